"""glTF 2.0 documents: read, extended and written; the rigs in them."""

from choreograph.gltf.document import INDICES, VERTICES, GltfDocument
from choreograph.gltf.reading import read_gltf
from choreograph.gltf.rig import Rig
from choreograph.gltf.rig_reading import GltfRig, read_rig

__all__ = ["INDICES", "VERTICES", "GltfDocument", "GltfRig", "Rig", "read_gltf", "read_rig"]
