"""Edits of dances, each of which changes a part and leaves all other frames as they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
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
from choreograph.choreography.piece_bank import PieceBank, Surroundings
from choreograph.choreography.pieces import Piece, PieceRequest, distinct, ranked_pieces
from choreograph.choreography.slots import resolve_bans
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.arguments import as_list, check_function, is_whole, unexpected
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import default_numerics, one_thread
from choreograph.core.progress import ProgressReport
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.motion.motion import Motion
from choreograph.music.song import Song
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.figures import danced_figures
from choreograph.pipeline.keeping import check_same_song, kept_file_plan, part_of, read_existing
from choreograph.pipeline.rearranging import hold, moved_join, repetition
from choreograph.plan.joins import take_motions
from choreograph.plan.plan import TOUCH_S, PlannedEdit
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
