"""Geometric relations between joints: the 32 features of FID_g, as tables of joints.

Müller, Röder, Clausen (Efficient content-based retrieval of motion capture data, SIGGRAPH 2005) describe a
frame by boolean relations between joints. fairmotion chose 32 of them ("manual"), which AIST++ and Bailando
share. Here a relation is a measure (a signed distance, speed or angle) and the open range in which it holds.
Lengths are in units of the dancer's humerus, shoulder width or hip width, speeds in those units per second.

`PUBLISHED` is what the public code computes, `CORRECTED` what the original authors' toolbox does. They differ
in the rows of `_CORRECTIONS`, each with its reason. Neither has the toolbox's windows and hysteresis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from choreograph.core.numerics import Floats
from choreograph.motion.skeleton import CANONICAL_JOINTS

# Points that relations may name: the joints, and the two ends of the vertical.
_POINTS = (*CANONICAL_JOINTS, "origin", "up")


class Lengths(NamedTuple):
    """The dancer's lengths in metres, the units of the thresholds."""

    humerus: float
    shoulders: float
    hips: float


@dataclass(frozen=True)
class GeometricRelation:
    """A measure of joints, and the open range in which the relation holds."""

    measure: str  # a key of MEASURES
    joints: tuple[str, ...]
    above: float = -np.inf  # in `unit`s. For speeds, in `unit`s per second
    below: float = np.inf
    unit: Literal["humerus", "shoulders", "hips", "degree"] = "humerus"


def measure_lengths(pos_m: Floats) -> Lengths:
    """Measure the dancer's lengths in positions (T, 24, 3), metres: medians over time, humeri averaged."""

    def length_m(a: str, b: str) -> float:
        ends = [pos_m[:, CANONICAL_JOINTS.index(name)] for name in (a, b)]
        return float(np.median(np.linalg.norm(ends[1] - ends[0], axis=-1)))

    humeri = [length_m(f"{side}_shoulder", f"{side}_elbow") for side in ("left", "right")]
    return Lengths(
        sum(humeri) / 2, length_m("left_shoulder", "right_shoulder"), length_m("left_hip", "right_hip")
    )


def shares(relations: tuple[GeometricRelation, ...], pos_m: Floats, fps: float, lengths_m: Lengths) -> Floats:
    """Share of the frames 1 … T - 1 of positions (T, 24, 3) in which each relation holds, (R,), 0 … 1.

    A relation whose direction is undefined (two of its joints coincide) does not hold.
    """
    points = np.concatenate([pos_m, np.zeros((len(pos_m), 2, 3))], axis=1)  # (T, 26, 3)
    points[:, -1, 1] = 1.0
    now = dict(zip(_POINTS, np.moveaxis(points[1:], 1, 0), strict=True))  # name -> (T-1, 3)
    velocity = dict(zip(_POINTS, np.moveaxis(np.diff(points, axis=0) * fps, 1, 0), strict=True))
    now["lowest"] = pos_m[1:, :, 1].min(axis=1)[:, None] * np.array([0.0, 1.0, 0.0])  # (T-1, 3)
    units = {**lengths_m._asdict(), "degree": 1.0}
    shares_held = []
    for relation in relations:
        value = MEASURES[relation.measure](now, velocity, *relation.joints)  # (T-1,)
        low, high = (limit * units[relation.unit] for limit in (relation.above, relation.below))
        shares_held.append(np.mean((value > low) & (value < high)))
    return np.array(shares_held)


_Points = dict[str, Floats]  # name -> (T-1, 3)


def _beyond(now: _Points, _: _Points, start: str, end: str, origin: str, point: str) -> Floats:
    """How far `point` is from `origin` in the direction start → end, metres."""
    return _dot(_unit(now[end] - now[start]), now[point] - now[origin])


def _off_plane(now: _Points, _: _Points, a: str, b: str, c: str, point: str) -> Floats:
    """Signed distance of `point` from the plane through a, b, c along (c - a) x (b - a), metres."""
    return _dot(_normal(now, a, b, c), now[point] - now[a])


def _speed_along(now: _Points, velocity: _Points, start: str, end: str, origin: str, point: str) -> Floats:
    """Speed of `point` relative to `origin` in the direction start → end, m/s."""
    return _dot(_unit(now[end] - now[start]), velocity[point] - velocity[origin])


def _speed_off_plane(now: _Points, velocity: _Points, a: str, b: str, c: str, point: str) -> Floats:
    """Speed of `point` relative to a, perpendicular to the plane through a, b, c, m/s."""
    return _dot(_normal(now, a, b, c), velocity[point] - velocity[a])


def _speed(_: _Points, velocity: _Points, point: str) -> Floats:
    """Speed of `point`, m/s."""
    result: Floats = np.linalg.norm(velocity[point], axis=-1)
    return result


def _height(now: _Points, _: _Points, point: str) -> Floats:
    """Height of `point` above the body's lowest joint, metres."""
    return (now[point] - now["lowest"])[:, 1]


