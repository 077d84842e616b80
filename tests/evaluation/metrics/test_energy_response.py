"""Energy response: planted sections, chance, songs that do not tell, malformed input."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.energy_response import (
    evaluate,
    evaluate_chance,
    motion_size,
    pooled_response,
    response,
    section_loudness_db,
    section_means,
    soft_to_loud,
)
from choreograph.motion.body import BODY_JOINTS

FPS = 60.0
BODY = np.random.default_rng(0).normal(size=(len(BODY_JOINTS), 3))
BOUNDS_S = [0.0, 10.0, 20.0, 30.0, 40.0]
LOUDNESS_DB = [-6.0, 0.0, -12.0, -3.0]
DANCED_S = (0.0, 40.0)


def swinging(size: list[float], section_s: float = 10.0) -> np.ndarray:
    """A body whose joints swing, twice a second and so wide in each section, while it travels, (T, 21, 3)."""
    times_s = np.arange(round(len(size) * section_s * FPS)) / FPS
    width = np.repeat(size, round(section_s * FPS))
    swing = (1 + 0.1 * width * np.sin(4 * np.pi * times_s))[:, None, None] * (BODY - BODY[0])
    return swing + (times_s * times_s)[:, None, None] * np.array([0.1, 0.0, 0.0])


def test_perfect():
    pos = swinging([1.0, 1.6, 0.4, 1.3])  # in proportion to the level
    scores = evaluate(pos, FPS, DANCED_S, BOUNDS_S, LOUDNESS_DB)
    assert scores["energy_response"] == pytest.approx(1.0, abs=0.01)
    assert scores["soft_to_loud_speed"] == pytest.approx(0.25, abs=0.03)


def test_space():
    spread = np.cbrt(np.repeat([1.0, 1.6, 0.4, 1.3], 600))[:, None, None] * (BODY - BODY[0])
    scores = evaluate(spread, FPS, DANCED_S, BOUNDS_S, LOUDNESS_DB)
    assert scores["energy_response_space"] == pytest.approx(1.0, abs=0.01)
    assert scores["soft_to_loud_space"] == pytest.approx(0.25, abs=0.01)


def test_the_opposite_and_one_size():
    assert evaluate(swinging([1.0, 0.4, 1.6, 0.7]), FPS, DANCED_S, BOUNDS_S, LOUDNESS_DB)[
        "energy_response"
    ] == pytest.approx(-1.0, abs=0.01)
    still = np.tile(BODY, (2400, 1, 1))
    scores = evaluate(still, FPS, DANCED_S, BOUNDS_S, LOUDNESS_DB)
    assert scores["energy_response"] == 0.0 and np.isnan(scores["soft_to_loud_speed"])
    assert scores["soft_to_loud_space"] == pytest.approx(1.0)


def test_chance_is_none_however_well_the_dance_responds():
    pos = swinging([1.0, 1.6, 0.4, 1.3])
    chance = evaluate_chance(pos, FPS, DANCED_S, BOUNDS_S, LOUDNESS_DB)
    assert abs(chance["energy_response"]) < 0.1
    assert 0.9 < chance["soft_to_loud_speed"] < 1.6  # a mean of ratios is above 1
    assert chance == evaluate_chance(pos, FPS, DANCED_S, BOUNDS_S, LOUDNESS_DB)


def test_travelling_is_no_size():
    speed, space = motion_size(swinging([0.0]), FPS)
    assert speed == pytest.approx(0.0, abs=1e-6) and np.ptp(space) < 1e-3
    assert len(speed) == len(space) == 200
    assert motion_size(swinging([1.0])[:1], FPS)[0] == [0.0]


def test_held_poses_and_sections_that_are_hardly_danced_do_not_count():
    values = np.concatenate([np.zeros(40), np.ones(360), np.zeros(400)])  # 2 s held, danced to 20 s
    means = section_means(values, BOUNDS_S, (2.0, 20.0))
    assert means[:2] == pytest.approx([1.0, 1.0]) and np.isnan(means[2:]).all()
    assert np.isnan(section_means(values, [0.0, 4.0, 5.0, 30.0], (2.0, 20.0))).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("loudness_db", "size"),
    [
        ([], []),
        ([0.0, -9.0], [1.0, 0.5]),  # two sections
        ([0.0, -1.0, -1.9], [1.0, 0.9, 0.5]),  # of one loudness
        ([0.0, -9.0, -3.0], [1.0, float("nan"), 0.7]),
    ],
)
def test_songs_that_do_not_tell(loudness_db, size):
    assert np.isnan(response(loudness_db, size)) and np.isnan(soft_to_loud(loudness_db, size))
    assert np.isnan(pooled_response([(np.array(loudness_db), np.array(size))]))


def test_an_empty_song_and_one_without_sections():
    scores = evaluate(swinging([1.0]), FPS, (0.0, 10.0), [], [])
    assert len(scores) == 4 and np.isnan(list(scores.values())).all()
    assert np.isnan(list(evaluate_chance(swinging([1.0]), FPS, (0.0, 10.0), [], []).values())).all()


def test_pooled_songs_are_centred_and_scaled_each():
    quiet = (np.array([-30.0, -20.0, -25.0]), np.array([1.0, 3.0, 2.0]))
    loud = (np.array([-10.0, 0.0, -5.0]), np.array([0.1, 0.3, 0.2]))
    assert pooled_response([quiet, loud]) == pytest.approx(1.0)
    against = (loud[0], loud[1][::-1])
    assert pooled_response([quiet, (loud[0], np.array([0.3, 0.1, 0.2]))]) == pytest.approx(0.0, abs=1e-9)
    assert pooled_response([quiet, against]) < 1.0


def test_loudness():
    rng = np.random.default_rng(0)
    samples = np.concatenate([0.1 * rng.normal(size=1000), 0.01 * rng.normal(size=1000), np.zeros(1000)])
    assert section_loudness_db(samples, 100.0, [0.0, 10.0, 20.0, 30.0, 40.0]) == pytest.approx(
        [-20.0, -40.0, -60.0, -60.0], abs=0.5
    )
    assert len(section_loudness_db(samples, 100.0, [])) == 0


@pytest.mark.parametrize(
    ("danced_s", "bounds_s", "loudness_db"),
    [
        (DANCED_S, [0.0, 10.0], [0.0, 0.0]),
        (DANCED_S, [0.0, 10.0, 10.0], [0.0, 0.0]),
        (DANCED_S, [0.0, 10.0], [float("nan")]),
        (DANCED_S, [[0.0, 10.0]], [0.0]),
        (DANCED_S, [], [0.0]),
        ((5.0, 5.0), [0.0, 10.0], [0.0]),
        ((0.0, float("nan")), [0.0, 10.0], [0.0]),
    ],
)
def test_malformed(danced_s, bounds_s, loudness_db):
    with pytest.raises(ParameterError):
        evaluate(swinging([1.0]), FPS, danced_s, bounds_s, loudness_db)


def test_malformed_sizes():
    with pytest.raises(ParameterError):
        response([0.0, 1.0, 2.0], [0.0, 1.0])


@given(st.lists(st.tuples(st.floats(-40, 0), st.floats(0.01, 2)), min_size=3, max_size=8), st.floats(-20, 20))
def test_gain_and_scale_do_not_matter(sections, gain_db):
    loudness_db, size = (np.array(column) for column in zip(*sections, strict=True))
    plain = response(loudness_db, size)
    if np.isnan(plain):
        return
    assert -1 - 1e-9 <= plain <= 1 + 1e-9
    assert response(loudness_db + gain_db, 3 * size) == pytest.approx(plain, abs=1e-4)
