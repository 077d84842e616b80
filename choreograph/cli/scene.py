"""`choreograph scene`, which makes a dance of several dancers for a song."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.dance_options import CAMERA_MODES, default_names
from choreograph.cli.declared import (
    Command,
    Given,
    Input,
    Output,
    Seconds,
    SongTime,
    SongTimes,
    after_equals,
    argument,
    given_settings,
    inputs,
    option,
    unused_options,
    whole,
)
from choreograph.cli.present import StageLines, examples, say, show_notes, stages
from choreograph.core.errors import ParameterError
from choreograph.core.files import check_apart, file_identity, free_names
from choreograph.core.progress import counted
from choreograph.formats import output_formats
from choreograph.settings import DanceConfig, engine_names

if TYPE_CHECKING:
    from choreograph.cli.present import Stages
    from choreograph.motion.cameras import CameraMode
    from choreograph.pipeline.scenes import Scene

_PLAN = "plan"  # the mode that renders a plan
_planned = partial(option, modes=("",))


def _defaults(given: Given) -> Iterator[Path]:
    from choreograph.pipeline.scenes import scene_paths
    from choreograph.plan.scenes import MOST_DANCERS

    named = given["song"] or given["plan_path"]
    for path in default_names(named) if named else ():
        yield from scene_paths(path, min(given["dancers"], MOST_DANCERS))


def _formats_of_scenes() -> str:
    """The formats that scenes are written in, for the help."""
    one, many = (
        ", ".join(f".{format.name}" for format in output_formats().values() if format.together == together)
        for together in (True, False)
    )
    return f"{one}: one file for all dancers. {many}: a file for each dancer, NAME-1.bvh and so on."


@click.command(
    cls=Command,
    reasons={_PLAN: "decides what is danced"},
    short_help="Make a dance of several dancers for a song.",
    epilog=examples(
        "choreograph scene song.mp3                                        four dancers in unison, in a V",
        "choreograph scene song.mp3 --dancers 2 --relation mirror --open   and opens the page",
        "choreograph scene song.mp3 --dancers 8 --formation line --formation chorus=circle",
        "choreograph scene song.mp3 --relation canon:4 --relation 'bar 17=unison' -o a.bvh",
        "choreograph scene song.mp3 --relation free --genre house --genre salsa -o scene.json",
        "choreograph scene song.mp3 --dancers 3 --camera cuts -o a.mp4     shots that change at phrases",
        "choreograph scene song.mp3 --plan scene.json -o a.bvh             renders it again",
    ),
)
@argument("song", required=False, type=Input("song"))
@_planned("--dancers", type=int, default=4, show_default=True, metavar="N", help="Number of dancers.")
@_planned(
    "--formation", type=Input("list", after_equals), multiple=True, metavar="[WHEN=]line|v|circle|pairs|FILE",
    help="Where they stand (v). FILE.json: places [x, z] in metres. WHEN: chorus, verse, phrase 2, bar 9, "
    "bar 9-bar 17 or 30-45, for another formation there. Repeatable, as the next three.",
)  # fmt: skip
@_planned(
    "--relation", multiple=True, metavar="[WHEN=]unison|mirror|canon:N|call-and-response|free",
    help="What they dance (unison). canon:N: N counts after the pair before. free: each a dance of its own.",
)  # fmt: skip
@_planned("--genre", multiple=True, help="Genre to follow. With --relation free, one for each dancer.")
@option(
    "--character", multiple=True, type=Input("character"), saves="character", written="scenes",
    help="Character of each dancer in turn, in a file each.",
)  # fmt: skip
@option(
    "--camera", type=click.Choice(CAMERA_MODES), saves="camera", written="scenes",
    help="Film all from the audience, follow them, or cut on phrases.",
)  # fmt: skip
@option("--db", type=Input("repertoire"), multiple=True, metavar="FILE|DIR", help="Repertoire. Repeatable.")
@_planned("--start", type=SongTime(), help="Where in the song to begin: 75.5, bar 9 or chorus 2 (0).")
@_planned("--duration", type=Seconds(), help="Length of the dance (to the end of the song).")
@_planned(
    "--beats",
    type=Input("beats", whole),
    metavar="TRACKER|FILE",
    help="Beat tracker (network), or a file of beats.",
)
@_planned("--engine", metavar="|".join(engine_names()), help="Engine of the dances (graph).")
@_planned("--seed", type=int, help="Another seed gives another dance (0).")
@_planned("--fps", type=float, saves="fps", written="scenes", help="Frames per second of the dance (60).")
@_planned(
    "--set", "assigned", type=Input("setting", after_equals), multiple=True, metavar="NAME=VALUE",
    help="Any other setting. Repeatable.",
)  # fmt: skip
@option(
    "--plan", "plan_path", type=Input("plan"), selects=_PLAN,
    help="Render this plan of a scene. SONG is its sound, and what the rollout engine dances to again.",
)  # fmt: skip
@option(
    "-o", "--output", multiple=True, type=Output(default=_defaults), completed=_formats_of_scenes,
    help="File to write. Repeatable. Default: SONG.bvh and SONG.html here.",
)  # fmt: skip
@option("--force", is_flag=True, help="Replace files that are not dances, if -o is not given.")
@option("--open", "opened", is_flag=True, help="Open the page in the browser.")
@option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
@option("-q", "--quiet", is_flag=True, help="Print no progress, notes or summary.")
def command(
    song: Path | None,
    plan_path: Path | None,
    output: tuple[Path, ...],
    camera: CameraMode | None,
    force: bool,
    opened: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Make a dance of several dancers for SONG, on one stage.

    No two bodies come nearer than 0.6 m. The dancers come to their places at the borders of phrases.
    """
    from choreograph.pipeline.saving import options_used
    from choreograph.pipeline.scenes import scene_paths

    named = song or plan_path
    if named is None:
        raise ParameterError("expected a SONG, or --plan FILE. `choreograph songs` lists a few to begin with")
    n_dancers = _n_dancers(options["dancers"], plan_path)
    outputs, notes = _outputs(named, output, n_dancers, force=force, opened=opened)
    notes = (*notes, *_checked(outputs, n_dancers, bool(options["character"])))
    with nullcontext(StageLines()) if as_json and not quiet else stages(quiet=quiet) as shown:
        made = _made(song, plan_path, options, shown)
        for path in outputs:
            made.save(path, **options_used(path, {"camera": camera}), report=shown.report)
    characters = bool(options["character"])
    n_made = len(made.dancers)
    files = [one for path in outputs for one in scene_paths(path, n_made, characters=characters)]
    notes = (*notes, *made.notes)
    if as_json:
        click.echo(json.dumps(_facts(made, files, notes), indent=1))
    elif not quiet:
        show_notes(notes)
        written = ", ".join(str(path) for path in outputs)
        dances = counted(len(made.plan.dances), "dance")
        say(f"{written}: {counted(len(made.dancers), 'dancer')}, {dances}, {made.plan.duration_s:.1f} s")
    if opened:
        page = next(path for path in outputs if path.suffix.lower() == ".html")
        click.launch(page.resolve().as_uri())


