"""How well the network of `real_or_built_in.py` tells real takes from other real takes.

    python -m research.real_from_real DANCE_WITH_MELODY CHOREONET STREET [--seeds 3] [--built FOLDER]

This says which AUC built-in takes could reach. Windows, network, training and the test on every second take
are the same. Each source of takes is told from the other real ones, and from each other source. The same is
done with all takes on one skeleton, without G1 Moves, whose takes are of a robot. A genre is told from the
same genre of another source, and from the other genres of its source. Takes are told from themselves after a
step of our own import, and at random from others of their source. The seeds are of the network and of the
halves.

With --built, two repertoires are built in FOLDER, of the takes of dance-with-melody that are trained on and
of those that are tested on. Dances of each to the songs of its takes are told from these takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

import choreograph as cg
from choreograph.core.timebase import NET_FPS
from choreograph.formats import choreonet
from choreograph.formats.register import import_takes
from choreograph.motion.body import body_pos_at, body_pos_m
from choreograph.motion.cleaning import without_jumps
from choreograph.motion.contacts import lock_feet
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import Skeleton, canonical_skeleton
from research.movement_ranges import OF_A_ROBOT, street_body
from research.real_or_built_in import Windows, arguments, asked_repertoire, auc, built_in_takes, windows_of

Body = tuple[str, str, str, np.ndarray]  # name, genre, source, positions (T, 21, 3) at 20 fps
Row = tuple[str, float, float]  # what is told from what, mean and spread of the AUC
SOURCES = ("dance-with-melody", "ChoreoNet", "CMU", "G1 Moves")
BUILT_IN = "built-in"
LOW_FPS = 12.5
MILD_S = 0.05
FEWEST = 2  # takes to train on, and to test on
DANCE_S, SONGS = 30.0, 8  # of each half


@dataclass(frozen=True, eq=False)
class Recorded:
    """A real take as its importer reads it."""

    name: str
    genre: str
    source: str
    motion: Motion

    def body(self, motion: Motion | None = None) -> Body:
        """Its positions, or those of `motion` under its name."""
        shown = self.motion if motion is None else motion
        return self.name, self.genre, self.source, body_pos_m(shown.resampled(NET_FPS))


def _smoothed(motion: Motion) -> Motion:
    quat = gaussian_filter1d(motion.local_quat, MILD_S * motion.fps, axis=0)
    quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
    root = gaussian_filter1d(motion.root_pos_m, MILD_S * motion.fps, axis=0)
    return replace(motion, root_pos_m=root, local_quat=quat)


def _imported(motion: Motion) -> Motion:
    return lock_feet(retarget(without_jumps(motion)[0], canonical_skeleton()))


# What is done to a take before it is told from itself.
STEPS: dict[str, Callable[[Motion], Motion]] = {
    "nothing": lambda motion: motion,
    f"at {LOW_FPS} frames a second": lambda motion: motion.resampled(LOW_FPS),
    "without jumps": lambda motion: without_jumps(motion)[0],
    "on the built-in dancers' skeleton": lambda motion: retarget(motion, canonical_skeleton()),
    "feet locked": lock_feet,
    "all of these, as a repertoire keeps it": _imported,
    f"smoothed, {MILD_S} s": _smoothed,
}


def recorded(dances: Path, lists: Path, street: Path) -> list[Recorded]:
    """The takes of dance-with-melody and ChoreoNet, and those of CMU, of no genre."""
    of_source = {
        SOURCES[0]: choreonet.annotate(list(import_takes(dances)), lists),
        SOURCES[1]: import_takes(lists),
    }
    found = [
        Recorded(take.name, take.credits.genre or "none", source, take.motion)
        for source, takes in of_source.items()
        for take in takes
    ]
    paths = [path for path in sorted(street.glob("*.npz")) if not path.name.startswith(OF_A_ROBOT)]
    return found + [Recorded(path.stem, "none", SOURCES[2], cg.load_motion(path)) for path in paths]


def of_a_robot(street: Path) -> list[Body]:
    """The takes of G1 Moves, of no genre."""
    found = []
    for path in sorted(street.glob(f"{OF_A_ROBOT}*.npz")):
        body, fps = street_body(path)
        found.append((path.stem, "none", SOURCES[3], body_pos_at(body, fps, NET_FPS)))
    return found


def on_skeleton(takes: Iterable[Recorded], repertoire: cg.Repertoire, target: Skeleton) -> list[Body]:
    """Real takes and those of a repertoire, all retargeted to one skeleton."""
    made = [
        Recorded(take.name, take.credits.genre, BUILT_IN, repertoire.motion(index)[0])
        for index, take in enumerate(repertoire.takes)
    ]
    return [take.body(retarget(take.motion.resampled(NET_FPS), target)) for take in (*takes, *made)]


def can_be_told(*sides: Windows) -> bool:
    """Whether both halves of every side have takes to train on and to test on."""
    return all(side.is_tested.any() and not side.is_tested.all() for side in sides)


def measured(first: Windows, second: Windows, seeds: int) -> tuple[float, float]:
    """Mean and spread of the AUC over the seeds of the network."""
    found = [auc(first, second, seed) for seed in range(seeds)]
    return float(np.mean(found)), float(np.std(found))


def of_sources(bodies: Sequence[Body], seeds: int) -> Iterable[Row]:
    """Each source told from all others that are real, and from each other one."""
    sides = {s: windows_of([b for b in bodies if b[2] == s]) for s in dict.fromkeys(b[2] for b in bodies)}
    for source, own in sides.items():
        rest = windows_of([b for b in bodies if b[2] not in (source, BUILT_IN)])
        yield f"{source} or the other real takes", *measured(rest, own, seeds)
    for one, other in combinations(sides, 2):
        yield f"{one} or {other}", *measured(sides[one], sides[other], seeds)


def of_genres(bodies: Sequence[Body], genres: Iterable[str], seeds: int) -> Iterable[Row]:
    """A genre of two sources, and a genre of a source told from the others of that source."""
    sources = list(dict.fromkeys(b[2] for b in bodies))
    for genre in genres:
        for one, other in combinations(sources, 2):
            takes = [[b for b in bodies if b[1:3] == (genre, source)] for source in (one, other)]
            if min(map(len, takes)) >= 2 * FEWEST:
                yield f"{genre}: {one} or {other}", *measured(*map(windows_of, takes), seeds)
        for source in sources:
            own = [b for b in bodies if b[2] == source and b[1] == genre]
            rest = [b for b in bodies if b[2] == source and b[1] not in (genre, "none")]
            if min(len(own), len(rest)) >= 2 * FEWEST:
                yield f"{source}: {genre} or others", *measured(windows_of(rest), windows_of(own), seeds)


def of_steps(takes: Sequence[Recorded], seeds: int) -> Iterable[Row]:
    """Takes told from themselves after each of `STEPS`."""
    before = windows_of([take.body() for take in takes])
    for what, step in STEPS.items():
        after = windows_of([take.body(step(take.motion)) for take in takes])
        yield what, *measured(before, after, seeds)


def of_halves(bodies: Sequence[Body], seeds: int) -> tuple[float, float]:
    """Takes told from other takes among the same ones, drawn at random for each seed."""
    found = []
    for seed in range(seeds):
        order = np.random.default_rng(seed).permutation(len(bodies))
        halves = [windows_of([bodies[i] for i in order[start::2]]) for start in (0, 1)]
        found.append(auc(*halves, seed) if can_be_told(*halves) else np.nan)
    return float(np.mean(found)), float(np.std(found))


def dances_of(repertoire: cg.Repertoire, songs: Iterable[tuple[str, str, Path]]) -> list[Body]:
    """Dances of the graph engine to songs, given by name, genre and path."""
    found = []
    for name, genre, path in songs:
        song = cg.load_song(path, duration_s=DANCE_S)
        dance = cg.dance(song, repertoire, genre=genre, seed=0)
        found.append((name, genre, "dance", body_pos_m(dance.motion.resampled(NET_FPS))))
    return found


def in_part(bodies: Sequence[Body], is_tested: bool) -> Windows:
    """The windows of takes that are all trained on, or all tested on."""
    windows = windows_of(bodies)
    return replace(windows, is_tested=np.full(len(windows.genre), is_tested))


def joined(*parts: Windows) -> Windows:
    """The windows of all parts."""
    names = ("velocity", "genre", "source", "is_tested")
    return Windows(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def of_dances(data: Path, takes: Sequence[Recorded], work: Path, seeds: int) -> tuple[float, float]:
    """Takes told from dances that are made of them: dances of takes to test are made of these alone."""
    sides: tuple[list[Windows], list[Windows]] = ([], [])
    for half in (0, 1):
        own = sorted(takes, key=lambda take: take.name)[half::2]
        folder, target = work / f"takes-{half}", work / f"real-{half}.h5"
        folder.mkdir(parents=True, exist_ok=True)
        for take in own:
            link = folder / take.name
            if not link.exists():
                link.symlink_to((data / take.name).resolve(), target_is_directory=True)
        if not target.exists():
            cg.build([folder], target, seed=0)
        songs = [
            (take.name, take.genre, data / take.name / "audio.mp3") for take in own[:: -(-len(own) // SONGS)]
        ]
        danced = dances_of(cg.Repertoire.open(target), songs)
        sides[0].append(in_part([take.body() for take in own], half == 1))
        sides[1].append(in_part(danced, half == 1))
    return measured(joined(*sides[0]), joined(*sides[1]), seeds)


def show(what: str, mean: float, spread: float) -> None:
    print(f"| {what} | {mean:.3f} ± {spread:.3f} |", flush=True)


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--built", type=Path, metavar="FOLDER", help="where two repertoires are built")
    given = parser.parse_args()
    repertoire = asked_repertoire(given)
    takes = recorded(given.dances, given.lists, given.street)
    made = built_in_takes(repertoire)
    bodies = [*(take.body() for take in takes), *of_a_robot(given.street), *made]
    for row in of_sources(bodies, given.seeds):
        show(*row)
    for row in of_sources(on_skeleton(takes, repertoire, canonical_skeleton()), given.seeds):
        show(f"on one skeleton: {row[0]}", *row[1:])
    genres = sorted({take.genre for take in takes} - {"none"})
    for row in of_genres(bodies, genres, given.seeds):
        show(*row)
    ours = [take for take in takes if take.source == SOURCES[0]]
    for row in of_steps(ours, given.seeds):
        show(*row)
    for source in (*SOURCES, BUILT_IN):
        show(f"{source} at random", *of_halves([b for b in bodies if b[2] == source], 2 * given.seeds))
    if given.built:
        row = of_dances(given.dances, ours, given.built, given.seeds)
        show(f"dances of {SOURCES[0]} or its takes", *row)


if __name__ == "__main__":
    main()
