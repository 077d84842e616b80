"""`choreograph dance`: a song to a dance."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import click

from choreograph.cli.present import examples, show_notes, stages
from choreograph.errors import ParameterError


@click.command(
    epilog=examples(
        "choreograph dance song.mp3                          song.bvh and song.html, with the built-in takes",
        "choreograph dance song.mp3 --open                   and watch it in the browser",
        "choreograph dance song.mp3 --db rep.h5 -o a.mp4     your own takes, as a video",
        "choreograph dance song.mp3 --start 30 --duration 20 --weight transition=8",
        "choreograph dance song.mp3 --plan plan.json -o a.bvh   an edited plan, rendered again",
    )
)
@click.argument("song", required=False, type=click.Path(path_type=Path))
@click.option(
    "--db", type=click.Path(path_type=Path), help="Repertoire to dance with. Default: the built-in one."
)
@click.option(
    "-o", "--output", multiple=True, type=click.Path(path_type=Path),
    help="File to write: .bvh, .npz (motion), .html (page to watch), .mp4 (video), .png (poses on the beats) "
    "or .json (the plan); repeat for more. Default: SONG.bvh and SONG.html here.",
)  # fmt: skip
@click.option("--open", "opened", is_flag=True, help="Open the page in the browser.")
@click.option(
    "--plan", "plan_path", type=click.Path(path_type=Path),
    help="Render this (edited) plan; SONG is then only heard.",
)  # fmt: skip
@click.option("--planner", metavar="exact|greedy|motion-graph", help="exact (default): the cheapest path.")
@click.option("--candidates", type=int, help="Clips warped for each second (512).")
@click.option("--blending", metavar="inertial|linear", help="How seconds are joined (inertial).")
@click.option("--weight", multiple=True, metavar="COST=NUMBER", help="Of style, completeness, transition, …")
@click.option("--config", type=click.Path(path_type=Path), help="TOML file of these settings.")
@click.option("--start", default=0.0, show_default=True, help="Second of the song to begin at.")
@click.option("--duration", type=float, help="Seconds to dance; default to the end.")
@click.option("--fps", type=float, help="Frames per second of the dance (60).")
@click.option("--beats", metavar="tempo-path|librosa|beat-this", help="Beat tracker (tempo-path).")
@click.option("--seed", type=int, help="Another seed, another dance; the same one gives the same bytes (0).")
@click.option("--json", "as_json", is_flag=True, help="Say what was made as JSON, for machines.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no notes, no summary.")
def command(
    song, db, output, opened, plan_path, weight, config, start, duration, as_json, quiet, **settings
) -> None:
    """Make a dance for SONG (any audio file)."""
    from choreograph.config import DanceConfig, load_config
    from choreograph.pipeline.dancing import Dance, dance, render
    from choreograph.pipeline.saving import check_outputs
    from choreograph.plan import Plan
    from choreograph.repertoire import Repertoire

    if song is None and plan_path is None:
        raise ParameterError("expected a SONG, or --plan FILE; `choreograph songs` lists a few to begin with")
    outputs = _outputs(output, (song or plan_path).stem, opened)
    check_outputs(outputs)
    settings = {name: value for name, value in settings.items() if value is not None}
    base = load_config(config) if config else DanceConfig()
    chosen = replace(base, **settings, weights={**base.weights, **_weights(weight)})
    repertoire = _starter() if db is None else Repertoire.open(db)
    with stages(quiet=quiet or as_json) as shown:
        if plan_path is not None:
            plan = Plan.read(plan_path)
            notes = () if song else ("no SONG beside the plan: a page or video of it is silent",)
            made = Dance(render(plan, repertoire), plan, notes, song)
        else:
            made = dance(
                song, repertoire, config=chosen, start_s=start, duration_s=duration, report=shown.report
            )
        for path in outputs:
            made.save(path, report=shown.report)
    if as_json:
        click.echo(json.dumps(_facts(made, outputs), indent=1))
    elif not quiet:
        show_notes(made.notes)
        click.echo(_summary(made.plan, outputs))
    if opened:
        page = next(path for path in outputs if path.suffix.lower() == ".html")
        click.launch(page.resolve().as_uri())


def _outputs(given: tuple[Path, ...], stem: str, opened: bool) -> tuple[Path, ...]:
    outputs = given or (Path(f"{stem}.bvh"), Path(f"{stem}.html"))
    if opened and not any(path.suffix.lower() == ".html" for path in outputs):
        outputs = (*outputs, Path(f"{stem}.html"))
    return outputs


def _starter():
    from choreograph.starter import starter_repertoire

    return starter_repertoire()


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


def _facts(made, outputs) -> dict:
    plan = made.plan
    credits = {second.take: second.credits for second in plan.seconds}
    seconds = Counter(second.take for second in plan.seconds)
    return {
        "outputs": [str(path) for path in outputs],
        "song": plan.song,
        "repertoire": plan.repertoire,
        "duration_s": plan.duration_s,
        "music_beats": len(plan.music_beats_s),
        "motion_beats": len(made.motion_beats_s),
        "takes": [
            {"name": name, "seconds": count, **vars(credits[name])} for name, count in seconds.most_common()
        ],
        "cost": round(plan.total_cost, 4),
        "notes": list(made.notes),
    }
