"""Transitions and ends: how often a dance goes from take to take, where, and how it begins and ends.

Conventions: transitions (B,) are in seconds of the dance, increasing. Each is the instant at which one take
gives way to another. A bar border is a downbeat, a music beat (Q,) numbered 1. Figure borders (F,) are the
instants, in seconds of the dance, at which the outgoing or the incoming take of a transition is at the start
or end of one of its figures. Takes whose figures are not known have none. "At" is within `WITHIN_BEATS` beat.
A beat is the interval between the music beats around the transition.

The shares tell where transitions are. `physical` measures the speed and the jerk there. A share of nothing is
nan.

At both ends, speed is the mean over the joints of the distance covered in 1/60 s, in m/s, with root motion,
of body positions (T, 21, 3) in metres at `fps`. A pose is held while the speed is below `HELD_M_S`. Breathing
and marker noise of a standing dancer are 0.03 to 0.1 m/s. Below `FROZEN_M_S`, a body is frozen, since no
dancer stands so still. A body that never moves is held throughout, so compare these values with the speed of
the dance itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import STORE_FPS, frame_times_s, seconds_to_frames
from choreograph.evaluation.metrics import counts
from choreograph.evaluation.metrics.counts import WITHIN_BEATS, beat_positions
from choreograph.evaluation.metrics.physical import ANKLE_OVER_SOLE_M
from choreograph.motion.body import BODY_JOINTS, body_pos_at, checked_body_pos_m


def validate(transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike) -> None:
    """Raise `ParameterError` unless transitions and beats increase and every beat has a number.

    Examples
    --------
    >>> cg.metrics.transitions.validate([1.0], beats_s=[0.0, 0.5], beat_numbers=[1, 2])
    >>> cg.metrics.transitions.validate([2.0, 1.0], beats_s=[0.0, 0.5], beat_numbers=[1, 2])
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected increasing, finite transitions in seconds, got shape (2,)
    """
    for name, times_s in (("transitions", transitions_s), ("music beats", beats_s)):
        times = np.asarray(times_s, np.float64)
        if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise ParameterError(f"expected increasing, finite {name} in seconds, got shape {times.shape}")
    if np.shape(beat_numbers) != np.shape(beats_s):
        raise ParameterError(
            f"expected a number in the bar for each beat {np.shape(beats_s)}, got {np.shape(beat_numbers)}"
        )


def transitions_per_minute(transitions_s: ArrayLike, duration_s: float) -> float:
    """Transitions per minute of a dance of `duration_s`. Nearer to real dances is better.

    Examples
    --------
    >>> cg.metrics.transitions.transitions_per_minute([2.0, 6.0, 9.0], duration_s=30.0)
    6.0
    """
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise ParameterError(f"expected a duration above 0 s, got {duration_s}")
    return np.size(transitions_s) * 60.0 / duration_s


def mean_gap_s(transitions_s: ArrayLike) -> float:
    """Mean time from a transition to the next, in seconds. nan with fewer than two.

    Examples
    --------
    >>> cg.metrics.transitions.mean_gap_s([2.0, 6.0, 8.0])
    3.0
    """
    gaps_s = np.diff(np.asarray(transitions_s, np.float64))
    return float(gaps_s.mean()) if len(gaps_s) else float("nan")


def on_counts(transitions_s: ArrayLike, beats_s: ArrayLike) -> float:
    """Share of the transitions at a music beat, 0 to 1. Higher is better. 0.30 is chance.

    Examples
    --------
    >>> cg.metrics.transitions.on_counts([1.0, 2.25], beats_s=np.arange(16) / 2)
    0.5
    """
    position = beat_positions(transitions_s, beats_s)
    position = position[~np.isnan(position)]
    return _share(np.abs(position - np.round(position)) <= WITHIN_BEATS + 1e-9)


def at_bar_borders(transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike) -> float:
    """Share of the transitions at a downbeat, 0 to 1. Higher is better. 0.30 / metre is chance.

    The result is nan without downbeats.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)  # bars of 2 s
    >>> cg.metrics.transitions.at_bar_borders([2.0, 4.0, 4.5, 5.0], beats_s, numbers)
    0.5
    """
    validate(transitions_s, beats_s, beat_numbers)
    if not _has_bars(beat_numbers):
        return float("nan")
    return _share(_at_bars(transitions_s, beats_s, beat_numbers))


def at_figure_borders(transitions_s: ArrayLike, beats_s: ArrayLike, figure_borders_s: ArrayLike) -> float:
    """Share of the transitions at which one of the two takes is at a border of a figure, 0 to 1.

    Higher is better.

    Examples
    --------
    >>> borders_s = [2.0, 6.0]
    >>> cg.metrics.transitions.at_figure_borders([2.0, 4.0], np.arange(16) / 2, borders_s)
    0.5
    """
    return _share(_at_figures(transitions_s, beats_s, figure_borders_s))


def at_borders(
    transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike, figure_borders_s: ArrayLike
) -> float:
    """Share of the transitions at the border of a bar or of a figure, 0 to 1. Higher is better.

    The result is nan if neither kind is known.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)  # bars of 2 s
    >>> cg.metrics.transitions.at_borders([2.0, 3.0, 3.5], beats_s, numbers, [3.0]) > 0.6
    True
    """
    validate(transitions_s, beats_s, beat_numbers)
    if not _has_bars(beat_numbers) and np.size(figure_borders_s) == 0:
        return float("nan")
    figures = _at_figures(transitions_s, beats_s, figure_borders_s)
    return _share(_at_bars(transitions_s, beats_s, beat_numbers) | figures)


@default_numerics()
def evaluate(
    transitions_s: ArrayLike,
    duration_s: float,
    beats_s: ArrayLike,
    beat_numbers: ArrayLike,
    figure_borders_s: ArrayLike = (),
) -> dict[str, float]:
    """All metrics of this module by name. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> beats_s, numbers = np.arange(16) / 2, np.tile([1, 2, 3, 4], 4)  # bars of 2 s
    >>> scores = cg.metrics.transitions.evaluate([2.0, 4.0], 8.0, beats_s, numbers)
    >>> scores["transitions_per_minute"], scores["transitions_at_bar_borders"]
    (15.0, 1.0)
    """
    validate(transitions_s, beats_s, beat_numbers)
    return {
        "transitions_per_minute": transitions_per_minute(transitions_s, duration_s),
        "transition_gap_s": mean_gap_s(transitions_s),
        "transitions_on_counts": on_counts(transitions_s, beats_s),
        "transitions_at_bar_borders": at_bar_borders(transitions_s, beats_s, beat_numbers),
        "transitions_at_figure_borders": at_figure_borders(transitions_s, beats_s, figure_borders_s),
        "transitions_at_borders": at_borders(transitions_s, beats_s, beat_numbers, figure_borders_s),
    }


def uniform_chance(metre: int) -> dict[str, float]:
    """Exact shares of transitions at random instants of a steady beat of that metre.

    Raises `ParameterError` unless the metre is 1 or more.

    Examples
    --------
    >>> cg.metrics.transitions.uniform_chance(4)
    {'transitions_on_counts': 0.3, 'transitions_at_bar_borders': 0.075}
    """
    of_counts = counts.uniform_chance(metre)
    return {
        "transitions_on_counts": of_counts["counts_within"],
        "transitions_at_bar_borders": of_counts["downbeat_share"],
    }


def _has_bars(beat_numbers: ArrayLike) -> bool:
    return bool((np.asarray(beat_numbers) == 1).any())


def _at_bars(transitions_s: ArrayLike, beats_s: ArrayLike, beat_numbers: ArrayLike) -> NDArray[np.bool_]:
    """Whether each transition is at a downbeat, (B,)."""
    downbeats_s = np.asarray(beats_s, np.float64)[np.asarray(beat_numbers) == 1]
    return _near(transitions_s, downbeats_s, beats_s)


def _at_figures(
    transitions_s: ArrayLike, beats_s: ArrayLike, figure_borders_s: ArrayLike
) -> NDArray[np.bool_]:
    """Whether each transition is at a border of a figure, (B,)."""
    borders_s = np.sort(np.asarray(figure_borders_s, np.float64))
    if borders_s.ndim != 1 or not np.isfinite(borders_s).all():
        raise ParameterError(f"expected finite figure borders (F,) in seconds, got shape {borders_s.shape}")
    return _near(transitions_s, borders_s, beats_s)


def _near(times_s: ArrayLike, borders_s: Floats, beats_s: ArrayLike) -> NDArray[np.bool_]:
    """Whether each time (B,) is within `WITHIN_BEATS` beat of any border (F,). False without beats."""
    times = np.asarray(times_s, np.float64)
    if np.size(beats_s) < 2:
        return np.zeros(len(times), bool)
    apart = beat_positions(borders_s, beats_s) - beat_positions(times, beats_s)[:, None]  # (B, F)
    result: NDArray[np.bool_] = np.any(np.abs(apart) <= WITHIN_BEATS + 1e-9, axis=1)
    return result


def _share(flags: NDArray[np.bool_]) -> float:
    return float(flags.mean()) if len(flags) else float("nan")


# Both ends of a dance: held poses, frozen or alive, and whether it ends on time.


END_S = 0.3
HELD_M_S = 0.15
FROZEN_M_S = 0.02
_FEET = [
    (BODY_JOINTS.index(f"{side}_ankle"), BODY_JOINTS.index(f"{side}_foot")) for side in ("left", "right")
]


def validate_ends(body_pos_m: Floats, fps: float, last_strong_s: float | None = None) -> None:
    """Raise `ParameterError` unless positions (T, 21, 3), rate and the time of the count are valid.

    Examples
    --------
    >>> cg.metrics.transitions.validate_ends(np.zeros((60, 21, 3)), 60.0, last_strong_s=0.5)
    >>> cg.metrics.transitions.validate_ends(np.zeros((60, 21, 3)), 60.0, last_strong_s=np.nan)
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
    >>> round(cg.metrics.transitions.opening_speed_m_s(pos_m, 60.0), 2)
    1.0
    """
    return _mean(_speed(body_pos_m, fps)[1][: _frames(span_s)])


def closing_speed_m_s(body_pos_m: Floats, fps: float, *, span_s: float = END_S) -> float:
    """Mean joint speed in the last `span_s`, in m/s. Low is a held pose. nan for a single frame.

    Examples
    --------
    >>> pos_m = np.zeros((180, 21, 3))  # 2 s of 1 m/s, then 1 s of standing still
    >>> pos_m[:, :, 0] = np.minimum(np.arange(180) / 60, 2.0)[:, None]
    >>> cg.metrics.transitions.closing_speed_m_s(pos_m, 60.0)
    0.0
    """
    return _mean(_speed(body_pos_m, fps)[1][-_frames(span_s) :])


def held_from_s(body_pos_m: Floats, fps: float, *, held_m_s: float = HELD_M_S) -> float:
    """The time from which the pose is held to the end of the dance, in seconds. nan if it moves to the end.

    Examples
    --------
    >>> pos_m = np.zeros((180, 21, 3))  # 2 s of 1 m/s, then 1 s of standing still
    >>> pos_m[:, :, 0] = np.minimum(np.arange(180) / 60, 2.0)[:, None]
    >>> cg.metrics.transitions.held_from_s(pos_m, 60.0)
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
    >>> round(cg.metrics.transitions.frozen_ends_share(pos_m, 60.0), 1)
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
    >>> round(cg.metrics.transitions.closing_lift_cm(pos_m, 60.0), 3)
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
    >>> cg.metrics.transitions.hold_delay_s(pos_m, 60.0, last_strong_s=1.5)
    0.5
    """
    validate_ends(body_pos_m, fps, last_strong_s)
    return held_from_s(body_pos_m, fps) - last_strong_s


@default_numerics()
def evaluate_ends(body_pos_m: Floats, fps: float, last_strong_s: float | None = None) -> dict[str, float]:
    """The metrics of both ends by name. The delay needs the last strong count of the song.

    Examples
    --------
    >>> cg.metrics.transitions.evaluate_ends(np.zeros((60, 21, 3)), 60.0)
    {'opening_speed_m_s': 0.0, 'closing_speed_m_s': 0.0, 'closing_held': 1.0, 'closing_lift_cm': 0.0,
     'frozen_ends_share': 1.0}
    """
    validate_ends(body_pos_m, fps, last_strong_s)
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
