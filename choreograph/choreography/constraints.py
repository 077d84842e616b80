"""Constraints as the user states them: pins, bans, a genre, a signature, a motif sequence.

They are made from arguments, from the text of the command line, or from files.
"""

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

from choreograph.core.arguments import as_floats, as_list, check_text, is_number, is_whole, unexpected
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import atomic_path, check_target, read_json
from choreograph.core.progress import one_line
from choreograph.core.timebase import parse_seconds
from choreograph.library.vocabulary import checked_signature
from choreograph.motion.motion import Credits
from choreograph.plan.plan import FORMAT as PLAN_FORMAT
from choreograph.plan.plan import Plan


@dataclass(frozen=True)
class MotifPin:
    """Require a motif in the beat interval around a time of the dance.

    Raises
    ------
    ParameterError   if a value is not a number, or the motif is negative

    Examples
    --------
    >>> pin = cg.MotifPin(at_s=2.0, motif=0)
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=4, pins=[pin])
    >>> word = dance.plan.words[0]
    >>> word.motif, word.start_s < 2.0 < word.end_s
    (0, True)
    """

    at_s: float
    """Time in the dance, in seconds."""

    motif: int
    """Index of the motif in the repertoire's vocabulary, from 0 on."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_times(self, "at_s")
        _check_motif(self)

    def __str__(self) -> str:
        return f"{self.at_s:g}=motif:{self.motif}"


@dataclass(frozen=True)
class TakePin:
    """Require one take from one time of the dance to another.

    Raises
    ------
    ParameterError   if a time is not a number, or the take is not a name

    Examples
    --------
    >>> pin = cg.TakePin(start_s=1.0, end_s=3.0, take="house-01")
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=4, pins=[pin])
    >>> dance.plan.seconds[2].take
    'house-01'
    """

    start_s: float
    """From when, in seconds of the dance."""

    end_s: float
    """Until when, in seconds of the dance."""

    take: str
    """Name of the take in the repertoire."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_times(self, "start_s", "end_s")
        _check_names(self, "take")

    def __str__(self) -> str:
        return f"{self.start_s:g}-{self.end_s:g}=take:{self.take}"


@dataclass(frozen=True)
class Span:
    """A part of a dance, from `start_s` to `end_s` in seconds. Raises `ParameterError` for other values."""

    start_s: float
    """When it begins, in seconds of the dance."""

    end_s: float
    """When it ends, in seconds of the dance."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        check_times(self, "start_s", "end_s")

    def __str__(self) -> str:
        return f"{self.start_s:g}-{self.end_s:g}"


@dataclass(frozen=True, repr=False)
class Keep(Span):
    """Keep a part of another dance to the same song as it is.

    Raises
    ------
    ParameterError   if a time is not a number

    Examples
    --------
    >>> song = cg.load_song(cg.example_songs()["house"], duration_s=6)
    >>> first = cg.dance(song)
    >>> second = cg.dance(song, existing=first, keep=[cg.Keep(start_s=0.0, end_s=3.0)], seed=1)
    >>> np.array_equal(first.motion.root_pos_m[:180], second.motion.root_pos_m[:180])
    True
    """


BANNED_NAMES = ("take", "genre", "performer", "licence")


@dataclass(frozen=True)
class Ban:
    """Exclude a take, the takes of a genre, of a performer or with a licence, or a motif. Give exactly one.

    Raises
    ------
    ParameterError   if not exactly one is given, a name is not text, or the motif is negative

    Examples
    --------
    >>> dance = cg.dance(cg.example_songs()["house"], duration_s=2, bans=[cg.Ban(take="house-16")])
    >>> "house-16" in dance.plan.takes_s()
    False
    """

    take: str | None = None
    """Name of a take in the repertoire."""

    genre: str | None = None
    """Genre, as in the credits of takes."""

    motif: int | None = None
    """Index of a motif in the repertoire's vocabulary, from 0 on."""

    performer: str | None = None
    """Performer, as in the credits of takes."""

    licence: str | None = None
    """Licence, as in the credits of takes."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        if sum(value is not None for value in vars(self).values()) != 1:
            raise unexpected("a ban of one take, genre, performer, licence or motif", vars(self))
        if self.motif is not None:
            _check_motif(self)
        _check_names(self, *(name for name in BANNED_NAMES if getattr(self, name) is not None))

    def __str__(self) -> str:
        kind, name = next((k, v) for k, v in vars(self).items() if v is not None)
        return f"{kind}:{name}"


def excludes(ban: Ban, take: str, credits: Credits) -> bool:
    """Whether a ban excludes the take of this name."""
    return ban.take == take or any(
        getattr(ban, name) == getattr(credits, name) for name in BANNED_NAMES if name != "take"
    )


def check_times(constraint: object, *names: str) -> None:
    """Raise `ParameterError` unless the fields of these names are numbers."""
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
    """Everything that is requested of a dance, besides its song. The default is nothing."""

    genre: str | None = None  # of the dance, or None for the nearest ones to the song
    signature: tuple[float, ...] | None = None  # (K,) shares of the motifs
    motifs: tuple[int, ...] = ()  # of the dance's words, from the first word on
    pins: tuple[Pin, ...] = ()  # motifs and takes at given times
    bans: tuple[Ban, ...] = ()  # takes and motifs that are excluded

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
    """Constraints from the arguments of a caller. Motifs with times become pins.

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


