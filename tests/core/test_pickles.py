"""Pickles from untrusted files: what is read as it was written, and what is refused without a crash."""

from __future__ import annotations

import io
import pickle
import struct
import time

import numpy as np
import pytest

from choreograph.core.pickles import unpickled

SQUARE = np.arange(24.0).reshape(4, 6)
ARRAYS = {
    "rows first": SQUARE,
    "columns first": np.asfortranarray(SQUARE),
    "axes in another order": np.zeros((2, 3, 4)).transpose(1, 0, 2) + 1.0,
    "every second row": SQUARE[::2],
    "big-endian": SQUARE.astype(">f4"),
    "half precision": SQUARE.astype("f2"),
    "integers": SQUARE.astype("u1"),
    "complex": SQUARE * 1j,
    "true and false": SQUARE > 3,
    "texts": np.array(["left", "é", ""]),
    "bytes": np.array([b"a", b"bcd"]),
    "empty": np.zeros((0, 72)),
    "no axis": np.array(3.0),
}


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_read_as_they_were_written(name, protocol):
    written = ARRAYS[name]
    read = unpickled(pickle.dumps({"a": written, "again": [written]}, protocol=protocol))
    assert read["a"].dtype == written.dtype.newbyteorder("=") and read["a"].shape == written.shape
    np.testing.assert_array_equal(read["a"], written)
    assert read["again"][0] is read["a"] and read["a"].flags.writeable


@pytest.mark.parametrize("protocol", range(6))
def test_other_values_are_read_as_they_were_written(protocol):
    values = [
        None, True, 3, -(1 << 40), (1 << 64) - 1, 0.5, float("inf"), "é\n\\", b"\0\xff", b"", "x" * 300, [],
        (), (1,), (1, (2, "3")), {}, {"a": {1: [2.0]}}, np.float32(0.1), np.bool_(True), np.int64(-3),
    ]  # fmt: skip
    read = unpickled(pickle.dumps(values, protocol=protocol))
    assert read == values and [type(one) for one in read] == [type(one) for one in values]


def test_values_are_those_of_the_module_pickle():
    shared = [1]
    for value in ({"a": shared, "b": shared}, np.array({"a": SQUARE}, object)):
        data = pickle.dumps(value, protocol=2).replace(b"numpy._core.", b"numpy.core.")
        read = unpickled(data)
        assert str(read) == str(value.item() if isinstance(value, np.ndarray) else value)
    assert unpickled(b"\x80\x02}q\x00(U\x01aq\x01U\x03\xe9\xffbu.") == {"a": "\xe9\xffb"}  # of Python 2


def _array(kind: str, shape: str, content: bytes, state: str = "N,N,N,I-1\n,I-1\n,I0\n") -> bytes:
    """An array of any dtype, as `pickle` writes it."""
    parts = "(I3\nV<\n" + state.replace(",", "") + "t"
    dtype = f"cnumpy\ndtype\n(V{kind}\nI00\nI01\ntR{parts}b"
    start = "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntVb\ntR(I1\n"
    made = b"B" + struct.pack("<I", len(content)) + content
    return f"{start}{shape}{dtype}I00\n".encode("latin1") + made + b"tb."


