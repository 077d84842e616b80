"""Poses of fingers on characters that have finger bones, in the shapes of `motion.hands`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from choreograph.core.numerics import Floats, descendants
from choreograph.formats.gltf_rig import Rig
from choreograph.motion import rotations as rot
from choreograph.motion.hands import (
    BENDS_DEG,
    SEGMENTS,
    SHAPES,
    HandSpan,
    bend_axis,
    shape_shares,
    thumb_goal,
)
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion

_FINGERS = {
    "thumb": re.compile(r"thumb|親指", re.IGNORECASE),
    "index": re.compile(r"index|人指|人差指", re.IGNORECASE),
    "middle": re.compile(r"middle|mid\d|中指", re.IGNORECASE),
    "ring": re.compile(r"ring|薬指", re.IGNORECASE),
    "pinky": re.compile(r"pinky|pinkie|little|小指", re.IGNORECASE),
}
_NO_SEGMENT = re.compile(r"metacarpal|carpal|palm|twist|_end$|_nub$", re.IGNORECASE)


@dataclass(frozen=True)
class Finger:
    """A finger in the bind pose of a rig."""

    side: str  # "left" or "right"
    name: str  # "thumb", "index", "middle", "ring" or "pinky"
    bones: tuple[int, ...]  # from the hand to the tip, at most three


def fingers_of(rig: Rig, bones: Mapping[str, int]) -> list[Finger]:
    """The fingers below the hands of a rig, found by the names of their bones."""
    found = []
    for side in ("left", "right"):
        below = descendants(rig.parents, bones[f"{side}_wrist"])[1:]
        for name, pattern in _FINGERS.items():
            own = [b for b in below if pattern.search(rig.names[b]) and not _NO_SEGMENT.search(rig.names[b])]
            chain: list[int] = []
            for bone in own:
                if not chain or rig.parents[bone] == chain[-1]:
                    chain.append(bone)
            if chain:
                found.append(Finger(side, name, tuple(chain[:SEGMENTS])))
    return found


def with_fingers(
    figure: Motion,
    rig: Rig,
    bones: Mapping[str, int],
    joint_of: Mapping[int, int],
    spans: Sequence[HandSpan] = (),
) -> Motion:
    """The motion of a figure with fingers in the shapes of `spans`, and relaxed elsewhere.

    The joints of the figure are the bones `joint_of`. A hand without an index finger and another one to tell
    the palm by keeps its bind pose. Without such fingers, the motion is returned as it is.
    """
    fingers = fingers_of(rig, bones)
    weights = shape_shares(figure.n_frames, figure.fps, spans)  # (T, S)
    _, turned = forward(figure.skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 4)
    moved: set[int] = set()
    for side in ("left", "right"):
        hand = {finger.name: finger for finger in fingers if finger.side == side}
        wrist = bones[f"{side}_wrist"]
        frame = _palm(rig, wrist, hand)
        if frame is None:
            continue
        for finger in hand.values():
            axis, bent_rad = _bends(rig, finger, *frame)
            angles_rad = weights @ bent_rad  # (T, N) from the bind pose
            for bone, angle_rad in zip(finger.bones, angles_rad.T, strict=True):
                quat = rot.multiply(turned[:, joint_of[wrist]], rot.from_rotvec(angle_rad[:, None] * axis))
                for below in descendants(figure.skeleton.parents, joint_of[bone]):
                    turned[:, below] = quat
            moved |= {joint_of[bone] for bone in finger.bones}
    if not moved:
        return figure
    local = figure.local_quat.copy()
    changed = sorted(moved)
    local[:, changed] = rot.make_continuous(to_local(figure.skeleton, turned)[:, changed])
    return replace(figure, local_quat=local)


def _palm(rig: Rig, wrist: int, hand: Mapping[str, Finger]) -> tuple[Floats, Floats] | None:
    """The directions (3,) out of the palm and from the index finger to the smallest one, in the bind pose."""
    first = hand.get("index")
    last = next((hand[name] for name in ("pinky", "ring", "middle") if name in hand), None)
    if first is None or last is None:
        return None
    index_m, last_m = (rig.bind_pos_m[finger.bones[0]] for finger in (first, last))
    along, across = (index_m + last_m) / 2 - rig.bind_pos_m[wrist], last_m - index_m
    palm = np.cross(across, along) if first.side == "left" else np.cross(along, across)
    length = float(np.linalg.norm(palm))
    if length < 1e-9:
        return None
    return palm / length, across / np.linalg.norm(across)


def _bends(rig: Rig, finger: Finger, palm: Floats, across: Floats) -> tuple[Floats, Floats]:
    """The axis (3,) of a finger, and the angles (S, N) of its segments from the bind pose in each shape."""
    directions = _directions(rig, finger)  # (N, 3)
    goal = thumb_goal(palm, across) if finger.name == "thumb" else palm
    straight = directions[0] - (directions[0] @ goal) * goal
    straight /= max(float(np.linalg.norm(straight)), 1e-9)
    axis = bend_axis(directions[0], goal)
    bends = np.array([BENDS_DEG[shape][finger.name][: len(finger.bones)] for shape in SHAPES])
    angles = np.cumsum(np.radians(bends), axis=1)  # (S, N) of each segment
    if finger.name != "thumb":
        angles = angles - np.arctan2(directions @ goal, directions @ straight)
    return axis, angles


def _directions(rig: Rig, finger: Finger) -> Floats:
    """The directions (N, 3) of the segments of a finger in the bind pose, up to the tip if it has a bone."""
    directions: list[Floats] = []
    for bone in finger.bones:
        children = np.flatnonzero(rig.parents == bone)
        ahead = rig.bind_pos_m[children].mean(axis=0) - rig.bind_pos_m[bone] if len(children) else np.zeros(3)
        length = float(np.linalg.norm(ahead))
        if length > 1e-9:
            directions.append(ahead / length)
        elif directions:
            directions.append(directions[-1])
        else:
            along = rig.bind_pos_m[bone] - rig.bind_pos_m[rig.parents[bone]]
            directions.append(along / max(float(np.linalg.norm(along)), 1e-9))
    return np.array(directions)
