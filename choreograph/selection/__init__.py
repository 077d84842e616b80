"""Selection: the K clips whose style suits each second of the song best, and the takes cast for a phrase."""

from choreograph.selection.casting import cast_takes, phrase_of_seconds
from choreograph.selection.select import select_clips, take_losses
from choreograph.selection.steering import clip_misfits

__all__ = ["cast_takes", "clip_misfits", "phrase_of_seconds", "select_clips", "take_losses"]
