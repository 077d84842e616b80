"""`choreograph inspect --check`, `--lint`, `--coverage` and `--movement`: what a repertoire is good for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import click
import numpy as np

from choreograph.cli.present import say, stages
from choreograph.core.errors import ParameterError
from choreograph.core.progress import counted
from choreograph.evaluation.coverage import Coverage, coverage, coverage_table
from choreograph.evaluation.lint import KINDS, lint
from choreograph.evaluation.movement import movement, movement_table
from choreograph.evaluation.plots import expect_matplotlib, write_coverage_figure
from choreograph.evaluation.songs import SONG_SUFFIXES
from choreograph.library.repertoire import Repertoire


def show_check(repertoire: Repertoire, *, as_json: bool) -> None:
    """Read a whole repertoire and print that nothing is damaged. Raises `RepertoireError` if a block is."""
    with stages(quiet=as_json) as shown:
        repertoire.verify(partial(shown.report, "checking"))
    n_bytes = sum(path.stat().st_size for path in repertoire.paths)
    if as_json:
        click.echo(
            json.dumps({"path": str(repertoire.path), "is_intact": True, "n_bytes": n_bytes}, indent=1)
        )
        return
    takes, clips = counted(len(repertoire.takes), "take"), counted(repertoire.n_clips, "clip")
    say(f"{repertoire.path.name}: {takes}, {clips}, {n_bytes / 1e6:,.1f} MB, and every checksum is right")


def show_lint(repertoire: Repertoire, *, as_json: bool) -> None:
    """Print what is likely wrong in a repertoire, grouped by kind."""
    with stages(quiet=as_json) as shown:
        findings = lint(repertoire, report=shown.report)
    if as_json:
        click.echo(json.dumps([asdict(finding) for finding in findings], indent=1))
        return
    for kind in KINDS:
        of_kind = [finding for finding in findings if finding.kind == kind]
        if of_kind:
            say(f"{kind}: {counted(len(of_kind), 'finding')}")
        for finding in of_kind:
            say(f"  {finding}")
    if not findings:
        say(f"{repertoire.path.name}: nothing was found")


def show_movement(repertoire: Repertoire, *, as_json: bool) -> None:
    """Print how a repertoire moves, beside the ranges of real dancing."""
    cells = movement(repertoire)
    if as_json:
        click.echo(json.dumps([asdict(cell) | {"inside": cell.is_inside} for cell in cells], indent=1))
        return
    for line in movement_table(cells):
        say(line)


def show_coverage(
    repertoire: Repertoire, given: Sequence[Path], *, picture: Path | None, as_json: bool
) -> None:
    """Print what a repertoire lacks for songs, which are files or all songs of folders."""
    if picture is not None:
        expect_matplotlib()
    songs = [song for path in given for song in _songs_at(path)]
    with stages(quiet=as_json) as shown:
        found = coverage(repertoire, songs, report=shown.report)
    if picture is not None:
        write_coverage_figure(picture, found)
    if as_json:
        click.echo(json.dumps(_as_json(found), indent=1))
        return
    for line in coverage_table(found):
        say(line)
    if picture is not None:
        say(f"{picture}: tempi of songs and takes")


def _songs_at(path: Path) -> list[Path]:
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
                        "tempo_bpm": round(float(bpm), 1) if np.isfinite(bpm) else None,
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
