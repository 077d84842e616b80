"""Liveliness: planted ways and widths, playback speed, genres apart, takes too short."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.motion_beats import (
    genre_sizes,
    liveliness_ranks,
    travel_and_width,
    travel_and_width_sums,
)

BODY = np.random.default_rng(0).normal(size=(len(BODY_JOINTS), 3))
STARTS = np.arange(20, 160, 20)  # smoothing slows the ends of a take


class Liveliness:
    """The ranks of seconds of these takes in their genres."""

    def __init__(self, takes: list[np.ndarray], genres: list[str]) -> None:
        sums = [travel_and_width_sums(one) for one in takes]
        self.stops = np.cumsum([len(one) for one in sums])
        self.sums = np.concatenate(sums)
        names, self.genre = np.unique(genres, return_inverse=True)
        self.sizes = [
            genre_sizes([sums[i] for i in np.flatnonzero(self.genre == g)]) for g in range(len(names))
        ]

    def ranks(self, take: np.ndarray, start: np.ndarray, stop: np.ndarray) -> np.ndarray:
        first = np.append(0, self.stops)[take]
        measured = travel_and_width(lambda r: self.sums[r], first, self.stops[take] - 1, start, stop)
        return liveliness_ranks(measured, self.genre[take], self.sizes)


def take(speed_m_s: float, width: float = 1.0, length_s: int = 10) -> np.ndarray:
    """A body of this width that slides at an even speed, (T, 21, 3) at 20 fps."""
    times_s = np.arange(length_s * NET_FPS) / NET_FPS
    return width * BODY + (speed_m_s * times_s)[:, None, None] * np.array([0.0, 0.0, 1.0])


def ranks_of(liveliness: Liveliness, index: int, speed: float = 1.0) -> np.ndarray:
    return liveliness.ranks(np.full(len(STARTS), index), STARTS, STARTS + 20.0 * speed)


def test_faster_takes_of_a_genre_rank_higher():
    liveliness = Liveliness([take(0.2), take(0.5), take(0.9)], ["waltz"] * 3)
    slow, middle, fast = (ranks_of(liveliness, i).mean() for i in range(3))
    assert slow < 0.2 and 0.3 < middle < 0.7 and fast > 0.6


def test_wider_takes_of_a_genre_rank_higher():
    liveliness = Liveliness([take(0.5, 0.5), take(0.5, 1.5)], ["waltz"] * 2)
    assert ranks_of(liveliness, 0).max() <= 0.5 < ranks_of(liveliness, 1).mean()


def test_a_take_played_faster_is_livelier():
    liveliness = Liveliness([take(0.4), take(0.5)], ["waltz"] * 2)
    assert (ranks_of(liveliness, 0, 1.5) == 1.0).all()
    assert (ranks_of(liveliness, 1, 0.5) == 0.0).all()


def test_genres_are_ranked_apart():
    liveliness = Liveliness([take(0.2), take(0.3), take(2.0), take(3.0)], ["slow"] * 2 + ["fast"] * 2)
    assert ranks_of(liveliness, 1).mean() == pytest.approx(ranks_of(liveliness, 3).mean(), abs=0.1)
    assert ranks_of(liveliness, 2).mean() < 0.5 < ranks_of(liveliness, 1).mean()


def test_ranks_are_spread_evenly():
    rng = np.random.default_rng(1)
    walk = np.cumsum(rng.exponential(0.05, 2000))[:, None, None] * np.array([0.0, 0.0, 1.0]) + BODY
    starts = np.arange(0, 1980)
    ranks = Liveliness([walk], ["waltz"]).ranks(np.zeros(len(starts), int), starts, starts + 20.0)
    np.testing.assert_allclose(np.quantile(ranks, [0.1, 0.5, 0.9]), [0.1, 0.5, 0.9], atol=0.02)


@pytest.mark.parametrize("takes", [[take(0.5)[:1]], [take(0.5)[:20], take(1.0)[:2]]])
def test_takes_shorter_than_a_second_rank_in_the_middle(takes):
    liveliness = Liveliness(takes, ["waltz"] * len(takes))
    assert liveliness.ranks(np.array([0]), np.array([0.0]), np.array([20.0])) == [0.5]


def test_beyond_a_take_its_last_pose_is_held():
    liveliness = Liveliness([take(0.5), take(0.6)], ["waltz"] * 2)
    assert liveliness.ranks(np.array([0]), np.array([300.0]), np.array([320.0])) == [0.0]
