"""Does a dance change where its music does? Songs spliced from two genres, 18 s of each.

    python research/spliced_songs.py [--repertoire REP] [--seeds 5] [--engines graph mixer]

The songs are rendered here. None of them, nor their seeds, is a song of the built-in takes. Columns are the
share of seconds danced by takes of the genre of each half, averaged over both halves, and the same by chance
(the same seconds in any order, 0.5 for a dance of one genre throughout) and by takes drawn from the
repertoire. Then come the share of the second half alone, how often the dance switched and after how many
seconds, the counts against the true beats, and count 1 against the true downbeats.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import soundfile

import choreograph as cg
from choreograph.evaluation.metrics import counts
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.plan.plan import Plan
from content.songs.known_songs import SPLICED_SONGS, SplicedSong
from content.songs.synthesis.sounds import RATE_HZ
from research import style_response

Row = dict[str, float]


def genre_by_second(plan: Plan, repertoire: cg.Repertoire) -> list[str]:
    """Genre of the take danced in the middle of every whole second. The strings are empty without takes."""
    genres = {take.name: take.credits.genre for take in repertoire.takes}
    middles_s = np.arange(int(plan.duration_s)) + 0.5
    blocks = plan.blocks
    starts_s = [block.start_s for block in blocks]
    danced = np.clip(np.searchsorted(starts_s, middles_s, side="right") - 1, 0, None)
    return [genres.get(blocks[index].planned.take, "") for index in danced]


def measured(spliced: SplicedSong, repertoire: cg.Repertoire, config: cg.DanceConfig) -> Row:
    """Scores of one dance to one spliced song."""
    audio = spliced.render()
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{spliced.name}.wav"
        soundfile.write(path, audio.samples, RATE_HZ)
        plan = cg.dance(path, repertoire, config=config).plan
    wanted = audio.wanted
    danced = genre_by_second(plan, repertoire)[: len(wanted)]
    row = style_response.evaluate(danced, wanted[: len(danced)])
    lengths_s = {genre: 0.0 for genre in audio.genres}
    for take in repertoire.takes:
        if take.credits.genre in lengths_s:
            lengths_s[take.credits.genre] += take.duration_s
    row["part_genre_drawn"] = sum(lengths_s.values()) / 2 / sum(take.duration_s for take in repertoire.takes)
    row["second_half"] = style_response.own_genre_shares(danced, wanted[: len(danced)])[-1]
    placed = danced_counts(plan, repertoire)
    pair = (placed.times_s, placed.numbers, audio.counts.times_s, audio.counts.numbers)
    row["counts_within"] = counts.counts_within(*pair[::2])
    row["downbeat_share"] = counts.downbeat_share(*pair)
    return row


def means(rows: list[Row]) -> Row:
    """Mean of every column over the rows in which it is known."""
    known = {key: [row[key] for row in rows if np.isfinite(row[key])] for key in rows[0]}
    return {key: float(np.mean(values)) if values else float("nan") for key, values in known.items()}


def text(row: Row) -> str:
    return " ".join(f"{key} {value:.2f}" for key, value in row.items())


def spliced_table(repertoire: cg.Repertoire, config: cg.DanceConfig, seeds: int) -> list[Row]:
    """A row for each seed, means over the songs. Every song is printed."""
    rows = []
    for seed in range(seeds):
        of_seed = []
        for spliced in SPLICED_SONGS:
            of_seed.append(measured(spliced, repertoire, replace(config, seed=seed)))
            print(f"{spliced.name:26s} seed {seed}", text(of_seed[-1]), flush=True)
        rows.append(means(of_seed))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repertoire", type=Path, help="default: the built-in one")
    parser.add_argument("--engines", nargs="+", default=["graph"])
    parser.add_argument("--weights", type=json.loads, default={}, help='of the graph\'s, as {"signature": 0}')
    parser.add_argument("--seeds", type=int, default=1)
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()
    for engine in given.engines:
        weights = given.weights if engine == "graph" else {}
        rows = spliced_table(repertoire, cg.DanceConfig(engine=engine, weights=weights), given.seeds)
        print(
            f"mean of {len(SPLICED_SONGS)} songs, {given.seeds} seeds, {engine}:",
            text(means(rows)),
            flush=True,
        )


if __name__ == "__main__":
    main()
