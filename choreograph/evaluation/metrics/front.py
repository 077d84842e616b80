"""Front: whether a dancer turns the back to the audience or leaves the stage, and where the last pose faces.

Conventions: body positions (T, 21, 3) in metres at `fps`, Y up. The heading is that of the pelvis: the
direction on the ground perpendicular to the line through the hips. 0 faces +Z, and positive angles turn
towards +X, in radians. `front_rad` is the heading at which the dancer faces the audience. A dance of this
program has the audience at +Z. That of a recorded dance is often not known. `usual_front_rad` estimates it
from the dance, which makes the result a lower bound.
"""

from __future__ import annotations

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.motion.body import BODY_JOINTS, checked_body_pos_m

AWAY_DEG = 100.0  # turned further than this, a dancer shows the back
TO_FRONT_DEG = 45.0  # turned less than this, a dancer faces the audience
_PELVIS = BODY_JOINTS.index("pelvis")
_HIPS = [BODY_JOINTS.index("left_hip"), BODY_JOINTS.index("right_hip")]
_DIRECTIONS = np.radians(np.arange(-180.0, 180.0, 5.0))
_SAMPLES = 600  # of the headings of a dance, which are enough for its front


def validate(body_pos_m: Floats, fps: float, *, front_rad: float = 0.0) -> None:
    """Raise `ParameterError` unless positions (T, 21, 3), rate and front are valid.

    Examples
    --------
    >>> cg.metrics.front.validate(np.zeros((60, 21, 3)), 60.0)
    >>> cg.metrics.front.validate(np.zeros((60, 21, 3)), 60.0, front_rad=np.inf)
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected the front as an angle in radians, got inf
    """
    checked_body_pos_m(body_pos_m, fps)
    if not np.isfinite(front_rad):
        raise ParameterError(f"expected the front as an angle in radians, got {front_rad}")


def heading_rad(body_pos_m: Floats) -> Floats:
    """Heading of the pelvis (T,), from -π to π.

    Examples
    --------
    >>> pos_m = np.zeros((1, 21, 3))
    >>> pos_m[0, 1:3] = [[0.1, 1.0, 0.0], [-0.1, 1.0, 0.0]]  # the left hip at +X: the dancer faces +Z
    >>> cg.metrics.front.heading_rad(pos_m)
    array([0.])
    """
    left, right = _HIPS
    pos = np.asarray(body_pos_m)
    across = pos[:, left] - pos[:, right]  # (T, 3)
    heading: Floats = np.arctan2(-across[:, 2], across[:, 0]) + 0.0  # no negative zero
    return heading


