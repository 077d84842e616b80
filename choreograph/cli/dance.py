"""`choreograph dance`: a song to a dance."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

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
        "choreograph dance song.mp3 --engine mixer --genre waltz",
        "choreograph dance song.mp3 --pin 12.0=motif:41 --pin 30-38=take:NAME --ban genre:tango",
        "choreograph dance song.mp3 --recreate NAME             its moves, to this song",
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
@click.option(
    "--engine", metavar="graph|mixer|rollout",
    help="What a dance is made of: seconds of takes (graph, the default), motion words of takes (mixer), or "
    "a network's motion (rollout).",
)  # fmt: skip
@click.option(
    "--genre", help="Dance as this genre of the repertoire does; by default the one nearest to the song."
)
@click.option(
    "--signature", type=click.Path(path_type=Path),
    help="Dance with this share of every motif: a file of `choreograph inspect --signature`.",
)  # fmt: skip
@click.option(
    "--motifs", "motif_file", type=click.Path(path_type=Path),
    help="Dance these motifs: JSON, a list of numbers or of {\"at_s\": …, \"motif\": …}, or a plan.",
)  # fmt: skip
@click.option(
    "--recreate",
    metavar="TAKE",
    help="Dance the motifs of this take, or motion file with its song beside it.",
)
@click.option(
    "--pin",
    multiple=True,
    metavar="SECOND=motif:N|FROM-TO=take:NAME",
    help="Dance this then; repeat for more.",
)
@click.option(
    "--ban", multiple=True, metavar="take:NAME|genre:NAME|motif:N", help="Never dance this; repeat for more."
)
@click.option(
    "--style-song",
    type=click.Path(path_type=Path),
    help="With --engine rollout: move in another song's style.",
)
@click.option("--variations", type=int, metavar="N", help="N dances that differ: NAME-1.bvh, NAME-2.bvh, …")
@click.option("--planner", metavar="exact|greedy|motion-graph", help="exact (default): the cheapest path.")
@click.option("--candidates", type=int, help="Clips warped for each second (512).")
@click.option(
    "--selection", metavar="style|random", help="Of these clips: nearest in style (default), or any."
)
@click.option("--warping", metavar="dtw|none", help="Clips onto the music's tempo (dtw), or as recorded.")
@click.option("--blending", metavar="inertial|linear", help="How seconds are joined (inertial).")
@click.option(
    "--joins",
    metavar="beats|seconds",
    help="When takes change: as beats want it (default), or on seconds.",
)
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
    song, db, output, opened, plan_path, genre, signature, motif_file, recreate, pin, ban, style_song,
    variations, weight, config, start, duration, as_json, quiet, **settings,
) -> None:  # fmt: skip
    """Make a dance for SONG (any audio file)."""
    from choreograph.config import DanceConfig, load_config
    from choreograph.pipeline import Dance, dance, render, vary
    from choreograph.pipeline.saving import check_outputs
    from choreograph.plan import Plan
    from choreograph.repertoire import Repertoire

    if song is None and plan_path is None:
        raise ParameterError("expected a SONG, or --plan FILE; `choreograph songs` lists a few to begin with")
    outputs = _outputs(output, (song or plan_path).stem, opened)
    numbered = [_numbered(outputs, number, variations) for number in range(1, (variations or 1) + 1)]
    check_outputs([path for paths in numbered for path in paths])
    settings = {name: value for name, value in settings.items() if value is not None}
    base = load_config(config) if config else DanceConfig()
    chosen = replace(base, **settings)
    given = _weights(weight)
    repertoire = _starter() if db is None else Repertoire.open(db)
    constraints = _wishes(repertoire, genre, signature, motif_file, recreate, pin, ban)
    if plan_path is not None and (variations or any(constraints.values())):
        raise ParameterError(
            "a plan says everything that is danced: expected no pins, bans or other wishes beside"
        )
    with stages(quiet=quiet or as_json) as shown:
        if plan_path is not None:
            plan = Plan.read(plan_path)
            notes = () if song else ("no SONG beside the plan: a page or video of it is silent",)
            dances = [Dance(render(plan, repertoire), plan, notes, song)]
        else:
            options = {"start_s": start, "duration_s": duration, "report": shown.report, **constraints}
            options["weights"] = given
            options["style_song"] = style_song
            engine = settings.get("engine")
            if variations is None:
                dances = [dance(song, repertoire, engine=engine, config=chosen, **options)]
            else:
                dances = vary(song, repertoire, variations, engine=engine, config=chosen, **options)
        for made, paths in zip(dances, numbered, strict=True):
            for path in paths:
                made.save(path, report=shown.report)
    if as_json:
        facts = [_facts(made, paths) for made, paths in zip(dances, numbered, strict=True)]
        click.echo(json.dumps(facts if variations else facts[0], indent=1))
    elif not quiet:
        show_notes(dict.fromkeys(note for made in dances for note in made.notes))
        for made, paths in zip(dances, numbered, strict=True):
            click.echo(_summary(made.plan, paths))
    if opened:
        page = next(path for path in numbered[0] if path.suffix.lower() == ".html")
        click.launch(page.resolve().as_uri())


def _outputs(given: tuple[Path, ...], stem: str, opened: bool) -> tuple[Path, ...]:
    outputs = given or (Path(f"{stem}.bvh"), Path(f"{stem}.html"))
    if opened and not any(path.suffix.lower() == ".html" for path in outputs):
        outputs = (*outputs, Path(f"{stem}.html"))
    return outputs


def _numbered(outputs: tuple[Path, ...], number: int, variations: int | None) -> tuple[Path, ...]:
    """The files of one variation: NAME-1.bvh for NAME.bvh; as they are if there is but one dance."""
    if variations is None:
        return outputs
    return tuple(path.with_name(f"{path.stem}-{number}{path.suffix}") for path in outputs)


def _wishes(repertoire, genre, signature, motif_file, recreate, pins, bans) -> dict[str, Any]:
    """What `dance` is asked for, from the command line's text and files."""
    from choreograph.constraints.parse import parse_ban, parse_pin, read_motifs, read_signature
    from choreograph.pipeline.recreation import motifs_of

    if motif_file is not None and recreate is not None:
        raise ParameterError("expected --motifs or --recreate, got both: each says the whole sequence")
    motifs = read_motifs(motif_file) if motif_file else motifs_of(recreate, repertoire) if recreate else ()
    return {
        "genre": genre,
        "signature": read_signature(signature) if signature else None,
        "motifs": motifs,
        "pins": tuple(parse_pin(text) for text in pins),
        "bans": tuple(parse_ban(text) for text in bans),
    }


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
    takes = {block.planned.take for block in plan.blocks}
    of = f"{len(takes)} takes" if plan.engine != "rollout" else "the rollout network"
    words = f", {len(plan.words)} motion words" if plan.words else ""
    return (
        f"{', '.join(str(path) for path in outputs)}: {plan.duration_s:.1f} s from {of}, "
        f"{len(plan.music_beats_s)} music beats{words}"
    )


def _facts(made, outputs) -> dict:
    plan = made.plan
    credits = {block.planned.take: block.planned.credits for block in plan.blocks}
    takes_s = sorted(plan.takes_s().items(), key=lambda item: -item[1])
    return {
        "outputs": [str(path) for path in outputs],
        "song": plan.song,
        "repertoire": plan.repertoire,
        "duration_s": plan.duration_s,
        "music_beats": len(plan.music_beats_s),
        "motion_beats": len(made.motion_beats_s),
        "takes": [
            {"name": name, "seconds": round(danced_s, 3), **vars(credits[name])} for name, danced_s in takes_s
        ],
        "engine": plan.engine,
        "motifs": [word.motif for word in plan.words],
        "cost": round(plan.total_cost, 4),
        "notes": list(made.notes),
    }
