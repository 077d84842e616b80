"""Characters of the user's: their bones found and a dance brought onto them."""

from choreograph.characters.gltf_character import GltfCharacter, read_character
from choreograph.characters.performance import Performance, perform
from choreograph.gltf.rig import Rig
from choreograph.motion.bone_map import find_bones, read_bone_map, write_bone_map

__all__ = [
    "GltfCharacter", "Performance", "Rig", "find_bones", "perform", "read_bone_map", "read_character",
    "write_bone_map",
]  # fmt: skip
