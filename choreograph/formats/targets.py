"""Programs that a dance is written for: bones, rest pose, root motion, names of clips, marks of loops.

Unreal's mannequin has a bone "root" on the floor, whose child is the pelvis, and stands in an A pose. Root
motion is that of this bone. Godot's humanoid profile and Unity's humanoid have the same names, in a T pose.
Godot loops a clip whose name ends in "-loop". Avatars of VRChat dance in place. MikuMikuDance reads VMD.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.formats.writer import distinct, renamed, with_rest_pose
from choreograph.motion.motion import Motion

TargetName = Literal["unreal", "unity", "vrchat", "blender", "mmd", "godot"]
_LOOP_GAP_M = 0.001  # greatest distance of a joint between the ends of a loop
_UNUSUAL = re.compile(r"[^A-Za-z0-9]+")


@dataclass(frozen=True)
class Target:
    """What a program expects of a GLB."""

    naming: str  # a key of `writer.NAMES`
    rest: Literal["t", "a"]
    root: str = ""  # name of the bone that carries the path on the floor, or "" for the hips
    in_place: bool = False  # whether the hips stay above the place where they begin
    loop_mark: str = "_loop"  # at the end of the name of a clip that loops


TARGETS: dict[TargetName, Target] = {
    "unreal": Target("ue", "a", root="root"),
    "unity": Target("humanoid", "t"),
    "vrchat": Target("humanoid", "t", in_place=True),
    "blender": Target("rigify", "t"),
    "mmd": Target("smpl", "a"),
    "godot": Target("humanoid", "t", root="Root", loop_mark="-loop"),
}


def check_target_format(name: str, path: str | Path) -> None:
    """Raise `ParameterError` for an unknown program, or a file that it does not read."""
    if name not in TARGETS:
        raise ParameterError(f"expected a program among {', '.join(TARGETS)}, got {name!r}")
    if not reads(name, path):
        wanted = _suffix(name)
        raise ParameterError(f"expected a file {wanted} for {name}, got {path}: use -o NAME{wanted}")


def reads(name: str, path: str | Path) -> bool:
    """Whether a file has the format that is written for a program."""
    return Path(path).suffix.lower() == _suffix(name)


def _suffix(name: str) -> str:
    return ".vmd" if name == "mmd" else ".glb"


def prepared(motion: Motion, target: Target) -> Motion:
    """The motion with the names, the rest pose and the place that a program expects.

    Raises `ParameterError` for a rig whose joint names are unknown.
    """
    return placed(renamed(with_rest_pose(motion, target.rest), target.naming), target)


def placed(motion: Motion, target: Target) -> Motion:
    """The motion, with the hips above the origin if the program expects it in place."""
    if not target.in_place:
        return motion
    root_pos_m = motion.root_pos_m.copy()  # (T, 3)
    root_pos_m[:, [0, 2]] = 0.0
    return replace(motion, root_pos_m=root_pos_m)


def clip_name(song: str, target: Target, *, loops: bool) -> str:
    """The name of a clip: letters and digits of the song's name, and the mark of a loop."""
    return f"{_words(song)}{target.loop_mark if loops else ''}"


def _words(name: str) -> str:
    return _UNUSUAL.sub("_", name).strip("_") or "dance"


def is_loop(motion: Motion) -> bool:
    """Whether a motion ends where it begins, in the same pose."""
    ends_m = [motion.sliced(frame, frame + 1).joint_pos_m()[0] for frame in (0, motion.n_frames - 1)]
    return motion.n_frames > 1 and bool(np.linalg.norm(ends_m[1] - ends_m[0], axis=-1).max() < _LOOP_GAP_M)


def named_clips(motions: Iterable[tuple[str, Motion]], target: Target | None = None) -> dict[str, Motion]:
    """The motions by the names of their clips, which all differ, with the mark of those that loop."""
    given = list(motions)
    mark = Target.loop_mark if target is None else target.loop_mark
    names = distinct([_words(name) for name, _ in given])
    return {
        f"{name}{mark if is_loop(motion) else ''}": motion
        for name, (_, motion) in zip(names, given, strict=True)
    }
