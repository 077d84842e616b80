"""How well a small network tells built-in takes from real ones: the area under its ROC curve (chance 0.5).

    python research/real_or_built_in.py DANCE_WITH_MELODY CHOREONET STREET [--repertoire REP] [--seeds 3]

The network sees the joint velocities of 2 s in the root frame, smoothed alike (`SMOOTH_S`), so that it does
not look for the noise of a capture. It is trained on every second take by name, and tested on the others. Of
STREET, only takes of people are used. Takes of each genre weigh as much as those of another. As controls, the
real takes are told from real takes of other data sets, and the built-in ones from each other at random.
With --by-part, networks that see only some joints, only slow or fast motion, or the frames of a window in a
random order show what takes are told by.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d
from sklearn.metrics import roc_auc_score
from torch import nn

import choreograph as cg
from choreograph.core.timebase import NET_FPS
from choreograph.formats import choreonet
from choreograph.formats.register import import_takes
from choreograph.motion.body import BODY_JOINTS, body_pos_at, body_pos_m, to_root_frame
from research.movement_ranges import OF_A_ROBOT, street_body

WINDOW, HOP = 2 * NET_FPS, NET_FPS  # frames
SMOOTH_S = 0.1
STEPS, BATCH = 400, 64
PARTS = {
    "pelvis and legs": ("pelvis", "hip", "knee", "ankle", "foot"),
    "trunk and head": ("spine", "neck", "head", "collar"),
    "arms": ("shoulder", "elbow", "wrist"),
}
SLOW_S = 0.15  # smoothing that leaves what is slower than about 1 Hz


@dataclass(frozen=True, eq=False)
class Windows:
    """Joint velocities in m/s, the genre and the source of each window, and whether it is of an odd take."""

    velocity: np.ndarray  # (N, 63, T)
    genre: np.ndarray  # (N,)
    source: np.ndarray  # (N,)
    is_tested: np.ndarray  # (N,)

    def of(self, wanted: np.ndarray) -> Windows:
        return Windows(self.velocity[wanted], self.genre[wanted], self.source[wanted], self.is_tested[wanted])


def windows_of(bodies: Sequence[tuple[str, str, str, np.ndarray]]) -> Windows:
    """The windows of takes: name, genre, source and body positions (T, 21, 3) at 20 fps."""
    rows = []
    for index, (_, genre, source, body) in enumerate(sorted(bodies, key=lambda take: take[:1])):
        pos = gaussian_filter1d(body, SMOOTH_S * NET_FPS, axis=0)
        velocity = to_root_frame(pos, np.gradient(pos, axis=0) * NET_FPS)
        for start in range(0, len(body) - WINDOW + 1, HOP):
            rows.append(
                (velocity[start : start + WINDOW].reshape(WINDOW, -1).T, genre, source, index % 2 == 1)
            )
    velocity, genre, source, is_tested = zip(*rows, strict=True)
    return Windows(np.array(velocity, np.float32), np.array(genre), np.array(source), np.array(is_tested))


def real_takes(dances: Path, lists: Path, street: Path) -> list[tuple[str, str, str, np.ndarray]]:
    found = []
    for folder, takes in (
        ("dance-with-melody", choreonet.annotate(list(import_takes(dances)), lists)),
        ("choreonet", import_takes(lists)),
    ):
        for take in takes:
            body = body_pos_m(take.motion.resampled(NET_FPS))
            found.append((take.name, take.credits.genre or "none", folder, body))
    for path in sorted(street.glob("*.npz")):
        if not path.name.startswith(OF_A_ROBOT):
            body, fps = street_body(path)
            found.append((path.stem, "street", "street", body_pos_at(body, fps, NET_FPS)))
    return found


def built_in_takes(repertoire: cg.Repertoire) -> list[tuple[str, str, str, np.ndarray]]:
    return [
        (take.name, take.credits.genre, "built-in", repertoire.body_pos_m(index).astype(np.float64))
        for index, take in enumerate(repertoire.takes)
    ]


def small_net(width: int = 32) -> nn.Module:
    """The network that tells takes, from velocities (N, 63, T) to scores (N, 1)."""
    return nn.Sequential(
        nn.Conv1d(63, width, 5), nn.GELU(), nn.MaxPool1d(2), nn.Conv1d(width, width, 5), nn.GELU(),
        nn.AdaptiveAvgPool1d(1), nn.Flatten(), nn.Dropout(0.3), nn.Linear(width, 1),
    )  # fmt: skip


def auc(
    first: Windows,
    second: Windows,
    seed: int,
    net_of: Callable[[], nn.Module] = small_net,
    trainings: int = 1,
) -> float:
    """How well takes of `second` are told from those of `first`, on takes that were not trained on.

    The network is trained for `trainings` times as many steps as usual.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    net = net_of()
    sides = [side.of(~side.is_tested) for side in (first, second)]
    weights = [balanced(side.genre) for side in sides]
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-3, weight_decay=1e-2)
    for _ in range(trainings * STEPS):
        parts = [
            side.velocity[rng.choice(len(side.genre), BATCH // 2, p=weight)]
            for side, weight in zip(sides, weights, strict=True)
        ]
        truth = torch.cat([torch.zeros(BATCH // 2), torch.ones(BATCH // 2)])
        given = net(torch.from_numpy(np.concatenate(parts)))[:, 0]
        optimizer.zero_grad()
        nn.functional.binary_cross_entropy_with_logits(given, truth).backward()
        optimizer.step()
    net.eval()
    tested = [side.of(side.is_tested) for side in (first, second)]
    with torch.no_grad():
        scores = np.concatenate([net(torch.from_numpy(side.velocity))[:, 0].numpy() for side in tested])
    truth_of = np.repeat([0, 1], [len(side.genre) for side in tested])
    weight = np.concatenate([balanced(side.genre) for side in tested])
    return float(roc_auc_score(truth_of, scores, sample_weight=weight))


def balanced(genre: np.ndarray) -> np.ndarray:
    """Weights (N,) with the sum 1, of which all genres have the same share."""
    n = Counter(genre.tolist())
    return np.array([1.0 / n[g] for g in genre.tolist()]) / len(n)


def show(what: str, first: Windows, second: Windows, seeds: int) -> None:
    found = [auc(first, second, seed) for seed in range(seeds)]
    print(f"{what:44s} {np.mean(found):.3f} ± {np.std(found):.3f}", flush=True)


def only(windows: Windows, what: str) -> Windows:
    """The windows with what is named alone: joints of a part, slow or fast motion, or frames in disorder."""
    velocity = windows.velocity
    if what in PARTS:
        seen = [any(name.endswith(end) or end in name for end in PARTS[what]) for name in BODY_JOINTS]
        return replace(windows, velocity=velocity * np.repeat(np.array(seen, np.float32), 3)[:, None])
    if what == "frames in disorder":
        rng = np.random.default_rng(0)
        order = np.argsort(rng.random((len(velocity), 1, velocity.shape[2])), axis=2)
        return replace(windows, velocity=np.take_along_axis(velocity, order, axis=2))
    slow = gaussian_filter1d(velocity, SLOW_S * NET_FPS, axis=2)
    return replace(windows, velocity=slow if what == "slow motion" else velocity - slow)


def arguments(description: str | None) -> argparse.ArgumentParser:
    """The arguments of all that tells takes: real takes of three sources, a repertoire, and seeds."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("dances", type=Path)
    parser.add_argument("lists", type=Path)
    parser.add_argument("street", type=Path)
    parser.add_argument("--repertoire", type=Path, help="default: the built-in one")
    parser.add_argument("--seeds", type=int, default=3)
    return parser


def asked_repertoire(given: argparse.Namespace) -> cg.Repertoire:
    """The repertoire that the arguments name, or the built-in one."""
    return cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--by-part", action="store_true", help="what takes are told by")
    given = parser.parse_args()
    made = windows_of(built_in_takes(asked_repertoire(given)))
    real = windows_of(real_takes(given.dances, given.lists, given.street))
    print(f"{len(made.genre)} windows of built-in takes, {len(real.genre)} of real ones")
    show("real or built-in", real, made, given.seeds)
    for genre in sorted(set(real.genre) & set(made.genre)):
        show(
            f"real or built-in, {genre}",
            real.of(real.genre == genre),
            made.of(made.genre == genre),
            given.seeds,
        )
    for what in (*PARTS, "slow motion", "fast motion", "frames in disorder") if given.by_part else ():
        show(f"real or built-in, by {what}", only(real, what), only(made, what), given.seeds)
    ours, others = real.source == "dance-with-melody", real.source == "street"
    show("control: dance-with-melody or street", real.of(ours), real.of(others), given.seeds)
    half = np.random.default_rng(0).random(len(made.genre)) < 0.5
    show("control: built-in at random", made.of(half), made.of(~half), given.seeds)


if __name__ == "__main__":
    main()
