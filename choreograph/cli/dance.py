"""`choreograph dance`, which makes a dance for a song."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from choreograph.cli.characters import check_map_target, write_map
from choreograph.cli.dance_jobs import Job, check_jobs, jobs_of, present, with_free_names
from choreograph.cli.dance_options import DanceCommand, DanceOptions, FileOptions, dance_options, options_of
from choreograph.cli.dance_songs import SongDances, run_jobs, with_checked_requests
from choreograph.cli.declared import Input, argument, inputs, unused_options
from choreograph.cli.present import StageLines, examples, stages
from choreograph.core.errors import ParameterError


@click.command(
    cls=DanceCommand,
    epilog=examples(
        "choreograph dance song.mp3                          song.bvh and song.html, with the built-in takes",
        "choreograph dance song.mp3 --open                   the same, and opens the page in the browser",
        "choreograph dance song.mp3 --db rep.h5 -o a.mp4     your own takes, as a video",
        "choreograph dance song.mp3 --character hero.glb -o a.glb     your character dances",
        "choreograph dance songs/*.mp3 -o out/{song}.glb     a dance for each song, and a table",
        "choreograph dance song.mp3 --start 30 --duration 20 --weight transition=8",
        "choreograph dance song.mp3 --engine mixer --genre waltz --set planner=greedy",
        "choreograph dance song.mp3 --pin 12.0=motif:41 --pin 30-38=take:NAME --ban genre:tango",
        "choreograph dance song.mp3 --existing a.json --swap 'bar 9-bar 13'   keeps all other bars",
        "choreograph dance song.mp3 --camera cuts -o a.mp4     a film with shots that change at phrases",
        "choreograph dance song.mp3 --plan plan.json -o a.bvh     renders an edited plan",
    ),
)
@argument("songs", nargs=-1, metavar="[SONG]...", type=Input("song"))
@dance_options
def command(
    songs: tuple[Path, ...],
    db: tuple[Path, ...],
    plan_path: Path | None,
    variations: int | None,
    strict: bool,
    workers: int | None,
    dask: str | None,
    **options: Any,
) -> None:
    """Make a dance for SONG (any audio file), or for each of several."""
    if workers is not None and workers < 0:
        raise ParameterError(f"expected --workers of 0 or more, got {workers}")
    files, asked = options_of(FileOptions, options), options_of(DanceOptions, options)
    if plan_path is not None and len(songs) > 1:
        raise ParameterError(f"expected one SONG beside --plan, got {len(songs)}")
    jobs = jobs_of(songs or ((plan_path,) if plan_path else ()), files.output, files.opened, variations)
    notes, read = unused_options(jobs[0].outputs[0]), inputs()
    jobs, moved = with_free_names(jobs, files.output, read, force=files.force)
    check_map_target(files.save_map)
    check_jobs(jobs, files.save_map, read)
    first, notes = jobs[0].outputs[0], (*notes, *moved)
    sound = songs[0] if plan_path is not None and songs else None
    dances = SongDances(db, asked, files, variations, strict, plan_path, sound)
    _check_character(dances, first)
    sounds = _checked_sounds(files.target, jobs, read)
    if sounds and (plan_path is None or sound is not None):  # a plan alone has no sound
        notes = (*notes, f"the danced part of the song is written to {', '.join(map(str, sounds))}")
    dances = with_checked_requests(dances, jobs)
    with_lines = files.as_json and not files.quiet
    with nullcontext(StageLines()) if with_lines else stages(quiet=files.quiet) as shown:
        results = run_jobs(
            jobs, dances, shown, workers=1 if workers is None else workers, dask=dask or "",
            shared=_shared(read, jobs),
        )  # fmt: skip
    if any(result.dances for result in results):
        write_map(files.save_map, dances.character())
    present(results, notes, as_json=files.as_json, quiet=files.quiet, many=variations is not None)
    if files.opened:
        page = next(path for path in first if path.suffix.lower() == ".html")
        click.launch(page.resolve().as_uri())


def _shared(read: Sequence[Path], jobs: Sequence[Job]) -> list[Path]:
    """The files that are read for more than one song."""
    songs = {job.song for job in jobs}
    return [path for path in read if path not in songs]


def _checked_sounds(target: str | None, jobs: Sequence[Job], read: Sequence[Path]) -> list[Path]:
    """The sounds that the program of --for plays with outputs.

    Raises `ParameterError` if the program reads no output, or a sound would replace another file.
    """
    from choreograph.formats.targets import check_target_format, reads
    from choreograph.pipeline.saving import sound_beside

    sounds: list[Path] = []
    if target is None:
        return sounds
    for job in jobs:
        paths = [path for paths in job.outputs for path in paths]
        played = [path for path in paths if reads(target, path)]
        if not played:
            check_target_format(target, paths[0])
        sounds += [sound_beside(path, read) for path in played if target == "mmd"]
    return sounds


def _check_character(dances: SongDances, outputs: tuple[Path, ...]) -> None:
    """Raise `ParameterError` for a map alone, or for a page that cannot show the character."""
    from choreograph.pipeline.saving import check_character

    character = dances.character()
    if character is not None:
        check_character(character, outputs)
