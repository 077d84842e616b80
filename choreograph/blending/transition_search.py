"""When and how fast a run takes over from the one before: where the blended motion best keeps the beat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.blending.runs import Run, TransitionTiming
from choreograph.blending.sampled_runs import MotionReader, SampledRun, alignment_at, sample_run
from choreograph.blending.transitions import blend_transition
from choreograph.config import TRANSITION_LENGTHS_S
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.motion.body import body_indices, body_pos_m
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]

REACH_S = 0.5  # a transition is moved no further: what plays until then was not warped to the music
_STEP_S = 0.1  # between the times tried, which include the music beats
_MIN_RUN_S = 0.6  # a run is not made shorter
_WINDOW_S = 1.3  # rendered to each side of the border,
_SCORED_S = 1.0  # and scored: what a transition can move, without the window's own ends
_TRIED_WITH_LOCKED_FEET = 6  # transitions: those that keep the beat best without foot locking
_MAX_GAP_S = 0.25  # beats further apart than this are unrelated


def search_transitions(
    runs: Sequence[Run],
    beat_times_s: Floats,
    take_lengths_s: Mapping[str, float],
    read_motion: MotionReader,
    *,
    fps: float,
    blending: str,
    fixed: Sequence[bool] = (),
) -> list[TransitionTiming]:
    """When each run takes over from the one before, and how long that takes (N,); the first at its start.

    Transitions add motion beats and remove them. One after the other, each is tried at several times around
    its border, on music beats and between, with every length that the blending has. The motion around it is
    rendered, for the most promising ones with locked feet, and its motion beats are detected. The transition
    with the smallest sum of squared distances between motion and music beats, both ways, is kept. Where the
    second run starts later, the first plays on; where it starts earlier, the first ends earlier. A run that
    is `fixed` (N,) takes over at its start. ChoreoGraph changes takes on the second.
    """
    timings = [TransitionTiming(run.start_s, run.transition_s) for run in runs]
    if len(runs) < 2:
        return timings
    reach, window = seconds_to_frames(REACH_S, fps), seconds_to_frames(_WINDOW_S, fps)
    margin = reach + seconds_to_frames(max(TRANSITION_LENGTHS_S[blending]) + 0.05, fps)
    a = sample_run(runs[0], read_motion, fps, margin)
    total = seconds_to_frames(runs[-1].stop_s, fps) + reach
    root_out, quat_out = np.empty((total, 3)), np.empty((total, *a.quat.shape[1:]))
    _write(a, a.stop + reach, root_out, quat_out)
    for index in range(1, len(runs)):
        border = sample_run(runs[index], read_motion, fps, margin)
        first, stop = max(0, border.start - window), min(border.start + window, border.stop)
        tried: list[tuple[SampledRun, Floats, Floats]] = []
        frames = [border.start]
        if not (fixed and fixed[index]):
            frames = _start_frames(runs[index - 1 : index + 1], a.start, beat_times_s, take_lengths_s, fps)
        for frame in frames:
            aligned = replace(border.moved(*alignment_at(a, border, frame)), start=frame)
            for transition_s in TRANSITION_LENGTHS_S[blending]:
                b = replace(aligned, transition_s=transition_s)
                root, quat = root_out[first:stop].copy(), quat_out[first:stop].copy()
                rows = b.rows(frame, stop)
                root[frame - first :], quat[frame - first :] = b.root[rows], b.quat[rows]
                blend_transition(a, b, blending, fps, root, quat, first)
                tried.append((b, root, quat))
        best = _best([(root, quat) for _, root, quat in tried], b, first, border.start, beat_times_s, fps)
        b, root, quat = tried[best]
        _write(b, b.stop + reach, root_out, quat_out)
        root_out[first:stop], quat_out[first:stop] = root, quat
        timings[index] = TransitionTiming(b.start / fps, b.transition_s)
        a = b
    return timings


def _write(sampled: SampledRun, stop: int, root_out: Floats, quat_out: Floats) -> None:
    stop = min(stop, len(root_out))
    rows = sampled.rows(sampled.start, stop)
    root_out[sampled.start : stop], quat_out[sampled.start : stop] = sampled.root[rows], sampled.quat[rows]


def _start_frames(
    pair: Sequence[Run], start: int, beat_times_s: Floats, take_lengths_s: Mapping[str, float], fps: float
) -> list[int]:
    """Frames at which the second run may take over from the first, which starts at `start`: nearest first."""
    before, after = pair
    border = seconds_to_frames(after.start_s, fps)
    if before.locked or after.locked:
        return [border]
    steps_s = after.start_s + _STEP_S * np.arange(-round(REACH_S / _STEP_S), round(REACH_S / _STEP_S) + 1)
    near_s = beat_times_s[np.abs(beat_times_s - after.start_s) <= REACH_S]
    shortest = seconds_to_frames(_MIN_RUN_S, fps)
    frames = {border}
    for time_s in (*steps_s, *near_s):
        frame = seconds_to_frames(float(time_s), fps)
        long_enough = min(frame - start, seconds_to_frames(after.stop_s, fps) - frame) >= shortest
        at_s = np.array([frame / fps])
        within = before.source_s(at_s)[0] <= take_lengths_s[before.take] and after.source_s(at_s)[0] >= 0.0
        # Rounding may put half a second half a frame beyond the reach, where nothing is sampled.
        if long_enough and within and abs(frame - border) <= seconds_to_frames(REACH_S, fps):
            frames.add(frame)
    return sorted(frames, key=lambda frame: abs(frame - border))


def _best(
    tried: Sequence[tuple[Floats, Floats]],
    sampled: SampledRun,
    first: int,
    border: int,
    beat_times_s: Floats,
    fps: float,
) -> int:
    """Index of the motion, (T, 3) and (T, J, 4) from dance frame `first` on, that is nearest to the beat."""
    if len(tried) == 1:
        return 0
    skeleton = sampled.motion.skeleton
    roots, quats = (np.stack(arrays) for arrays in zip(*tried, strict=True))
    bodies_m = forward(skeleton, roots, quats)[0][:, :, body_indices(skeleton)]  # (C, T, 21, 3)
    around_s = border / fps

    def gaps_s2(body_m: Floats) -> float:
        """How far apart motion and music beats are around the border for a body (T, 21, 3)."""
        return _squared_gaps_s2(first / fps + motion_beat_times_s(body_m, fps), beat_times_s, around_s)

    # Foot locking moves motion beats as well, but takes longer than everything else here.
    promising = np.argsort([gaps_s2(body_m) for body_m in bodies_m], kind="stable")[:_TRIED_WITH_LOCKED_FEET]
    motions = [Motion(skeleton, roots[row], quats[row], fps) for row in promising]
    locked = [lock_feet(motion, shift_s=DANCE_SHIFT_S) for motion in motions]
    return int(promising[np.argmin([gaps_s2(body_pos_m(motion)) for motion in locked])])


def _squared_gaps_s2(motion_s: Floats, music_s: Floats, around_s: float) -> float:
    """Sum of squared, capped distances from each beat around a time to the nearest of the other kind."""
    return sum(
        float(np.square(_nearest_s(own[np.abs(own - around_s) <= _SCORED_S], others)).sum())
        for own, others in ((motion_s, music_s), (music_s, motion_s))
    )


def _nearest_s(times_s: Floats, others_s: Floats) -> Floats:
    """Distance of each time (N,) to the nearest of the others, at most `_MAX_GAP_S`."""
    apart = np.abs(times_s[:, None] - others_s[None, :])
    return np.minimum(apart.min(axis=1, initial=_MAX_GAP_S), _MAX_GAP_S)
