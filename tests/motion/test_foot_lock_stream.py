"""Feet locked as frames come in."""

import numpy as np
from synthetic_motions import stepping

from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.motion.body import body_pos_m
from choreograph.motion.foot_locking import FootLockStream, locking_shift
from choreograph.motion.motion import Motion

FPS = 60.0


def test_shifts_that_are_given_are_gone_on_from():
    rng = np.random.default_rng(0)
    points_m, contacts = rng.normal(0, 0.02, (60, 2, 3)).cumsum(axis=0), rng.random((60, 2))
    whole = locking_shift(points_m, contacts, FPS, 0.1)
    for n_given in (1, 3, 7):
        rest = locking_shift(points_m, contacts, FPS, 0.1, whole[:n_given])
        assert np.allclose(rest, whole, atol=1e-9)


def sliding():
    """Steps on the spot that drift sideways by 0.2 m/s: every foot slides in contact."""
    steps = stepping(8 * 60, fps=FPS, period_s=0.5, seed=1)
    drift = np.outer(np.arange(steps.n_frames) / FPS, [0.2, 0.0, 0.0])
    return Motion(steps.skeleton, steps.root_pos_m + drift, steps.local_quat, FPS)


def locked(motion, block, ahead):
    """All frames, locked in blocks when `ahead` frames after them are known."""
    stream, quats, known = FootLockStream(motion.skeleton, FPS, 0.1), [], 0
    for first in range(0, motion.n_frames - block - ahead + 1, block):
        stop = first + block + ahead
        contacts = np.ones((stop - known, 2))
        stream.push(motion.root_pos_m[known:stop], motion.local_quat[known:stop], contacts)
        quats.append(stream.pop(block))
        known = stop
    quat = np.concatenate(quats)
    return Motion(motion.skeleton, motion.root_pos_m[: len(quat)], quat, FPS)


def test_feet_slide_less_and_only_legs_move():
    motion = sliding()
    dance = locked(motion, block=2, ahead=2)
    before, after = (foot_slide_cm_s(body_pos_m(one), FPS) for one in (motion, dance))
    assert after < 0.6 * before
    same = np.isclose(dance.local_quat, motion.local_quat[: dance.n_frames]).all(axis=(0, 2))
    moved = {name for name, kept in zip(motion.skeleton.names, same, strict=True) if not kept}
    assert moved and all(name.split("_")[-1] in ("hip", "knee", "ankle") for name in moved)


def test_frames_depend_on_no_later_frame_than_those_known():
    motion = sliding()
    later = motion.local_quat.copy()
    later[200:] = later[:1]
    altered = Motion(motion.skeleton, motion.root_pos_m, later, FPS)
    first, other = (locked(one, block=2, ahead=2).local_quat for one in (motion, altered))
    assert np.array_equal(first[:198], other[:198]) and not np.allclose(first[200:], other[200:])
