"""Fréchet distances against formulas; poses do not depend on position, heading, rate or extra joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from golden.regenerate import frechet_scores, golden
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import sqrtm

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import frechet
from choreograph.formats.register import import_takes
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton, canonical_skeleton

RNG = np.random.default_rng(0)


def _dance(seed: int, n_frames: int = 80, fps: float = 20.0, mean: float = 0.0) -> Motion:
    """Every joint swings smoothly in its own way about a rotation of `mean` radians."""
    rng = np.random.default_rng(seed)
    times_s = np.arange(n_frames) / fps
    phase, pace, size = (
        rng.uniform(0, 6, (24, 3)),
        rng.uniform(1, 4, (24, 3)),
        rng.uniform(0.05, 0.4, (24, 3)),
    )
    quat = rot.from_rotvec(mean + size * np.sin(pace * times_s[:, None, None] + phase))  # (T, 24, 4)
    skeleton = canonical_skeleton()
    return Motion(skeleton, np.tile(skeleton.offsets_m[0], (n_frames, 1)), rot.make_continuous(quat), fps)


def _gaussian(mean, covariance) -> frechet.Gaussian:
    return frechet.Gaussian(np.asarray(mean, float), np.asarray(covariance, float), 100)


@given(
    a=st.lists(st.floats(0, 9), min_size=3, max_size=3),
    b=st.lists(st.floats(0, 9), min_size=3, max_size=3),
    gap=st.lists(st.floats(-5, 5), min_size=3, max_size=3),
)
def test_independent_dimensions_add_up(a, b, gap):
    """For diagonal Gaussians the distance is Σ (m - m')² + (s - s')², zero standard deviations included."""
    wanted = np.sum(np.square(gap)) + np.sum((np.array(a) - b) ** 2)
    got = frechet.frechet_distance(
        _gaussian(gap, np.diag(np.square(a))), _gaussian([0, 0, 0], np.diag(np.square(b)))
    )
    assert got == pytest.approx(wanted, abs=1e-9)


def test_agrees_with_the_matrix_square_root_where_that_works():
    a, b = (
        frechet.fit_gaussian(RNG.normal(0, 1, (400, 12)) @ RNG.normal(0, 1, (12, 12)) + shift)
        for shift in (0, 1)
    )
    root = sqrtm(a.covariance @ b.covariance).real
    wanted = np.sum((a.mean - b.mean) ** 2) + np.trace(a.covariance + b.covariance - 2 * root)
    assert frechet.frechet_distance(a, b) == pytest.approx(wanted, rel=1e-9)
    assert frechet.frechet_distance(b, a) == pytest.approx(wanted, rel=1e-9)


@given(seed=st.integers(0, 50), n_samples=st.integers(2, 30))
def test_few_samples_in_many_dimensions(seed, n_samples):
    """Covariances of rank 1 … 29 in 40 dimensions: zero to itself, and rotating both changes nothing."""
    rng = np.random.default_rng(seed)
    a, b = rng.normal(0, 1, (n_samples, 40)), rng.normal(0.5, 2, (n_samples, 40))
    one, other = frechet.fit_gaussian(a), frechet.fit_gaussian(b)
    assert frechet.frechet_distance(one, one) == pytest.approx(0, abs=1e-9)
    rotation = np.linalg.qr(rng.normal(0, 1, (40, 40)))[0]
    rotated = (frechet.fit_gaussian(side @ rotation) for side in (a, b))
    assert frechet.frechet_distance(*rotated) == pytest.approx(frechet.frechet_distance(one, other), rel=1e-8)


def test_malformed_samples_are_refused():
    for samples in (np.zeros((1, 3)), np.zeros(3), np.zeros((4, 0)), np.array([[0.0], [np.nan]])):
        with pytest.raises(ParameterError):
            frechet.fit_gaussian(samples)
    with pytest.raises(ParameterError, match="one dimension"):
        frechet.frechet_distance(_gaussian([0], [[1]]), _gaussian([0, 0], np.eye(2)))


def test_the_distance_of_a_set_to_itself_is_zero():
    scores = frechet.evaluate([_dance(1), _dance(2)], [_dance(2), _dance(1)])
    assert scores["fpd"] == pytest.approx(0, abs=1e-9)
    assert scores["fmd"] == pytest.approx(0, abs=1e-9)


@given(angle=st.floats(-1.5, 1.5))
def test_one_bent_elbow_is_its_angle_squared(angle):
    """All poses of one side bend the elbow by a constant angle: FPD is angle², FMD three times that."""
    still = frechet.still(_dance(3), np.random.default_rng(0))
    straight, bent = np.array(still.local_quat), np.array(still.local_quat)
    elbow = still.skeleton.index("left_elbow")
    straight[:, elbow] = rot.IDENTITY
    bent[:, elbow] = rot.from_rotvec(np.array([0.0, angle, 0.0]))
    scores = frechet.evaluate([replace(still, local_quat=bent)], [replace(still, local_quat=straight)])
    assert scores["fpd"] == pytest.approx(angle**2, abs=1e-9)
    assert scores["fmd"] == pytest.approx(3 * angle**2, abs=1e-9)


@given(yaw=st.floats(-3.1, 3.1), x=st.floats(-5, 5))
def test_position_and_heading_do_not_matter_but_lean_does(yaw, x):
    dance = _dance(4)
    moved = dance.moved(yaw_rad=yaw, shift_m=np.array([x, 0.0, -x]))
    roles = frechet.validate([dance])
    assert np.allclose(frechet.poses_rad(moved, roles), frechet.poses_rad(dance, roles), atol=1e-9)
    lean = np.array(dance.local_quat)
    lean[:, 0] = rot.multiply(rot.from_rotvec(np.array([0.5, 0.0, 0.0])), lean[:, 0])
    seen = frechet.poses_rad(replace(dance, local_quat=lean), roles) - frechet.poses_rad(dance, roles)
    assert np.abs(seen[:, :3]).max() > 0.3 and np.abs(seen[:, 3:]).max() < 1e-9


def test_the_rate_of_a_dance_hardly_matters():
    slow, fast = _dance(5, 400, 20.0), _dance(5, 1200, 60.0)
    assert frechet.fpd([fast], [slow]) < 1e-4
    assert frechet.fmd([fast], [slow]) < 1e-4


def test_extra_joints_between_and_missing_ones_do_no_harm():
    """A rig without hands, with a twist joint in the forearm that takes half of the wrist's rotation."""
    dance = _dance(6)
    canonical = canonical_skeleton()
    names = [name for name in canonical.names if not name.endswith("hand")]
    kept = [canonical.index(name) for name in names]
    offsets, quat = canonical.offsets_m[kept], dance.local_quat[:, kept]
    parents = [names.index(canonical.names[p]) if p >= 0 else -1 for p in canonical.parents[kept]]
    wrist, elbow = names.index("left_wrist"), names.index("left_elbow")
    half = rot.slerp(np.broadcast_to(rot.IDENTITY, quat[:, wrist].shape), quat[:, wrist], 0.5)
    order = [*range(wrist), len(names), *range(wrist, len(names))]  # the twist joint before its wrist
    names = [*names, "ForearmTwistExtra"]
    quat = np.concatenate([quat, half[:, None]], axis=1)
    quat[:, wrist] = rot.multiply(rot.invert(half), quat[:, wrist])
    parents = [*parents, elbow]
    parents[wrist] = len(names) - 1
    where = {old: new for new, old in enumerate(order)}
    skeleton = Skeleton(
        tuple(names[i] for i in order),
        np.array([where[parents[i]] if parents[i] >= 0 else -1 for i in order]),
        np.concatenate([offsets, [[0.1, 0.0, 0.0]]])[order],
    )
    rig = Motion(skeleton, dance.root_pos_m, quat[:, order], dance.fps)
    roles = frechet.validate([dance, rig])
    assert set(canonical.names) - set(roles) == {"left_hand", "right_hand"}
    assert np.allclose(frechet.poses_rad(dance, roles), frechet.poses_rad(rig, roles), atol=1e-9)
    assert frechet.fpd([rig], [dance]) == pytest.approx(0, abs=1e-9)


