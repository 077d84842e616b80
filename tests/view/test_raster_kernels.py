"""Raster kernels against synthetic triangles and calculations by hand."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.view import raster_kernels as raster

F32 = np.float32


def rasterised(corners, triangles=((0, 1, 2),), shape=(12, 16)):
    """Owners and nearness of triangles whose `corners` are (x, y, nearness)."""
    nearness, owners = np.zeros(shape, F32), np.full(shape, raster.NOTHING, np.int32)
    raster.rasterise(np.array(corners, F32), np.array(triangles, np.int32), nearness, owners)
    return owners, nearness


def test_a_synthetic_triangle_covers_the_samples_inside_it():
    # Counter-clockwise with y up: (1, 1), (1, 9), (9, 1) on a screen whose y grows down.
    owners, _ = rasterised([(1, 1, 1), (1, 9, 1), (9, 1, 1)])
    rows, columns = np.mgrid[:12, :16] + 0.5
    inside = (columns > 1) & (rows > 1) & (columns + rows < 10)
    edge = np.isclose(columns + rows, 10)
    assert np.array_equal((owners == 0)[~edge], inside[~edge])


def test_back_faces_and_triangles_behind_the_camera_are_not_drawn():
    assert (rasterised([(1, 1, 1), (9, 1, 1), (1, 9, 1)])[0] == raster.NOTHING).all()
    assert (rasterised([(1, 1, 0), (1, 9, 1), (9, 1, 1)])[0] == raster.NOTHING).all()


def test_the_nearer_triangle_wins_whatever_the_order():
    corners = [(1, 1, 1), (1, 9, 1), (9, 1, 1), (1, 1, 2), (1, 9, 2), (9, 1, 2)]
    for triangles, winner in ((((0, 1, 2), (3, 4, 5)), 1), (((3, 4, 5), (0, 1, 2)), 0)):
        owners, nearness = rasterised(corners, triangles)
        assert set(np.unique(owners)) == {raster.NOTHING, winner}
        assert np.allclose(nearness[owners == winner], 2.0)


def test_crossing_triangles_are_split_at_their_intersection():
    # One slopes from 1 to 3 along x, the other stays at 2.
    corners = [(0, 0, 1), (0, 12, 1), (16, 0, 3), (16, 12, 3), (0, 0, 2), (0, 12, 2), (16, 0, 2), (16, 12, 2)]
    owners, _ = rasterised(corners, ((0, 1, 2), (2, 1, 3), (4, 5, 6), (6, 5, 7)))
    assert (owners[:, :7] >= 2).all() and (owners[:, 9:] <= 1).all() and (owners != raster.NOTHING).all()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.floats(-30, 40), st.floats(-30, 40)), min_size=4, max_size=4))
def test_triangles_that_share_an_edge_leave_no_gap_and_stay_on_the_screen(points):
    a, b, c, d = ((*point, 1.0) for point in points)
    shape = (12, 16)
    both = [(0, 1, 2), (2, 1, 0), (0, 2, 3), (3, 2, 0)]
    owners, _ = rasterised([a, b, c, d], both, shape)
    single = [rasterised([a, b, c, d], [t], shape)[0] >= 0 for t in both]
    assert np.array_equal(owners >= 0, np.any(single, axis=0))


def test_pinhole_projection():
    view = np.hstack([np.eye(3), [[0], [0], [5.0]]]).astype(F32)  # 5 m in front
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5], [0, 0, -6]], F32)
    screen = raster.project(points, view, F32(100), F32(50), F32(40))
    assert np.allclose(screen[0], [50, 40, 0.2])
    assert np.allclose(screen[1], [70, 40, 0.2]) and np.allclose(screen[2], [50, 20, 0.2])
    assert np.allclose(screen[3], [50, 40, 0.1]) and (screen[4] == 0).all()


def test_skinning_by_hand():
    turn = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], F32)  # +Z to +X
    matrices = np.stack([np.hstack([np.eye(3), [[1], [2], [3]]]), np.hstack([turn, np.zeros((3, 1))])])
    vertices = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1]], F32)
    weights = np.array([[1, 0], [0, 1], [0.5, 0.5]], F32)
    joints = np.tile(np.array([0, 1], np.int32), (3, 1))
    placed, turned = raster.skin(vertices, vertices, joints, weights, matrices.astype(F32))
    assert np.allclose(placed, [[1, 2, 4], [1, 0, 0], [1, 1, 2]])
    assert np.allclose(turned, [[0, 0, 1], [1, 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5)]], atol=1e-6)


def test_shadow_falls_where_the_triangle_is_and_fades_with_height():
    triangle = np.array([[0, 1, 2]], np.int32)
    for height, expected in ((0.0, 1.0), (0.5, 0.5), (1.0, 0.0)):
        points = np.array([[2, height, 2], [8, height, 2], [2, height, 8]], F32)
        cover = np.zeros((12, 12), F32)
        raster.flatten_onto_floor(points, triangle, np.zeros(2, F32), np.zeros(2, F32), F32(1), F32(1), cover)
        assert np.isclose(cover[3, 3], expected) and cover[8, 8] == 0
    points[:, 1] = 0.5
    slanted = np.zeros((12, 12), F32)
    raster.flatten_onto_floor(
        points, triangle, np.array([4, 0], F32), np.zeros(2, F32), F32(1), F32(1), slanted
    )
    assert slanted[3, 3] == 0 and np.isclose(slanted[3, 5], 0.5)


def test_blur_keeps_the_light_and_spreads_it_evenly():
    image = np.zeros((31, 31), F32)
    image[15, 15] = 1.0
    blurred = raster.blur(image, 2, 3)
    assert np.isclose(blurred.sum(), 1.0, atol=1e-5)
    assert np.allclose(blurred, blurred.T, atol=1e-7) and np.allclose(blurred, blurred[::-1, ::-1], atol=1e-7)
    assert blurred.max() == blurred[15, 15] and blurred[15, 9] > 0 == blurred[15, 8]
    assert raster.blur(image, 0, 1)[15, 15] == 1.0
