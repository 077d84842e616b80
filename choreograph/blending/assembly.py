"""All runs of a dance as one motion: sampled from their takes, aligned, and blended at transitions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.runs import Run
from choreograph.blending.sampled_runs import MotionReader, SampledRun, align_to, sample_run
from choreograph.blending.transitions import blend_transition
from choreograph.config import BLENDINGS, TRANSITION_LENGTHS_S
from choreograph.errors import ParameterError
from choreograph.frame_blocks import frame_blocks
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.progress import StepReport
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]


def assemble(
    runs: Sequence[Run],
    read_motion: MotionReader,
    *,
    fps: float,
    duration_s: float,
    blending: str,
    keep_on_stage: bool = True,
    report: StepReport | None = None,
) -> tuple[Motion, NDArray[np.float64]]:
    """The dance before foot locking, and the times of its transitions in seconds.

    Each run is rotated about Y and shifted on the ground so that its body stands where the previous run's
    stood at the transition (the paper does not say how nodes are joined), and steered a little to keep the
    dance on the stage (`keep_on_stage`, ours).
    `linear` is the paper's crossfade. With `inertial` the difference of pose, velocity and acceleration
    decays on both sides, so that neither motion is smeared. Transitions between short runs are shorter.

    Raises `ParameterError` for an unknown blending, or if there is no run.
    """
    if blending not in BLENDINGS:
        raise ParameterError(f"expected a blending among {', '.join(BLENDINGS)}, got {blending!r}")
    longest_s = max((*TRANSITION_LENGTHS_S[blending], *(run.transition_s or 0.0 for run in runs)))
    margin = max(2, seconds_to_frames(longest_s + 0.05, fps))  # frames: velocities need two beyond the end
    total = seconds_to_frames(runs[-1].stop_s, fps) if runs else 0
    root_out = np.empty((total, 3))
    quat_out: Floats | None = None
    previous: SampledRun | None = None
    for done, run in enumerate(runs, start=1):
        sampled = sample_run(run, read_motion, fps, margin)
        if previous is not None:
            sampled = align_to(previous, sampled, fps, keep_on_stage=keep_on_stage)
        if quat_out is None:
            quat_out = np.empty((total, *sampled.quat.shape[1:]))
        rows = sampled.rows(sampled.start, sampled.stop)
        root_out[sampled.start : sampled.stop] = sampled.root[rows]
        quat_out[sampled.start : sampled.stop] = sampled.quat[rows]
        if previous is not None:
            blend_transition(previous, sampled, blending, fps, root_out, quat_out)
        previous = sampled
        if report is not None:
            report(done, len(runs))
    if previous is None or quat_out is None:
        raise ParameterError("expected a plan of one second or more, got none")
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    for block in frame_blocks(total):
        quat_out[block] = rot.normalize(quat_out[block])
    motion = Motion(previous.motion.skeleton, root_out, rot.make_continuous(quat_out), fps)
    transition_times_s = np.array([run.start_s for run in runs[1:]], np.float64)
    return motion.sliced(0, min(n_frames, total)), transition_times_s
