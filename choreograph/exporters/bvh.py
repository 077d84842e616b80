"""BVH writer: the motion's skeleton, six channels on the root and three elsewhere."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from choreograph.arguments import as_number, check_choice, check_kind
from choreograph.exporters._base import Writer
from choreograph.exporters.naming import NAMES, renamed, word_of
from choreograph.exporters.rest_pose import REST_POSES, with_rest_pose
from choreograph.frame_blocks import frame_blocks
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton

# The format has no place for comments: a dance is known by zeros after the ten digits of its frame time.
DANCE_DIGITS = "000"
_ORDERS = tuple("".join(axes) for axes in itertools.permutations("XYZ"))


@dataclass(frozen=True)
class BvhOptions:
    """Options of a BVH file. Raises `ParameterError` for an invalid field."""

    units_per_m: float = 100.0  # centimetres, as most programs expect
    order: str = "ZXY"  # of the rotation channels
    naming: str = "smpl"  # of the joints: see `exporters.naming`
    in_place: bool = False  # the hips stay above where they begin
    rest: str | None = None  # pose of the hierarchy: see `exporters.rest_pose`; None: the skeleton's own

    def __post_init__(self) -> None:
        check_choice("a rotation order", self.order, _ORDERS)
        as_number("a positive number of units per metre", self.units_per_m, above=0.0)
        check_choice("names", self.naming, NAMES)
        check_kind("in_place", self.in_place, bool)
        if self.rest is not None:
            check_choice("a rest pose", self.rest, REST_POSES)


class BvhWriter(Writer):
    """Writes five decimals: an error far below a tenth of a millimetre at the fingertips."""

    format = "bvh"

    def __init__(self, options: BvhOptions | None = None) -> None:
        self.options = options or BvhOptions()

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`; Euler angles are unwrapped past 180 degrees so that curves can be edited."""
        if self.options.rest is not None:
            motion = with_rest_pose(motion, self.options.rest)
        motion = renamed(motion, self.options.naming)
        root_pos_m = motion.root_pos_m.copy()
        if self.options.in_place:
            root_pos_m[:, [0, 2]] = root_pos_m[0, [0, 2]]
        order = _file_order(motion.skeleton)
        rows = np.empty((motion.n_frames, 3 + 3 * len(order)))  # (T, 3 + 3 J)
        rows[:, :3] = root_pos_m * self.options.units_per_m
        for column, joint in enumerate(order, start=1):
            angles = rot.to_euler(self.options.order, motion.local_quat[:, joint])  # (T, 3)
            rows[:, 3 * column : 3 * column + 3] = np.degrees(np.unwrap(angles, axis=0))
        line = " ".join(["%.5f"] * rows.shape[1])
        with open(path, "w", encoding="utf-8", newline="\n") as file:
            file.write("HIERARCHY\n")
            file.writelines(f"{text}\n" for text in self._hierarchy(motion.skeleton, 0, ""))
            mark = DANCE_DIGITS if self.is_dance else ""
            file.write(f"MOTION\nFrames: {motion.n_frames}\nFrame Time: {1.0 / motion.fps:.10f}{mark}\n")
            for block in frame_blocks(motion.n_frames):
                file.writelines(line % tuple(row) + "\n" for row in rows[block].tolist())

    def _hierarchy(self, skeleton: Skeleton, joint: int, indent: str) -> list[str]:
        # With a root offset of zero it does not matter whether a reader adds the position channels to it.
        # A rest pose that was asked for stands on the floor, for the readers that take them as they are.
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


def _file_order(skeleton: Skeleton) -> list[int]:
    """Joints depth first, the order in which the file nests them; skeletons may differ."""
    order: list[int] = []
    stack = [0]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack += np.flatnonzero(skeleton.parents == joint)[::-1].tolist()
    return order
