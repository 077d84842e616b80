"""glTF 2.0 documents: read, extended and written; the rigs in them."""

from choreograph.gltf.document import INDICES, VERTICES, GltfDocument
from choreograph.gltf.reading import read_gltf, referenced_files
from choreograph.gltf.rig import Rig
from choreograph.gltf.rig_reading import GltfRig, read_rig
from choreograph.gltf.skin_points import SkinPoints, read_skin_points

__all__ = [
    "INDICES",
    "VERTICES",
    "GltfDocument",
    "GltfRig",
    "Rig",
    "SkinPoints",
    "read_gltf",
    "read_rig",
    "read_skin_points",
    "referenced_files",
]
