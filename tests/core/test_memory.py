"""A memory computes a value once for inputs of the same content, and again for any other content."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from choreograph.core.numerics import NO_MEMORY, Memory, digest

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


def test_a_value_is_made_from_the_last_one_of_the_same_common_inputs():
    memory, got = Memory(2000), []

    def value(common, name):
        def compute(last):
            got.append((name, last))
            return name

        return memory.value_from_last(compute, (common,), name)

    assert [value(*pair) for pair in (("x", "a"), ("x", "b"), ("y", "c"), ("x", "a"), ("x", "d"))] == [
        *"abcad"
    ]
    assert got == [("a", None), ("b", "a"), ("c", None), ("d", "a")]  # a was used last
    memory.value(lambda: np.zeros(225), "large")  # in place of all others
    value("x", "e")
    assert got[-1] == ("e", None)


def test_without_a_memory_there_is_no_last_value_and_no_key():
    assert NO_MEMORY.value_from_last(lambda last: [last], ("x",), "a") == [None]
    assert NO_MEMORY.value_from_last(lambda last: [last], ("x",), "b") == [None]
    assert NO_MEMORY.key("x") == b""
    assert Memory(1).key("x") != Memory(1).of("y").key("x")
