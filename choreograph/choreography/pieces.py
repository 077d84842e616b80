"""Pieces of takes that may be danced in a part of an existing dance, their costs, and what is said of them.

A piece is a part of one take of a whole number of counts, which is played count by count. It begins and ends
with the counts that lead from and to the dance around it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from choreograph.choreography.edits import EditSlots
from choreograph.choreography.mixer.words import AROUND_S
from choreograph.core.counts import UNKNOWN, Counts, bar_positions
from choreograph.core.numerics import Floats, Indices
from choreograph.core.timebase import MAX_SLOPE, MIN_SLOPE
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import dance_bounds_s, poses_at
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, clips_to_root_frame, ground_pos_m, heading_rad
from choreograph.motion.motion import Credits, Motion
from choreograph.music.count_grids import accent_shifts_s
from choreograph.plan.plan import Plan, PlannedWord

# The counts of all takes, on which pieces begin and end.


NEAR_S = 0.12  # of the start of a word from a count that is its start


class PieceBank:
    """The counts of the takes of a repertoire, with their positions in the bar and their motifs."""

    def __init__(self, repertoire: Repertoire) -> None:
        self.repertoire = repertoire
        self._motifs: dict[int, Indices] = {}

    @cached_property
    def counts_s(self) -> list[Floats]:
        """The counts (Q,) of each take, moved to its accents and continued to its ends."""
        found = []
        for take, info in enumerate(self.repertoire.takes):
            counts_s = self.repertoire.counts(take).times_s
            beats_s = self.repertoire.motion_beats_s(take)
            if len(counts_s) < 2:
                counts_s = beats_s
            found.append(dance_bounds_s(counts_s + accent_shifts_s(beats_s, counts_s), info.duration_s))
        return found

    @cached_property
    def positions(self) -> list[Indices]:
        """The position in the bar (Q,) of each count of each take, as of `bar_positions`."""
        return [bar_positions(s, self.repertoire.counts(take)) for take, s in enumerate(self.counts_s)]

    def motifs(self, take: int) -> Indices:
        """The motif (Q,) of the word that begins on each count of a take, -1 where there is none."""
        if take not in self._motifs:
            times_s = self.counts_s[take]
            motifs = np.full(len(times_s), -1, np.int64)
            if self.repertoire.has_vocabulary:
                v = self.repertoire.vocabulary
                words = v.words_of_take(take)
                if len(v.word_start_s[words]):
                    away_s = np.abs(v.word_start_s[words] - times_s[:, None])  # (Q, W)
                    nearest = away_s.argmin(axis=1)
                    near = away_s[np.arange(len(times_s)), nearest] < NEAR_S
                    motifs[near] = v.word_motif[words][nearest[near]]
            self._motifs[take] = motifs
        return self._motifs[take]


# The existing dance around an edit.


class Surroundings:
    """An existing dance, with its counts, its poses, and the takes that it is made of."""

    def __init__(self, plan: Plan, motion: Motion, bounds_s: Floats) -> None:
        self.plan, self.bounds_s, self.fps = plan, bounds_s, motion.fps
        self.body_m = body_pos_m(motion)  # (T, 21, 3)
        self.blocks = plan.planned_blocks
        numbers = np.array(plan.music_beat_numbers, np.int64)
        beats_s = np.array(plan.music_beats_s)
        counts = Counts(beats_s, numbers if len(numbers) else np.zeros(len(beats_s), np.int64), plan.metre)
        self.positions = bar_positions(bounds_s, counts)  # (N + 1,)

    def poses_m(self, times_s: Floats) -> Floats:
        """Poses (..., 21, 3) of the dance at times (...)."""
        return poses_at(self.body_m, self.fps, times_s)

    def source_at(self, at_s: float) -> tuple[str, float]:
        """The take that is danced at a time, and the time in it."""
        block = next((b for b in self.blocks if b.start_s <= at_s < b.end_s), self.blocks[-1])
        return block.planned.take, block.source_s(at_s)

    def credits(self, slots: EditSlots) -> list[Credits]:
        """The credits of the takes in a span."""
        start_s, end_s = self.bounds_s[[slots.first, slots.stop]]
        return [b.planned.credits for b in self.blocks if b.start_s < end_s and b.end_s > start_s]


# The pieces for the slots of an edit, and what they cost.


APART_M = 0.2  # mean joint distance of two pieces that look different
_MOST_READ = 2048  # pieces of which the poses at the ends are read
_MOST_COMPARED = 256  # pieces, the cheapest by their ends, of which the poses within are read
_POSES_PER_COUNT = 4
_FAR = 0.75  # of the greatest distance from the dance there, if no piece is far enough from it
_RADIUS_M = 0.3  # that the feet move in a turn of a radian, about
_AGAIN_S = 10.0  # within which the same part of a take is a repetition
# Weights of the costs, all in metres of joint distance.
_TRAVEL = 0.5  # of a correction of the path by a metre a second
_TEMPO_M = 0.15  # of half or twice the speed
_COUNT_M = 0.5  # of a piece that begins on another count of the bar
_GENRE_M = 0.3  # of another genre than the dance has there
_FRONT_M = 0.25  # of a piece that is danced with the back to the audience
_ENERGY_M = 0.2  # of half or twice the speed of the joints that the dance has there
_AGAIN_M = 0.25  # of a part of a take that is danced at nearly the same time
_SIMILAR = 1.5  # of the distance from the dance there, if a variation is asked for


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of a take for the slots of an edit."""

    words: tuple[PlannedWord, ...]  # one for each slot, the leading ones included
    costs: dict[str, float]  # by name, in metres of joint distance
    poses_m: Floats  # (S, 21, 3) of what was asked for, moved rigidly to one place and heading
    why: str  # how it differs from the dance there, in words

    @property
    def cost(self) -> float:
        """The sum of its costs."""
        return sum(self.costs.values())


