"""Costs of where a path is: phrases that return in the music and in the dance, and places on the stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.layers import MIDDLE, Layer, Moments, positions
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import AnyFloats, AnyInts, Floats
from choreograph.core.timebase import NET_FPS
from choreograph.music.count_grids import SongGrid
from choreograph.music.form import Form, Phrase
from choreograph.music.song_features import SongFeatures
from choreograph.plan.joins import stage_half_m

_VARIED_COUNTS = 4  # at the end of what returns, where other music follows
_VARIED_WEIGHT = 0.5
SAME_FRAMES = 0.25 * NET_FPS  # largest distance of two positions in a take that are the same figure


@dataclass(frozen=True, eq=False)
class Returns:
    """The seconds of a song in which music returns, each with the moment that its middle returns to.

    A new phrase after one that returns is paired as well, with what followed there before (ABAC: C with the
    first B). A dance should not return there.
    """

    seconds: NDArray[np.int64]  # (R,) increasing
    first_s: Floats  # (R,) the moments, count by count
    is_return: NDArray[np.bool_]  # (R,) or else new music
    weights: Floats  # (R,) 1, and less at the end of what returns
    counts_later: NDArray[np.int64]  # (R,) from the moment to its return

    @classmethod
    def of(cls, form: Form, grid: SongGrid, is_planned: Callable[[float], bool]) -> Returns:
        """The returns of a song's phrases, by the grid of its beats, among the moments that are planned."""
        pairs: list[_Pair] = []
        labels = form.labels
        for number, phrase in enumerate(form.phrases):
            before = [other for other in range(number) if labels[other] == labels[number]]
            after = [other + 1 for other in range(number - 1) if labels[other] == labels[number - 1]]
            paired: dict[int, _Pair] = {}
            for other in before or after:
                ends = labels[number + 1 : number + 2] != labels[other + 1 : other + 2]
                for pair in _pairs(phrase, form.phrases[other], grid, is_planned, ends=ends):
                    paired.setdefault(pair.second, replace(pair, is_return=bool(before)))
            pairs += [paired[second] for second in sorted(paired)]
        return cls(
            np.array([pair.second for pair in pairs], np.int64),
            np.array([pair.first_s for pair in pairs], np.float64),
            np.array([pair.is_return for pair in pairs], bool),
            np.array([pair.weight for pair in pairs], np.float64),
            np.array([pair.counts_later for pair in pairs], np.int64),
        )

    def first_seconds(self, n_seconds: int) -> NDArray[np.int64]:
        """For every second (S,), the second that it returns to, or itself if its music is new."""
        firsts = np.arange(n_seconds)
        firsts[self.seconds[self.is_return]] = np.floor(self.first_s[self.is_return])
        return firsts

    def shifts(self, n_seconds: int, grid: SongGrid) -> Floats:
        """By how many counts (S,) every second begins later in its phrase than its `first_seconds`."""
        shifts = np.zeros(n_seconds)
        again = self.seconds[self.is_return]
        starts = grid.index_at(again.astype(np.float64))
        firsts = grid.index_at(np.floor(self.first_s[self.is_return]))
        shifts[again] = starts - self.counts_later[self.is_return] - firsts
        return shifts

    def moments(self, n_seconds: int) -> list[Moments]:
        """`Layer.moments` of every second."""
        moments: list[Moments] = [()] * n_seconds
        for number, first_s in enumerate(self.first_s):
            second = int(first_s)
            moments[second] = (*moments[second], (number, float(first_s - second)))
        return moments

    def returning(self, n_seconds: int) -> list[int | None]:
        """`Layer.returns` of every second."""
        returning: list[int | None] = [None] * n_seconds
        for number, second in enumerate(self.seconds):
            returning[second] = number
        return returning


@dataclass(frozen=True)
class _Pair:
    """A second, and the moment of an earlier phrase that its middle is compared with."""

    second: int
    first_s: float
    weight: float
    counts_later: int
    is_return: bool = True


def _pairs(
    phrase: Phrase, first: Phrase, grid: SongGrid, is_planned: Callable[[float], bool], *, ends: bool
) -> Iterator[_Pair]:
    """The pairs of a phrase with an earlier one. At its end, other music follows if it `ends`."""
    start, first_start, end = grid.index_at(np.array([phrase.start_s, first.start_s, phrase.end_s]))
    counts_later = round(start - first_start)
    for second in range(max(0, int(phrase.start_s)), int(phrase.end_s) + 1):
        middle_s = second + MIDDLE
        index = float(grid.index_at(np.array([middle_s]))[0])
        first_s = grid.time_at(index - counts_later)
        in_phrase = phrase.start_s <= middle_s < phrase.end_s and first_s < min(first.end_s, second)
        if in_phrase and is_planned(first_s) and is_planned(middle_s):
            weight = _VARIED_WEIGHT if ends and index >= end - _VARIED_COUNTS else 1.0
            yield _Pair(second, first_s, weight, counts_later)


