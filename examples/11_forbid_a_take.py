"""A cost of one's own: never dance a given take, and say why each second is what it is.

Run: python examples/11_forbid_a_take.py SONG REPERTOIRE TAKE OUT.bvh
"""

import sys

import numpy as np

import choreograph as cg


class Forbid(cg.Cost):
    """Infinite cost for every node of one take."""

    def __init__(self, take: str) -> None:
        self.take = take

    def node(self, layer: cg.Layer, song_features: cg.SongFeatures) -> np.ndarray:
        return np.where(layer.take_names == self.take, np.inf, 0.0)  # (N,)


def main(song: str, db: str, take: str, out: str) -> None:
    made = cg.dance(song, cg.Repertoire.open(db), costs=[Forbid(take)])
    made.save(out)
    for second in made.plan.seconds[:5]:
        why = ", ".join(f"{name} {cost:.2f}" for name, cost in second.costs.items())
        print(f"{second.second:3d} s: {second.take} from {second.source_times_s[0]:.1f} s ({why})")
    assert take not in {second.take for second in made.plan.seconds}


if __name__ == "__main__":
    main(*sys.argv[1:])