@dataclass(frozen=True)
class PieceRequest:
    """What is asked of a piece."""

    takes: Collection[int]  # that may be danced
    motif: int | None = None  # of its first count
    banned: Collection[int] = ()  # motifs that it must not have
    similar: bool = False  # to the dance there
    pinned: bool = False  # it keeps its size, and may be the dance there


def ranked_pieces(
    bank: PieceBank,
    around: Surroundings,
    slots: EditSlots,
    request: PieceRequest,
    *,
    most_read: int = _MOST_READ,
) -> list[Piece]:
    """Pieces for the slots of an edit, the cheapest first. There may be none.

    Poses are read of the `most_read` pieces that are the cheapest by their counts.

    A piece is played at half to twice its speed. Unless it is pinned, it differs from the dance there by a
    mean joint distance of 0.2 m, or of 0.1 m if it shall be similar. If none does, it is one of those that
    differ most.
    """
    found = _candidates(bank, around, slots, request)
    if len(found.takes) == 0:
        return []
    found, costs = _cheapest(found, _costs_of_counts(bank, around, slots, found), most_read)
    costs |= _costs_of_ends(bank, around, slots, found)
    found, costs = _cheapest(found, costs, _MOST_COMPARED)
    takes, rows, counts_s = found.takes, found.rows, found.counts_s
    shares = np.arange(
        slots.before * _POSES_PER_COUNT, (slots.end - slots.begin - slots.after) * _POSES_PER_COUNT
    )
    index = (shares + 0.5) / _POSES_PER_COUNT  # (S,) in slots from the first one
    poses_m = clips_to_root_frame(
        bank.repertoire.clip_motion.poses_at(takes, _at(counts_s, index))
    )  # (M, S, 21, 3)
    times_s = np.interp(index + slots.begin, np.arange(len(around.bounds_s)), around.bounds_s)
    here_m = clips_to_root_frame(around.poses_m(times_s))  # (S, 21, 3)
    distance_m = _distance_m(poses_m, here_m)
    speeds = np.log2((_speed(poses_m) + 1e-3) / (_speed(here_m[None]) + 1e-3))
    again = _is_again(around, slots, bank, takes, counts_s)
    costs |= {"energy": _ENERGY_M * np.abs(speeds), "again": np.where(again, _AGAIN_M, 0.0)}
    if request.similar:
        costs["difference"] = _SIMILAR * distance_m
    total = _total(costs)
    least_m = 0.0 if request.pinned else APART_M / 2 if request.similar else APART_M
    least_m = min(least_m, _FAR * float(distance_m.max()))
    pieces = []
    for row in np.argsort(total, kind="stable").tolist():
        if distance_m[row] < least_m:
            continue
        take = int(takes[row])
        motifs = bank.motifs(take)[rows[row] : rows[row] + slots.end - slots.begin]
        why = reasons(
            bank, around, slots, take, motifs, counts_s[row], float(speeds[row]), costs["joins"][row]
        )
        pieces.append(
            Piece(
                _words(bank, around, slots, take, motifs, counts_s[row], pinned=request.pinned),
                {name: round(float(cost[row]), 4) for name, cost in costs.items()},
                poses_m[row],
                why,
            )
        )
    return pieces