class FormCost(Cost):
    """1 in each second whose music returns, unless it dances what the path danced there before (ours).

    It dances the same if it is at the same moment of the same take, within a quarter of a second. In the last
    four counts before other music, the cost is 0.5, so that a phrase may end in another way. A new phrase
    after one that returns has a cost of 1 in each second that dances what followed there before. A song
    without phrases that return has no such cost. Raise its weight if the dance should return more often.
    """

    name = "form"
    of_path = True
    min_path_cost = 0.0
    min_jump_cost = 0.0

    def __init__(self, returns: Returns) -> None:
        self.returns = returns

    def node(self, layer: Layer, song_features: SongFeatures) -> AnyFloats | None:
        if layer.second > 0:
            return None
        total = np.zeros(layer.n_nodes)
        for number, share in layer.moments:
            total += self._cost(number, layer.danced[:, number], positions(layer, share))
        return total

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats | None:
        total: NDArray[np.float32] | None = None
        for number, share in moments_of(next):
            danced = previous.danced[:, number]
            if np.isnan(danced).all():
                continue
            cost = self._cost(number, danced[:, None], positions(next, share))
            total = cost if total is None else total + cost
        return total

    def min_edge_costs(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        least = np.zeros(next.n_nodes)
        for number, share in moments_of(next):
            values = np.unique(previous.danced[:, number])
            least += self._cost(number, values[:, None], positions(next, share)).min(axis=0)
        return least

    def _cost(self, number: int, danced: AnyFloats, here: AnyFloats) -> NDArray[np.float32]:
        """The cost of positions at one end of a pair, by what is danced at the other. 0 if nothing is yet."""
        away = np.abs(danced - here)
        is_wrong = away > SAME_FRAMES if self.returns.is_return[number] else away <= SAME_FRAMES
        return np.float32(self.returns.weights[number]) * is_wrong.astype(np.float32)


def moments_of(layer: Layer) -> Moments:
    """The moments that a second is, and the one that it returns to."""
    return layer.moments if layer.returns is None else (*layer.moments, (layer.returns, MIDDLE))


# Places on a stage with borders, which follow from the path.


WALK_AT = 0.5, 1.0  # shares of the second at which the place on the stage is compared with its borders


class Stage(Cost):
    """How far the dancer leaves the stage along the path, in metres (ours).

    It is a mean over the second. The pelvis should stay 0.3 m within the borders, so that the feet do as
    well. A stage without borders has no such cost. Raise its weight if the dancer leaves the stage.
    """

    of_path = True
    min_path_cost = 0.0
    min_jump_cost = 0.0

    def __init__(self, size_m: tuple[float, float]) -> None:
        """The width and the depth of the stage in metres."""
        self._half_m = stage_half_m(size_m)

    def edge(self, previous: Layer, next: Layer, song_features: SongFeatures) -> AnyFloats:
        beyond_m: AnyFloats = beyond_stage_m(
            np.ascontiguousarray(previous.place_m), previous.turn_rad,
            np.ascontiguousarray(previous.join_heading_rad[:, 1]),
            np.ascontiguousarray(next.join_heading_rad[:, 0]), next.steer_rad, previous.next_part, next.part,
            np.ascontiguousarray(next.walk_m, np.float64), *self._half_m,
        )  # fmt: skip
        return beyond_m


@njit(
    "float32[:,::1](float64[:,::1], float64[::1], float32[::1], float32[::1], float64, int64[::1], "
    "int64[::1], float64[:,:,::1], float64, float64)",
    nogil=True,
)
def beyond_stage_m(
    place_m: AnyFloats,
    turn_rad: AnyFloats,
    end_rad: AnyFloats,
    start_rad: AnyFloats,
    steer_rad: float,
    next_part: AnyInts,
    part: AnyInts,
    walk_m: AnyFloats,
    half_width_m: float,
    half_depth_m: float,
) -> NDArray[np.float32]:  # pragma: no cover - compiled
    """How far N nodes that follow P nodes are outside of a stage, (P, N), as a mean over M places of each.

    The others end at `place_m` (P, 2). Each node moves by `walk_m` (N, M, 2), rotated as in `turned_costs`.
    """
    n_a, n_b, n_places = len(end_rad), len(start_rad), walk_m.shape[1]
    beyond = np.zeros((n_a, n_b), np.float32)
    for i in range(n_a):
        for j in range(n_b):
            turned = turn_rad[i]
            if next_part[i] != part[j]:
                turned = (turned + end_rad[i] - start_rad[j] + np.pi) % (2 * np.pi) - np.pi
                turned -= min(max(turned, -steer_rad), steer_rad)
            cosine, sine = np.cos(turned), np.sin(turned)
            total = 0.0
            for k in range(n_places):
                x = place_m[i, 0] + cosine * walk_m[j, k, 0] + sine * walk_m[j, k, 1]
                z = place_m[i, 1] + cosine * walk_m[j, k, 1] - sine * walk_m[j, k, 0]
                total += max(0.0, abs(x) - half_width_m, abs(z) - half_depth_m)
            beyond[i, j] = total / n_places
    return beyond
