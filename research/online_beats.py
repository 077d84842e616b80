"""Beats and bars that are followed while music plays, beside those that are tracked in the whole song.

    python research/online_beats.py -o results.md
    python research/online_beats.py -o results.md --data dance-with-melody/ --choreonet choreonet/

Each song is given to `OnlineBeats` in blocks of a tenth of a second. A beat is what the clock said so many
seconds before it: 0 s is what a body is moved by, 2 s is when a part is planned, and 6 s is the end of that
part. Songs are synthetic, with true beats: every fifth one of those of `research/music_counts.py` from the
third on. The settings of `OnlineBeats` were chosen on the first, sixth and so on, and three ramps. Beats
before the clock starts are not judged, but that time is in the table. Real songs have no true beats, so that
their beats are compared with those that are tracked in the whole song.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from runpy import run_path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.live.online_beats import OnlineBeats
from choreograph.music.mel import log_mel
from choreograph.nets.music_counts import network_beats, shipped_music_counts

BLOCK_S, NEAR_S = 0.1, 0.07
AHEADS_S = (0.0, 2.0, 6.0)
FIRST, STEP = 2, 5  # of the songs
ROUNDS = 20  # of the chance level


@dataclass(frozen=True, eq=False)
class Followed:
    """What was followed of a song."""

    counts: dict[float, Counts]  # by how long before
    starts_s: float  # when the clock starts, or nan
    n_generations: int  # sets of beats
    cpu_s: float  # of a second of music


def follow(samples: NDArray[np.float32]) -> Followed:
    tracker, size = OnlineBeats(), round(BLOCK_S * SAMPLE_RATE_HZ)
    said: dict[float, dict[tuple[int, int], tuple[float, int]]] = {ahead_s: {} for ahead_s in AHEADS_S}
    starts_s, n_generations, began = np.nan, 0, time.process_time()
    for start in range(0, len(samples), size):
        tracker.feed(samples[start : start + size])
        clock, now_s = tracker.clock, tracker.heard_s
        if clock is None:
            continue
        starts_s = now_s if np.isnan(starts_s) else starts_s
        n_generations = clock.generation
        for ahead_s, beats in said.items():
            first, last = clock.beat_at([now_s + ahead_s, now_s + ahead_s + BLOCK_S])
            # A correction may move a beat over the border of two blocks, so the block before counts, too.
            for beat in range(int(np.ceil(first - 0.3)), int(np.ceil(last))):
                known = float(max(clock.time_at(beat), now_s + ahead_s)), int(clock.number_of(beat))
                beats.setdefault((clock.generation, beat), known)
    cpu_s = (time.process_time() - began) / (len(samples) / SAMPLE_RATE_HZ)
    counts = {ahead_s: in_order(list(beats.values())) for ahead_s, beats in said.items()}
    return Followed(counts, float(starts_s), n_generations, cpu_s)


def in_order(beats: Sequence[tuple[float, int]]) -> Counts:
    ordered = sorted(beats)
    times_s, numbers = np.array([t for t, _ in ordered]), np.array([n for _, n in ordered], np.int64)
    return Counts(times_s, numbers, int(numbers.max(initial=0)))


def scores(found: Counts, truth: Counts, from_s: float) -> dict[str, float]:
    """F-scores and the mean offset, of what lies after a time and before the end of the true beats."""
    to_s = truth.times_s[-1] + 0.5 * np.median(np.diff(truth.times_s))

    def judged(times_s: Floats, early_s: float) -> Floats:
        return times_s[(times_s >= from_s - early_s) & (times_s < to_s)]

    beats_s, true_s = judged(found.times_s, NEAR_S), judged(truth.times_s, 0.0)
    ones_s, true_ones_s = judged(found.downbeat_times_s, NEAR_S), judged(truth.downbeat_times_s, 0.0)
    offsets = [float(beats_s[np.abs(beats_s - t).argmin()] - t) for t in true_s] if len(beats_s) else []
    near = [offset for offset in offsets if abs(offset) < NEAR_S]
    return {
        "beats": f_score(beats_s, true_s),
        "count 1": f_score(ones_s, true_ones_s),
        "offset": 1000 * float(np.mean(near)) if near else np.nan,
        "spread": 1000 * float(np.std(near)) if near else np.nan,
    }


def shifted(counts: Counts, shift_s: float, duration_s: float) -> Counts:
    times_s = (counts.times_s + shift_s) % duration_s
    order = np.argsort(times_s)
    return Counts(times_s[order], counts.numbers[order], counts.metre)


def rows_of(
    samples: NDArray[np.float32], truth: Counts | None, rng: np.random.Generator
) -> dict[str, dict[str, float]]:
    """Scores by column. Without a truth, it is what is tracked in the whole song."""
    with_bars = run_path(str(Path(__file__).with_name("music_counts.py")))["with_bars"]
    mel = log_mel(samples)
    whole = with_bars(samples, mel, network_beats(mel, shipped_music_counts()))
    made, true = follow(samples), whole if truth is None else truth
    duration_s = len(samples) / SAMPLE_RATE_HZ
    rows = {
        f"{ahead_s:g} s before": scores(counts, true, made.starts_s + ahead_s)
        for ahead_s, counts in made.counts.items()
    }
    rows["whole song"] = scores(whole, true, made.starts_s)
    lots = [
        scores(shifted(made.counts[0.0], shift_s, duration_s), true, made.starts_s)
        for shift_s in rng.uniform(1.0, duration_s - 1.0, ROUNDS)
    ]
    rows["chance"] = {name: float(np.mean([lot[name] for lot in lots])) for name in ("beats", "count 1")}
    rows["facts"] = {"starts": made.starts_s, "sets": made.n_generations, "cpu": made.cpu_s}
    return rows


def table(all_rows: Sequence[dict[str, dict[str, float]]], columns: Sequence[str]) -> str:
    def cell(column: str, name: str, digits: int = 2) -> str:
        values = [rows[column].get(name, np.nan) for rows in all_rows]
        return "" if np.isnan(values).all() else f"{np.nanmean(values):.{digits}f}"

    lines = [f"| {len(all_rows)} songs | {' | '.join(columns)} |", f"| --- |{' --- |' * len(columns)}"]
    for name, label, digits in (
        ("beats", "beats, F at 70 ms", 2), ("count 1", "count 1, F at 70 ms", 2),
        ("offset", "mean offset in ms", 1), ("spread", "spread of the offset in ms", 1),
    ):  # fmt: skip
        lines.append(f"| {label} | {' | '.join(cell(column, name, digits) for column in columns)} |")
    facts = {name: [rows["facts"][name] for rows in all_rows] for name in ("starts", "sets", "cpu")}
    starts = np.array(facts["starts"])
    lines.append("")
    starts_text = f"{np.nanmedian(starts):.1f} s (median), {np.nanmax(starts):.1f} s at most"
    lines.append(
        f"The clock starts after {starts_text}, in {np.isfinite(starts).sum()} of {len(starts)} songs. It is "
        f"set anew {np.sum(facts['sets']) - len(starts):.0f} times in all. "
        f"CPU: {np.mean(facts['cpu']):.3f} s for a second of music."
    )
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--choreonet", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    beside = run_path(str(Path(__file__).with_name("music_counts.py")))
    rng = np.random.default_rng(given.seed)
    columns = [*(f"{ahead_s:g} s before" for ahead_s in AHEADS_S), "whole song", "chance"]
    parts, made = [], []
    for song in islice(beside["true_songs"](), FIRST, None, STEP):
        made.append(rows_of(song.samples, song.truth, rng))
        print(song.name, {c: round(r["beats"], 2) for c, r in made[-1].items() if "beats" in r}, flush=True)
    parts.append("Synthetic songs, true beats\n\n" + table(made, columns))
    if given.data is not None and given.choreonet is not None:
        made = []
        for song in islice(beside["real_songs"](given.data, given.choreonet), FIRST, None, STEP):
            made.append(rows_of(song.samples, None, rng))
            print(
                song.name, {c: round(r["beats"], 2) for c, r in made[-1].items() if "beats" in r}, flush=True
            )
        columns.remove("whole song")
        parts.append("Real songs, against the beats of the whole song\n\n" + table(made, columns))
    given.output.write_text("\n".join(parts), encoding="utf-8")
    print("\n".join(parts))


if __name__ == "__main__":
    main()