def distinct(pieces: Sequence[Piece], n: int, *, apart_m: float = APART_M) -> list[Piece]:
    """The first `n` of the pieces that are `apart_m` from each other."""
    chosen: list[Piece] = []
    for piece in pieces:
        if len(chosen) == n:
            break
        if all(pose_distance_m(piece.poses_m, other.poses_m) >= apart_m for other in chosen):
            chosen.append(piece)
    return chosen


def pose_distance_m(one_m: Floats, other_m: Floats) -> float:
    """Mean joint distance of two clips (S, 21, 3), each moved rigidly to one place and heading."""
    return float(np.linalg.norm(one_m - other_m, axis=-1).mean())


@dataclass(frozen=True, eq=False)
class _Found:
    """Pieces of takes that fit the slots of an edit, M of them."""

    takes: Indices  # (M,)
    rows: Indices  # (M,) the counts of the takes on which they begin
    counts_s: Floats  # (M, n + 1) times of the take at the bounds of all slots
    positions: Indices  # (M,) in the bar, of the first count that was asked for


def _cheapest(found: _Found, costs: dict[str, Floats], n: int) -> tuple[_Found, dict[str, Floats]]:
    """The `n` pieces with the least costs, so that a large library needs no more time and memory."""
    if len(found.takes) <= n:
        return found, costs
    rows = np.argsort(_total(costs), kind="stable")[:n]
    kept = _Found(found.takes[rows], found.rows[rows], found.counts_s[rows], found.positions[rows])
    return kept, {name: cost[rows] for name, cost in costs.items()}


def _total(costs: dict[str, Floats]) -> Floats:
    total: Floats = np.sum(list(costs.values()), axis=0)
    return total


def _candidates(bank: PieceBank, around: Surroundings, slots: EditSlots, request: PieceRequest) -> _Found:
    """All pieces that may be played for the slots of an edit, at half to twice their speed."""
    n = slots.end - slots.begin
    lengths_s = np.diff(around.bounds_s[slots.begin : slots.end + 1])  # (n,)
    none = np.zeros(0, np.int64)
    takes, rows, counts_s, positions = [none], [none], [np.zeros((0, n + 1))], [none]
    for take in sorted(request.takes):
        times_s = bank.counts_s[take]
        if len(times_s) <= n:
            continue
        windows_s = sliding_window_view(times_s, n + 1)
        ratio = np.diff(windows_s, axis=1) / lengths_s
        fits = ((ratio >= MIN_SLOPE) & (ratio <= MAX_SLOPE)).all(axis=1)
        found = np.flatnonzero(fits)
        if request.motif is not None:
            found = found[bank.motifs(take)[found + slots.before] == request.motif]
        if len(request.banned):
            motifs = bank.motifs(take)[found[:, None] + np.arange(n)]
            found = found[~np.isin(motifs, list(request.banned)).any(axis=1)]
        takes.append(np.full(len(found), take))
        rows.append(found)
        counts_s.append(windows_s[found])
        positions.append(bank.positions[take][found + slots.before])
    return _Found(
        np.concatenate(takes), np.concatenate(rows), np.concatenate(counts_s), np.concatenate(positions)
    )


def _at(counts_s: Floats, index: Floats) -> Floats:
    """Times (M, S) of pieces with counts (M, n + 1) at fractional counts (S,)."""
    low = np.minimum(index.astype(np.int64), counts_s.shape[1] - 2)
    times_s: Floats = counts_s[:, low] + (index - low) * (counts_s[:, low + 1] - counts_s[:, low])
    return times_s


