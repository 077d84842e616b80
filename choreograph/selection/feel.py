"""What people notice within a genre: how large and how densely stepped motion is for a part of the song.

Pairs do not teach it: the dancers of dance-with-melody move in the softest part of a song as they do in the
loudest (0.97 of the speed). So it is said: loud asks for large, many onsets for many steps (ours). Motion is
ranked in its genre, 0 to 1; clips are selected by it, and nodes pay for it (`graph.costs`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


def energy_mismatch(louder: float, liveliness: Floats) -> Floats:
    """How far ranks of liveliness (N,) are from a part that is `louder` than its song, -1 … 1.

    A part as loud as the song on average asks for nothing.
    """
    return 2.0 * abs(louder) * (1.0 - liveliness if louder > 0 else liveliness)


def steps_mismatch(onset_density: float, steps: Floats) -> Floats:
    """How far ranks of steps (N,) are from the density of onsets, as a rank in the song."""
    return np.abs(steps - onset_density)
