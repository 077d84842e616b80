"""A page that shows dances of any systems side by side, with their song."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from choreograph.core.arguments import check_kind
from choreograph.core.errors import ParameterError
from choreograph.motion.motion import Credits, Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.music.song import Song
from choreograph.plan.plan import Plan, PlannedWord
from choreograph.settings import DanceConfig
from choreograph.view.page import write_page

_APART_M = 1.8
_FPS = 30.0
_MOST = 8


def write_side_by_side(
    path: str | Path, motions: Mapping[str, Motion], song: Song, *, beats_s: np.ndarray
) -> None:
    """Write a page with the dances from left to right, as the audience sees them.

    All start with the song and are cut to the shortest one. Each is moved so that its mean position is in its
    place, and retargeted to one body. `beats_s` (Q,) are those of the song.

    Raises `ParameterError` for more than 8 dances, or a joint of unknown name, and as `view.page.write_page`.
    """
    if not 1 <= len(motions) <= _MOST:
        raise ParameterError(f"expected 1 to {_MOST} dances side by side, got {len(motions)}")
    for name, motion in motions.items():
        check_kind(f"the dance {name}", motion, Motion)
    body = canonical_skeleton()
    shown = [
        (motion if motion.skeleton.same_as(body) else retarget(motion, body)).resampled(_FPS)
        for motion in motions.values()
    ]
    n_frames = min(*(one.n_frames for one in shown), max(1, round(song.duration_s * _FPS)))
    placed = [
        _placed(one.sliced(0, n_frames), _APART_M * (place - (len(shown) - 1) / 2))
        for place, one in enumerate(shown)
    ]
    names = ", ".join(motions)
    several = len(motions) > 1
    plan = _plan(song, n_frames / _FPS, beats_s, "all dances" if several else names)
    write_page(
        path, placed[0], plan, song_path=song.path, motion_beats_s=(), start_s=song.start_s,
        title=f"From left: {names}" if several else names, others=placed[1:],
    )  # fmt: skip


def _placed(motion: Motion, x_m: float) -> Motion:
    mean_m = motion.root_pos_m.mean(axis=0)
    return motion.moved(shift_m=np.array([x_m - mean_m[0], 0.0, -mean_m[2]]))


def _plan(song: Song, duration_s: float, beats_s: np.ndarray, name: str) -> Plan:
    """What the timeline of the page shows: the beats, and one block."""
    defaults = DanceConfig()
    whole = PlannedWord(0.0, duration_s, 0, "", 0.0, duration_s, Credits(), kept=name)
    return Plan(
        song=song.name, duration_s=duration_s, start_s=song.start_s, repertoire="", planner=defaults.planner,
        blending=defaults.blending, seed=0, fps=_FPS, weights={},
        music_beats_s=tuple(float(beat) for beat in beats_s if beat < duration_s), seconds=(), engine="mixer",
        words=(whole,),
    )  # fmt: skip
