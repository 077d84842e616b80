"""Selection: the K clips whose style suits each second of the song best."""

from choreograph.selection.select import select_clips

__all__ = ["select_clips"]
