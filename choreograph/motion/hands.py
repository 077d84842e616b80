"""Shapes of hands: relaxed, open or a fist, by the figure that is danced, and how fingers bend in them.

Bodies of takes have no fingers. A figure whose name says what the hands do opens or closes them: arms that
reach, point or hold a partner have open hands, stomps and grooves have fists. All others have relaxed hands.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from choreograph.core.counts import Figure
from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot

HandShape = Literal["relaxed", "open", "fist"]

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
SEGMENTS = 3  # of a finger
_CHANGE_S = 0.5  # from one shape to another, half of it before the figure begins
# Degrees that each joint of a finger bends from straight, from the hand to the tip. Those of thumbs are
# measured from the bind pose, because the place of a thumb differs between models.
BENDS_DEG: dict[HandShape, dict[str, tuple[float, float, float]]] = {
    "relaxed": {
        "thumb": (5, 8, 10), "index": (18, 24, 14), "middle": (24, 30, 18), "ring": (28, 34, 20),
        "pinky": (30, 34, 20),
    },
    "open": {finger: (0, 0, 0) for finger in FINGERS},
    "fist": {
        "thumb": (25, 35, 40), "index": (80, 95, 55), "middle": (84, 97, 58), "ring": (86, 97, 58),
        "pinky": (86, 95, 55),
    },
}  # fmt: skip
SHAPES: tuple[HandShape, ...] = tuple(BENDS_DEG)
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
# A left hand in a T pose: the arm along +X, the palm down, the thumb between the arm and the front.
_PALM, _ACROSS = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, -1.0])
ALONG = np.array([1.0, 0.0, 0.0])
THUMB_ALONG = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)


@dataclass(frozen=True)
class HandSpan:
    """A part of a dance in which both hands have a shape."""

    start_s: float
    end_s: float
    shape: HandShape


def shape_of(figure: str) -> HandShape:
    """The shape of the hands in a figure, by its name."""
    if _FIST.search(figure):
        return "fist"
    return "open" if _OPEN.search(figure) else "relaxed"


def hand_spans(figures: Sequence[Figure]) -> tuple[HandSpan, ...]:
    """Where the hands are not relaxed, in order, for the figures of a dance."""
    spans = [HandSpan(figure.start_s, figure.end_s, shape_of(figure.name)) for figure in figures]
    return tuple(span for span in spans if span.shape != "relaxed")


def shape_shares(n_frames: int, fps: float, spans: Sequence[HandSpan]) -> Floats:
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


def thumb_goal(palm: Floats, across: Floats) -> Floats:
    """The direction (3,) to which a thumb bends, from those out of the palm and to the smallest finger."""
    return (palm + across) / np.linalg.norm(palm + across)


def bend_axis(along: Floats, goal: Floats) -> Floats:
    """The axis (3,) about which a finger with the direction `along` bends towards `goal`."""
    straight = along - (along @ goal) * goal
    return np.cross(straight / max(float(np.linalg.norm(straight)), 1e-9), goal)


def finger_quats(side: str, shares: Floats) -> dict[str, Floats]:
    """Local rotations (T, 3, 4) of the segments of each finger of a hand, for shares (T, S) of shapes.

    They are relative to a T pose with straight fingers, whose bones have the axes of the world: +X is left,
    +Y up and +Z the front.
    """
    found: dict[str, Floats] = {}
    for finger in FINGERS:
        thumb = finger == "thumb"
        axis = bend_axis(*((THUMB_ALONG, thumb_goal(_PALM, _ACROSS)) if thumb else (ALONG, _PALM)))
        if side == "right":
            axis = axis * np.array([1.0, -1.0, -1.0])  # mirrored at the plane between left and right
        bends_rad = np.radians([BENDS_DEG[shape][finger] for shape in SHAPES])  # (S, 3)
        found[finger] = rot.from_rotvec((shares @ bends_rad)[..., None] * axis)
    return found
