"""`Song`: a piece of music as mono samples at the program's rate, from any audio file.

RIFF, RF64, FLAC, Ogg and AIFF are decoded by soundfile; all else (mp3, m4a, opus, video with sound, and
what soundfile refuses) by PyAV, whose FFmpeg prints no warnings about cut bit reservoirs in mp3. Both
decode in blocks that are mixed down and resampled immediately, so a song takes 4 bytes a sample.
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soxr
from numpy.typing import NDArray

from choreograph.audio.decode import decoded_blocks
from choreograph.errors import FormatError, ParameterError
from choreograph.files import as_path
from choreograph.timebase import SAMPLE_RATE_HZ, SEGMENT_S

SILENCE_PEAK = 1e-4  # -80 dB: a song whose peak amplitude is lower counts as silent
_LONG_S = 3600.0


@dataclass(frozen=True, eq=False)
class Song:
    """Mono samples in [-1, 1] at 22.05 kHz, their source, and notes on anything unusual."""

    samples: NDArray[np.float32]  # (S,)
    name: str
    path: Path | None = None
    notes: tuple[str, ...] = ()  # one line each

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.samples) / SAMPLE_RATE_HZ


def load_song(path: str | Path, *, start_s: float = 0.0, duration_s: float | None = None) -> Song:
    """Decode an audio file (or a video's sound) to mono at 22.05 kHz.

    Parameters
    ----------
    path : any container, rate and channel count that soundfile or FFmpeg reads
    start_s : seconds to skip at the beginning
    duration_s : seconds to keep from there, or as many as there are; None for all

    Returns
    -------
    Song   with `notes` if it is silent, shorter than a segment, or very long

    Raises
    ------
    FormatError      the file is missing, a folder, empty, truncated, not audio, or has NaN samples
    ParameterError   `start_s` is negative or past the end, or `duration_s` is not positive
    """
    path = as_path("a song", path)
    for name, value in (("start_s", start_s), ("duration_s", duration_s)):
        if value is not None and not isinstance(value, int | float | np.number):
            raise ParameterError(f"expected {name} in seconds, got {reprlib.repr(value)}")
    if not (np.isfinite(start_s) and start_s >= 0):
        raise ParameterError(f"expected a start in seconds of 0 or more, got {start_s:g}")
    if duration_s is not None and not (np.isfinite(duration_s) and duration_s > 0):
        raise ParameterError(f"expected a duration in seconds above 0, got {duration_s:g}")
    _check_is_file(path)
    rate_hz, blocks = decoded_blocks(path)
    parts = list(_resampled(_checked_finite(_mono_span(blocks, rate_hz, start_s, duration_s), path), rate_hz))
    samples = _concatenated(parts)
    if len(samples) == 0:
        if start_s > 0:
            raise ParameterError(f"expected a start inside {path}, got {start_s:g} s: the song ends before")
        raise FormatError(f"expected a song in {path}, got no sound at all: the file may be cut off")
    return Song(samples, path.stem, path, _notes(samples))


def _check_is_file(path: Path) -> None:
    if path.is_dir():
        raise FormatError(f"expected a song at {path}, got a folder: name one audio file in it")
    if not path.exists():
        raise FormatError(f"expected a song at {path}, got nothing: there is no such file")
    if path.stat().st_size == 0:
        raise FormatError(
            f"expected a song at {path}, got an empty file: its download or copy may have failed"
        )


def _mono_span(
    blocks: Iterator[NDArray[np.float32]], rate_hz: int, start_s: float, duration_s: float | None
) -> Iterator[NDArray[np.float32]]:
    """Mono blocks of the requested span; decoding stops at its end."""
    start = round(start_s * rate_hz)
    stop = None if duration_s is None else start + max(1, round(duration_s * rate_hz))
    position = 0
    for block in blocks:  # (S_b, channels)
        mono = block.mean(axis=1, dtype=np.float32)
        low = max(0, start - position)
        high = len(mono) if stop is None else min(len(mono), stop - position)
        if high > low:
            yield mono[low:high]
        position += len(mono)
        if stop is not None and position >= stop:
            return


def _checked_finite(blocks: Iterator[NDArray[np.float32]], path: Path) -> Iterator[NDArray[np.float32]]:
    for block in blocks:
        if not np.isfinite(block).all():
            raise FormatError(
                f"expected finite samples in {path}, got NaN or infinity: the program that wrote it failed"
            )
        yield block


def _resampled(blocks: Iterator[NDArray[np.float32]], rate_hz: int) -> Iterator[NDArray[np.float32]]:
    if rate_hz == SAMPLE_RATE_HZ:
        yield from blocks
        return
    stream = soxr.ResampleStream(rate_hz, SAMPLE_RATE_HZ, 1, dtype="float32")
    for block in blocks:
        yield stream.resample_chunk(block)
    yield stream.resample_chunk(np.zeros(0, np.float32), last=True)


def _concatenated(parts: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Concatenate and empty `parts`, so that peak memory is one song, not two."""
    samples = np.empty(sum(map(len, parts)), np.float32)
    end = len(samples)
    while parts:
        part = parts.pop()
        samples[end - len(part) : end] = part
        end -= len(part)
    return samples


def _notes(samples: NDArray[np.float32]) -> tuple[str, ...]:
    notes = []
    duration_s = len(samples) / SAMPLE_RATE_HZ
    if max(samples.max(), -samples.min()) < SILENCE_PEAK:
        notes.append("the song is silent: the dance follows no beat")
    if duration_s < SEGMENT_S:
        notes.append(f"the song lasts {duration_s:.2f} s, less than the {SEGMENT_S} s of one segment")
    if duration_s > _LONG_S:
        notes.append(f"the song lasts {duration_s / 3600:.1f} h: this takes long")
    return tuple(notes)
