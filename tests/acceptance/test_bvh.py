"""100 sane BVH files, as programs write them: at most one is refused, all others are the same dance."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from acceptance.corpus import SaneFile, assert_read
from synthetic_characters import MIXAMO, RIGIFY, UNREAL, VRM
from synthetic_motions import swaying

from choreograph.formats.register import import_takes
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m

MOTION = swaying(40).resampled(30.0)
WITHIN_M = 0.02  # of the joints, against the pelvis


@dataclass(frozen=True)
class Style:
    """How a program writes BVH."""

    orders: tuple[str, ...] = ("ZXY",)  # of the joints in turn
    positions: str = "root"  # or "all", "zero" below the root, "last" after the root's rotations
    name: Callable[[str], str] = str
    units_per_m: float = 100.0
    indent: str = "\t"
    newline: str = "\n"
    space: str = " "
    number: str = "%.6f"
    keyword: Callable[[str], str] = str
    end_site: str = "End Site"  # "": leaves end without one
    brace: str = "\n"  # before an opening brace
    frame_time: str = "0.0333333"
    n_frames: int = 40
    announced: int = 0  # frames more than there are
    reference: bool = False  # a joint on the floor above the hips
    z_up: bool = False
    edit: Callable[[str], str] = str  # of the whole text
    encoding: str = "utf-8"
    tail: bytes = b""

    def write(self, folder: Path) -> Path:
        """The file in a folder."""
        text = self.edit(self._hierarchy() + self._motion()).replace("\n", self.newline)
        path = folder / "take.bvh"
        path.write_bytes(text.encode(self.encoding) + self.tail)
        return path

    def _order(self, joint: int) -> str:
        return self.orders[joint % len(self.orders)]

    def _channels(self, joint: int) -> list[str]:
        turns = [f"{axis}rotation" for axis in self._order(joint)]
        places = [f"{axis}position" for axis in "XYZ"]
        if joint and self.positions not in ("all", "zero"):
            return turns
        return turns + places if self.positions == "last" else places + turns

    def _row(self, values: np.ndarray) -> str:
        return self.space.join(self.number % value for value in values)

    def _turned(self, vectors: np.ndarray) -> np.ndarray:
        return rot.rotate(rot.from_rotvec(np.array([np.pi / 2, 0, 0])), vectors) if self.z_up else vectors

    def _offset(self, joint: int) -> np.ndarray:
        """The offset from the parent in the file's units; all rotations are turned with it where Z is up."""
        return self._turned(self.units_per_m * MOTION.skeleton.offsets_m[joint])

    def _hierarchy(self) -> str:
        lines = [self.keyword("HIERARCHY")]
        if self.reference:
            places = " ".join(f"{axis}position" for axis in "XYZ")
            lines += [f"{self.keyword('ROOT')} Reference{self.brace}{{", f"{self.keyword('OFFSET')} 0 0 0"]
            lines.append(f"{self.keyword('CHANNELS')} 6 {places} Zrotation Xrotation Yrotation")
        self._joint(0, lines, 1 if self.reference else 0)
        return "\n".join(lines) + ("\n}" if self.reference else "") + "\n"

    def _joint(self, joint: int, lines: list[str], depth: int) -> None:
        inside = self.indent * (depth + 1)
        kind = "JOINT" if depth else "ROOT"
        brace = f"{self.brace}{self.indent * depth if self.brace == chr(10) else ''}{{"
        lines.append(
            f"{self.indent * depth}{self.keyword(kind)} {self.name(MOTION.skeleton.names[joint])}{brace}"
        )
        lines.append(f"{inside}{self.keyword('OFFSET')} {self._row(self._offset(joint))}")
        channels = self._channels(joint)
        lines.append(f"{inside}{self.keyword('CHANNELS')} {len(channels)} {' '.join(channels)}")
        children = np.flatnonzero(MOTION.skeleton.parents == joint).tolist()
        for child in children:
            self._joint(child, lines, depth + 1)
        if not children and self.end_site:
            tip = self._row(self._turned(self.units_per_m * np.array([0.0, 0.05, 0.0])))
            lines.append(f"{inside}{self.keyword(self.end_site)}{self.brace}{{")
            lines += [f"{inside}{self.indent}{self.keyword('OFFSET')} {tip}", f"{inside}}}"]
        lines.append(f"{self.indent * depth}}}")

    def _motion(self) -> str:
        columns = [np.zeros((self.n_frames, 6))] if self.reference else []
        for joint in self._depth_first(0):
            order = self._order(joint)
            quat = MOTION.local_quat[: self.n_frames, joint]
            if self.z_up:
                turn = rot.from_rotvec(np.array([np.pi / 2, 0, 0]))
                quat = rot.multiply(rot.multiply(turn, quat), rot.invert(turn))
            parts = [np.degrees(rot.to_euler(order, quat))]
            if len(self._channels(joint)) == 6:
                if joint:
                    place = np.tile(self._offset(joint) * (self.positions != "zero"), (self.n_frames, 1))
                else:
                    place = self._turned(self.units_per_m * MOTION.root_pos_m[: self.n_frames])
                parts.insert(len(parts) if self.positions == "last" else 0, place)
            columns += parts
        rows = [self._row(row) for row in np.hstack(columns)]
        times = [f"Frames: {self.n_frames + self.announced}", f"Frame Time: {self.frame_time}"]
        return "\n".join([self.keyword("MOTION"), *map(self.keyword, times), *rows]) + "\n"

    def _depth_first(self, joint: int) -> list[int]:
        children = np.flatnonzero(MOTION.skeleton.parents == joint).tolist()
        return [joint] + [below for child in children for below in self._depth_first(child)]


