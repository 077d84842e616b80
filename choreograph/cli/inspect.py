"""`choreograph inspect`, `library`, `songs` and `settings`.

They show a repertoire and what it is good for, keep several repertoire files as one library, and show the
built-in songs and all settings.
"""

from __future__ import annotations

import inspect
import json
import math
import os
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.declared import Changed, Command, Input, Output, argument, option, whole
from choreograph.cli.present import examples, say, show, show_notes, stages
from choreograph.core.arguments import unexpected
from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, check_target, free_names, sha256_of
from choreograph.core.progress import counted

if TYPE_CHECKING:
    from choreograph.core.settings import Setting
    from choreograph.evaluation.coverage import Coverage
    from choreograph.library.catalogue import AnyFile
    from choreograph.library.repertoire import Repertoire

_N_COMMON = 5  # motifs shown of each genre
_PRINTED = ("plots", "notes", "check", "lint", "movement", "coverage")  # the modes of the command that print
_WRITTEN = {"signature": ".json", "counts": ".csv", "coverage": ".png"}  # what it writes, by its modes


@click.command(
    cls=Command,
    short_help="Show the content of a repertoire.",
    epilog=examples(
        "choreograph inspect rep.h5",
        "choreograph inspect                     the built-in repertoire",
        "choreograph inspect rep.h5 --json",
        "choreograph inspect rep.h5 --notes --take W_1       notes of the build about the take W_1",
        "choreograph inspect rep.h5 --plots plots/   signatures, transitions and motifs as PNG",
        "choreograph inspect rep.h5 --signature waltz -o mine.json   for `choreograph dance --signature`",
        "choreograph inspect rep.h5 --counts W_1 -o W_1.counts.csv      counts to place beside W_1.bvh",
        "choreograph inspect rep.h5 --check          reads the whole file and compares its checksums",
        "choreograph inspect rep.h5 --lint           duplicates, drifting feet, wrong genres and counts",
        "choreograph inspect rep.h5 --movement       knees, steps, travel and arms, beside real dancing",
        "choreograph inspect rep.h5 --coverage songs/    what it lacks for these songs",
    ),
)
@argument("db", required=False, type=Input("repertoire"))
@option("--json", "as_json", is_flag=True, modes=("", *_PRINTED), help="Print the content as JSON.")
@option(
    "--plots", type=Output(), selects="plots", metavar="FOLDER",
    help="Write plots of its genres as PNG: signatures, transitions, distances, motifs.",
)  # fmt: skip
@option("--notes", "with_notes", is_flag=True, selects="notes", help="Print all notes of the build.")
@option("--take", metavar="TAKE", modes=("notes",), help="With --notes: only notes on this take.")
@option(
    "--signature", type=Input("motion", whole), selects="signature", needs="output",
    metavar="TAKE|GENRE", help="Write the signature of this take or genre to -o.",
)  # fmt: skip
@option(
    "--counts", metavar="TAKE", selects="counts", needs="output",
    help="Write the counts and figures of this take to -o.",
)  # fmt: skip
@option(
    "--check", "with_check", is_flag=True, selects="check",
    help="Read the whole file, and print that no block is damaged, or which.",
)  # fmt: skip
@option("--lint", "with_lint", is_flag=True, selects="lint", help="Print what is likely wrong in it.")
@option(
    "--movement", "with_movement", is_flag=True, selects="movement",
    help="Print how it moves, beside the ranges of real dancing.",
)  # fmt: skip
@option(
    "--coverage", "songs", type=Input("takes"), multiple=True, selects="coverage", metavar="SONG|FOLDER",
    help="Print what it lacks for this song, or the songs in this folder. Repeatable.",
)  # fmt: skip
@option(
    "-o", "--output", type=Output(), modes=tuple(_WRITTEN),
    help="File for --signature (.json), --counts (.csv) or --coverage (.png).",
)  # fmt: skip
def command(
    db: Path | None,
    as_json: bool,
    plots: Path | None,
    with_notes: bool,
    take: str | None,
    signature: str | None,
    counts: str | None,
    with_check: bool,
    with_lint: bool,
    with_movement: bool,
    songs: tuple[Path, ...],
    output: Path | None,
) -> None:
    """Show takes, clips, networks and motifs of the repertoire DB (default: the built-in one)."""
    from choreograph.library.repertoire import as_repertoire

    if output is not None:
        _check_suffix(output, {"signature": signature, "counts": counts, "coverage": songs})
    repertoire = as_repertoire(db)
    if signature is not None and output is not None:
        from choreograph.choreography.constraints import write_signature
        from choreograph.pipeline.session import signature_of

        shares = signature_of(signature, repertoire)
        write_signature(output, shares, name=signature, repertoire=repertoire.path.name)
        say(f"{output}: signature of {signature}, {int((shares > 0).sum())} of {len(shares)} motifs")
        return
    if counts is not None and output is not None:
        from choreograph.formats.manifest import write_counts

        index = repertoire.take_index(counts)
        write_counts(output, repertoire.counts(index), repertoire.figures(index))
        say(f"{output}: {_counts_text(_counts_facts(repertoire, index))}")
        return
    if with_notes:
        _show_build_notes(repertoire, take, as_json=as_json)
        return
    if with_check or with_lint or with_movement:
        shown = show_check if with_check else show_lint if with_lint else show_movement
        shown(repertoire, as_json=as_json)
        return
    if songs:
        show_coverage(repertoire, songs, picture=output, as_json=as_json)
        return
    facts = _facts(repertoire)
    if plots is not None:
        from choreograph.view.strip import write_motif_plots

        facts["plots"] = [str(path) for path in write_motif_plots(plots, repertoire)]
    show(facts, _text(facts), as_json=as_json)


