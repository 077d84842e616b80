"""Formats of motion, scenes and bodies that are not read: what they are, and what to export instead."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple


class ForeignFormat(NamedTuple):
    """A format that is known, but not read."""

    what: str
    motion: str  # how its motion comes into a format that is read


_BLENDER = "export BVH from Blender: File > Export > Motion Capture (.bvh)"
_ACCLAIM = ForeignFormat(
    "Acclaim motion capture",
    "take the .bvh or .c3d that most archives offer too, or import it in Blender",
)
_MAYA = ForeignFormat("a Maya scene", "export FBX from Maya: File > Export Selection > FBX")
_USD = ForeignFormat("USD", "import it in Blender (File > Import > Universal Scene Description), export .glb")
_FORMATS = {
    ".vmd": ForeignFormat("MikuMikuDance motion", _BLENDER),
    ".blend": ForeignFormat("a Blender scene", _BLENDER),
    ".ma": _MAYA,
    ".mb": _MAYA,
    ".max": ForeignFormat("a 3ds Max scene", "export FBX from 3ds Max: File > Export > FBX"),
    ".trc": ForeignFormat("marker tracks as text", "export C3D, or BVH of a solved skeleton"),
    ".mvnx": ForeignFormat("Xsens MVN motion", "export BVH or FBX from MVN: File > Export"),
    ".anim": ForeignFormat("an animation of Unity or Maya", "export FBX there, with the skeleton it moves"),
    ".abc": ForeignFormat("Alembic, meshes without a skeleton", "export its skeleton as BVH or FBX"),
    ".asf": _ACCLAIM,
    ".amc": _ACCLAIM,
    ".dae": ForeignFormat("COLLADA", "import it in the program it is from, and export FBX or glTF (.glb)"),
    ".obj": ForeignFormat("a mesh without skeleton or motion", "export the character that moves as .glb"),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _USD),
    ".x": ForeignFormat("DirectX animation", _BLENDER),
}  # fmt: skip


def foreign_format(path: Path) -> ForeignFormat | None:
    """The known format of a file that is not read, by its suffix; None for any other file."""
    return _FORMATS.get(path.suffix.lower())
