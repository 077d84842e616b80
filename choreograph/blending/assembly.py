"""From a plan to one motion: runs of seconds sampled from their takes, placed, joined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.runs import Run
from choreograph.blending.sampled_runs import MotionReader, SampledRun, join, placed, play
from choreograph.config import BLENDINGS, TRANSITION_LENGTHS_S
from choreograph.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]


def assemble(
    runs: Sequence[Run], read_motion: MotionReader, *, fps: float, duration_s: float, blending: str
) -> tuple[Motion, NDArray[np.float64]]:
    """The dance before its feet are locked, and the instants of its joins in seconds.

    Each run is turned about Y and shifted on the ground so that its body stands where the last one's
    stood at the join, and steered a little so that the dance stays on a stage (ours).
    `linear` is the paper's crossfade; `inertial` lets the difference of pose, speed and acceleration
    die away on both sides, so that neither motion is smeared. Short runs are joined in less time.

    Raises `ParameterError` for an unknown blending.
    """
    if blending not in BLENDINGS:
        raise ParameterError(f"expected a blending among {', '.join(BLENDINGS)}, got {blending!r}")
    longest_s = max((*TRANSITION_LENGTHS_S[blending], *(run.transition_s or 0.0 for run in runs)))
    margin = seconds_to_frames(longest_s + 0.05, fps)
    total = seconds_to_frames(runs[-1].stop_s, fps) if runs else 0
    root_out = np.empty((total, 3))
    quat_out: Floats | None = None
    previous: SampledRun | None = None
    for run in runs:
        played = play(run, read_motion, fps, margin)
        if previous is not None:
            played = placed(previous, played, fps)
        if quat_out is None:
            quat_out = np.empty((total, *played.quat.shape[1:]))
        body = played.rows(played.start, played.stop)
        root_out[played.start : played.stop] = played.root[body]
        quat_out[played.start : played.stop] = played.quat[body]
        if previous is not None:
            join(previous, played, blending, fps, root_out, quat_out)
        previous = played
    if previous is None or quat_out is None:
        raise ParameterError("expected a plan of one second or more, got none")
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    motion = Motion(previous.motion.skeleton, root_out, rot.make_continuous(rot.normalize(quat_out)), fps)
    transition_times_s = np.array([run.start_s for run in runs[1:]], np.float64)
    return motion.sliced(0, min(n_frames, total)), transition_times_s
