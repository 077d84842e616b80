"""What people notice within a genre: how large and how densely stepped clips are for a part of the song.

Pairs do not teach it: the dancers of dance-with-melody move in the softest part of a song as they do in the
loudest (0.97 of the speed). So it is said: loud asks for large, many onsets for many steps (ours).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.timebase import SEGMENT_S

Floats = NDArray[np.floating]


def energy_mismatch(energy: Floats, clip_energy: Floats, second: int) -> Floats:
    """How far clips (N,), ranked 0 … 1 in their genre, are from the song's energy (S,) at a second.

    As the cost of a node does, it compares the song with its own mean: a song of one loudness asks for
    nothing.
    """
    louder = float(energy[second : second + SEGMENT_S].mean() - energy.mean())
    return 2.0 * abs(louder) * (1.0 - clip_energy if louder > 0 else clip_energy)


def steps_mismatch(onset_density: Floats, clip_steps: Floats, second: int) -> Floats:
    """How far clips (N,), ranked 0 … 1 in their genre, are from the density (S,) of onsets at a second."""
    return np.abs(clip_steps - onset_density[second])
