"""Synthetic motions with known properties."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.contacts import estimate_floor_m, sole_pos_m
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton, canonical_skeleton


def swaying(n_frames: int = 60, *, fps: float = 30.0, seed: int = 0) -> Motion:
    """A body over the floor at Y = 0 with small swings of all joints, and bending knees and elbows."""
    rng = np.random.default_rng(seed)
    skeleton = canonical_skeleton()
    phase = (
        np.arange(n_frames)[:, None, None] / fps * 2 * np.pi * rng.uniform(0.3, 1.2, (skeleton.n_joints, 3))
    )
    rotvec = 0.25 * np.sin(phase + rng.uniform(0, 6, (skeleton.n_joints, 3)))  # (T, J, 3)
    bend = 0.5 + 0.4 * np.sin(phase[:, 0, 0])
    for side, elbow in (("left", -1), ("right", 1)):
        rotvec[:, skeleton.index(f"{side}_knee")] = bend[:, None] * [1, 0, 0]
        rotvec[:, skeleton.index(f"{side}_elbow")] = elbow * bend[:, None] * [0, 1, 0]
    root = np.array([0.0, 0.9, 0.0]) + 0.3 * np.sin(phase[:, 0] * 0.5) * [1, 0.1, 1]
    motion = Motion(skeleton, root, rot.make_continuous(rot.from_rotvec(rotvec)), fps)
    return motion.moved(shift_m=np.array([0.0, -estimate_floor_m(sole_pos_m(motion)), 0.0]))


def on_other_axes(motion: Motion, seed: int) -> Motion:
    """The same joint positions on a rig with random joint axes, and so another rest pose."""
    rng = np.random.default_rng(seed)
    skeleton = motion.skeleton
    axes = rot.normalize(rng.normal(size=(skeleton.n_joints, 4)))
    world = rot.multiply(forward(skeleton, motion.root_pos_m, motion.local_quat)[1], axes)
    inward = rot.invert(axes)
    offsets = rot.rotate(inward[skeleton.parents], skeleton.offsets_m)
    tips = rot.rotate(inward[skeleton.tip_parents], skeleton.tips_m)
    other = Skeleton(skeleton.names, skeleton.parents, offsets, skeleton.tip_parents, tips)
    return replace(motion, skeleton=other, local_quat=rot.make_continuous(to_local(other, world)))


def stepping(n_frames: int, *, fps: float = 30.0, period_s: float = 0.5, seed: int = 0) -> Motion:
    """A body whose joints all come to rest at 0, `period_s`, 2 `period_s`, … and swings between."""
    rng = np.random.default_rng(seed)
    skeleton = canonical_skeleton()
    turn = np.cos(np.pi * np.arange(n_frames) / fps / period_s)  # (T,) its speed is 0 at every period
    swing = rng.normal(scale=0.15, size=(skeleton.n_joints, 3))
    swing[0] *= 0.3
    rotvec = turn[:, None, None] * swing  # (T, J, 3)
    root = np.array([0.0, 0.9, 0.0]) + turn[:, None] * np.array([0.08, 0.01, 0.05])
    return Motion(skeleton, root, rot.make_continuous(rot.from_rotvec(rotvec)), fps)


def standing_body(n_frames: int) -> np.ndarray:
    """Body positions (T, 21, 3) of the canonical skeleton at rest: it faces +Z, with its left at +X."""
    skeleton = canonical_skeleton()
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (n_frames, skeleton.n_joints, 1))
    root = np.tile([0.0, skeleton.offsets_m[0][1], 0.0], (n_frames, 1))
    return body_pos_m(Motion(skeleton, root, quat, 20.0))
