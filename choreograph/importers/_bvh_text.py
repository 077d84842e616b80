"""Parser of BVH text: the file's hierarchy and numbers as arrays, in its own units and axes."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import FormatError, ParameterError
from choreograph.files import read_bytes
from choreograph.motion.motion import check_length
from choreograph.motion.skeleton import MAX_JOINTS

_CHANNELS = frozenset(axis + kind for axis in "xyz" for kind in ("position", "rotation"))
_COMMENT = re.compile(r"(?:#|//)[^\n]*")
_MOTION = re.compile(r"^[ \t]*MOTION\b", re.MULTILINE | re.IGNORECASE)
_SPACE = re.compile(r"\s")
_TIMING = re.compile(r"\s*Frames\s*:\s*(\S+)\s+Frame\s+Time\s*:\s*(\S+)", re.IGNORECASE)
_MAX_BYTES = 1 << 29
_BLOCK_LETTERS = 1 << 20
_LARGEST = 1e7  # bound on lengths and angles in any unit; keeps later arithmetic finite


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


def read_text(path: Path) -> str:
    """The file's text, in any common encoding and with any line ends.

    Raises `ParameterError` if there is no such file, `FormatError` if it cannot be read.
    """
    if not path.exists():
        raise ParameterError(f"no file {path}")
    data = read_bytes(path, "a text file", max_bytes=_MAX_BYTES)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # only joint names can hold more than ASCII
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_bvh(text: str) -> BvhText:
    """Parse BVH text; `FormatError` (without the file's name) if it is incomplete or damaged."""
    parts = _MOTION.split(text, maxsplit=1)
    if not re.search(r"^\s*HIERARCHY\b", parts[0], re.MULTILINE | re.IGNORECASE):
        what = "nothing" if not text.strip() else repr(text.strip()[:20])
        raise FormatError(f"expected a BVH, which starts with HIERARCHY, got {what}")
    bvh = _Hierarchy(_COMMENT.sub("", parts[0])).parse()
    if len(parts) == 1:
        raise FormatError(
            "expected a MOTION section after the hierarchy, got none: the file is cut off or a skeleton only"
        )
    body = _COMMENT.sub("", parts[1]) if "#" in parts[1] or "//" in parts[1] else parts[1]
    _parse_motion(body, bvh)
    return bvh


class _Hierarchy:
    """Parser, with a stack, of the tokens between HIERARCHY and MOTION."""

    def __init__(self, text: str) -> None:
        self.tokens = re.sub(r"([{}])", r" \1 ", text).split()[1:]
        self.position = 0
        self.copies: dict[str, int] = {}  # name -> how often it was read
        self.bvh = BvhText()

    def parse(self) -> BvhText:
        stack: list[int] = []  # open joints; an end site is stored as -2 - its joint
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
                raise FormatError(f"unexpected {word!r} in the hierarchy")
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
        try:
            value = float(token)
        except ValueError:
            value = np.nan
        if not abs(value) < _LARGEST:
            raise FormatError(f"expected a number after {where}, got {token!r}")
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
                "expected one ROOT with every JOINT inside it; several bodies in a file are not read"
            )
        joint = len(bvh.names)
        if joint == MAX_JOINTS:
            raise FormatError(f"expected at most {MAX_JOINTS} joints, got more")
        name = base = self.name_until_brace() or f"joint{joint}"
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
            raise FormatError(f"expected 0 to 6 channels on {self.bvh.names[joint]!r}, got {count:g}")
        names = [self.next_token().lower() for _ in range(int(count))]
        if not _CHANNELS.issuperset(names) or len(set(names)) != len(names):
            raise FormatError(
                f"expected different positions and rotations as channels, got {' '.join(names)}"
            )
        self.bvh.channels[joint] = names


def _parse_motion(body: str, bvh: BvhText) -> None:
    timing = _TIMING.match(body)
    if timing is None:
        raise FormatError('expected "Frames:" and "Frame Time:" after MOTION')
    n_channels = sum(map(len, bvh.channels))
    try:
        n_frames = int(timing[1])
    except ValueError:
        raise FormatError(f"expected a number of frames, got {timing[1]!r}") from None
    bvh.fps = _frame_rate(timing[2])
    check_length(max(n_frames, 1), len(bvh.names), bvh.fps)
    values, n_found = _numbers(body, timing.end(), n_frames * n_channels)
    if n_frames <= 0 or n_found == 0:
        raise FormatError(f"no motion: {n_frames} frames announced, {n_found} numbers found")
    if n_found != n_frames * n_channels:
        raise FormatError(
            f"expected {n_frames} frames of {n_channels} numbers, found {n_found / n_channels:.6g}: "
            "the frame count is wrong or the file is cut off"
        )
    bvh.values = values.reshape(n_frames, n_channels)  # (T, C)
    bad = ~(np.abs(bvh.values) < _LARGEST)
    if bad.any():
        frame, channel = np.argwhere(bad)[0]
        raise FormatError(
            f"frame {frame} holds {bvh.values[frame, channel]}, which is not a valid length or angle"
        )


def _numbers(text: str, start: int, most: int) -> tuple[NDArray[np.float64], int]:
    """The numbers between spaces from a letter on, and how many there are; those beyond `most` are counted.

    Read block by block, since words take much more memory than their text or numbers.
    """
    blocks, n_found = [np.zeros(0)], 0
    while start < len(text):
        space = _SPACE.search(text, start + _BLOCK_LETTERS)
        end = len(text) if space is None else space.start()
        words = text[start:end].split()
        if n_found <= most:
            try:
                blocks.append(np.array(list(map(float, words))))
            except ValueError as error:
                raise FormatError(
                    f"the motion contains something that is not a number: {str(error)[:100]}"
                ) from None
        n_found += len(words)
        start = end
    return np.concatenate(blocks), n_found


def _frame_rate(frame_time: str) -> float:
    """Frames per second, rounded to a whole rate if that has the given frame time at the digits printed."""
    try:
        seconds = float(frame_time)
    except ValueError:
        seconds = np.nan
    if not 1e-4 <= seconds <= 10.0:
        raise FormatError(f"expected a frame time in seconds, got {frame_time!r}")
    whole = round(1.0 / seconds)
    digits = len(frame_time.partition(".")[2])
    # With fewer than 4 digits 60 and 59.9 print alike; the whole rate is more probable.
    return float(whole) if whole and abs(1.0 / whole - seconds) < 10.0 ** -max(digits, 3) else 1.0 / seconds
