"""VMD: motions for the models of MikuMikuDance and similar programs.

A file has a header and the name of a model, then counted records of bones, faces, cameras, lights, shadows,
and of inverse kinematics (IK) that is switched on and off. Names are in Shift-JIS, numbers are little-endian.
Later parts may be missing. Keys are at 30 fps. Coordinates are those of MikuMikuDance: left-handed, Y up.

A file has no skeleton, so that motions are read and written on `standard_body`, which has the proportions of
common models: 20 units of 8 cm tall, with the hips at 11.4 units and arms 38 degrees below the horizontal.
Its arrays are in the axes of this program: right-handed, facing +Z. Those of MikuMikuDance have Z reversed.
"""

from __future__ import annotations

import struct
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import BUDGETS, read_bytes
from choreograph.core.numerics import Floats
from choreograph.core.timebase import frame_times_s, seconds_to_frames
from choreograph.formats.writer import Writer
from choreograph.motion import rotations as rot
from choreograph.motion.hands import finger_quats, hand_spans, shape_shares
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import FARTHEST_M, Credits, Motion, Take, check_length
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import Skeleton

# Keys of bones: the records of the format, and values between keys.


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
    pos: Floats  # (K, 3) from the rest position, in the file's unit
    quat: Floats  # (K, 4) wxyz
    # Handles x1, y1, x2, y2 from 0 to 1 of the curves that lead to a key, for X, Y, Z and the rotation.
    curves: Floats  # (K, 4, 4)

    def sampled(self, frames: Floats) -> tuple[Floats, Floats]:
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


def curve_value(handles: Floats, share: Floats) -> Floats:
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


def _bezier(first: Floats, second: Floats, at: Floats) -> np.ndarray:
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
        raise FormatError(
            f"expected a VMD, which starts with {next(iter(_HEADERS)).decode()!r}, got {data[:16]!r}"
        )
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


def _in_order(keys: NDArray[np.void], pos: Floats, quat: Floats, rows: NDArray[np.int64]) -> BoneKeys:
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


def linear_curves(n_keys: int) -> Floats:
    """Handles (K, 4, 4) of straight curves, as MikuMikuDance writes them."""
    return np.tile(np.array(_LINEAR) / _LARGEST, (n_keys, 4, 1))


def _curve_bytes(curves: Floats) -> NDArray[np.uint8]:
    """The 64 bytes of each key: 16 of x1 of all curves, then y1, x2 and y2, in four rows shifted by one."""
    row = np.rint(curves * _LARGEST).astype(np.uint8).transpose(0, 2, 1).reshape(-1, 16)  # (K, 16)
    padded = np.pad(row, ((0, 0), (0, 3)))
    return np.concatenate([padded[:, shift : shift + 16] for shift in range(4)], axis=1)


# The body, and its legs, which are moved by the positions of the feet.


UNIT_M = 0.08
SIDES = {"left": "左", "right": "右"}
CENTRE = "センター"
LOWER, UPPER = "下半身", "上半身"  # both are children of the centre, and are in the same place
CENTRE_POS_M = np.array([0.0, 8.0, 0.0]) * UNIT_M

