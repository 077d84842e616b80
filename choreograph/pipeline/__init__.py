"""The stages in order: the only place that knows all of them.

- `build_repertoire` — takes and their songs to a repertoire file
- `dance`, `vary`, `render` — a song and a repertoire to a dance, or several; a plan to its motion
- `Ban`, `MotifPin`, `TakePin` — what a dance should hold and what not
"""

from choreograph.pipeline.building import BuildOptions, build_repertoire
from choreograph.pipeline.dancing import Dance, dance
from choreograph.pipeline.rendering import render
from choreograph.pipeline.variations import vary
from choreograph.pipeline.wishes import Ban, MotifPin, TakePin

__all__ = [
    "Ban", "BuildOptions", "Dance", "MotifPin", "TakePin", "build_repertoire", "dance", "render", "vary",
]  # fmt: skip