def _check_suffix(output: Path, asked: Mapping[str, object]) -> None:
    """Raise `ParameterError` if the output has another suffix than what is written, or cannot be written."""
    mode = next(name for name, value in asked.items() if value)
    if output.suffix.lower() != _WRITTEN[mode]:
        raise unexpected(f"a {_WRITTEN[mode]} for --{mode}", str(output))
    check_target(output)


def _show_build_notes(repertoire: Repertoire, take: str | None, *, as_json: bool) -> None:
    """Print the notes of the build, or those on a take."""
    if take is not None:
        repertoire.take_index(take)
    notes = [note for note in repertoire.notes if take is None or note.subject == take]
    facts = [asdict(note) | {"text": note.text} for note in notes]
    show(facts, [str(note) for note in notes] or ["no notes"], as_json=as_json)


def _facts(repertoire: Repertoire) -> dict[str, Any]:
    clips = Counter(int(take) for take in repertoire.clip_take)
    takes: list[dict[str, Any]] = [
        {
            "name": take.name, "song": take.song_name, "genre": take.credits.genre,
            "performer": take.credits.performer, "licence": take.credits.licence,
            "source": take.credits.source, "duration_s": round(take.duration_s, 3), "fps": take.fps,
            "clips": clips[index], "counts": _counts_facts(repertoire, index), "notes": take.notes,
        }
        for index, take in enumerate(repertoire.takes)
    ]  # fmt: skip
    return {
        "path": str(repertoire.path),
        "takes": takes,
        "n_clips": repertoire.n_clips,
        "duration_s": round(sum(take["duration_s"] for take in takes), 3),
        "joints": list(repertoire.skeleton.names),
        "density": repertoire.density,
        "nets": list(repertoire.net_names),
        "provenance": repertoire.provenance,
        "vocabulary": _vocabulary_facts(repertoire) if repertoire.has_vocabulary else None,
    }


def _counts_facts(repertoire: Repertoire, take: int) -> dict[str, Any]:
    counts = repertoire.counts(take)
    return {
        "n": len(counts),
        "metre": counts.metre,
        "source": counts.source,
        "confidence": round(counts.confidence, 2),
        "figures": len(repertoire.figures(take)),
    }


