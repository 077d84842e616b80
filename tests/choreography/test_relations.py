"""Relations: what is read, and the parts of each dancer."""

from __future__ import annotations

import pytest

from choreograph.choreography.scenes import CALM, Relation, dancer_parts, is_mirrored, n_counts, pair_of
from choreograph.core.errors import ParameterError

BEATS_S = tuple(0.5 * beat for beat in range(1, 60))
BOUNDS_S = (0.0, 8.0, 16.0, 24.0)


def parts(dancer: int, *relations: str, n: int = 4):
    read = [Relation.parse(text) for text in relations]
    return dancer_parts(dancer, n, read, BOUNDS_S[: len(read) + 1], BEATS_S, 0.5)


@pytest.mark.parametrize(
    "text", ["", "canon", "canon:0", "canon:33", "canon:-1", "canon:2s", "duet", "unison:2"]
)
def test_another_relation_is_refused(text):
    with pytest.raises(ParameterError, match="expected a relation among unison, mirror, canon:N"):
        Relation.parse(text)


def test_sides_and_pairs():
    assert [is_mirrored(dancer, 4) for dancer in range(4)] == [False, True, False, True]
    assert [is_mirrored(dancer, 5) for dancer in range(5)] == [False, False, True, False, True]
    assert [pair_of(dancer, 4) for dancer in range(4)] == [0, 0, 1, 1]
    assert [pair_of(dancer, 5) for dancer in range(5)] == [0, 1, 1, 2, 2]


def test_equal_spans_are_one_part():
    (part,) = parts(3, "unison", "unison", "unison")
    assert (part.start_s, part.end_s, part.dance, part.delay_counts, part.mirrored) == (
        0.0,
        24.0,
        0,
        0,
        False,
    )
    assert parts(1, "mirror")[0].mirrored and not parts(2, "mirror")[0].mirrored
    assert [part.dance for part in parts(2, "free", "unison")] == [2, 0]


def test_a_canon_from_the_start_is_one_part():
    assert [parts(dancer, "canon:3")[0].delay_counts for dancer in range(4)] == [0, 0, 3, 3]


def test_a_later_canon_waits_for_its_count():
    before, waits, behind = parts(2, "unison", "canon:3")
    assert before.end_s == waits.start_s == 8.0 and waits.held
    assert waits.end_s == pytest.approx(9.5) and behind.delay_counts == 3 and not behind.held


def test_an_answer_is_the_call_a_phrase_later():
    caller = parts(0, "call-and-response", "call-and-response")
    answer = parts(1, "call-and-response", "call-and-response")
    assert [part.size for part in caller] == [1.0, CALM]
    assert [part.size for part in answer] == [CALM, 1.0]
    assert answer[1].delay_counts == 16 and caller[1].delay_counts == 0


def test_counts_without_beats_last_half_a_second():
    assert n_counts((), 1.0, 3.0) == n_counts((2.0,), 1.0, 3.0) == 4
