"""Song analysis: beats, style and target tempo-density of a song, by the networks of a repertoire."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.genres import (
    CHANGE_LOSS,
    CHANGE_LOSS_OF_STYLE,
    changes_of_style,
    least_loss_path,
    rhythm_losses,
    style_losses,
    tempi_of_takes,
)
from choreograph.core.cache import NO_MEMORY, DiskCache, Memory
from choreograph.core.counts import Counts
from choreograph.core.files import sha256_of
from choreograph.core.numerics import Floats, one_thread
from choreograph.core.progress import StepReport, part
from choreograph.library.repertoire import Repertoire
from choreograph.library.songs import DEFAULT_BEATS, check_beats, names_a_tracker, song_counts
from choreograph.music.bars import (
    at_changes,
    between,
    change_times_s,
    choose_level,
    joined,
    metrical_levels,
    tempo_bpm,
)
from choreograph.music.count_grids import dance_span_s
from choreograph.music.form import Form, Sections, phrase_bounds_s, song_form, song_sections
from choreograph.music.mel import log_mel, onset_density, onset_envelopes
from choreograph.music.rhythm import off_beat_share, rhythm_features
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures, energy_per_second, music_density, stops_s
from choreograph.music.spectral import spectral_features
from choreograph.nets.inference import SongStyle

Analysis = tuple[SongFeatures, tuple[str, ...]]  # with notes

_MAX_BYTES = 64 << 20  # of all analyses in the cache: about 600 songs of three minutes
_STEPS = 100  # of the progress, most of which is for the sections
_SAME_TEMPO = 0.015  # largest relative difference of tempi that count as the same
_OTHER_LEVEL = 0.25  # loss per second of another level than the tracked one. That of the style is up to 0.5
_WHOLE_SONG = 0.8  # of its duration: a note on a shorter part states where it is


def analyses_cache() -> DiskCache:
    """The user's cache of what is analysed of songs."""
    return DiskCache.of_user("analyses", _MAX_BYTES)


@one_thread()
def analyse_song(
    song: Song,
    repertoire: Repertoire,
    *,
    beats: str | Path = DEFAULT_BEATS,
    genre: str | None = None,
    keep: bool = False,
    report: StepReport | None = None,
    memory: Memory = NO_MEMORY,
) -> tuple[SongFeatures, tuple[str, ...]]:
    """Features of every second of a song, and notes on what is unusual about it.

    `beats` is one of `library.songs.TRACKER_NAMES` or a file (see `music.beats`) with times in the song file.
    The song is counted at half or double the tracked tempo if this is clearly nearer to the tempo of the
    takes of `genre`, or else if a genre that suits the song is danced at that tempo. Without style networks,
    all style vectors are zero. Raises `ParameterError` for an unknown tracker and `FormatError` for a file
    that cannot be read.

    With `keep`, the analysis is read from the cache of the user, or else it is made and written there.
    `memory` is of this repertoire.
    """
    check_beats(beats)

    def analyse() -> Analysis:
        return _analysis(song, repertoire, beats, genre, report)

    tracker = str(beats) if names_a_tracker(beats) else sha256_of(beats)
    inputs = song.samples_sha256, song.name, song.notes, song.start_s, tracker, genre

    def cached() -> Analysis:
        return analyses_cache().value(analyse, repertoire.analysis_digest, *inputs) if keep else analyse()

    analysis = memory.value(cached, "analysis", *inputs)
    if report is not None:
        report(_STEPS, _STEPS)
    return analysis


def _analysis(
    song: Song, repertoire: Repertoire, beats: str | Path, genre: str | None, report: StepReport | None
) -> tuple[SongFeatures, tuple[str, ...]]:
    n_seconds = max(1, int(np.ceil(song.duration_s - 1e-9)))
    notes = list(song.notes)
    mel = log_mel(song.samples, report=part(report, 0, 10, _STEPS))  # (T, 96)
    counts = song_counts(song, mel, beats)
    if report is not None:
        report(20, _STEPS)
    if names_a_tracker(beats):
        counts = _at_one_level(counts, song, mel, repertoire)
    rhythm = rhythm_features(mel, counts)
    style, beat_count, style_notes = _style(repertoire, mel, rhythm, n_seconds)
    notes += style_notes
    if report is not None:
        report(25, _STEPS)
    sections, form, _ = song_structure(song, counts, part(report, 25, 60, _STEPS))
    if names_a_tracker(beats):
        losses = None if genre else style_losses(style, sections, off_beat_share(rhythm), repertoire)
        counts, changed = _danceable(counts, song, mel, sections, repertoire, style, genre, losses)
        if changed:
            sections, form, _ = song_structure(song, counts, part(report, 60, 95, _STEPS))
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
        energy_per_second(song.samples, n_seconds, onset_envelopes(mel).mean(axis=1)),
        opening_s,
        closing_s,
        onset_density(mel, n_seconds),
        off_beat_share(rhythm),
        form,
        stops_s(song.samples, counts),
    )
    return features, tuple(notes)


