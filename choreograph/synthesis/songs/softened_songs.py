"""Songs whose middle third is soft: does a dance get smaller there?

The middle third is played by the instruments of a break, and `SOFT_DB` softer; the outer ones are choruses.
Their seeds start at `FIRST_SEED`, so no network was trained on them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from choreograph.synthesis.songs.arrangement import Section
from choreograph.synthesis.songs.genres import STYLES
from choreograph.synthesis.songs.song import SyntheticSong, render_song
from choreograph.synthesis.songs.style import SongStyle
from choreograph.synthesis.songs.voices import RATE_HZ

FIRST_SEED = 9500
SOFT_DB = -12.0
_ENERGIES = {"chorus": 0.9, "break": 0.3}
_FADE_S = 0.05  # of the gain, around the bar lines


def softened_song(genre: str, *, seed: int, duration_s: float = 60.0) -> SyntheticSong:
    """A song of about this length in three equal sections, the middle one soft; the middle of its tempi.

    Raises `ParameterError` as `render_song` does.
    """
    style = STYLES[genre]
    bars = _bars_of_third(style, duration_s)
    names = ("chorus", "break", "chorus")
    sections = [Section(name, i * bars, bars, _ENERGIES[name]) for i, name in enumerate(names)]
    song = render_song(style, n_bars=3 * bars, seed=seed, sections=sections)
    start_s, stop_s = song.bar_times_s[[bars, 2 * bars]]
    times_s = np.arange(len(song.samples)) / RATE_HZ
    corners_s = [start_s - _FADE_S, start_s, stop_s - _FADE_S, stop_s]
    gain_db = np.interp(times_s, corners_s, [0.0, SOFT_DB, SOFT_DB, 0.0])
    gain = (10.0 ** (gain_db / 20.0)).astype(np.float32)
    return replace(song, samples=song.samples * gain[:, None])


def _bars_of_third(style: SongStyle, duration_s: float) -> int:
    bar_s = style.beats_per_bar * 60.0 / float(np.mean(style.bpm))
    return max(1, round(duration_s / bar_s / 3.0))
