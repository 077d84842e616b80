"""Rendered images: position of the mannequin, shadow, cameras."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import swaying

from choreograph.core.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.motion.skinned_mesh import PARTS, build_mannequin
from choreograph.view.renderer import Camera, follow_camera, render_pose

SKELETON = canonical_skeleton()
FIGURE = build_mannequin(SKELETON)
STANDING_M = SKELETON.rest_pos_m()
STILL = np.tile(rot.IDENTITY, (24, 1))
FRONT = Camera(np.array([0.0, 1.0, 5.0]), np.array([0.0, 0.9, 0.0]))


def picture(pos_m=STANDING_M, camera=FRONT, size=(120, 120)):
    return render_pose(FIGURE, pos_m, STILL, camera, size=size)


def drawn(pixels, pos_m=STANDING_M, camera=FRONT):
    """Mask of the mannequin: pixels that change when it stands far away instead."""
    empty = picture(pos_m + np.array([1000.0, 0.0, 0.0]), camera, pixels.shape[1::-1])
    return np.abs(pixels.astype(int) - empty).max(axis=2) > 60


def test_shape_and_determinism():
    first = picture(size=(64, 48))
    assert first.shape == (48, 64, 3) and first.dtype == np.uint8
    assert np.array_equal(first, picture(size=(64, 48)))


def test_body_is_where_its_joints_project():
    mesh = drawn(picture())
    rows, columns = np.nonzero(mesh)
    focal = 0.5 * 120 / np.tan(FRONT.fov_rad / 2)
    top = 60 - focal * (FIGURE.vertices_m[:, 1].max() - 0.9) / 5.0
    assert abs(rows.min() - top) < 4
    assert abs(columns.mean() - 59.5) < 2  # in the middle
    half_span = focal * FIGURE.vertices_m[:, 0].max() / 5.0
    assert abs((columns.max() - columns.min()) / 2 - half_span) < 3


def test_left_appears_on_the_right_from_the_front():
    pixels = picture(size=(200, 200)).astype(float)
    warm = pixels[..., 0] - pixels[..., 2] > 40  # the colour of the left arm and leg
    cool = pixels[..., 2] - pixels[..., 0] > 40
    columns = np.arange(200)
    assert (warm.sum(axis=0) @ columns) / warm.sum() > 100 > (cool.sum(axis=0) @ columns) / cool.sum()
    assert FIGURE.palette[PARTS.index("left_arm")][0] > FIGURE.palette[PARTS.index("right_arm")][0]


def test_a_turned_camera_sees_the_back():
    behind = Camera(np.array([0.0, 1.0, -5.0]), np.array([0.0, 0.9, 0.0]))
    row = round(100 - 100 / np.tan(FRONT.fov_rad / 2) * (1.59 - 0.9) / 5.0)  # above the ears
    face, nape = (picture(camera=camera, size=(200, 200))[row, 100] for camera in (FRONT, behind))
    assert face.astype(int).sum() > nape.astype(int).sum() + 150  # skin before, dark hair behind


def test_feet_darken_the_floor_beneath_them():
    above = Camera(np.array([0.0, 3.0, 2.0]), np.array([0.0, 0.0, 0.15]))
    standing = picture(STANDING_M - [0, 0.015, 0], above, (200, 200)).astype(int)
    hovering = picture(STANDING_M + np.array([0, 5.0, 0]), above, (200, 200)).astype(int)
    beside = (standing.sum(axis=2) < hovering.sum(axis=2) - 30).sum()
    assert beside > 300


def test_mesh_out_of_view_leaves_the_stage_empty():
    away = Camera(np.array([0.0, 1.0, 5.0]), np.array([0.0, 1.0, 10.0]))
    assert picture(camera=away).std(axis=(0, 1)).max() < 60
    inside = Camera(np.array([0.0, 1.2, 0.02]), np.array([0.0, 1.2, 1.0]))  # eye in the chest
    assert picture(camera=inside).shape == (120, 120, 3)


@pytest.mark.parametrize("size", [(0, 10), (10, -1)])
def test_size_must_be_positive(size):
    with pytest.raises(ParameterError, match="at least 1 x 1"):
        picture(size=size)


def test_pose_of_another_skeleton_is_refused():
    with pytest.raises(ParameterError, match="as in the mesh"):
        picture(STANDING_M[:5])


@pytest.mark.parametrize(
    ("target", "fov", "message"), [((0, 9, 5), 0.5, "straight up"), ((0, 0, 0), 4.0, "field of view")]
)
def test_impossible_cameras(target, fov, message):
    with pytest.raises(ParameterError, match=message):
        Camera(np.array([0.0, 1.0, 5.0]), np.array(target, float), fov)


@pytest.mark.parametrize("front_rad", [0.0, 2.5])
@pytest.mark.parametrize("yaw_rad", [0.0, np.pi])
def test_camera_follows_and_stands_with_the_audience(front_rad, yaw_rad):
    motion = swaying(90, fps=30.0).moved(yaw_rad=yaw_rad, shift_m=np.array([3.0, 0.0, -2.0]))
    shots = follow_camera(motion, [0.0, 1.0, 2.0], aspect=1.0, front_rad=front_rad)
    assert np.allclose(shots.targets_m[:, [0, 2]], motion.root_pos_m[[0, 30, 60]][:, [0, 2]], atol=0.1)
    bearing = np.arctan2(shots.towards_eye_m[0], shots.towards_eye_m[2])
    assert 0.1 < bearing - front_rad < 0.3  # wherever the dancer faces
    narrow = follow_camera(motion, [0.0], aspect=0.3)
    assert np.linalg.norm(narrow.towards_eye_m) > 1.5 * np.linalg.norm(shots.towards_eye_m)


def test_smoothed_camera_ignores_shaking():
    motion = swaying(300, fps=30.0)
    shaken = motion.root_pos_m + 0.2 * np.sin(np.arange(300) * 2 * np.pi / 10)[:, None] * [1.0, 0.0, 0.0]
    shaken = type(motion)(motion.skeleton, shaken, motion.local_quat, 30.0)
    times = np.arange(30, 270) / 30
    unsmoothed, smoothed = (
        np.diff(follow_camera(shaken, times, aspect=1.0, smoothing_s=c).targets_m, axis=0) for c in (0.0, 0.7)
    )
    assert np.abs(smoothed).max() < 0.15 * np.abs(unsmoothed).max()


@pytest.mark.parametrize("times", [[], [-0.1], [1e9], [np.nan]])
def test_times_outside_the_motion_are_refused(times):
    with pytest.raises(ParameterError, match="time"):
        follow_camera(swaying(30), times, aspect=1.0)
