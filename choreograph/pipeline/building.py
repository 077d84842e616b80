"""`build`, which makes a repertoire from takes, and the training data of its networks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np

from choreograph.core.arguments import as_list, check_function, check_kind
from choreograph.core.counts import make_counts
from choreograph.core.files import as_path, atomic_path
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.core.settings import changed
from choreograph.library.building.build import build_repertoire
from choreograph.library.building.options import BuildOptions, BuildResult, BuildSettings
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Credits, Take
from choreograph.pipeline.dancing import dance
from choreograph.plan.plan import Plan
from choreograph.render.rendering import render

if TYPE_CHECKING:
    from choreograph.nets.training import TrainingProgress
from choreograph.core.arguments import as_texts
from choreograph.core.errors import ParameterError
from choreograph.library.building import growing
from choreograph.library.building.options import ReadingSettings

# Graph dances that the rollout network learns from, beside the takes.
#
# Dancers of takes are not always on the count. In a graph dance, every count is on a beat and every bar
# begins on a downbeat. Every song of the takes is danced once. A library may have only three songs of a
# genre, so these are then danced again, with other seeds.


LONGEST_S = 180.0  # of each song
AGAIN_PER_GENRE = 8  # further dances to the songs of a genre, in turn

# A song, its genre, and the number of earlier dances to it.
DanceToTeach = tuple[Path, str, int]


def teach_rollout(
    repertoire: Repertoire,
    takes: Sequence[Take],
    folder: Path,
    *,
    beats: str,
    seed: int,
    report: ProgressReport | None = None,
) -> list[Take]:
    """Dances to the songs of `takes`, and more to those of each genre, as takes with counts.

    The list is empty if the repertoire has no clips. `folder` keeps the plans. Raises `FormatError` if a song
    cannot be read.
    """
    if repertoire.n_clips == 0:
        return []
    return graph_dances(repertoire, dances_to_teach(takes), folder, beats=beats, seed=seed, report=report)


def dances_to_teach(takes: Sequence[Take]) -> list[DanceToTeach]:
    """Each song of `takes` once, and `AGAIN_PER_GENRE` times one of each genre. A song has the genre of the
    first take to it."""
    genres: dict[Path, str] = {}
    for take in takes:
        if take.song_path is not None:
            genres.setdefault(take.song_path, take.credits.genre)
    again: list[DanceToTeach] = []
    for genre in sorted(set(genres.values())):
        songs = [song for song, of_song in genres.items() if of_song == genre]
        again += [(songs[i % len(songs)], genre, 1 + i // len(songs)) for i in range(AGAIN_PER_GENRE)]
    return [*((song, genre, 0) for song, genre in genres.items()), *again]


def graph_dances(
    repertoire: Repertoire,
    wanted: Sequence[DanceToTeach],
    folder: Path,
    *,
    beats: str,
    seed: int,
    report: ProgressReport | None = None,
) -> list[Take]:
    """The wanted dances of the graph engine, as takes with counts.

    The seed of a dance is `seed`, plus the number of earlier dances to its song. `folder` keeps the plan of
    every dance, so that a stopped build can be resumed. It must belong to this repertoire, these songs and
    these settings. Raises `FormatError` if a song cannot be read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    dances = []
    for index, (song, genre, earlier) in enumerate(wanted):
        kept = folder / f"{index}.json"
        if not kept.exists():
            made = dance(
                song,
                repertoire,
                engine="graph",
                genre=genre or None,
                beats=beats,
                seed=seed + earlier,
                duration_s=LONGEST_S,
            )
            with atomic_path(kept) as temporary:
                temporary.write_text(made.plan.to_json(), encoding="utf-8")
        dances.append(_as_take(Plan.read(kept), repertoire, song, genre, f"graph dance {index}"))
        if report is not None:
            report("dancing for the rollout network to learn from", index + 1, len(wanted))
    return dances


def _as_take(plan: Plan, repertoire: Repertoire, song: Path, genre: str, name: str) -> Take:
    """The rendered plan, counted by the beats it was danced on."""
    motion = render(plan, repertoire)
    times_s = np.array(plan.music_beats_s)
    numbers = np.array(plan.music_beat_numbers or [0] * len(times_s))
    danced = (times_s >= plan.opening_s) & (times_s <= min(plan.danced_until_s, motion.duration_s))
    counts = make_counts(times_s[danced], numbers[danced], plan.metre)
    return Take(name, motion, Credits(genre=genre), song, song_name=song.stem, counts=counts)


# `build`, with every setting as a keyword.


DEFAULTS = BuildOptions()


