"""Endings: whether a dance begins and ends in a held pose, frozen or alive, and whether it ends on time.

Conventions: body positions (T, 21, 3) in metres at `fps`. Speed is the mean over the joints of the distance
covered in 1/60 s, in m/s, with root motion. A pose is held while the speed is below `HELD_M_S`. Breathing and
marker noise of a standing dancer are 0.03 to 0.1 m/s. Below `FROZEN_M_S`, a body is frozen, since no dancer
stands so still. A body that never moves is held throughout, so compare these values with the speed of the
dance itself.
"""

from __future__ import annotations

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import STORE_FPS, frame_times_s, seconds_to_frames
from choreograph.evaluation.metrics.physical import ANKLE_OVER_SOLE_M
from choreograph.motion.body import BODY_JOINTS, body_pos_at, checked_body_pos_m

END_S = 0.3
HELD_M_S = 0.15
FROZEN_M_S = 0.02
_FEET = [
    (BODY_JOINTS.index(f"{side}_ankle"), BODY_JOINTS.index(f"{side}_foot")) for side in ("left", "right")
]


def validate(body_pos_m: Floats, fps: float, last_strong_s: float | None = None) -> None:
    """Raise `ParameterError` unless positions (T, 21, 3), rate and the time of the count are valid.

    Examples
    --------
    >>> cg.metrics.endings.validate(np.zeros((60, 21, 3)), 60.0, last_strong_s=0.5)
    >>> cg.metrics.endings.validate(np.zeros((60, 21, 3)), 60.0, last_strong_s=np.nan)
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected the last strong count in seconds, got nan
    """
    checked_body_pos_m(body_pos_m, fps)
    if last_strong_s is not None and not np.isfinite(last_strong_s):
        raise ParameterError(f"expected the last strong count in seconds, got {last_strong_s}")


def opening_speed_m_s(body_pos_m: Floats, fps: float, *, span_s: float = END_S) -> float:
    """Mean joint speed in the first `span_s`, in m/s. Low is a held pose. nan for a single frame.

    Examples
    --------
    >>> pos_m = np.zeros((180, 21, 3))  # 2 s of 1 m/s, then 1 s of standing still
    >>> pos_m[:, :, 0] = np.minimum(np.arange(180) / 60, 2.0)[:, None]
    >>> round(cg.metrics.endings.opening_speed_m_s(pos_m, 60.0), 2)
    1.0
    """
    return _mean(_speed(body_pos_m, fps)[1][: _frames(span_s)])


def closing_speed_m_s(body_pos_m: Floats, fps: float, *, span_s: float = END_S) -> float:
    """Mean joint speed in the last `span_s`, in m/s. Low is a held pose. nan for a single frame.

    Examples
    --------
    >>> pos_m = np.zeros((180, 21, 3))  # 2 s of 1 m/s, then 1 s of standing still
    >>> pos_m[:, :, 0] = np.minimum(np.arange(180) / 60, 2.0)[:, None]
    >>> cg.metrics.endings.closing_speed_m_s(pos_m, 60.0)
    0.0
    """
    return _mean(_speed(body_pos_m, fps)[1][-_frames(span_s) :])


def held_from_s(body_pos_m: Floats, fps: float, *, held_m_s: float = HELD_M_S) -> float:
    """The time from which the pose is held to the end of the dance, in seconds. nan if it moves to the end.

    Examples
    --------
    >>> pos_m = np.zeros((180, 21, 3))  # 2 s of 1 m/s, then 1 s of standing still
    >>> pos_m[:, :, 0] = np.minimum(np.arange(180) / 60, 2.0)[:, None]
    >>> cg.metrics.endings.held_from_s(pos_m, 60.0)
    2.0
    """
    times_s, speed = _speed(body_pos_m, fps)
    if len(speed) == 0:
        return 0.0
    moving = np.flatnonzero(speed >= held_m_s)
    if len(moving) == 0:
        return 0.0
    return float(times_s[moving[-1] + 1]) if moving[-1] + 1 < len(speed) else float("nan")


