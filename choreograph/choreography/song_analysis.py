"""Song analysis: beats, style and target tempo-density of a song, by the networks of a repertoire."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from choreograph.core.counts import Counts
from choreograph.core.numerics import one_thread
from choreograph.core.progress import StepReport, part
from choreograph.library.repertoire import Repertoire
from choreograph.library.songs import DEFAULT_BEATS, names_a_tracker, song_counts
from choreograph.music.mel import log_mel, onset_density
from choreograph.music.metrical_level import (
    at_changes,
    between,
    change_times_s,
    choose_level,
    joined,
    metrical_levels,
    tempo_bpm,
)
from choreograph.music.rhythm import rhythm_features
from choreograph.music.sections import Sections, dance_span_s, song_sections
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures, energy_per_second, music_density

_STEPS = 100  # of the progress, most of which is for the sections
_NEAREST_CLIPS = 32  # whose takes determine the tempo at which a second of the song can be danced
_WHOLE_SONG = 0.8  # of its duration: a note on a shorter part states where it is


@one_thread()
def analyse_song(
    song: Song,
    repertoire: Repertoire,
    *,
    beats: str | Path = DEFAULT_BEATS,
    genre: str | None = None,
    report: StepReport | None = None,
) -> tuple[SongFeatures, tuple[str, ...]]:
    """Features of every second of a song, and notes on what is unusual about it.

    `beats` is one of `library.songs.TRACKER_NAMES` or a file (see `music.beats`) with times in the song file.
    The song is counted at half or double the tracked tempo if this is clearly nearer to the tempo of the
    takes of `genre`, or else of the takes nearest in style. Without style networks, all style vectors are
    zero. Raises `ParameterError` for an unknown tracker and `FormatError` for a file that cannot be read.
    """
    n_seconds = max(1, int(np.ceil(song.duration_s - 1e-9)))
    notes = list(song.notes)
    mel = log_mel(song.samples, report=part(report, 0, 10, _STEPS))  # (T, 96)
    counts = song_counts(song, mel, beats)
    if report is not None:
        report(20, _STEPS)
    style, beat_count, style_notes = _style(repertoire, mel, counts, n_seconds)
    notes += style_notes
    if report is not None:
        report(25, _STEPS)
    sections = _sections(song, counts, part(report, 25, 60, _STEPS))
    if names_a_tracker(beats):
        counts, changed = _danceable(counts, song, mel, sections, repertoire, style, genre)
        if changed:
            sections = _sections(song, counts, part(report, 60, 95, _STEPS))
            notes.append(_level_note(song, changed, genre))
    if len(counts) == 0:
        notes.append(f"{song.name}: no beats found: the dance keeps the rhythm of its takes")
    opening_s, closing_s = dance_span_s(counts, mel, song.duration_s)
    features = SongFeatures(
        song.name,
        song.duration_s,
        counts,
        style,
        beat_count,
        _wanted_density(repertoire, mel, counts.times_s, n_seconds),
        sections,
        energy_per_second(song.samples, n_seconds),
        opening_s,
        closing_s,
        onset_density(mel, n_seconds),
    )
    if report is not None:
        report(_STEPS, _STEPS)
    return features, tuple(notes)


def _sections(song: Song, counts: Counts, report: StepReport | None) -> Sections:
    return song_sections(
        song.samples,
        counts.times_s,
        downbeat_times_s=counts.downbeat_times_s,
        change_times_s=change_times_s(counts),
        report=report,
    )


def _level_note(song: Song, changed: Sequence[tuple[Counts, Counts]], genre: str | None) -> str:
    """The tempo at which the longest part of a song is counted rather than as tracked."""
    tracked, counts = max(changed, key=lambda pair: float(np.ptp(pair[0].times_s)))
    span = f" from {counts.times_s[0]:.0f} s to {counts.times_s[-1]:.0f} s"
    is_whole = np.ptp(tracked.times_s) > _WHOLE_SONG * song.duration_s
    return (
        f"{song.name}: counted at {tempo_bpm(counts):.0f} BPM{'' if is_whole else span} rather than the "
        f"tracked {tempo_bpm(tracked):.0f} BPM, because this is nearer to the tempo of the "
        + (f"takes of {genre}" if genre else "takes nearest in style")
    )


def _danceable(
    tracked: Counts,
    song: Song,
    mel: NDArray[np.float32],
    sections: Sections,
    repertoire: Repertoire,
    style: NDArray[np.float32],
    genre: str | None,
) -> tuple[Counts, list[tuple[Counts, Counts]]]:
    """The song's counts, each part at the metrical level that suits the takes (`music.metrical_level`).

    A new part begins where the tracked tempo or metre changes. Also returns the parts that are counted at
    another level than the tracked one, as tracked and as counted.
    """
    counted = ((i, repertoire.counts(i)) for i in range(len(repertoire.takes)))
    takes = [i for i, counts in counted if counts.has_bars and len(counts) > 1]  # one count has no tempo
    if not takes or not tracked.has_bars:
        return tracked, []
    of_genre = [i for i in takes if repertoire.takes[i].credits.genre == genre]
    if of_genre:
        takes, style = of_genre, np.zeros_like(style)  # without style, all of them have the same weight
    bounds_s = sections.bounds_s[1:-1]
    bounds_s = np.r_[-np.inf, bounds_s[at_changes(bounds_s, change_times_s(tracked))], np.inf]
    chosen, changed = [], []
    for start_s, stop_s in pairwise(bounds_s):
        seconds = style[int(np.clip(start_s, 0, len(style) - 1)) : int(np.clip(stop_s, 1, len(style)))]
        levels = metrical_levels(song.samples, mel, between(tracked, start_s, stop_s))
        if len(levels[0]) > 1:  # a single beat stays as it was tracked
            levels = (levels[0], *(level for level in levels[1:] if len(level) > 1))
            chosen.append(choose_level(levels, *_take_tempi(repertoire, takes, seconds)))
        else:
            chosen.append(levels[0])
        if chosen[-1] is not levels[0]:
            changed.append((levels[0], chosen[-1]))
    return (joined(chosen) if changed else tracked), changed


def _take_tempi(
    repertoire: Repertoire, takes: Sequence[int], style: NDArray[np.float32]
) -> tuple[dict[int, NDArray[np.float64]], dict[int, NDArray[np.float64]]]:
    """The tempi (X,) of the counted takes of each metre, and their nearness to a part's style (S, 32)."""
    near = _nearness(style, repertoire)  # (takes,)
    tempi_bpm, weights = {}, {}
    for metre in {repertoire.counts(i).metre for i in takes}:
        of_metre = [i for i in takes if repertoire.counts(i).metre == metre]
        tempi_bpm[metre] = np.array([tempo_bpm(repertoire.counts(i)) for i in of_metre])
        weights[metre] = near[of_metre]
    return tempi_bpm, weights


