"""Selection: the K clips whose style suits each second of the song best."""

from choreograph.selection.select import select_clips, take_losses
from choreograph.selection.signature_fit import clip_signature_mismatch

__all__ = ["clip_signature_mismatch", "select_clips", "take_losses"]
