"""Raster kernels against synthetic triangles and calculations by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.view import render_kernels as kernels
from choreograph.view.renderer import blurred, floor_cover, projected, skinned

F32 = np.float32


def rasterised(corners, triangles=((0, 1, 2),), shape=(12, 16)):
    """Owners and nearness of triangles whose `corners` are (x, y, nearness)."""
    nearness, owners = np.zeros(shape, F32), np.full(shape, kernels.NOTHING, np.int32)
    kernels.rasterise(np.array(corners, F32), np.array(triangles, np.int32), nearness, owners)
    return owners, nearness


def test_a_synthetic_triangle_covers_the_samples_inside_it():
    # Counter-clockwise with y up: (1, 1), (1, 9), (9, 1) on a screen whose y grows down.
    owners, _ = rasterised([(1, 1, 1), (1, 9, 1), (9, 1, 1)])
    rows, columns = np.mgrid[:12, :16] + 0.5
    inside = (columns > 1) & (rows > 1) & (columns + rows < 10)
    edge = np.isclose(columns + rows, 10)
    assert np.array_equal((owners == 0)[~edge], inside[~edge])


def test_back_faces_and_triangles_behind_the_camera_are_not_drawn():
    assert (rasterised([(1, 1, 1), (9, 1, 1), (1, 9, 1)])[0] == kernels.NOTHING).all()
    assert (rasterised([(1, 1, 0), (1, 9, 1), (9, 1, 1)])[0] == kernels.NOTHING).all()


def test_the_nearer_triangle_wins_whatever_the_order():
    corners = [(1, 1, 1), (1, 9, 1), (9, 1, 1), (1, 1, 2), (1, 9, 2), (9, 1, 2)]
    for triangles, winner in ((((0, 1, 2), (3, 4, 5)), 1), (((3, 4, 5), (0, 1, 2)), 0)):
        owners, nearness = rasterised(corners, triangles)
        assert set(np.unique(owners)) == {kernels.NOTHING, winner}
        assert np.allclose(nearness[owners == winner], 2.0)


def test_crossing_triangles_are_split_at_their_intersection():
    # One slopes from 1 to 3 along x, the other stays at 2.
    corners = [(0, 0, 1), (0, 12, 1), (16, 0, 3), (16, 12, 3), (0, 0, 2), (0, 12, 2), (16, 0, 2), (16, 12, 2)]
    owners, _ = rasterised(corners, ((0, 1, 2), (2, 1, 3), (4, 5, 6), (6, 5, 7)))
    assert (owners[:, :7] >= 2).all() and (owners[:, 9:] <= 1).all() and (owners != kernels.NOTHING).all()


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
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5], [0, 0, -6]], F32)
    screen = projected(
        points, np.array([0, 0, -5], F32), np.eye(3, dtype=F32), F32(100), (100, 80)
    )  # 5 m away
    assert np.allclose(screen[0], [50, 40, 0.2])
    assert np.allclose(screen[1], [70, 40, 0.2]) and np.allclose(screen[2], [50, 20, 0.2])
    assert np.allclose(screen[3], [50, 40, 0.1]) and (screen[4] == 0).all()


def test_skinning_by_hand():
    turn = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], F32)  # +Z to +X
    matrices = np.stack([np.hstack([np.eye(3), [[1], [2], [3]]]), np.hstack([turn, np.zeros((3, 1))])])
    vertices = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1]], F32)
    weights = np.array([[1, 0], [0, 1], [0.5, 0.5]], F32)
    joints = np.tile(np.array([0, 1], np.int32), (3, 1))
    mesh = SimpleNamespace(vertices_m=vertices, normals=vertices, joints=joints, weights=weights)
    placed, turned = skinned(mesh, matrices.astype(F32))
    assert np.allclose(placed, [[1, 2, 4], [1, 0, 0], [1, 1, 2]])
    assert np.allclose(turned, [[0, 0, 1], [1, 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5)]], atol=1e-6)


def test_shadow_falls_where_the_triangle_is_and_fades_with_height():
    triangle = np.array([[0, 2, 1]], np.int32)
    corners = np.array([[2, 0, 2], [8, 0, 2], [2, 0, 8]], F32) * kernels.TEXEL_M
    for height_m, expected in ((0.0, 1.0), (0.5, 0.5), (1.0, 0.0)):
        cover = floor_cover(corners + F32([0, height_m, 0]), triangle, np.zeros(2), np.zeros(2, F32), 1.0)
        assert np.isclose(cover[3, 3], expected) and cover[8, 8] == 0
    raised, slant = corners + F32([0, 0.5, 0]), np.array([4 * kernels.TEXEL_M, 0])
    slanted = floor_cover(raised, triangle, slant, np.zeros(2, F32), 1.0)
    assert slanted[3, 3] == 0 and np.isclose(slanted[3, 5], 0.5)


def test_blur_keeps_the_light_and_spreads_it_evenly():
    image = np.zeros((31, 31), F32)
    image[15, 15] = 1.0
    spread = blurred(image, 5)
    assert np.isclose(spread.sum(), 1.0, atol=1e-5)
    assert np.allclose(spread, spread.T, atol=1e-7) and np.allclose(spread, spread[::-1, ::-1], atol=1e-7)
    assert spread.max() == spread[15, 15] and spread[15, 9] > 1e-5 and np.isclose(spread[15, 8], 0, atol=1e-7)
    assert blurred(image, 1)[15, 15] == 1.0
