"""Returns: dances that repeat with their song, that never repeat, and that repeat elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import phrase_returns
from choreograph.motion.body import body_pos_m

PHRASE_S = 4.0
FPS = 20.0


def spans(n: int) -> np.ndarray:
    starts_s = PHRASE_S * np.arange(n)
    return np.stack([starts_s, starts_s + PHRASE_S], axis=1)


def pieces(*source_starts_s: float) -> np.ndarray:
    """One piece for each phrase, from these times of its take."""
    source = np.array(source_starts_s)
    return np.hstack([spans(len(source)), np.stack([source, source + PHRASE_S], axis=1)])


def danced(letters: str) -> np.ndarray:
    """Body positions (T, 21, 3) of a dance with other steps for each letter."""
    n = round(PHRASE_S * FPS)
    parts = {
        letter: body_pos_m(stepping(n, fps=FPS, period_s=0.5 + 0.1 * i, seed=i))
        for i, letter in enumerate(sorted(set(letters)))
    }
    return np.concatenate([parts[letter] for letter in letters])


@pytest.fixture(scope="module")
def scores():
    """Scores of a dance for the form ABAB, by what is danced."""
    sources = {"a": 0.0, "b": 10.0, "c": 20.0, "d": 30.0}

    def of(letters: str) -> dict[str, float]:
        return phrase_returns.evaluate(
            danced(letters), FPS, ["take"] * len(letters), pieces(*(sources[letter] for letter in letters)),
            phrases_s=spans(len(letters)), labels="ABAB",
        )  # fmt: skip

    return {letters: of(letters) for letters in ("abab", "abcd", "aabb", "aaaa")}


def test_a_dance_that_returns_with_its_song_is_perfect(scores):
    perfect = scores["abab"]
    assert perfect["return_distance_m"] == pytest.approx(0.0, abs=1e-9)
    assert perfect["other_distance_m"] > 0.01
    assert perfect["return_distance_ratio"] == pytest.approx(0.0, abs=1e-6)
    assert (perfect["returned_share"], perfect["returned_share_chance"]) == (1.0, 0.0)
    assert perfect["shared_between_sections"] == 0.0


def test_a_dance_that_never_returns_scores_as_by_chance(scores):
    medley = scores["abcd"]
    assert medley["return_distance_ratio"] > 0.5
    assert medley["returned_share"] == medley["returned_share_chance"] == 0.0


def test_a_dance_that_repeats_elsewhere_is_no_better(scores):
    wrong = scores["aabb"]
    assert wrong["returned_share"] == 0.0
    assert wrong["return_distance_ratio"] > 1.0
    assert wrong["returned_share_chance"] == pytest.approx(0.5)
    assert wrong["shared_between_sections"] == 1.0


def test_one_phrase_over_and_over_returns_by_chance(scores):
    same = scores["aaaa"]
    assert same["returned_share"] == same["returned_share_chance"] == same["shared_between_sections"] == 1.0
    assert np.isnan(same["return_distance_ratio"])


def test_place_and_heading_do_not_count():
    body = danced("ab")
    turned = body @ np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]) + [2.0, 0.0, 1.0]
    distances_m = phrase_returns.pose_distances_m(np.concatenate([body, turned]), FPS, spans(4))
    assert distances_m[0, 2] < 1e-6 < distances_m[0, 1]
    assert np.allclose(distances_m, distances_m.T)


def test_moments_within_a_quarter_of_a_second_are_the_same():
    shares = [
        phrase_returns.same_shares(["t", "t"], pieces(0.0, shift_s), spans(2))[0, 1] for shift_s in (0.2, 0.3)
    ]
    assert shares == [1.0, 0.0]
    assert phrase_returns.same_shares(["t", "u"], pieces(0.0, 0.0), spans(2))[0, 1] == 0.0


def test_without_returns_or_other_phrases_there_is_no_value():
    values = np.zeros((3, 3))
    assert np.isnan(phrase_returns.return_mean(values, "ABC"))
    assert np.isnan(phrase_returns.other_mean(values, "AAA"))


@pytest.mark.parametrize(
    ("phrases_s", "labels"),
    [
        (np.zeros((0, 2)), ""),
        (spans(2), "A"),
        (spans(2)[::-1], "AB"),
        (np.array([[0.0, 1.0], [0.5, 2.0]]), "AB"),
        (np.array([[0.0, np.nan]]), "A"),
    ],
)
def test_malformed_phrases_are_refused(phrases_s, labels):
    with pytest.raises(ParameterError, match=r"expected .*phrases"):
        phrase_returns.validate(phrases_s, labels)
    with pytest.raises(ParameterError, match=r"expected .*phrases"):
        phrase_returns.shared_between_sections(["t"], pieces(0.0), phrases_s, labels)


def test_malformed_values_are_refused():
    with pytest.raises(ParameterError, match=r"expected finite values \(2, 2\)"):
        phrase_returns.return_mean(np.zeros((2, 3)), "AB")
    with pytest.raises(ParameterError, match=r"expected finite values \(2, 2\)"):
        phrase_returns.other_mean(np.full((2, 2), np.nan), "AB")
    with pytest.raises(ParameterError, match="body positions"):
        phrase_returns.pose_distances_m(np.zeros((10, 3)), FPS, spans(2))
