"""The stages in order: the only place that knows all of them.

- `build_repertoire` — takes and their songs to a repertoire file
- `dance`, `render` — a song and a repertoire to a dance; a plan to its motion
"""

from choreograph.pipeline.building import BuildOptions, build_repertoire
from choreograph.pipeline.dancing import Dance, dance, render

__all__ = ["BuildOptions", "Dance", "build_repertoire", "dance", "render"]
