"""Marker fitting, floor estimation and body size on synthetic motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.cleaning import bridge_flips, smoothed_angle
from choreograph.motion.contacts import estimate_floor_m, track_floor_m
from choreograph.motion.kinematics import forward, two_bone
from choreograph.motion.marker_fitting import REQUIRED_ROLES, fit_error_m, fit_positions, resized, size_ratio
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton


def _synthetic(rng: np.random.Generator, n_frames: int = 60):
    skeleton = canonical_skeleton()
    rotvec = np.zeros((n_frames, 24, 3))
    wave = np.sin(np.linspace(0, 6, n_frames))
    for name in ("left_hip", "right_hip", "left_shoulder", "right_shoulder", "spine1"):
        rotvec[:, CANONICAL_JOINTS.index(name)] = wave[:, None] * rng.uniform(-0.4, 0.4, 3)
    for name in ("left_knee", "right_knee"):
        rotvec[:, CANONICAL_JOINTS.index(name), 0] = 0.6 + 0.4 * wave
    rotvec[:, 0, 1] = np.linspace(0, 5, n_frames)
    root = np.stack([wave, np.full(n_frames, 0.9), wave], axis=-1)
    return skeleton, root, rot.from_rotvec(rotvec)


def test_synthetic_motion_comes_back_without_flips():
    skeleton, root, quat = _synthetic(np.random.default_rng(0))
    pos, _ = forward(skeleton, root, quat)
    found_root, found = fit_positions(skeleton, pos, CANONICAL_JOINTS, fps=25)
    assert fit_error_m(skeleton, found_root, found, pos, CANONICAL_JOINTS).mean() < 0.01
    assert np.degrees(2 * np.arccos(np.clip(np.sum(found[1:] * found[:-1], -1), -1, 1))).max() < 60


def test_a_flip_of_a_few_frames_is_bridged():
    bend = rot.from_rotvec(np.linspace(0.0, 0.5, 60)[:, None, None] * [[1.0, 0.0, 0.0]])  # (T, 1, 4)
    flipped = bend.copy()
    flipped[30:32] = rot.multiply(bend[30:32], rot.from_rotvec(np.array([0.0, 3.0, 0.0])))
    np.testing.assert_allclose(bridge_flips(flipped, 4), bend, atol=1e-9)


def test_an_angle_without_weight_is_interpolated():
    angle = np.linspace(0.0, 0.4, 50)
    weight = np.ones(50)
    weight[20:30] = 0.0
    noise = np.where(weight > 0, 0.0, 2.0)
    found = smoothed_angle(weight * np.cos(angle + noise), weight * np.sin(angle + noise), 0.1)
    np.testing.assert_allclose(found, angle, atol=0.01)


def test_missing_role_and_nan_are_refused():
    skeleton = canonical_skeleton()
    with pytest.raises(ParameterError, match="left_hip"):
        fit_positions(skeleton, np.zeros((5, 1, 3)), ["pelvis"], fps=25)
    with pytest.raises(ParameterError, match="finite"):
        fit_positions(skeleton, np.full((5, len(REQUIRED_ROLES), 3), np.nan), REQUIRED_ROLES, fps=25)


def test_floor_survives_jumps_noise_and_drift():
    rng = np.random.default_rng(1)
    time = np.arange(1000) / 25
    feet = np.zeros((1000, 2, 3))
    feet[..., 1] = (
        0.3 + np.maximum(0, np.sin(time * 3))[:, None] * [0.2, 0.1] + rng.normal(0, 0.003, (1000, 2))
    )
    assert abs(estimate_floor_m(feet) - 0.3) < 0.01
    feet[..., 1] += 0.01 * time[:, None]
    assert np.abs(track_floor_m(feet, 25) - 0.3 - 0.01 * time).max() < 0.03


def test_two_bone_reaches_and_keeps_still_limbs():
    rng = np.random.default_rng(2)
    hip, knee, ankle = np.array([0, 1.0, 0]), np.array([0, 0.55, 0.1]), np.array([0, 0.12, 0.0])
    for target in (ankle, ankle + rng.uniform(-0.1, 0.1, 3) + [0, 0.1, 0]):
        upper, lower = two_bone(hip, knee, ankle, target, np.array([1.0, 0, 0]))
        new_knee = hip + rot.rotate(upper, knee - hip)
        assert np.allclose(new_knee + rot.rotate(lower, ankle - knee), target, atol=1e-6)
        assert new_knee[2] > 0.5 * target[2]
    upper, lower = two_bone(hip, knee, ankle, np.array([0, -2.0, 0]), np.array([1.0, 0, 0]))
    assert np.isfinite(upper).all()
    assert np.isfinite(lower).all()


@pytest.mark.parametrize("size", [0.8, 1.0, 1.25])
def test_the_size_of_a_scaled_body_is_found(size):
    canonical = canonical_skeleton()
    assert size_ratio(replace(canonical, offsets_m=canonical.offsets_m / size), canonical) == pytest.approx(
        size
    )


def test_resizing_keeps_the_floor_and_feet_at_rest():
    rng = np.random.default_rng(3)
    pos_m = rng.uniform(0.4, 2.0, (50, 6, 3))
    pos_m[:, 0] = [2.0, 0.4, -1.0]  # a foot on the floor
    small = resized(pos_m, np.full(50, 0.8), 0.4)
    assert np.allclose(np.ptp(small[:, 0], axis=0), 0.0)
    assert np.allclose(small[:, 0, 1], 0.4)
    assert np.allclose(_distances(small), 0.8 * _distances(pos_m))
    walking = pos_m + np.linspace(0, 3, 50)[:, None, None] * [1.0, 0.0, 0.5]
    steps = np.diff(resized(walking, np.full(50, 0.8), 0.4)[:, 0], axis=0)
    assert np.allclose(steps, 0.8 * np.diff(walking[:, 0], axis=0))


def _distances(pos_m: np.ndarray) -> np.ndarray:
    return np.linalg.norm(pos_m[:, :, None] - pos_m[:, None], axis=-1)