def _vocabulary_facts(repertoire: Repertoire) -> dict[str, Any]:
    from choreograph.core.numerics import chi_square_distance
    from choreograph.view.strip import dances_of, distances_to_template

    vocabulary = repertoire.vocabulary
    take_genres = [take.credits.genre for take in repertoire.takes]
    genres = {}
    for genre, template in zip(vocabulary.genres, vocabulary.signatures, strict=True):
        takes = dances_of(vocabulary, take_genres, genre)
        own = distances_to_template(vocabulary, genre, takes)
        common = sorted(range(len(template)), key=lambda motif: -template[motif])[:_N_COMMON]
        distances = chi_square_distance(template, vocabulary.signatures)
        genres[genre] = {
            "takes": len(takes),
            "common_motifs": {str(motif): round(float(template[motif]), 4) for motif in common},
            "takes_to_template": round(float(own.mean()), 4) if takes else None,
            "to_other_templates": {
                other: round(float(distance), 4)
                for other, distance in zip(vocabulary.genres, distances, strict=True)
                if other != genre
            },
        }
    return {"n_words": len(vocabulary.word_motif), "n_motifs": vocabulary.n_motifs, "genres": genres}


def _text(facts: dict[str, Any]) -> list[str]:
    lines = [
        f"{facts['path']}: {counted(len(facts['takes']), 'take')}, {facts['duration_s'] / 60:.1f} min, "
        f"{counted(facts['n_clips'], 'clip')}, {counted(len(facts['joints']), 'joint')}",
        f"tempo-density {facts['density']}; networks: {', '.join(facts['nets']) or 'none'}; "
        f"preset {facts['provenance'].get('preset')}",
    ]
    width = max((len(take["name"]) for take in facts["takes"]), default=0)
    for take in facts["takes"]:
        owner = " · ".join(text for text in (take["performer"], take["source"], take["licence"]) if text)
        lines.append(
            f"  {take['name']:<{width}}  {take['genre'] or '-':<10} {take['duration_s']:7.1f} s  "
            f"{take['clips']:4d} clips  {_counts_text(take['counts'])}  {owner}"
        )
    lines += _vocabulary_text(facts["vocabulary"]) if facts["vocabulary"] else ["no motion words"]
    if "plots" in facts:
        lines.append(f"{counted(len(facts['plots']), 'plot')} in {Path(facts['plots'][0]).parent}")
    return lines


def _counts_text(counts: dict[str, Any]) -> str:
    if not counts["n"]:
        return "no counts"
    metre = f" in {counts['metre']}" if counts["metre"] else ", no bars"
    figures = {0: "", 1: ", 1 figure"}.get(counts["figures"], f", {counts['figures']} figures")
    return f"{counts['n']} counts{metre} ({counts['source']} {counts['confidence']:.2f}){figures}"


def _vocabulary_text(vocabulary: dict[str, Any]) -> list[str]:
    genres = vocabulary["genres"]
    width = max(len(genre) for genre in genres)
    lines = [
        f"{vocabulary['n_words']} motion words of {vocabulary['n_motifs']} motifs. "
        "Genre, takes, their χ² distance to its template, its most common motifs:"
    ]
    for genre, about in genres.items():
        common = ", ".join(f"{motif} ({share:.1%})" for motif, share in about["common_motifs"].items())
        own = about["takes_to_template"]
        distance = "   -" if own is None else f"{own:.2f}"
        lines.append(f"  {genre:<{width}}  {about['takes']:3d}  {distance}  {common}")
    if len(genres) > 2:  # two genres and all takes together
        lines.append("χ² distance between templates:")
        lines.append("  " + " " * width + "".join(f"  {genre:>6}" for genre in genres))
        for genre, about in genres.items():
            row = [about["to_other_templates"].get(other) for other in genres]
            cells = [
                f"  {'-' if distance is None else f'{distance:.2f}':>{max(6, len(other))}}"
                for other, distance in zip(genres, row, strict=True)
            ]
            lines.append(f"  {genre:<{width}}" + "".join(cells))
    return lines


