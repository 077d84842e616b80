"""Times on the command line: in seconds, as on a clock, or as places such as `bar 9` or `chorus 2`."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from choreograph.core.errors import ParameterError
from choreograph.core.timebase import parse_seconds

if TYPE_CHECKING:
    from choreograph.library.repertoire import Repertoire
    from choreograph.music.places import Places
    from choreograph.plan.plan import Plan

    _Floats = click.ParamType[float]
else:
    _Floats = click.ParamType  # not generic in every click


class Seconds(_Floats):
    """A time, in seconds (`75.5`) or with minutes and hours (`1:15.5`)."""

    name = "seconds"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The time in seconds. Reports a value that is no time as click does."""
        try:
            return parse_seconds(value) if isinstance(value, str) else float(value)
        except ParameterError as error:
            self.fail(str(error), param, ctx)


class SongTime(Seconds):
    """A time in a song: in seconds, as on a clock, or the start of a place such as `chorus 2`."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The time in seconds, or the text that names a place, which needs the song."""
        from choreograph.music.places import names_place

        if isinstance(value, str) and names_place(value):
            return value
        return super().convert(value, param, ctx)


class SongTimes:
    """The places of one song, which is analysed when a text first names one.

    Texts are those of options. `genre` and `beats` are the options that the analysis depends on.
    """

    def __init__(
        self,
        song: Path,
        repertoire: Repertoire,
        *,
        genre: str | None,
        beats: str | None,
        existing: Path | None,
    ) -> None:
        self._song, self._repertoire, self._existing = song, repertoire, existing
        self._genre, self._beats = genre, beats

    def start_s(self, start: float | str | None) -> float | None:
        """The time in the song at which a dance begins."""
        if not isinstance(start, str):
            return start
        return float(self._places(None, None).in_seconds(start))

    def texts(
        self, given: tuple[str, ...], start_s: float | None, duration_s: float | None
    ) -> tuple[str, ...]:
        """Options with times of the dance to a part of the song, in seconds."""
        return tuple(self._text(text, start_s, duration_s) for text in given)

    def _text(self, text: str, start_s: float | None, duration_s: float | None) -> str:
        from choreograph.music.places import names_place

        if not names_place(text):
            return text
        places = self._places(start_s, duration_s)
        span, at, time = text.partition("@")
        is_span = "=motif" not in text
        return places.in_seconds(span, is_span=is_span) + at + (places.in_seconds(time) if at else "")

    def _places(self, start_s: float | None, duration_s: float | None) -> Places:
        from choreograph.choreography.song_analysis import analyse_song
        from choreograph.library.songs import DEFAULT_BEATS
        from choreograph.music.places import Places
        from choreograph.music.song import load_song

        if self._plan is not None and start_s is None:
            start_s = self._plan.start_s
        if self._plan is not None and duration_s is None:
            duration_s = self._plan.duration_s
        part = load_song(self._song, start_s=start_s or 0.0, duration_s=duration_s)
        features, _ = analyse_song(
            part, self._repertoire, beats=self._beats or DEFAULT_BEATS, genre=self._genre, keep=True
        )
        return Places.of_song(features)

    @cached_property
    def _plan(self) -> Plan | None:
        """The plan of the existing dance, whose part of the song is danced, if there is one."""
        from choreograph.plan.plan import Plan

        is_plan = self._existing is not None and self._existing.suffix.lower() == ".json"
        return Plan.read(self._existing) if is_plan and self._existing is not None else None
