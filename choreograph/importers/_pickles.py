"""Pickles of arrays, loaded with a restricted unpickler that runs no code."""

from __future__ import annotations

import io
import pickle
import pickletools
import struct
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.errors import FormatError
from choreograph.files import read_bytes

_MAX_BYTES = 1 << 26
_MAX_OPCODES = 20_000  # an array takes about thirty
_MAX_MADE_BYTES = 1 << 31  # each call in a pickle makes at most as many bytes as the pickle has
_CALLS = ("REDUCE", "NEWOBJ", "NEWOBJ_EX", "INST", "OBJ", "BUILD")
_RECONSTRUCT = np.zeros(1).__reduce__()[0]
_SCALAR = np.float64(0).__reduce__()[0]
_FROM_BUFFER = np.zeros(1).__reduce_ex__(5)[0]


def _encode(text: str, encoding: str = "latin1") -> bytes:
    """Bytes as older pickles encode them; the full codec registry has more than text codecs."""
    if encoding not in ("latin1", "latin-1", "utf-8"):
        raise pickle.UnpicklingError(f"codec {encoding}")
    return text.encode(encoding)


# Before numpy 2 the module was numpy.core; both kinds of files exist.
_ALLOWED: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("_codecs", "encode"): _encode,
}
for _core in ("numpy.core", "numpy._core"):
    _ALLOWED[f"{_core}.multiarray", "_reconstruct"] = _RECONSTRUCT
    _ALLOWED[f"{_core}.multiarray", "scalar"] = _SCALAR
    _ALLOWED[f"{_core}.numeric", "_frombuffer"] = _FROM_BUFFER


class _ArraysOnly(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        try:
            return _ALLOWED[module, name]
        except KeyError:
            raise pickle.UnpicklingError(
                f"it refers to {module}.{name}, which is not an array and may run code"
            ) from None


def load_arrays(path: Path) -> dict[str, Any]:
    """The dictionary of arrays and numbers in a pickle.

    Raises `FormatError` if it contains anything else, or would make more of its bytes than there are.
    """
    data = read_bytes(path, "a pickle of arrays", max_bytes=_MAX_BYTES)
    try:
        _check_opcodes(data)
        content = _ArraysOnly(io.BytesIO(data), encoding="latin1").load()
    except (
        pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, IndexError, AttributeError,
        MemoryError, OverflowError, struct.error, SystemError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(f"{path}: expected a pickle of arrays; not opened: {reason}") from None
    if not isinstance(content, dict):
        raise FormatError(f"{path}: expected a pickled dictionary of arrays, got {type(content).__name__}")
    for name, value in content.items():
        if not isinstance(name, str) or not isinstance(value, np.ndarray | np.generic | int | float | str):
            raise FormatError(
                f"{path}: expected arrays and numbers by name, got {type(value).__name__}: another pickle?"
            )
    arrays = [value for value in content.values() if isinstance(value, np.ndarray)]
    if sum(array.nbytes for array in arrays) > 2 * len(data):  # in latin-1 text, half of it may be escaped
        raise FormatError(f"{path}: expected the arrays' numbers in the pickle, got shapes without them")
    return content


def _check_opcodes(data: bytes) -> None:
    """`UnpicklingError` if a pickle would take far more time or memory than its bytes."""
    n_calls = 0
    for i, (opcode, argument, _) in enumerate(pickletools.genops(data)):
        n_calls += opcode.name in _CALLS
        is_far = "PUT" in opcode.name and (argument or 0) > _MAX_OPCODES
        if i > _MAX_OPCODES or n_calls * len(data) > _MAX_MADE_BYTES or is_far:
            raise pickle.UnpicklingError("it is larger or more complicated than arrays are")
