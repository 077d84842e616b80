"""`choreograph scene`, which makes a dance of several dancers for a song."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.dance_options import CAMERA_MODES
from choreograph.cli.present import (
    Command,
    Seconds,
    StageLines,
    examples,
    given_options,
    given_settings,
    input_files,
    say,
    show_notes,
    stages,
)
from choreograph.cli.times import SongTime, SongTimes
from choreograph.core.errors import ParameterError
from choreograph.core.files import check_apart, file_identity, free_names
from choreograph.core.progress import counted
from choreograph.settings import DanceConfig, engine_names

if TYPE_CHECKING:
    from choreograph.cli.present import Stages
    from choreograph.motion.cameras import CameraMode
    from choreograph.pipeline.scenes import Scene

_FILE = click.Path(path_type=Path)
_WITH_PLAN = (
    "--plan",
    "--db",
    "--output",
    "--character",
    "--camera",
    "--force",
    "--open",
    "--json",
    "--quiet",
)


@click.command(
    cls=Command,
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
@click.argument("song", required=False, type=_FILE)
@click.option("--dancers", type=int, default=4, show_default=True, metavar="N", help="Number of dancers.")
@click.option(
    "--formation", multiple=True, metavar="[WHEN=]line|v|circle|pairs|FILE",
    help="Where they stand (v). FILE.json: places [x, z] in metres. WHEN: chorus, verse, phrase 2, bar 9, "
    "bar 9-bar 17 or 30-45, for another formation there. Repeatable, as the next three.",
)  # fmt: skip
@click.option(
    "--relation", multiple=True, metavar="[WHEN=]unison|mirror|canon:N|call-and-response|free",
    help="What they dance (unison). canon:N: N counts after the pair before. free: each a dance of its own.",
)  # fmt: skip
@click.option("--genre", multiple=True, help="Genre to follow. With --relation free, one for each dancer.")
@click.option(
    "--character", multiple=True, type=_FILE, help="Character of each dancer in turn, in a .glb or .fbx each."
)
@click.option(
    "--camera", type=click.Choice(CAMERA_MODES),
    help="Film all from the audience, follow them, or cut on phrases (.html, .mp4, .glb, .usda).",
)  # fmt: skip
@click.option("--db", type=_FILE, multiple=True, metavar="FILE|DIR", help="Repertoire. Repeatable.")
@click.option("--start", type=SongTime(), help="Where in the song to begin: 75.5, bar 9 or chorus 2 (0).")
@click.option("--duration", type=Seconds(), help="Length of the dance (to the end of the song).")
@click.option("--beats", metavar="TRACKER|FILE", help="Beat tracker (network), or a file of beats.")
@click.option("--engine", metavar="|".join(engine_names()), help="Engine of the dances (graph).")
@click.option("--seed", type=int, help="Another seed gives another dance (0).")
@click.option("--fps", type=float, help="Frames per second of the dance (60).")
@click.option("--set", "assigned", multiple=True, metavar="NAME=VALUE", help="Any other setting. Repeatable.")
@click.option(
    "--plan",
    "plan_path",
    type=_FILE,
    help="Render this plan of a scene. SONG is its sound, and what the rollout engine dances to again.",
)
@click.option(
    "-o", "--output", multiple=True, type=_FILE,
    help="File to write. Repeatable. .html, .glb, .fbx, .usda, .usdc, .mp4, .png: all dancers in one. "
    ".json: the plan. .bvh and other formats: a file for each dancer, NAME-1.bvh. Default: SONG.bvh and "
    "SONG.html here.",
)  # fmt: skip
@click.option("--force", is_flag=True, help="Replace files that are not dances, if -o is not given.")
@click.option("--open", "opened", is_flag=True, help="Open the page in the browser.")
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print no progress, notes or summary.")
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
    from choreograph.pipeline.scene_saving import scene_paths

    named = song or plan_path
    if named is None:
        raise ParameterError("expected a SONG, or --plan FILE. `choreograph songs` lists a few to begin with")
    if plan_path is not None:
        _check_beside_plan()
    check_apart(output, input_files(except_for=("output",)))  # before the plan is read
    n_dancers = _n_dancers(options["dancers"], plan_path)
    outputs, notes = _outputs(named, output, n_dancers, force=force, opened=opened)
    _check(outputs, n_dancers, bool(options["character"]), camera)
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


def _check_beside_plan() -> None:
    """Raise `ParameterError` for an option that the plan of a scene decides."""
    decided = [name for name in given_options() if name not in _WITH_PLAN]
    if decided:
        raise ParameterError(f"--plan decides what is danced: leave out {', '.join(decided)}")


def _n_dancers(asked: int, plan_path: Path | None) -> int:
    from choreograph.scene_plan import MOST_DANCERS, ScenePlan

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
    from choreograph.pipeline.scene_saving import scene_paths

    made: tuple[Path, ...] = () if given else (Path(f"{named.stem}.bvh"), Path(f"{named.stem}.html"))
    if opened and given and not any(path.suffix.lower() == ".html" for path in given):
        made = (given[0].with_suffix(".html"),)
    read = {file_identity(path) for path in input_files(except_for=("output",))}

    def is_kept(path: Path) -> bool:
        return any(
            file_identity(one) in read or (one.exists() and not force and not is_saved_dance(one))
            for one in scene_paths(path, n_dancers)
        )

    free = tuple(free_names(made, is_kept))
    if free == made:
        return (*given, *made), ()
    return (*given, *free), (f"files of these names are kept: the scene is written to {free[0].stem}",)


def _check(
    outputs: tuple[Path, ...], n_dancers: int, has_characters: bool, camera: CameraMode | None
) -> None:
    """Raise before any work if a file cannot be written, is an input, or none can hold what is asked for."""
    from choreograph.pipeline.saving import format_of, used_by
    from choreograph.pipeline.scene_saving import check_scene_outputs, scene_paths

    check_scene_outputs(outputs, n_dancers, characters=has_characters)
    written = [one for path in outputs for one in scene_paths(path, n_dancers, characters=has_characters)]
    bases = [path for path in outputs if path not in written]
    check_apart([*written, *bases], input_files(except_for=("output",)))
    held = [path for path in outputs if format_of(path) in ("glb", "fbx")]
    if has_characters and not held:
        raise ParameterError(f"expected .glb or .fbx for --character, got {outputs[0]}: add -o NAME.glb")
    if camera is not None and not any(format_of(path) in used_by("camera") for path in outputs):
        raise ParameterError(f"expected .html, .mp4, .glb or .usda for --camera, got {outputs[0]}")


def _made(
    song: Path | None, plan_path: Path | None, options: dict[str, Any], shown: Stages | StageLines
) -> Scene:
    from choreograph.cli.characters import character_of
    from choreograph.library.builtin import as_repertoire
    from choreograph.pipeline.scenes import render_scene_plan, scene
    from choreograph.scene_plan import ScenePlan

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
