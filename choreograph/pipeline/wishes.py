"""What a dance should hold, as users say it: pins, bans, signatures, motif sequences; from text and files."""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.config import is_number
from choreograph.errors import FormatError, ParameterError
from choreograph.files import atomic_path, check_target
from choreograph.motifs.signatures import checked_signature
from choreograph.plan import FORMAT as PLAN_FORMAT
from choreograph.plan import Plan

SIGNATURE_FORMAT = "choreograph-signature"


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
class Wishes:
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


def make_wishes(
    *,
    genre: str | None = None,
    signature: Sequence[float] | NDArray[np.floating] | None = None,
    motifs: Sequence[int] | Sequence[MotifPin] = (),
    pins: Sequence[Pin] = (),
    bans: Sequence[Ban] = (),
) -> Wishes:
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
    return Wishes(
        genre,
        None if shares is None else tuple(checked_signature(shares, max(1, shares.size)).tolist()),
        tuple(int(motif) for motif in plain),
        (*pins, *timed),
        tuple(bans),
    )


def parse_pin(text: str) -> Pin:
    """`12.0=motif:41` or `30-38=take:NAME`; `ParameterError` for anything else."""
    at = re.fullmatch(r"([\d.]+)=motif:(\d+)", text)
    over = re.fullmatch(r"([\d.]+)-([\d.]+)=take:(.+)", text)
    try:
        if at:
            return MotifPin(float(at[1]), int(at[2]))
        if over:
            return TakePin(float(over[1]), float(over[2]), over[3])
    except ValueError:
        pass
    raise ParameterError(f"expected --pin SECOND=motif:NUMBER or FROM-TO=take:NAME, got {text!r}")


def parse_ban(text: str) -> Ban:
    """`take:NAME`, `genre:NAME` or `motif:NUMBER`; `ParameterError` for anything else."""
    kind, _, name = text.partition(":")
    if name and kind == "take":
        return Ban(take=name)
    if name and kind == "genre":
        return Ban(genre=name)
    if kind == "motif" and name.isdecimal():
        return Ban(motif=int(name))
    raise ParameterError(f"expected --ban take:NAME, genre:NAME or motif:NUMBER, got {text!r}")


def read_signature(path: str | Path) -> tuple[float, ...]:
    """The shares (K,) in a signature file; `FormatError` if it is none."""
    data = _json(path)
    shares = data.get("shares") if isinstance(data, dict) and data.get("format") == SIGNATURE_FORMAT else None
    if not isinstance(shares, list) or not shares or not all(map(is_number, shares)):
        raise FormatError(f"{path}: expected a {SIGNATURE_FORMAT} with a list of shares, got something else")
    try:
        return tuple(checked_signature(np.array(shares, np.float64), len(shares)).tolist())
    except ParameterError as error:
        raise FormatError(f"{path}: {error}") from None


def write_signature(path: str | Path, shares: NDArray[np.floating], *, name: str, repertoire: str) -> None:
    """Write a signature (K,): of a take or genre called `name`, over the motifs of `repertoire`."""
    check_target(path)
    data = {
        "format": SIGNATURE_FORMAT, "version": 1, "name": name, "repertoire": repertoire,
        "shares": [float(share) for share in shares],
    }  # fmt: skip
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def read_motifs(path: str | Path) -> tuple[int, ...] | tuple[MotifPin, ...]:
    """The motifs in a file: a list of numbers, one a word; a list of {"at_s": 12.0, "motif": 41}; or a plan.

    A plan of words gives its words' motifs, a plan of the graph engine its pinned words with their times.
    Raises `FormatError` if the file is none of these.
    """
    data = _json(path)
    if isinstance(data, dict) and data.get("format") == PLAN_FORMAT:
        plan = Plan.read(path)
        if not plan.words:
            raise FormatError(f"{path}: expected a plan of motifs, got one of seconds alone")
        if plan.engine != "graph":
            return tuple(word.motif for word in plan.words)
        return tuple(MotifPin((word.start_s + word.end_s) / 2, word.motif) for word in plan.words)
    if isinstance(data, list) and data and all(_is_motif(entry) for entry in data):
        return tuple(data)
    if isinstance(data, list) and data and all(_is_timed(entry) for entry in data):
        return tuple(MotifPin(entry["at_s"], entry["motif"]) for entry in data)
    raise FormatError(
        f'{path}: expected a list of motif numbers, of {{"at_s": seconds, "motif": number}}, or a plan'
    )


def _is_motif(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_timed(entry: Any) -> bool:
    return (
        isinstance(entry, dict)
        and set(entry) == {"at_s", "motif"}
        and is_number(entry["at_s"])
        and _is_motif(entry["motif"])
    )


def _json(path: str | Path) -> Any:
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected JSON, could not read it: {error}") from error
