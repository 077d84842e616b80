"""glTF 2.0 documents: read, extended and written. What their nodes mean is said elsewhere."""

from choreograph.gltf.document import INDICES, VERTICES, GltfDocument
from choreograph.gltf.reading import read_gltf

__all__ = ["INDICES", "VERTICES", "GltfDocument", "read_gltf"]
