"""The ranges of real dancing for `choreograph inspect --movement`.

    python research/movement_ranges.py DANCE_WITH_MELODY CHOREONET STREET [-o movement_ranges.json]
    python research/movement_ranges.py DANCE_WITH_MELODY CHOREONET STREET --held-out REPERTOIRE

A range is the 5th, 50th and 95th percentile of windows of 20 s: of each genre with at least 8 windows, and of
all of them together. Windows of a genre weigh as much as those of another in the range of all. STREET holds
takes of the CMU database (local rotations) and of G1 Moves, which are positions of a robot without head and
spine, so that only measures of legs, hips and arms are taken of them.

Before anything was fitted to this table, every second take by name and every third measure by name were set
aside. `--held-out` prints, for a repertoire, the share of its cells inside the ranges of each half of the
takes, by measures that were and were not set aside. The halves share motion, since dances of one data set
have figures in common.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.core.files import atomic_path
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.movement import ALL_REAL, MEASURES, Range, cells_beside, measured, windows_of
from choreograph.formats import choreonet
from choreograph.formats.register import import_takes
from choreograph.motion.body import BODY_JOINTS, body_pos_at, body_pos_m

FEWEST_WINDOWS = 8
PERCENTILES = (5, 50, 95)
OF_A_ROBOT = "g1-"
# Of a robot without head and spine, and with limits of its joints, these measures say nothing of a dancer.
NOT_OF_A_ROBOT = (
    "head",
    "trunk",
    "shoulder",
    "chest",
    "elbow",
    "knee angle",
    "wrist height",
    "wrist to",
    "tilt",
)

Values = dict[str, dict[str, list[float]]]  # by genre and measure
Takes = dict[str, tuple[str, dict[str, list[float]]]]  # the genre of each take, and its values by measure


def set_aside_measures() -> set[str]:
    """Every third measure by name, which nothing is fitted to."""
    return set(sorted(MEASURES)[2::3])


def take_values(dances: Path, lists: Path, street: Path) -> Takes:
    """The genre and the values of the measures of every take, by name."""
    found: Takes = {}
    for take in [*choreonet.annotate(list(import_takes(dances)), lists), *import_takes(lists)]:
        body = body_pos_m(take.motion.resampled(NET_FPS))
        found[take.name] = (take.credits.genre or "none", values_of(body, take.counts))
    for path in sorted(street.glob("*.npz")):
        body, fps = street_body(path)
        found[path.stem] = ("street", values_of(body_pos_at(body, fps, NET_FPS), None))
        if path.name.startswith(OF_A_ROBOT):
            kept = {n: v for n, v in found[path.stem][1].items() if not n.startswith(NOT_OF_A_ROBOT)}
            found[path.stem] = ("street", kept)
    return found


def values_of(body: np.ndarray, counts: cg.Counts | None) -> dict[str, list[float]]:
    values: dict[str, list[float]] = defaultdict(list)
    for window in windows_of(body, counts):
        for name, value in measured(window).items():
            if np.isfinite(value):
                values[name].append(value)
    return values


ROBOT = {
    "pelvis": "pelvis", "spine1": "waist_yaw", "spine3": "torso", "neck": "torso", "head": "torso",
    **{f"{s}_{j}": f"{s}_{r}" for s in ("left", "right") for j, r in (
        ("hip", "hip_pitch"), ("knee", "knee"), ("ankle", "ankle_pitch"), ("foot", "ankle_roll"),
        ("collar", "shoulder_pitch"), ("shoulder", "shoulder_pitch"), ("elbow", "elbow"),
        ("wrist", "wrist_yaw"),
    )},
}  # fmt: skip
PELVIS_M = 0.93  # of the canonical body
NECK_M, HEAD_M = 0.25, 0.4  # above the torso of the robot, which has neither


def street_body(path: Path) -> tuple[np.ndarray, float]:
    """Body positions (T, 21, 3) of a file of STREET, at its rate."""
    with np.load(path) as data:
        if "positions_m" not in data:
            return body_pos_m(cg.load_motion(path)), float(data["fps"])
        names = [str(name) for name in data["names"]]
        pos = data["positions_m"][..., [1, 2, 0]].astype(np.float64)  # Z up, to the front X
        fps = float(data["fps"])
    body = pos[:, [names.index(ROBOT[joint]) for joint in BODY_JOINTS]]
    body *= PELVIS_M / np.median(body[:, BODY_JOINTS.index("pelvis"), 1])
    body[:, BODY_JOINTS.index("neck"), 1] += NECK_M
    body[:, BODY_JOINTS.index("head"), 1] += HEAD_M
    return body, fps


def ranges_of(takes: Takes) -> dict[str, dict[str, Range]]:
    """The ranges of each genre and of all genres together."""
    values: Values = defaultdict(lambda: defaultdict(list))
    for genre, own in takes.values():
        for name, of_take in own.items():
            values[genre][name] += of_take
    ranges: dict[str, dict[str, Range]] = {ALL_REAL: {}}
    for name in MEASURES:
        of_genres = [v for genre in values if len(v := values[genre].get(name, [])) >= FEWEST_WINDOWS]
        if not of_genres:
            continue
        weights = np.concatenate([np.full(len(v), 1.0 / len(v)) for v in of_genres])
        ranges[ALL_REAL][name] = weighted_range(np.concatenate(of_genres), weights)
        for genre, own in values.items():
            if genre not in ("none", "street") and len(own.get(name, [])) >= FEWEST_WINDOWS:
                of_genre = weighted_range(np.array(own[name]), np.ones(len(own[name])))
                ranges.setdefault(genre, {})[name] = of_genre
    return ranges


def weighted_range(values: np.ndarray, weights: np.ndarray) -> Range:
    order = np.argsort(values)
    at = (np.cumsum(weights[order]) - weights[order] / 2) / weights.sum()
    return Range(*(float(f"{v:.4g}") for v in np.interp(np.array(PERCENTILES) / 100, at, values[order])))


def write(path: Path, ranges: Mapping[str, Mapping[str, Range]], takes: Takes) -> None:
    n_takes = Counter(genre for genre, _ in takes.values())
    listed = ", ".join(f"{n} {genre}" for genre, n in sorted(n_takes.items()))
    about = f"Percentiles 5, 50, 95 of windows of 20 s, by research/movement_ranges.py. Takes: {listed}"
    rows = {g: {n: [r.low, r.median, r.high] for n, r in of.items()} for g, of in ranges.items()}
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps({"about": about, "ranges": rows}, indent=1) + "\n", encoding="utf-8")


def show_held_out(repertoire: cg.Repertoire, takes: Takes) -> None:
    """Shares of cells inside the ranges of each half of the takes, by each part of the measures."""
    names = sorted(takes)
    aside = set_aside_measures()
    for half, title in ((names[::2], "takes that are fitted to"), (names[1::2], "takes set aside")):
        cells = cells_beside(ranges_of({name: takes[name] for name in half}), repertoire)
        for is_aside, measures in ((False, "measures fitted to"), (True, "measures set aside")):
            of = [c for c in cells if (c.measure in aside) == is_aside]
            own = [c.is_inside for c in of if c.of_genre]
            inside = np.mean([c.is_inside for c in of])
            of_own = np.mean(own or [np.nan])
            print(f"{title}, {measures}: {inside:.2f} of {len(of)} cells, own genre {of_own:.2f}")


def show_real(takes: Takes) -> None:
    """The same of the takes that are set aside, beside the ranges of the others: what can be reached."""
    names = sorted(takes)
    ranges = ranges_of({name: takes[name] for name in names[::2]})
    values: Values = defaultdict(lambda: defaultdict(list))
    for name in names[1::2]:
        for measure, own in takes[name][1].items():
            values[takes[name][0]][measure] += own
    for of, title in (("all", "the range of all"), ("own", "that of their genre")):
        inside = [
            ranges[genre if of == "own" else ALL_REAL][measure].holds(float(np.median(own)))
            for genre, measures in values.items()
            for measure, own in measures.items()
            if measure in ranges.get(genre if of == "own" else ALL_REAL, {})
        ]
        print(f"genres of real takes set aside, beside {title}: {np.mean(inside):.2f} of {len(inside)} cells")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("takes", type=Path, nargs=2, help="dance-with-melody and choreonet")
    parser.add_argument("street", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--held-out", type=Path, metavar="REPERTOIRE")
    given = parser.parse_args()
    takes = take_values(*given.takes, given.street)
    if given.output is not None:
        write(given.output, ranges_of(takes), takes)
    if given.held_out is not None:
        show_real(takes)
        show_held_out(cg.Repertoire.open(given.held_out), takes)


if __name__ == "__main__":
    main()
