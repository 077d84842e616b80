"""Do built-in takes look real when a network refines them? Fresh judges, and what the refinement costs.

    python -m research.refined_takes write DANCE_WITH_MELODY CHOREONET STREET TAKES.npz
    python -m research.refined_takes refine TAKES.npz -o FOLDER [--seconds 185] [--seeds 0] [--only NAME …]

The first command writes the real takes to a file. The second needs no more than this repository and that
file. It uses CUDA if there is any (for a trial on the CPU: --width 32 --batch 8 --seconds 20). Three kinds
of networks are trained on every second take by name: a refiner against critics (`research/refiner.py`), a
regressor that restores the upper body from its smoothed copy, and a diffusion network of the upper body,
given the legs. Each then refines all built-in takes, which judges tell from real takes. Judges are networks
of `real_or_built_in.py`, trained anew with three seeds of their own. Stronger judges are wider, trained
for longer, or both.

Refined takes are compared with the real takes on their own bodies, and with all on the skeleton of the
built-in dancers. They are also compared by judges that are trained and tested on takes that no refiner saw,
with CMU and G1 Moves alone, and by pelvis and legs.
Only networks that are trained on "street" (CMU and G1 Moves) could be shipped.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch

import choreograph as cg
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.metrics import beat
from choreograph.evaluation.movement import cells_beside, real_ranges
from choreograph.motion.body import BODY_JOINTS, body_pos_at
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton
from research.real_from_real import Body, in_part, joined, of_a_robot, recorded
from research.real_or_built_in import Windows, auc, built_in_takes, only, small_net
from research.refiner import FEET, Setting
from research.refiner_training import Adversary, Denoiser, Diffusion, Trained, train

UNIT_M = 1 / 2500  # of the positions in the file
CMU, ROBOT = "CMU", "G1 Moves"
JUDGE_SEEDS = (100, 101, 102)
LONGER = 4  # times the training of a judge
BEAT_FPS = 60.0

SETTINGS = (
    Setting("free, no penalty", held=False, residual=0.0, feet=0.0),
    Setting("free 0.02", held=False, residual=0.02),
    Setting("free 0.2", held=False, residual=0.2),
    Setting("held 0.02", residual=0.02),
    Setting("held 0.2", residual=0.2),
    Setting("held 0.2, timing", residual=0.2, timing=2.0),
    Setting("street: free 0.02", "street", held=False, residual=0.02),
    Setting("street: held 0.02", "street", residual=0.02),
)
DENOISERS = tuple(
    (f"{on}: {kind}", on, kind) for on in ("all", "street") for kind in ("regressor", "diffusion")
)


def write_takes(folders: Sequence[Path], path: Path) -> None:
    """The real takes on their own bodies, and on the skeleton of the built-in dancers, but for the robot."""
    dances, lists, street = folders
    takes, target = recorded(dances, lists, street), canonical_skeleton()
    of_skeletons = {
        "own": [*(take.body() for take in takes), *of_a_robot(street)],
        "one": [take.body(retarget(take.motion.resampled(NET_FPS), target)) for take in takes],
    }
    arrays = {}
    for skeleton, bodies in of_skeletons.items():
        for index, part in enumerate(("name", "genre", "source")):
            arrays[f"{skeleton}/{part}"] = np.array([body[index] for body in bodies])
        arrays[f"{skeleton}/frames"] = np.array([len(body[3]) for body in bodies])
        moved = [
            body[3] - [[[*body[3].mean(axis=(0, 1))[[0]], 0.0, body[3].mean(axis=(0, 1))[2]]]]
            for body in bodies
        ]
        arrays[f"{skeleton}/pos"] = np.rint(np.concatenate(moved) / UNIT_M).astype(np.int16)
    np.savez_compressed(path, **arrays)


def read_takes(path: Path, skeleton: str) -> list[Body]:
    with np.load(path) as data:
        stops = np.cumsum(data[f"{skeleton}/frames"])[:-1]
        parts = np.split(data[f"{skeleton}/pos"].astype(np.float32) * UNIT_M, stops)
        labels = [data[f"{skeleton}/{part}"].tolist() for part in ("name", "genre", "source")]
    return [(*label, pos) for *label, pos in zip(*labels, parts, strict=True)]


def halves(bodies: Iterable[Body]) -> tuple[list[Body], list[Body]]:
    """Takes to train on, and to test on: every second one by name."""
    ordered = sorted(bodies, key=lambda take: take[:1])
    return ordered[::2], ordered[1::2]


def sides_of(bodies: Sequence[Body], unseen: bool) -> Windows:
    """Windows with the takes that `real_or_built_in.py` tests to be tested, or with half of these alone."""
    trained, tested = halves(halves(bodies)[1] if unseen else bodies)
    return joined(in_part(trained, False), in_part(tested, True))


def real_side(takes: Path, name: str) -> Windows:
    """The real takes of a comparison."""
    bodies = read_takes(takes, "one" if "one skeleton" in name else "own")
    people = sides_of([b for b in bodies if b[2] != ROBOT], "unseen" in name)
    if "street" not in name:
        return people
    robot = in_sources(sides_of([b for b in bodies if b[2] == ROBOT], "unseen" in name))
    return joined(in_sources(people.of(people.source == CMU)), robot)


def in_sources(windows: Windows) -> Windows:
    """The windows with their sources as genres, so that sources weigh alike."""
    return replace(windows, genre=windows.source)


COMPARISONS = ("own bodies", "one skeleton", "one skeleton, unseen", "street, own bodies")
PART = "one skeleton, pelvis and legs"
STRONGER = ("one skeleton, longer", "one skeleton, wide", "one skeleton, wide, longer")
ALL = (*COMPARISONS, PART, *STRONGER)


def judged(takes: Path, made: Path, comparison: str, seed: int) -> float:
    """The AUC of a fresh judge."""
    torch.set_num_threads(1)
    own = sides_of(read_made(made), "unseen" in comparison)
    real = real_side(takes, comparison)
    if comparison == PART:
        real, own = only(real, "pelvis and legs"), only(own, "pelvis and legs")
    net_of = wide_net if "wide" in comparison else small_net
    return auc(real, own, seed, net_of, LONGER if "longer" in comparison else 1)


def wide_net() -> torch.nn.Module:
    """A judge that is wider and sees more frames, as the widest critic."""
    return torch.nn.Sequential(
        torch.nn.Conv1d(63, 128, 5), torch.nn.GELU(), torch.nn.Conv1d(128, 128, 5), torch.nn.GELU(),
        torch.nn.Conv1d(128, 128, 5, dilation=2), torch.nn.GELU(), torch.nn.AdaptiveAvgPool1d(1),
        torch.nn.Flatten(), torch.nn.Dropout(0.3), torch.nn.Linear(128, 1),
    )  # fmt: skip


def read_made(path: Path) -> list[Body]:
    """The built-in takes with the positions of a file."""
    takes = cg.starter_repertoire().takes
    with np.load(path) as data:
        parts = np.split(data["pos"], np.cumsum(data["frames"])[:-1])
    return [(take.name, take.credits.genre, "built-in", pos) for take, pos in zip(takes, parts, strict=True)]


class Moved:
    """The built-in repertoire with other positions, as far as `cells_beside` needs one."""

    def __init__(self, made: Path):
        self._own = cg.starter_repertoire()
        self.takes, self.counts = self._own.takes, self._own.counts
        self._pos = [body[3].astype(np.float64) for body in read_made(made)]

    def body_pos_m(self, take: int) -> np.ndarray:
        return self._pos[take]


def moved_as(made: Path) -> dict[str, float]:
    """How refined takes move: cells inside, counts near motion beats, and how far joints are moved (m)."""
    torch.set_num_threads(1)
    moved, before = Moved(made), cg.starter_repertoire()
    cells = cells_beside(real_ranges(), moved)
    scores, apart, slide = [], [], []
    for take in range(len(moved.takes)):
        pos, own = moved.body_pos_m(take), before.body_pos_m(take).astype(np.float64)
        beats_s = motion_beat_times_s(body_pos_at(pos, NET_FPS, BEAT_FPS), BEAT_FPS)
        scores.append(beat.f_score(beats_s, before.counts(take).times_s))
        apart.append(np.linalg.norm(pos - own, axis=-1).mean(axis=0))
        still = np.linalg.norm(np.gradient(own[:, list(FEET)], axis=0), axis=-1) * NET_FPS < 0.05
        slide.append(
            (np.linalg.norm(np.gradient(pos[:, list(FEET)], axis=0), axis=-1) * NET_FPS)[still].mean()
        )
    apart_m = np.mean(apart, axis=0)
    others = [i for i in range(len(BODY_JOINTS)) if i not in FEET]
    return {
        "cells": float(np.mean([c.is_inside for c in cells])),
        "cells of own genre": float(np.mean([c.is_inside for c in cells if c.of_genre])),
        "F": float(np.mean(scores)),
        "moved, m": float(apart_m[others].mean()),
        "feet moved, m": float(apart_m[list(FEET)].mean()),
        "standing feet, m/s": float(np.mean(slide)),
    }


def save_made(path: Path, positions: Sequence[np.ndarray]) -> None:
    np.savez(
        path, pos=np.concatenate(positions).astype(np.float32), frames=np.array([len(p) for p in positions])
    )


def trainers(takes: Path, seed: int, wanted: Sequence[str], width: int, batch: int) -> dict[str, Trained]:
    """Everything that is trained, by name, on the takes that no judge is tested on."""
    device = "cuda" if torch.cuda.is_available() else "cpu"
    made = halves(built_in_takes(cg.starter_repertoire()))[0]
    people = halves(read_takes(takes, "one"))[0]
    robot = halves(b for b in read_takes(takes, "own") if b[2] == ROBOT)[0]
    street = [(b[0], b[2], b[2], b[3]) for b in [*people, *robot] if b[2] in (CMU, ROBOT)]
    on_own = halves(b for b in read_takes(takes, "own") if b[2] != ROBOT)[0]
    real = {"all": people, "own": on_own, "street": street}
    found: dict[str, Trained] = {}
    for setting in SETTINGS:
        if not wanted or setting.name in wanted:
            torch.manual_seed(seed)
            found[setting.name] = Adversary(
                setting, made, real[setting.trained_on], seed, width, batch, device
            )
    for name, on, kind in DENOISERS:
        if not wanted or name in wanted:
            torch.manual_seed(seed)
            of_kind = Denoiser if kind == "regressor" else Diffusion
            found[name] = of_kind(real[on], seed, width, batch, device)
    return found


def refine(given: argparse.Namespace) -> None:
    """Train, refine, judge, and print a line for each kind of refined takes."""
    given.output.mkdir(parents=True, exist_ok=True)
    own = [body[3].astype(np.float32) for body in built_in_takes(cg.starter_repertoire())]
    files = {"before": given.output / "before.npz"}
    save_made(files["before"], own)
    os.environ["OMP_NUM_THREADS"] = "1"
    context = get_context("spawn")
    with ProcessPoolExecutor(given.workers, mp_context=context) as pool:
        jobs = {"before": submitted(pool, given.takes, files["before"], ALL)}
        for seed in given.seeds:
            for share, networks in train(
                trainers(given.takes, seed, given.only, given.width, given.batch),
                given.seconds,
                given.shares,
                given.eager,
            ):
                for name, network in networks.items():
                    for how, positions in network.refined(own, seed).items():
                        what = ", ".join([name, *([how] if how else []), f"seed {seed}", f"at {share:g}"])
                        path = given.output / f"{len(files)}.npz"
                        files[what] = path
                        save_made(path, positions)
                        comparisons = ALL if share == 1 else (COMPARISONS[1],)
                        jobs[what] = submitted(pool, given.takes, path, comparisons)
        rows = {}
        for what, job in jobs.items():
            rows[what] = collected(job)
            print(f"| {what} | " + " | ".join(rows[what].values()) + " |", flush=True)
            (given.output / "rows.json").write_text(json.dumps(rows, indent=1))
    print("| | " + " | ".join(rows["before"]) + " |")


def submitted(
    pool: ProcessPoolExecutor, takes: Path, made: Path, comparisons: Sequence[str]
) -> dict[str, list]:
    jobs = {
        name: [pool.submit(judged, takes, made, name, seed) for seed in JUDGE_SEEDS] for name in comparisons
    }
    return jobs | {"moved": [pool.submit(moved_as, made)]}


def collected(jobs: dict[str, list]) -> dict[str, str]:
    row = {}
    for name, of_name in jobs.items():
        found = [job.result() for job in of_name]
        if name == "moved":
            row |= {key: f"{value:.3f}" for key, value in found[0].items()}
        else:
            row[name] = f"{np.mean(found):.3f} ± {np.std(found):.3f}"
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    writing = commands.add_parser("write")
    writing.add_argument("folders", nargs=3, type=Path)
    writing.add_argument("takes", type=Path)
    refining = commands.add_parser("refine")
    refining.add_argument("takes", type=Path)
    refining.add_argument("-o", "--output", type=Path, required=True)
    refining.add_argument("--seconds", type=float, default=185.0, help="of training, for each seed")
    refining.add_argument("--seeds", type=int, nargs="+", default=[0])
    refining.add_argument("--shares", type=float, nargs="+", default=[1.0], help="of training, to judge at")
    refining.add_argument("--only", nargs="+", default=[], help="names of what is trained")
    refining.add_argument("--width", type=int, default=128, help="channels of each network")
    refining.add_argument("--batch", type=int, default=64)
    refining.add_argument("--eager", action="store_true", help="without CUDA graphs")
    refining.add_argument("--workers", type=int, default=max(1, (os.cpu_count() or 1) - 2))
    given = parser.parse_args()
    if given.command == "write":
        write_takes(given.folders, given.takes)
    else:
        refine(given)


if __name__ == "__main__":
    main()
