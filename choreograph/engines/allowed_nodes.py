"""The cost that forbids banned takes and motifs, and every other take where one is pinned."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.constraints.spec import TakePin
from choreograph.errors import ParameterError
from choreograph.features.phrasing import REACH_S
from choreograph.features.song_features import SongFeatures
from choreograph.graph import Cost, Layer
from choreograph.repertoire import Repertoire


class AllowedNodes(Cost):
    """Infinite for nodes that the user's pins and bans exclude, 0 for the others."""

    name = "constraints"

    def __init__(self, takes: NDArray[np.bool_], motif_banned: NDArray[np.bool_]) -> None:
        self.takes = takes  # (S, takes) which may be danced in each second
        self.motif_banned = np.append(motif_banned, False)  # (K + 1,) the last one for no motif: index -1

    @classmethod
    def of(
        cls, constraints: ResolvedConstraints, repertoire: Repertoire, n_seconds: int
    ) -> AllowedNodes | None:
        """For a dance of so many seconds; None if nothing is excluded.

        Raises `ParameterError` if two pinned takes share a second, or a pinned take has no clip.
        """
        takes = np.tile(constraints.take_allowed, (n_seconds, 1))
        for second, pin in _pinned_seconds(constraints.requested.take_pins, n_seconds).items():
            take = repertoire.take_index(pin.take)
            if not (repertoire.clip_take == take).any():
                raise ParameterError(
                    f"expected pins of takes of 8 s or more, the length of a clip, got {pin}"
                )
            takes[second] = np.arange(takes.shape[1]) == take
        if takes.all() and not constraints.motif_banned.any():
            return None
        return cls(takes, constraints.motif_banned)

    def node(self, layer: Layer, song_features: SongFeatures) -> NDArray[np.floating]:
        allowed = self.takes[layer.second, layer.take] & ~self.motif_banned[layer.motifs].any(axis=1)
        return np.where(allowed, 0.0, np.inf)


def _pinned_seconds(pins: tuple[TakePin, ...], n_seconds: int) -> dict[int, TakePin]:
    """Second -> the pin that holds there."""
    owner: dict[int, TakePin] = {}
    for pin in pins:
        for second in range(int(pin.start_s), int(np.ceil(pin.end_s))):
            other = owner.setdefault(second, pin)
            if other.take != pin.take:
                raise ParameterError(
                    "expected one pinned take in a second, since the graph engine dances whole ones, but "
                    f"{other} and {pin} share second {second}: move one, or use the mixer"
                )
    # Transitions move to beats: another take would reach into the pin from the seconds beside it.
    for pin in pins:
        for second in (int(pin.start_s - REACH_S), int(pin.end_s + REACH_S)):
            if 0 <= second < n_seconds:
                owner.setdefault(second, pin)
    return owner
