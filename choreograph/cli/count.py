"""`choreograph count`, which prints the tempo, counts and loop points of an animation or song."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from choreograph.cli.declared import Command, Input, Output, argument, option, whole
from choreograph.cli.present import examples, say, stages
from choreograph.core.counts import ANNOTATED, DATA_SET, FROM_MOTION, FROM_MUSIC
from choreograph.core.progress import counted as number_of

if TYPE_CHECKING:
    from choreograph.choreography.loops import Loop
    from choreograph.core.counts import Figure
    from choreograph.pipeline.counting import CountedFile

_SOURCES = {
    ANNOTATED: "stated beside the file",
    DATA_SET: "stated by the data set",
    FROM_MUSIC: "tracked in the song",
    FROM_MOTION: "estimated from the motion",
}


@click.command(
    cls=Command,
    short_help="Count an animation or a song.",
    epilog=examples(
        "choreograph count walk.glb                    tempo, count 1 and loop points of an animation",
        "choreograph count song.mp3 -o song.txt        and its counts as labels for a sound editor",
        "choreograph count dance.bvh -o dance.counts.csv --json",
        "choreograph count walk.glb -o walk-counted.glb        with its counts in the animation",
    ),
)
@argument("file", type=Input("motion"))
@option(
    "-o", "--output", type=Output(), metavar="FILE",
    help="Write the counts: a table (.csv), JSON (.json), labels of Audacity (.txt), or the animation with "
    "its counts (.glb, .usda, .usdc).",
)  # fmt: skip
@option("--json", "as_json", is_flag=True, help="Print all facts as JSON.")
@option(
    "--beats", type=Input("beats", whole), metavar="TRACKER|FILE",
    help="Tracker of a song's beats, or a file of them. Default: network.",
)  # fmt: skip
def command(file: Path, output: Path | None, as_json: bool, beats: str | None) -> None:
    """Print the tempo, the metre, the counts and the loop points of FILE, an animation or a song.

    Counts that are stated beside an animation are used. Otherwise a network estimates them from the motion,
    with the confidence that a count is right. The figures of an animation are those that are stated with it,
    and those of a song are its phrases, where the same letter means the same music.
    """
    from choreograph.library.songs import DEFAULT_BEATS
    from choreograph.pipeline.counting import count_file, save_counts

    with stages(quiet=as_json) as shown:
        shown.report("counting", 0, 0)
        counted = count_file(file, beats=beats or DEFAULT_BEATS)
    if output is not None:
        save_counts(output, counted)
    if as_json:
        click.echo(json.dumps(counted.facts(), indent=1))
        return
    for line in _text(counted):
        say(line)
    if output is not None:
        say(f"{output}: {number_of(len(counted.counts), 'count')}")


def _text(counted: CountedFile) -> list[str]:
    counts = counted.counts
    about = f"{counted.name}: {counted.duration_s:.1f} s, a {counted.kind}"
    if counted.tempo_bpm is None:
        return [f"{about}, without a clear beat"]
    bars = f"{counts.metre} counts in a bar" if counts.has_bars else "bars are not known"
    lines = [
        f"{about} at {counted.tempo_bpm:.1f} BPM, {bars}",
        f"counts: {len(counts)}, {counts.times_s[0]:.2f} s to {counts.times_s[-1]:.2f} s, {_doubt(counted)}",
    ]
    if counts.has_bars:
        ones_s = counts.downbeat_times_s
        more = f" and {len(ones_s) - 4} more" if len(ones_s) > 4 else ""
        lines.append("count 1: " + ", ".join(f"{time_s:.2f}" for time_s in ones_s[:4]) + f" s{more}")
    lines += [_loop(loop, counted) for loop in counted.loops]
    return lines + [_figure(figure, counted) for figure in counted.figures]


def _doubt(counted: CountedFile) -> str:
    """The source of the counts and how certain they are."""
    counts = counted.counts
    source = _SOURCES.get(counts.source, "of an unknown source")
    if counts.source in (ANNOTATED, DATA_SET):
        return source
    doubt = "" if counted.is_sure else ", which is uncertain"
    return f"{source}, confidence {counts.confidence:.2f}{doubt}"


def _loop(loop: Loop, counted: CountedFile) -> str:
    length = number_of(loop.n_counts, "count")
    if counted.counts.has_bars and loop.n_counts % counted.counts.metre == 0:
        length = number_of(loop.n_counts // counted.counts.metre, "bar")
    apart = f"poses {100 * loop.distance:.1f} cm apart"
    if counted.kind == "song":
        apart = f"music {loop.distance:.2f} apart, where 1 is any other place"
    return f"loop of {length}: {loop.start_s:.2f} s to {loop.end_s:.2f} s, {apart}"


def _figure(figure: Figure, counted: CountedFile) -> str:
    what = "figure" if counted.kind == "motion" else "phrase"
    length = number_of(figure.n_counts, "count")
    return f"{what} {figure.name}: {figure.start_s:.2f} s to {figure.end_s:.2f} s, {length}"
