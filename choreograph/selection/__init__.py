"""Selection: the K clips whose style suits each second of the song best."""

from choreograph.selection.select import select_clips, take_losses
from choreograph.selection.steering import clip_misfits

__all__ = ["clip_misfits", "select_clips", "take_losses"]