def renamed(names: dict[str, str]) -> Callable[[str], str]:
    """The joints' names of another rig; hands, which it lacks, as they are."""
    return lambda name: names.get(name, f"{name}_end")


def of_biped(name: str) -> str:
    """3ds Max's names, with spaces."""
    parts = {
        "pelvis": "Pelvis", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck",
        "head": "Head",
        "hip": "Thigh", "knee": "Calf", "ankle": "Foot", "foot": "Toe0", "collar": "Clavicle",
        "shoulder": "UpperArm", "elbow": "Forearm", "wrist": "Hand", "hand": "Finger0",
    }  # fmt: skip
    side, _, part = name.rpartition("_")
    return f"Bip01 {side[:1].upper() + ' ' if side else ''}{parts[part]}"


def with_comments(text: str) -> str:
    return "# made by a program\n// and by hand\n" + text.replace("\nMOTION", "\n# the motion\nMOTION")


def with_comments_after(text: str) -> str:
    return text.replace("rotation\n", "rotation # angles in degrees\n")


def with_blank_rows(text: str) -> str:
    head, _, rows = text.partition("Frame Time")
    return head + "Frame Time" + rows.replace("\n", "\n\n")


def numbers_on_lines(text: str) -> str:
    head, _, rows = text.partition("Frame Time: ")
    time, _, numbers = rows.partition("\n")
    return f"{head}Frame Time: {time}\n" + numbers.replace(" ", "\n")


def with_second_body(text: str) -> str:
    """Two dancers in a file: the one kind of sane file that is refused."""
    head = text.partition("MOTION")[0].removeprefix("HIERARCHY\n")
    return text.replace("MOTION", head + "MOTION", 1)