def usual_front_rad(body_pos_m: Floats, fps: float) -> float:
    """The direction that the dancer faces most, from -π to π: the circular median of the headings.

    It is exact to 5°.

    Examples
    --------
    >>> pos_m = np.zeros((90, 21, 3))
    >>> pos_m[:, 1] = [0.1, 1.0, 0.0]  # the left hip: faces +Z
    >>> pos_m[80:, 1] = [-0.1, 1.0, 0.0]  # and turns around for the last of nine seconds
    >>> cg.metrics.front.usual_front_rad(pos_m, 10.0)
    0.0
    """
    validate(body_pos_m, fps)
    headings = heading_rad(body_pos_m)
    headings = headings[:: max(1, len(headings) // _SAMPLES)]
    away_rad = np.abs(_wrapped(headings[:, None] - _DIRECTIONS)).mean(axis=0)  # (72,)
    return float(_DIRECTIONS[int(np.argmin(away_rad))])


def turned_away_share(
    body_pos_m: Floats, fps: float, *, front_rad: float = 0.0, beyond_deg: float = AWAY_DEG
) -> float:
    """Share of the time, 0 to 1, in which the pelvis is turned further than `beyond_deg` from the front.

    Lower is better, and 0 is a dancer who never shows the back. 0.44 is chance.

    Examples
    --------
    >>> pos_m = np.zeros((90, 21, 3))
    >>> pos_m[:, 1] = [0.1, 1.0, 0.0]  # the left hip: faces +Z
    >>> pos_m[60:, 1] = [-0.1, 1.0, 0.0]  # and turns around for the last three of nine seconds
    >>> round(cg.metrics.front.turned_away_share(pos_m, 10.0), 3)
    0.333
    """
    return float((_away_deg(body_pos_m, fps, front_rad) > beyond_deg).mean())


def last_heading_deg(body_pos_m: Floats, fps: float, *, front_rad: float = 0.0) -> float:
    """How far the pelvis is turned from the front in the last frame, in degrees from 0 to 180.

    Lower is better. 90 is chance.

    Examples
    --------
    >>> pos_m = np.zeros((90, 21, 3))
    >>> pos_m[:, 1] = [0.1, 1.0, 0.0]  # the left hip: faces +Z
    >>> cg.metrics.front.last_heading_deg(pos_m, 10.0), cg.metrics.front.last_heading_deg(
    ...     pos_m, 10.0, front_rad=np.pi / 2)
    (0.0, 90.0)
    """
    return float(_away_deg(body_pos_m, fps, front_rad)[-1])


def outside_share(body_pos_m: Floats, width_m: float, depth_m: float) -> float:
    """Share of the time, 0 to 1, in which the pelvis is off a stage around the origin. Lower is better.

    The stage is `width_m` wide, along X, and `depth_m` deep.

    Examples
    --------
    >>> pos_m = np.zeros((90, 21, 3))
    >>> pos_m[60:, 0, 0] = 2.5  # the last third is 2.5 m to the side
    >>> round(cg.metrics.front.outside_share(pos_m, 4.0, 3.0), 3)
    0.333
    """
    places_m = np.asarray(body_pos_m)[:, _PELVIS]
    outside = (np.abs(places_m[:, 0]) > width_m / 2) | (np.abs(places_m[:, 2]) > depth_m / 2)
    return float(outside.mean())


@default_numerics()
def evaluate(body_pos_m: Floats, fps: float, *, front_rad: float = 0.0) -> dict[str, float]:
    """All metrics of this module by name. Raises `ParameterError` as `validate` does.

    `ends_to_front` is 1 if the last pose is turned less than 45° from the front, else 0.

    Examples
    --------
    >>> pos_m = np.zeros((90, 21, 3))
    >>> pos_m[:, 1] = [0.1, 1.0, 0.0]  # the left hip: faces +Z
    >>> cg.metrics.front.evaluate(pos_m, 10.0)
    {'turned_away_share': 0.0, 'last_heading_deg': 0.0, 'ends_to_front': 1.0}
    """
    last_deg = last_heading_deg(body_pos_m, fps, front_rad=front_rad)
    return {
        "turned_away_share": turned_away_share(body_pos_m, fps, front_rad=front_rad),
        "last_heading_deg": last_deg,
        "ends_to_front": float(last_deg < TO_FRONT_DEG),
    }


def uniform_chance() -> dict[str, float]:
    """Exact mean values of a dance that is turned by a random angle.

    Examples
    --------
    >>> {name: round(level, 2) for name, level in cg.metrics.front.uniform_chance().items()}
    {'turned_away_share': 0.44, 'last_heading_deg': 90.0, 'ends_to_front': 0.25}
    """
    return {
        "turned_away_share": 1.0 - AWAY_DEG / 180.0,
        "last_heading_deg": 90.0,
        "ends_to_front": TO_FRONT_DEG / 180.0,
    }


def _away_deg(body_pos_m: Floats, fps: float, front_rad: float) -> Floats:
    """How far each heading is from the front, (T,), 0 to 180 degrees."""
    validate(body_pos_m, fps, front_rad=front_rad)
    away_deg: Floats = np.degrees(np.abs(_wrapped(heading_rad(body_pos_m) - front_rad)))
    return away_deg


def _wrapped(angle_rad: Floats) -> Floats:
    wrapped: Floats = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    return wrapped
