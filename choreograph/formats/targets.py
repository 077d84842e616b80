"""Programs that a dance is written for: bones, rest pose, root motion, names of clips, marks of loops.

Unreal's mannequin has a bone "root" on the floor, whose child is the pelvis, and stands in an A pose. Root
motion is that of this bone. Godot's humanoid profile and Unity's humanoid have the same names, in a T pose.
Godot loops a clip whose name ends in "-loop". Avatars of VRChat dance in place. MikuMikuDance reads VMD.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from choreograph.core.errors import ParameterError
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.writer import renamed, with_rest_pose
from choreograph.motion.motion import Motion

TargetName = Literal["unreal", "unity", "vrchat", "blender", "mmd", "godot"]
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
    motion = renamed(with_rest_pose(motion, target.rest), target.naming)
    if not target.in_place:
        return motion
    root_pos_m = motion.root_pos_m.copy()  # (T, 3)
    root_pos_m[:, [0, 2]] = 0.0
    return replace(motion, root_pos_m=root_pos_m)


def clip_name(song: str, target: Target, *, loops: bool) -> str:
    """The name of a clip: letters and digits of the song's name, and the mark of a loop."""
    words = _UNUSUAL.sub("_", song).strip("_") or "dance"
    return f"{words}{target.loop_mark if loops else ''}"


def named_clip(document: GltfDocument, name: str) -> GltfDocument:
    """A copy of a document whose last animation has a name."""
    renamed_document = document.copy()
    renamed_document.json["animations"][-1]["name"] = name
    return renamed_document
