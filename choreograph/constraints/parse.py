"""Constraints from the command line's text and from files: pins, bans, signatures, motif sequences."""

from __future__ import annotations

import json
import re
import reprlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.arguments import is_number
from choreograph.constraints.spec import Ban, Keep, MotifPin, Pin, TakePin
from choreograph.errors import FormatError, ParameterError
from choreograph.files import atomic_path, check_target, read_json
from choreograph.motifs.signatures import checked_signature
from choreograph.plan import FORMAT as PLAN_FORMAT
from choreograph.plan import Plan
from choreograph.timebase import parse_seconds

SIGNATURE_FORMAT = "choreograph-signature"
_ROUNDED_SUM = 0.01  # from 1, of shares written with two digits or more
_TIME = r"[\d:]*\d(?:\.\d*)?|\.\d+"  # as `parse_seconds` reads it


def parse_pin(text: str) -> Pin:
    """`12.0=motif:41` or `0:30-0:38=take:NAME`; `ParameterError` for anything else."""
    at = re.fullmatch(rf"({_TIME})=motif:(\d+)", text)
    over = re.fullmatch(rf"({_TIME})-({_TIME})=take:(.+)", text)
    if at:
        return MotifPin(parse_seconds(at[1]), int(at[2]))
    if over:
        return TakePin(parse_seconds(over[1]), parse_seconds(over[2]), over[3])
    raise ParameterError(f"expected --pin SECOND=motif:NUMBER or FROM-TO=take:NAME, got {text!r}")


def parse_keep(text: str) -> Keep:
    """`12.5-30` or `0:12.5-0:30`; `ParameterError` for anything else."""
    span = re.fullmatch(rf"({_TIME})-({_TIME})", text)
    if span:
        return Keep(parse_seconds(span[1]), parse_seconds(span[2]))
    raise ParameterError(f"expected --keep FROM-TO, such as 12.5-30 or 0:12.5-0:30, got {text!r}")


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
    """The shares (K,) in a signature file, made to sum to 1 if rounding left up to 1 % more or less.

    Raises `FormatError` if it is none.
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
    data = read_json(path, "a list of motifs, or a plan")
    if isinstance(data, dict) and data.get("format") == PLAN_FORMAT:
        plan = Plan.read(path)
        if not plan.words:
            raise FormatError(f"{path}: expected a plan of motifs, got one of seconds alone")
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
