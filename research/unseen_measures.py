"""A test of the built-in dancers by measures that nothing was fitted to.

    python -m research.unseen_measures DANCE_WITH_MELODY CHOREONET STREET [--repertoire REP]
    python -m research.unseen_measures DANCE_WITH_MELODY CHOREONET STREET --set first --each first
    python -m research.unseen_measures DANCE_WITH_MELODY CHOREONET STREET --real-only

The built-in takes were fitted to all recorded takes and to all measures of `choreograph inspect --movement`,
so that neither is a clean test. The measures of each set here were written afterwards, all at once, before a
value of any of them was known for the built-in takes. A cell is a measure of a genre. It is inside if
its median lies between the 5th and the 95th percentile of windows of real takes, of the genre where there are
enough. The same is done with the real takes themselves: each second take of a genre beside the others.

The values of the first set are known, and the dancers were changed after them. The second set stays a clean
test for as long as only its shares are read. So single cells are printed only with `--each`, and nobody who
changes the dancers may ask for those of the second set.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.movement import ALL_REAL, Range, Window, windows_of
from choreograph.formats import choreonet
from choreograph.formats.register import import_takes
from choreograph.motion.body import body_pos_at, body_pos_m
from research.first_unseen_measures import FIRST
from research.movement_ranges import FEWEST_WINDOWS, OF_A_ROBOT, street_body, weighted_range
from research.real_or_built_in import arguments, asked_repertoire
from research.second_unseen_measures import SECOND

SETS = {"first": FIRST, "second": SECOND}
Values = dict[str, dict[str, list[float]]]  # by genre and measure


def measures_of(sets: Iterable[str], *, is_robot: bool = False) -> dict[str, Callable[[Window], float]]:
    """The measures of sets by name."""
    return {name: measure for s in sets for name, measure in SETS[s].of(is_robot=is_robot).items()}


def values_of(
    windows: Iterable[Window], sets: Iterable[str] = SETS, *, is_robot: bool = False
) -> dict[str, list[float]]:
    """The values of the measures of sets in windows, by name."""
    measures = measures_of(sets, is_robot=is_robot)
    values: dict[str, list[float]] = defaultdict(list)
    for window in windows:
        for name, measure in measures.items():
            value = measure(window)
            if np.isfinite(value):
                values[name].append(value)
    return values


def real_values(
    dances: Path, lists: Path, street: Path, sets: Iterable[str]
) -> dict[str, tuple[str, dict[str, list[float]]]]:
    """The genre and the values of every real take, by name."""
    found = {}
    for take in [*choreonet.annotate(list(import_takes(dances)), lists), *import_takes(lists)]:
        windows = windows_of(body_pos_m(take.motion.resampled(NET_FPS)), take.counts)
        found[take.name] = (take.credits.genre or "none", values_of(windows, sets))
    for path in sorted(street.glob("*.npz")):
        body, fps = street_body(path)
        is_robot = path.name.startswith(OF_A_ROBOT)
        windows = windows_of(body_pos_at(body, fps, NET_FPS))
        found[path.stem] = ("street", values_of(windows, sets, is_robot=is_robot))
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
    for name in measures_of(SETS):
        enough = {g: own[name] for g, own in values.items() if len(own.get(name, ())) >= FEWEST_WINDOWS}
        for genre, own in enough.items():
            if genre not in ("none", "street"):
                ranges[genre][name] = weighted_range(np.array(own), np.ones(len(own)))
        weights = [np.full(len(own), 1.0 / len(own)) for own in enough.values()]
        if enough:
            together = np.concatenate(list(map(np.array, enough.values())))
            ranges[ALL_REAL][name] = weighted_range(together, np.concatenate(weights))
    return ranges


def show(
    what: str,
    values: Values,
    ranges: Mapping[str, Mapping[str, Range]],
    sets: Iterable[str],
    each: Iterable[str] = (),
) -> None:
    """Print the shares of cells inside by set, and the cells outside of the sets of `each`."""
    for which in sets:
        inside: dict[bool, list[bool]] = {True: [], False: []}  # of an own range, or of all
        outside: list[str] = []
        for genre, own in sorted(values.items()):
            for name in measures_of([which]):
                real = ranges.get(genre, {}).get(name)
                is_own = real is not None
                real = real or ranges[ALL_REAL].get(name)
                if real is None or not own.get(name):
                    continue
                value = float(np.median(own[name]))
                inside[is_own].append(real.holds(value))
                if not real.holds(value):
                    outside.append(f"{genre}: {name} {value:.3g}, real {real.low:.3g} to {real.high:.3g}")
        together = inside[True] + inside[False]
        print(
            f"{what}, {SETS[which].title}: {np.mean(together):.2f} of {len(together)} cells inside, "
            f"own genre {np.mean(inside[True] or [np.nan]):.2f} of {len(inside[True])}"
        )
        for cell in outside if which in each else ():
            print(f"  {cell}")


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--set", choices=SETS, action="append", dest="sets", help="default: both")
    parser.add_argument(
        "--each", choices=SETS, action="append", default=[], help="print the cells outside of this set"
    )
    parser.add_argument("--real-only", action="store_true", help="only real takes beside other real takes")
    given = parser.parse_args()
    sets = given.sets or list(SETS)
    takes = real_values(given.dances, given.lists, given.street, sets)
    names = sorted(takes)
    halves = [by_genre(takes[name] for name in names[start::2]) for start in (0, 1)]
    show("real takes beside other real takes", halves[1], ranges_of(halves[0]), sets)
    if given.real_only:
        return
    repertoire = asked_repertoire(given)
    made = by_genre(
        (info.credits.genre, values_of(windows_of(repertoire.body_pos_m(i), repertoire.counts(i)), sets))
        for i, info in enumerate(repertoire.takes)
    )
    show("the repertoire", made, ranges_of(by_genre(takes.values())), sets, given.each)


if __name__ == "__main__":
    main()
