"""Selection: the K clips whose style matches each second of the song best.

- `select` — style-based selection, the paper's
- `genre_distance` — how far music is from each genre in style
- `signature_fit` — mismatch of clips with a target signature, for dances of a genre
"""

from choreograph.selection.genre_distance import genre_distances
from choreograph.selection.select import select_clips
from choreograph.selection.signature_fit import clip_signature_mismatch

__all__ = ["clip_signature_mismatch", "genre_distances", "select_clips"]