def _n_dancers(asked: int, plan_path: Path | None) -> int:
    from choreograph.plan.scenes import MOST_DANCERS, ScenePlan

    if plan_path is not None:
        return len(ScenePlan.read(plan_path).dancers)
    if not 1 <= asked <= MOST_DANCERS:
        raise ParameterError(f"expected 1 to {MOST_DANCERS} --dancers, got {asked}")
    return asked


def _outputs(
    named: Path, given: tuple[Path, ...], n_dancers: int, *, force: bool, opened: bool
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """The files to write, and a note if those by default were renamed, because they exist already."""
    from choreograph.pipeline.saving import is_saved_dance
    from choreograph.pipeline.scenes import scene_paths

    made: tuple[Path, ...] = () if given else default_names(named)
    if opened and given and not any(path.suffix.lower() == ".html" for path in given):
        made = (given[0].with_suffix(".html"),)
    read = {file_identity(path) for path in inputs()}

    def is_kept(path: Path) -> bool:
        return any(
            file_identity(one) in read or (one.exists() and not force and not is_saved_dance(one))
            for one in scene_paths(path, n_dancers)
        )

    free = tuple(free_names(made, is_kept))
    if free == made:
        return (*given, *made), ()
    return (*given, *free), (f"files of these names are kept: the scene is written to {free[0].stem}",)


def _checked(outputs: tuple[Path, ...], n_dancers: int, has_characters: bool) -> tuple[str, ...]:
    """Notes on options that some files do not use.

    Raises before any work if a file cannot be written, is an input, or none can hold what is asked for.
    """
    from choreograph.pipeline.scenes import check_scene_outputs, scene_paths

    check_scene_outputs(outputs, n_dancers, characters=has_characters)
    written = [one for path in outputs for one in scene_paths(path, n_dancers, characters=has_characters)]
    check_apart(written, inputs())
    return unused_options(outputs, in_scenes=n_dancers > 1)


def _made(
    song: Path | None, plan_path: Path | None, options: dict[str, Any], shown: Stages | StageLines
) -> Scene:
    from choreograph.cli.characters import character_of
    from choreograph.library.repertoire import as_repertoire
    from choreograph.pipeline.scenes import render_scene_plan, scene
    from choreograph.plan.scenes import ScenePlan

    repertoire = as_repertoire(options["db"])
    characters = [character_of(path, None) for path in options["character"]]
    if plan_path is not None:
        return render_scene_plan(ScenePlan.read(plan_path), repertoire, characters=characters, song_path=song)
    assert song is not None
    genres = options["genre"]
    times = SongTimes(
        song, repertoire, genre=genres[0] if genres else None, beats=options["beats"], existing=None
    )
    named = {name: options[name] for name in ("beats", "engine", "seed", "fps")}
    return scene(
        song, repertoire, dancers=options["dancers"], formation=options["formation"],
        relation=options["relation"], genre=genres or None, characters=characters,
        start_s=times.start_s(options["start"]), duration_s=options["duration"], report=shown.report,
        **given_settings(DanceConfig, named, options["assigned"]),
    )  # fmt: skip


def _facts(made: Scene, files: list[Path], notes: tuple[str, ...]) -> dict[str, Any]:
    plan = made.plan.dances[0]
    return {
        "outputs": [str(path) for path in files],
        "song": plan.song,
        "repertoire": plan.repertoire,
        "duration_s": plan.duration_s,
        "engine": plan.engine,
        "dances": len(made.plan.dances),
        "dancers": [
            {
                "name": planned.name,
                "height": planned.height,
                "seed": made.plan.dances[planned.parts[0].dance].seed,
                "place_m": [round(planned.x_m[0], 3), round(planned.z_m[0], 3)],
            }
            for planned in made.plan.dancers
        ],
        "notes": list(notes),
    }