def song_structure(
    song: Song, counts: Counts, report: StepReport | None
) -> tuple[Sections, Form, NDArray[np.float32]]:
    """The sections of a song, its phrases, and the spectral features (B, 87) that they are found by."""
    bounds_s = phrase_bounds_s(counts, song.duration_s)
    features = spectral_features(song.samples, bounds_s, report=report)
    sections = song_sections(
        features[: max(0, len(counts) - 1)],
        counts.times_s,
        downbeat_times_s=counts.downbeat_times_s,
        change_times_s=change_times_s(counts),
    )
    return sections, song_form(features, bounds_s, counts, sections), features


def _level_note(song: Song, changed: Sequence[tuple[Counts, Counts]], genre: str | None) -> str:
    """The tempo at which the longest part of a song is counted rather than as tracked."""
    tracked, counts = max(changed, key=lambda pair: float(np.ptp(pair[0].times_s)))
    span = f" from {counts.times_s[0]:.0f} s to {counts.times_s[-1]:.0f} s"
    is_whole = np.ptp(tracked.times_s) > _WHOLE_SONG * song.duration_s
    return (
        f"{song.name}: counted at {tempo_bpm(counts):.0f} BPM{'' if is_whole else span} rather than the "
        f"tracked {tempo_bpm(tracked):.0f} BPM, because this is nearer to the tempo of the "
        + (f"takes of {genre}" if genre else "takes that suit it")
    )


def _danceable(
    tracked: Counts,
    song: Song,
    mel: NDArray[np.float32],
    sections: Sections,
    repertoire: Repertoire,
    style: NDArray[np.float32],
    genre: str | None,
    losses: tuple[list[str], Floats] | None,
) -> tuple[Counts, list[tuple[Counts, Counts]]]:
    """The song's counts, each part at the metrical level that suits the takes (`music.bars`).

    A new part begins where the tracked tempo or metre changes. Also returns the parts that are counted at
    another level than the tracked one, as tracked and as counted. `losses` are those of `style_losses`, or
    None if a genre is requested.
    """
    if not tracked.has_bars:
        return tracked, []
    bounds_s = sections.bounds_s[1:-1]
    bounds_s = np.r_[-np.inf, bounds_s[at_changes(bounds_s, change_times_s(tracked))], np.inf]
    of_parts = []
    for span_s in pairwise(bounds_s):
        levels = metrical_levels(song.samples, mel, between(tracked, *span_s))
        of_parts.append([levels[0], *(level for level in levels[1:] if len(level) > 1)])
    if losses is not None and losses[0]:
        chosen = _likeliest_levels(of_parts, bounds_s[1:-1], repertoire, style, *losses)
    else:
        tempi_bpm = _take_tempi(repertoire, genre)
        chosen = [_nearest_level(levels, tempi_bpm) for levels in of_parts]
    changed = [
        (levels[0], level) for levels, level in zip(of_parts, chosen, strict=True) if level is not levels[0]
    ]
    return (joined(chosen) if changed else tracked), changed


def _at_one_level(tracked: Counts, song: Song, mel: NDArray[np.float32], repertoire: Repertoire) -> Counts:
    """The counts of a song, with parts that were tracked at half or double the tempo corrected.

    Such parts are counted at the tempo of the longest part, unless their style differs even then.
    """
    changes_s = change_times_s(tracked)
    if not tracked.has_bars or len(changes_s) == 0:
        return tracked
    of_parts = [between(tracked, *span_s) for span_s in pairwise(np.r_[-np.inf, changes_s, np.inf])]
    longest = max((one for one in of_parts if len(one) > 1), key=lambda one: float(np.ptp(one.times_s)))
    bpm = tempo_bpm(longest)
    chosen = []
    for tracked_part in of_parts:
        levels = metrical_levels(song.samples, mel, tracked_part)
        same = [level for level in levels if len(level) > 1 and _is_same(tempo_bpm(level), bpm)]
        same = [level for level in same if level.metre == longest.metre]
        chosen.append(same[0] if same else tracked_part)
    if all(one is other for one, other in zip(of_parts, chosen, strict=True)):
        return tracked
    counts, n_seconds = joined(chosen), max(1, int(np.ceil(song.duration_s)))
    style, _, _ = _style(repertoire, mel, rhythm_features(mel, counts), n_seconds)
    starts = np.unique(np.r_[0, np.clip(np.rint(changes_s), 0, n_seconds - 1)]).astype(np.int64)
    return tracked if changes_of_style(style, starts).any() else counts


