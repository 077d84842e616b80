"""VMD files as keys of bones: the records of the format, and values between keys.

A file has a header and the name of a model, then counted records of bones, faces, cameras, lights, shadows,
and of inverse kinematics (IK) that is switched on and off. Names are in Shift-JIS, numbers are little-endian.
Later parts may be missing. Keys are at 30 fps. Coordinates are those of MikuMikuDance: left-handed, Y up.
"""

from __future__ import annotations

import struct
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import FormatError
from choreograph.motion import rotations as rot
from choreograph.motion.motion import FARTHEST_M

VMD_FPS = 30.0
_ENCODING = "cp932"  # Shift-JIS, as Windows has it
_HEADERS = {b"Vocaloid Motion Data 0002": 20, b"Vocaloid Motion Data file": 10}  # bytes of the model's name
_HEADER_BYTES = 30
_BONE = np.dtype(
    [("name", "S15"), ("frame", "<u4"), ("pos", "<f4", 3), ("quat", "<f4", 4), ("curves", "u1", 64)]
)
_SWITCH = np.dtype([("name", "S20"), ("on", "u1")])
_FACES, _CAMERAS, _LIGHTS, _SHADOWS = 23, 61, 28, 9  # bytes of a record
_LINEAR = (20, 20, 107, 107)  # of 127: x and y of the first handle, and of the second
_LARGEST = 127
_SHORTEST = 1e-3  # quaternion that has a direction
_HALVINGS = 40  # of the interval in which a curve is searched, to the precision of numbers


