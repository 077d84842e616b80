"""Write a cost of your own that prefers low poses and never dances one of the takes.

Run: python examples/02_own_cost.py [SONG [REPERTOIRE]]
"""

import sys

import numpy as np

import choreograph as cg

PELVIS = 0  # of `choreograph.motion.body.BODY_JOINTS`


class LowPoses(cg.Cost):
    """Height of the pelvis at the start of the node in metres, infinite for a forbidden take."""

    name = "low_poses"

    def __init__(self, *, forbidden: str) -> None:
        self.forbidden = forbidden

    def node(self, layer: cg.Layer, song_features: cg.SongFeatures) -> np.ndarray:
        return np.where(layer.take_names == self.forbidden, np.inf, layer.first_pose_m[:, PELVIS, 1])


def main(song: str = "", repertoire: str | None = None) -> None:
    song = song or cg.example_songs()["house"]
    usual = cg.dance(song, repertoire, duration_s=6.0)
    cost = LowPoses(forbidden=usual.plan.seconds[0].take)
    low = cg.dance(song, repertoire, duration_s=6.0, costs=[cost], weights={"low_poses": 20.0})
    low.save("low.bvh")
    for name, made in (("usual", usual), ("low", low)):
        print(f"{name}: pelvis {made.motion.root_pos_m[:, 1].mean():.2f} m high, takes", *made.plan.takes_s())
    print("costs of second 3:", low.plan.seconds[3].costs)


if __name__ == "__main__":
    main(*sys.argv[1:])
