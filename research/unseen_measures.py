"""A test of the built-in dancers by measures that nothing was fitted to.

    python -m research.unseen_measures DANCE_WITH_MELODY CHOREONET STREET [--repertoire REP]

The built-in takes were fitted to all recorded takes and to all measures of `choreograph inspect --movement`,
so that neither is a clean test. The measures here were written afterwards, all at once, before a value
of any of them was known, and nothing was changed after them. A cell is a measure of a genre. It is inside if
its median lies between the 5th and the 95th percentile of windows of real takes, of the genre where there are
enough. The same is done with the real takes themselves: each second take of a genre beside the others.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.movement import ALL_REAL, Range
from choreograph.evaluation.movement_measures import Window, windows_of
from choreograph.formats import choreonet
from choreograph.formats.register import import_takes
from choreograph.motion.body import body_pos_at, body_pos_m
from research.movement_ranges import FEWEST_WINDOWS, OF_A_ROBOT, street_body, weighted_range
from research.real_or_built_in import arguments, asked_repertoire

SLOW_M_S = 0.15
Values = dict[str, dict[str, list[float]]]  # by genre and measure


def between_feet_m(window: Window) -> np.ndarray:
    """From the right foot to the left one in the frame of the dancer, (T, 3)."""
    return window.facing_joint("left_foot") - window.facing_joint("right_foot")


def speed_m_s(window: Window, joint: str, of: str = "") -> np.ndarray:
    """Speed of both sides of a joint, or relative to another one, (2, T - 1)."""
    pos = window.sides(joint) - (window.sides(of) if of else 0.0)
    return np.linalg.norm(np.diff(pos, axis=1), axis=-1) * NET_FPS


def pelvis_m(window: Window) -> np.ndarray:
    return gaussian_filter1d(window.joint("pelvis"), 0.05 * NET_FPS, axis=0)


def turned_out_deg(window: Window) -> np.ndarray:
    """How far the feet point outwards from the heading, (2, T)."""
    found = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        way = window.facing_joint(f"{side}_foot") - window.facing_joint(f"{side}_ankle")
        found.append(sign * np.degrees(np.arctan2(way[:, 0], way[:, 2])))
    return np.array(found)


def intervals_spread(window: Window) -> float:
    """Spread of the times between landings of feet, by their mean."""
    lands = [np.flatnonzero(np.diff(side.astype(np.int8)) == 1) for side in window.contacts.T]
    between = np.diff(np.sort(np.concatenate(lands)))
    between = between[between > 1]
    return float(between.std() / between.mean()) if len(between) > 2 else float("nan")


def shoulders_yaw_deg(window: Window) -> np.ndarray:
    across = window.joint("left_shoulder") - window.joint("right_shoulder")
    yaw = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    return yaw - uniform_filter1d(yaw, 2 * NET_FPS, mode="nearest")


def pelvis_aside_m(window: Window) -> np.ndarray:
    """The pelvis to the left of the middle of the feet, (T,)."""
    middle = 0.5 * (window.facing_joint("left_foot") + window.facing_joint("right_foot"))
    return window.facing_joint("pelvis")[:, 0] - middle[:, 0]


def wrists_apart_m(window: Window) -> np.ndarray:
    return np.linalg.norm(window.joint("left_wrist") - window.joint("right_wrist"), axis=-1)


def sides_differ(values: np.ndarray) -> float:
    """How far the mean of the left side (2, T) is from that of the right one, as a logarithm of the ratio."""
    left, right = values.mean(axis=1)
    return float(abs(np.log(max(left, 1e-3) / max(right, 1e-3))))


def spread_95(values: np.ndarray) -> float:
    return float(np.percentile(values, 95) / max(float(np.median(values)), 1e-3))


# Of legs and pelvis, also of a robot.
OF_LEGS: dict[str, Callable[[Window], float]] = {
    "pelvis below its highest, median, m": lambda w: float(
        np.percentile(w.joint("pelvis")[:, 1], 95) - np.median(w.joint("pelvis")[:, 1])
    ),
    "acceleration of the pelvis, 95th percentile, m/s²": lambda w: float(
        np.percentile(np.linalg.norm(np.diff(pelvis_m(w), 2, axis=0), axis=-1), 95) * NET_FPS**2
    ),
    "speed of the feet, median, m/s": lambda w: float(np.median(speed_m_s(w, "foot"))),
    "speed of the feet, 95th percentile, m/s": lambda w: float(np.percentile(speed_m_s(w, "foot"), 95)),
    "no foot stands, share": lambda w: float((~w.contacts).all(axis=1).mean()),
    "times between landings, spread": intervals_spread,
    "a foot before the other, sd, m": lambda w: float(between_feet_m(w)[:, 2].std()),
    "a foot beside the other, sd, m": lambda w: float(between_feet_m(w)[:, 0].std()),
    "pelvis aside of the feet, sd, m": lambda w: float(pelvis_aside_m(w).std()),
    "one leg faster than the other": lambda w: sides_differ(speed_m_s(w, "foot")),
    "speed of the knees from the hips, median, m/s": lambda w: float(np.median(speed_m_s(w, "knee", "hip"))),
    "body is slow, share": lambda w: float((w.speed_m_s < SLOW_M_S).mean()),
}
# Of a body with trunk, head, arms and feet.
OF_BODIES: dict[str, Callable[[Window], float]] = {
    "feet turned out, median, °": lambda w: float(np.median(turned_out_deg(w))),
    "feet turned out, sd, °": lambda w: float(turned_out_deg(w).std(axis=1).mean()),
    "shoulder yaw, sd, °": lambda w: float(shoulders_yaw_deg(w).std()),
    "head beside the pelvis, median, m": lambda w: float(
        np.median(np.linalg.norm((w.joint("head") - w.joint("pelvis"))[:, [0, 2]], axis=-1))
    ),
    "head speed over pelvis speed, median": lambda w: float(
        np.median(np.linalg.norm(np.diff(w.joint("head"), axis=0), axis=-1))
        / max(float(np.median(np.linalg.norm(np.diff(w.joint("pelvis"), axis=0), axis=-1))), 1e-4)
    ),
    "wrists apart, median, m": lambda w: float(np.median(wrists_apart_m(w))),
    "wrists apart, sd, m": lambda w: float(wrists_apart_m(w).std()),
    "wrist before the shoulder, median, m": lambda w: float(np.median(w.wrists_m[..., 2])),
    "wrist before the shoulder, sd, m": lambda w: float(w.wrists_m[..., 2].std(axis=1).mean()),
    "speed of the elbows from the shoulders, 95th percentile over median": lambda w: spread_95(
        speed_m_s(w, "elbow", "shoulder")
    ),
    "one arm faster than the other": lambda w: sides_differ(w.wrist_speed_m_s),
    "elbow below the shoulder, median, m": lambda w: float(
        np.median(w.sides("shoulder")[..., 1] - w.sides("elbow")[..., 1])
    ),
}
UNSEEN = OF_LEGS | OF_BODIES


def values_of(windows: Iterable[Window], *, is_robot: bool = False) -> dict[str, list[float]]:
    """The values of all unseen measures in windows, by name."""
    values: dict[str, list[float]] = defaultdict(list)
    for window in windows:
        for name, measure in (OF_LEGS if is_robot else UNSEEN).items():
            value = measure(window)
            if np.isfinite(value):
                values[name].append(value)
    return values


def real_values(dances: Path, lists: Path, street: Path) -> dict[str, tuple[str, dict[str, list[float]]]]:
    """The genre and the values of every real take, by name."""
    found = {}
    for take in [*choreonet.annotate(list(import_takes(dances)), lists), *import_takes(lists)]:
        windows = windows_of(body_pos_m(take.motion.resampled(NET_FPS)), take.counts)
        found[take.name] = (take.credits.genre or "none", values_of(windows))
    for path in sorted(street.glob("*.npz")):
        body, fps = street_body(path)
        is_robot = path.name.startswith(OF_A_ROBOT)
        windows = windows_of(body_pos_at(body, fps, NET_FPS))
        found[path.stem] = ("street", values_of(windows, is_robot=is_robot))
    return found


def by_genre(takes: Iterable[tuple[str, Mapping[str, list[float]]]]) -> Values:
    values: Values = defaultdict(lambda: defaultdict(list))
    for genre, of_take in takes:
        for name, own in of_take.items():
            values[genre][name] += own
    return values


def ranges_of(values: Values) -> dict[str, dict[str, Range]]:
    """Ranges of each genre, and of all with equal weights, where there are enough windows."""
    ranges: dict[str, dict[str, Range]] = defaultdict(dict)
    for name in UNSEEN:
        enough = {g: own[name] for g, own in values.items() if len(own.get(name, ())) >= FEWEST_WINDOWS}
        for genre, own in enough.items():
            if genre not in ("none", "street"):
                ranges[genre][name] = weighted_range(np.array(own), np.ones(len(own)))
        weights = [np.full(len(own), 1.0 / len(own)) for own in enough.values()]
        if enough:
            together = np.concatenate(list(map(np.array, enough.values())))
            ranges[ALL_REAL][name] = weighted_range(together, np.concatenate(weights))
    return ranges


def show(what: str, values: Values, ranges: Mapping[str, Mapping[str, Range]], *, each: bool = False) -> None:
    """Print the shares of cells inside, and with `each` the cells outside."""
    inside: dict[bool, list[bool]] = {True: [], False: []}  # of an own range, or of all
    for genre, own in sorted(values.items()):
        for name in UNSEEN:
            real = ranges.get(genre, {}).get(name)
            is_own = real is not None
            real = real or ranges[ALL_REAL].get(name)
            if real is None or not own.get(name):
                continue
            value = float(np.median(own[name]))
            inside[is_own].append(real.holds(value))
            if each and not real.holds(value):
                print(f"  {genre}: {name} {value:.3g}, real {real.low:.3g} to {real.high:.3g}")
    together = inside[True] + inside[False]
    print(
        f"{what}: {np.mean(together):.2f} of {len(together)} cells inside, "
        f"own genre {np.mean(inside[True]):.2f} of {len(inside[True])}"
    )


def main() -> None:
    parser = arguments(__doc__)
    given = parser.parse_args()
    takes = real_values(given.dances, given.lists, given.street)
    repertoire = asked_repertoire(given)
    made = by_genre(
        (info.credits.genre, values_of(windows_of(repertoire.body_pos_m(i), repertoire.counts(i))))
        for i, info in enumerate(repertoire.takes)
    )
    names = sorted(takes)
    halves = [by_genre(takes[name] for name in names[start::2]) for start in (0, 1)]
    show("real takes beside other real takes", halves[1], ranges_of(halves[0]))
    show("the repertoire", made, ranges_of(by_genre(takes.values())), each=True)


if __name__ == "__main__":
    main()