SIGNATURE_FORMAT = "choreograph-signature"
_ROUNDED_SUM = 0.01  # from 1, of shares written with two digits or more
_TIME = r"[\d:]*\d(?:\.\d*)?|\.\d+"  # as `parse_seconds` reads it


def parse_pin(text: str) -> Pin:
    """The pin in `12.0=motif:41` or `0:30-0:38=take:NAME`. Raises `ParameterError` for other text."""
    at = re.fullmatch(rf"({_TIME})=motif:(\d+)", text)
    over = re.fullmatch(rf"({_TIME})-({_TIME})=take:(.+)", text)
    if at:
        return MotifPin(parse_seconds(at[1]), int(at[2]))
    if over:
        return TakePin(parse_seconds(over[1]), parse_seconds(over[2]), over[3])
    raise ParameterError(f"expected --pin SECOND=motif:NUMBER or FROM-TO=take:NAME, got {text!r}")


def parse_keep(text: str, option: str = "--keep") -> Keep:
    """The span in `12.5-30` or `0:12.5-0:30` of an option. Raises `ParameterError` for other text."""
    span = re.fullmatch(rf"({_TIME})-({_TIME})", text)
    if span:
        return Keep(parse_seconds(span[1]), parse_seconds(span[2]))
    raise ParameterError(f"expected {option} FROM-TO, such as 12.5-30 or 0:12.5-0:30, got {text!r}")


def parse_ban(text: str) -> Ban:
    """The ban in `take:NAME`, `genre:NAME`, `performer:NAME`, `licence:NAME` or `motif:NUMBER`.

    Raises `ParameterError` for other text.
    """
    kind, _, name = text.partition(":")
    if name and kind in BANNED_NAMES:
        named: dict[str, Any] = {kind: name}
        return Ban(**named)
    if kind == "motif" and name.isdecimal():
        return Ban(motif=int(name))
    raise ParameterError(
        f"expected --ban {', '.join(f'{kind}:NAME' for kind in BANNED_NAMES)} or motif:NUMBER, got {text!r}"
    )


def read_signature(path: str | Path) -> tuple[float, ...]:
    """The shares (K,) in a signature file.

    A sum that differs from 1 by up to 1 %, because of rounding, is corrected. Raises `FormatError` if the
    file holds no signature.
    """
    data = read_json(path, "a signature")
    shares = data.get("shares") if isinstance(data, dict) and data.get("format") == SIGNATURE_FORMAT else None
    if not isinstance(shares, list) or not shares or not all(map(is_number, shares)):
        raise FormatError(f"{path}: expected a {SIGNATURE_FORMAT} with a list of shares, got something else")
    values = np.array(shares, np.float64)
    total = values.sum()
    if abs(total - 1.0) <= _ROUNDED_SUM:
        values /= total
    try:
        return tuple(checked_signature(values, len(shares)).tolist())
    except ParameterError as error:
        raise FormatError(f"{path}: {error}") from None


def write_signature(path: str | Path, shares: NDArray[np.floating], *, name: str, repertoire: str) -> None:
    """Write a signature (K,) of the take or genre `name`, over the motifs of `repertoire`."""
    check_target(path)
    data = {
        "format": SIGNATURE_FORMAT, "version": 1, "name": name, "repertoire": repertoire,
        "shares": [float(share) for share in shares],
    }  # fmt: skip
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def read_motifs(path: str | Path) -> tuple[int, ...] | tuple[MotifPin, ...]:
    """The motifs in a file.

    The file is a list of numbers, one for each word, a list of {"at_s": 12.0, "motif": 41}, or a plan. A plan
    of words gives the motifs of its words. A plan of the graph engine gives its pinned words with their
    times. Raises `FormatError` for any other file.
    """
    data = read_json(path, "a list of motifs, or a plan")
    if isinstance(data, dict) and data.get("format") == PLAN_FORMAT:
        plan = Plan.read(path)
        if not plan.words:
            raise FormatError(f"{path}: expected a plan of motifs, got one that has only seconds")
        if not plan.seconds:
            return tuple(word.motif for word in plan.words)
        return tuple(MotifPin((word.start_s + word.end_s) / 2, word.motif) for word in plan.words)
    if isinstance(data, list) and data and all(_is_motif(entry) for entry in data):
        return tuple(data)
    if isinstance(data, list) and data and all(_is_timed(entry) for entry in data):
        return tuple(MotifPin(entry["at_s"], entry["motif"]) for entry in data)
    raise FormatError(
        f'{path}: expected a list of motif numbers, of {{"at_s": seconds, "motif": number}}, or a plan, got '
        f"{reprlib.repr(data)}"
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
