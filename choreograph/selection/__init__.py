"""Selection: the K clips that take part in each second of the dance.

- `draw` — at random, at least half of them of the genre that suits the music
- `select` — the nearest in style, the paper's
- `feel` — how far clips are from a part of the song in energy and density of steps
- `genre_distance` — how far music is from each genre in style
- `signature_fit` — mismatch of clips with a target signature, for dances of a genre
"""

from choreograph.selection.draw import Alignments, draw_clips
from choreograph.selection.feel import energy_mismatch, steps_mismatch
from choreograph.selection.genre_distance import genre_distances
from choreograph.selection.select import select_clips
from choreograph.selection.signature_fit import clip_signature_mismatch

__all__ = [
    "Alignments",
    "clip_signature_mismatch",
    "draw_clips",
    "energy_mismatch",
    "genre_distances",
    "select_clips",
    "steps_mismatch",
]
