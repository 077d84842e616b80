"""NPY: arrays without pickles."""

from __future__ import annotations

import io
import struct
import time

import numpy as np
import pytest

import choreograph as cg
from choreograph.core.errors import FormatError
from choreograph.formats.npz import array_of, header_of

POSES = np.arange(24.0).reshape(2, 3, 4)


def written(array: np.ndarray, version: tuple[int, int] | None = None) -> bytes:
    packed = io.BytesIO()
    np.lib.format.write_array(packed, array, version)
    return packed.getvalue()


def with_header(header: str, content: bytes = b"", version: int = 1) -> bytes:
    size = struct.pack("<H" if version == 1 else "<I", len(header))
    return b"\x93NUMPY" + bytes((version, 0)) + size + header.encode("latin1") + content


def stated(descr: str = "'<f8'", order: str = "False", shape: str = "(2,)") -> str:
    return f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}\n"


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
@pytest.mark.parametrize(
    "array",
    [POSES, np.asfortranarray(POSES), POSES.astype(">f4"), POSES > 3, POSES.astype("i2"), POSES * 1j,
     np.array(["left", "é"]), np.zeros((0, 72)), np.array(3.0)],
)  # fmt: skip
def test_what_numpy_writes_is_read(array, version):
    read = array_of(written(array, version))
    assert read.dtype == array.dtype.newbyteorder("=") and read.flags.writeable
    np.testing.assert_array_equal(read, array)
    assert read.flags.f_contiguous == array.flags.f_contiguous


def test_headers_of_other_programs_and_of_python_2_are_read():
    content = np.array([1.0, 2.0]).tobytes()
    for header in ("{'descr': '<f8', 'fortran_order': False, 'shape': (2L,)}", stated().replace(", }", ",}")):
        assert array_of(with_header(header, content)).tolist() == [1.0, 2.0]
    assert array_of(with_header(stated(), content + b"another array")).tolist() == [1.0, 2.0]


HEADERS = {
    "a tree too deep": "(" * 3000,
    "signs": "-" * 3000 + "1",
    "an expression": "[0 for i in range(10)]",
    "fields": stated("[('a', '<f8')]"),
    "an array of arrays": stated("('<f8', (3, 4))"),
    "dates": stated("'<M8[ns]'"),
    "values without a size": stated("'|V0'", shape="(4611686018427387904,)"),
    "texts without a size": stated("'<U0'", shape="(4611686018427387904,)"),
    "another order": stated(order="None"),
    "no shape": stated(shape="None"),
    "a negative axis": stated(shape="(-1, -2)"),
    "axes whose product overflows": stated(shape="(4294967296, 4294967296)"),
    "an axis without end": stated(shape="(" + "9" * 3900 + ",)"),
    "axes without end": stated(shape="(" + "1, " * 1200 + ")"),
    "digits that do not end": stated(shape="(" + "1" * 3900)[:-5],
    "more than there is": stated(shape="(1000000000,)"),
    "nothing": "",
}


@pytest.mark.parametrize("name", HEADERS)
@pytest.mark.parametrize("version", [1, 2])
def test_other_headers_are_refused_in_one_line(tmp_path, name, version):
    (tmp_path / "a.npy").write_bytes(with_header(HEADERS[name], bytes(8), version))
    began = time.process_time()
    with pytest.raises(FormatError, match="expected an array") as caught:
        cg.load_motion(tmp_path / "a.npy")
    assert len(str(caught.value)) < 400 + len(str(tmp_path)) and time.process_time() - began < 2.0


def test_files_that_end_in_the_header_are_refused():
    data = written(POSES)
    for n in (0, 5, 6, 7, 8, 9, 11, 60, 127, len(data) - 1):
        with pytest.raises(FormatError, match="expected an array"):
            array_of(data[:n])


def test_values_that_are_none_are_refused():
    for descr, content in (("'|b1'", b"\x00\x02"), ("'<U1'", b"\xff\xff\xff\xff" * 2)):
        with pytest.raises(FormatError, match="expected an array of numbers"):
            array_of(with_header(stated(descr), content))


def test_objects_are_not_read_here():
    packed = io.BytesIO()
    np.save(packed, np.array({"a": 1}, object))
    assert header_of(packed.getvalue()).kind is None
    with pytest.raises(FormatError, match="objects"):
        array_of(packed.getvalue())
