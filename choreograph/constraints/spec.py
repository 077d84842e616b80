"""What a dance should hold, as users say it: pins, bans, signatures, motif sequences; from text and files."""

from __future__ import annotations

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.motifs.signatures import checked_signature


@dataclass(frozen=True)
class MotifPin:
    """A motif in the beat interval that holds an instant of the dance."""

    at_s: float
    motif: int

    def __str__(self) -> str:
        return f"{self.at_s:g}=motif:{self.motif}"


@dataclass(frozen=True)
class TakePin:
    """Material of one take alone, from one instant of the dance to another."""

    start_s: float
    end_s: float
    take: str

    def __str__(self) -> str:
        return f"{self.start_s:g}-{self.end_s:g}=take:{self.take}"


@dataclass(frozen=True)
class Ban:
    """One take, one genre or one motif that is not danced: give one of the three."""

    take: str | None = None
    genre: str | None = None
    motif: int | None = None

    def __post_init__(self) -> None:
        if [self.take, self.genre, self.motif].count(None) != 2:
            raise ParameterError(f"expected a ban of one take, genre or motif, got {self!r}")

    def __str__(self) -> str:
        kind, name = next((k, v) for k, v in vars(self).items() if v is not None)
        return f"{kind}:{name}"


Pin = MotifPin | TakePin


@dataclass(frozen=True)
class Constraints:
    """Everything that is asked of a dance beside its song; by default nothing."""

    genre: str | None = None
    signature: tuple[float, ...] | None = None  # (K,) shares of the motifs
    motifs: tuple[int, ...] = ()  # of the dance's words from the first on
    pins: tuple[Pin, ...] = ()
    bans: tuple[Ban, ...] = ()

    @property
    def of_motifs(self) -> bool:
        """Whether a vocabulary is needed to fulfil them."""
        motif_pins = any(isinstance(pin, MotifPin) for pin in self.pins)
        motif_bans = any(ban.motif is not None for ban in self.bans)
        return bool(self.genre or self.signature or self.motifs or motif_pins or motif_bans)

    def __str__(self) -> str:
        return ", ".join([*(f"--pin {pin}" for pin in self.pins), *(f"--ban {ban}" for ban in self.bans)])


def make_constraints(
    *,
    genre: str | None = None,
    signature: Sequence[float] | NDArray[np.floating] | None = None,
    motifs: Sequence[int] | Sequence[MotifPin] = (),
    pins: Sequence[Pin] = (),
    bans: Sequence[Ban] = (),
) -> Constraints:
    """Wishes from what a caller gives; motifs with times become pins.

    Raises `ParameterError` for a pin, ban or motif of another kind, or a signature that does not sum to 1.
    """
    for pin in pins:
        if not isinstance(pin, MotifPin | TakePin):
            raise ParameterError(f"expected pins as MotifPin or TakePin, got {reprlib.repr(pin)}")
    for ban in bans:
        if not isinstance(ban, Ban):
            raise ParameterError(f"expected bans as Ban, got {reprlib.repr(ban)}")
    timed = [motif for motif in motifs if isinstance(motif, MotifPin)]
    plain = [motif for motif in motifs if not isinstance(motif, MotifPin)]
    if timed and plain:
        raise ParameterError("expected motifs that all have times, or none, got both")
    for motif in plain:
        if isinstance(motif, bool) or not isinstance(motif, int | np.integer):
            raise ParameterError(f"expected motifs as numbers, got {reprlib.repr(motif)}")
    shares = None if signature is None else np.asarray(signature, np.float64)
    return Constraints(
        genre,
        None if shares is None else tuple(checked_signature(shares, max(1, shares.size)).tolist()),
        tuple(int(motif) for motif in plain),
        (*pins, *timed),
        tuple(bans),
    )
