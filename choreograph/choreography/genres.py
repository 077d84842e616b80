"""The genre that suits a song, section by section."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.selection import genre_distances
from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats
from choreograph.library.clips import TakeTempi
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.music.bars import DANCED_IN
from choreograph.music.form import Sections
from choreograph.music.song_features import SongFeatures

_NEAREST = "no genre given: the dance follows {}, by style, tempo and metre"
_FALLBACK = "no genre given: the style suggests none, and the dance follows the takes of all genres"
# Losses of one second. The style alone makes at most 0.5.
_PER_DISTANCE = 0.025  # loss per squared distance. Neighbouring seconds have similar distances
_FAR = 20.0  # limit of squared distance beyond the nearest genre's: a few seconds do not decide for a section
# Loss added to a genre if none of its takes has the metre of a second. It is larger than any loss of style,
# since a dance in another metre does not fit the bars, and than that of a tempo out of reach. At 0.6, house
# that rises from 90 to 140 BPM was danced as waltz.
_OTHER_METRE = 1.8  # where the metre is certain
# Loss added to a genre whose takes are all slower or all faster than the song, and the loss per octave of
# difference.
_OTHER_TEMPO, _PER_OCTAVE = 1.5, 4.0
# Loss per octave of the mean difference from the tempi of a genre's takes. It decides between genres of
# similar style whose tempi overlap. Rumbas of 66 to 124 BPM include the tempo of cha-chas.
_PER_MEAN_OCTAVE = 0.5
_SAME_TEMPO = 1.04  # largest ratio of two tempi that count as the same
# House and disco have a hi-hat between the beats, and music without one is neither. The share of percussion
# onsets that are between two beats rather than on one is 0.51 or more in a quarter of the seconds of
# synthetic songs of both genres, and 0.36 to 0.50 in cha-chas.
_WITH_OFF_BEATS = ("disco", "house")
_OFF_BEATS = (0.43, 0.51)
_NO_OFF_BEATS = 0.6
# The loss that a change of genre must save, summed over seconds. It is small where a section begins in
# another style or metre.
CHANGE_LOSS, CHANGE_LOSS_OF_STYLE = 30.0, 3.0
_SAME_STYLE = 0.4  # least cosine. It is up to 0.37 in songs spliced from two genres, from 0.44 in real songs
_SEGMENT_S = 4  # seconds that the style of a second describes
_SHARPNESS = 10.0  # factor of the mean loss in the softmax that gives the probability of a genre
# What people dance to a song that is like none of the others. It is danced where the probability of the
# likely genre is below `_UNSURE`, unless its mean loss is larger by more than `_DEFAULT_LOSS`: of synthetic
# songs, more than that makes pop of all disco. Of 40 recorded ballroom songs, it changes one.
_DEFAULT_GENRE, _UNSURE, _DEFAULT_LOSS = "pop", 0.55, 0.05


@dataclass(frozen=True)
class LikelyGenre:
    """The likely genre of a part of a song, with its probability."""

    first_second: int
    genre: str
    probability: float = 1.0
    runner_up: str = ""  # empty if there is no other genre
    tempo: str = ""  # "slower" or "faster" if the song is outside the tempi of the genre's takes, or empty

    def __str__(self) -> str:
        other = f", else {self.runner_up}" if self.runner_up else ""
        tempo = f", {self.tempo} than its takes" if self.tempo else ""
        return f"{self.genre} ({100 * self.probability:.0f} % sure{other}{tempo})"


def genre_note(parts: Sequence[LikelyGenre]) -> str:
    """The note that a dance follows the likely genres, one for each part of the song."""
    if any(part.genre == ALL_GENRES for part in parts):
        return _FALLBACK
    return _NEAREST.format(", then ".join(map(str, parts)))


def likely_genre(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> LikelyGenre:
    """The genre of the whole song with the least loss, among those that are not banned.

    It is `ALL_GENRES` without style networks, or if no take has a genre.
    """
    genres, losses = _genre_losses(song_features, repertoire, constraints)
    if not genres:
        return LikelyGenre(0, ALL_GENRES)
    whole = _likely(0, int(np.argmin(losses.mean(axis=0))), genres, losses)
    return replace(whole, tempo=_tempo_of_part(song_features, 0, len(losses), repertoire, whole.genre))


def likely_genres(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> list[LikelyGenre]:
    """The genre of each part of the song, chosen as in `likely_genre`.

    Dynamic programming minimizes the sum of the losses of all seconds and of all changes of genre.
    """
    genres, losses = _genre_losses(song_features, repertoire, constraints)
    if not genres:
        return [LikelyGenre(0, ALL_GENRES)]
    chosen = least_loss_path(losses, _change_losses(song_features))
    firsts = [second for second in range(len(chosen)) if second == 0 or chosen[second] != chosen[second - 1]]
    stops = [*firsts[1:], len(chosen)]
    parts = [
        _likely(first, chosen[first], genres, losses[first:stop])
        for first, stop in zip(firsts, stops, strict=True)
    ]
    return [
        replace(part, tempo=_tempo_of_part(song_features, part.first_second, stop, repertoire, part.genre))
        for part, stop in zip(parts, stops, strict=True)
    ]


def _likely(first_second: int, chosen: int, genres: Sequence[str], losses: Floats) -> LikelyGenre:
    """The chosen genre with its probability among all genres, from the losses (S, G) of its part.

    Where the choice is unsure, it is the default genre, if that suits the part nearly as well.
    """
    mean = losses.mean(axis=0)  # (G,)
    shares = np.exp(-_SHARPNESS * (mean - mean.min()))
    default = genres.index(_DEFAULT_GENRE) if _DEFAULT_GENRE in genres else chosen
    is_unsure = shares[chosen] < _UNSURE * shares.sum()
    if is_unsure and mean[default] <= mean[chosen] + _DEFAULT_LOSS:
        chosen = default
    others = np.where(np.arange(len(genres)) == chosen, np.inf, mean)
    runner_up = genres[int(np.argmin(others))] if len(genres) > 1 else ""
    return LikelyGenre(first_second, genres[chosen], float(shares[chosen] / shares.sum()), runner_up)


def least_loss_path(losses: Floats, change_loss: Floats) -> list[int]:
    """The genre of each of T parts, with the least sum of losses (T, G) and of losses (T,) of changes.

    `change_loss` is added where a part has another genre than the part before.
    """
    every = np.arange(losses.shape[1])
    reached, parents = losses[0], []
    for of_part, loss in zip(losses[1:], change_loss[1:], strict=True):
        changed = reached.min() + loss
        parents.append(np.where(reached <= changed, every, np.argmin(reached)))
        reached = np.minimum(reached, changed) + of_part
    chosen = [int(np.argmin(reached))]
    for parent in reversed(parents):
        chosen.append(int(parent[chosen[-1]]))
    return chosen[::-1]


def _change_losses(song_features: SongFeatures) -> Floats:
    """The loss that a change of genre adds in each second, (S,)."""
    starts = _section_starts(song_features.sections, song_features.n_seconds)
    metres = [np.bincount(part).argmax() for part in np.split(song_metre_at(song_features), starts[1:])]
    other = changes_of_style(song_features.style, starts) | np.append(False, np.diff(metres) != 0)
    losses = np.full(song_features.n_seconds, CHANGE_LOSS)
    losses[starts[other]] = CHANGE_LOSS_OF_STYLE
    return losses


def changes_of_style(style: NDArray[np.floating], starts: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Whether the style (S, 32) of the music changes at each of the seconds (P,) where parts begin."""
    stops = np.append(starts[1:], len(style))
    inside = [
        style[start : max(start + 1, stop - _SEGMENT_S + 1)]
        for start, stop in zip(starts, stops, strict=True)
    ]
    means = np.stack([part.mean(axis=0, dtype=np.float64) for part in inside])  # (P, 32)
    means /= np.maximum(np.linalg.norm(means, axis=1, keepdims=True), 1e-9)
    other = np.sum(means[1:] * means[:-1], axis=1) < _SAME_STYLE
    return np.append(False, other)


