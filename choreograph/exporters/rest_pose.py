"""Another rest pose for the same motion: standing on the floor, with the arms in a T or an A."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.mannequin import Body, standing_body
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton

Floats = NDArray[np.float64]

REST_POSES = {"t": 0.0, "a": np.pi / 4}  # radians that the arms hang below the horizontal


def with_rest_pose(motion: Motion, rest: str) -> Motion:
    """The motion on its skeleton in another rest pose: world positions of joints stay, rotations change.

    The root's offset puts the soles on the floor above the origin. A joint's world rotation becomes
    its old one times the inverse of its turn from the old rest pose to the new.

    Raises `ParameterError` for an unknown rest pose, or joint names that are not a known rig's.
    """
    if rest not in REST_POSES:
        raise ParameterError(f"expected a rest pose among {', '.join(REST_POSES)}, got {rest!r}")
    skeleton = motion.skeleton
    body = standing_body(skeleton, motion)
    turns = np.array(body.bind_quat)  # (J, 4)
    for side in ("left", "right"):
        for joint, turn in _arm_turns(skeleton, body, side, REST_POSES[rest]).items():
            turns[joint] = rot.multiply(turn, turns[joint])
    above = np.where(skeleton.parents < 0, 0, skeleton.parents)
    offsets_m = rot.rotate(turns[above], skeleton.offsets_m)
    offsets_m[0] = [0.0, body.bind_pos_m[0, 1] - body.sole_m, 0.0]
    tips_m = rot.rotate(turns[skeleton.tip_parents], skeleton.tips_m)
    local = rot.multiply(rot.multiply(turns[above], motion.local_quat), rot.invert(turns))  # (T, J, 4)
    local[:, 0] = rot.multiply(motion.local_quat[:, 0], rot.invert(turns[0]))
    return replace(
        motion,
        skeleton=replace(skeleton, offsets_m=offsets_m, tips_m=tips_m),
        local_quat=rot.make_continuous(local),
    )


def _arm_turns(skeleton: Skeleton, body: Body, side: str, below_rad: float) -> dict[int, Floats]:
    """World rotations (4,) by joint that stretch an arm of the standing body sideways, some way down."""
    outwards = body.place(f"{side}_shoulder") - body.place(
        f"{'right' if side == 'left' else 'left'}_shoulder"
    )
    outwards = outwards * np.array([1.0, 0.0, 1.0]) / np.hypot(outwards[0], outwards[2])
    along = np.cos(below_rad) * outwards - np.array([0.0, np.sin(below_rad), 0.0])
    turns: dict[int, Floats] = {}
    for start, end in (("shoulder", "elbow"), ("elbow", "wrist")):
        bone = body.place(f"{side}_{end}") - body.place(f"{side}_{start}")
        turn = rot.between(bone / np.linalg.norm(bone), along)
        first = body.roles[f"{side}_{start}"]
        turns |= {joint: turn for joint in _with_descendants(skeleton, first)}
    return turns


def _with_descendants(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint and all below it."""
    below = [joint]
    for child in range(joint + 1, skeleton.n_joints):
        if skeleton.parents[child] in below:
            below.append(child)
    return below
