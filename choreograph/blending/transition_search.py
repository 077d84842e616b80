"""Where and how fast a run gives way to the next: as the joined motion, measured, keeps the beat best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.foot_locking import DANCE_SHIFT_S, lock_feet
from choreograph.blending.runs import Run, TransitionTiming
from choreograph.blending.sampled_runs import MotionReader, SampledRun, alignment_at, join, play
from choreograph.config import TRANSITION_LENGTHS_S
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.motion.body import body_indices, body_pos_m
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.timebase import seconds_to_frames

Floats = NDArray[np.float64]

REACH_S = 0.5  # a join is moved no further: what is played meanwhile was not warped to the music
_STEP_S = 0.1  # instants tried, and the beats among them
_SHORTEST_S = 0.6  # a run is not made shorter than that
_WINDOW_S = 1.3  # rendered to each side of the border,
_JUDGED_S = 1.0  # and judged: what a join can move, but not the window's own ends
_TRIED_WITH_FEET_HELD = 6  # of the joins, those that keep time best without
_LONELY_S = 0.25  # beats further apart than that have nothing to do with one another


def search_transitions(
    runs: Sequence[Run],
    beat_times_s: Floats,
    take_lengths_s: Mapping[str, float],
    read_motion: MotionReader,
    *,
    fps: float,
    blending: str,
    held: Sequence[bool] = (),
) -> list[TransitionTiming]:
    """When and how fast each run takes over from the one before (N,); the first at its start.

    Joins make motion beats and unmake them. From the first join on, each is tried at several instants
    around its place, on music beats and between, and with every fade of the blending; the motion around is
    rendered, for the likely ones with its feet held, its beats are found, and the join stays with which
    motion and music beats are the least apart, both ways, in squared seconds. The one run plays on as long
    as the other begins later, or the other way round. A run that is `held` (N,) takes over at its start.
    ChoreoGraph joins on the second.
    """
    transitions = [TransitionTiming(run.start_s, run.transition_s) for run in runs]
    if len(runs) < 2:
        return transitions
    reach, window = seconds_to_frames(REACH_S, fps), seconds_to_frames(_WINDOW_S, fps)
    margin = reach + seconds_to_frames(max(TRANSITION_LENGTHS_S[blending]) + 0.05, fps)
    a = play(runs[0], read_motion, fps, margin)
    total = seconds_to_frames(runs[-1].stop_s, fps) + reach
    root_out, quat_out = np.empty((total, 3)), np.empty((total, *a.quat.shape[1:]))
    _write(a, a.stop + reach, root_out, quat_out)
    for index in range(1, len(runs)):
        border = play(runs[index], read_motion, fps, margin)
        first, stop = max(0, border.start - window), min(border.start + window, border.stop)
        tried: list[tuple[SampledRun, Floats, Floats]] = []
        frames = [border.start]
        if not (held and held[index]):
            frames = _instants(runs[index - 1 : index + 1], a.start, beat_times_s, take_lengths_s, fps)
        for frame in frames:
            met_there = replace(border.moved(*alignment_at(a, border, frame)), start=frame)
            for transition_s in TRANSITION_LENGTHS_S[blending]:
                b = replace(met_there, transition_s=transition_s)
                root, quat = root_out[first:stop].copy(), quat_out[first:stop].copy()
                here = b.rows(frame, stop)
                root[frame - first :], quat[frame - first :] = b.root[here], b.quat[here]
                join(a, b, blending, fps, root, quat, first)
                tried.append((b, root, quat))
        best = _best([(root, quat) for _, root, quat in tried], b, first, border.start, beat_times_s, fps)
        b, root, quat = tried[best]
        _write(b, b.stop + reach, root_out, quat_out)
        root_out[first:stop], quat_out[first:stop] = root, quat
        transitions[index] = TransitionTiming(b.start / fps, b.transition_s)
        a = b
    return transitions


def _write(played: SampledRun, stop: int, root_out: Floats, quat_out: Floats) -> None:
    stop = min(stop, len(root_out))
    rows = played.rows(played.start, stop)
    root_out[played.start : stop], quat_out[played.start : stop] = played.root[rows], played.quat[rows]


def _instants(
    pair: Sequence[Run], start: int, beat_times_s: Floats, take_lengths_s: Mapping[str, float], fps: float
) -> list[int]:
    """Frames at which the second run may take over from the first, which begins at `start`: nearest first."""
    before, after = pair
    border = seconds_to_frames(after.start_s, fps)
    if before.locked or after.locked:
        return [border]
    steps_s = after.start_s + _STEP_S * np.arange(-round(REACH_S / _STEP_S), round(REACH_S / _STEP_S) + 1)
    near_s = beat_times_s[np.abs(beat_times_s - after.start_s) <= REACH_S]
    shortest = seconds_to_frames(_SHORTEST_S, fps)
    frames = {border}
    for instant_s in (*steps_s, *near_s):
        frame = seconds_to_frames(float(instant_s), fps)
        long_enough = min(frame - start, seconds_to_frames(after.stop_s, fps) - frame) >= shortest
        at_s = np.array([frame / fps])
        within = before.source_s(at_s)[0] <= take_lengths_s[before.take] and after.source_s(at_s)[0] >= 0.0
        # Half a second may be half a frame more from a border than from 0; nothing is played there.
        if long_enough and within and abs(frame - border) <= seconds_to_frames(REACH_S, fps):
            frames.add(frame)
    return sorted(frames, key=lambda frame: abs(frame - border))


def _best(
    tried: Sequence[tuple[Floats, Floats]],
    played: SampledRun,
    first: int,
    border: int,
    beat_times_s: Floats,
    fps: float,
) -> int:
    """Which of the motions, roots (T, 3) and rotations (T, J, 4) from dance frame `first` on, keeps time."""
    if len(tried) == 1:
        return 0
    skeleton = played.motion.skeleton
    roots, quats = (np.stack(arrays) for arrays in zip(*tried, strict=True))
    bodies_m = forward(skeleton, roots, quats)[0][:, :, body_indices(skeleton)]  # (C, T, 21, 3)
    around_s = border / fps

    def misses_s2(body_m: Floats) -> float:
        """How far beats are apart around the border if the body (T, 21, 3) is what is danced."""
        return _misses_s2(first / fps + motion_beat_times_s(body_m, fps), beat_times_s, around_s)

    # Held feet make beats and unmake them too, but to hold them takes longer than all else here.
    likely = np.argsort([misses_s2(body_m) for body_m in bodies_m], kind="stable")[:_TRIED_WITH_FEET_HELD]
    motions = [Motion(skeleton, roots[row], quats[row], fps) for row in likely]
    held = [lock_feet(motion, over_s=DANCE_SHIFT_S) for motion in motions]
    return int(likely[np.argmin([misses_s2(body_pos_m(motion)) for motion in held])])


def _misses_s2(motion_s: Floats, music_s: Floats, around_s: float) -> float:
    """Sum of squared distances, capped, from each beat around an instant to the nearest of the other kind."""
    return sum(
        float(np.square(_nearest_s(own[np.abs(own - around_s) <= _JUDGED_S], others)).sum())
        for own, others in ((motion_s, music_s), (music_s, motion_s))
    )


def _nearest_s(instants_s: Floats, others_s: Floats) -> Floats:
    """Distance of each instant (N,) to the nearest of the others, at most `_LONELY_S`."""
    apart = np.abs(instants_s[:, None] - others_s[None, :])
    return np.minimum(apart.min(axis=1, initial=_LONELY_S), _LONELY_S)
