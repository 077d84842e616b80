"""From takes and their songs to a repertoire file.

- `build_repertoire`, `BuildOptions`, `BuildResult` — what is behind `choreograph.build`
- `importing` — takes read, brought to one skeleton, their feet locked, and measured
- `song_cache` — each song decoded and analysed once
- `segmentation` — takes segmented into motion words, and the motifs found among them
- `train_networks`, `train_rollout` — every network of a repertoire
- `training_content` — what they learn from, by which a checkpoint is known

The package is not called `build`, since `choreograph.build` (in `build_pipeline`) is the function.
"""

from choreograph.building.build import build_repertoire
from choreograph.building.options import BuildOptions
from choreograph.building.result import BuildResult

__all__ = ["BuildOptions", "BuildResult", "build_repertoire"]
