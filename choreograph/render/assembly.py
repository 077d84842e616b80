"""Assembles runs to one motion: they are sampled from their takes, aligned, and blended at transitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np

from choreograph.core.arguments import as_stage_m, check_choice
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.progress import StepReport
from choreograph.core.timebase import seconds_to_frames
from choreograph.motion import rotations as rot
from choreograph.motion.body import ground_pos_m
from choreograph.motion.motion import Motion
from choreograph.render.runs import MotionReader, Run, RunSampler, SampledRun, align_to, sample_run
from choreograph.render.transitions import Joins, blend_transition, feet_at_join
from choreograph.settings import TRANSITION_LENGTHS_S, Blending


def assemble(
    runs: Sequence[Run],
    read_motion: MotionReader,
    *,
    fps: float,
    duration_s: float,
    blending: str,
    stage: str = "near",
    to_front: bool = True,
    sample: RunSampler = sample_run,
    report: StepReport | None = None,
) -> tuple[Motion, Joins]:
    """The dance before foot locking, and its joins.

    Each run is rotated about Y and shifted on the ground so that its body stands where the previous run's
    stood at the transition (the paper does not say how nodes are joined), and steered a little to face the
    audience (`to_front`) and to keep the dance on the `stage`, both ours. The dance begins in the middle of
    the stage. If that has borders, its middle is above the origin.
    `linear` is the paper's crossfade. With `inertial` the difference of pose, velocity and acceleration
    decays on both sides, so that neither motion is smeared. Transitions between short runs are shorter.

    Raises `ParameterError` for an unknown blending, or if there is no run.
    """
    check_choice("a blending", blending, get_args(Blending))
    longest_s = max((*TRANSITION_LENGTHS_S[blending], *(run.transition_s or 0.0 for run in runs)))
    margin = max(2, seconds_to_frames(longest_s + 0.05, fps))  # frames: velocities need two beyond the end
    total = seconds_to_frames(runs[-1].stop_s, fps) if runs else 0
    root_out = np.empty((total, 3))
    quat_out: Floats | None = None
    feet_m: list[tuple[int, Floats]] = []
    previous: SampledRun | None = None
    middle_m = np.zeros(3)  # of the stage
    for done, run in enumerate(runs, start=1):
        sampled = sample(run, read_motion, fps, margin)
        if previous is None:
            middle_m = ground_pos_m(sampled.body_at(sampled.start))
            if as_stage_m(stage):
                sampled, middle_m = sampled.moved(0.0, -middle_m), np.zeros(3)
        else:
            bent = "free" if to_front and run is runs[-1] else stage  # so that the last pose faces the front
            sampled = align_to(previous, sampled, fps, stage=bent, middle_m=middle_m, to_front=to_front)
        if quat_out is None:
            quat_out = np.empty((total, *sampled.quat.shape[1:]))
        rows = sampled.rows(sampled.start, sampled.stop)
        root_out[sampled.start : sampled.stop] = sampled.root[rows]
        quat_out[sampled.start : sampled.stop] = sampled.quat[rows]
        if previous is not None:
            blend_transition(previous, sampled, blending, fps, root_out, quat_out)
            feet_m += feet_at_join(previous, sampled, fps)
        previous = sampled
        if report is not None:
            report(done, len(runs))
    if previous is None or quat_out is None:
        raise ParameterError("expected a plan of one second or more, got none")
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    for block in frame_blocks(total):
        quat_out[block] = rot.normalize(quat_out[block])
    motion = Motion(previous.skeleton, root_out, rot.make_continuous(quat_out, out=quat_out), fps)
    joins = Joins(np.array([run.start_s for run in runs[1:]], np.float64), tuple(feet_m))
    return motion.sliced(0, min(n_frames, total)), joins


def off_stage(motion: Motion, stage: str) -> tuple[str, ...]:
    """A note if a dance leaves a `stage` such as "4x3", which it begins in the middle of. None otherwise.

    Raises `ParameterError` for what is no stage.
    """
    size_m = as_stage_m(stage)
    if size_m is None:
        return ()
    places_m = np.abs(motion.root_pos_m - motion.root_pos_m[0])[:, [0, 2]]  # (T, 2)
    outside = float((places_m > np.array(size_m) / 2).any(axis=1).mean())
    if outside == 0:
        return ()
    return (f"the dancer is off the stage ({stage} m) for {max(outside, 0.01):.0%} of the time",)
