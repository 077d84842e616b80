"""A cost of one's own: prefer nodes that are danced low.

Run: python examples/10_low_poses.py SONG REPERTOIRE OUT.bvh
"""

import sys

import numpy as np

import choreograph as cg
from choreograph.motion.body import BODY_JOINTS


class LowPoses(cg.Cost):
    """Height of the pelvis at the start of the node, metres."""

    name = "low_poses"

    def node(self, layer: cg.Layer, song_features: cg.SongFeatures) -> np.ndarray:
        # Poses stand above the origin, so Y is the height over the floor.
        return layer.first_pose_m[:, BODY_JOINTS.index("pelvis"), 1]  # (N,)


def main(song: str, db: str, out: str) -> None:
    repertoire = cg.Repertoire.open(db)
    upright = cg.dance(song, repertoire)
    low = cg.dance(song, repertoire, costs=[LowPoses()], weights={"low_poses": 20.0})
    low.save(out)
    for name, made in (("as usual", upright), ("low", low)):
        print(f"{name}: mean pelvis height {made.motion.root_pos_m[:, 1].mean():.2f} m")


if __name__ == "__main__":
    main(*sys.argv[1:])
