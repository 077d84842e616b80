"""Constraints as the user states them: pins, bans, a genre, a signature, a motif sequence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.arguments import as_floats, as_list, check_text, is_number, is_whole, unexpected
from choreograph.errors import ParameterError
from choreograph.motifs.signatures import checked_signature


@dataclass(frozen=True)
class MotifPin:
    """A motif in the beat interval around a time of the dance."""

    at_s: float
    motif: int

    def __post_init__(self) -> None:
        _check_times(self, "at_s")
        _check_motif(self)

    def __str__(self) -> str:
        return f"{self.at_s:g}=motif:{self.motif}"


@dataclass(frozen=True)
class TakePin:
    """Only one take, from one time of the dance to another."""

    start_s: float
    end_s: float
    take: str

    def __post_init__(self) -> None:
        _check_times(self, "start_s", "end_s")
        _check_names(self, "take")

    def __str__(self) -> str:
        return f"{self.start_s:g}-{self.end_s:g}=take:{self.take}"


@dataclass(frozen=True)
class Keep:
    """A stretch of another dance to the same song that is kept as it is."""

    start_s: float
    end_s: float

    def __post_init__(self) -> None:
        _check_times(self, "start_s", "end_s")

    def __str__(self) -> str:
        return f"{self.start_s:g}-{self.end_s:g}"


@dataclass(frozen=True)
class Ban:
    """One take, one genre or one motif that must not be danced: give exactly one of the three."""

    take: str | None = None
    genre: str | None = None
    motif: int | None = None

    def __post_init__(self) -> None:
        if sum(value is not None for value in vars(self).values()) != 1:
            raise unexpected("a ban of one take, genre or motif", vars(self))
        if self.motif is not None:
            _check_motif(self)
        _check_names(self, *(name for name in ("take", "genre") if getattr(self, name) is not None))

    def __str__(self) -> str:
        kind, name = next((k, v) for k, v in vars(self).items() if v is not None)
        return f"{kind}:{name}"


def _check_times(constraint: object, *names: str) -> None:
    for name in names:
        if not is_number(getattr(constraint, name)):
            raise unexpected(f"{name} of a {type(constraint).__name__} in seconds", getattr(constraint, name))


def _check_names(constraint: object, *names: str) -> None:
    for name in names:
        if not isinstance(getattr(constraint, name), str):
            what = f"the {name} of a {type(constraint).__name__} by name"
            raise unexpected(what, getattr(constraint, name))


def _check_motif(constraint: MotifPin | Ban) -> None:
    motif = constraint.motif
    if not is_whole(motif) or motif < 0:
        raise unexpected(f"the motif of a {type(constraint).__name__} as a number of 0 or more", motif)


Pin = MotifPin | TakePin


@dataclass(frozen=True)
class Constraints:
    """Everything requested of a dance beside its song; by default nothing."""

    genre: str | None = None
    signature: tuple[float, ...] | None = None  # (K,) shares of the motifs
    motifs: tuple[int, ...] = ()  # of the dance's words, from the first word on
    pins: tuple[Pin, ...] = ()
    bans: tuple[Ban, ...] = ()

    @property
    def need_motifs(self) -> bool:
        """Whether they can only be met with a repertoire that has motifs."""
        motif_pins = any(isinstance(pin, MotifPin) for pin in self.pins)
        motif_bans = any(ban.motif is not None for ban in self.bans)
        return bool(self.genre or self.signature or self.motifs or motif_pins or motif_bans)

    @property
    def take_pins(self) -> tuple[TakePin, ...]:
        """The pins of takes."""
        return tuple(pin for pin in self.pins if isinstance(pin, TakePin))

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
    """Constraints from the arguments of a caller; motifs with times become pins.

    Raises `ParameterError` for an argument of another type, or a signature that does not sum to 1.
    """
    if genre is not None:
        check_text("a genre", genre)
    pins = as_list("pins", pins, "MotifPin or TakePin", MotifPin | TakePin)
    bans = as_list("bans", bans, "Ban", Ban)
    motifs = as_list("motifs", motifs, "whole numbers or MotifPin", int | np.integer | MotifPin)
    timed = [motif for motif in motifs if isinstance(motif, MotifPin)]
    untimed = [motif for motif in motifs if not isinstance(motif, MotifPin)]
    if timed and untimed:
        raise ParameterError("expected motifs that all have times, or none, got both")
    return Constraints(
        genre, _shares(signature), tuple(int(motif) for motif in untimed), (*pins, *timed), bans
    )


def _shares(signature: object) -> tuple[float, ...] | None:
    if signature is None:
        return None
    shares = as_floats("a signature as a list of shares", signature)
    return tuple(checked_signature(shares, max(1, shares.size)).tolist())