def _section_starts(sections: Sections, n_seconds: int) -> NDArray[np.int64]:
    """The seconds (P,) nearest to where sections begin, from 0 on."""
    starts = np.unique(np.concatenate([[0], np.round(sections.bounds_s[1:-1])])).astype(np.int64)
    return starts[starts < n_seconds]


def _genre_losses(
    song_features: SongFeatures, repertoire: Repertoire, constraints: Constraints
) -> tuple[list[str], Floats]:
    """The genres that may be danced, and the loss of each second and genre (S, G)."""
    banned = {ban.genre for ban in constraints.bans if ban.genre is not None}
    genres, losses = style_losses(
        song_features.style, song_features.sections, song_features.off_beat, repertoire, banned=banned
    )
    if not genres:
        return genres, losses
    return genres, losses + rhythm_losses(song_features.counts, len(losses), repertoire, genres)


# The losses of a genre by style, tempo and metre.


def style_losses(
    style: NDArray[np.floating],
    sections: Sections,
    off_beat: float,
    repertoire: Repertoire,
    *,
    banned: Collection[str] = (),
) -> tuple[list[str], Floats]:
    """The genres that may be danced, and the loss (S, G) of each for the style of each second.

    The style (S, 32) is that of the 4 s around the second that are in its section. `off_beat` is the share of
    `SongFeatures`. There is no genre without style vectors.
    """
    of_take = np.array([take.credits.genre for take in repertoire.takes])
    with_clips = set(of_take[np.unique(repertoire.clip_take)])
    known = repertoire.vocabulary.genres if repertoire.has_vocabulary else ()
    genres = [genre for genre in known if genre in with_clips.difference(banned)]
    # Takes without counts are not danced on counts, so that a genre of such takes would be danced by others.
    genres = [genre for genre in genres if len(tempi_of_takes(repertoire, genre).bpm)] or genres
    if not genres or not style.any():
        return [], np.zeros((len(style), 0))
    of_clip = np.array([genres.index(g) if g in genres else -1 for g in of_take])[repertoire.clip_take]
    away = genre_distances(style, repertoire.clip_style[of_clip >= 0], of_clip[of_clip >= 0])
    losses = _PER_DISTANCE * np.minimum(away - away.min(axis=1, keepdims=True), _FAR)
    few_off_beats = 1.0 - np.clip(np.interp(off_beat, _OFF_BEATS, (0.0, 1.0)), 0.0, 1.0)
    losses[:, np.isin(genres, _WITH_OFF_BEATS)] += _NO_OFF_BEATS * few_off_beats
    return genres, _within_sections(losses, sections)


