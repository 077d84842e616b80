"""Checks of a caller's arguments: what they let through, and what they say in one line of the rest."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.arguments import (
    as_floats,
    as_index,
    as_list,
    as_number,
    as_texts,
    as_whole_numbers,
    check_choice,
    check_function,
    check_kind,
    is_number,
    is_whole,
    unexpected,
)
from choreograph.core.errors import ParameterError


def test_an_error_is_one_line_of_what_was_expected_and_given():
    assert str(unexpected("a take", [1.5], "a typo?")) == "expected a take, got [1.5]: a typo?"
    assert str(ParameterError("no plan at a\nb")) == "no plan at a b"
    assert len(str(unexpected("text", np.zeros((200, 200))))) < 100


@pytest.mark.parametrize("value", [0, -3, 1.5, np.float64(2)])
def test_numbers(value):
    assert is_number(value) and as_number("a number", value) == value


@pytest.mark.parametrize("value", [True, "1", None, np.nan, -np.inf, 10**400, 1j, np.float32("nan")])
def test_what_is_no_number(value):
    assert not is_number(value)
    with pytest.raises(ParameterError, match=r"^expected a number, got "):
        as_number("a number", value)


def test_numbers_of_numpy_and_limits():
    assert as_number("fps", np.float32(0.5), above=0.0) == 0.5
    with pytest.raises(ParameterError, match="expected fps above 0, got 0"):
        as_number("fps above 0", 0, above=0.0)


def test_an_index_lies_below_the_number_of_things():
    assert as_index("a clip", np.int32(2), 3) == 2 and is_whole(np.int64(7))
    for value in (3, -1, 1.0, True, "1", [0]):
        with pytest.raises(ParameterError, match="expected a clip as a whole number from 0 to 2, got "):
            as_index("a clip", value, 3)


def test_arrays_of_numbers_are_not_copied():
    floats, whole = np.zeros(3), np.arange(3)
    assert as_floats("frames", floats) is floats and as_whole_numbers("joints", whole) is whole
    np.testing.assert_array_equal(as_floats("frames", [1, 2.5]), [1.0, 2.5])
    np.testing.assert_array_equal(as_whole_numbers("joints", [1.0, 2]), [1, 2])


@pytest.mark.parametrize("values", ["12", ["1"], [None], [[1], [2, 3]], object(), 1j, [10**400], {}])
def test_what_is_no_array_of_numbers(values):
    for check in (as_floats, as_whole_numbers):
        with pytest.raises(ParameterError, match="expected frames as an array of numbers, got "):
            check("frames", values)


@pytest.mark.parametrize("values", [[0.5], [np.nan], [np.inf], [1e300]])
def test_what_is_no_array_of_whole_numbers(values):
    with pytest.raises(ParameterError, match="expected joints as whole numbers, got "):
        as_whole_numbers("joints", values)


def test_lists():
    assert as_texts("notes", iter(["a", "b"])) == ("a", "b")
    assert as_list("pins", (), "Pin", int) == ()
    for values in ("", "ab", b"ab", {}, 3, None):
        with pytest.raises(ParameterError, match="expected notes as a list of texts, got "):
            as_texts("notes", values)
    with pytest.raises(ParameterError, match=r"got 3$"):
        as_texts("notes", ["a", 3])
    with pytest.raises(ParameterError, match="a class instead of an instance"):
        as_list("costs", [ParameterError], "Cost", int)


def test_choices_kinds_and_functions():
    check_choice("a preset", "tiny", ("tiny", "small"))
    check_kind("words", True, bool)
    check_function("report", None)
    for check, said in (
        (lambda: check_choice("a preset", ["tiny"], ("tiny",)), "a preset among tiny, got "),
        (lambda: check_kind("words", "yes", bool), "words as True or False, got 'yes'"),
        (lambda: check_function("report", 3), "a function as report, got 3"),
    ):
        with pytest.raises(ParameterError, match=f"expected {said}"):
            check()
