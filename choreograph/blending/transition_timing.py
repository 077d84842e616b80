"""When a run takes over from the one before, and how long that takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.runs import Run, TransitionTiming
from choreograph.blending.sampled_runs import MotionReader, SampledRun, alignment_at, sample_run
from choreograph.config import TRANSITION_LENGTHS_S
from choreograph.progress import StepReport

Floats = NDArray[np.float64]

_MIN_RUN_S = 0.6  # a run is not made shorter
# Greatest acceleration by an offset x, times x / T², and by its rate v, times v / T: where two sides share
# the offset, and where one alone brings it to rest.
_PEAKS_SHARED = 1.45, 2.0
_PEAKS_ALONE = 5.8, 4.0
_EASY_M_S2 = 4.0  # a body may be accelerated so much by a transition: gentle beside what dancers do


def time_transitions(
    runs: Sequence[Run],
    joins_s: Sequence[float],
    take_lengths_s: Mapping[str, float],
    read_motion: MotionReader,
    *,
    fps: float,
    blending: str,
    fixed: Sequence[bool] = (),
    report: StepReport | None = None,
) -> list[TransitionTiming]:
    """When each run takes over from the one before, and how long that takes (N,); the first at its start.

    A run takes over at its instant of `joins_s` (N,), a count near its start, if both takes reach that far
    and neither run becomes shorter than 0.6 s; else, or if it is `fixed` (N,), at its start. Where it starts
    later, the run before plays on; where it starts earlier, the one before ends earlier. An inertial
    transition is the shortest that accelerates no joint by more than 4 m/s². ChoreoGraph changes takes on
    the second.
    """
    starts = [runs[0].start_s] if runs else []
    for index, (before, after) in enumerate(pairwise(runs), start=1):
        held = before.locked or after.locked or (bool(fixed) and fixed[index])
        at_s = float(joins_s[index])
        possible = (
            not held
            and min(at_s - starts[-1], after.stop_s - at_s) >= _MIN_RUN_S
            and before.source_s(np.array([at_s]))[0] <= take_lengths_s[before.take]
            and after.source_s(np.array([at_s]))[0] >= 0.0
        )
        starts.append(at_s if possible else after.start_s)
    lengths = []
    for (before, after), at_s in zip(pairwise(runs), starts[1:], strict=True):
        lengths.append(_length_s(before, after, at_s, read_motion, fps, blending))
        if report is not None:
            report(len(lengths) + 1, len(runs))
    return [
        TransitionTiming(at_s, length_s)
        for at_s, length_s in zip(starts, (*(run.transition_s for run in runs[:1]), *lengths), strict=True)
    ]


def _length_s(
    before: Run, after: Run, at_s: float, read_motion: MotionReader, fps: float, blending: str
) -> float:
    """The shortest length of the blending that is gentle enough, else its longest."""
    options = sorted(TRANSITION_LENGTHS_S[blending])
    if len(options) == 1:
        return options[0]
    # Longer than a frame, so that there are three around the instant.
    span = slice(at_s - 2.0 / fps, at_s + 2.0 / fps)
    a, b = (sample_run(run.cut(span.start, span.stop), read_motion, fps, 1) for run in (before, after))
    offset_m, rate_m_s = _offset(a, b, fps)
    of_offset, of_rate = _PEAKS_ALONE if before.locked != after.locked else _PEAKS_SHARED
    peaks = [np.max(of_offset * offset_m / length**2 + of_rate * rate_m_s / length) for length in options]
    return next(
        (length for length, peak in zip(options, peaks, strict=True) if peak <= _EASY_M_S2), options[-1]
    )


def _offset(a: SampledRun, b: SampledRun, fps: float) -> tuple[Floats, Floats]:
    """Distance and difference of velocity of every joint (21,), once b stands where a stands."""
    frame = a.start + 1
    aligned = b.moved(*alignment_at(a, b, frame))
    apart = [aligned.body_at(at) - a.body_at(at) for at in (frame - 1, frame, frame + 1)]
    return np.linalg.norm(apart[1], axis=-1), np.linalg.norm(apart[2] - apart[0], axis=-1) * fps / 2