_ARM_RAD = np.radians(38.0)
_ALONG_ARM = (float(np.cos(_ARM_RAD)), -float(np.sin(_ARM_RAD)), 0.0)
_UPPER_ARM, _FOREARM, _PALM = 2.9, 2.6, 1.0  # units
# Name, parent, role and rest position in units, Z to the front, of the trunk.
_TRUNK = (
    (LOWER, "", "pelvis", (0.0, 12.4, 0.0)),
    (UPPER, LOWER, "spine1", (0.0, 12.4, 0.0)),
    ("上半身2", UPPER, "spine3", (0.0, 13.9, 0.0)),
    ("首", "上半身2", "neck", (0.0, 16.4, -0.2)),
    ("頭", "首", "head", (0.0, 17.2, 0.0)),
)
# Name, parent, role, and the rest position from that of the parent, of the left limbs. Knees are hinges
# about X, so that a leg is in a plane without X.
_LIMBS = (
    ("足", LOWER, "hip", (0.9, -1.0, 0.0)),
    ("ひざ", "足", "knee", (0.0, -4.9, 0.1)),
    ("足首", "ひざ", "ankle", (0.0, -5.2, -0.35)),
    ("つま先", "足首", "foot", (0.0, -1.3, 1.75)),
    ("肩", "上半身2", "collar", (0.3, 2.0, -0.2)),
    ("腕", "肩", "shoulder", (1.0, -0.2, 0.0)),
    ("ひじ", "腕", "elbow", tuple(_UPPER_ARM * part for part in _ALONG_ARM)),
    ("手首", "ひじ", "wrist", tuple(_FOREARM * part for part in _ALONG_ARM)),
    ("中指１", "手首", "hand", tuple(_PALM * part for part in _ALONG_ARM)),
)
_ABOVE_HEAD = (0.0, 2.8, 0.0)
UNKEYED = ("つま先", "中指１")  # ends of limbs, whose rotations are not in files

# Bones of fingers from the hand to the tip, without their sides. Some models lack the first one of the thumb.
FINGERS = {
    "thumb": ("親指０", "親指１", "親指２"), "index": ("人指１", "人指２", "人指３"),
    "middle": ("中指１", "中指２", "中指３"), "ring": ("薬指１", "薬指２", "薬指３"),
    "pinky": ("小指１", "小指２", "小指３"),
}  # fmt: skip

_X = np.array([1.0, 0.0, 0.0])
_STRAIGHT = 0.02  # sine of the bend of a knee below which its axis is mostly that of the thigh