def _costs_of_counts(
    bank: PieceBank, around: Surroundings, slots: EditSlots, found: _Found
) -> dict[str, Floats]:
    """What pieces (M,) cost because of their tempo, their counts and their genre, without their poses."""
    lengths_s = np.diff(around.bounds_s[slots.begin : slots.end + 1])
    ratio = np.diff(found.counts_s, axis=1) / lengths_s  # (M, n)
    wanted = around.positions[slots.first]
    known = (found.positions != UNKNOWN) & (wanted != UNKNOWN)
    genres = np.array([info.credits.genre for info in bank.repertoire.takes])[found.takes]
    others = ~np.isin(genres, [one.genre for one in around.credits(slots)])
    return {
        "tempo": _TEMPO_M * np.square(np.log2(ratio)).mean(axis=1),
        "count": np.where(known & (found.positions != wanted), _COUNT_M, 0.0),
        "genre": np.where(others, _GENRE_M, 0.0),
    }


def _costs_of_ends(
    bank: PieceBank, around: Surroundings, slots: EditSlots, found: _Found
) -> dict[str, Floats]:
    """What pieces (M,) cost because of their ends."""
    clips, times_s = bank.repertoire.clip_motion, around.bounds_s[[slots.begin, slots.end]]
    inside = np.array([slots.begin > 0, slots.end < len(around.bounds_s) - 1])  # of the dance
    lengths_s = np.diff(around.bounds_s[slots.begin : slots.end + 1])[[0, -1]]
    speeds = np.diff(found.counts_s, axis=1)[:, [0, -1]]  # (M, 2) in s of the take by count
    ends_s = found.counts_s[:, [0, -1], None] + (speeds / lengths_s)[..., None] * AROUND_S  # (M, 2, 3)
    poses_m = clips.poses_at(found.takes, ends_s)  # (M, 2, 3, 21, 3)
    here_m = around.poses_m(times_s[:, None] + AROUND_S)  # (2, 3, 21, 3)
    away_m = clips_to_root_frame(poses_m) - clips_to_root_frame(here_m)
    joins = np.sqrt(np.square(away_m).sum(axis=-1).mean(axis=(-2, -1)))  # (M, 2) in m
    headings, here_rad = heading_rad(poses_m[:, :, 1]), heading_rad(here_m[:, 1])
    led_m = _walk_m(poses_m[:, :, 1], headings) - _walk_m(here_m[None, :, 1], here_rad[None])  # (M, 3)
    turn_rad = _wrapped((headings[:, 1] - headings[:, 0]) - (here_rad[1] - here_rad[0]))
    fast_m_s = (np.linalg.norm(led_m, axis=-1) + _RADIUS_M * np.abs(turn_rad)) / (times_s[1] - times_s[0])
    turned_rad = here_rad[0] - (headings[:, 0] - clips.fronts_rad[found.takes])
    return {
        "joins": (joins * inside).sum(axis=1),
        "travel": _TRAVEL * fast_m_s * inside.all(),
        "front": _FRONT_M * 0.5 * (1.0 - np.cos(turned_rad)) * inside[0],
    }


def _walk_m(poses_m: Floats, headings: Floats) -> Floats:
    """The way (..., 3) between two poses (..., 2, 21, 3), seen from the heading (..., 2) of the first."""
    ground_m = ground_pos_m(poses_m)
    walk_m: Floats = rot.rotate(rot.about_y(-headings[..., 0]), ground_m[..., 1, :] - ground_m[..., 0, :])
    return walk_m


def _wrapped(angle_rad: Floats) -> Floats:
    wrapped: Floats = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    return wrapped


def _distance_m(poses_m: Floats, here_m: Floats) -> Floats:
    """Mean joint distance (M,) of pieces (M, S, 21, 3) from the dance (S, 21, 3)."""
    distance_m: Floats = np.linalg.norm(poses_m - here_m, axis=-1).mean(axis=(1, 2))
    return distance_m


def _speed(poses_m: Floats) -> Floats:
    """Mean joint distance (M,) from one of the poses (M, S, 21, 3) to the next."""
    speed: Floats = np.linalg.norm(np.diff(poses_m, axis=1), axis=-1).mean(axis=(1, 2))
    return speed