def test_movements_depend_on_order_and_poses_do_not():
    dance = _dance(7, 600)
    mixed = frechet.shuffled_frames(dance, np.random.default_rng(0))
    assert frechet.fpd([mixed], [dance]) == pytest.approx(0, abs=1e-9)
    assert frechet.fmd([mixed], [dance]) > 0.5


def test_movements_do_not_span_two_dances():
    roles = frechet.validate([_dance(8)])
    assert frechet.movements_of(np.arange(8.0).reshape(4, 2)).tolist() == [
        [0, 1, 2, 3, 4, 5],
        [2, 3, 4, 5, 6, 7],
    ]
    assert frechet.movements_of(np.zeros((2, 5))).shape == (0, 15)
    both = frechet.gaussians([_dance(8, 10), _dance(9, 20), _dance(9, 2)], roles)
    assert (both["fpd"].n_samples, both["fmd"].n_samples) == (32, 8 + 18)


def test_refuses_empty_sets_short_dances_and_other_rest_poses():
    dance = _dance(9)
    for dances, real in (([], [dance]), ([dance], []), ([_dance(9, 3)], [_dance(9, 3)])):
        with pytest.raises(ParameterError, match=r"at least"):
            frechet.evaluate(dances, real)
    hanging = np.array(canonical_skeleton().offsets_m)
    for name, side in (("left_elbow", 1), ("right_elbow", -1)):
        hanging[canonical_skeleton().index(name)] = [0.1 * side, -0.2, 0.0]
    other = replace(dance, skeleton=replace(canonical_skeleton(), offsets_m=hanging))
    with pytest.raises(ParameterError, match=r"left_shoulder 63° apart: retarget"):
        frechet.fpd([dance], [other])


