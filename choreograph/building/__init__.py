"""From takes and their songs to a repertoire file.

- `build_repertoire`, `BuildOptions` — the whole build and its settings
- `importing` — takes read, brought to one skeleton, their feet locked, and measured
- `train_networks`, `train_rollout` — every network of a repertoire
- `segmentation` — takes segmented into motion words, and the motifs found among them
"""

from choreograph.building.build import build_repertoire
from choreograph.building.options import BuildOptions

__all__ = ["BuildOptions", "build_repertoire"]
