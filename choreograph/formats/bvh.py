"""BVH: a parser of the text, a reader of any channels, Euler order, unit and axis, and a writer.

`parse_bvh` gives the hierarchy and the numbers of a file in its own units and axes. End-of-file marks after
the motion, decimal commas, and a number of frames that is off by one or two are accepted with a note. A
comment begins with # or // at the beginning of a word. "-1.#IND00", which C libraries print for NaN, is
therefore one word, a missing value. `read_bvh` makes a motion of it: metres, Y up, from the hips down.
"""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import as_number
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import BUDGETS, read_bytes
from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.progress import one_line
from choreograph.core.settings import settings
from choreograph.formats.axes_and_units import known_roles, rotation_to_y_up, to_rotated_axes, unit_m
from choreograph.formats.writer import Writer, name_of_word, renamed, with_rest_pose, word_of
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import PosedBones, take_bones
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Credits, Motion, Take, check_length
from choreograph.motion.skeleton import MAX_JOINTS, Skeleton, descendants

# The text of a file as arrays, in its own units and axes.


_CHANNELS = frozenset(axis + kind for axis in "xyz" for kind in ("position", "rotation"))
_COMMENT = re.compile(r"(?<![^\s{}])(?:#|//)[^\n]*")
_MOTION = re.compile(r"^[ \t]*MOTION\b", re.MULTILINE | re.IGNORECASE)
_SPACE = re.compile(r"\s")
# 1.#IND, 1.#QNAN, 1.#INF and, rounded, 1.#J of MSVC, nan(ind) and nan(0x8000) of others, NaNQ of AIX.
_MISSING = re.compile(r"[+-]?(?:\d+[.,]#[a-z]+\d*|nan(?:[qs]|\(\w*\))?)", re.IGNORECASE)
_END_MARKS = "\x1a\0"  # ^Z of DOS, and padding to the size of a block
_TIMING = re.compile(r"\s*Frames\s*:\s*(\S+)\s+Frame\s+Time\s*:\s*(\S+)", re.IGNORECASE)
_BLOCK_LETTERS = 1 << 20
_MISCOUNTED_FRAMES = 2  # programs count from 0, or leave out the rest pose
_CHANNELLESS_JOINTS = 256  # beyond one joint for each channel: props, ends, fingers
_LARGEST = 1e7  # length or angle in any unit, so that arithmetic stays finite


@dataclass
class BvhText:
    """A parsed file, in the file's units (degrees, unknown length) and axes."""

    names: list[str] = field(default_factory=list)  # J of them
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[list[str]] = field(default_factory=list)  # per joint, such as "xposition"
    tip_parents: list[int] = field(default_factory=list)
    tips: list[list[float]] = field(default_factory=list)
    values: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # (T, all channels)
    fps: float = 0.0
    notes: list[str] = field(default_factory=list)  # on what is unusual in the text
    has_decimal_commas: bool = False


def read_text(path: Path) -> str:
    """The text of a file, in any common encoding and with any line ends.

    Raises `ParameterError` if the file does not exist, `FormatError` if it cannot be read.
    """
    if not path.exists():
        raise ParameterError(f"no file {path}")
    data = read_bytes(path, "a text file", max_bytes=BUDGETS["bvh"].file_bytes)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")  # only joint names can hold more than ASCII
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_bvh(text: str) -> BvhText:
    """Parse BVH text. Raises `FormatError`, without the name of the file, if it is incomplete or damaged."""
    head, *motion = _MOTION.split(text, maxsplit=1)
    tokens = _COMMENT.sub("", head).replace("{", " { ").replace("}", " } ").split()
    if not tokens or tokens[0].upper() != "HIERARCHY":
        what = reprlib.repr(tokens[0]) if tokens else "nothing"
        raise FormatError(f"expected a BVH, which starts with HIERARCHY, got {what}")
    bvh = _Hierarchy(tokens[1:]).parse()
    if not motion:
        raise FormatError(
            "expected a MOTION section after the hierarchy, got none: the file is cut off or a skeleton only"
        )
    end = len(motion[0].rstrip(_END_MARKS + " \t\n"))
    body, n_marks = motion[0][:end], sum(motion[0].count(mark, end) for mark in _END_MARKS)
    if n_marks:
        bvh.notes.append(f"{n_marks} end-of-file marks (^Z, NUL) after the motion are left out")
    if "#" in body or "//" in body:
        body = _COMMENT.sub("", body)
    _parse_motion(body, bvh)
    if bvh.has_decimal_commas:
        bvh.notes.append("numbers have decimal commas, which are read as points")
    return bvh


