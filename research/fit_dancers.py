"""Fits what the body of a built-in dancer does by itself to real dancing, by a random search.

    python -m research.fit_dancers DANCE_WITH_MELODY CHOREONET STREET --genre waltz [--tries 100] [--seed 0]

One to three amounts at a time (`AMOUNTS`, of the carriage, the manner and the genre) are changed at random.
The change is kept if the whole takes of the genre come nearer to the ranges of real takes. These are the
ranges of the table of `choreograph inspect --movement`, and of the first set of `research.unseen_measures`,
whose values are known. The second set is not used. A dancer may not get farther from the counts,
accelerate more, or be changed without need. The amounts that were found are printed, to be written into
`content/moves/genres/`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from choreograph.core.counts import ANNOTATED, make_counts, numbers_in_bar
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.metrics import beat
from choreograph.evaluation.movement import ALL_REAL, Range, measured, real_ranges, windows_of
from choreograph.motion.body import body_pos_m
from content.moves.genres import GENRES
from content.moves.sequencer import Genre, render_take
from content.moves.stylings import styled
from content.songs.danced_styles import DANCED
from content.songs.synthesis.song import SyntheticSong, render_song
from content.starter_takes import FPS, TakeSpec, beat_energies, take_specs
from research.real_or_built_in import arguments
from research.unseen_measures import by_genre, ranges_of, real_values, values_of

SET = "first"  # of the unseen measures, by which is fitted
# A step of the search, the least and the greatest value.
AMOUNTS = {
    "carriage.reach": (0.004, 0.975, 0.9965), "carriage.to_go": (0.1, 0.1, 0.95),
    "carriage.through": (0.1, 0.1, 0.9), "carriage.stoop_m": (0.01, -0.02, 0.05),
    "carriage.sinks_m": (0.006, 0.0, 0.035), "carriage.give_m": (0.008, 0.0, 0.05),
    "carriage.hip_up": (0.8, 0.0, 8.0), "carriage.hip_out_m": (0.006, 0.0, 0.05),
    "carriage.hip_with_feet": (4.0, 0.0, 40.0), "carriage.turned": (2.5, 0.0, 15.0),
    "carriage.chest_against": (0.2, 0.0, 1.6), "carriage.shoulders_against": (0.2, -0.8, 1.0),
    "carriage.lean": (2.0, -19.0, 8.0), "carriage.lean_into": (0.8, 0.0, 6.0),
    "carriage.left_behind": (0.4, 0.0, 3.0), "carriage.posture": (0.8, 1.0, 9.5),
    "carriage.sway": (1.0, -6.0, 6.0), "carriage.head_still": (0.2, -0.9, 1.0),
    "carriage.head_back": (6.0, 0.0, 25.0), "carriage.head_drag": (0.5, 0.0, 4.0),
    "carriage.looks": (1.5, 1.0, 16.0), "carriage.arms_back": (4.0, -12.0, 20.0),
    "carriage.arms_open": (4.0, -5.0, 22.0), "carriage.arm_swing": (3.0, 0.0, 35.0),
    "carriage.arm_drag_s": (0.015, 0.0, 0.12), "carriage.arm_throw": (0.6, 0.0, 5.0),
    "carriage.arm_play": (1.0, 1.0, 9.0), "carriage.toes_vary": (3.0, 5.0, 20.0),
    "carriage.toes_sweep": (5.0, 8.0, 35.0), "carriage.toes_point": (5.0, 25.0, 56.0),
    "genre.size": (0.06, 0.8, 1.45), "genre.bounce": (0.12, 0.0, 1.8),
    "manner.twist_deg": (2.0, 0.0, 22.0), "manner.side_deg": (1.2, -6.0, 10.0),
    "manner.look_deg": (3.0, 4.0, 30.0), "manner.toe_out_deg": (3.0, -4.0, 25.0),
    "manner.swing": (0.07, 0.5, 1.0), "manner.lift_m": (0.007, 0.03, 0.09),
    "manner.ball_deg": (3.0, 12.0, 32.0), "manner.varies": (0.025, 0.1, 0.3),
    "manner.turns_vary_deg": (2.0, 4.0, 16.0),
}  # fmt: skip
STEP = 1.5  # spread of a change, in steps
MARGIN = 0.04  # of a range: nearer to its ends than this costs, and outside costs more
OUTSIDE, FAR = 0.6, 0.8  # cost of a cell outside, and of one that is farther by the width of its range
OFF_THE_COUNT, HASTY, CHANGED = 40.0, 0.1, 0.02  # cost of F, of 1 m/s², and of a change by a step

Amounts = dict[str, float]
Ranges = Mapping[str, Mapping[str, Range]]


def amounts_of(genre: Genre) -> Amounts:
    parts = {"genre": genre, "carriage": genre.carriage, "manner": genre.manner}
    return {key: float(getattr(parts[key.split(".")[0]], key.split(".")[1])) for key in AMOUNTS}


def with_amounts(genre: Genre, amounts: Amounts) -> Genre:
    parts: dict[str, Amounts] = defaultdict(dict)
    for key, value in amounts.items():
        part, name = key.split(".")
        parts[part][name] = value
    carriage = replace(genre.carriage, **parts["carriage"])
    manner = replace(genre.manner, **parts["manner"])
    return replace(genre, carriage=carriage, manner=manner, **parts["genre"])


class Judge:
    """How far the takes of a genre are from real dancing. Songs are rendered once."""

    def __init__(self, name: str, first_ranges: Ranges) -> None:
        self.name = name
        self.ranges = (real_ranges(), first_ranges)
        self.takes: list[tuple[TakeSpec, SyntheticSong]] = [
            (spec, render_song(DANCED[name], bpm=spec.bpm, duration_s=spec.duration_s, seed=spec.seed))
            for spec in take_specs()
            if spec.genre == name and spec.part == "whole"
        ]

    def measures(self, genre: Genre) -> tuple[list[Mapping[str, list[float]]], float, float]:
        """The values of both tables by measure, the mean F with the counts, and m/s² of joints."""
        values: list[dict[str, list[float]]] = [defaultdict(list), defaultdict(list)]
        f_scores, fastest_m_s2 = [], []
        for spec, song in self.takes:
            energy = np.clip(beat_energies(song) + spec.way.energy, 0.0, 1.0)
            dance = render_take(
                styled(genre, spec.way), song.beat_times_s, energy=energy, seed=spec.seed, fps=FPS
            )
            body = body_pos_m(dance.motion.resampled(NET_FPS))
            numbers = numbers_in_bar(len(song.beat_times_s), song.beats_per_bar)
            counts = make_counts(song.beat_times_s, numbers, song.beats_per_bar, source=ANNOTATED)
            windows = list(windows_of(body, counts))
            for window in windows:
                for name, value in measured(window).items():
                    if np.isfinite(value):
                        values[0][name].append(value)
            for name, own in values_of(windows, [SET]).items():
                values[1][name] += own
            beats_s = beat.our_beats_s(body_pos_m(dance.motion), FPS)
            f_scores.append(beat.f_score(beats_s, dance.count_times_s))
            faster = np.linalg.norm(np.diff(body, 2, axis=0), axis=-1) * NET_FPS**2
            fastest_m_s2.append(np.percentile(faster, 99.9))
        return [dict(table) for table in values], float(np.mean(f_scores)), float(np.mean(fastest_m_s2))

    def cost(self, tables: Sequence[Mapping[str, list[float]]]) -> tuple[float, int]:
        """The cost of the cells outside or near the ends of their ranges, and how many are outside."""
        cost, outside = 0.0, 0
        for table, ranges in zip(tables, self.ranges, strict=True):
            for name, values in table.items():
                real = ranges.get(self.name, {}).get(name) or ranges[ALL_REAL].get(name)
                if real is None:
                    continue
                width, value = max(real.high - real.low, 1e-9), float(np.median(values))
                low = real.low + MARGIN * width * (real.low != 0.0)
                high = real.high - MARGIN * width * (real.high != 0.0)
                outside += not real.holds(value)
                far = min(max(0.0, low - value, value - high) / width, 1.0)
                cost += OUTSIDE * (not real.holds(value)) + FAR * far
        return cost, outside


def changed_cost(amounts: Amounts, written: Amounts) -> float:
    steps = [((amounts[key] - written[key]) / AMOUNTS[key][0]) ** 2 for key in AMOUNTS]
    return CHANGED * float(sum(step / (1.0 + 0.25 * step) for step in steps))


def search(judge: Judge, genre: Genre, tries: int, rng: np.random.Generator) -> Amounts:
    """The amounts of the dancer with the least cost that `tries` random changes find."""
    written = amounts_of(genre)
    tables, least_f, most_m_s2 = judge.measures(genre)
    best, outside = judge.cost(tables)
    print(f"{judge.name}: {outside} cells outside, F {least_f:.3f}, {most_m_s2:.0f} m/s²", flush=True)
    found = written
    order: list[str] = []
    for _ in range(tries):
        order = order or list(rng.permutation(list(AMOUNTS)))
        tried = dict(found)
        for key in [order.pop() for _ in range(min(int(rng.integers(1, 4)), len(order)))]:
            step, low, high = AMOUNTS[key]
            tried[key] = float(np.clip(tried[key] + STEP * step * rng.standard_normal(), low, high))
        tables, f_score, m_s2 = judge.measures(with_amounts(genre, tried))
        cost, outside = judge.cost(tables)
        cost += OFF_THE_COUNT * max(0.0, least_f - f_score) + HASTY * max(0.0, m_s2 - most_m_s2)
        cost += changed_cost(tried, written)
        if cost < best:
            best, found = cost, tried
            print(f"  {outside} cells outside, F {f_score:.3f}, {m_s2:.0f} m/s²", flush=True)
    return {key: value for key, value in found.items() if value != written[key]}


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--genre", choices=sorted(GENRES), required=True)
    parser.add_argument("--tries", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    takes = real_values(given.dances, given.lists, given.street, [SET])
    judge = Judge(given.genre, ranges_of(by_genre(takes.values())))
    found = search(judge, GENRES[given.genre], given.tries, np.random.default_rng(given.seed))
    for key, value in sorted(found.items()):
        print(f"{key} {value:.4g}")


if __name__ == "__main__":
    main()
