"""Selection: the K clips whose style matches each second of the song best.

- `select` — style-based selection, the paper's
- `feel` — how far clips are from a part of the song in energy and density of steps
- `genre_distance` — how far music is from each genre in style
- `signature_fit` — mismatch of clips with a target signature, for dances of a genre
"""

from choreograph.selection.feel import energy_mismatch, steps_mismatch
from choreograph.selection.genre_distance import genre_distances
from choreograph.selection.select import select_clips
from choreograph.selection.signature_fit import clip_signature_mismatch

__all__ = ["clip_signature_mismatch", "energy_mismatch", "genre_distances", "select_clips", "steps_mismatch"]