class _Hierarchy:
    """Parses the tokens between HIERARCHY and MOTION with a stack."""

    def __init__(self, tokens: list[str]) -> None:
        self.tokens = tokens
        self.position = 0
        self.copies: dict[str, int] = {}  # name -> how often it was read
        self.bvh = BvhText()

    def parse(self) -> BvhText:
        stack: list[int] = []  # open joints, and -2 - joint for an end site
        while self.position < len(self.tokens):
            word = self.next_token().upper()
            if word in ("ROOT", "JOINT"):
                stack.append(self.open_joint(word, stack))
            elif word == "END":
                self.name_until_brace()
                stack.append(-2 - self.enclosing(stack, word))
            elif word == "OFFSET":
                self.offset(self.enclosing(stack, word, tip=True), [self.number(word) for _ in range(3)])
            elif word == "CHANNELS":
                self.channels(self.enclosing(stack, word))
            elif word == "}" and stack:
                stack.pop()
            else:
                raise FormatError(f"unexpected {reprlib.repr(word)} in the hierarchy")
        if stack:
            raise FormatError(
                "the hierarchy ends inside a joint: a closing brace is missing or the file is cut off"
            )
        if not self.bvh.names:
            raise FormatError("the hierarchy has no joints")
        if not any(self.bvh.channels):
            raise FormatError("no joint has channels: there is no motion")
        return self.bvh

    def next_token(self) -> str:
        if self.position == len(self.tokens):
            raise FormatError("the hierarchy ends in the middle of a line: the file is cut off")
        self.position += 1
        return self.tokens[self.position - 1]

    def number(self, where: str) -> float:
        token = self.next_token()
        value = _number_or_nan(token)
        if not abs(value) < _LARGEST:
            raise FormatError(f"expected a number after {where}, got {reprlib.repr(token)}")
        self.bvh.has_decimal_commas |= "," in token
        return value

    def name_until_brace(self) -> str:
        words = []
        while (word := self.next_token()) != "{":
            words.append(word)
        return " ".join(words)  # 3ds Max writes names with spaces

    @staticmethod
    def enclosing(stack: list[int], word: str, *, tip: bool = False) -> int:
        if not stack or (stack[-1] < 0 and not tip):
            raise FormatError(f"{word} outside a joint in the hierarchy")
        return stack[-1]

    def open_joint(self, word: str, stack: list[int]) -> int:
        bvh = self.bvh
        if (word == "ROOT") != (not bvh.names) or (word == "JOINT" and (not stack or stack[-1] < 0)):
            raise FormatError(
                "expected one ROOT with every JOINT inside it, since several bodies in a file are not read"
            )
        joint = len(bvh.names)
        if joint == MAX_JOINTS:
            raise FormatError(f"expected at most {MAX_JOINTS} joints, got more")
        written = self.name_until_brace()
        name = base = name_of_word(written) if written else f"joint{joint}"
        while name in self.copies:
            self.copies[base] += 1
            name = f"{base}_{self.copies[base]}"
        self.copies[name] = 1
        bvh.names.append(name)
        bvh.parents.append(stack[-1] if stack else -1)
        bvh.offsets.append([0.0, 0.0, 0.0])
        bvh.channels.append([])
        return joint

    def offset(self, owner: int, offset: list[float]) -> None:
        if owner >= 0:
            self.bvh.offsets[owner] = offset
        else:
            self.bvh.tip_parents.append(-2 - owner)
            self.bvh.tips.append(offset)

    def channels(self, joint: int) -> None:
        count = self.number("CHANNELS")
        if count not in range(7):
            raise FormatError(
                f"expected 0 to 6 channels on {reprlib.repr(self.bvh.names[joint])}, got {count:g}"
            )
        names = [self.next_token().lower() for _ in range(int(count))]
        if not _CHANNELS.issuperset(names) or len(set(names)) != len(names):
            raise FormatError(
                f"expected different positions and rotations as channels, got {reprlib.repr(' '.join(names))}"
            )
        self.bvh.channels[joint] = names


