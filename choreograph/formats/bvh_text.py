"""Parser of BVH text: the hierarchy and numbers of a file as arrays, in its own units and axes.

End-of-file marks after the motion, decimal commas, and a number of frames that is off by one or two are
accepted with a note. A comment begins with # or // at the beginning of a word. "-1.#IND00", which C libraries
print for NaN, is therefore one word, a missing value.
"""

from __future__ import annotations

import re
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.budgets import BUDGETS
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import read_bytes
from choreograph.formats.writer import name_of_word
from choreograph.motion.motion import check_length
from choreograph.motion.skeleton import MAX_JOINTS

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
    values: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))  # (T, all channels)
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
    body = _without_end_marks(motion[0], bvh.notes)
    if "#" in body or "//" in body:
        body = _COMMENT.sub("", body)
    _parse_motion(body, bvh)
    if bvh.has_decimal_commas:
        bvh.notes.append("numbers have decimal commas, which are read as points")
    return bvh


def _without_end_marks(body: str, notes: list[str]) -> str:
    """The text without the ^Z and NULs at its end. They are noted."""
    end = len(body.rstrip(_END_MARKS + " \t\n"))
    marks = sum(body.count(mark, end) for mark in _END_MARKS)
    if marks:
        notes.append(f"{marks} end-of-file marks (^Z, NUL) after the motion are left out")
    return body[:end]


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
    n_channels = sum(map(len, bvh.channels))
    announced = _frame_count(timing[1])
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


def _numbers(text: str, start: int, most: int) -> tuple[NDArray[np.float64], int]:
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


def _as_numbers(words: Sequence[str]) -> NDArray[np.float64]:
    try:
        return np.array(list(map(float, words)))
    except ValueError:
        values = np.array(list(map(_number_or_nan, words)))
    for word, value in zip(words, values, strict=True):
        if np.isnan(value) and not _is_missing(word):
            raise FormatError(f"the motion contains something that is not a number: {reprlib.repr(word)}")
    return values


def _number_or_nan(word: str) -> float:
    """The number of a word, with a decimal point or comma. NaN for a missing value and other words."""
    try:
        return float(word.replace(",", ".", 1))
    except ValueError:
        return np.nan


def _is_missing(word: str) -> bool:
    """Whether a word is a spelling of a missing value."""
    return _MISSING.fullmatch(word) is not None


def _frame_count(word: str) -> int:
    count = _number_or_nan(word)
    if not (abs(count) < _LARGEST and count.is_integer()):
        raise FormatError(f"expected a number of frames, got {reprlib.repr(word)}")
    return int(count)


def _frame_rate(frame_time: str) -> float:
    """Frames per second, or the whole rate that has the same frame time in the printed digits."""
    seconds = _number_or_nan(frame_time)
    if not 1e-4 <= seconds <= 10.0:
        raise FormatError(f"expected a frame time in seconds, got {reprlib.repr(frame_time)}")
    whole = round(1.0 / seconds)
    digits = -int(Decimal(frame_time.replace(",", ".")).as_tuple().exponent)
    # With fewer than 4 digits, 60 and 59.9 are the same text. The whole rate is more probable.
    return float(whole) if whole and abs(1.0 / whole - seconds) < 10.0 ** -max(digits, 3) else 1.0 / seconds
