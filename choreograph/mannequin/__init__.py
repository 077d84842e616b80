"""The body that is shown where there is no character: a skinned mesh around the joints of any skeleton."""

from choreograph.mannequin._bind_pose import Body, standing_body
from choreograph.mannequin.skinned_mesh import PARTS, SkinnedMesh, build_mannequin, skin_matrices

__all__ = ["PARTS", "Body", "SkinnedMesh", "build_mannequin", "skin_matrices", "standing_body"]
