"""Zigzag encoding: nothing is lost, the order is by magnitude, and small numbers stay small."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from choreograph.library.schema import zigzag_decode, zigzag_encode

ALL = np.arange(-(2**15), 2**15).astype(np.int16)


def test_every_integer_comes_back():
    encoded = zigzag_encode(ALL)
    assert encoded.dtype == np.uint16
    assert zigzag_decode(encoded).dtype == np.int16
    np.testing.assert_array_equal(zigzag_decode(encoded), ALL)
    np.testing.assert_array_equal(np.sort(encoded), np.arange(2**16))


def test_the_code_alternates_between_the_signs():
    np.testing.assert_array_equal(zigzag_encode(np.array([0, -1, 1, -2, 2], np.int16)), np.arange(5))


def test_magnitudes_at_most_double():
    assert (zigzag_encode(ALL) <= 2 * np.abs(ALL.astype(int))).all()


@given(arrays(np.int16, array_shapes(max_dims=3)), st.booleans())
def test_any_shape_and_memory_layout(integers, transposed):
    integers = integers.T if transposed else integers
    np.testing.assert_array_equal(zigzag_decode(zigzag_encode(integers)), integers)
