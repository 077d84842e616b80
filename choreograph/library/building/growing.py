"""Takes that are added to a repertoire file, replaced in it or removed from it.

Networks and motifs are kept. Only new takes are read, measured, counted and embedded. Ranks, signatures and
transitions are computed again, since they depend on all takes. The file is that of a build of all takes with
the same networks and motifs (`BuildOptions.keep_networks`).

The arrays of the result are those of the file and the new ones, joined take by take (`TakeRows`). Notes say
how far new takes are from those that the networks were trained on (`novelty_notes`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.cache import caching
from choreograph.core.counts import FROM_MOTION
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.core.files import check_apart, check_target, folder_beside, locked_folder
from choreograph.core.numerics import AnyFloats, Floats, Indices, squared_distances
from choreograph.core.progress import ProgressReport
from choreograph.core.workers import working
from choreograph.formats.download import is_address, local_sources
from choreograph.library.building.build import clip_features
from choreograph.library.building.counting import Counting
from choreograph.library.building.networks import source_checksums
from choreograph.library.building.options import BuildOptions, BuildResult
from choreograph.library.building.takes import (
    Imported,
    check_takes,
    import_sources,
    kept_notes,
    prepared_takes,
    short_notes,
)
from choreograph.library.building.words import (
    FEWEST_WORDS,
    KeptMotifs,
    SegmentedTake,
    WordTable,
    embedder_of,
    segment_takes,
)
from choreograph.library.builtin import MOTION_NET, load_motion_counter, pretrained_set
from choreograph.library.derived import ALWAYS_MADE, with_derived
from choreograph.library.notes import KINDS, Note, note_arrays, summary
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import DATASETS, POSES, UNCERTAINTY, NetArrays
from choreograph.library.songs import SongCache, song_notes
from choreograph.library.store import JoinedRows, RepertoireFile, Rows
from choreograph.library.vocabulary import Vocabulary, motif_arrays
from choreograph.library.writing import Contents, MeasuredTake, write_repertoire
from choreograph.motion.motion import Take


@dataclass(frozen=True)
class TakeChanges:
    """What is changed in a repertoire."""

    add: tuple[str | Path, ...] = ()  # sources of takes with new names
    replace: tuple[str | Path, ...] = ()  # sources of takes whose names are in the repertoire
    remove: tuple[str, ...] = ()  # names of takes

    @property
    def sources(self) -> tuple[str | Path, ...]:
        """All sources."""
        return (*self.add, *self.replace)


def change_takes(
    path: Path,
    changes: TakeChanges,
    output: Path | None,
    options: BuildOptions,
    report: ProgressReport | None = None,
) -> BuildResult:
    """Add, replace and remove takes, and write the result to `output`, by default in place of `path`.

    Replaced takes keep their places, and added ones follow all others. Of `options`, only those about the
    reading of sources are used. The others are those that the file was built with.

    Raises
    ------
    ChoreographError  another process changes the file, or it cannot be written
    ParameterError    there is nothing to change, no take would be left, a name of `remove` or a take of
                      `replace` is not in the repertoire, or one of `add` is
    FormatError       a source is damaged
    RepertoireError   the repertoire cannot be read
    """
    if not changes.sources and not changes.remove:
        raise ParameterError("expected takes to add, to replace or to remove, got none")
    target = check_target(path if output is None else output)
    on_disk = [source for source in changes.sources if not is_address(source)]
    check_apart([target], [*on_disk, *([] if output is None else [path])])
    work = folder_beside(target, ".build")
    with (
        locked_folder(work, doing=f"changes {target.name}"),
        local_sources(changes.sources, work, report) as paths,
        working(options.workers, options.dask, stage=options.stage),
        caching(options.cache_gb) as results,
    ):
        if options.dask:
            paths = tuple(source.absolute() for source in paths)  # workers are elsewhere
        kept = _Kept.of(RepertoireFile(path), options)
        n_added = len(changes.add)
        new = _new_takes(kept, paths[:n_added], paths[n_added:], changes.remove, report)
        notes = _write_changed(kept, new, changes, target)
        notes += kept_notes(results, len(new.measured))
    repertoire = Repertoire.open(target)
    lines = summary(notes, len(repertoire.takes), target.name, n_stored=len(repertoire.notes))
    return BuildResult(repertoire, lines)


@dataclass(frozen=True, eq=False)
class _Kept:
    """The repertoire before the changes, and the options that it was built with."""

    file: RepertoireFile
    repertoire: Repertoire
    options: BuildOptions

    @classmethod
    def of(cls, file: RepertoireFile, given: BuildOptions) -> _Kept:
        stated = file.provenance
        options_of = {"beats": "beats", "lock_feet": "feet_locked", "pretrained": "pretrained"}
        built_with: dict[str, Any] = {
            option: stated[name] for option, name in options_of.items() if name in stated
        }
        try:
            options = replace(given, compress="poses" not in file.parts, **built_with)
        except ParameterError as error:
            raise RepertoireError(f"{file.path}: provenance: {error}: a damaged file") from error
        return cls(file, Repertoire(file), options)

    @property
    def names(self) -> list[str]:
        return [take.name for take in self.repertoire.takes]

    @cached_property
    def nets(self) -> dict[str, NetArrays]:
        return {name: self.file.read_net(name) for name in self.file.net_names}


@dataclass(frozen=True, eq=False)
class _NewTakes:
    """The takes of the sources, measured and counted, with their words and notes."""

    measured: list[MeasuredTake] = field(default_factory=list)
    arrays: Mapping[str, Rows] = field(default_factory=dict)
    segmented: list[SegmentedTake] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    trained_on: tuple[str, ...] = ()  # songs and takes that the network which counted them was trained on

    @property
    def names(self) -> list[str]:
        return [m.take.name for m in self.measured]


def _new_takes(
    kept: _Kept,
    add: Sequence[Path],
    replace: Sequence[Path],
    remove: Sequence[str],
    report: ProgressReport | None,
) -> _NewTakes:
    """Read, measure, count and embed the takes of the sources."""
    if not (add or replace):
        _check_names(kept.names, (), (), remove)
        return _NewTakes()
    options = kept.options
    added, replaced = (_imported(sources, options, report) for sources in (add, replace))
    _check_names(kept.names, added.takes, replaced.takes, remove)
    takes = [*added.takes, *replaced.takes]
    skeleton = kept.repertoire.skeleton
    on_it = all(take.motion.skeleton.same_as(skeleton) for take in takes)
    songs, shipped = SongCache(options.beats), pretrained_set(options.pretrained)
    counting = Counting(songs, load_motion_counter(shipped))
    target = None if on_it else skeleton
    measured, jumps, count_notes = prepared_takes(takes, options, report, counting, target=target)
    notes = [*added.notes(), *replaced.notes(), *jumps]
    notes += [] if on_it else [Note("moved onto", take.name) for take in takes]
    notes += [*short_notes(measured), *count_notes]
    counter: tuple[str, ...] = ()
    if any(m.take.counts.source == FROM_MOTION for m in measured):
        counter = shipped[MOTION_NET].trained_on
        notes.append(Note("counting networks", values={"networks": shipped[MOTION_NET].description}))
    segmented: list[SegmentedTake] = []
    segment_notes: list[Note] = []
    if kept.repertoire.has_vocabulary:
        segmented, segment_notes = segment_takes(measured, songs, report=report)
    notes += [*song_notes([m.take for m in measured], songs), *segment_notes]
    features = clip_features(kept.nets, kept.file.density, [])
    arrays = with_derived(
        features.arrays(measured, source_checksums(measured, (*add, *replace))), compress=options.compress
    )
    if segmented:
        arrays["motifs/word_take"] = WordTable.of(segmented).take
    return _NewTakes(measured, arrays, segmented, notes, counter)


def _imported(sources: Sequence[Path], options: BuildOptions, report: ProgressReport | None) -> Imported:
    if not sources:
        return Imported([], [], [], [])
    imported = import_sources(sources, options, report)
    check_takes(imported, options)
    return imported


def _check_names(
    known: Sequence[str], added: Sequence[Take], replaced: Sequence[Take], removed: Sequence[str]
) -> None:
    """Raise `ParameterError` unless the names of takes fit what is to be done with them."""
    if present := sorted({take.name for take in added} & set(known)):
        raise ParameterError(
            f"expected takes with new names to add, but the repertoire has {_named(present)}: replace them "
            "(--replace), or leave them out"
        )
    for what, names in (("replace", [take.name for take in replaced]), ("remove", list(removed))):
        if absent := sorted(set(names) - set(known)):
            raise ParameterError(
                f"expected takes of the repertoire to {what}, but it has no {_named(absent)}"
            )
    new = [take.name for take in (*added, *replaced)]
    if twice := sorted({name for name in new if new.count(name) > 1} | (set(new) & set(removed))):
        raise ParameterError(f"expected one change of each take, got two of {_named(twice)}")
    if set(removed) == set(known) and not added:
        raise ParameterError("expected a take that is left, got all takes to remove")


def _named(names: Sequence[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(map(repr, names[:3])) + more


def _write_changed(kept: _Kept, new: _NewTakes, changes: TakeChanges, target: Path) -> list[Note]:
    """Join what is kept with the new takes and write the file. Returns the notes on the changes."""
    order = _order(kept.names, new.names, changes.remove)
    rows = TakeRows(kept.file, new.arrays, len(new.measured), order)
    arrays = joined_arrays(rows, kept.file, new.arrays)
    told = list(new.notes)
    names = [str(name) for name in np.asarray(arrays["takes/name"])]
    stored = list(new.notes)
    if kept.repertoire.has_vocabulary and rows.counts("W").sum():
        vocabulary = _vocabulary(kept, new, rows)
        arrays |= motif_arrays(vocabulary)
        if n_lost := kept.repertoire.vocabulary.n_motifs - vocabulary.n_motifs:
            told.append(Note("lost motifs", values={"motifs": n_lost}))
    elif kept.repertoire.has_vocabulary:
        stored.append(Note("few words", values={"words": 0, "fewest": FEWEST_WORDS}))
    if new.measured:
        told += novelty_notes(
            kept.repertoire,
            [m.take.credits.genre for m in new.measured],
            np.asarray(new.arrays["clips/style"]),
            WordTable.of(new.segmented),
            [m.body_pos_m for m in new.measured],
        )
    notes = joined_notes(
        kept.repertoire.notes, stored, names,
        gone={*changes.remove, *(set(new.names) & set(kept.names))},
        files=[str(path) for path in np.asarray(arrays["sources/path"])],
        is_counted=rows.counts("U") > 0,
    )  # fmt: skip
    provenance = _provenance(kept, names, new.trained_on)
    contents = Contents(arrays | note_arrays(notes), kept.file.density, provenance, kept.nets)
    write_repertoire(target, contents, compress=kept.options.compress)
    return told


def _order(known: Sequence[str], new: Sequence[str], removed: Sequence[str]) -> list[TakeOrigin]:
    """Where each take of the result is. Replaced takes keep their places."""
    at = {name: index for index, name in enumerate(new)}
    gone = set(removed)
    order = [
        TakeOrigin(True, at[name]) if name in at else TakeOrigin(False, index)
        for index, name in enumerate(known)
        if name not in gone
    ]
    return order + [TakeOrigin(True, index) for name, index in at.items() if name not in set(known)]


def _vocabulary(kept: _Kept, new: _NewTakes, rows: TakeRows) -> Vocabulary:
    """The motifs of the file with the words of all takes."""
    repertoire, before = kept.repertoire, kept.repertoire.vocabulary
    motifs, net = KeptMotifs.of(repertoire), repertoire.word_net()
    of_new = WordTable.of(new.segmented)
    new_motif = [motifs.nearest(net.embed(take.words.body_pos_m)) for take in new.segmented]

    def joined(old: NDArray[Any], added: NDArray[Any]) -> NDArray[Any]:
        return rows.joined_arrays("W", old, added)

    infos = [new.measured[t.index].take if t.is_new else repertoire.takes[t.index] for t in rows.order]
    table = WordTable(
        np.repeat(np.arange(len(rows.order)), rows.counts("W")),
        joined(before.word_start_s, of_new.start_s),
        joined(before.word_end_s, of_new.end_s),
        [info.name for info in infos],
        [info.credits.genre for info in infos],
    )

    def body_pos_m(take: int) -> AnyFloats:
        at = rows.order[take]
        return new.measured[at.index].body_pos_m if at.is_new else repertoire.body_pos_m(at.index)

    word_motif = joined(before.word_motif, np.concatenate([np.zeros(0, np.int64), *new_motif]))
    return motifs.vocabulary(table, word_motif, embedder_of(table, body_pos_m, net.embed))


def _provenance(kept: _Kept, names: Sequence[str], counter: Sequence[str]) -> dict[str, Any]:
    """The provenance of the file, of which only the songs and takes of a network for counts change."""
    stated = {**kept.file.provenance, "motifs": kept.repertoire.motif_set}
    left_out = stated.get("left_out", [])
    known = left_out if isinstance(left_out, list) else []
    if known or kept.options.leave_out:
        stated["left_out"] = sorted({*map(str, known), *kept.options.leave_out} - set(names))
    if counter:
        stated["trained_on"] = sorted({*stated.get("trained_on", ()), *counter})
    return stated


# The takes of the result, in order, and the rows that each has in every array.


@dataclass(frozen=True)
class TakeOrigin:
    """Where a take of the result is: its index among the takes of the file, or among the new ones."""

    is_new: bool
    index: int


# By the first axis of an array with rows of takes: the column of `takes/` with their last rows, or the array
# with the take of each row, in order.
_ENDS = {"M": "takes/motion_stop", "B": "takes/body_stop", "Q": "takes/beat_stop", "U": "takes/count_stop"}
_TAKE_OF = {"N": "clips/take", "C": "sources/take", "F": "figures/take", "W": "motifs/word_take"}
_PER_TAKE = "X"


class TakeRows:
    """The rows of each take in the arrays of a file and in new arrays, and how they are joined."""

    def __init__(
        self,
        file: RepertoireFile,
        new: Mapping[str, Rows],
        n_new: int,
        order: Sequence[TakeOrigin],
    ) -> None:
        self._file, self._new, self._n_new, self.order = file, new, n_new, order
        self._n_old = file.shapes["takes/fps"][0]
        self._borders: dict[str, tuple[Indices, Indices]] = {}

    def borders(self, axis: str) -> tuple[Indices, Indices]:
        """First rows of the takes along an axis, and last the number of rows: of the file, and of the new."""
        if axis not in self._borders:
            none = np.zeros(1, np.int64)
            old = self._borders_in(axis, self._file.read, self._n_old)
            new = self._borders_in(axis, lambda name: np.asarray(self._new[name]), self._n_new)
            self._borders[axis] = old, new if self._n_new else none
        return self._borders[axis]

    def _borders_in(self, axis: str, read: Any, n_takes: int) -> Indices:
        if axis == _PER_TAKE or n_takes == 0:
            return np.arange(n_takes + 1)
        if axis in _ENDS:
            return np.append(0, read(_ENDS[axis])).astype(np.int64)
        return np.searchsorted(read(_TAKE_OF[axis]), np.arange(n_takes + 1))

    def counts(self, axis: str) -> Indices:
        """The number of rows of each take of the result."""
        old, new = (np.diff(borders) for borders in self.borders(axis))
        return np.array([(new if take.is_new else old)[take.index] for take in self.order], np.int64)

    def ranges(self, axis: str) -> list[tuple[bool, int, int]]:
        """Consecutive rows of the result: whether they are new, and the first and the one after the last."""
        found = []
        # In a run of takes that follow each other where they are, the difference is constant.
        runs = groupby(enumerate(self.order), lambda at: (at[1].is_new, at[1].index - at[0]))
        for (is_new, _), run in runs:
            takes = [take.index for _, take in run]
            borders = self.borders(axis)[is_new]
            found.append((is_new, int(borders[takes[0]]), int(borders[takes[-1] + 1])))
        return found

    def joined(self, name: str, kind: str, axis: str) -> Rows:
        """The rows of an array. Those of the file are read when they are needed, unless they are texts."""
        ranges = self.ranges(axis)
        if kind != "s":
            new = np.asarray(self._new[name]) if self._n_new else np.zeros(0)
            parts = [new[start:stop] if is_new else (start, stop) for is_new, start, stop in ranges]
            return JoinedRows(self._file, name, parts, kind)
        return self.joined_arrays(axis, self._file.read(name), self._new.get(name, np.zeros(0, np.str_)))

    def joined_arrays(self, axis: str, old: NDArray[Any], new: Rows) -> NDArray[Any]:
        """The rows of two arrays in memory, that of the takes of the file and that of the new ones."""
        both = old, np.asarray(new)
        return np.concatenate([both[is_new][start:stop] for is_new, start, stop in self.ranges(axis)])


def joined_arrays(rows: TakeRows, file: RepertoireFile, new: Mapping[str, Rows]) -> dict[str, Rows]:
    """The arrays of the result by path, without motifs, notes and those of `derived.ALWAYS_MADE`.

    `new` are those of the new takes, with what is derived from them.
    """
    layout = DATASETS | (POSES if "poses" in file.parts else {})
    made: dict[str, Rows] = {}
    for name, (kind, axes, *_) in layout.items():
        axis = axes.split()[0]
        if name in ALWAYS_MADE or name == "provenance":
            continue
        if axis in ("J", "E"):
            made[name] = file.read(name)
        elif name in _TAKE_OF.values():
            made[name] = np.repeat(np.arange(len(rows.order)), rows.counts(axis))
        elif not name.endswith(("_start", "_stop")):
            made[name] = rows.joined(name, kind, axis)
    for axis, name in _ENDS.items():
        stops = np.cumsum(rows.counts(axis))
        made |= {name: stops, name.replace("_stop", "_start"): stops - rows.counts(axis)}
    if "roles" in file.parts:
        made["skeleton/roles"] = file.read("skeleton/roles")
    if (np.asarray(made["takes/counts_source"]) == FROM_MOTION).any():
        [name] = UNCERTAINTY
        old = file.read(name) if "uncertainty" in file.parts else np.zeros(file.shapes["counts/time_s"][0])
        n_counts = len(np.asarray(new["counts/time_s"])) if new else 0
        made[name] = rows.joined_arrays("U", old, new.get(name, np.zeros(n_counts)))
    return made


# Notes in the order in which a build of all takes makes them.


_STAGES = (
    ("import",), ("skipped file", "unreadable file"), ("unknown take",), ("jumps",), ("retargeted",),
    ("moved onto",), ("short",),
    ("counts from song", "counts from motion", "uncertain counts", "refused counts", "no counts"),
    ("uncounted left out", "uncounted danced"), ("style begins", "style kept"), ("counting networks",),
    ("networks unchanged", "no music networks"), ("song",), ("longer than song", "counts beside beats"),
    ("no density networks",), ("no music beats",), ("few words",),
)  # fmt: skip
_STAGE_OF = {kind: stage for stage, kinds in enumerate(_STAGES) for kind in kinds}


def joined_notes(
    old: Iterable[Note],
    new: Iterable[Note],
    names: Sequence[str],
    *,
    gone: Collection[str],
    files: Iterable[str],
    is_counted: NDArray[np.bool_],
) -> list[Note]:
    """The notes of the file on what is left, and those on new takes.

    Parameters
    ----------
    names : the takes of the result, in order
    gone : takes of the file that were removed or replaced, whose notes are left out
    files : paths of the sources of the result. Notes on other songs are left out
    is_counted : bool array (takes,)   whether each take of the result has counts
    """
    place = {name: index for index, name in enumerate(names)}
    songs = {PurePosixPath(path).name for path in files}

    def is_valid(note: Note) -> bool:
        subject = KINDS[note.kind].subject
        if subject == "take":
            return note.subject not in gone
        if subject == "song":
            return note.subject in songs
        return PurePosixPath(note.subject).stem not in place if subject else "uncounted" not in note.kind

    kept = [*filter(is_valid, old), *(note for note in new if "uncounted" not in note.kind)]
    if not is_counted.all():
        kept.append(Note("uncounted left out" if is_counted.any() else "uncounted danced"))
    seen: list[Note] = []
    for note in kept:
        if KINDS[note.kind].subject == "take" or note not in seen:
            seen.append(note)
    return sorted(seen, key=lambda note: (_STAGE_OF.get(note.kind, 0), place.get(note.subject, 0)))


# How far new takes are from those that the networks were trained on.


_MOST = 400  # words or clips of either side that are compared, evenly spaced
_MOST_TAKES = 32  # whose words are compared, since bodies are read take by take
_SHARE = 0.95  # of what the networks were trained on, which is nearer than what counts as far


def novelty_notes(
    repertoire: Repertoire,
    genres: Sequence[str],
    style: AnyFloats,
    words: WordTable,
    bodies: Sequence[AnyFloats],
) -> list[Note]:
    """At most one note on distances, and one on new genres.

    Parameters
    ----------
    repertoire : without the new takes
    genres : of the new takes
    style : float array (N, 32)   style vectors of the new clips
    words : of the new takes, perhaps none
    bodies : float arrays (T, 21, 3)   body positions of the new takes at 20 fps

    Motion words are compared by their distance from the nearest motif. Without motifs, clips are compared by
    the distance of their style from that of the nearest clip of another take.
    """
    songs = set(repertoire.provenance.get("trained_on", ()))
    to_songs = [index for index, take in enumerate(repertoire.takes) if take.song_name in songs]
    trained = np.array(to_songs or range(len(repertoire.takes)), np.int64)  # all takes if songs are not known
    notes = []
    if repertoire.has_vocabulary and len(words.take):
        new_m, known_m = _word_distances_m(repertoire, trained, words, bodies)
        notes.append(_note("farther words", new_m, known_m))
    elif len(style) and "style" in repertoire.net_names:
        new, known = _clip_distances(repertoire, trained, style)
        notes += [_note("farther clips", new, known)] if len(known) else []
    known_genres = {repertoire.takes[take].credits.genre for take in trained.tolist()}
    unknown = sorted(set(genres) - known_genres - {""})
    if unknown and repertoire.net_names:
        notes.append(Note("new genres", values={"genres": ", ".join(unknown), "name": repertoire.path.name}))
    return notes


def _note(kind: str, new: Floats, known: Floats) -> Note:
    share = float((new > np.quantile(known, _SHARE)).mean())
    medians = {"new": float(np.median(new)), "known": float(np.median(known))}
    return Note(kind, values={"share": share, **medians})


def _some(indices: Indices, most: int = _MOST) -> Indices:
    """At most `most` of the indices, evenly spaced."""
    at = np.linspace(0, len(indices) - 1, min(most, len(indices))).round().astype(np.int64)
    some: Indices = indices[at]
    return some


def _word_distances_m(
    repertoire: Repertoire, trained: Indices, words: WordTable, bodies: Sequence[AnyFloats]
) -> tuple[Floats, Floats]:
    """Distances in metres from the nearest motif: of new words, and of words of the takes before."""
    motifs, embed = KeptMotifs.of(repertoire), repertoire.word_net().embed
    before = repertoire.vocabulary
    table = WordTable(before.word_take, before.word_start_s, before.word_end_s, (), ())
    takes = _some(np.intersect1d(before.word_take, trained), _MOST_TAKES)
    known = _some(np.flatnonzero(np.isin(before.word_take, takes)))
    of_known = embedder_of(table, repertoire.body_pos_m, embed)(known)
    of_new = embedder_of(words, bodies.__getitem__, embed)(_some(np.arange(len(words.take))))
    return motifs.distances_m(of_new), motifs.distances_m(of_known)


def _clip_distances(repertoire: Repertoire, trained: Indices, style: AnyFloats) -> tuple[Floats, Floats]:
    """Distances of style from the nearest clip of another take: of new clips, and of clips before."""
    kept, take = repertoire.clip_style, repertoire.clip_take
    known = _some(np.flatnonzero(np.isin(take, trained)))
    to_known = squared_distances(kept[known].astype(np.float64), kept.astype(np.float64))
    to_known[take[known][:, None] == take] = np.inf
    nearest = to_known.min(axis=1)
    new = np.asarray(style, np.float64)[_some(np.arange(len(style)))]
    to_new = squared_distances(new, kept.astype(np.float64)).min(axis=1)
    return np.sqrt(to_new), np.sqrt(nearest[np.isfinite(nearest)])
