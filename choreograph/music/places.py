"""Places of a song by name: bars, phrases, sections, choruses and verses, as times or spans in seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats, Floats
from choreograph.music.form import Sections
from choreograph.music.song_features import SongFeatures

_NAMES = ("bar", "phrase", "section", "chorus", "verse")
PLACE = re.compile(rf"\b({'|'.join(_NAMES)})\s*(\d+)\b", re.IGNORECASE)
Span = tuple[float, float]


def names_place(text: str) -> bool:
    """Whether a text names a place of a song, such as `bar 9` or `chorus 2`."""
    return PLACE.search(text.partition("=")[0]) is not None


@dataclass(frozen=True)
class Places:
    """The spans of a song that have names, each numbered from 1."""

    spans_s: dict[str, tuple[Span, ...]]  # by "bar", "phrase", "section", "chorus" and "verse"

    @classmethod
    def of_song(cls, features: SongFeatures) -> Places:
        """Those of a song. The chorus is the music that returns with the most energy, the verse the next."""
        sections = tuple(pairwise(features.sections.bounds_s.tolist()))
        chorus, verse = chorus_and_verse(features.sections, features.energy)
        labels = features.sections.labels.tolist()
        return cls(
            {
                "bar": bar_spans_s(features.counts.downbeat_times_s, features.duration_s),
                "phrase": tuple((phrase.start_s, phrase.end_s) for phrase in features.form.phrases),
                "section": sections,
                "chorus": tuple(s for s, label in zip(sections, labels, strict=True) if label == chorus),
                "verse": tuple(s for s, label in zip(sections, labels, strict=True) if label == verse),
            }
        )

    def span_s(self, name: str, number: int) -> Span:
        """The span of a place. Raises `ParameterError` if the song has none of this number."""
        spans = self.spans_s.get(name, ())
        if not 1 <= number <= len(spans):
            known = f"{name} 1 to {len(spans)}" if spans else f"a song in which a {name} was found"
            cure = "" if spans else ": write the time in seconds"
            raise ParameterError(f"expected {known}, got {name} {number}{cure}")
        return spans[number - 1]

    def in_seconds(self, text: str, *, is_span: bool = False) -> str:
        """A text with the starts of places in seconds instead of their names.

        What follows an equals sign remains as it is. If a span is expected and one place is named, the result
        is its start and its end, as `12.000000-20.000000`. Raises as `span_s`.
        """
        times, equals, rest = text.partition("=")
        whole = PLACE.fullmatch(times.strip())
        if whole and is_span:
            start_s, end_s = self.span_s(whole[1].lower(), int(whole[2]))
            return f"{start_s:.6f}-{end_s:.6f}{equals}{rest}"

        def start(found: re.Match[str]) -> str:
            return f"{self.span_s(found[1].lower(), int(found[2]))[0]:.6f}"

        return PLACE.sub(start, times) + equals + rest


def bar_spans_s(downbeats_s: Floats | Sequence[float], duration_s: float) -> tuple[Span, ...]:
    """The spans of the bars of a song from its downbeats (D,). The last one ends with the song."""
    return tuple(pairwise([*(float(s) for s in downbeats_s), float(duration_s)])) if len(downbeats_s) else ()


def chorus_and_verse(sections: Sections, energy: AnyFloats) -> tuple[int, int]:
    """The labels of the chorus and the verse of a song with the energy (S,) of its seconds, -1 for none.

    They are the two of greatest mean energy among the labels that occur more than once.
    """
    labels, seconds = sections.labels, np.arange(len(energy)) + 0.5
    loud: dict[int, float] = {}
    for label in dict.fromkeys(labels.tolist()):
        own = np.zeros(len(energy), bool)
        for index in np.flatnonzero(labels == label):
            own |= (seconds >= sections.bounds_s[index]) & (seconds < sections.bounds_s[index + 1])
        if (labels == label).sum() > 1 and own.any():
            loud[label] = float(np.asarray(energy, np.float64)[own].mean())
    ranked = [*sorted(loud, key=lambda label: -loud[label]), -1, -1]
    return ranked[0], ranked[1]
