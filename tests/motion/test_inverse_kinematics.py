"""Two-bone IK keeps bone lengths, reaches reachable targets, and changes nothing at the target."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from choreograph.motion import rotations as rot
from choreograph.motion.inverse_kinematics import two_bone

HINGE = np.array([1.0, 0.0, 0.0])
SEEDS = st.integers(0, 2**32 - 1)


def _limb(rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """A bent leg anywhere, its hinge, and its lengths."""
    lengths = rng.uniform(0.3, 0.6, 2)
    bend = rng.uniform(0.3, 2.2)
    upper = np.array([0.0, -1.0, 0.0]) * lengths[0]
    lower = rot.rotate(rot.from_rotvec(HINGE * bend), np.array([0.0, -1.0, 0.0])) * lengths[1]
    rotation = rot.from_rotvec(rng.normal(0, 1, 3))
    start = rng.normal(0, 1, 3)
    middle = start + rot.rotate(rotation, upper)
    return start, middle, middle + rot.rotate(rotation, lower), rot.rotate(rotation, HINGE), lengths


def _moved(start, middle, end, target, hinge):
    upper, lower = two_bone(start, middle, end, target, hinge)
    knee = start + rot.rotate(upper, middle - start)
    return knee, knee + rot.rotate(lower, end - middle)


@given(SEEDS, st.floats(0.0, 1.0))
def test_reachable_targets_are_hit_and_bones_keep_their_lengths(seed, share):
    rng = np.random.default_rng(seed)
    start, middle, end, hinge, (a, b) = _limb(rng)
    near, far = abs(a - b) + 0.01, 0.97 * (a + b)
    away = rng.normal(size=3)
    target = start + away / np.linalg.norm(away) * (near + share * (far - near))
    knee, ankle = _moved(start, middle, end, target, hinge)
    assert np.allclose(ankle, target, atol=1e-6)
    assert np.isclose(np.linalg.norm(knee - start), a)
    assert np.isclose(np.linalg.norm(ankle - knee), b)


@given(SEEDS, st.floats(1.0, 5.0))
def test_targets_out_of_reach_are_pointed_at(seed, beyond):
    rng = np.random.default_rng(seed)
    start, middle, end, hinge, (a, b) = _limb(rng)
    away = rng.normal(size=3)
    target = start + away / np.linalg.norm(away) * beyond * (a + b)
    knee, ankle = _moved(start, middle, end, target, hinge)
    reached = np.linalg.norm(ankle - start)
    assert 0.97 * (a + b) < reached < a + b
    assert np.allclose(
        (ankle - start) / reached, (target - start) / np.linalg.norm(target - start), atol=1e-6
    )
    assert np.isclose(np.linalg.norm(ankle - knee), b)


@given(SEEDS)
def test_a_target_already_reached_changes_nothing(seed):
    start, middle, end, hinge, _ = _limb(np.random.default_rng(seed))
    knee, ankle = _moved(start, middle, end, end, hinge)
    assert np.allclose(knee, middle, atol=1e-6)
    assert np.allclose(ankle, end, atol=1e-6)


@given(SEEDS)
def test_a_small_displacement_is_a_small_rotation(seed):
    rng = np.random.default_rng(seed)
    start, middle, end, hinge, (a, b) = _limb(rng)
    if np.linalg.norm(end - start) > 0.95 * (a + b):
        return
    knee, _ = _moved(start, middle, end, end + rng.normal(0, 1e-4, 3), hinge)
    assert np.linalg.norm(knee - middle) < 5e-3


def test_a_batch_gives_the_same_as_each_frame_alone():
    rng = np.random.default_rng(1)
    limbs = [_limb(rng)[:4] for _ in range(8)]
    start, middle, end, hinge = (np.stack(column) for column in zip(*limbs, strict=True))
    target = end + rng.normal(0, 0.05, end.shape)
    together = two_bone(start, middle, end, target, hinge)
    for row in range(8):
        alone = two_bone(start[row], middle[row], end[row], target[row], hinge[row])
        assert np.allclose(together[0][row], alone[0])
        assert np.allclose(together[1][row], alone[1])
