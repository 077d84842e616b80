"""Halves never split a group; chance dances keep and lose what they should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import references
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton


def _motion(seed: int = 0, n_frames: int = 40) -> Motion:
    rng = np.random.default_rng(seed)
    quat = rot.from_rotvec(rng.normal(0, 0.3, (n_frames, 24, 3)))
    return Motion(canonical_skeleton(), rng.normal(0, 1, (n_frames, 3)), rot.make_continuous(quat), 20.0)


@given(groups=st.lists(st.sampled_from("abcdefg"), min_size=2, max_size=40), seed=st.integers(0, 99))
def test_halves_split_the_items_and_no_group(groups, seed):
    if len(set(groups)) < 2:
        with pytest.raises(ParameterError, match="2 groups"):
            references.halves(groups, np.random.default_rng(seed))
        return
    one, other = references.halves(groups, np.random.default_rng(seed))
    assert sorted([*one, *other]) == list(range(len(groups)))
    assert not {groups[i] for i in one} & {groups[i] for i in other}
    assert len(one) and len(other)
    largest = max(groups.count(group) for group in groups)
    assert abs(len(one) - len(other)) <= largest


def test_still_freezes_one_of_the_poses():
    motion = _motion()
    frozen = references.still(motion, np.random.default_rng(1))
    assert frozen.n_frames == motion.n_frames
    assert np.ptp(frozen.joint_pos_m(), axis=0).max() < 1e-12
    assert np.abs(motion.joint_pos_m() - frozen.joint_pos_m()[0]).max(axis=(1, 2)).min() < 1e-9


def test_shuffled_joints_keep_the_root_and_the_set_of_rotations():
    motion = _motion()
    mixed = references.shuffled_joints(motion, np.random.default_rng(1))
    assert np.array_equal(mixed.local_quat[:, 0], motion.local_quat[:, 0])
    assert not np.allclose(mixed.local_quat, motion.local_quat)
    for frame in (0, 20):
        assert np.allclose(np.sort(mixed.local_quat[frame], 0), np.sort(motion.local_quat[frame], 0))


def test_shuffled_frames_keep_the_set_of_poses():
    motion = _motion()
    mixed = references.shuffled_frames(motion, np.random.default_rng(1))
    assert np.array_equal(mixed.root_pos_m, motion.root_pos_m)
    poses = [np.sort(np.abs(m.local_quat.reshape(m.n_frames, -1)).sum(axis=1)) for m in (motion, mixed)]
    assert np.allclose(poses[0], poses[1])
    assert not np.allclose(mixed.local_quat, motion.local_quat)


def test_chance_motions_keep_their_length():
    for chance in references.CHANCE.values():
        assert chance(_motion(), np.random.default_rng(0)).duration_s == _motion().duration_s
