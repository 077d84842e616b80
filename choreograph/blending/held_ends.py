"""The first and the last pose of a dance, held until its first count and from its last one on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.features.phrasing import coming_to_rest_s, setting_off_s
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.timebase import frame_times_s

Floats = NDArray[np.float64]


def hold_ends(motion: Motion, opening_s: float, closing_s: float | None) -> Motion:
    """The motion with a pose held before the first count, and one after the last count.

    How it sets off and comes to rest is said by `features.phrasing`; `closing_s` None: it dances to its end.
    """
    times_s = frame_times_s(motion.n_frames, motion.fps)
    played_s = np.array(times_s)
    if opening_s > 0:
        start_s, stop_s = setting_off_s(opening_s)
        ease_s = stop_s - start_s
        since = np.clip((times_s - start_s) / ease_s, 0.0, 1.0)
        before = times_s < stop_s
        played_s[before] = (stop_s - ease_s * (0.5 - _eased(since)))[before]
    if closing_s is not None:
        start_s, stop_s = coming_to_rest_s(opening_s, closing_s)
        ease_s = stop_s - start_s
        since = np.clip((times_s - start_s) / ease_s, 0.0, 1.0)
        after = times_s > start_s
        played_s[after] = (start_s + ease_s * (since - _eased(since)))[after]
    moved = np.flatnonzero(played_s != times_s)
    if len(moved) == 0:
        return motion
    frames = np.clip(played_s[moved] * motion.fps, 0.0, motion.n_frames - 1)
    held = motion.sampled_smooth(frames)
    root_pos_m, local_quat = motion.root_pos_m.copy(), motion.local_quat.copy()
    root_pos_m[moved], local_quat[moved] = held.root_pos_m, held.local_quat
    return replace(motion, root_pos_m=root_pos_m, local_quat=rot.make_continuous(local_quat))


def _eased(since: Floats) -> Floats:
    """The way gone at a speed that rises smoothly from 0 to 1 as `since` does; 0.5 at the end."""
    return since**3 - 0.5 * since**4