PLAIN = Style()
ORDERS = ["".join(order) for order in itertools.permutations("XYZ")]
UNITS = {"metres": 1.0, "decimetres": 10.0, "inches": 39.3701, "CMU units": 17.7165, "millimetres": 1000.0}
TIMES = (
    "0.033333",
    "0.0333",
    "0.03333333333333333",
    ".0333333",
    "3.33333e-02",
    "3.333333E-2",
    "0.0333667",
    "0.04",
)
RATES = {
    "120 a second": "0.0083333",
    "240 a second": "0.004167",
    "60 a second": "0.0166667",
    "24": "0.0416667",
}
STYLES: dict[str, Style] = {
    "plain": PLAIN,
    **{f"order {order}": Style(orders=(order,)) for order in ORDERS},
    "another order for each joint": Style(orders=tuple(ORDERS)),
    "root in another order": Style(orders=("YXZ", *["ZXY"] * 23)),
    "positions on all joints": Style(positions="all"),
    "zero positions below the root": Style(positions="zero"),
    "root's positions last": Style(positions="last"),
    **{f"in {name}": Style(units_per_m=units) for name, units in UNITS.items()},
    "Z up": Style(z_up=True),
    **{f"frame time {time}": Style(frame_time=time) for time in TIMES},
    **{f"rate {name}": Style(frame_time=time) for name, time in RATES.items()},
    "one frame": Style(n_frames=1),
    "two frames": Style(n_frames=2),
    **{f"frames off by {off}": Style(announced=off) for off in (-2, -1, 1, 2)},
    "two spaces of indentation": Style(indent="  "),
    "no indentation": Style(indent=""),
    "eight spaces": Style(indent=" " * 8),
    "CRLF": Style(newline="\r\n"),
    "CR": Style(newline="\r"),
    "tabs between numbers": Style(space="\t"),
    "many spaces between numbers": Style(space="   "),
    "numbers of few digits": Style(number="%.3f"),
    "scientific numbers": Style(number="%.6e"),
    "scientific numbers in capitals": Style(number="%.6E"),
    "short numbers": Style(number="%.6g"),
    "numbers with signs": Style(number="%+.5f"),
    "numbers in columns": Style(number="%12.5f"),
    "many digits": Style(number="%.15f"),
    "lower-case keywords": Style(keyword=str.lower),
    "upper-case keywords": Style(keyword=str.upper, end_site="END SITE"),
    "capitalised keywords": Style(keyword=str.title),
    "End site": Style(end_site="End site"),
    "End with a name": Style(end_site="End Effector"),
    "no end sites": Style(end_site=""),
    "brace on the line": Style(brace=" "),
    "brace without a space": Style(brace=""),
    "byte order mark": Style(encoding="utf-8-sig"),
    "UTF-16": Style(encoding="utf-16"),
    "UTF-16 with CRLF": Style(encoding="utf-16", newline="\r\n"),
    "Latin-1 names": Style(name=lambda name: f"Körper:{name}", encoding="latin-1"),
    "names in UTF-8": Style(name=lambda name: f"体:{name}"),
    "names of Mixamo": Style(name=renamed(MIXAMO)),
    "names of Unreal": Style(name=renamed(UNREAL)),
    "names of Rigify": Style(name=renamed(RIGIFY)),
    "names of VRM": Style(name=renamed(VRM)),
    "names with spaces": Style(name=of_biped),
    "names with spaces and a brace on the line": Style(name=of_biped, brace=" "),
    "names with a prefix": Style(name=lambda name: f"Character1_{name}"),
    "names with a namespace": Style(name=lambda name: f"dancer:rig:{name}"),
    "names with numbers": Style(name=lambda name: f"{name}_01"),
    "names with a suffix": Style(name=lambda name: f"{name}_JNT"),
    "names in capitals": Style(name=str.upper),
    "names with dots": Style(name=lambda name: f"rig.{name.replace('_', '.')}"),
    "a name with a comma": Style(name=lambda name: name.replace("head", "head, crown")),
    "a reference above the hips": Style(reference=True),
    "a reference and positions on all": Style(reference=True, positions="all"),
    "comments": Style(edit=with_comments),
    "comments after words": Style(edit=with_comments_after),
    "blank lines before": Style(edit=lambda text: "\n\n \n" + text),
    "blank lines between rows": Style(edit=with_blank_rows),
    "blank line before MOTION": Style(edit=lambda text: text.replace("\nMOTION", "\n\n\nMOTION")),
    "blank lines at the end": Style(edit=lambda text: text + "\n\n\n"),
    "spaces at the ends of lines": Style(edit=lambda text: text.replace("\n", " \n")),
    "a tab before MOTION": Style(edit=lambda text: text.replace("\nMOTION", "\n\tMOTION")),
    "tabs after colons": Style(edit=lambda text: text.replace(": ", ":\t")),
    "spaces before colons": Style(edit=lambda text: text.replace(":", " :")),
    "no space after colons": Style(edit=lambda text: text.replace(": ", ":")),
    "a number on each line": Style(edit=numbers_on_lines),
    "no final newline": Style(edit=str.rstrip),
    "^Z at the end": Style(tail=b"\x1a"),
    "^Z and a newline": Style(tail=b"\x1a\r\n", newline="\r\n"),
    "NULs to the end of a block": Style(tail=bytes(3072)),
    "decimal commas": Style(edit=lambda text: text.replace(".", ",")),
    "decimal commas and tabs": Style(edit=lambda text: text.replace(".", ","), space="\t"),
    "minus zero": Style(edit=lambda text: text.replace(" 0.000000", " -0.000000")),
    "whole numbers": Style(edit=lambda text: text.replace(".000000", "")),
    "two bodies": Style(edit=with_second_body),
}  # fmt: skip
STYLES |= {
    f"{one} and {other}": replace(STYLES[one], **{field: getattr(STYLES[other], field)})
    for one, other, field in (
        ("order YZX", "in millimetres", "units_per_m"),
        ("CRLF", "byte order mark", "encoding"),
        ("names of Mixamo", "order XYZ", "orders"),
        ("decimal commas", "CRLF", "newline"),
        ("lower-case keywords", "numbers in columns", "number"),
        ("positions on all joints", "names with spaces", "name"),
        ("Z up", "a reference above the hips", "reference"),
        ("no end sites", "^Z at the end", "tail"),
    )
}
FILES = [SaneFile(name, style.write) for name, style in STYLES.items()]


def read_as_the_same_dance(path: Path) -> None:
    """Read a file as `build-db` does, and compare the first pose with that of the dance."""
    (take,) = import_takes(path)
    ours, theirs = (body_pos_m(motion)[0] for motion in (MOTION, take.motion))
    apart_m = np.linalg.norm((theirs - theirs[0]) - (ours - ours[0]), axis=-1)
    assert apart_m.max() < WITHIN_M, f"{path.parent.name}: {apart_m.max():.3f} m"


def test_100_sane_bvh_files_are_read(tmp_path):
    assert_read(FILES, read_as_the_same_dance, tmp_path, n_files=100)
