"""Styles made of other styles: in other metres, with other instruments, with drums at half or double time.

What a network is trained on must be wider than the genres as written, or it learns them by heart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from choreograph.errors import ParameterError
from choreograph.synthesis.songs.style import STEPS_PER_BEAT, Lane, Part, SongStyle

Source = TypeVar("Source", Lane, Part)

_SOFTER = str.maketrans("Xx", "xo")
_LEVEL_DB = 4.0  # standard deviation of a source's level from that of its style
_P_OTHER_VOICE, _P_SILENT_LANE, _P_WITHOUT_DRUMS, _P_EVERYWHERE = 0.35, 0.2, 0.12, 0.25


def in_three(style: SongStyle, *, dropped: int) -> SongStyle:
    """A style in four with one beat (0 to 3) of every bar left out; `ParameterError` for another metre."""
    _expect_metre(style, 4)
    bar, beat = style.steps_per_bar, STEPS_PER_BEAT * dropped

    def cut(pattern: str) -> str:
        bars = [pattern[i : i + bar] for i in range(0, len(pattern), bar)]
        return "".join(bar[:beat] + bar[beat + STEPS_PER_BEAT :] for bar in bars)

    return replace(
        _with_patterns(style, cut), name=f"{style.name} in three", beats_per_bar=3,
        fills=tuple((drum, cut(pattern)) for drum, pattern in style.fills),
    )  # fmt: skip


def in_six(style: SongStyle) -> SongStyle:
    """A style in three with two of its bars in one: the second softer, chords as long as both.

    `ParameterError` for another metre.
    """
    _expect_metre(style, 3)
    bar = style.steps_per_bar

    def doubled(pattern: str) -> str:
        bars = [pattern[i : i + bar] for i in range(0, len(pattern), bar)]
        return pattern if len(bars) % 2 == 0 else "".join(bar + bar.translate(_SOFTER) for bar in bars)

    return replace(
        _with_patterns(style, doubled), name=f"{style.name} in six", beats_per_bar=6,
        fills=tuple((drum, "." * bar + pattern) for drum, pattern in style.fills),
    )  # fmt: skip


def half_time_drums(style: SongStyle) -> SongStyle:
    """The drums at half the tempo of the beats, as in a half-time groove; fills as they are."""
    lanes = _repatterned(style.lanes, lambda pattern: "".join(f"{letter}." for letter in pattern))
    return replace(style, name=f"{style.name} at half time", lanes=lanes)


def double_time_drums(style: SongStyle) -> SongStyle:
    """The drums at twice the tempo of the beats; what lies between their new steps is left out."""
    lanes = _repatterned(style.lanes, lambda pattern: 2 * pattern[::2])
    return replace(style, name=f"{style.name} at double time", lanes=lanes)


def drums_of(drums: SongStyle, rest: SongStyle) -> SongStyle:
    """The drums of one style with the parts of another; `ParameterError` unless their metre is the same."""
    _expect_metre(drums, rest.beats_per_bar)
    return replace(rest, name=f"{rest.name} with {drums.name}'s drums", lanes=drums.lanes, fills=drums.fills)


def reorchestrated(style: SongStyle, voices: dict[str, Sequence[str]], rng: np.random.Generator) -> SongStyle:
    """Other levels; at times other voices of a role, some drums or all silent, some that never rest."""
    without_drums = rng.random() < _P_WITHOUT_DRUMS
    kept = [lane for lane in style.lanes if not without_drums and rng.random() >= _P_SILENT_LANE]
    lanes = tuple(_relevelled(lane, rng) for lane in kept)
    parts = []
    for part in style.parts:
        other = (str(rng.choice(voices[part.role])),) if rng.random() < _P_OTHER_VOICE else part.voices
        parts.append(replace(_relevelled(part, rng), voices=other))
    return replace(style, lanes=lanes, parts=tuple(parts), room_s=float(style.room_s * rng.uniform(0.6, 1.8)))


def _relevelled(source: Source, rng: np.random.Generator) -> Source:
    level_db = source.db + float(rng.normal(0.0, _LEVEL_DB))
    if rng.random() < _P_EVERYWHERE:
        return replace(source, db=level_db, enters=0.0, leaves=2.0)
    return replace(source, db=level_db)


def _with_patterns(style: SongStyle, change: Callable[[str], str]) -> SongStyle:
    return replace(style, lanes=_repatterned(style.lanes, change), parts=_repatterned(style.parts, change))


def _repatterned(sources: Sequence[Source], change: Callable[[str], str]) -> tuple[Source, ...]:
    return tuple(replace(s, patterns=tuple(change(pattern) for pattern in s.patterns)) for s in sources)


def _expect_metre(style: SongStyle, metre: int) -> None:
    if style.beats_per_bar != metre:
        raise ParameterError(f"expected a style in {metre}, got {style.name!r} in {style.beats_per_bar}")