def _is_again(
    around: Surroundings, slots: EditSlots, bank: PieceBank, takes: Indices, counts_s: Floats
) -> NDArray[np.bool_]:
    """Which pieces (M,) overlap a part of their take that is danced within 10 s of the edit."""
    start_s, end_s = around.bounds_s[[slots.first, slots.stop]]
    names = np.array([info.name for info in bank.repertoire.takes])[takes]
    again = np.zeros(len(takes), bool)
    for block in around.blocks:
        if block.end_s > start_s - _AGAIN_S and block.start_s < end_s + _AGAIN_S:
            over = (counts_s[:, 0] < block.source_end_s) & (counts_s[:, -1] > block.source_start_s)
            again |= over & (names == block.planned.take)
    return again


def _words(
    bank: PieceBank, around: Surroundings, slots: EditSlots, take: int, motifs: Indices, counts_s: Floats,
    *, pinned: bool,
) -> tuple[PlannedWord, ...]:  # fmt: skip
    info, bounds_s = bank.repertoire.takes[take], around.bounds_s[slots.begin : slots.end + 1]
    times_s = np.clip(counts_s, 0.0, info.duration_s)
    return tuple(
        PlannedWord(
            round(float(bounds_s[i]), 6), round(float(bounds_s[i + 1]), 6), max(0, int(motifs[i])), info.name,
            round(float(times_s[i]), 6), round(float(times_s[i + 1]), 6), info.credits, pinned,
        )
        for i in range(len(bounds_s) - 1)
    )  # fmt: skip


# Why a piece: how it differs from the dance that it would replace, in words.

_LOUDER = 0.25  # octaves of the speed of the joints
_FASTER = 0.12  # octaves of the tempo
_HARD_M = 0.4  # of both joins


def reasons(
    bank: PieceBank, around: Surroundings, slots: EditSlots, take: int, motifs: Indices, counts_s: Floats,
    louder: float, joins_m: float,
) -> str:  # fmt: skip
    """How a piece differs from the dance there, such as "same motif, quieter, from another dancer"."""
    credits, bounds_s = bank.repertoire.takes[take].credits, around.bounds_s
    genres, performers = (
        {getattr(one, name) for one in around.credits(slots)} for name in ("genre", "performer")
    )
    said = []
    asked = motifs[slots.before : len(motifs) - slots.after]
    here = _motifs_of_dance(bank, around, slots)
    if (asked >= 0).any() and (here >= 0).any():
        same = float(np.mean((asked == here) & (asked >= 0)))
        said.append(("same motif" if len(asked) == 1 else "same motifs") if same >= 0.5 else "other motifs")
    if abs(louder) >= _LOUDER:
        said.append("livelier" if louder > 0 else "quieter")
    octaves = np.log2((counts_s[-1] - counts_s[0]) / (bounds_s[slots.end] - bounds_s[slots.begin]))
    if abs(octaves) >= _FASTER:
        said.append("played faster" if octaves > 0 else "played slower")
    if credits.genre and credits.genre not in genres:
        said.append(f"{credits.genre} instead of {' and '.join(sorted(genres - {''})) or 'none'}")
    if joins_m >= _HARD_M:
        said.append("with a harder join")
    names = {around.source_at(float(at_s))[0] for at_s in bounds_s[slots.first : slots.stop]}
    if bank.repertoire.takes[take].name in names:
        said.append("from the same take")
    elif credits.performer and credits.performer not in performers:
        said.append("from another dancer")
    else:
        said.append("from another take")
    return ", ".join(said)


def _motifs_of_dance(bank: PieceBank, around: Surroundings, slots: EditSlots) -> Indices:
    """The motif of the dance in each of the slots that were asked for, -1 where it is not known."""
    names = [info.name for info in bank.repertoire.takes]
    found = np.full(slots.stop - slots.first, -1, np.int64)
    for i, at_s in enumerate(around.bounds_s[slots.first : slots.stop].tolist()):
        name, source_s = around.source_at(at_s + 1e-6)
        if name in names:
            take = names.index(name)
            away_s = np.abs(bank.counts_s[take] - source_s)
            if away_s.min() < NEAR_S:
                found[i] = bank.motifs(take)[int(away_s.argmin())]
    return found