def _parse_motion(body: str, bvh: BvhText) -> None:
    timing = _TIMING.match(body)
    if timing is None:
        raise FormatError('expected "Frames:" and "Frame Time:" after MOTION')
    n_channels, stated = sum(map(len, bvh.channels)), _number_or_nan(timing[1])
    if not (abs(stated) < _LARGEST and stated.is_integer()):
        raise FormatError(f"expected a number of frames, got {reprlib.repr(timing[1])}")
    announced = int(stated)
    bvh.fps = _frame_rate(timing[2])
    check_length(max(announced, 1), len(bvh.names), bvh.fps)
    if len(bvh.names) > n_channels + _CHANNELLESS_JOINTS:  # a short file would need much memory
        raise FormatError(
            f"expected channels on most joints, got {n_channels} channels of {len(bvh.names)} joints"
        )
    most = (announced + _MISCOUNTED_FRAMES) * n_channels
    values, n_found = _numbers(body, timing.end(), most)
    if n_found == 0 or announced < 0:
        raise FormatError(f"expected a motion, got {announced} stated frames and {n_found} numbers")
    n_frames, rest = divmod(n_found, n_channels)
    if rest or n_frames == 0 or abs(n_frames - announced) > _MISCOUNTED_FRAMES:
        raise FormatError(
            f"expected {announced} frames of {n_channels} numbers, found {n_found / n_channels:.6g}: "
            "the frame count is wrong or the file is cut off"
        )
    if n_frames != announced:
        bvh.notes.append(f"the file states {announced} frames and contains {n_frames}, which are read")
    bvh.has_decimal_commas |= "," in timing[2] or body.find(",", timing.end()) >= 0
    bvh.values = values.reshape(n_frames, n_channels)  # (T, C)
    bad = ~(np.abs(bvh.values) < _LARGEST)
    if bad.any():
        frame, channel = np.argwhere(bad)[0]
        raise FormatError(
            f"frame {frame} holds {bvh.values[frame, channel]}, which is not a valid length or angle"
        )


def _numbers(text: str, start: int, most: int) -> tuple[Floats, int]:
    """The numbers from a character on, and how many there are. Those beyond `most` are only counted.

    They are read in blocks, because words need much more memory than their text or numbers.
    """
    blocks, n_found = [np.zeros(0)], 0
    while start < len(text):
        space = _SPACE.search(text, start + _BLOCK_LETTERS)
        end = len(text) if space is None else space.start()
        words = text[start:end].split()
        if n_found <= most:
            blocks.append(_as_numbers(words))
        n_found += len(words)
        start = end
    return np.concatenate(blocks), n_found


def _as_numbers(words: Sequence[str]) -> Floats:
    try:
        return np.array(list(map(float, words)))
    except ValueError:
        values = np.array(list(map(_number_or_nan, words)))
    for word, value in zip(words, values, strict=True):
        if np.isnan(value) and _MISSING.fullmatch(word) is None:
            raise FormatError(f"the motion contains something that is not a number: {reprlib.repr(word)}")
    return values


def _number_or_nan(word: str) -> float:
    """The number of a word, with a decimal point or comma. NaN for a missing value and other words."""
    try:
        return float(word.replace(",", ".", 1))
    except ValueError:
        return np.nan


