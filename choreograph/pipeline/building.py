"""`build`, which makes a repertoire from takes, and the training data of its networks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
from choreograph.music.synthesis.song import STYLES, render_song, write_song
from choreograph.pipeline.dancing import dance
from choreograph.plan.plan import Plan
from choreograph.render.rendering import render

if TYPE_CHECKING:
    from choreograph.nets.training import TrainingProgress
from choreograph.core.arguments import as_texts
from choreograph.core.errors import ParameterError
from choreograph.library.building import growing
from choreograph.library.building.options import ReadingSettings

# Synthesised songs. The rollout network learns from graph dances to these and to the songs of the takes.
#
# A library may have only three songs of a genre. A network that is trained on these alone does not keep the
# counts of other songs.


SONG_S = 60.0
SONGS_PER_GENRE = 8  # spread over the tempi of the genre
_SEEDS_FROM = 70_000  # beyond those of songs that anything is measured on


def synthesised_songs(
    genres: Iterable[str], folder: Path, report: ProgressReport | None = None
) -> dict[Path, str]:
    """Synthesised songs of those `genres` that the synthesiser has, written to `folder`, with their genres.

    Songs that are in the folder are not rendered again.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [
        (folder / f"{genre}-{i}.flac", genre, bpm, _SEEDS_FROM + i)
        for genre in sorted(set(genres) & set(STYLES))
        for i, bpm in enumerate(np.linspace(*STYLES[genre].bpm, SONGS_PER_GENRE))
    ]
    for index, (path, genre, bpm, seed) in enumerate(wanted):
        if not path.exists():
            write_song(path, render_song(genre, bpm=bpm, duration_s=SONG_S, seed=seed))
        if report is not None:
            report("synthesising songs for the rollout network to learn from", index + 1, len(wanted))
    return {path: genre for path, genre, _, _ in wanted}


# Graph dances that the rollout network learns from, beside the takes.
#
# The songs are those of the takes, and synthesised ones of their genres. Dancers of takes are not always on
# the count. In a graph dance, every count is on a beat and every bar begins on a downbeat.


LONGEST_S = 180.0  # of each song


def teach_rollout(
    repertoire: Repertoire,
    takes: Sequence[Take],
    folder: Path,
    *,
    beats: str,
    seed: int,
    report: ProgressReport | None = None,
) -> list[Take]:
    """Dances to the songs of `takes` and to synthesised songs of their genres, as takes with counts.

    The list is empty if the repertoire has no clips. `folder` keeps the synthesised songs and the plans.
    Raises `FormatError` if a song cannot be read.
    """
    if repertoire.n_clips == 0:
        return []
    songs = songs_of(takes)
    songs |= synthesised_songs(songs.values(), folder / "songs", report)
    return graph_dances(repertoire, songs, folder, beats=beats, seed=seed, report=report)


def songs_of(takes: Sequence[Take]) -> dict[Path, str]:
    """The songs of `takes`, and the genre of the first take to each."""
    genres: dict[Path, str] = {}
    for take in takes:
        if take.song_path is not None:
            genres.setdefault(take.song_path, take.credits.genre)
    return genres


def graph_dances(
    repertoire: Repertoire,
    songs: Mapping[Path, str],
    folder: Path,
    *,
    beats: str,
    seed: int,
    report: ProgressReport | None = None,
) -> list[Take]:
    """A dance of the graph engine to each song, of the genre given with it, as takes with counts.

    `folder` keeps the plan of every dance, so that a stopped build can be resumed. It must belong to this
    repertoire, these songs and these settings. Raises `FormatError` if a song cannot be read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    dances = []
    for index, (song, genre) in enumerate(songs.items()):
        kept = folder / f"{index}.json"
        if not kept.exists():
            made = dance(
                song,
                repertoire,
                engine="graph",
                genre=genre or None,
                beats=beats,
                seed=seed,
                duration_s=LONGEST_S,
            )
            with atomic_path(kept) as temporary:
                temporary.write_text(made.plan.to_json(), encoding="utf-8")
        dances.append(_as_take(Plan.read(kept), repertoire, song, genre, f"graph dance {index}"))
        if report is not None:
            report("dancing for the rollout network to learn from", index + 1, len(songs))
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
