"""Characters of the user's: their bones found and a dance brought onto them."""

from choreograph.characters.bone_map import find_bones
from choreograph.characters.gltf_character import GltfCharacter, read_character
from choreograph.characters.performance import Performance, perform
from choreograph.characters.rig import Rig

__all__ = ["GltfCharacter", "Performance", "Rig", "find_bones", "perform", "read_character"]
