"""A song and a repertoire to a dance: the stages in order.

- `dance`, `vary` — a song and a repertoire to a dance, or to several that differ
- `render` — a plan to its motion
- `recreation` — the motifs and the signature of a dance there is already
"""

from choreograph.blending.rendering import render
from choreograph.pipeline.dancing import Dance, dance
from choreograph.pipeline.variations import vary

__all__ = ["Dance", "dance", "render", "vary"]
