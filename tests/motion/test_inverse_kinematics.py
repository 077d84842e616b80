"""Two-bone IK keeps bone lengths, reaches reachable targets, and changes nothing at the target."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import two_bone

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


def _leg(flexion: float, sideways: float, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """A leg bent by `flexion` radians about its hinge and `sideways` across it; either may be negative."""
    a, b = rng.uniform(0.35, 0.5, 2)
    rotation = rot.from_rotvec(rng.normal(0, 1, 3))
    lower = rot.rotate(rot.from_rotvec(np.array([flexion, 0.0, sideways])), np.array([0.0, -1.0, 0.0]))
    middle = rot.rotate(rotation, np.array([0.0, -a, 0.0]))
    return np.zeros(3), middle, middle + rot.rotate(rotation, b * lower), rot.rotate(rotation, HINGE)


FLEXIONS = st.floats(-0.3, 2.5)
SIDEWAYS = st.floats(-0.2, 0.2)


@given(SEEDS, FLEXIONS, SIDEWAYS)
def test_any_leg_at_its_target_stays(seed, flexion, sideways):
    start, middle, end, hinge = _leg(flexion, sideways, np.random.default_rng(seed))
    knee, ankle = _moved(start, middle, end, end, hinge)
    assert np.allclose(knee, middle, atol=1e-5)
    assert np.allclose(ankle, end, atol=1e-5)


@given(SEEDS, FLEXIONS, SIDEWAYS, st.floats(0.05, 0.98))
def test_any_leg_keeps_its_lengths_and_reaches_what_is_well_within_reach(seed, flexion, sideways, share):
    rng = np.random.default_rng(seed)
    start, middle, end, hinge = _leg(flexion, sideways, rng)
    a, b = np.linalg.norm(middle), np.linalg.norm(end - middle)
    away = rng.normal(size=3)
    target = away / np.linalg.norm(away) * (abs(a - b) + share * (0.97 * (a + b) - abs(a - b)))
    knee, ankle = _moved(start, middle, end, target, hinge)
    assert np.isclose(np.linalg.norm(knee), a)
    assert np.isclose(np.linalg.norm(ankle - knee), b)
    missed_m = np.linalg.norm(ankle - target)
    assert missed_m < (1e-5 if flexion > 0 else 0.3 * (flexion**2 + sideways**2) + 1e-5)


@given(SEEDS, st.floats(0.0, 0.3), st.floats(0.85, 0.97))
def test_a_leg_bent_the_wrong_way_folds_the_right_way(seed, wrong, share):
    rng = np.random.default_rng(seed)
    start, middle, end, hinge = _leg(-wrong, 0.0, rng)
    target = share * end / np.linalg.norm(end) * (np.linalg.norm(middle) + np.linalg.norm(end - middle))
    knee, ankle = _moved(start, middle, end, target, hinge)
    assert np.cross(knee, ankle - knee) @ hinge > 0 or np.linalg.norm(target) > np.linalg.norm(end) - 0.02


@given(SEEDS, FLEXIONS, SIDEWAYS, st.floats(-0.1, 0.1))
def test_neighbouring_legs_and_targets_have_neighbouring_knees(seed, flexion, sideways, shorter):
    """Near straight a knee moves as the square root of what its ankle does: 5 mm for 1e-6 m."""
    start, middle, end, hinge = _leg(flexion, sideways, np.random.default_rng(seed))
    other = _leg(flexion - 1e-6, sideways + 1e-6, np.random.default_rng(seed))
    out = end / np.linalg.norm(end)
    knee, _ = _moved(start, middle, end, end - shorter * out, hinge)
    near, _ = _moved(start, middle, end, end - (shorter + 1e-6) * out, hinge)
    assert np.linalg.norm(near - knee) < 5e-3
    near, _ = _moved(*other[:3], other[2] - shorter * out, other[3])
    assert np.linalg.norm(near - knee) < 5e-3


def test_a_leg_that_swings_through_straight_keeps_its_knee_on_its_path():
    for shorter in (0.0, 0.001, 0.01, 0.03):
        knees = []
        for flexion in np.linspace(0.25, -0.12, 60):
            start, middle, end, hinge = _leg(flexion, 0.02, np.random.default_rng(4))
            knees.append(_moved(start, middle, end, end * (1 - shorter / np.linalg.norm(end)), hinge)[0])
        bend_m = np.linalg.norm(np.diff(knees, n=2, axis=0), axis=-1)
        assert bend_m.max() < 0.01