@default_numerics()
def build(
    sources: str | Path | Iterable[str | Path],
    output: str | Path,
    *,
    options: BuildOptions = DEFAULTS,
    report: ProgressReport | None = None,
    training_report: Callable[[TrainingProgress], None] | None = None,
    **settings: Unpack[BuildSettings],
) -> BuildResult:
    """Build a repertoire from takes and their songs, and write it to one file.

    Parameters
    ----------
    sources : a folder or file of takes, or several
    output : the file to write. Work in progress lies beside it in `OUTPUT.build/`
    options : all settings in one object
    report : called with the name of the stage, the work done so far, and all the work
    training_report : called repeatedly with a `TrainingProgress`
    **settings : single settings, which replace those of `options`: any field of `BuildOptions`, such as
        `preset`, `seed` and `leave_out`. `choreograph.pipeline.published.published_build` makes those of
        ChoreoGraph as published

    Raises
    ------
    ChoreographError  another process builds the same file, or it cannot be written
    ParameterError    no take is left, two takes share a name, an unknown choice, an argument of another type
    FormatError       a source is damaged. If several are, it is an `UnreadFilesError` that names them
    RepertoireError   a repertoire to start from cannot be read

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=12)
    >>> dance.save("take.bvh")
    >>> built = cg.build("take.bvh", "mine.h5", preset="tiny", words=False)
    >>> built
    <BuildResult mine.h5: 1 take, 5 clips, ...>
    """
    paths = as_list("sources", [sources] if isinstance(sources, str | Path) else sources, "paths", str | Path)
    check_function("report", report)
    check_function("training_report", training_report)
    check_kind("options", options, BuildOptions)
    options = changed(options, settings)
    teacher = partial(teach_rollout, beats=options.beats, seed=options.seed, report=report)
    return build_repertoire(
        paths, as_path("the output", output), options,
        teacher=teacher, report=report, training_report=training_report,
    )  # fmt: skip


# `change_takes`, which adds takes to a repertoire, replaces some or removes some.


@default_numerics()
def change_takes(
    repertoire: str | Path,
    *,
    add: str | Path | Iterable[str | Path] = (),
    replace: str | Path | Iterable[str | Path] = (),
    remove: Iterable[str] = (),
    output: str | Path | None = None,
    report: ProgressReport | None = None,
    **settings: Unpack[ReadingSettings],
) -> BuildResult:
    """Add takes to a repertoire file, replace some or remove some, without building it again.

    Only new takes are read, measured, counted and embedded. Networks and motifs are kept. The file is that of
    a build of all takes with these networks and motifs (`init_from` and `keep_networks` of `build`).

    Parameters
    ----------
    repertoire : the file, which is replaced as a whole at the end unless there is an `output`
    add : a folder or file of takes, or several. No take in the repertoire has their names
    replace : the same, of takes whose names are in the repertoire
    remove : names of takes
    output : the file to write instead
    report : called with the name of the stage, the work done so far, and all the work
    **settings : settings of `build` about the reading of sources: `leave_out`, `skip_bad`, `allow_outside`,
        `bone_map`, `workers`, `dask`, `stage` and `cache_gb`

    Returns the repertoire and what was unusual in the new takes. A note says how far they are from those that
    the networks were trained on.

    Raises
    ------
    ChoreographError  another process changes the file, or it cannot be written
    ParameterError    there is nothing to change, no take would be left, or a name does not fit
    FormatError       a source is damaged. If several are, it is an `UnreadFilesError` that names them
    RepertoireError   the repertoire cannot be read

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, stop_s=10)
    >>> cg.save_motion("walk.bvh", motion)
    >>> cg.save_motion("turn.bvh", motion)
    >>> built = cg.build("walk.bvh", "mine.h5", preset="tiny", words=False)
    >>> changed = cg.change_takes("mine.h5", add="turn.bvh", remove=["walk"])
    >>> [take.name for take in changed.repertoire.takes]
    ['turn']
    """
    changes = growing.TakeChanges(
        add=_sources("add", add),
        replace=_sources("replace", replace),
        remove=as_texts("remove", remove),
    )
    check_function("report", report)
    if unknown := sorted(set(settings) - set(ReadingSettings.__annotations__)):
        known = ", ".join(ReadingSettings.__annotations__)
        raise ParameterError(
            f"expected settings among {known}, since networks are kept, got {', '.join(unknown)}: build the "
            "repertoire again to change others"
        )
    options = changed(BuildOptions(), settings)
    target = None if output is None else as_path("the output", output)
    return growing.change_takes(as_path("a repertoire file", repertoire), changes, target, options, report)


def _sources(name: str, given: str | Path | Iterable[str | Path]) -> tuple[str | Path, ...]:
    paths = [given] if isinstance(given, str | Path) else given
    return tuple(as_list(name, paths, "paths", str | Path))