def _frame_rate(frame_time: str) -> float:
    """Frames per second, or the whole rate that has the same frame time in the printed digits."""
    seconds = _number_or_nan(frame_time)
    if not 1e-4 <= seconds <= 10.0:
        raise FormatError(f"expected a frame time in seconds, got {reprlib.repr(frame_time)}")
    whole = round(1.0 / seconds)
    digits = -int(Decimal(frame_time.replace(",", ".")).as_tuple().exponent)
    # With fewer than 4 digits, 60 and 59.9 are the same text. The whole rate is more probable.
    return float(whole) if whole and abs(1.0 / whole - seconds) < 10.0 ** -max(digits, 3) else 1.0 / seconds


# Takes and motions.


LAYOUT = "a single NAME.bvh"
SUFFIXES = (".bvh",)
READS_BONE_MAP = True
_NAMED = 6  # joints in a note, which counts the others
_POSES = 4  # of the motion, in which bones are searched if the rest pose does not show them
_VARIES_M = 1e-3  # bone offsets that vary by more get a note


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take]:
    """The file as a take without music, named after it."""
    motion, notes = read_bvh(path, bone_map)
    yield Take(path.stem, motion, Credits(source=path.name), source_paths=(path,), notes=notes)


def read_bvh(path: str | Path, bone_map: Mapping[str, str] | None = None) -> tuple[Motion, tuple[str, ...]]:
    """Read a BVH file at its own frame rate.

    Position channels are the full translation of a joint, as in common exporters and readers. If all of them
    below the root stay near zero while the offsets do not, they are added to the offsets instead. The hips
    become the root: transforms above them are applied to them, and other branches are left out. Bone offsets
    that vary over time are replaced by their mean. If the names of the joints are unknown, or `bone_map` is
    given, the skeleton has `roles` for the joints that were found.

    Returns
    -------
    motion : Motion             metres, Y up
    notes : tuple of str        what was inferred (the unit) or is unusual, one line each

    Raises
    ------
    ParameterError   if the file does not exist
    FormatError      if it is not a valid BVH
    """
    path = Path(path)
    text = read_text(path)
    try:
        return _to_motion(parse_bvh(text), bone_map)
    except (FormatError, ParameterError) as error:
        raise FormatError(f"{path}: {error}") from None


@dataclass(frozen=True)
class _Body:
    """Joints with translation and rotation in each frame, in the file's units and axes."""

    names: tuple[str, ...]
    parents: NDArray[np.int64]  # (J,)
    rest: Floats  # (J, 3)
    local_pos: Floats  # (T, J, 3)
    local_quat: Floats  # (T, J, 4)
    tip_parents: NDArray[np.int64]  # (E,)
    tips: Floats  # (E, 3)
    roles: Mapping[str, int] | None = None  # if they are not known by the names

    def skeleton(self) -> Skeleton:
        """The skeleton, whose bone offsets are the mean translations of the joints."""
        offsets = self.local_pos.mean(axis=0)  # (J, 3)
        offsets[0] = self.rest[0]
        return Skeleton(self.names, self.parents, offsets, self.tip_parents, self.tips, roles=self.roles)

    def with_roles(self, bone_map: Mapping[str, str] | None, notes: list[str]) -> _Body:
        """The body with roles, if the names of its joints are unknown."""
        skeleton = self.skeleton()
        tips = skeleton.tip_parents, skeleton.rest_pos_m()[skeleton.tip_parents] + skeleton.tips_m
        rig = PosedBones(self.names, self.parents, skeleton.rest_pos_m(), *tips)
        roles, note = take_bones(rig, self._poses(skeleton), bone_map)
        notes += [note] if note else []
        return replace(self, roles=roles)

    def _poses(self, skeleton: Skeleton) -> Iterator[PosedBones]:
        """Some frames of the motion."""
        for frame in np.linspace(0, len(self.local_pos) - 1, _POSES).astype(int):
            pos, quat = forward(skeleton, self.local_pos[[frame], 0], self.local_quat[[frame]])
            owners = skeleton.tip_parents
            tip_pos = pos[0, owners] + rot.rotate(quat[0, owners], skeleton.tips_m)
            yield PosedBones(self.names, self.parents, pos[0], owners, tip_pos)


