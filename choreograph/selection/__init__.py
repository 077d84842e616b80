"""Selection: the K clips whose style matches each second of the song best.

- `select` — style-based selection, the paper's
- `signature_fit` — mismatch of clips with a target signature, for dances of a genre
"""

from choreograph.selection.select import select_clips, take_losses
from choreograph.selection.signature_fit import clip_signature_mismatch

__all__ = ["clip_signature_mismatch", "select_clips", "take_losses"]