def _is_same(bpm: float, other_bpm: float) -> bool:
    return abs(bpm / other_bpm - 1.0) < _SAME_TEMPO


def _likeliest_levels(
    of_parts: Sequence[Sequence[Counts]],
    borders_s: Floats,
    repertoire: Repertoire,
    style: NDArray[np.float32],
    genres: list[str],
    style_loss: Floats,
) -> list[Counts]:
    """The likeliest level of each part of a song, chosen together with its genre.

    The losses of style (S, G), of rhythm and of changes of genre are added, as in `genres.likely_genres`.
    Another level than the first is chosen only if it is clearly better.
    """
    n_seconds = len(style)
    starts = np.r_[0, np.clip(np.rint(borders_s), 1, n_seconds - 1)].astype(np.int64)
    stops = np.append(starts[1:], n_seconds)
    losses = []  # of each part, (levels, G)
    for levels, start, stop in zip(of_parts, starts, stops, strict=True):
        of_levels = np.zeros((len(levels), len(genres)))
        for row, level in enumerate(levels):
            rhythm = rhythm_losses(level, n_seconds, repertoire, genres)
            of_levels[row] = (style_loss + rhythm)[start:stop].sum(axis=0) + _OTHER_LEVEL * (row > 0) * (
                stop - start
            )
        losses.append(of_levels)
    change_loss = np.where(changes_of_style(style, starts), CHANGE_LOSS_OF_STYLE, CHANGE_LOSS)
    path = least_loss_path(np.stack([of_levels.min(axis=0) for of_levels in losses]), change_loss)
    return [
        levels[int(np.argmin(of_levels[:, genre]))]
        for levels, of_levels, genre in zip(of_parts, losses, path, strict=True)
    ]


def _nearest_level(levels: Sequence[Counts], tempi_bpm: dict[int, Floats]) -> Counts:
    """The level nearest to the tempi of takes, by their metre. Without these, or of one beat, the first."""
    if not tempi_bpm or len(levels[0]) < 2:
        return levels[0]
    return choose_level(levels, tempi_bpm, {metre: np.ones(len(bpm)) for metre, bpm in tempi_bpm.items()})


def _take_tempi(repertoire: Repertoire, genre: str | None) -> dict[int, Floats]:
    """The tempi (X,) of the takes of a genre with bars, by their metre. Those of all takes if it has none."""
    every = sorted({take.credits.genre for take in repertoire.takes})
    parts = [] if genre is None else [tempi_of_takes(repertoire, genre)]
    if not any(len(part.bpm) for part in parts):
        parts = [tempi_of_takes(repertoire, other) for other in every]
    metre, bpm = np.concatenate([part.metre for part in parts]), np.concatenate([part.bpm for part in parts])
    return {int(one): bpm[metre == one] for one in _in_order(metre[metre > 0])}


def _in_order(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Each of the values once, in the order in which they come."""
    _, first = np.unique(values, return_index=True)
    return values[np.sort(first)]


def _style(
    repertoire: Repertoire, mel: NDArray[np.float32], rhythm: NDArray[np.float32], n_seconds: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], list[str]]:
    """Style vectors (S, 32) of the 4 s from each second, their expected motion beats (S,), and notes."""
    without = (
        np.zeros((n_seconds, repertoire.clip_style.shape[1]), np.float32),
        np.zeros(n_seconds, np.float32),
    )
    if "style" not in repertoire.net_names:
        return *without, [f"{repertoire.path.name}: no style networks: clips are not chosen by style"]
    net = repertoire.net("style")
    nets = SongStyle.from_arrays(net.weights, net.config)
    style = nets.embed_music(mel, rhythm, np.arange(n_seconds))
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