def frozen_ends_share(body_pos_m: Floats, fps: float, *, frozen_m_s: float = FROZEN_M_S) -> float:
    """Share of the time, 0 to 1, in which the body is frozen in the poses held at both ends.

    Lower is better. The ends are the time before the first movement faster than `HELD_M_S` and after the
    last. The result is 1 for a body that never moves, and for a single frame.

    Examples
    --------
    >>> pos_m = np.zeros((180, 21, 3))  # 2 s of 1 m/s, then 1 s of standing still
    >>> pos_m[:, :, 0] = np.minimum(np.arange(180) / 60, 2.0)[:, None]
    >>> round(cg.metrics.endings.frozen_ends_share(pos_m, 60.0), 1)
    0.3
    """
    _, speed = _speed(body_pos_m, fps)
    if len(speed) == 0:
        return 1.0
    moving = np.flatnonzero(speed >= HELD_M_S)
    frozen = speed < frozen_m_s
    if len(moving):
        frozen[moving[0] : moving[-1] + 1] = False
    return float(frozen.mean())


def closing_lift_cm(body_pos_m: Floats, fps: float) -> float:
    """How much higher one foot is than the other in the last pose, in cm. Lower is better.

    A foot is as high as the lower of its ball and its heel, which is `ANKLE_OVER_SOLE_M` below the ankle.
    Above about 5 cm, the body stands on one leg.

    Examples
    --------
    >>> pos_m = np.zeros((60, 21, 3))
    >>> pos_m[:, [6, 9], 1] += 0.3  # left ankle and ball
    >>> round(cg.metrics.endings.closing_lift_cm(pos_m, 60.0), 3)
    30.0
    """
    last_m = checked_body_pos_m(body_pos_m, fps)[-1, :, 1]
    low_m = [min(last_m[ankle] - ANKLE_OVER_SOLE_M, last_m[ball]) for ankle, ball in _FEET]
    return float(abs(low_m[0] - low_m[1]) * 100.0)


def hold_delay_s(body_pos_m: Floats, fps: float, last_strong_s: float) -> float:
    """Seconds from the last strong count to the held pose. 0 is on time.

    The delay is negative if the pose is held earlier, and nan if it is never held.

    Examples
    --------
    >>> pos_m = np.zeros((180, 21, 3))  # 2 s of 1 m/s, then 1 s of standing still
    >>> pos_m[:, :, 0] = np.minimum(np.arange(180) / 60, 2.0)[:, None]
    >>> cg.metrics.endings.hold_delay_s(pos_m, 60.0, last_strong_s=1.5)
    0.5
    """
    validate(body_pos_m, fps, last_strong_s)
    return held_from_s(body_pos_m, fps) - last_strong_s


@default_numerics()
def evaluate(body_pos_m: Floats, fps: float, last_strong_s: float | None = None) -> dict[str, float]:
    """All metrics of this module by name. The delay needs the last strong count of the song.

    Examples
    --------
    >>> cg.metrics.endings.evaluate(np.zeros((60, 21, 3)), 60.0)
    {'opening_speed_m_s': 0.0, 'closing_speed_m_s': 0.0, 'closing_held': 1.0, 'closing_lift_cm': 0.0,
     'frozen_ends_share': 1.0}
    """
    validate(body_pos_m, fps, last_strong_s)
    scores = {
        "opening_speed_m_s": opening_speed_m_s(body_pos_m, fps),
        "closing_speed_m_s": closing_speed_m_s(body_pos_m, fps),
        "closing_held": float(not np.isnan(held_from_s(body_pos_m, fps))),
        "closing_lift_cm": closing_lift_cm(body_pos_m, fps),
        "frozen_ends_share": frozen_ends_share(body_pos_m, fps),
    }
    if last_strong_s is not None:
        scores["hold_delay_s"] = hold_delay_s(body_pos_m, fps, last_strong_s)
    return scores


def _speed(body_pos_m: Floats, fps: float) -> tuple[Floats, Floats]:
    """Times at which a 60th of a second starts, and the mean joint speed over it, both (T' - 1,)."""
    pos = body_pos_at(body_pos_m, fps, STORE_FPS)
    speed = np.linalg.norm(np.diff(pos, axis=0), axis=-1).mean(axis=1) * STORE_FPS
    return frame_times_s(len(speed), STORE_FPS), speed


def _frames(span_s: float) -> int:
    return max(1, seconds_to_frames(span_s, STORE_FPS))


def _mean(values: Floats) -> float:
    return float(values.mean()) if len(values) else float("nan")