def _within_sections(losses: Floats, sections: Sections) -> Floats:
    """Losses (S, G) of the 4 s from each second, or from earlier where these reach into another section."""
    borders = [*_section_starts(sections, len(losses))[1:], len(losses)]
    seconds = np.arange(len(losses))
    starts = [0, *borders[:-1]]
    for start, stop in zip(starts, borders, strict=True):
        seconds[start:stop] = np.minimum(seconds[start:stop], max(start, stop - _SEGMENT_S))
    return losses[seconds]


def rhythm_losses(counts: Counts, n_seconds: int, repertoire: Repertoire, genres: Sequence[str]) -> Floats:
    """The loss (S, G) of genres for the tempo and the metre of a song in each second.

    A genre is danced between the tempi of its slowest and its fastest take. Outside of these, its loss is so
    large that it is chosen only if no genre of similar style and metre includes the tempo.
    """
    losses = np.zeros((n_seconds, len(genres)))
    if len(counts) < 2:
        return losses
    bpm, metre_at = tempo_at(counts, n_seconds), _metre_at(counts, n_seconds)
    for column, genre in enumerate(genres):
        takes = tempi_of_takes(repertoire, genre)
        metres = takes.metre[takes.metre > 0]
        if len(metres) and counts.has_bars:
            other = np.zeros(n_seconds)
            for metre in np.unique(metre_at[metre_at > 0]).tolist():
                other[metre_at == metre] = np.mean(~np.isin(metres, DANCED_IN.get(metre, (metre,))))
            losses[:, column] += _OTHER_METRE * counts.confidence**2 * other
        slowest_bpm, fastest_bpm = _tempi_bpm(takes)
        ratio = np.maximum(np.maximum(slowest_bpm / bpm, bpm / fastest_bpm), 1.0)
        losses[:, column] += (ratio > 1.0) * _OTHER_TEMPO + _PER_OCTAVE * np.log2(ratio)
        losses[:, column] += _PER_MEAN_OCTAVE * _mean_octaves(bpm, takes)
    return losses


