"""Form of a song: its sections, its phrases, and which of them are repeated."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats, Indices, frame_blocks
from choreograph.music.bars import at_changes
from choreograph.music.spectral import SPECTRAL_COLUMNS

SECTION_S = 12.0  # average length of a section
_MIN_SECTION_S = 6.0  # a shorter part is a fill or a break, not a section
_MIN_BEATS = 8
_SAME_SECTION_DISTANCE = 0.35  # of the features' deviation. Sections with a lower mean distance are repeats
# Weights of standardised groups. Timbre separates sections better than harmony. Both together do best.
_GROUP_WEIGHTS = {"chroma_cens": 0.5, "mel_db": 1.0, "mfcc": 1.0}
_CHANGE_REACH_S = 4.0  # drums may change a bar before the cut, and a tracker follows a beat or two late
_NONE = np.zeros(0)
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
# Phrases. The features that are compared, the largest distance of repeats (of the median of two counts), and
# the terms of the choice of phrases.
_WHOLE_ROWS = 1536  # of the distances of counts that are computed at once: 12 minutes of song
_ROWS_AT_ONCE = 384  # in longer songs. With other numbers, products of matrices are rounded otherwise
_ROWS_CHANGED = 128
_SAMPLED = 20_000  # values, of which the median of all is near that of the sample
_AROUND_MEDIAN = 0.47, 0.53  # shares of the sample
_COMPARED = ("chroma", "chroma_cqt", "mel_db")
_SAME_PHRASE_DISTANCE = 0.45
_CUT_OFF_SHARE = 0.5  # of a phrase. The last phrase of a song repeats it even if its end is missing
_PENALTIES = {4: 0.0, 2: 1.5, 6: 2.0, 1: 2.5, 3: 2.5, 5: 2.5, 7: 3.0}  # by length in bars
_CHANGE_WEIGHT = 0.5  # of one standard deviation
_CHANGE_BARS = 4  # before and after a border
_SHORTEST_REPEAT_BARS = 3
_REPEAT_REWARD = 1.5  # of four bars that are repeated exactly


@dataclass(frozen=True, eq=False)
class Sections:
    """Consecutive sections of a song, or none if the song has too few beats."""

    bounds_s: Floats
    """(S + 1,) times in seconds at which sections begin, and the end of the last one, or (0,)."""

    labels: NDArray[np.int64]
    """(S,) label of each section. Equal labels are the same music repeated."""

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def names(self) -> tuple[str, ...]:
        """A letter for each section. The first one is A, and so is every section that repeats it."""
        order = list(dict.fromkeys(self.labels.tolist()))
        return tuple(letter_name(order.index(label)) for label in self.labels.tolist())


def letter_name(rank: int) -> str:
    """The name of a part of a song: A to Z, then A1 to Z1 and so on."""
    return _LETTERS[rank % 26] + (str(rank // 26) if rank >= 26 else "")


@dataclass(frozen=True)
class Phrase:
    """A span of the music of about 4 or 8 bars, from one count 1 to another."""

    start_s: float
    """When it begins, in seconds."""

    end_s: float
    """When it ends, in seconds: at the start of the next phrase, or at the last count of the song."""

    n_counts: int
    """Its length in counts."""

    section: int
    """Index of the section in which it begins."""

    repeats: int | None = None
    """Index of the first phrase that it repeats count by count, or None if it is new."""


@dataclass(frozen=True)
class Form:
    """The phrases of a song, in order and without gaps. There are none if its bars are not known.

    Examples
    --------
    >>> from choreograph.music.form import Form, Phrase
    >>> first = Phrase(start_s=0.0, end_s=8.0, n_counts=16, section=0, repeats=None)
    >>> Form((first, Phrase(8.0, 16.0, 16, 1, None), Phrase(16.0, 24.0, 16, 2, repeats=0))).labels
    (0, 1, 0)
    """

    phrases: tuple[Phrase, ...]
    """The phrases in order of time, without gaps."""

    @classmethod
    def empty(cls) -> Form:
        """The form of a song without counts."""
        return cls(())

    @property
    def labels(self) -> tuple[int, ...]:
        """The index of the first phrase with the same music, of each phrase."""
        return tuple(
            index if phrase.repeats is None else phrase.repeats for index, phrase in enumerate(self.phrases)
        )


def phrase_bounds_s(counts: Counts, duration_s: float) -> Floats:
    """The counts (Q,), and the end of the last one if it is in the song: the bounds of what is compared."""
    times_s = counts.times_s
    if len(times_s) < 2:
        return times_s
    end_s = 2 * times_s[-1] - times_s[-2]
    return np.append(times_s, end_s) if end_s < duration_s else times_s


def song_form(features: NDArray[np.floating], bounds_s: Floats, counts: Counts, sections: Sections) -> Form:
    """The phrases of a song with bars.

    `features` are the spectral features (B - 1, 87) between the `phrase_bounds_s` (B,) of its counts. Phrases
    begin on downbeats. Most of them have four bars. They begin where the music changes and where repeats
    begin. A phrase repeats another one of the same length if their counts have similar features one by one.
    The last phrase of a song may be shorter than the one that it repeats.
    """
    if not counts.has_bars or len(sections) == 0:
        return Form.empty()
    downbeats = np.flatnonzero(counts.numbers == 1)
    downbeats = downbeats[downbeats < len(features)]
    if len(downbeats) == 0:
        return Form.empty()
    away = CountDistances(features)
    bounds = _phrase_bounds(away, np.append(downbeats, len(features)))
    apart = _phrase_distances(away, bounds)
    phrases: list[Phrase] = []
    for index, (start, end) in enumerate(pairwise(bounds.tolist())):
        most = (end - start) / _CUT_OFF_SHARE if end == bounds[-1] else end - start
        section = int(np.searchsorted(sections.bounds_s[1:-1], bounds_s[start], side="right"))
        same = [
            apart[before, index]
            if phrase.repeats is None and end - start <= phrase.n_counts <= most
            else np.inf
            for before, phrase in enumerate(phrases)
        ]
        nearest = int(np.argmin(same)) if same else 0
        repeats = nearest if same and same[nearest] < _SAME_PHRASE_DISTANCE else None
        phrases.append(
            Phrase(float(bounds_s[start]), float(bounds_s[end]), int(end - start), section, repeats)
        )
    return Form(tuple(phrases))


class CountDistances:
    """Distances of any two rows of spectral features (N, 87), relative to their median.

    They are computed in blocks of rows when they are read, since all of an hour of song take 0.5 GB.
    """

    def __init__(self, features: NDArray[np.floating]) -> None:
        groups = []
        for name in _COMPARED:
            columns = features[:, SPECTRAL_COLUMNS[name]].astype(np.float64)
            spread = columns.std(axis=0) + 1e-6
            groups.append((columns - columns.mean(axis=0)) / spread / np.sqrt(columns.shape[1]))
        self._vectors = np.hstack(groups)  # (N, F)
        self._squared = np.square(self._vectors).sum(axis=1)
        self._size = len(features) if len(features) <= _WHOLE_ROWS else _ROWS_AT_ONCE
        self._recent: dict[int, Floats] = {}  # the last two blocks, by their numbers
        self._median = 1.0
        low, high = np.quantile(self._sample(), _AROUND_MEDIAN)
        numbers = range(-(-len(features) // self._size))
        self._median = max(_median(lambda: map(self._block, numbers), float(low), float(high)), 1e-9)

    def rows(self, first: int, stop: int, columns: slice = slice(None)) -> Floats:
        """Rows `first` to `stop` - 1 of the distances, (n, N). They are fastest to read in order."""
        parts = []
        for number in range(first // self._size, (stop - 1) // self._size + 1):
            begin = number * self._size
            parts.append(self._kept(number)[max(0, first - begin) : stop - begin, columns])
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _kept(self, number: int) -> Floats:
        if number not in self._recent:
            self._recent = dict(list(self._recent.items())[-1:])
            self._recent[number] = self._block(number)
        return self._recent[number]

    def _block(self, number: int) -> Floats:
        rows = slice(number * self._size, (number + 1) * self._size)
        away: Floats = 2 * self._vectors[rows] @ self._vectors.T
        for part in frame_blocks(len(away), _ROWS_CHANGED):  # in place
            squared = self._squared[rows][part, None] + self._squared - away[part]
            away[part] = np.sqrt(np.maximum(squared, 0.0, out=squared), out=squared)
        away /= self._median
        return away

    def _sample(self) -> Floats:
        """Some of the distances, about as they are."""
        n = len(self._squared)
        one, other = np.divmod(np.arange(0, n * n, max(1, n * n // _SAMPLED)), n)
        apart: Floats = np.linalg.norm(self._vectors[one] - self._vectors[other], axis=1)
        return apart


def _median(blocks: Callable[[], Iterable[Floats]], low: float, high: float) -> float:
    """The median of the values of all blocks as NumPy's, which would need them at once.

    Only values from `low` to `high` are sorted, if it is among them.
    """
    n_values, n_below, near = 0, 0, []
    for block in blocks():
        n_values += block.size
        n_below += int(np.count_nonzero(block < low))
        near.append(block[(block >= low) & (block <= high)])
    found, middle = np.sort(np.concatenate(near)), (n_values - 1) // 2 - n_below
    if middle < 0 or middle + 1 >= len(found):
        return float(np.median(found)) if len(found) == n_values else _median(blocks, -np.inf, np.inf)
    return float(np.mean(found[middle : middle + 2 - n_values % 2]))


def _phrase_distances(away: CountDistances, bounds: Indices) -> Floats:
    """Mean distance, count by count, of each phrase and the later ones that are no longer, (P, P).

    The bounds (P + 1,) are counts. The last phrase is compared as far as it goes.
    """
    starts, lengths = bounds[:-1], np.diff(bounds)
    apart = np.full((len(starts), len(starts)), np.inf)
    for one, (start, length) in enumerate(zip(starts.tolist(), lengths.tolist(), strict=True)):
        of_counts = away.rows(start, start + length)
        for other in range(one + 1, len(starts)):
            if lengths[other] <= length:
                steps = np.arange(lengths[other])
                apart[one, other] = of_counts[steps, starts[other] + steps].mean()
    return apart


def _phrase_bounds(away: CountDistances, bars: Indices) -> Indices:
    """First counts of the phrases, and the end of the last one, among the bounds of bars (B + 1,).

    The phrases have the greatest sum of two terms: how much the music changes at each start, and the share of
    counts that have a repeat, minus a penalty for lengths other than four bars.
    """
    n_bars = len(bars) - 1
    change = _changes(away, bars)
    rewards = _repeat_rewards(away, bars)
    best = np.full(n_bars + 1, -np.inf)
    best[0] = 0.0
    before = np.zeros(n_bars + 1, np.int64)
    for end in range(1, n_bars + 1):
        for n, penalty in _PENALTIES.items():
            start = end - n
            if start < 0:
                continue
            value = best[start] + _CHANGE_WEIGHT * change[start] + rewards[n][start] - penalty
            if value > best[end]:
                best[end], before[end] = value, start
    bounds = [n_bars]
    while bounds[-1] > 0:
        bounds.append(int(before[bounds[-1]]))
    return bars[bounds[::-1]]


def _changes(away: CountDistances, bars: Indices) -> Floats:
    """How much the music differs before and after the start of each bar, (B,), standardised."""
    change = np.zeros(len(bars) - 1)
    for bar in range(1, len(bars) - 1):
        reach = min(_CHANGE_BARS, bar, len(bars) - 1 - bar)
        first, stop = bars[bar - reach], bars[bar + reach]
        near = away.rows(first, stop, slice(first, stop))
        left, right = slice(bars[bar] - first), slice(bars[bar] - first, None)
        within = 0.5 * (near[left, left].mean() + near[right, right].mean())
        change[bar] = near[left, right].mean() - within
    spread = float(change.std())
    return (change - change.mean()) / spread if spread > 0 else change


def _repeat_rewards(away: CountDistances, bars: Indices) -> dict[int, Floats]:
    """For each length in bars, the reward (B,) of a phrase there if another span is the same music."""
    lengths = np.diff(bars)
    n_bars = len(lengths)
    rewards = {n: np.zeros(n_bars) for n in _PENALTIES}
    of_bars = np.full((n_bars, n_bars), np.inf)  # mean distance of two bars of one length
    same = {length: np.flatnonzero(lengths == length) for length in np.unique(lengths).tolist()}
    for bar, length in enumerate(lengths.tolist()):
        steps, others = np.arange(length), same[length]
        of_counts = away.rows(bars[bar], bars[bar + 1])[
            steps, bars[others][:, None] + steps
        ]  # (bars, length)
        of_bars[bar, others] = of_counts.mean(axis=1)
    for n, reward in rewards.items():
        n_starts = n_bars - n + 1
        if n < _SHORTEST_REPEAT_BARS or n_starts < 1:
            continue
        starts, nearest = np.arange(n_starts), np.empty(n_starts)
        for rows in frame_blocks(n_starts, _ROWS_CHANGED):
            begins = starts[rows]
            spans = sum(of_bars[begins[0] + k : begins[-1] + 1 + k, k : k + n_starts] for k in range(n)) / n
            overlap = np.abs(begins[:, None] - starts) < n
            nearest[rows] = np.where(overlap, np.inf, spans).min(axis=1)
        reward[:n_starts] = _REPEAT_REWARD * n / 4 * np.maximum(0.0, 1.0 - nearest / _SAME_PHRASE_DISTANCE)
    return rewards


def song_sections(
    features: NDArray[np.floating],
    beat_times_s: NDArray[np.floating],
    *,
    downbeat_times_s: NDArray[np.floating] | None = None,
    change_times_s: NDArray[np.floating] = _NONE,
) -> Sections:
    """The sections of a song, bounded by beats (Q,), or by downbeats if those are given.

    `features` are the spectral features (Q - 1, 87) of the intervals between beats (`music.spectral`).
    Neighbouring bars (beats, if downbeats are not known) are merged by Ward's criterion to one section per
    12 s. Sections shorter than 6 s are merged with the more
    similar neighbour. Sections with similar mean features get one label. There is a bound at every beat of
    `change_times_s` (C,), where other music begins (see `music.bars`). A bound that is 1.5 to 4 s
    from it is moved there. At least 17 beats are needed.
    """
    beats_s = np.asarray(beat_times_s, np.float64)
    if len(beats_s) <= 2 * _MIN_BEATS:
        return Sections(np.zeros(0), np.zeros(0, np.int64))
    beat_features = _standardized(features)  # (Q - 1, F)
    if downbeat_times_s is None or len(downbeat_times_s) == 0:
        units = np.arange(len(beat_features))
    else:
        units = np.union1d(0, np.flatnonzero(np.isin(beats_s[:-1], downbeat_times_s)))
    starts = _with_changes(_section_starts(beat_features, beats_s, units), beats_s, change_times_s)
    means = _means(beat_features, starts)
    threshold = _SAME_SECTION_DISTANCE * np.sqrt(np.square(beat_features).sum(axis=1).mean())
    if len(means) == 1:
        return Sections(beats_s[[0, -1]], np.zeros(1, np.int64))
    from scipy.cluster.hierarchy import fcluster, linkage  # not needed where the analysis is kept

    labels = fcluster(linkage(means, "average"), threshold, "distance").astype(np.int64) - 1
    # Neighbours with one label are one section, unless other music begins there.
    first = np.r_[True, np.diff(labels) != 0] | at_changes(beats_s[starts], change_times_s)
    return Sections(np.r_[beats_s[starts[first]], beats_s[-1]], labels[first])


def _section_starts(beat_features: Floats, beats_s: Floats, units: NDArray[np.int64]) -> NDArray[np.int64]:
    """First beat of each section, (S,), among the first beats (U,) of the units to be merged."""
    most = min(len(beat_features) // _MIN_BEATS, len(units))
    n_sections = int(np.clip(round((beats_s[-1] - beats_s[0]) / SECTION_S), min(2, most), most))
    starts = units[_merged(_means(beat_features, units), n_sections)]
    while len(starts) > 1:
        length_s = np.diff(beats_s[np.append(starts, len(beats_s) - 1)])
        shortest = int(length_s.argmin())
        if length_s[shortest] >= _MIN_SECTION_S:
            break
        means = _means(beat_features, starts)
        away = np.linalg.norm(np.diff(means, axis=0), axis=1)  # (S - 1,) of neighbours
        before = away[shortest - 1] if shortest > 0 else np.inf
        after = away[shortest] if shortest < len(away) else np.inf
        starts = np.delete(starts, shortest if before <= after else shortest + 1)
    return starts


def _merged(rows: Floats, n_parts: int) -> NDArray[np.int64]:
    """First rows of parts (n_parts,) of rows (U, F), merged from the most similar neighbours on.

    By Ward's criterion, those are most similar whose merger adds least to the sum of squared distances of
    rows to the means of their parts.
    """
    starts, means = np.arange(len(rows)), rows.astype(np.float64)
    while len(starts) > n_parts:
        sizes = np.diff(np.append(starts, len(rows)))
        weights = sizes[:-1] * sizes[1:] / (sizes[:-1] + sizes[1:])
        at = int((weights * np.square(np.diff(means, axis=0)).sum(axis=1)).argmin())
        means[at] = np.average(means[at : at + 2], axis=0, weights=sizes[at : at + 2])
        starts, means = np.delete(starts, at + 1), np.delete(means, at + 1, axis=0)
    return starts


def _with_changes(
    starts: NDArray[np.int64], beats_s: Floats, change_times_s: NDArray[np.floating]
) -> NDArray[np.int64]:
    """First beats of sections (S,), those near a change moved to its beat, and the other changes."""
    bounds = starts[1:].copy()  # the first section begins with the song
    for change_s in change_times_s:
        if at_changes(np.array([change_s]), beats_s[bounds])[0]:
            continue
        beat = int(np.abs(beats_s - change_s).argmin())
        away_s = np.abs(beats_s[bounds] - change_s)
        is_free = ~at_changes(beats_s[bounds], change_times_s)  # not where another change is
        if np.min(away_s, initial=np.inf, where=is_free) <= _CHANGE_REACH_S:
            bounds[np.where(is_free, away_s, np.inf).argmin()] = beat
        elif np.min(away_s, initial=np.inf) > _CHANGE_REACH_S:
            bounds = np.append(bounds, beat)
    inside = bounds[(bounds > 0) & (bounds < len(beats_s) - 1)]
    return np.union1d(starts[:1], inside)


def _means(beat_features: Floats, starts: NDArray[np.int64]) -> Floats:
    """Mean features of the parts that begin at these beats, (S, F)."""
    return np.stack([part.mean(axis=0) for part in np.split(beat_features, starts[1:])])


def _standardized(features: NDArray[np.floating]) -> Floats:
    """Features (B, 87) of beats as (B, F), every group standardised and weighted."""
    groups = []
    for name, weight in _GROUP_WEIGHTS.items():
        columns = features[:, SPECTRAL_COLUMNS[name]].astype(np.float64)
        spread = columns.std(axis=0) + 1e-6
        groups.append(weight * (columns - columns.mean(axis=0)) / spread / np.sqrt(columns.shape[1]))
    return np.hstack(groups)