@lru_cache(maxsize=1)
def standard_body() -> Skeleton:
    """The standard body with Japanese names of joints, in metres."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[Floats] = []
    roles: dict[str, int] = {}
    for name, parent, role, pos in _TRUNK:
        above = names.index(parent) if parent else -1
        rest = np.array(pos) - (np.array(_TRUNK[above][3]) if parent else 0.0)
        roles[role] = len(names)
        names.append(name)
        parents.append(above)
        offsets.append(rest)
    for side, mark in SIDES.items():
        for name, parent, role, offset in _LIMBS:
            roles[f"{side}_{role}"] = len(names)
            parents.append(names.index(parent if parent in names else f"{mark}{parent}"))
            names.append(f"{mark}{name}")
            offsets.append(np.array(offset) * (1.0 if side == "left" else -1.0, 1.0, 1.0))
    return Skeleton(
        tuple(names), np.array(parents), UNIT_M * np.array(offsets),
        tip_parents=np.array([roles["head"]]), tips_m=UNIT_M * np.array([_ABOVE_HEAD]), roles=roles,
    )  # fmt: skip


def mirrored(pos: Floats, quat: Floats) -> tuple[np.ndarray, np.ndarray]:
    """Positions (..., 3) and rotations (..., 4) from the axes of MikuMikuDance to ours, and back."""
    return pos * np.array([1.0, 1.0, -1.0]), quat * np.array([1.0, -1.0, -1.0, 1.0])


def finger_turns(side: str, shares: Floats) -> dict[str, Floats]:
    """Local rotations (T, 4) of the bones of fingers of a hand, by name, for shares (T, S) of its shapes."""
    angle_rad = -_ARM_RAD if side == "left" else _ARM_RAD
    arm = rot.from_rotvec(np.array([0.0, 0.0, angle_rad]))  # from the T pose to that of the body
    quats = finger_quats(side, shares)
    return {
        f"{SIDES[side]}{name}": rot.multiply(arm, rot.multiply(quats[finger][:, segment], rot.invert(arm)))
        for finger, names in FINGERS.items()
        for segment, name in enumerate(names)
    }


def bend_leg(thigh_quat: Floats, hip_pos_m: Floats, target_pos_m: Floats) -> tuple[Floats, Floats]:
    """World rotations (T, 4) of the thigh and local ones of the knee that put the ankle on a target (T, 3).

    The knee bends about the X axis of the thigh. The thigh turns from `thigh_quat` (T, 4) as little as
    possible. A leg that does not reach the target points at it.
    """
    thigh, shin = _leg_bones()
    lengths = np.linalg.norm(thigh), np.linalg.norm(shin)
    to_target = target_pos_m - hip_pos_m  # (T, 3)
    reach = np.linalg.norm(to_target, axis=-1).clip(abs(lengths[0] - lengths[1]), sum(lengths))  # (T,)
    cosine = (reach**2 - lengths[0] ** 2 - lengths[1] ** 2) / (2.0 * lengths[0] * lengths[1])
    angle = np.arccos(cosine.clip(-1.0, 1.0)) - _angle_about(_X, thigh, shin)  # (T,)
    knee = rot.from_rotvec(angle[:, None] * _X)
    leg = rot.rotate(thigh_quat, thigh + rot.rotate(knee, shin))  # (T, 3) from hip to ankle
    turn = rot.between(rot.unit(leg), rot.unit(to_target))
    return rot.multiply(turn, thigh_quat), knee


def hinged_thigh(thigh_quat: Floats, knee_m: Floats, ankle_m: Floats) -> Floats:
    """World rotations (T, 4) of the thigh, twisted so that its X axis is the axis in which the knee bends.

    `knee_m` and `ankle_m` (T, 3) are the bones in the world. An axis cannot be seen in a straight leg, which
    keeps that of `thigh_quat` (T, 4).
    """
    along = rot.unit(knee_m)
    thigh = _leg_bones()[0]
    aligned = rot.multiply(
        rot.between(rot.rotate(thigh_quat, np.broadcast_to(rot.unit(thigh), along.shape)), along),
        thigh_quat,
    )
    axis = rot.rotate(aligned, np.broadcast_to(_X, along.shape))  # (T, 3)
    bend = np.cross(along, rot.unit(ankle_m))
    sine = np.maximum(np.linalg.norm(bend, axis=-1, keepdims=True), 1e-12)
    forward = ((bend * axis).sum(axis=-1, keepdims=True) / sine).clip(0.0, 1.0)  # 0: the knee bends back
    angle = _angle_about(along, axis, _STRAIGHT * axis + forward * bend)
    return rot.multiply(rot.from_rotvec(angle[:, None] * along), aligned)


def _leg_bones() -> tuple[Floats, Floats]:
    """Thigh and shin (3,) of both legs in the rest pose, in metres."""
    body = standard_body()
    return body.offsets_m[body.index("左ひざ")], body.offsets_m[body.index("左足首")]


def _angle_about(axis: Floats, first: Floats, second: Floats) -> Floats:
    """Angles (...) in radians from `first` to `second` (..., 3) about `axis`, to which both are normal."""
    return np.arctan2((np.cross(first, second) * axis).sum(axis=-1), (first * second).sum(axis=-1))


# Motions.


LAYOUT = "a single NAME.vmd of MikuMikuDance"
SUFFIXES = (".vmd",)
# The name of the model in files, of 20 bytes. The second one marks files that a new dance may replace.
MODEL, DANCE_MODEL = "choreograph", "choreograph: a dance"

# Bones between those of the body, which turn in the same place, in the order in which they apply.
_TWISTS = {"ひじ": ("腕捩",), "手首": ("手捩",), "肩": ("肩P",)}
_Transform = tuple[Floats, Floats]  # positions (T, 3), rotations (T, 4)


def read(path: Path) -> Iterator[Take]:
    """The file as a take without music, named after it."""
    motion, notes = read_vmd(path)
    yield Take(path.stem, motion, Credits(source=path.name), source_paths=(path,), notes=notes)


def read_vmd(path: str | Path) -> tuple[Motion, tuple[str, ...]]:
    """Read a VMD file at 30 fps, on the standard body.

    Legs are moved by the IK of their feet while it is on and has keys, as in MikuMikuDance, and otherwise by
    their own rotations.

    Returns
    -------
    motion : Motion             metres, Y up
    notes : tuple of str        bones that are not read, in one line

    Raises
    ------
    ParameterError   if the file does not exist
    FormatError      if it is not a valid VMD, or moves no body
    """
    path = Path(path)
    if not path.exists():
        raise ParameterError(f"expected a VMD file at {path}, got nothing: there is no such file")
    data = read_bytes(path, "a VMD file", max_bytes=BUDGETS["vmd"].file_bytes)
    try:
        reader = _Reader(parse_vmd(data))
        return reader.motion(), reader.notes()
    except (FormatError, ParameterError) as error:
        raise FormatError(f"{path}: {error}") from None


class _Reader:
    """The motion of the keys in a file."""

    def __init__(self, file: VmdFile) -> None:
        self.file, self.body = file, standard_body()
        known = [name for name in _known_bones() if name in file.bones]
        if not known:
            raise FormatError(
                f"expected keys of MikuMikuDance's bones, such as {CENTRE} or {UPPER}, got "
                f"{len(file.bones)} other bones: a camera, a face, or a model with other names?"
            )
        n_frames = 1 + max(int(file.bones[name].frames[-1]) for name in known)
        check_length(n_frames, self.body.n_joints, VMD_FPS)
        self.frames = np.arange(n_frames, dtype=np.float64)  # (T,)

    def notes(self) -> tuple[str, ...]:
        """What was left out, and the body, in a line each."""
        fingers = {
            unicodedata.normalize("NFKC", f"{mark}{name}")
            for mark in SIDES.values()
            for names in FINGERS.values()
            for name in names
        }
        others = sorted(set(self.file.bones) - set(_known_bones()) - fingers)
        height = "on a body of 1.60 m, the size of common models, since the file has no skeleton"
        left = f"left out the keys of {len(others)} bones, such as {others[0]}" if others else ""
        return tuple(note for note in (height, left) if note)

    def motion(self) -> Motion:
        """The motion on the standard body."""
        waist_m, waist = self._waist()
        local = np.tile(rot.IDENTITY, (len(self.frames), self.body.n_joints, 1))  # (T, J, 4)
        for joint, name in enumerate(self.body.names):
            if name[1:] not in UNKEYED:
                local[:, joint] = self._local(name)
        local[:, 0] = rot.multiply(waist, local[:, 0])
        upper = self.body.index(UPPER)
        local[:, upper] = rot.multiply(rot.invert(local[:, 0]), rot.multiply(waist, local[:, upper]))
        for side in SIDES:
            self._bend_leg(side, waist_m, local)
        return Motion(self.body, waist_m, rot.make_continuous(local), VMD_FPS)

    def _keys(self, name: str) -> _Transform:
        """Positions in metres and rotations of a bone in its parent, those of the rest pose without keys."""
        keys = self.file.bones.get(name)
        if keys is None:
            return np.zeros((len(self.frames), 3)), np.tile(rot.IDENTITY, (len(self.frames), 1))
        pos, quat = mirrored(*keys.sampled(self.frames))
        return pos * UNIT_M, quat

    def _local(self, name: str) -> Floats:
        """Rotations (T, 4) of a bone, with those of the bones between it and its parent."""
        quat = self._keys(name)[1]
        for twist in _TWISTS.get(name[1:], ()):
            quat = rot.multiply(self._keys(name[0] + twist)[1], quat)
        if name[1:] == "腕":  # it does not turn with the parent of the shoulder
            quat = rot.multiply(rot.invert(self._keys(f"{name[0]}肩P")[1]), quat)
        return quat

    def _below(self, parent: _Transform, name: str, offset_m: Floats) -> _Transform:
        """The transform of a bone whose rest position is `offset_m` (3,) from that of its parent."""
        pos_m, quat = self._keys(name)
        return parent[0] + rot.rotate(parent[1], pos_m + offset_m), rot.multiply(parent[1], quat)

    def _root(self) -> _Transform:
        return self._keys("全ての親")

    def _waist(self) -> _Transform:
        """Positions of the waist and rotations of all bones above upper and lower body."""
        centre = self._below(self._root(), CENTRE, CENTRE_POS_M)
        groove = self._below(centre, "グルーブ", np.zeros(3))
        return self._below(groove, "腰", self.body.offsets_m[0] - CENTRE_POS_M)

    def _bend_leg(self, side: str, waist_m: Floats, local: Floats) -> None:
        """Move a leg in `local` (T, J, 4) by the IK of its foot, in the frames in which it is on."""
        mark, body = SIDES[side], self.body
        if f"{mark}足IK" not in self.file.bones:
            return
        hip, knee, ankle, toe = (body.index(f"{mark}{part}") for part in ("足", "ひざ", "足首", "つま先"))
        ankle_m = body.rest_pos_m()[ankle]
        above_m = ankle_m * np.array([1.0, 0.0, 1.0])
        above = self._below(self._root(), f"{mark}足IK親", above_m)
        target_m, target = self._below(above, f"{mark}足IK", ankle_m - above_m)
        hip_m = waist_m + rot.rotate(local[:, 0], body.offsets_m[hip])
        thigh, bent = bend_leg(rot.multiply(local[:, 0], local[:, hip]), hip_m, target_m)
        shin = rot.multiply(thigh, bent)
        foot = rot.multiply(shin, local[:, ankle])  # (T, 4)
        along = rot.rotate(foot, np.broadcast_to(body.offsets_m[toe], target_m.shape))
        toe_m = target_m + rot.rotate(target, self._keys(f"{mark}つま先IK")[0] + body.offsets_m[toe])
        reached_m = hip_m + rot.rotate(thigh, body.offsets_m[knee]) + rot.rotate(shin, body.offsets_m[ankle])
        pointed = rot.multiply(rot.between(along, toe_m - reached_m), foot)
        foot = np.where(self._is_on(f"{mark}つま先IK")[:, None], pointed, foot)
        on = self._is_on(f"{mark}足IK")
        for joint, quat in (
            (hip, rot.multiply(rot.invert(local[:, 0]), thigh)),
            (knee, bent),
            (ankle, rot.multiply(rot.invert(shin), foot)),
        ):
            local[on, joint] = quat[on]

    def _is_on(self, name: str) -> NDArray[np.bool_]:
        """Whether the IK of a bone is on (T,), as it is before its first key."""
        on = np.ones(len(self.frames), bool)
        for frame, state in self.file.switches.get(name, ()):
            on[frame:] = state
        return on


def _known_bones() -> tuple[str, ...]:
    """The bones whose keys are read, in the form of names of `VmdFile`."""
    above = ("全ての親", CENTRE, "グルーブ", "腰")
    own = tuple(name for name in standard_body().names if name[1:] not in UNKEYED)
    limbs = ("腕捩", "手捩", "肩P", "足IK親", "足IK", "つま先IK")
    return (*above, *own, *(f"{mark}{name}" for mark in SIDES.values() for name in limbs))


class VmdWriter(Writer):
    """Writes a key of each bone in each frame, at 30 fps, for standard models of any size.

    A motion on another skeleton is retargeted to the standard body. Feet have IK, which is on, and legs have
    the rotations that the IK gives on that body. Knees bend about one axis, as in the models, and not
    backwards. In a dance, fingers are relaxed, or open or a fist in its `figures`.
    """

    format = "vmd"
    figures: Sequence[Figure] = ()  # that are danced, in seconds of the motion

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`. Raises `ParameterError` if its joint names are unknown."""
        body = standard_body()
        n_frames = max(1, seconds_to_frames(motion.duration_s, VMD_FPS))
        frames = frame_times_s(n_frames, VMD_FPS) * motion.fps
        motion = motion if motion.fps == VMD_FPS else motion.sampled_smooth(frames, fps=VMD_FPS)
        dancer = motion if motion.skeleton.same_as(body) else retarget(motion, body)
        keys = _bone_keys(on_hinges(dancer))
        if self.is_dance:
            keys |= _finger_keys(n_frames, self.figures)
        content = vmd_bytes(
            DANCE_MODEL if self.is_dance else MODEL,
            keys,
            [f"{mark}{name}" for name in ("足ＩＫ", "つま先ＩＫ") for mark in SIDES.values()],
        )
        path.write_bytes(content)