def _mean_octaves(bpm: Floats, takes: TakeTempi) -> Floats:
    """Mean difference in octaves of tempi (S,) from those of counted takes, weighted by their duration.

    It is 0 without takes.
    """
    if len(takes.bpm) == 0:
        return np.zeros(len(bpm))
    tempi, back = np.unique(bpm, return_inverse=True)  # (P,) which songs have few of
    octaves = np.abs(np.log2(tempi[:, None] / takes.bpm))  # (P, X)
    mean: Floats = np.average(octaves, axis=1, weights=takes.counted_s)[back]
    return mean


def _tempi_bpm(takes: TakeTempi) -> tuple[float, float]:
    """The slowest and the fastest tempo of counted takes, with a tolerance. Without takes, 0 and infinity."""
    slowest, fastest = min(takes.bpm.tolist(), default=0.0), max(takes.bpm.tolist(), default=np.inf)
    return slowest / _SAME_TEMPO, fastest * _SAME_TEMPO


def _tempo_of_part(
    song_features: SongFeatures, first_second: int, stop_second: int, repertoire: Repertoire, genre: str
) -> str:
    """Empty, or "slower" or "faster" if a part of a song is outside the tempi of a genre's takes."""
    if len(song_features.counts) < 2:
        return ""
    bpm = float(np.median(tempo_at(song_features.counts, song_features.n_seconds)[first_second:stop_second]))
    slowest_bpm, fastest_bpm = _tempi_bpm(tempi_of_takes(repertoire, genre))
    return "slower" if bpm < slowest_bpm else "faster" if bpm > fastest_bpm else ""


def tempi_of_takes(repertoire: Repertoire, genre: str) -> TakeTempi:
    """The tempi of the takes of a genre that have counts. Estimated ones are used if there are no others."""
    tempi = repertoire.take_tempi
    of_genre = np.array([info.credits.genre == genre for info in repertoire.takes])
    counted = of_genre & (tempi.n_counts > 1)
    known = counted & ~tempi.is_estimated
    return tempi.of(known if known.any() else counted)


def tempo_at(counts: Counts, n_seconds: int) -> Floats:
    """The tempo around the middle of each second (S,), in BPM."""
    periods_s = scipy.ndimage.median_filter(np.diff(counts.times_s), min(9, len(counts) - 1), mode="nearest")
    middles_s = (counts.times_s[1:] + counts.times_s[:-1]) / 2
    bpm: Floats = 60.0 / np.interp(np.arange(n_seconds) + 0.5, middles_s, periods_s)
    return bpm


def song_metre_at(song_features: SongFeatures) -> NDArray[np.int64]:
    """Beats in the bar around the middle of each second (S,), 0 if there is no bar."""
    return _metre_at(song_features.counts, song_features.n_seconds)


def _metre_at(counts: Counts, n_seconds: int) -> NDArray[np.int64]:
    metre = np.zeros(n_seconds, np.int64)
    downbeats = np.flatnonzero(counts.numbers == 1)
    if len(downbeats) < 2:
        return metre
    length = np.diff(downbeats)  # (bars,)
    bar = np.searchsorted(counts.times_s[downbeats], np.arange(n_seconds) + 0.5, "right") - 1
    return length[np.clip(bar, 0, len(length) - 1)].astype(np.int64)