@click.command(
    cls=Command,
    epilog=examples(
        "choreograph songs                       their names and paths",
        "choreograph songs --copy .              copies all of them here",
        "choreograph dance $(choreograph songs --path house) --open",
    ),
)
@option(
    "--copy", "folder", type=Output(), modes=("",), metavar="FOLDER",
    help="Copy the songs to a folder.",
)  # fmt: skip
@option("--path", "name", selects="path", metavar="NAME", help="Print the path of this song.")
@option("--json", "as_json", is_flag=True, modes=("",), help="Print names and paths as JSON.")
def songs(folder: Path | None, name: str | None, as_json: bool) -> None:
    """List the built-in songs. The project made them, and they are free for any use."""
    from choreograph.library.builtin import example_songs

    paths = example_songs()
    if name is not None:
        if name not in paths:
            raise ParameterError(f"expected a song among {', '.join(paths)}, got {name!r}")
        click.echo(paths[name])
        return
    if folder is not None:
        paths = {song: _copied(path, folder / path.name) for song, path in paths.items()}
    width = max(map(len, paths), default=0)
    lines = (f"{song:<{width}}  {path}" for song, path in paths.items())
    show({song: str(path) for song, path in paths.items()}, lines, as_json=as_json)


def _copied(song: Path, target: Path) -> Path:
    """The copy of a song, under another name than `target` if that is another file."""

    def is_other(at: Path) -> bool:
        return os.path.lexists(at) and not (at.is_file() and sha256_of(at) == sha256_of(song))

    [path] = free_names([target], is_other)
    if path != target:
        show_notes([f"{target} is another file and is kept: the song is copied to {path}"])
    if not path.exists():
        with atomic_path(path) as temporary:
            shutil.copyfile(song, temporary)
    return path


@click.command(
    cls=Command,
    epilog=examples(
        "choreograph settings                    explains each setting, with its default",
        "choreograph settings selection          only this one",
        "choreograph settings weights            explains the costs, with their default weights",
        "choreograph settings --build            the settings of build-db",
        "choreograph settings --toml > mine.toml    for `choreograph dance --config`",
    ),
)
@argument("name", required=False)
@option("--build", is_flag=True, selects="build", help="Settings of build-db instead of those of dance.")
@option("--toml", is_flag=True, selects="toml", help="Print a settings file with all defaults, to be edited.")
def settings(name: str | None, build: bool, toml: bool) -> None:
    """Explain the settings of a dance: what each does, its unit, range and default.

    Give them as `dance --set NAME=VALUE`, as keywords in Python, or in the TOML file of `dance --config`.
    """
    from choreograph.core.settings import described, unknown_setting
    from choreograph.library.building.options import BuildOptions
    from choreograph.settings import DanceConfig

    found = {setting.name: setting for setting in described(BuildOptions if build else DanceConfig)}
    if name is not None:
        if name.replace("-", "_") not in found:
            raise unknown_setting(name, found)
        found = {name: found[name.replace("-", "_")]}
    for setting in found.values():
        if toml:
            click.echo("\n".join(_as_toml(setting)))
        else:
            click.echo(f"{setting.name}: {setting.kind}, default {setting.default!r}")
            click.echo(click.wrap_text(setting.text, 100, "    ", "    ") + "\n")
    if name == "weights" and not toml:
        _explain_costs()


