"""Takes that are added to a repertoire file, replaced in it or removed from it.

Networks and motifs are kept. Only new takes are read, measured, counted and embedded. Ranks, signatures and
transitions are computed again, since they depend on all takes. The file is that of a build of all takes with
the same networks and motifs (`BuildOptions.keep_networks`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.cache import caching
from choreograph.core.counts import FROM_MOTION
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.core.files import check_apart, check_target, folder_beside, locked_folder
from choreograph.core.numerics import AnyFloats
from choreograph.core.progress import ProgressReport
from choreograph.core.workers import working
from choreograph.formats.remote import is_address, local_sources
from choreograph.library.building.build import clip_features
from choreograph.library.building.counting import MOTION_NET, Counting, load_motion_counter
from choreograph.library.building.joining import TakeOrigin, TakeRows, joined_arrays, joined_notes
from choreograph.library.building.kept_motifs import KeptMotifs, WordTable, embedder_of
from choreograph.library.building.networks import source_checksums
from choreograph.library.building.novelty import novelty_notes
from choreograph.library.building.options import BuildOptions, BuildResult
from choreograph.library.building.takes import (
    FEWEST_WORDS,
    Imported,
    SegmentedTake,
    check_takes,
    import_sources,
    kept_notes,
    prepared_takes,
    segment_takes,
    short_notes,
    word_table,
)
from choreograph.library.builtin import pretrained_set
from choreograph.library.derived import with_derived
from choreograph.library.joined_rows import Rows
from choreograph.library.notes import Note, note_arrays, summary
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import Contents
from choreograph.library.songs import SongCache, song_notes
from choreograph.library.store import RepertoireFile
from choreograph.library.vocabulary import Vocabulary, motif_arrays
from choreograph.library.writing import MeasuredTake, write_repertoire
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
        built_with: dict[str, Any] = {
            option: stated[name]
            for option, name in (
                ("beats", "beats"),
                ("lock_feet", "feet_locked"),
                ("pretrained", "pretrained"),
            )
            if name in stated
        }
        is_compressed = "poses" not in file.parts
        try:
            options = replace(given, compress=is_compressed, **built_with)
        except ParameterError as error:
            raise RepertoireError(f"{file.path}: provenance: {error}: a damaged file") from error
        return cls(file, Repertoire(file), options)

    @property
    def names(self) -> list[str]:
        return [take.name for take in self.repertoire.takes]


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
    prepared = prepared_takes(takes, options, report, counting, target=None if on_it else skeleton)
    measured = prepared.measured
    notes = [*added.notes(), *replaced.notes(), *prepared.jumps]
    notes += [] if on_it else [Note("moved onto", take.name) for take in takes]
    notes += short_notes(measured)
    notes += prepared.count_notes
    counter: tuple[str, ...] = ()
    if any(m.take.counts.source == FROM_MOTION for m in measured):
        counter = shipped[MOTION_NET].trained_on
        notes.append(Note("counting networks", values={"networks": shipped[MOTION_NET].description}))
    segmented: list[SegmentedTake] = []
    segment_notes: list[Note] = []
    if kept.repertoire.has_vocabulary:
        segmented, segment_notes = segment_takes(measured, songs, report=report)
    notes += [*song_notes([m.take for m in measured], songs), *segment_notes]
    nets = {name: kept.file.read_net(name) for name in kept.file.net_names if name.split("_")[0] != "rollout"}
    features = clip_features(nets, kept.file.density, [])
    arrays = with_derived(
        features.arrays(measured, source_checksums(measured, (*add, *replace))), compress=options.compress
    )
    if segmented:
        arrays["motifs/word_take"] = word_table(segmented).take
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
            word_table(new.segmented) if new.segmented else WordTable.none(),
            [m.body_pos_m for m in new.measured],
        )
    notes = joined_notes(
        kept.repertoire.notes, stored, names,
        gone={*changes.remove, *(set(new.names) & set(kept.names))},
        files=[str(path) for path in np.asarray(arrays["sources/path"])],
        is_counted=rows.counts("U") > 0,
    )  # fmt: skip
    nets = {name: kept.file.read_net(name) for name in kept.file.net_names}
    provenance = _provenance(kept, names, new.trained_on)
    contents = Contents(arrays | note_arrays(notes), kept.file.density, provenance, nets)
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
    of_new = word_table(new.segmented) if new.segmented else WordTable.none()
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