def on_hinges(motion: Motion) -> Motion:
    """The motion on the standard body with knees that bend about their X axis alone, and not backwards.

    Hips, ankles and feet do not move. Knees that bend backwards do.
    """
    body = motion.skeleton
    pos_m, world = forward(body, motion.root_pos_m, motion.local_quat)
    world = world.copy()
    for mark in SIDES.values():
        hip, knee, ankle = (body.index(f"{mark}{part}") for part in ("足", "ひざ", "足首"))
        bones = pos_m[:, knee] - pos_m[:, hip], pos_m[:, ankle] - pos_m[:, knee]
        thigh, bent = bend_leg(hinged_thigh(world[:, hip], *bones), pos_m[:, hip], pos_m[:, ankle])
        world[:, hip], world[:, knee] = thigh, rot.multiply(thigh, bent)
    return Motion(body, motion.root_pos_m, rot.make_continuous(to_local(body, world)), motion.fps)


def _bone_keys(motion: Motion) -> dict[str, BoneKeys]:
    """Keys of all bones that are written, by name, for a motion on the standard body."""
    body, local = motion.skeleton, motion.local_quat
    pos_m, world = forward(body, motion.root_pos_m, local)
    rest_m = body.rest_pos_m()
    still, unturned = np.zeros_like(motion.root_pos_m), np.tile(rot.IDENTITY, (motion.n_frames, 1))
    bones: dict[str, _Transform] = {CENTRE: (motion.root_pos_m - rest_m[0], unturned)}
    for joint, name in enumerate(body.names):
        if name[1:] not in UNKEYED:
            # The upper body is a child of the centre in a model, and of the lower body here.
            bones[name] = still, world[:, joint] if name in (LOWER, UPPER) else local[:, joint]
    for mark in SIDES.values():
        ankle = body.index(f"{mark}足首")
        bones[f"{mark}足ＩＫ"] = pos_m[:, ankle] - rest_m[ankle], world[:, ankle]
        bones[f"{mark}つま先ＩＫ"] = still, unturned
    return {name: _dense_keys(*of) for name, of in bones.items()}