def test_golden():
    assert frechet_scores() == pytest.approx(golden("frechet"), rel=1e-6)


def test_real_dances_are_closer_to_each_other_than_chance(shared_data):
    folders = [shared_data / "dance-with-melody" / f"DANCE_{name}" for name in ("C_2", "C_4", "W_12", "W_22")]
    motions = [take.motion.sliced(0, 700) for folder in folders for take in import_takes(folder)]
    one, other = [motions[0], motions[2]], [motions[1], motions[3]]
    real = frechet.evaluate(one, other)
    rng = np.random.default_rng(0)
    mixed = frechet.evaluate([frechet.shuffled_joints(m, rng) for m in one], other)
    assert mixed["fpd"] > 2 * real["fpd"] and mixed["fmd"] > 2 * real["fmd"]


def _random_motion(seed: int = 0, n_frames: int = 40) -> Motion:
    rng = np.random.default_rng(seed)
    quat = rot.from_rotvec(rng.normal(0, 0.3, (n_frames, 24, 3)))
    return Motion(canonical_skeleton(), rng.normal(0, 1, (n_frames, 3)), rot.make_continuous(quat), 20.0)


@given(groups=st.lists(st.sampled_from("abcdefg"), min_size=2, max_size=40), seed=st.integers(0, 99))
def test_halves_split_the_items_and_no_group(groups, seed):
    if len(set(groups)) < 2:
        with pytest.raises(ParameterError, match="2 groups"):
            frechet.halves(groups, np.random.default_rng(seed))
        return
    one, other = frechet.halves(groups, np.random.default_rng(seed))
    assert sorted([*one, *other]) == list(range(len(groups)))
    assert not {groups[i] for i in one} & {groups[i] for i in other}
    assert len(one) and len(other)
    largest = max(groups.count(group) for group in groups)
    assert abs(len(one) - len(other)) <= largest


def test_still_freezes_one_of_the_poses():
    motion = _random_motion()
    frozen = frechet.still(motion, np.random.default_rng(1))
    assert frozen.n_frames == motion.n_frames
    assert np.ptp(frozen.joint_pos_m(), axis=0).max() < 1e-12
    assert np.abs(motion.joint_pos_m() - frozen.joint_pos_m()[0]).max(axis=(1, 2)).min() < 1e-9


def test_shuffled_joints_keep_the_root_and_the_set_of_rotations():
    motion = _random_motion()
    mixed = frechet.shuffled_joints(motion, np.random.default_rng(1))
    assert np.array_equal(mixed.local_quat[:, 0], motion.local_quat[:, 0])
    assert not np.allclose(mixed.local_quat, motion.local_quat)
    for frame in (0, 20):
        assert np.allclose(np.sort(mixed.local_quat[frame], 0), np.sort(motion.local_quat[frame], 0))


def test_shuffled_frames_keep_the_set_of_poses():
    motion = _random_motion()
    mixed = frechet.shuffled_frames(motion, np.random.default_rng(1))
    assert np.array_equal(mixed.root_pos_m, motion.root_pos_m)
    poses = [np.sort(np.abs(m.local_quat.reshape(m.n_frames, -1)).sum(axis=1)) for m in (motion, mixed)]
    assert np.allclose(poses[0], poses[1])
    assert not np.allclose(mixed.local_quat, motion.local_quat)


def test_chance_motions_keep_their_length():
    for chance in frechet.CHANCE.values():
        assert chance(_random_motion(), np.random.default_rng(0)).duration_s == _random_motion().duration_s