def _to_motion(text: BvhText, bone_map: Mapping[str, str] | None) -> tuple[Motion, tuple[str, ...]]:
    notes = list(text.notes)
    body = _from_hips(_body(text, notes).with_roles(bone_map, notes), notes)
    skeleton = body.skeleton()
    spread = np.abs(body.local_pos[:, 1:] - skeleton.offsets_m[1:]).max(initial=0.0, axis=(0, 2))  # (J-1,)
    motion = Motion(skeleton, body.local_pos[:, 0], rot.make_continuous(body.local_quat), text.fps)
    pos = motion.joint_pos_m()[:: max(1, motion.n_frames // 500)]  # (T', J, 3), still in the file's unit
    metres, note = unit_m(skeleton, pos)
    notes.append(note)
    varying = spread * metres > _VARIES_M
    if varying.any():
        notes.append(
            f"{varying.sum()} bones vary in length by up to {spread.max() * metres:.2g} m: using the means"
        )
    rotation, note = rotation_to_y_up(skeleton, pos)
    if note:
        notes.append(note)
    offsets, quat = to_rotated_axes(rotation, skeleton.offsets_m * metres, motion.local_quat)
    upright = replace(skeleton, offsets_m=offsets, tips_m=rot.rotate(rotation, body.tips * metres))
    return Motion(upright, rot.rotate(rotation, motion.root_pos_m * metres), quat, text.fps), tuple(notes)


def _body(text: BvhText, notes: list[str]) -> _Body:
    n_frames, n_joints = len(text.values), len(text.names)
    rest = np.array(text.offsets)  # (J, 3)
    local_pos = np.repeat(rest[None], n_frames, axis=0)  # (T, J, 3)
    local_quat = np.tile(rot.IDENTITY, (n_frames, n_joints, 1))  # (T, J, 4)
    has_position = np.zeros(n_joints, bool)
    first = 0
    for joint, channels in enumerate(text.channels):
        columns = text.values[:, first : first + len(channels)]  # (T, C)
        first += len(channels)
        angles = [i for i, channel in enumerate(channels) if channel.endswith("rotation")]
        if angles:
            order = "".join(channels[i][0] for i in angles)
            order += "".join(axis for axis in "xyz" if axis not in order)  # rotations by 0 change nothing
            padded = np.zeros((n_frames, 3))
            padded[:, : len(angles)] = np.radians(columns[:, angles])
            local_quat[:, joint] = rot.from_euler(order, padded)
        for i, channel in enumerate(channels):
            if channel.endswith("position"):
                local_pos[:, joint, "xyz".index(channel[0])] = columns[:, i]
                has_position[joint] = joint > 0
    means = local_pos[:, has_position].mean(axis=0)  # (J', 3)
    if np.linalg.norm(means, axis=1).sum() < np.linalg.norm(means - rest[has_position], axis=1).sum():
        local_pos[:, has_position] += rest[has_position]
        notes.append("position channels below the root stay near zero: they are added to the bone offsets")
    tip_parents = np.array(text.tip_parents, np.int64)
    names, parents = tuple(text.names), np.array(text.parents)
    return _Body(names, parents, rest, local_pos, local_quat, tip_parents, np.array(text.tips).reshape(-1, 3))


def _from_hips(body: _Body, notes: list[str]) -> _Body:
    """The body from the hips down the hierarchy, with all transforms above applied to the hips."""
    roles = known_roles(body.skeleton())
    hips = roles.get("pelvis", 0)
    if hips == 0:
        return body
    chain = [hips]
    while body.parents[chain[-1]] >= 0:
        chain.append(int(body.parents[chain[-1]]))
    chain.reverse()
    pos, quat = body.local_pos[:, 0], body.local_quat[:, 0]
    for joint in chain[1:]:
        pos = pos + rot.rotate(quat, body.local_pos[:, joint])
        quat = rot.multiply(quat, body.local_quat[:, joint])
    kept = descendants(body.parents, hips)
    new = {joint: place for place, joint in enumerate(kept)}
    known = {*chain, *new}
    dropped = [name for joint, name in enumerate(body.names) if joint not in known]
    if dropped:
        more = f" and {len(dropped) - _NAMED} more" if len(dropped) > _NAMED else ""
        notes.append(f"left out joints that are not below the hips: {', '.join(dropped[:_NAMED])}{more}")
    tips = [i for i, parent in enumerate(body.tip_parents) if parent in new]
    rest, local_pos, local_quat = body.rest[kept], body.local_pos[:, kept], body.local_quat[:, kept]
    rest[0], local_pos[:, 0], local_quat[:, 0] = body.rest[chain].sum(axis=0), pos, quat
    return _Body(
        names=tuple(body.names[joint] for joint in kept),
        parents=np.array([-1] + [new[int(body.parents[joint])] for joint in kept[1:]]),
        rest=rest,
        local_pos=local_pos,
        local_quat=local_quat,
        tip_parents=np.array([new[int(body.tip_parents[i])] for i in tips], np.int64),
        tips=body.tips[tips],
        roles=None if body.roles is None else {role: new[joint] for role, joint in roles.items()},
    )


# The format has no comments. A file is known as a dance by zeros after the ten digits of its frame time.
DANCE_DIGITS = "000"


Naming = Literal["smpl", "mixamo", "ue", "vrm", "humanoid", "rigify"]
RestPose = Literal["t", "a"]


@settings
class BvhOptions:
    """Options of a BVH file. A field that cannot be used raises `ParameterError`.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, start_s=0.0, stop_s=4.0)
    >>> from choreograph.formats.bvh import BvhWriter
    >>> options = cg.BvhOptions(naming="mixamo", rest="t")
    >>> cg.save_motion("steps.bvh", motion, writer=BvhWriter(options))
    >>> cg.load_motion("steps.bvh").skeleton.names[:3]
    ('Hips', 'LeftUpLeg', 'LeftLeg')
    """

    units_per_m: float = 100.0
    """How many units of the file are a metre. 100 writes centimetres, as most programs expect."""

    order: Literal["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"] = "ZXY"
    """Order of the rotation channels. Change it for programs that expect another one."""

    naming: Naming = "smpl"
    """Whose joint names are written. Choose those of the program or rig that reads the file."""

    in_place: bool = False
    """Whether the hips stay above the place where they begin, so that a game can move the character."""

    rest: RestPose | None = None
    """Rest pose of the hierarchy, a standing T or A pose. None keeps that of the skeleton."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        as_number("a positive number of units per metre", self.units_per_m, above=0.0)


_MOST = 1e12  # that a number of a file may be for its digits to be found by whole numbers


class BvhWriter(Writer):
    """Writes six channels for the root and three for other joints, with five decimals.

    The error is far below a tenth of a millimetre at the fingertips.
    """

    format = "bvh"

    def __init__(self, options: BvhOptions | None = None) -> None:
        self.options = options or BvhOptions()

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`. Euler angles are unwrapped past 180 degrees, so that their curves can be edited."""
        if self.options.rest is not None:
            motion = with_rest_pose(motion, self.options.rest)
        motion = renamed(motion, self.options.naming)
        lines = [
            "HIERARCHY",
            *self._hierarchy(motion.skeleton, 0, ""),
            "MOTION",
            f"Frames: {motion.n_frames}",
        ]
        mark = DANCE_DIGITS if self.is_dance else ""
        lines.append(f"Frame Time: {1.0 / motion.fps:.10f}{mark}\n")
        with open(path, "wb") as file:
            file.write("\n".join(lines).encode())
            for rows in self._rows(motion):
                file.write(_lines_of(rows))

    def _rows(self, motion: Motion) -> Iterator[Floats]:
        """The numbers of each frame in blocks, (T_b, 3 + 3 J)."""
        order = _file_order(motion.skeleton)
        before = turns = np.zeros((1, len(order), 3))  # angles of the last frame, and the full turns added
        for block in frame_blocks(motion.n_frames):
            root_pos_m = motion.root_pos_m[block].copy()
            if self.options.in_place:
                root_pos_m[:, [0, 2]] = motion.root_pos_m[0, [0, 2]]
            angles = np.empty((len(root_pos_m), len(order), 3))
            for column, joint in enumerate(order):
                angles[:, column] = rot.to_euler(self.options.order, motion.local_quat[block, joint])
            before = angles[:1] if block.start == 0 else before
            turns = np.cumsum(np.concatenate([turns, _full_turns(np.concatenate([before, angles]))]), axis=0)
            unwrapped = angles + turns[1:]
            if block.start == 0:
                unwrapped[0] = angles[0]  # a zero keeps its sign
            before, turns = angles[-1:], turns[-1:]
            root = root_pos_m * self.options.units_per_m
            yield np.concatenate([root, np.degrees(unwrapped).reshape(len(root), -1)], axis=1)

    def _hierarchy(self, skeleton: Skeleton, joint: int, indent: str) -> list[str]:
        # A root offset of zero is safe for readers that add the position channels to it. A rest pose that was
        # requested stands on the floor.
        offset = skeleton.offsets_m[joint] if joint or self.options.rest else np.zeros(3)
        position = "Xposition Yposition Zposition " if joint == 0 else ""
        rotation = " ".join(f"{axis}rotation" for axis in self.options.order)
        lines = [
            f"{indent}{'JOINT' if joint else 'ROOT'} {word_of(skeleton.names[joint])}",
            f"{indent}{{",
            f"{indent}  {self._offset(offset)}",
            f"{indent}  CHANNELS {3 if joint else 6} {position}{rotation}",
        ]
        for child in np.flatnonzero(skeleton.parents == joint):
            lines += self._hierarchy(skeleton, int(child), indent + "  ")
        for tip in skeleton.tips_m[skeleton.tip_parents == joint]:
            lines += [
                f"{indent}  End Site",
                f"{indent}  {{",
                f"{indent}    {self._offset(tip)}",
                f"{indent}  }}",
            ]
        return [*lines, f"{indent}}}"]

    def _offset(self, offset_m: np.ndarray) -> str:
        return "OFFSET " + " ".join(f"{value:.6f}" for value in offset_m * self.options.units_per_m)


def _lines_of(rows: Floats) -> bytes:
    """Lines of text with the numbers (T, C) of each row, five decimals each. It is faster than `%`."""
    if not np.abs(rows).max() < _MOST:
        line = " ".join(["%.5f"] * rows.shape[1]) + "\n"
        return (line * len(rows) % tuple(rows.ravel().tolist())).encode()
    left = np.rint(np.abs(rows) * 1e5).astype(np.int64)  # (T, C)
    n_digits = max(6, len(str(left.max())))
    text = np.zeros((*rows.shape, n_digits + 3), np.uint8)  # a sign, digits, the point, and a space or an end
    text[..., 0] = np.where(np.signbit(rows), ord("-"), 0)
    text[..., -7], text[..., -1], text[:, -1, -1] = ord("."), ord(" "), ord("\n")
    for digit in range(n_digits):  # the last one first
        higher = left // 10
        shown = ord("0") + left - 10 * higher
        text[..., -2 - digit - (digit >= 5)] = shown if digit < 6 else np.where(left, shown, 0)
        left = higher
    return text[text != 0].tobytes()


def _full_turns(angles: Floats) -> Floats:
    """What `np.unwrap` adds from each of the angles (T, ...) on, (T - 1, ...): full turns, or zero."""
    steps = np.diff(angles, axis=0)
    wrapped = np.mod(steps + np.pi, 2 * np.pi) - np.pi
    np.copyto(wrapped, np.pi, where=(wrapped == -np.pi) & (steps > 0))
    added: Floats = wrapped - steps
    np.copyto(added, 0.0, where=np.abs(steps) < np.pi)
    return added


def _file_order(skeleton: Skeleton) -> list[int]:
    """Joints depth first, which is the order in the file. That of the skeleton may differ."""
    order: list[int] = []
    stack = [0]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack += np.flatnonzero(skeleton.parents == joint)[::-1].tolist()
    return order


WRITERS = (BvhWriter,)
