"""A song and a repertoire to a dance: the stages in order.

- `dance`, `vary` — a song and a repertoire to a dance, or to several that differ
- `render` — a plan to its motion
- `build` — takes to a repertoire; `graph_teacher` — the dances that its rollout network learns from
- `recreation` — the motifs and the signature of a dance there is already
"""

from choreograph.blending.rendering import render
from choreograph.pipeline.building import build
from choreograph.pipeline.dancing import Dance, dance
from choreograph.pipeline.variations import vary

__all__ = ["Dance", "build", "dance", "render", "vary"]