OBJECTS = "cnumpy\ndtype\n(VO8\nI00\nI01\ntR(I3\nV|\nNNNI-1\nI-1\nI63\ntb"
SIZES = ",I8\n,I1\n,I27\n"  # of a dtype with objects
FROM_BUFFER = b"cnumpy.core.numeric\n_frombuffer\n("
REFUSED = {
    "addresses": _array("O8", "(I2\nt", b"\x41" * 16),
    "addresses in a field": _array("V8", "(I2\nt", b"\x41" * 16, f"N(Va\nt}}Va\n({OBJECTS}I0\nts{SIZES}"),
    "an array in an array": _array("V8", "(I2\nt", b"\x41" * 16, f"({OBJECTS}(I1\ntt,N,N{SIZES}"),
    "fields by descr": _array("f8,O", "(I1\nt", b"\x41" * 16),
    "values without a size": _array("V0", "(I4611686018427387904\nt", b""),
    "texts without a size": _array("U0", "(I4611686018427387904\nt", b""),
    "long texts": _array("U100000000", "(I1\nt", b""),
    "dates": _array("M8", "(I2\nt", bytes(16)),
    "too few bytes": _array("f8", "(I3\nt", bytes(16)),
    "too many bytes": _array("f8", "(I1\nt", bytes(16)),
    "a negative axis": _array("f8", "(I-1\nI-2\nt", bytes(16)),
    "axes whose product overflows": _array("f8", "(I4294967296\nI4294967296\nt", b""),
    "neither true nor false": _array("b1", "(I2\nt", b"\x00\x02"),
    "no characters": _array("U1", "(I1\nt", b"\xff\xff\xff\xff"),
    "an object by its address": b"cnumpy.core.multiarray\nscalar\n(" + OBJECTS.encode() + b"C\x08AAAAAAAAtR.",
    "objects of bytes": FROM_BUFFER + b"C\x08AAAAAAAA" + OBJECTS.encode() + b"(I1\ntVC\ntR.",
    "an array that is called": b"cnumpy\nndarray\n((I2\ntVO\ntR.",
    "a new array": b"cnumpy\nndarray\n((I2\ntVO\nt\x81.",
    "an array without a state": b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I9\ntVb\ntR.",
    "a class": b"(lcnumpy\nndarray\na.",
    "the state of a list": b"]}Va\nI1\nsb.",
    "the state of an array": _array("f8", "(I2\nt", bytes(16))[:-1] + b"}Vdtype\nVO\nsb.",
    "a persistent object": b"Pid\n.",
    "an extension": b"\x82\x01.",
    "a buffer that is not there": b"\x97.",
    "a long integer": b"\x8a\x09" + bytes(8) + b"\x01.",
    "a set": b"\x8f.",
    "a tuple as a key": b"})Ns.",
    "an unknown memo": b"h\x05.",
    "nothing": b".",
    "no end": b"N",
    "a later protocol": b"\x80\x06N.",
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_value_is_refused(name):
    with pytest.raises(pickle.UnpicklingError) as caught:
        unpickled(REFUSED[name])
    assert "\n" not in str(caught.value) and 0 < len(str(caught.value)) <= 200


def test_the_refused_arrays_are_read_with_other_parts():
    """So that each of them is refused for what is wrong with it."""
    np.testing.assert_array_equal(unpickled(_array("f8", "(I2\nt", np.array([1.0, 2.0]).tobytes())), [1, 2])
    assert unpickled(_array("U1", "(I1\nt", "a".encode("utf-32-le"))).tolist() == ["a"]
    assert unpickled(_array("b1", "(I2\nt", b"\x00\x01")).tolist() == [False, True]


def _doubled(n: int) -> bytes:
    return b"N" + b"2\x86" * n


MEGABYTE = struct.pack("<I", 1 << 20) + b"x" * (1 << 20) + b"q\x000]"
BYTES = b"cnumpy\ndtype\n(Vu1\nI00\nI01\ntR(I3\nV|\nNNNI-1\nI-1\nI0\ntb"
BYTES_OF_MEMO = FROM_BUFFER + b"h\x00" + BYTES + b"(I1048576\ntVC\ntRa"
HEAVY = {
    "the hash of doubled tuples": b"}" + _doubled(60) + b"Ns.",
    "the hash of nested tuples": b"}N" + b"\x85" * 19_000 + b"Ns.",
    "a shape of doubled tuples": _array("f8", _doubled(60).decode("latin1"), b""),
    "the name of doubled tuples": _doubled(60) + b"N\x93.",
    "a key of doubled tuples in a state": b"cnumpy\ndtype\n(Vf8\nI00\nI01\ntR}" + _doubled(60) + b"Nsb.",
    "nested lists": b"]" * 9_000 + b"a" * 8_999 + b"b.",
    "many axes": _array("f8", "(" + "I9999999999999999\n" * 10_000 + "t", b""),
    "marks": b"(" * (1 << 20),
    "one array again and again": b"B" + MEGABYTE + BYTES_OF_MEMO * 500 + b".",
    "a text that is encoded again and again": b"X" + MEGABYTE + b"c_codecs\nencode\n(h\x00tRa" * 3_000 + b".",
}


@pytest.mark.parametrize("name", HEAVY)
def test_time_is_in_proportion_to_the_pickle(name):
    began = time.process_time()
    with pytest.raises(pickle.UnpicklingError):
        unpickled(HEAVY[name])
    assert time.process_time() - began < 2.0


def test_pickles_of_many_instructions_are_read_on_request():
    data = pickle.dumps([[] for _ in range(30_000)])
    with pytest.raises(pickle.UnpicklingError, match="more complicated"):
        unpickled(data)
    assert len(unpickled(data, max_opcodes=len(data))) == 30_000


def test_names_in_messages_are_short_and_printable():
    for name in (b"\x1b[2J", b"x" * 5000):
        with pytest.raises(pickle.UnpicklingError, match="may run code") as caught:
            unpickled(b"cos\n" + name + b"\n.")
        assert str(caught.value).isprintable() and len(str(caught.value)) <= 200


def test_saved_objects_of_numpy_are_their_values():
    packed = io.BytesIO()
    np.lib.format.write_array(packed, np.array([{"a": SQUARE}], object))
    assert unpickled(packed.getvalue()[128:])["a"].shape == (4, 6)
