"""`choreograph dance`: a song to a dance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from choreograph.cli.present import show_notes, stages
from choreograph.errors import ParameterError


@click.command(
    epilog="Example: choreograph dance song.mp3 --db rep.h5 -o out.bvh -o plan.json --weight transition=2"
)
@click.argument("song", required=False, type=click.Path(path_type=Path))
@click.option("--db", required=True, type=click.Path(path_type=Path), help="Repertoire to dance with.")
@click.option(
    "-o", "--output", multiple=True, type=click.Path(path_type=Path),
    help="File to write: .bvh, .npz or .json (the plan); repeat for more. Default: SONG.bvh here.",
)  # fmt: skip
@click.option(
    "--plan", "plan_path", type=click.Path(path_type=Path), help="Render this (edited) plan; no SONG."
)
@click.option("--planner", metavar="exact|greedy|motion-graph", help="exact (default): the cheapest path.")
@click.option("--candidates", type=int, help="Clips warped for each second (512).")
@click.option("--blending", metavar="inertial|linear", help="How seconds are joined (inertial).")
@click.option("--weight", multiple=True, metavar="COST=NUMBER", help="Of style, completeness, transition, …")
@click.option("--config", type=click.Path(path_type=Path), help="TOML file of these settings.")
@click.option("--start", default=0.0, show_default=True, help="Second of the song to begin at.")
@click.option("--duration", type=float, help="Seconds to dance; default to the end.")
@click.option("--fps", type=float, help="Frames per second of the dance (60).")
@click.option("--beats", metavar="tempo-path|librosa|beat-this", help="Beat tracker (tempo-path).")
@click.option(
    "--seed", type=int, help="Kept in the plan; the same seed, song and repertoire give the same bytes."
)
@click.option("-q", "--quiet", is_flag=True, help="No progress, no notes.")
def command(song, db, output, plan_path, weight, config, start, duration, quiet, **settings) -> None:
    """Make a dance for SONG (any audio file) with the takes of a repertoire."""
    from choreograph.config import DanceConfig, load_config
    from choreograph.pipeline import Dance
    from choreograph.pipeline.dancing import check_outputs, dance, render
    from choreograph.plan import Plan
    from choreograph.repertoire import Repertoire

    if (song is None) == (plan_path is None):
        raise ParameterError("expected a SONG or --plan FILE, one of the two")
    outputs = output or (Path((song or plan_path).stem + ".bvh"),)
    check_outputs(outputs)
    settings = {name: value for name, value in settings.items() if value is not None}
    base = load_config(config) if config else DanceConfig()
    chosen = replace(base, **settings, weights={**base.weights, **_weights(weight)})
    repertoire = Repertoire.open(db)
    if plan_path is not None:
        plan = Plan.read(plan_path)
        made = Dance(render(plan, repertoire), plan)
    else:
        with stages(quiet=quiet) as shown:
            made = dance(
                song, repertoire, config=chosen, start_s=start, duration_s=duration, report=shown.report
            )
    for path in outputs:
        made.save(path)
    if not quiet:
        show_notes(made.notes)
        click.echo(_summary(made.plan, outputs))


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


def _summary(plan, outputs) -> str:
    takes = {second.take for second in plan.seconds}
    return (
        f"{', '.join(str(path) for path in outputs)}: {plan.duration_s:.1f} s from {len(takes)} takes, "
        f"{len(plan.music_beats_s)} music beats"
    )