def _nearness(style: NDArray[np.float32], repertoire: Repertoire) -> NDArray[np.float64]:
    """Share of each take (takes,) in the clips nearest in style to the song's seconds (S, 32).

    Without style networks, all takes have the same weight.
    """
    if not style.any():
        return np.ones(len(repertoire.takes))
    n_nearest = min(_NEAREST_CLIPS, repertoire.n_clips)
    _, nearest = cKDTree(repertoire.clip_style).query(style, n_nearest)  # (S, K)
    counted = np.bincount(repertoire.clip_take[np.ravel(nearest)], minlength=len(repertoire.takes))
    nearness: NDArray[np.float64] = counted / counted.sum()
    return nearness


def _style(
    repertoire: Repertoire, mel: NDArray[np.float32], counts: Counts, n_seconds: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], list[str]]:
    """Style vectors (S, 32) of the 4 s from each second, their expected motion beats (S,), and notes."""
    without = (
        np.zeros((n_seconds, repertoire.clip_style.shape[1]), np.float32),
        np.zeros(n_seconds, np.float32),
    )
    if "style" not in repertoire.net_names:
        return *without, [f"{repertoire.path.name}: no style networks: clips are not chosen by style"]
    from choreograph.nets.style import StyleNets

    net = repertoire.net("style")
    nets = StyleNets.from_arrays(net.weights, net.config)
    style = nets.embed_music(mel, rhythm_features(mel, counts), np.arange(n_seconds))
    return style, nets.predict_beat_count(style), []


def _wanted_density(
    repertoire: Repertoire, mel: NDArray[np.float32], beat_times_s: NDArray[np.float64], n_seconds: int
) -> NDArray[np.float32]:
    """Target tempo-density (S, 80) of the 4 s from each second."""
    if repertoire.density == "learned":
        from choreograph.nets.density import MusicDensity

        net = repertoire.net("music_density")
        return MusicDensity.from_arrays(net.weights, net.config).song_density(mel, n_seconds)
    return music_density(n_seconds, beat_times_s)
