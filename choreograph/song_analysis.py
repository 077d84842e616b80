"""Song analysis: beats, style and wanted tempo-density of a song, by a repertoire's networks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.features.bars import track_bars
from choreograph.features.density import music_density
from choreograph.features.energy import energy_per_second
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import DEFAULT_TRACKER, get_beat_tracker
from choreograph.features.phrasing import dance_span_s
from choreograph.features.sections import song_sections
from choreograph.features.song_features import SongFeatures
from choreograph.features.tempogram import rhythm_features
from choreograph.repertoire import Repertoire


def analyse_song(
    song: Song, repertoire: Repertoire, *, beats: str = DEFAULT_TRACKER
) -> tuple[SongFeatures, tuple[str, ...]]:
    """Features of every second of a song, and notes on what is unusual about it.

    `beats` is the name of a beat tracker. Without style networks all style vectors are zero. Raises
    `ParameterError` for an unknown tracker.
    """
    n_seconds = max(1, int(np.ceil(song.duration_s - 1e-9)))
    notes = list(song.notes)
    mel = log_mel(song.samples)  # (T, 96)
    beat_times_s = get_beat_tracker(beats).beats(song, mel)
    if len(beat_times_s) == 0:
        notes.append(f"{song.name}: no beats found: the dance keeps the rhythm of its takes")
    if "style" in repertoire.net_names:
        style, beat_count = _style(repertoire, mel, n_seconds)
    else:
        notes.append(f"{repertoire.path.name}: no style networks: clips are not chosen by style")
        style = np.zeros((n_seconds, repertoire.clip_style.shape[1]), np.float32)
        beat_count = np.zeros(n_seconds, np.float32)
    density = _wanted_density(repertoire, mel, beat_times_s, n_seconds)
    counts = track_bars(song.samples, mel, beat_times_s)
    opening_s, closing_s = dance_span_s(counts, mel, song.duration_s)
    features = SongFeatures(
        song.name,
        song.duration_s,
        counts,
        style,
        beat_count,
        density,
        song_sections(song.samples, beat_times_s),
        energy_per_second(song.samples, n_seconds),
        opening_s,
        closing_s,
    )
    return features, tuple(notes)


def _style(
    repertoire: Repertoire, mel: NDArray[np.float32], n_seconds: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Style vectors (S, 32) of the 4 s from each second, and the motion beats (S,) expected there."""
    from choreograph.nets.style.model import StyleNets

    net = repertoire.net("style")
    nets = StyleNets.from_arrays(net.weights, net.config)
    style = nets.embed_music(mel, rhythm_features(mel), np.arange(n_seconds))
    return style, nets.predict_beat_count(style)


def _wanted_density(
    repertoire: Repertoire, mel: NDArray[np.float32], beat_times_s: NDArray[np.float64], n_seconds: int
) -> NDArray[np.float32]:
    """Tempo-density (S, 80) wanted in the 4 s from each second."""
    if repertoire.density == "learned":
        from choreograph.nets.density.model import MusicDensity

        net = repertoire.net("music_density")
        return MusicDensity.from_arrays(net.weights, net.config).song_density(mel, n_seconds)
    return music_density(n_seconds, beat_times_s)