def _dense_keys(pos_m: Floats, quat: Floats) -> BoneKeys:
    """A key in each frame, or a single one for a bone that does not move."""
    moving = any(bool((values != values[0]).any()) for values in (pos_m, quat))
    n_keys = len(pos_m) if moving else 1
    pos, quat = mirrored(pos_m[:n_keys] / UNIT_M, rot.make_continuous(quat[:n_keys]))
    return BoneKeys(np.arange(n_keys), pos, quat, linear_curves(n_keys))


def _finger_keys(n_frames: int, figures: Sequence[Figure]) -> dict[str, BoneKeys]:
    """Keys of the bones of fingers, in the frames in which they begin, change, or come to rest."""
    shares = shape_shares(n_frames, VMD_FPS, hand_spans(figures))  # (T, S)
    changes = (np.diff(shares, axis=0) != 0.0).any(axis=1)  # (T - 1,)
    keyed = np.flatnonzero(np.append(changes, False) | np.insert(changes, 0, True))
    keys = {}
    for side in SIDES:
        for name, turns in finger_turns(side, shares[keyed]).items():
            pos, quat = mirrored(np.zeros((len(keyed), 3)), rot.make_continuous(turns))
            keys[name] = BoneKeys(keyed, pos, quat, linear_curves(len(keyed)))
    return keys


WRITERS = (VmdWriter,)
