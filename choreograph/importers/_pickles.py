"""Pickles of arrays, loaded with a restricted unpickler that runs no code."""

from __future__ import annotations

import pickle
import struct
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.errors import FormatError

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
    """The dictionary of arrays in a pickle; `FormatError` if it contains anything else."""
    try:
        with open(path, "rb") as file:
            content = _ArraysOnly(file, encoding="latin1").load()
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error.strerror})") from None
    except (
        pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, IndexError, AttributeError,
        MemoryError, OverflowError, struct.error, SystemError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(f"{path}: expected a pickle of arrays; not opened: {reason}") from None
    if not isinstance(content, dict):
        raise FormatError(f"{path}: expected a pickled dictionary of arrays, got {type(content).__name__}")
    return content
