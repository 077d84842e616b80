"""Poses of fingers on characters that have finger bones: relaxed, open or a fist, with smooth changes.

The built-in repertoire, and any that is built, has bodies without fingers. A figure whose name says what the
hands do opens or closes them: arms that reach, point or hold a partner have open hands, stomps and grooves
have fists. All others have relaxed hands.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from choreograph.core.counts import Figure
from choreograph.core.numerics import Floats, descendants
from choreograph.formats.gltf_rig import Rig
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion

HandShape = Literal["relaxed", "open", "fist"]

_CHANGE_S = 0.5  # from one shape to another, half of it before the figure begins
_MOST_SEGMENTS = 3  # of a finger
# Degrees that each joint of a finger bends from straight, from the hand to the tip. Those of thumbs are
# measured from the bind pose, because the place of a thumb differs between models.
_BENDS: dict[HandShape, dict[str, tuple[float, float, float]]] = {
    "relaxed": {
        "thumb": (5, 8, 10), "index": (18, 24, 14), "middle": (24, 30, 18), "ring": (28, 34, 20),
        "pinky": (30, 34, 20),
    },
    "open": {finger: (0, 0, 0) for finger in ("thumb", "index", "middle", "ring", "pinky")},
    "fist": {
        "thumb": (25, 35, 40), "index": (80, 95, 55), "middle": (84, 97, 58), "ring": (86, 97, 58),
        "pinky": (86, 95, 55),
    },
}  # fmt: skip
SHAPES: tuple[HandShape, ...] = tuple(_BENDS)
_FINGERS = {
    "thumb": re.compile(r"thumb|親指", re.IGNORECASE),
    "index": re.compile(r"index|人指|人差指", re.IGNORECASE),
    "middle": re.compile(r"middle|mid\d|中指", re.IGNORECASE),
    "ring": re.compile(r"ring|薬指", re.IGNORECASE),
    "pinky": re.compile(r"pinky|pinkie|little|小指", re.IGNORECASE),
}
_NO_SEGMENT = re.compile(r"metacarpal|carpal|palm|twist|_end$|_nub$", re.IGNORECASE)
_OPEN = re.compile(
    r"new yorker|\bfan\b|\barms?\b|\bhands?\b|\bpoint\b|reach|opening|bras\b|circle|jazz|scarecrow|curtsey"
    r"|oversway|alemana|\btilt\b|sweep|shoulder to shoulder|windmill",
    re.IGNORECASE,
)
_FIST = re.compile(
    r"stomp|running man|cabbage patch|groove|\bjack\b|steve martin|bart simpson|mess around|farmer"
    r"|\block and",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class HandSpan:
    """A part of a dance in which both hands have a shape."""

    start_s: float
    end_s: float
    shape: HandShape


@dataclass(frozen=True)
class Finger:
    """A finger in the bind pose of a rig."""

    side: str  # "left" or "right"
    name: str  # "thumb", "index", "middle", "ring" or "pinky"
    bones: tuple[int, ...]  # from the hand to the tip, at most three


def shape_of(figure: str) -> HandShape:
    """The shape of the hands in a figure, by its name."""
    if _FIST.search(figure):
        return "fist"
    return "open" if _OPEN.search(figure) else "relaxed"


def hand_spans(figures: Sequence[Figure]) -> tuple[HandSpan, ...]:
    """Where the hands are not relaxed, in order, for the figures of a dance."""
    spans = [HandSpan(figure.start_s, figure.end_s, shape_of(figure.name)) for figure in figures]
    return tuple(span for span in spans if span.shape != "relaxed")


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
                found.append(Finger(side, name, tuple(chain[:_MOST_SEGMENTS])))
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
    weights = _weights(figure.n_frames, figure.fps, spans)  # (T, S)
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


def _weights(n_frames: int, fps: float, spans: Sequence[HandSpan]) -> Floats:
    """The share (T, S) of each shape in each frame. Shares change smoothly and add up to 1."""
    times_s = np.arange(n_frames) / fps
    shape = np.zeros(n_frames, int)
    for span in spans:
        shape[(times_s >= span.start_s) & (times_s < span.end_s)] = SHAPES.index(span.shape)
    shares: Floats = np.eye(len(SHAPES))[shape]
    half = round(_CHANGE_S * fps / 2)
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.pad(shares, ((half, half), (0, 0)), mode="edge")
    columns = [np.convolve(column, window / window.sum(), mode="valid") for column in padded.T]
    return np.stack(columns, axis=1)


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
    goal = (palm + across) / np.linalg.norm(palm + across) if finger.name == "thumb" else palm
    straight = directions[0] - (directions[0] @ goal) * goal
    straight /= max(float(np.linalg.norm(straight)), 1e-9)
    axis = np.cross(straight, goal)
    bends = np.array([_BENDS[shape][finger.name][: len(finger.bones)] for shape in SHAPES])
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