def _explain_costs() -> None:
    """Print the weight of each cost, and what the docstring of its class says on it."""
    from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS, cost_kinds

    for kind in cost_kinds():
        text = inspect.getdoc(kind) or ""
        _, raise_it, where = " ".join(text.split()).partition("Raise its weight")
        explained = " ".join(filter(None, [text.partition("\n")[0], raise_it + where]))
        click.echo(f"    {kind.name} = {DEFAULT_WEIGHTS.get(kind.name, '(of another package, unused)')}")
        click.echo(click.wrap_text(explained, 100, "        ", "        "))


def _as_toml(setting: Setting) -> list[str]:
    """A setting as lines of a TOML file, a comment if its default is None."""
    text = click.wrap_text(setting.text, 100, "# ", "# ").splitlines()
    if isinstance(setting.default, Mapping):
        return [*text, f"[{setting.name}]", ""]
    value = "" if setting.default is None else json.dumps(setting.default)
    return [*text, f"{setting.name} = {value}" if value else f"# {setting.name} =", ""]


# What a repertoire is good for.


def show_check(repertoire: Repertoire, *, as_json: bool) -> None:
    """Read a whole repertoire and print that nothing is damaged. Raises `RepertoireError` if a block is."""
    with stages(quiet=as_json) as shown:
        repertoire.verify(partial(shown.report, "checking"))
    n_bytes = sum(path.stat().st_size for path in repertoire.paths)
    takes, clips = counted(len(repertoire.takes), "take"), counted(repertoire.n_clips, "clip")
    line = f"{repertoire.path.name}: {takes}, {clips}, {n_bytes / 1e6:,.1f} MB, and every checksum is right"
    facts = {"path": str(repertoire.path), "is_intact": True, "n_bytes": n_bytes}
    show(facts, [line], as_json=as_json)


def show_lint(repertoire: Repertoire, *, as_json: bool) -> None:
    """Print what is likely wrong in a repertoire, grouped by kind."""
    from choreograph.evaluation.lint import KINDS, lint

    with stages(quiet=as_json) as shown:
        findings = lint(repertoire, report=shown.report)
    lines = [] if findings else [f"{repertoire.path.name}: nothing was found"]
    for kind in KINDS:
        of_kind = [finding for finding in findings if finding.kind == kind]
        lines += [f"{kind}: {counted(len(of_kind), 'finding')}"] if of_kind else []
        lines += [f"  {finding}" for finding in of_kind]
    show([asdict(finding) for finding in findings], lines, as_json=as_json)


def show_movement(repertoire: Repertoire, *, as_json: bool) -> None:
    """Print how a repertoire moves, beside the ranges of real dancing."""
    from choreograph.evaluation.movement import movement, movement_table

    cells = movement(repertoire)
    facts = [asdict(cell) | {"inside": cell.is_inside} for cell in cells]
    show(facts, movement_table(cells), as_json=as_json)


def show_coverage(
    repertoire: Repertoire, given: Sequence[Path], *, picture: Path | None, as_json: bool
) -> None:
    """Print what a repertoire lacks for songs, which are files or all songs of folders."""
    from choreograph.evaluation.coverage import coverage, coverage_table
    from choreograph.evaluation.plots import expect_matplotlib, write_coverage_figure

    if picture is not None:
        expect_matplotlib()
    songs = [song for path in given for song in _songs_at(path)]
    with stages(quiet=as_json) as shown:
        found = coverage(repertoire, songs, report=shown.report)
    lines = list(coverage_table(found))
    if picture is not None:
        write_coverage_figure(picture, found)
        lines.append(f"{picture}: tempi of songs and takes")
    show(_as_json(found), lines, as_json=as_json)


def _songs_at(path: Path) -> list[Path]:
    from choreograph.evaluation.songs import SONG_SUFFIXES

    if not path.is_dir():
        return [path]
    songs = sorted(p for p in path.iterdir() if p.suffix.lower() in SONG_SUFFIXES and p.name[0] != ".")
    if not songs:
        raise ParameterError(f"expected songs in {path}, got a folder without audio files")
    return songs


