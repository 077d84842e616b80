"""`choreograph inspect`: what a repertoire holds."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import click

from choreograph.cli.present import examples


@click.command(
    epilog=examples(
        "choreograph inspect rep.h5",
        "choreograph inspect                     the built-in repertoire",
        "choreograph inspect rep.h5 --json",
    )
)
@click.argument("db", required=False, type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="For machines.")
def command(db, as_json) -> None:
    """Show takes, clips, skeleton and networks of the repertoire DB, by default of the built-in one."""
    from choreograph.repertoire import Repertoire
    from choreograph.starter import STARTER_PATH

    facts = _facts(Repertoire.open(db or STARTER_PATH))
    click.echo(json.dumps(facts, indent=1) if as_json else _text(facts))


def _facts(repertoire) -> dict[str, Any]:
    clips = Counter(int(take) for take in repertoire.clip_take)
    takes = [
        {
            "name": take.name, "song": take.song_name, "genre": take.credits.genre,
            "performer": take.credits.performer, "licence": take.credits.licence,
            "source": take.credits.source, "duration_s": round(take.duration_s, 3), "fps": take.fps,
            "clips": clips[index], "notes": take.notes,
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
    }


def _text(facts: dict[str, Any]) -> str:
    lines = [
        f"{facts['path']}: {len(facts['takes'])} takes, {facts['duration_s'] / 60:.1f} min, "
        f"{facts['n_clips']} clips, {len(facts['joints'])} joints",
        f"tempo-density {facts['density']}; networks: {', '.join(facts['nets']) or 'none'}; "
        f"preset {facts['provenance'].get('preset')}",
    ]
    width = max((len(take["name"]) for take in facts["takes"]), default=0)
    for take in facts["takes"]:
        owner = " · ".join(text for text in (take["performer"], take["source"], take["licence"]) if text)
        lines.append(
            f"  {take['name']:<{width}}  {take['genre'] or '-':<10} {take['duration_s']:7.1f} s  "
            f"{take['clips']:4d} clips  {owner}"
        )
    return "\n".join(lines)
