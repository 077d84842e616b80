"""A memory computes a value once for inputs of the same content, and again for any other content."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from choreograph.core.numerics import NO_MEMORY, Memory, digest, rows_from

plain = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary()
some_arrays = arrays.arrays(
    st.sampled_from([np.float32, np.int64, bool]), arrays.array_shapes(min_side=0, max_side=3)
)
contents = st.recursive(plain | some_arrays, lambda inner: st.lists(inner, max_size=3), max_leaves=6)


@dataclass(frozen=True, eq=False)
class Inputs:
    number: int
    values: np.ndarray


def written(content: object) -> str:
    """The content with types and shapes, as text that differs for other content."""
    if isinstance(content, list):
        return f"[{', '.join(map(written, content))}]"
    if isinstance(content, np.ndarray):
        return f"{content.dtype}{content.shape}{content.tobytes()!r}"
    return f"{type(content).__name__} {content!r}"


@given(contents, contents)
def test_digests_are_equal_for_equal_content_only(one, other):
    assert (digest(one) == digest(other)) == (written(one) == written(other))


def test_the_digest_of_a_dataclass_is_that_of_its_fields():
    of = [
        digest(Inputs(n, np.array(values))) for n, values in ((1, [2.0]), (1, [2.0]), (1, [3.0]), (2, [2.0]))
    ]
    assert of[0] == of[1]
    assert len(set(of)) == 3


def test_an_array_and_its_transpose_differ():
    square = np.arange(4.0).reshape(2, 2)
    assert digest(square) != digest(square.T)
    assert digest(square.T) == digest(square.T.copy())


def test_objects_without_a_content_have_no_digest():
    with pytest.raises(TypeError, match="object"):
        digest([object()])
    with pytest.raises(TypeError, match="ndarray"):
        digest(np.array([object()]))


def test_a_value_is_computed_once_for_the_same_inputs():
    memory, computed = Memory(1000), []

    def value(*inputs):
        return memory.value(lambda: computed.append(inputs), *inputs)  # None is a value, too

    for inputs in (("a", 1), ("a", 1), ("a", 2), ("b", 1), ("a", 1)):
        value(*inputs)
    assert computed == [("a", 1), ("a", 2), ("b", 1)]


def test_parts_of_a_memory_share_its_bytes_but_not_their_values():
    memory = Memory(3000)
    one, other = memory.of("one"), memory.of("other")
    assert one.value(lambda: np.zeros(125), "v").sum() == 0
    assert other.value(lambda: np.ones(125), "v").sum() == 125
    assert one.of("x").value(lambda: 5, "v") == 5
    assert 2000 < memory.n_bytes <= 3000
    other.value(lambda: np.ones(250), "w")  # in place of the value that was not used for longest
    assert one.value(lambda: np.full(1, 7.0), "v").sum() == 7
    assert memory.n_bytes <= 3000


def test_no_memory_keeps_nothing():
    computed = [NO_MEMORY.of("a").value(lambda: object(), "b") for _ in range(2)]
    assert computed[0] is not computed[1]
    assert not NO_MEMORY.is_on and NO_MEMORY.n_bytes == 0
    assert Memory(1).is_on


def test_a_value_is_made_from_the_last_ones_of_the_same_common_inputs():
    memory, got = Memory(2000), []

    def value(common, name):
        def compute(last):
            got.append((name, list(last)))
            return name

        return memory.value_from_last(compute, (common,), name)

    assert [value(*pair) for pair in (("x", "a"), ("x", "b"), ("y", "c"), ("x", "a"), ("x", "d"))] == [
        *"abcad"
    ]
    assert got == [("a", []), ("b", ["a"]), ("c", []), ("d", ["a", "b"])]  # a was used last
    for name in "efg":
        value("x", name)
    assert got[-1] == ("g", ["f", "e", "d", "a"])
    memory.value(lambda: np.zeros(225), "large")  # in place of all others
    value("x", "h")
    assert got[-1] == ("h", [])


def test_without_a_memory_there_is_no_last_value_and_no_key():
    assert NO_MEMORY.value_from_last(lambda last: [last], ("x",), "a") == [[]]
    assert NO_MEMORY.value_from_last(lambda last: [last], ("x",), "b") == [[]]
    assert NO_MEMORY.key("x") == b""
    assert Memory(1).key("x") != Memory(1).of("y").key("x")


ids = st.lists(st.integers(0, 20), unique=True, min_size=1, max_size=12).map(np.array)


def rows_of(numbers):
    """Rows that follow from their ids."""
    return {"square": (numbers**2)[:, None] * [1.0, 2.0], "name": np.array([f"{n:>3}" for n in numbers])}


@given(st.lists(ids, max_size=3), ids)
def test_rows_are_taken_where_they_are_and_the_others_made(last, wanted):
    made = []

    def make(new):
        made.extend(wanted[new].tolist())
        return rows_of(wanted[new])

    found = rows_from([rows_of(one) for one in last], last, wanted, make)
    assert made == [one for one in wanted.tolist() if not any(one in other for other in last)]
    for name, values in rows_of(wanted).items():
        assert found[name].dtype == values.dtype
        np.testing.assert_array_equal(found[name], values)
