"""`choreograph dance`, which makes a dance for a song."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.characters import bvh_of, character_of, check_map_target, write_map
from choreograph.cli.dance_jobs import Job, check_jobs, jobs_of, present, run_jobs, with_free_names
from choreograph.cli.dance_options import (
    DanceOptions,
    FileOptions,
    check_options_with_plan,
    dance_options,
    options_of,
)
from choreograph.cli.present import (
    Command,
    StageLines,
    check_output_options,
    examples,
    input_files,
    stages,
)
from choreograph.core.errors import NoPathError, ParameterError

if TYPE_CHECKING:
    from choreograph.characters.gltf_character import GltfCharacter
    from choreograph.core.progress import ProgressReport
    from choreograph.library.repertoire import Repertoire
    from choreograph.pipeline.dancing import Dance, DanceArguments

Maker = Callable[[Job, "ProgressReport"], "list[Dance]"]


@click.command(
    cls=Command,
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
        "choreograph dance song.mp3 --plan plan.json -o a.bvh     renders an edited plan",
    ),
)
@click.argument("songs", nargs=-1, metavar="[SONG]...", type=click.Path(path_type=Path))
@dance_options
def command(
    songs: tuple[Path, ...],
    db: tuple[Path, ...],
    plan_path: Path | None,
    variations: int | None,
    strict: bool,
    **options: Any,
) -> None:
    """Make a dance for SONG (any audio file), or for each of several."""
    from choreograph.library.builtin import as_repertoire
    from choreograph.pipeline.saving import options_used

    files, asked = options_of(FileOptions, options), options_of(DanceOptions, options)
    if plan_path is not None:
        check_options_with_plan(songs)
    jobs = jobs_of(songs or ((plan_path,) if plan_path else ()), files.output, files.opened, variations)
    notes = check_output_options(jobs[0].outputs[0])
    inputs = input_files(except_for=("output", "save_map"), with_songs=("motifs",))
    jobs, moved = with_free_names(jobs, files.output, inputs, force=files.force)
    check_map_target(files.save_map)
    check_jobs(jobs, files.save_map, inputs)
    first, notes = jobs[0].outputs[0], (*notes, *moved)
    bvh = bvh_of(files.naming, files.units, files.rest, files.in_place)
    figure = _character(files, first)
    to_save = {"character": figure, "bvh": bvh, "loop": files.loop, "click": files.with_clicks}
    repertoire = as_repertoire(db)
    if plan_path is not None:
        make = _renderer(plan_path, songs, repertoire, asked.existing)
    else:
        make = _maker(asked, repertoire, variations, jobs)

    def dances_of(job: Job, report: ProgressReport) -> list[Dance]:
        made = make(job, report)
        unmet = [line for one in made for line in one.unmet]
        if strict and unmet:
            raise NoPathError(unmet[0])
        write_map(files.save_map, figure)
        for one, paths in zip(made, job.outputs, strict=True):
            for path in paths:
                one.save(path, **options_used(path, to_save), report=report)
        return made

    with_lines = files.as_json and not files.quiet
    with nullcontext(StageLines()) if with_lines else stages(quiet=files.quiet) as shown:
        results = run_jobs(jobs, dances_of, shown)
    present(
        results, notes, as_json=files.as_json, quiet=files.quiet, looped=files.loop,
        many=variations is not None,
    )  # fmt: skip
    if files.opened:
        page = next(path for path in first if path.suffix.lower() == ".html")
        click.launch(page.resolve().as_uri())


def _maker(asked: DanceOptions, repertoire: Repertoire, variations: int | None, jobs: Sequence[Job]) -> Maker:
    """Make the dance of a job, or several variations of it, or edit an existing dance."""
    import choreograph as cg

    existing = asked.existing
    if asked.edits_dance and existing is not None:
        if len(jobs) > 1:
            raise ParameterError(f"expected one SONG for the edits of a dance, got {len(jobs)}")
        edits = asked.edits(asked.times(jobs[0].song, repertoire))
        seed = asked.seed or 0
        return lambda job, report: [
            cg.edit(existing, edits, repertoire, song=job.song, seed=seed, report=report)
        ]
    first = asked.arguments(repertoire, asked.times(jobs[0].song, repertoire))  # reports errors early

    def make(job: Job, report: ProgressReport) -> list[Dance]:
        own = first if job is jobs[0] else asked.arguments(repertoire, asked.times(job.song, repertoire))
        given: DanceArguments = {**own, "report": report}
        if variations is None:
            return [cg.dance(job.song, repertoire, **given)]
        return cg.vary(job.song, repertoire, variations, **given)

    return make


def _renderer(
    plan_path: Path, songs: tuple[Path, ...], repertoire: Repertoire, existing: Path | None
) -> Maker:
    """Render the plan, with the sound of a song if there is one."""
    import choreograph as cg
    from choreograph.pipeline.keeping import render_file

    def make(job: Job, report: ProgressReport) -> list[Dance]:
        plan, motion = render_file(plan_path, repertoire, existing)
        if songs:
            return [cg.Dance(motion, plan, (), songs[0])]
        return [cg.Dance(motion, plan, ("no SONG was given with the plan: pages and videos are silent",))]

    return make


def _character(files: FileOptions, outputs: tuple[Path, ...]) -> GltfCharacter | None:
    """The character that dances, if any. Raises `ParameterError` for a map alone or an unfit page."""
    from choreograph.pipeline.saving import check_character

    if files.character is None:
        if files.map_path or files.save_map:
            raise ParameterError("expected --character FILE beside --map or --save-map")
        return None
    character = character_of(files.character, files.map_path)
    check_character(character, outputs)
    return character