def _as_json(found: Coverage) -> dict[str, object]:
    return {
        "songs": [
            {
                "song": song.song,
                "duration_s": round(song.duration_s, 3),
                "metre": song.metre,
                "poor_s": song.poor_s,
                "genre_probability": round(song.probability, 3),
                "seconds": [
                    {
                        "genre": genre,
                        "tempo_bpm": round(float(bpm), 1) if math.isfinite(bpm) else None,
                        "motion_s": round(float(motion_s), 1),
                        "lacks": reason,
                    }
                    for genre, bpm, motion_s, reason in zip(
                        song.genres, song.tempo_bpm, song.motion_s, song.reasons, strict=True
                    )
                ],
                "notes": list(song.notes),
            }
            for song in found.songs
        ],
        "lacks": [asdict(lack) for lack in found.lacks],
        "unused": list(found.unused),
    }


# `choreograph library`.


@click.group(
    short_help="Keep several repertoire files as one library.",
    epilog=examples(
        "choreograph library create archive/ monday.h5 tuesday.h5",
        "choreograph library add archive/ wednesday.h5",
        "choreograph library remove archive/ monday",
        "choreograph library check archive/",
        "choreograph library merge archive/ -o all.h5",
        "choreograph dance song.mp3 --db archive/",
    ),
)
def library() -> None:
    """Keep repertoire files in a folder that is one library, for the option --db of other commands.

    The files have the same networks, motifs and skeleton. `build-db --init-from FILE --keep-networks` builds
    one that has those of FILE. Takes of a file are changed by `build-db --add`, --replace and --remove.
    """


@library.command("create", cls=Command, short_help="Make a folder of repertoire files.")
@argument("directory", metavar="DIR", type=Changed("repertoire"))
@argument("files", nargs=-1, required=True, type=Input("repertoire"))
def create(directory: Path, files: tuple[Path, ...]) -> None:
    """Copy repertoire FILES to the new folder DIR, if they can be read as one library."""
    from choreograph.library.catalogue import create_library

    _show(directory, create_library(directory, files))


@library.command("add", cls=Command, short_help="Add repertoire files.")
@argument("directory", metavar="DIR", type=Changed("repertoire"))
@argument("files", nargs=-1, required=True, type=Input("repertoire"))
def add(directory: Path, files: tuple[Path, ...]) -> None:
    """Copy repertoire FILES to DIR, if they have the networks, motifs and skeleton of its files."""
    from choreograph.library.catalogue import add_files

    _show(directory, add_files(directory, files))


@library.command("remove", cls=Command, short_help="Delete files of a library.")
@argument("directory", metavar="DIR", type=Changed("repertoire"))
@argument("names", nargs=-1, required=True)
def remove(directory: Path, names: tuple[str, ...]) -> None:
    """Delete the files NAMES of the library DIR."""
    from choreograph.library.catalogue import remove_files

    _show(directory, remove_files(directory, names))


@library.command("check", cls=Command, short_help="Compare all data with its checksums.")
@argument("directory", metavar="DIR", type=Input("repertoire"))
def check(directory: Path) -> None:
    """Read all of the library DIR, and compare every block with its checksum."""
    from choreograph.library.repertoire import Repertoire

    show_check(Repertoire.open(directory), as_json=False)


@library.command("merge", cls=Command, short_help="Write all takes to one file.")
@argument("paths", metavar="DIR|FILE...", nargs=-1, required=True, type=Input("repertoire"))
@option("-o", "--output", required=True, type=Output(), help="Repertoire to write.")
def merge(paths: tuple[Path, ...], output: Path) -> None:
    """Write the takes of a library, or of several files, to one repertoire."""
    from choreograph.library.catalogue import merge_library

    _show(output, merge_library(paths, output))


def _show(path: Path, file: AnyFile) -> None:
    shapes = file.shapes
    takes, clips = counted(shapes["takes/fps"][0], "take"), counted(shapes["clips/take"][0], "clip")
    say(f"{path}: {takes}, {clips}")
