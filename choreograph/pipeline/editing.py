"""Edits of dances, each of which changes a part and leaves all other frames as they are.

A part is danced with other pieces of takes, with what the dance has elsewhere, or with a pose that is held.
`alternatives` lists what else could be danced there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from choreograph.choreography.constraints import Ban, Constraints, MotifPin, TakePin, excludes
from choreograph.choreography.edits import (
    EditRequest,
    EditSlots,
    Hold,
    MoveJoin,
    Repeat,
    Vary,
    edit_slots,
    parts_of,
    slot_bounds_s,
)
from choreograph.choreography.enforcement import danced_motifs
from choreograph.choreography.pieces import (
    APART_M,
    Piece,
    PieceBank,
    PieceRequest,
    Surroundings,
    distinct,
    pose_distance_m,
    ranked_pieces,
)
from choreograph.choreography.slots import resolve_bans
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.arguments import as_list, check_function, is_whole, unexpected
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import Floats, default_numerics, one_thread
from choreograph.core.progress import ProgressReport
from choreograph.core.timebase import MAX_SLOPE, MIN_SLOPE
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.motion.body import body_pos_m, clips_to_root_frame
from choreograph.motion.motion import Credits, Motion
from choreograph.music.song import Song
from choreograph.pipeline.dancing import Dance, danced_figures
from choreograph.pipeline.keeping import check_same_song, kept_file_plan, part_of, read_existing
from choreograph.plan.joins import take_motions
from choreograph.plan.plan import TOUCH_S, Block, Plan, PlannedEdit, PlannedWord, goes_on, words_between
from choreograph.render.assembly import off_stage
from choreograph.render.rendering import with_edit

# Edits of a dance, one after another.


@default_numerics()
def edit(
    existing: Dance | str | Path,
    edits: Sequence[EditRequest],
    repertoire: str | Path | Repertoire | None = None,
    *,
    song: str | Path | Song | None = None,
    seed: int = 0,
    report: ProgressReport | None = None,
) -> Dance:
    """Change parts of a dance. All other frames remain as they are, to the bit.

    Each edit changes the time that it names, moved to the nearest counts, and one or two counts on either
    side, in which the dance goes over from and to what is kept. A pin is danced there. What is banned is
    swapped where it is danced, and not danced by any of the edits. The edits are made in their order. The
    result is a whole dance, which can be saved, rendered from its plan and edited again.

    Parameters
    ----------
    existing : a dance, as made by `dance` or `edit`, or as a plan, .bvh or .npz file
    edits : each a `Swap`, `Vary`, `Repeat`, `Hold`, `MoveJoin`, `TakePin`, `MotifPin` or `Ban`
    repertoire : the takes to dance with, among them those of the existing dance
    song : the song of the dance, for the sound of pages and videos. A motion file needs it for its counts
    seed : 0 for the best piece of a take for each edit, 1 for the second best, and so on
    report : called with the name of the stage, the number of edits made, and that of all edits

    Raises
    ------
    FormatError      a file cannot be read
    RepertoireError  the repertoire lacks a take of the existing dance
    ParameterError   an argument has a wrong type or value, a time is outside of the dance, or the song is
                     another one
    NoPathError      no piece of a take can be danced there

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=8)
    >>> edited = cg.edit(dance, [cg.Swap(4.0, 5.0), cg.Repeat(1.0, 2.0, at_s=6.0)])
    >>> edited.plan
    <Plan of a dance to 'house': 8.0 s, graph engine, 8 seconds, 2 edits>
    """
    edits = as_list(
        "edits", edits, "Swap, Vary, Repeat, Hold, MoveJoin, MotifPin, TakePin or Ban", EditRequest
    )
    if not is_whole(seed) or seed < 0:
        raise unexpected("a seed of 0 or more", seed)
    check_function("report", report)
    if not edits:
        raise ParameterError("expected an edit, got none")
    repertoire = as_repertoire(repertoire)
    return _edited(as_dance(existing, repertoire, song), edits, repertoire, seed, report)


@one_thread()
def _edited(
    dance: Dance,
    edits: Sequence[EditRequest],
    repertoire: Repertoire,
    seed: int,
    report: ProgressReport | None,
) -> Dance:
    editor = Editor(dance, repertoire, [one for one in edits if isinstance(one, Ban)], seed)
    for done, one in enumerate(edits):
        if report is not None:
            report("editing", done, len(edits))
        editor.make(one)
    if report is not None:
        report("editing", len(edits), len(edits))
    return editor.dance


def as_dance(existing: object, repertoire: Repertoire, song: str | Path | Song | None) -> Dance:
    """An existing dance from a `Dance` or a file, with a plan of takes of the repertoire.

    Raises as `edit`.
    """
    if isinstance(existing, Dance):
        for block in existing.plan.played_blocks:
            if block.planned.take:
                repertoire.take_index(block.planned.take)
        path = existing.song_path if song is None else _path_of(song)
        return replace(existing, song_path=path)
    if not isinstance(existing, str | Path):
        raise unexpected("an existing dance as a Dance or a path", existing)
    known = read_existing(existing, repertoire)
    if known.plan is not None:
        path = _path_of(song)
        if song is not None and (path is None or path.stem != known.plan.song):
            loaded = part_of(song, None, None, known.plan, keep=True)
            check_same_song(known.plan, analyse_song(loaded, repertoire)[0])
        return Dance(known.motion, known.plan, song_path=path)
    if song is None:
        raise ParameterError(
            f"expected the song of {known.name} for its counts, got none: give it, or the plan of the dance"
        )
    loaded = part_of(song, None, known.motion.duration_s, None, keep=False)
    features, _ = analyse_song(loaded, repertoire)
    return Dance(known.motion, kept_file_plan(known, features, loaded, repertoire), song_path=loaded.path)


def _path_of(song: str | Path | Song | None) -> Path | None:
    return song.path if isinstance(song, Song) else None if song is None else as_path("a song", song)


def planned_edit(piece: Piece, request: str) -> PlannedEdit:
    """The edit that dances a piece."""
    return PlannedEdit(piece.words[0].start_s, piece.words[-1].end_s, request, piece.words)


_TRIES = 12  # pieces that are rendered until one shows a pinned motif, and no banned one


class Editor:
    """A dance that is edited step by step."""

    def __init__(self, dance: Dance, repertoire: Repertoire, bans: Sequence[Ban], seed: int) -> None:
        self.plan, self.motion = dance.plan, dance.motion
        self.repertoire, self.seed = repertoire, seed
        self.bank = PieceBank(repertoire)
        self.bounds_s = slot_bounds_s(dance.plan)
        self.read_motion = take_motions(repertoire)
        self.unmet: tuple[str, ...] = ()
        self._song_path = dance.song_path
        needs_motifs = any(ban.motif is not None for ban in bans) or repertoire.has_vocabulary
        n_motifs = repertoire.vocabulary.n_motifs if needs_motifs else 0
        take_allowed, motif_banned = resolve_bans(Constraints(bans=tuple(bans)), repertoire, n_motifs)
        self.allowed = tuple(np.flatnonzero(take_allowed).tolist())
        self.banned_motifs = tuple(np.flatnonzero(motif_banned).tolist())

    @property
    def dance(self) -> Dance:
        """The dance with the edits that were made so far."""
        notes = (*off_stage(self.motion, self.plan.stage), *self.unmet)
        figures = danced_figures(self.plan, self.repertoire)
        return Dance(self.motion, self.plan, notes, self._song_path, self.unmet, figures)

    def make(self, one: EditRequest) -> None:
        """Make one edit. Raises as `edit`."""
        if isinstance(one, Ban):
            for start_s, end_s in self._banned_spans_s(one):
                self._swap(edit_slots(start_s, end_s, self.bounds_s, outwards=True), f"ban {one}")
        elif isinstance(one, Repeat):
            self._apply(repetition(one, self.plan, self.bounds_s))
        elif isinstance(one, Hold):
            self._apply(hold(one, self.plan, self.bounds_s))
        elif isinstance(one, MoveJoin):
            self._apply(moved_join(one, self.plan, self.bounds_s, self.repertoire))
        elif isinstance(one, MotifPin):
            self._pin_motif(one)
        elif isinstance(one, TakePin):
            self._pin_take(one)
        else:
            slots = edit_slots(one.start_s, one.end_s, self.bounds_s)
            self._swap(slots, str(one), similar=isinstance(one, Vary))

    def _apply(self, made: PlannedEdit) -> None:
        self.motion = self.rendered(made)
        self.plan = replace(self.plan, edits=(*self.plan.edits, made))

    def rendered(self, made: PlannedEdit) -> Motion:
        """The motion of the dance with one more edit."""
        return with_edit(self.motion, self.plan, made, self.read_motion)

    def pieces(self, slots: EditSlots, request: PieceRequest) -> tuple[EditSlots, list[Piece]]:
        """The pieces for an edit, the cheapest first, and its slots.

        If no take is long enough for the counts that lead from and to it, it has none.
        """
        around = Surroundings(self.plan, self.motion, self.bounds_s)
        found = ranked_pieces(self.bank, around, slots, request)
        if found or slots == slots.without_leads():
            return slots, found
        return slots.without_leads(), ranked_pieces(self.bank, around, slots.without_leads(), request)

    def _swap(self, slots: EditSlots, request: str, *, similar: bool = False) -> None:
        """Dance other pieces: one if a take is long enough, else several."""
        wanted = PieceRequest(self.allowed, banned=self.banned_motifs, similar=similar)
        downbeats_s = [
            s for s, n in zip(self.plan.music_beats_s, self.plan.music_beat_numbers, strict=False) if n == 1
        ]
        todo = parts_of(slots, self.bounds_s, downbeats_s)
        while todo:
            part = todo.pop(0)
            used, found = self.pieces(part, wanted)
            if not found and part.stop - part.first > 1:
                middle = (part.first + part.stop) // 2
                todo[:0] = [
                    EditSlots(part.first, middle, part.before, 0), EditSlots(middle, part.stop, 1, part.after)
                ]  # fmt: skip
                continue
            if not found:
                at_s = self.bounds_s[part.first]
                raise NoPathError(f"no piece of a take can be danced at {at_s:.1f} s: ban less")
            chosen = self._of_seed(found)
            if self.banned_motifs:
                chosen = self._first([chosen, *found], partial(self._is_without_bans, used))
            self._apply(planned_edit(chosen, request))

    def _of_seed(self, found: Sequence[Piece]) -> Piece:
        """The piece of the seed, among pieces that differ, and then among the others."""
        apart = distinct(found, self.seed + 1)
        ordered = [*apart, *(piece for piece in found if piece not in apart)]
        return ordered[self.seed % len(ordered)]

    def _first(self, found: Sequence[Piece], is_right: Callable[[Motion], bool]) -> Piece:
        """The first of a few pieces whose rendered motion is right, or the very first if none is."""
        tried = found[:_TRIES]
        return next((piece for piece in tried if is_right(self.rendered(planned_edit(piece, "")))), tried[0])

    def _is_without_bans(self, slots: EditSlots, motion: Motion) -> bool:
        motifs = danced_motifs(motion, self.bounds_s[slots.first : slots.stop + 1], self.repertoire)
        return not np.isin(motifs, self.banned_motifs).any()

    def _pin_motif(self, pin: MotifPin) -> None:
        vocabulary = self.repertoire.vocabulary
        if pin.motif >= vocabulary.n_motifs:
            raise ParameterError(f"expected motifs 0 to {vocabulary.n_motifs - 1}, got motif {pin.motif}")
        if not 0 <= pin.at_s < self.plan.duration_s:
            raise ParameterError(
                f"expected a pin within the dance, which lasts {self.plan.duration_s:g} s, got {pin}"
            )
        first = int(np.searchsorted(self.bounds_s, pin.at_s, side="right")) - 1
        span_s = float(self.bounds_s[first]), float(self.bounds_s[first + 1])
        wanted = PieceRequest(self.allowed, motif=pin.motif, banned=self.banned_motifs, pinned=True)
        slots, found = self.pieces(edit_slots(*span_s, self.bounds_s), wanted)
        if not found:
            raise NoPathError(f"no word of motif {pin.motif} can be danced at {span_s[0]:.1f} s")

        def shown(motion: Motion) -> bool:
            bounds_s = self.bounds_s[slots.first : slots.stop + 1]
            return int(danced_motifs(motion, bounds_s, self.repertoire, {0: pin.motif})[0]) == pin.motif

        self._apply(planned_edit(self._first(found, shown), f"pin {pin}"))
        if not shown(self.motion):
            self.unmet += (
                f"expected motif {pin.motif} at {span_s[0]:.1f} s, but the transitions from and to the dance "
                "around it change it",
            )

    def _pin_take(self, pin: TakePin) -> None:
        take = self.repertoire.take_index(pin.take)
        if take not in self.allowed:
            raise ParameterError(f"expected pins of takes that are not banned, got {pin}")
        asked = edit_slots(pin.start_s, pin.end_s, self.bounds_s)
        wanted = PieceRequest([take], banned=self.banned_motifs, pinned=True)
        found = self.pieces(asked, wanted)[1]
        if not found:
            length_s = self.bounds_s[asked.stop] - self.bounds_s[asked.first]
            raise NoPathError(
                f"{pin.take} cannot be danced for {length_s:.1f} s on counts, at half to twice its speed: "
                "pin it for less"
            )
        self._apply(planned_edit(self._of_seed(found), f"pin {pin}"))

    def _banned_spans_s(self, ban: Ban) -> list[tuple[float, float]]:
        """The times of the dance at which something banned is danced. Times that touch are joined."""
        spans_s: list[tuple[float, float]] = []
        if ban.motif is None:
            for block in self.plan.blocks:
                planned = block.planned
                if planned.take and excludes(ban, planned.take, planned.credits):
                    spans_s.append((block.start_s, block.end_s))
        else:
            motifs = danced_motifs(self.motion, self.bounds_s, self.repertoire)
            for slot in np.flatnonzero(motifs == ban.motif):
                start_s, end_s = self.bounds_s[slot : slot + 2].tolist()
                if self.plan.opening_s <= start_s and end_s <= self.plan.danced_until_s:
                    spans_s.append((start_s, end_s))
        joined: list[tuple[float, float]] = []
        for start_s, end_s in spans_s:
            if joined and start_s - joined[-1][1] < TOUCH_S:
                joined[-1] = joined[-1][0], end_s
            else:
                joined.append((start_s, end_s))
        return joined


# Edits that dance what is danced already at other times: repetitions, held poses and moved joins.

_NEAR_COUNTS = 1.0  # of a join, at most, from where it is asked for
_TEMPO_S = 2.0  # of a take beside a join, whose mean speed the take keeps


def repetition(one: Repeat, plan: Plan, bounds_s: Floats) -> PlannedEdit:
    """The edit that dances a part again, count by count, on slots with `bounds_s` (N + 1,).

    Raises `ParameterError` if it does not fit into the dance, or for a part whose takes are not known.
    """
    source = edit_slots(one.start_s, one.end_s, bounds_s)
    n = source.stop - source.first
    first = int(np.abs(bounds_s - one.at_s).argmin())
    if not 0 <= one.at_s < plan.duration_s or first + n >= len(bounds_s):
        raise ParameterError(
            f"expected {one} to end within the dance of {plan.duration_s:g} s, got {n} counts from "
            f"{one.at_s:g} s on"
        )
    target = edit_slots(float(bounds_s[first]), float(bounds_s[first + n]), bounds_s)
    before, after = min(source.before, target.before), min(source.after, target.after)
    begin, end = source.first - before, source.stop + after
    from_s = bounds_s[begin : end + 1]
    words = words_between(plan.planned_blocks, float(from_s[0]), float(from_s[-1]), from_s.tolist())
    to_s = bounds_s[target.first - before : target.stop + after + 1]
    return _edit([_moved(word, from_s, to_s, mirrored=one.mirrored) for word in words], one)


def hold(one: Hold, plan: Plan, bounds_s: Floats) -> PlannedEdit:
    """The edit that holds the pose at the start of a part until its end, between slots with `bounds_s`.

    The dance comes to rest in the counts before it, and sets off as it was after it. Raises as `repetition`.
    """
    slots = edit_slots(one.start_s, one.end_s, bounds_s)
    begin_s, start_s, stop_s, end_s = bounds_s[[slots.begin, slots.first, slots.stop, slots.end]].tolist()
    before = _danced(plan, begin_s, start_s, bounds_s)
    after = _danced(plan, stop_s, end_s, bounds_s)
    last = before[-1] if before else _danced(plan, start_s, stop_s, bounds_s)[0]
    pose_s = last.source_end_s if before else last.source_start_s
    held = replace(
        last, start_s=start_s, end_s=stop_s, motif=0, source_start_s=pose_s, source_end_s=pose_s, pinned=False
    )
    return _edit([*before, held, *after], one)


def joins_s(plan: Plan) -> list[float]:
    """The times at which one take gives way to another, or to another part of itself."""
    return [after.start_s for one, after in pairwise(plan.blocks) if not goes_on(one, after)]


def moved_join(one: MoveJoin, plan: Plan, bounds_s: Floats, repertoire: Repertoire) -> PlannedEdit:
    """The edit that moves a join by counts, to one of `bounds_s` (N + 1,).

    Raises `ParameterError` if there is no join within a count of its time, if the next join or the end of a
    take is too near, or for takes that are not known.
    """
    known_s = joins_s(plan)
    at_s = min(known_s, key=lambda join_s: abs(join_s - one.at_s), default=np.inf)
    count_s = float(np.median(np.diff(bounds_s)))
    if abs(at_s - one.at_s) > _NEAR_COUNTS * count_s:
        said = f"got one at {at_s:.2f} s" if known_s else "got one take without joins"
        raise ParameterError(f"expected a join of takes within a count of {one.at_s:.2f} s, {said}")
    slot = int(np.abs(bounds_s - at_s).argmin()) + one.counts
    lowest_s = max((join_s for join_s in known_s if join_s < at_s), default=0.0)
    highest_s = min((join_s for join_s in known_s if join_s > at_s), default=plan.duration_s)
    to_s = float(bounds_s[slot]) if 0 < slot < len(bounds_s) - 1 else np.inf
    if not lowest_s + TOUCH_S < to_s < highest_s - TOUCH_S:
        raise ParameterError(
            f"expected the join at {at_s:.2f} s to stay between those beside it, at {lowest_s:.2f} and "
            f"{highest_s:.2f} s, got {one.counts:+d} counts"
        )
    first_s, last_s = min(at_s, to_s), max(at_s, to_s)
    slots = edit_slots(first_s, last_s, bounds_s, outwards=True)
    begin_s, end_s = bounds_s[[slots.begin, slots.end]].tolist()
    longer = _longer(plan, at_s, to_s, bounds_s, repertoire)
    before, after = _danced(plan, begin_s, first_s, bounds_s), _danced(plan, last_s, end_s, bounds_s)
    return _edit([*before, *longer, *after], one)


def _longer(
    plan: Plan, at_s: float, to_s: float, bounds_s: Floats, repertoire: Repertoire
) -> list[PlannedWord]:
    """The take before the join at `at_s`, danced on until `to_s`, or the one after it, danced from there."""
    blocks = plan.blocks
    index = next(i for i, block in enumerate(blocks) if block.start_s == at_s)
    later = to_s > at_s
    here = blocks[index - 1] if later else blocks[index]
    speed = _speed(blocks, index - 1 if later else index, -1 if later else 1)
    take = here.planned.take
    border_s = here.source_end_s if later else here.source_start_s
    times_s = np.array([min(at_s, to_s), *_inside(bounds_s, at_s, to_s), max(at_s, to_s)])
    source_s = border_s + speed * (times_s - at_s)
    length_s = repertoire.takes[repertoire.take_index(take)].duration_s if take else 0.0
    if source_s[0] < 0 or source_s[-1] > length_s:
        known_s = (length_s - border_s if later else border_s) / speed
        raise ParameterError(
            f"expected a join that moves by at most {max(known_s, 0.0):.1f} s, since {take or 'the take'} "
            f"{'ends' if later else 'begins'} there, got {abs(to_s - at_s):.1f} s"
        )
    credits: Credits = here.planned.credits
    spans = zip(pairwise(times_s.round(6).tolist()), pairwise(source_s.round(6).tolist()), strict=True)
    return [
        PlannedWord(*span_s, 0, take, *part_s, credits, mirrored=here.mirrored) for span_s, part_s in spans
    ]


def _speed(blocks: tuple[Block, ...], index: int, step: int) -> float:
    """The mean speed of a take on one side of a join: of the block there, and of those that it continues."""
    dance_s = source_s = 0.0
    here = index
    while dance_s < _TEMPO_S:
        dance_s += blocks[here].end_s - blocks[here].start_s
        source_s += blocks[here].source_end_s - blocks[here].source_start_s
        there = here + step
        if not 0 <= there < len(blocks) or not goes_on(blocks[min(here, there)], blocks[max(here, there)]):
            break
        here = there
    return float(np.clip(source_s / dance_s, MIN_SLOPE, MAX_SLOPE))


def _inside(bounds_s: Floats, one_s: float, other_s: float) -> list[float]:
    """The counts between two times, apart from those at the times themselves."""
    low_s, high_s = min(one_s, other_s), max(one_s, other_s)
    near_s = 0.25 * float(np.median(np.diff(bounds_s)))
    found: list[float] = bounds_s[(bounds_s > low_s + near_s) & (bounds_s < high_s - near_s)].tolist()
    return found


def _danced(plan: Plan, start_s: float, end_s: float, bounds_s: Floats) -> list[PlannedWord]:
    """What is danced between two times, count by count, or nothing if they are the same."""
    if end_s - start_s < TOUCH_S:
        return []
    return list(words_between(plan.planned_blocks, start_s, end_s, bounds_s.tolist()))


def _edit(words: list[PlannedWord], one: Repeat | Hold | MoveJoin) -> PlannedEdit:
    if not all(word.take for word in words):
        raise ParameterError(f"expected {one} of takes, got a part whose takes are not known")
    return PlannedEdit(words[0].start_s, words[-1].end_s, str(one), tuple(words))


def _moved(word: PlannedWord, from_s: Floats, to_s: Floats, *, mirrored: bool) -> PlannedWord:
    """A word at other counts of the dance, (N,) instead of (N,), or its mirror image there."""
    start_s, end_s = np.interp([word.start_s, word.end_s], from_s, to_s).round(6).tolist()
    return replace(word, start_s=start_s, end_s=end_s, mirrored=word.mirrored != mirrored)


# What else could be danced in a part, what it costs, and how it differs.

_COMPARED_FPS = 20.0  # of the rendered alternatives


@dataclass(frozen=True, eq=False)
class Alternative:
    """A dance in which one part is danced otherwise, what that costs, and how it differs.

    Examples
    --------
    >>> session = cg.Session(cg.example_songs()["house"], duration_s=8)
    >>> first, second = session.alternatives((3.0, 5.0), n=2)
    >>> first
    <Alternative from 2.67 to 5.57 s, cost ...: ...>
    >>> first.dance.plan.edits[-1].words[0].take != ""
    True
    """

    dance: Dance
    """The whole dance, with this part in it."""

    start_s: float
    """When the part that differs begins, in seconds."""

    end_s: float
    """When it ends, in seconds."""

    costs: dict[str, float]
    """Its costs by name, in metres of joint distance."""

    why: str
    """How it differs, such as "same motifs, quieter, from another dancer"."""

    @property
    def cost(self) -> float:
        """The sum of its costs."""
        return sum(self.costs.values())

    def __repr__(self) -> str:
        return (
            f"<Alternative from {self.start_s:.2f} to {self.end_s:.2f} s, cost {self.cost:.2f}: {self.why}>"
        )


@default_numerics()
@one_thread()
def alternatives(
    dance: Dance, repertoire: Repertoire, span_s: tuple[float, float], n: int
) -> tuple[Alternative, ...]:
    """As `Session.alternatives`, for a dance of takes of a repertoire."""
    if not is_whole(n) or n < 1:
        raise unexpected("a number of alternatives of 1 or more", n)
    editor = Editor(dance, repertoire, (), 0)
    asked = edit_slots(*span_s, editor.bounds_s)
    slots, found = editor.pieces(asked, PieceRequest(editor.allowed))
    times_s = editor.bounds_s[[slots.first, slots.stop]]
    shown_m = [_poses_m(dance.motion, times_s)]
    made: list[Alternative] = []
    looked: list[Piece] = []
    for piece in found:
        if len(made) == n:
            break
        if any(pose_distance_m(piece.poses_m, other.poses_m) < APART_M for other in looked):
            continue
        planned = planned_edit(piece, f"swap {times_s[0]:g}-{times_s[1]:g}")
        motion = editor.rendered(planned)
        poses_m = _poses_m(motion, times_s)
        if any(pose_distance_m(poses_m, other_m) < APART_M for other_m in shown_m):
            continue
        shown_m.append(poses_m)
        looked.append(piece)
        plan = replace(dance.plan, edits=(*dance.plan.edits, planned))
        figures = danced_figures(plan, repertoire)
        other = Dance(motion, plan, off_stage(motion, plan.stage), dance.song_path, figures=figures)
        made.append(Alternative(other, planned.start_s, planned.end_s, piece.costs, piece.why))
    return tuple(made)


def _poses_m(motion: Motion, span_s: Floats) -> Floats:
    """Poses (S, 21, 3) of a part of a motion, moved rigidly to one place and heading."""
    first, stop = (span_s * motion.fps).round().astype(int)
    step = max(1, round(motion.fps / _COMPARED_FPS))
    poses_m: Floats = clips_to_root_frame(body_pos_m(motion.sliced(first, max(stop, first + 1)))[::step])
    return poses_m
