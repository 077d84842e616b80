"""Why a piece: how it differs from the dance that it would replace, in words."""

from __future__ import annotations

import numpy as np

from choreograph.choreography.edits import EditSlots
from choreograph.choreography.piece_bank import NEAR_S, PieceBank, Surroundings
from choreograph.core.numerics import Floats, Indices

_LOUDER = 0.25  # octaves of the speed of the joints
_FASTER = 0.12  # octaves of the tempo
_HARD_M = 0.4  # of both joins


def reasons(
    bank: PieceBank, around: Surroundings, slots: EditSlots, take: int, motifs: Indices, counts_s: Floats,
    louder: float, joins_m: float,
) -> str:  # fmt: skip
    """How a piece differs from the dance there, such as "same motif, quieter, from another dancer"."""
    credits, bounds_s = bank.repertoire.takes[take].credits, around.bounds_s
    genres, performers = (
        {getattr(one, name) for one in around.credits(slots)} for name in ("genre", "performer")
    )
    said = []
    asked = motifs[slots.before : len(motifs) - slots.after]
    here = _motifs_of_dance(bank, around, slots)
    if (asked >= 0).any() and (here >= 0).any():
        same = float(np.mean((asked == here) & (asked >= 0)))
        said.append(("same motif" if len(asked) == 1 else "same motifs") if same >= 0.5 else "other motifs")
    if abs(louder) >= _LOUDER:
        said.append("livelier" if louder > 0 else "quieter")
    octaves = np.log2((counts_s[-1] - counts_s[0]) / (bounds_s[slots.end] - bounds_s[slots.begin]))
    if abs(octaves) >= _FASTER:
        said.append("played faster" if octaves > 0 else "played slower")
    if credits.genre and credits.genre not in genres:
        said.append(f"{credits.genre} instead of {' and '.join(sorted(genres - {''})) or 'none'}")
    if joins_m >= _HARD_M:
        said.append("with a harder join")
    names = {around.source_at(float(at_s))[0] for at_s in bounds_s[slots.first : slots.stop]}
    if bank.repertoire.takes[take].name in names:
        said.append("from the same take")
    elif credits.performer and credits.performer not in performers:
        said.append("from another dancer")
    else:
        said.append("from another take")
    return ", ".join(said)


def _motifs_of_dance(bank: PieceBank, around: Surroundings, slots: EditSlots) -> Indices:
    """The motif of the dance in each of the slots that were asked for, -1 where it is not known."""
    names = [info.name for info in bank.repertoire.takes]
    found = np.full(slots.stop - slots.first, -1, np.int64)
    for i, at_s in enumerate(around.bounds_s[slots.first : slots.stop].tolist()):
        name, source_s = around.source_at(at_s + 1e-6)
        if name in names:
            take = names.index(name)
            away_s = np.abs(bank.counts_s[take] - source_s)
            if away_s.min() < NEAR_S:
                found[i] = bank.motifs(take)[int(away_s.argmin())]
    return found
