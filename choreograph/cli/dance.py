"""`choreograph dance`: a song to a dance."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.characters import bvh_of, character_of, check_map_target, write_map
from choreograph.cli.dance_jobs import Job, check_jobs, jobs_of, present, run_jobs, with_free_names
from choreograph.cli.dance_options import dance_options
from choreograph.cli.present import (
    Command,
    StageLines,
    check_output_options,
    examples,
    given_options,
    input_files,
    stages,
)
from choreograph.core.errors import NoPathError, ParameterError

if TYPE_CHECKING:
    from choreograph.core.progress import ProgressReport

_BESIDE_A_PLAN = {
    "songs", "db", "output", "character", "map_path", "save_map", "naming", "units", "rest", "in_place",
    "force", "loop", "with_clicks", "opened", "plan_path", "existing", "as_json", "as_lines",
    "quiet",
}  # fmt: skip


@click.command(
    cls=Command,
    epilog=examples(
        "choreograph dance song.mp3                          song.bvh and song.html, with the built-in takes",
        "choreograph dance song.mp3 --open                   the same, and shows it in the browser",
        "choreograph dance song.mp3 --db rep.h5 -o a.mp4     your own takes, as a video",
        "choreograph dance song.mp3 -o a.mp4 --click         a video to count along with",
        "choreograph dance song.mp3 --character hero.glb     your character dances in the page",
        "choreograph dance song.mp3 --character hero.glb -o a.glb   and in a file",
        "choreograph dance songs/*.mp3 -o out/{song}.glb     a dance for each, and a table",
        "choreograph dance song.mp3 --start 30 --duration 20 --weight transition=8",
        "choreograph dance song.mp3 --plan plan.json -o a.bvh   renders an edited plan",
        "choreograph dance song.mp3 --engine mixer --genre waltz",
        "choreograph dance song.mp3 --pin 12.0=motif:41 --pin 30-38=take:NAME --ban genre:tango",
        "choreograph dance song.mp3 --existing a.bvh --keep 0-12 --keep 20-40   dances 12 to 20 s anew",
        "choreograph dance song.mp3 --recreate NAME          the motifs of a take, danced to this song",
    ),
)
@click.argument("songs", nargs=-1, metavar="[SONG]...", type=click.Path(path_type=Path))
@dance_options
def command(
    songs, db, output, character, map_path, save_map, naming, units, rest, in_place, loop, with_clicks,
    opened, force, as_json, as_lines, quiet, plan_path, variations, start, duration, weight, config,
    published, genre, signature, motif_file, recreate, pin, ban, keep, strict, **settings,
) -> None:  # fmt: skip
    """Make a dance for SONG (any audio file), or for each of several."""
    import choreograph as cg
    from choreograph.pipeline.saving import options_used
    from choreograph.settings import load_config, published_dance

    if plan_path is not None:
        _refuse_beside_a_plan(songs)
    jobs = jobs_of(songs or ((plan_path,) if plan_path else ()), output, opened, variations)
    notes = check_output_options(jobs[0].outputs[0])
    inputs = input_files(except_for=("output", "save_map"), with_songs=("recreate",))
    jobs, moved = with_free_names(jobs, output, inputs, force=force)
    check_map_target(save_map)
    check_jobs(jobs, save_map, inputs)
    first, notes = jobs[0].outputs[0], (*notes, *moved)
    bvh = bvh_of(naming, units, rest, in_place)
    figure = _character(character, map_path, save_map, first)
    to_save = {"character": figure, "bvh": bvh, "loop": loop, "click": with_clicks}
    base = published_dance() if published else None
    chosen = load_config(config, base) if config else base
    weights = _weights(weight)
    repertoire = cg.starter_repertoire() if db is None else cg.Repertoire.open(db)
    if plan_path is None:
        constraints = _constraints(repertoire, genre, signature, motif_file, recreate, pin, ban, keep)
        options = {
            **settings, **constraints, "config": chosen, "weights": weights or None,
            "start_s": start, "duration_s": duration,
        }  # fmt: skip

    def dances_of(job: Job, report: ProgressReport) -> list[cg.Dance]:
        if plan_path is not None:
            made = [_rendered(plan_path, songs[0] if songs else None, repertoire, settings["existing"])]
        elif variations is None:
            made = [cg.dance(job.song, repertoire, **options, report=report)]
        else:
            made = cg.vary(job.song, repertoire, variations, **options, report=report)
        unmet = [line for one in made for line in one.unmet]
        if strict and unmet:
            raise NoPathError(unmet[0])
        write_map(save_map, figure)
        for one, paths in zip(made, job.outputs, strict=True):
            for path in paths:
                one.save(path, **options_used(path, to_save), report=report)
        return made

    with nullcontext(StageLines()) if as_lines else stages(quiet=quiet or as_json) as shown:
        results = run_jobs(jobs, dances_of, shown)
    present(results, notes, as_json=as_json, quiet=quiet, looped=loop, many=variations is not None)
    if opened:
        page = next(path for path in first if path.suffix.lower() == ".html")
        click.launch(page.resolve().as_uri())


def _character(path: Path | None, map_path: Path | None, save_map: Path | None, outputs: tuple[Path, ...]):
    """The character that dances, or None; `ParameterError` for a map alone, or a page that cannot show it."""
    from choreograph.pipeline.saving import check_character

    if path is None:
        if map_path or save_map:
            raise ParameterError("expected --character FILE beside --map or --save-map")
        return None
    character = character_of(path, map_path)
    check_character(character, outputs)
    return character


def _refuse_beside_a_plan(songs: tuple[Path, ...]) -> None:
    """Raise `ParameterError` if an option or a song is given that the plan already decides."""
    if len(songs) > 1:
        raise ParameterError(f"expected one SONG beside --plan, got {len(songs)}")
    decided = given_options(except_for=_BESIDE_A_PLAN)
    if decided:
        raise ParameterError(f"--plan decides what is danced: leave out {', '.join(decided)}")


def _rendered(plan_path: Path, song: Path | None, repertoire, existing: Path | None):
    import choreograph as cg
    from choreograph.pipeline.keeping import render_file

    plan, motion = render_file(plan_path, repertoire, existing)
    notes = () if song else ("no SONG beside the plan: a page or video of it is silent",)
    return cg.Dance(motion, plan, notes, song)


def _constraints(repertoire, genre, signature, motif_file, recreate, pins, bans, keeps) -> dict[str, Any]:
    """The constraints of a dance, from the command line's text and files."""
    from choreograph.choreography.constraints import (
        parse_ban,
        parse_keep,
        parse_pin,
        read_motifs,
        read_signature,
    )
    from choreograph.pipeline.variations import motifs_of

    if motif_file is not None and recreate is not None:
        raise ParameterError("expected --motifs or --recreate, got both: each gives the whole sequence")
    motifs = read_motifs(motif_file) if motif_file else motifs_of(recreate, repertoire) if recreate else ()
    return {
        "genre": genre,
        "signature": read_signature(signature) if signature else None,
        "motifs": motifs,
        "pins": tuple(parse_pin(text) for text in pins),
        "bans": tuple(parse_ban(text) for text in bans),
        "keep": tuple(parse_keep(text) for text in keeps),
    }


def _weights(given: tuple[str, ...]) -> dict[str, float]:
    weights = {}
    for text in given:
        name, equals, number = text.partition("=")
        try:
            weights[name.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise ParameterError(f"expected --weight COST=NUMBER, got {text!r}")
    return weights