def _angle(now: _Points, _: _Points, a: str, b: str, c: str, d: str) -> Floats:
    """Angle between the directions a → b and c → d, degrees, 0 … 180."""
    cosine = _dot(_unit(now[b] - now[a]), _unit(now[d] - now[c]))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


MEASURES: dict[str, Callable[..., Floats]] = {
    "beyond": _beyond,
    "off_plane": _off_plane,
    "speed_along": _speed_along,
    "speed_off_plane": _speed_off_plane,
    "speed": _speed,
    "height": _height,
    "angle": _angle,
}


def _unit(vector: Floats) -> Floats:
    """Unit vectors (..., 3), or nan, which lies in no range, where the direction is undefined."""
    norm = np.linalg.norm(vector, axis=-1, keepdims=True)
    result: Floats = np.divide(vector, norm, out=np.full_like(vector, np.nan), where=norm > 1e-9)
    return result


def _normal(now: _Points, a: str, b: str, c: str) -> Floats:
    return _unit(np.cross(now[c] - now[a], now[b] - now[a]))


def _dot(a: Floats, b: Floats) -> Floats:
    result: Floats = np.sum(a * b, axis=-1)
    return result


def _pair(relation: GeometricRelation) -> tuple[GeometricRelation, GeometricRelation]:
    """A relation of the right side, and the same with left and right swapped."""
    flip = {"left": "right", "right": "left"}
    joints = (name.split("_") for name in relation.joints)
    return relation, replace(
        relation, joints=tuple("_".join(flip.get(word, word) for word in words) for words in joints)
    )


def _row(measure: str, joints: str, **limits: float | str) -> GeometricRelation:
    return GeometricRelation(measure, tuple(joints.split()), **limits)  # type: ignore[arg-type]


PUBLISHED: tuple[GeometricRelation, ...] = (
    *_pair(_row("speed_off_plane", "neck right_hip left_hip right_wrist", above=1.8)),  # hand back / forward
    *_pair(_row("beyond", "spine3 neck neck right_wrist", above=0.2)),  # hand above the neck
    *_pair(_row("speed_along", "spine1 spine3 spine1 spine3", above=1.8)),  # chest away from the belly
    *_pair(
        _row("angle", "right_elbow right_shoulder right_elbow right_wrist", above=0, below=110, unit="degree")
    ),
    _row("beyond", "left_shoulder right_shoulder left_wrist right_wrist", above=2.5, unit="shoulders"),
    _row("speed_along", "left_wrist right_wrist left_wrist right_wrist", above=1.4),  # hands move apart
    *_pair(_row("speed_along", "right_wrist pelvis right_wrist left_wrist", above=1.4)),
    *_pair(_row("speed", "right_wrist", above=2.5)),
    *_pair(_row("off_plane", "pelvis left_hip left_foot right_ankle", above=0.38)),  # foot in front / behind
    *_pair(_row("height", "right_ankle", above=1.2)),
    _row("beyond", "left_hip right_hip left_ankle right_ankle", above=2.1, unit="hips"),  # feet apart
    *_pair(_row("angle", "right_knee right_hip right_knee right_ankle", above=0, below=110, unit="degree")),
    *_pair(_row("speed", "right_ankle", above=2.5)),
    *_pair(_row("angle", "neck pelvis right_shoulder right_elbow", above=25, below=180, unit="degree")),
    *_pair(_row("angle", "neck pelvis right_hip right_knee", above=50, below=180, unit="degree")),
    _row("off_plane", "right_ankle neck left_ankle pelvis", above=0.5),  # pelvis in front of neck and feet
    _row("angle", "neck pelvis origin up", above=70, below=110, unit="degree"),  # spine horizontal
    *_pair(_row("height", "right_wrist", below=1.2)),  # a hand near the ground
    _row("speed", "pelvis", above=2.3),
)

_CORRECTIONS: dict[int, GeometricRelation] = {
    # Both hands use the same normal of the torso plane, pointing forward.
    0: _row("speed_off_plane", "neck left_hip right_hip right_wrist", above=1.8),
    # j4 relative to j3 along j1 → j2: the hand rises, not the chest away from the belly.
    **dict(enumerate(_pair(_row("speed_along", "spine1 spine3 spine3 right_wrist", above=1.8)), start=4)),
    # The same fix: hands meet, hands leave the body.
    9: _row("speed_along", "left_wrist right_wrist right_wrist left_wrist", above=1.4),
    **dict(
        enumerate(_pair(_row("speed_along", "right_wrist pelvis right_wrist pelvis", above=1.4)), start=10)
    ),
    # A foot behind the other leg, on both sides. With that leg's toes, a standing foot would count as behind.
    14: _row("off_plane", "pelvis left_ankle left_hip right_ankle", above=0.38),
    15: _row("off_plane", "pelvis right_hip right_ankle left_ankle", above=0.38),
    # The pelvis behind the plane of neck and feet: the body bends or sits.
    27: _row("off_plane", "left_ankle neck right_ankle pelvis", above=0.5),
}
CORRECTED: tuple[GeometricRelation, ...] = tuple(_CORRECTIONS.get(i, row) for i, row in enumerate(PUBLISHED))
