"""The body that is shown where there is no character: a skinned mesh around the joints of any skeleton."""

from choreograph.mannequin.skinned_mesh import PARTS, SkinnedMesh, build_mannequin, skin_matrices

__all__ = ["PARTS", "SkinnedMesh", "build_mannequin", "skin_matrices"]
