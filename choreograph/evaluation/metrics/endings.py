"""Endings: whether a dance begins in a held pose and closes in one, on time.

Conventions: body positions (T, 21, 3) in metres at `fps`. Speed is the mean over the joints of the distance
covered in 1/60 s, in m/s, root motion included; a pose is held while it is below `HELD_M_S` (breathing and
marker noise of a standing dancer are 0.03 to 0.1). A body that never moves is held throughout: read these
beside the speed of the dance itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics
from choreograph.core.timebase import STORE_FPS, frame_times_s, seconds_to_frames
from choreograph.motion.body import body_pos_at, checked_body_pos_m

Floats = NDArray[np.float64]

END_S = 0.3
HELD_M_S = 0.15


def validate(body_pos_m: Floats, fps: float, last_strong_s: float | None = None) -> None:
    """Raise `ParameterError` unless positions (T, 21, 3), rate and the time of the count are valid."""
    checked_body_pos_m(body_pos_m, fps)
    if last_strong_s is not None and not np.isfinite(last_strong_s):
        raise ParameterError(f"expected the last strong count in seconds, got {last_strong_s}")


def opening_speed_m_s(body_pos_m: Floats, fps: float, *, span_s: float = END_S) -> float:
    """Mean joint speed in the first `span_s`, m/s; nan for a single frame."""
    return _mean(_speed(body_pos_m, fps)[1][: _frames(span_s)])


def closing_speed_m_s(body_pos_m: Floats, fps: float, *, span_s: float = END_S) -> float:
    """Mean joint speed in the last `span_s`, m/s; nan for a single frame."""
    return _mean(_speed(body_pos_m, fps)[1][-_frames(span_s) :])


def held_from_s(body_pos_m: Floats, fps: float, *, held_m_s: float = HELD_M_S) -> float:
    """The time from which the pose is held to the end of the dance; nan if it moves to the end."""
    times_s, speed = _speed(body_pos_m, fps)
    if len(speed) == 0:
        return 0.0
    moving = np.flatnonzero(speed >= held_m_s)
    if len(moving) == 0:
        return 0.0
    return float(times_s[moving[-1] + 1]) if moving[-1] + 1 < len(speed) else float("nan")


def hold_delay_s(body_pos_m: Floats, fps: float, last_strong_s: float) -> float:
    """Seconds from the last strong count to the pose held; below 0 if it is held before; nan if never."""
    validate(body_pos_m, fps, last_strong_s)
    return held_from_s(body_pos_m, fps) - last_strong_s


@default_numerics()
def evaluate(body_pos_m: Floats, fps: float, last_strong_s: float | None = None) -> dict[str, float]:
    """All metrics of this module by name; the delay only with the song's last strong count."""
    validate(body_pos_m, fps, last_strong_s)
    scores = {
        "opening_speed_m_s": opening_speed_m_s(body_pos_m, fps),
        "closing_speed_m_s": closing_speed_m_s(body_pos_m, fps),
        "closing_held": float(not np.isnan(held_from_s(body_pos_m, fps))),
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
