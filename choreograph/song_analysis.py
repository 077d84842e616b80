"""From a song to what the engine knows of it."""

from __future__ import annotations

import numpy as np

from choreograph.audio.song import Song
from choreograph.features.density import music_density
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import DEFAULT_TRACKER, get_beat_tracker
from choreograph.features.song_features import SongFeatures
from choreograph.features.tempogram import rhythm_features
from choreograph.repertoire import Repertoire


def analyse_song(
    song: Song, repertoire: Repertoire, *, beats: str = DEFAULT_TRACKER
) -> tuple[SongFeatures, tuple[str, ...]]:
    """The song's beats, styles and wanted tempo-densities, and notes on what is odd about it."""
    n_seconds = max(1, int(np.ceil(song.duration_s - 1e-9)))
    notes = list(song.notes)
    mel = log_mel(song.samples)  # (T, 96)
    beat_times_s = get_beat_tracker(beats).beats(song, mel)
    if len(beat_times_s) == 0:
        notes.append(f"{song.name}: no beat heard: the dance keeps the rhythm of its takes")
    starts = np.arange(n_seconds)
    if "style" in repertoire.net_names:
        from choreograph.nets.style.model import StyleNets

        net = repertoire.net("style")
        nets = StyleNets.from_arrays(net.weights, net.config)
        style = nets.embed_music(mel, rhythm_features(mel), starts)
        beat_count = nets.predict_beat_count(style)
    else:
        notes.append(f"{repertoire.path.name}: no style networks: clips are not chosen by style")
        style = np.zeros((n_seconds, repertoire.clip_style.shape[1]), np.float32)
        beat_count = np.zeros(n_seconds, np.float32)
    density = _wanted_density(repertoire, mel, beat_times_s, n_seconds)
    return SongFeatures(song.name, song.duration_s, beat_times_s, style, beat_count, density), tuple(notes)


def _wanted_density(repertoire: Repertoire, mel, beat_times_s, n_seconds: int):
    if repertoire.density == "learned":
        from choreograph.nets.density.model import MusicDensity

        net = repertoire.net("music_density")
        return MusicDensity.from_arrays(net.weights, net.config).song_density(mel, n_seconds)
    return music_density(n_seconds, beat_times_s)