@dataclass(frozen=True, eq=False)
class BoneKeys:
    """Keys of a bone in the order of their frames, which differ."""

    frames: NDArray[np.int64]  # (K,)
    pos: NDArray[np.float64]  # (K, 3) from the rest position, in the file's unit
    quat: NDArray[np.float64]  # (K, 4) wxyz
    # Handles x1, y1, x2, y2 from 0 to 1 of the curves that lead to a key, for X, Y, Z and the rotation.
    curves: NDArray[np.float64]  # (K, 4, 4)

    def sampled(self, frames: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions (T, 3) and rotations (T, 4) at `frames` (T,), which may be fractional."""
        before = np.searchsorted(self.frames, frames, side="right") - 1
        low, high = before.clip(0), (before + 1).clip(0, len(self.frames) - 1)
        gap = self.frames[high] - self.frames[low]
        share = np.where(gap > 0, (frames - self.frames[low]) / np.maximum(gap, 1), 0.0)  # (T,)
        weights = np.stack(
            [curve_value(self.curves[high, axis], share) for axis in range(4)], axis=-1
        )  # (T, 4)
        pos = self.pos[low] + weights[:, :3] * (self.pos[high] - self.pos[low])
        return pos, rot.slerp(self.quat[low], self.quat[high], weights[:, 3])


@dataclass(frozen=True, eq=False)
class VmdFile:
    """Keys by the names of bones, and when the IK of bones is on. Names have full or half width alike."""

    bones: Mapping[str, BoneKeys]
    switches: Mapping[str, tuple[tuple[int, bool], ...]]  # frame and state, in the order of frames


def curve_value(handles: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (T,) of Bezier curves from (0, 0) to (1, 1) at x = `share` (T,), with `handles` (T, 4)."""
    value = share.copy()
    bent = ((handles[:, 0] != handles[:, 1]) | (handles[:, 2] != handles[:, 3])) & (share > 0) & (share < 1)
    if not bent.any():
        return value
    (x1, y1, x2, y2), x = handles[bent].T, share[bent]
    low, high = np.zeros(len(x)), np.ones(len(x))
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        below = _bezier(x1, x2, middle) < x
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    value[bent] = _bezier(y1, y2, (low + high) / 2)
    return value


def _bezier(first: NDArray[np.float64], second: NDArray[np.float64], at: NDArray[np.float64]) -> np.ndarray:
    rest = 1.0 - at
    return 3.0 * rest * rest * at * first + 3.0 * rest * at * at * second + at**3


# Reading.


class _Parts:
    """The parts of a file, read one after another."""

    def __init__(self, data: bytes, start: int) -> None:
        self.data, self.at = data, start

    def counted(self, what: str, n_bytes: int) -> tuple[int, int]:
        """The number of records that follow and where they start. None follow at the end of the file."""
        if self.at == len(self.data):
            return 0, self.at
        n = self.number(what)
        start = self.at
        self._skip(what, n, n_bytes)
        return n, start

    def number(self, what: str) -> int:
        """A whole number."""
        start = self.at
        self._skip(f"the number of {what}", 1, 4)
        return int.from_bytes(self.data[start : self.at], "little")

    def _skip(self, what: str, n: int, n_bytes: int) -> None:
        left = len(self.data) - self.at
        if n * n_bytes > left:
            raise FormatError(f"expected {n * n_bytes} bytes of {what}, got {left}: cut off or damaged")
        self.at += n * n_bytes


def parse_vmd(data: bytes) -> VmdFile:
    """The keys in the content of a file. Raises `FormatError` if it is no VMD or is damaged."""
    header = next((known for known in _HEADERS if data.startswith(known)), None)
    if header is None:
        raise FormatError(f"expected a VMD, which starts with {_first(_HEADERS)}, got {data[:16]!r}")
    start = _HEADER_BYTES + _HEADERS[header]
    if len(data) < start + 4:
        raise FormatError(f"expected a VMD of {start + 4} bytes or more, got {len(data)}: cut off")
    parts = _Parts(data, start)
    n_bones, bones_at = parts.counted("keys of bones", _BONE.itemsize)
    keys = np.frombuffer(data, _BONE, n_bones, bones_at)
    for what, n_bytes in (
        ("keys of faces", _FACES), ("keys of cameras", _CAMERAS), ("keys of lights", _LIGHTS),
        ("keys of shadows", _SHADOWS),
    ):  # fmt: skip
        parts.counted(what, n_bytes)
    return VmdFile(_bones(keys), _switches(parts))


def _first(names: Mapping[bytes, int]) -> str:
    return repr(next(iter(names)).decode())


def _bones(keys: NDArray[np.void]) -> dict[str, BoneKeys]:
    pos = keys["pos"].astype(np.float64)  # (K, 3)
    xyzw = keys["quat"].astype(np.float64)  # (K, 4)
    if not ((np.abs(pos) < FARTHEST_M).all() and np.isfinite(xyzw).all()):
        raise FormatError(
            f"expected positions below {FARTHEST_M:g} and finite rotations, got others: damaged"
        )
    quat = np.roll(xyzw, 1, axis=-1)
    quat[np.linalg.norm(quat, axis=-1) < _SHORTEST] = rot.IDENTITY  # some programs write zeros for it
    quat = rot.normalize(quat)
    raw, group = np.unique(keys["name"], return_inverse=True)
    order = np.argsort(group, kind="stable")
    rows_of: dict[str, list[NDArray[np.int64]]] = {}
    for name, rows in zip(
        raw.tolist(), np.split(order, np.cumsum(np.bincount(group, minlength=len(raw)))[:-1]), strict=False
    ):
        rows_of.setdefault(_decoded(name), []).append(rows)
    return {name: _in_order(keys, pos, quat, np.sort(np.concatenate(rows))) for name, rows in rows_of.items()}


def _in_order(
    keys: NDArray[np.void], pos: NDArray[np.float64], quat: NDArray[np.float64], rows: NDArray[np.int64]
) -> BoneKeys:
    """The keys of `rows` in the order of frames. The last of several at one frame holds."""
    frames = keys["frame"][rows].astype(np.int64)
    frames, last = np.unique(frames[::-1], return_index=True)
    rows = rows[::-1][last]
    # The first row of 16 bytes has other uses in new programs, so that each curve is read where it starts a
    # row: x1, y1, x2 and y2 are every fourth byte of it.
    handles = keys["curves"][rows].reshape(-1, 4, 16)[:, :, ::4]  # (K, 4, 4)
    return BoneKeys(frames, pos[rows], quat[rows], handles.clip(0, _LARGEST) / _LARGEST)


def _switches(parts: _Parts) -> dict[str, tuple[tuple[int, bool], ...]]:
    states: dict[str, dict[int, bool]] = {}
    n, _ = (0, 0) if parts.at == len(parts.data) else (parts.number("keys of IK"), 0)
    for _ in range(n):
        frame = parts.number("keys of IK")
        parts.at += 1  # whether the model is shown
        n_bones, start = parts.counted("bones with IK", _SWITCH.itemsize)
        for name, on in np.frombuffer(parts.data, _SWITCH, n_bones, start).tolist():
            states.setdefault(_decoded(name), {})[frame] = bool(on)
    return {name: tuple(sorted(of.items())) for name, of in states.items()}


def _decoded(name: bytes) -> str:
    """A name in one form of full and half width. A character that the field has cut is left out."""
    name = name.partition(b"\0")[0]
    for end in (len(name), len(name) - 1):
        try:
            return unicodedata.normalize("NFKC", name[: max(end, 0)].decode(_ENCODING))
        except UnicodeDecodeError:
            if len(name) < _BONE["name"].itemsize:
                break
    raise FormatError(f"expected names of bones in Shift-JIS, got {name!r}: damaged, or of another program")


# Writing.


def vmd_bytes(model: str, bones: Mapping[str, BoneKeys], switched_on: Sequence[str]) -> bytes:
    """The content of a file with keys of bones, by their names in Japanese, and IK on from the first frame.

    Curves of keys are written as they are rounded to 1/127.
    """
    header = next(iter(_HEADERS))
    parts = [header.ljust(_HEADER_BYTES, b"\0"), model.encode(_ENCODING)[:20].ljust(20, b"\0")]
    parts.append(struct.pack("<I", sum(len(keys.frames) for keys in bones.values())))
    for name, keys in bones.items():
        records = np.zeros(len(keys.frames), _BONE)
        records["name"], records["frame"] = name.encode(_ENCODING), keys.frames
        records["pos"], records["quat"] = keys.pos, np.roll(keys.quat, -1, axis=-1)
        records["curves"] = _curve_bytes(keys.curves)
        parts.append(records.tobytes())
    parts.append(struct.pack("<4I", 0, 0, 0, 0))  # faces, cameras, lights, shadows
    parts.append(struct.pack("<IIBI", 1, 0, 1, len(switched_on)))
    switches = np.array([(name.encode(_ENCODING), 1) for name in switched_on], _SWITCH)
    parts.append(switches.tobytes())
    return b"".join(parts)


def linear_curves(n_keys: int) -> NDArray[np.float64]:
    """Handles (K, 4, 4) of straight curves, as MikuMikuDance writes them."""
    return np.tile(np.array(_LINEAR) / _LARGEST, (n_keys, 4, 1))


def _curve_bytes(curves: NDArray[np.float64]) -> NDArray[np.uint8]:
    """The 64 bytes of each key: 16 of x1 of all curves, then y1, x2 and y2, in four rows shifted by one."""
    row = np.rint(curves * _LARGEST).astype(np.uint8).transpose(0, 2, 1).reshape(-1, 16)  # (K, 16)
    padded = np.pad(row, ((0, 0), (0, 3)))
    return np.concatenate([padded[:, shift : shift + 16] for shift in range(4)], axis=1)
