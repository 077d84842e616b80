"""`Song`, a piece of music as mono samples at the program's rate, from any audio file.

RIFF, RF64, FLAC, Ogg and AIFF are decoded by soundfile. Other formats (mp3, m4a, opus, video with sound, and
files that soundfile cannot read) are decoded by PyAV, whose FFmpeg prints no warnings about cut bit
reservoirs in mp3. Both decode in blocks that are mixed down and resampled immediately, so a song takes 4
bytes per sample. Those of a song of more than ten minutes are in a temporary file, which is mapped to memory.
The system reads it where it is used, and needs no memory for the rest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import soxr
from numpy.typing import NDArray

from choreograph.core.arguments import as_number, as_texts, check_text, unexpected
from choreograph.core.cache import NO_CACHE, DiskCache
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import as_path, check_regular, sha256_of
from choreograph.core.long_songs import ScratchFile, is_long, scratch_file
from choreograph.core.numerics import default_numerics, frame_blocks
from choreograph.core.progress import one_line
from choreograph.core.timebase import SAMPLE_RATE_HZ, SEGMENT_S
from choreograph.music.decoding import Blocks, decode

SILENCE_PEAK = 1e-4  # -80 dB. A song with a lower peak amplitude counts as silent
_MAX_BYTES = 4 << 20  # of what is known of files of songs in the cache
_BLOCK_SAMPLES = 1 << 20
_LONG_S = 3600.0
_LONGEST_S = 3 * 3600.0
_SHORTER_S = 0.1  # largest difference to the requested duration without a note
_CANCELLED = 0.01  # ratio of the power of the mix to that of its channels


@dataclass(frozen=True, eq=False)
class Song:
    """Mono samples in [-1, 1] at 22.05 kHz, their source, and notes on anything unusual.

    Raises `ParameterError` unless there is a sample or more, all samples are finite floats, and all other
    fields have their types.

    Examples
    --------
    >>> tone = 0.5 * np.sin(2 * np.pi * 440 * np.arange(10 * 22050) / 22050)
    >>> song = cg.Song(tone.astype(np.float32), "tone")
    >>> song.duration_s, song.part(2.0, 5.0).duration_s
    (10.0, 5.0)
    """

    samples: NDArray[np.float32]
    """(S,) sound in -1 to 1, mono, at 22,050 samples per second."""

    name: str
    """Its name in plans and messages."""

    path: Path | None = None
    """The file it was read from, if there is one."""

    notes: tuple[str, ...] = ()
    """What is unusual, one line each."""

    start_s: float = 0.0
    """Time of the first sample in the file, in seconds."""

    __repr__ = one_line

    def __post_init__(self) -> None:
        samples, wanted = self.samples, "samples of a song as floats (S,) from -1 to 1, mono at 22.05 kHz"
        if not isinstance(samples, np.ndarray) or samples.dtype.kind != "f":
            raise unexpected(
                wanted, samples, "np.asarray(samples, np.float32) makes them, / 32768 of 16 bits"
            )
        if samples.ndim != 1 or len(samples) == 0:
            raise ParameterError(f"expected {wanted}, got an array of shape {samples.shape}")
        if not np.isfinite([samples.min(), samples.max()]).all():  # without a copy of three hours of music
            raise ParameterError(f"expected {wanted}, got some that are not finite")
        check_text("the name of a song", self.name)
        if self.path is not None:
            object.__setattr__(self, "path", as_path("a song", self.path))
        object.__setattr__(self, "notes", as_texts("notes on a song", self.notes))
        check_span(self.start_s, None)

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.samples) / SAMPLE_RATE_HZ

    @cached_property
    def samples_sha256(self) -> bytes:
        """A checksum of the samples, which takes half the time of `core.cache.digest`."""
        checksum = hashlib.sha256()
        for block in sample_blocks(self.samples):
            checksum.update(np.ascontiguousarray(block).data)
        return checksum.digest()

    def forget_samples(self) -> None:
        """Free the memory of samples that can be decoded again."""

    def part(self, start_s: float = 0.0, duration_s: float | None = None) -> Song:
        """The part from `start_s` on, for `duration_s` or to the end. Raises as `load_song`."""
        check_span(start_s, duration_s)
        first = round(start_s * SAMPLE_RATE_HZ)
        stop = None if duration_s is None else first + max(1, round(duration_s * SAMPLE_RATE_HZ))
        samples = self.samples[first:stop]
        if len(samples) == len(self.samples):
            return self
        if len(samples) == 0:
            raise _past_the_end(start_s, self.path or self.name)
        of_whole = _notes(self.samples)
        notes = (*(note for note in self.notes if note not in of_whole), *_notes(samples))
        return Song(samples, self.name, self.path, notes, self.start_s + start_s)


class _SongOfFile(Song):
    """A song of a file, whose samples are decoded when they are used."""

    def __init__(
        self, decode: Callable[[], Song], path: Path, notes: tuple[str, ...], start_s: float, length_s: float,
        sha256: bytes,
    ) -> None:  # fmt: skip
        """The song that `decode` returns, of which the rest is known."""
        self._decode: Callable[[], Song]
        self._length_s: float
        vars(self).update(
            name=path.stem, path=path, notes=notes, start_s=start_s, samples_sha256=sha256,
            _decode=decode, _length_s=length_s,
        )  # fmt: skip

    @cached_property
    def samples(self) -> NDArray[np.float32]:
        """As `Song.samples`."""
        return self._decode().samples

    def forget_samples(self) -> None:
        """As `Song.forget_samples`."""
        vars(self).pop("samples", None)

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return self._length_s


def cached_song(path: str | Path, *, start_s: float, duration_s: float | None, keep: bool = True) -> Song:
    """As `as_song` of a file, whose samples can be forgotten.

    With `keep`, it is decoded when its samples are used, if the same content was decoded before.
    """
    path = as_path("a song", path)
    check_song_file(path)
    decode = partial(as_song, "a song", path, start_s=start_s, duration_s=duration_s)
    decoded: list[Song] = []

    def about() -> tuple[tuple[str, ...], float, bytes]:
        song = decode()
        decoded.append(song)
        return song.notes, song.duration_s, song.samples_sha256

    inputs = path.stem, sha256_of(path) if keep else "", start_s, duration_s
    cache = DiskCache.of_user("songs", _MAX_BYTES) if keep else NO_CACHE
    notes, length_s, sha256 = cache.value(about, *inputs)
    song = _SongOfFile(decode, path, notes, start_s, length_s, sha256)
    if decoded:
        vars(song)["samples"] = decoded[0].samples
    return song


def check_span(start_s: Any, duration_s: Any) -> None:
    """Raise `ParameterError` unless the part of the song is given in seconds and is not empty."""
    if as_number("start_s in seconds", start_s) < 0:
        raise unexpected("a start in seconds of 0 or more", start_s)
    if duration_s is not None and as_number("duration_s in seconds or None", duration_s) <= 0:
        raise unexpected("a duration in seconds above 0", duration_s)


@default_numerics()
def load_song(path: str | Path, *, start_s: float = 0.0, duration_s: float | None = None) -> Song:
    """Decode an audio file (or a video's sound) to mono at 22.05 kHz.

    Parameters
    ----------
    path : any container, rate and channel count that soundfile or FFmpeg reads
    start_s : seconds to skip at the beginning
    duration_s : seconds to keep from there, if the song has as many, or None for all

    Returns
    -------
    Song   with `notes` if a part of it is lost, or if it is silent, shorter than a segment, or very long

    Raises
    ------
    FormatError      the file is missing, a folder, empty, truncated, not audio, over 3 hours, or not finite
    ParameterError   `start_s` is negative or past the end, or `duration_s` is not positive

    Examples
    --------
    >>> song = cg.load_song(cg.example_songs()["house"], start_s=2.0, duration_s=8.0)
    >>> song.name, song.duration_s
    ('house', 8.0)
    """
    path = as_path("a song", path)
    check_span(start_s, duration_s)
    check_song_file(path)
    samples, notes, levels = _decoded(path, start_s, duration_s, None)
    if levels.cancel:
        samples, notes, _ = _decoded(path, start_s, duration_s, levels.in_phase)
    if len(samples) == 0:
        if start_s > 0:
            raise _past_the_end(start_s, path)
        raise FormatError(f"expected a song in {path}, got no sound at all: the file may be cut off")
    if levels.cancel:
        notes = (*notes, "the channels cancel each other: they are mixed with their phases aligned")
    return Song(samples, path.stem, path, (*notes, *_notes(samples)), start_s)


def as_song(what: str, song: object, *, start_s: float = 0.0, duration_s: float | None = None) -> Song:
    """The part of a song, or of a song's file, with a note if it is shorter than `duration_s`.

    Raises `ParameterError` unless it is a `Song` or a path, and the errors of `load_song`.
    """
    if isinstance(song, Song):
        loaded = song.part(start_s, duration_s)
    elif isinstance(song, str | Path):
        loaded = load_song(song, start_s=start_s, duration_s=duration_s)
    else:
        raise unexpected(f"{what} as a path or a Song", song)
    if duration_s is None or loaded.duration_s > duration_s - _SHORTER_S:
        return loaded
    note = f"{loaded.name}: {duration_s:g} s were requested, the song ends after {loaded.duration_s:.2f} s"
    return replace(loaded, notes=(*loaded.notes, note))


def _past_the_end(start_s: float, song: str | Path) -> ParameterError:
    return ParameterError(f"expected a start inside {song}, got {start_s:g} s: the song ends before")


def _decoded(
    path: Path,
    start_s: float,
    duration_s: float | None,
    weights: NDArray[np.float32] | None,
) -> tuple[NDArray[np.float32], tuple[str, ...], _Levels]:
    """Samples at the program's rate, notes, and the levels of the channels, mixed by `weights` (C,)."""
    decoding = decode(path)
    levels = _Levels(decoding.n_channels)
    mono = _mono_span(levels.watched(decoding.blocks), decoding.rate_hz, start_s, duration_s, weights)
    bearable = _of_bearable_length(mono, path, decoding.rate_hz)
    samples = joined_samples(resampled(bearable, decoding.rate_hz))
    return samples, tuple(decoding.notes), levels


class _Levels:
    """The phases of channels (C,) relative to the loudest channel."""

    def __init__(self, n_channels: int) -> None:
        self._products = np.zeros((n_channels, n_channels))  # sums of products of two channels

    def watched(self, blocks: Blocks) -> Blocks:
        """The blocks (S_b, C), unchanged."""
        for block in blocks:
            self._products += block.T @ block
            yield block

    @property
    def cancel(self) -> bool:
        """Whether the mean of the channels is far quieter than the channels."""
        n_channels = len(self._products)
        power = np.trace(self._products) / n_channels
        return n_channels > 1 and self._products.mean() < _CANCELLED * power

    @property
    def in_phase(self) -> NDArray[np.float32]:
        """Weights (C,) that mix all channels in the phase of the loudest."""
        loudest = int(np.argmax(np.diagonal(self._products)))
        signs = np.where(self._products[loudest] < 0, -1.0, 1.0)
        return (signs / len(signs)).astype(np.float32)


def check_song_file(path: Path) -> None:
    """Raise `FormatError` for a folder, an empty file, or none."""
    if path.is_dir():
        raise FormatError(f"expected a song at {path}, got a folder: name one audio file in it")
    if not path.exists():
        raise FormatError(f"expected a song at {path}, got nothing: there is no such file")
    check_regular(path, "a song")
    if path.stat().st_size == 0:
        raise FormatError(
            f"expected a song at {path}, got an empty file: its download or copy may have failed"
        )


def _mono_span(
    blocks: Blocks,
    rate_hz: int,
    start_s: float,
    duration_s: float | None,
    weights: NDArray[np.float32] | None,
) -> Iterator[NDArray[np.float32]]:
    """Mono blocks of the requested span. Decoding stops at its end."""
    start = round(start_s * rate_hz)
    stop = None if duration_s is None else start + max(1, round(duration_s * rate_hz))
    position = 0
    for block in blocks:  # (S_b, channels)
        mono = block.mean(axis=1, dtype=np.float32) if weights is None else block @ weights
        low = max(0, start - position)
        high = len(mono) if stop is None else min(len(mono), stop - position)
        if high > low:
            yield mono[low:high]
        position += len(mono)
        if stop is not None and position >= stop:
            return


def _of_bearable_length(
    blocks: Iterator[NDArray[np.float32]], path: Path, rate_hz: int
) -> Iterator[NDArray[np.float32]]:
    """The blocks. Raises `FormatError` beyond `_LONGEST_S`: a small file can hold hours of silence."""
    n_frames = 0
    for block in blocks:
        n_frames += len(block)
        if n_frames > _LONGEST_S * rate_hz:
            raise FormatError(
                f"expected up to {_LONGEST_S / 3600:.0f} h of sound in {path}, got more: take a part of it"
            )
        yield block


def resampled(blocks: Iterator[NDArray[np.float32]], rate_hz: float) -> Iterator[NDArray[np.float32]]:
    """Blocks of mono samples (S,) at 22.05 kHz, of blocks at another rate."""
    if rate_hz == SAMPLE_RATE_HZ:
        yield from blocks
        return
    stream = soxr.ResampleStream(rate_hz, SAMPLE_RATE_HZ, 1, dtype="float32")
    for block in blocks:
        yield stream.resample_chunk(block)
    yield stream.resample_chunk(np.zeros(0, np.float32), last=True)


def joined_samples(blocks: Iterable[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Blocks (S_b,) as one array, which is in a temporary file if it is long and there is room for it."""
    parts: list[NDArray[np.float32]] = []
    n_samples, file, has_room = 0, None, True
    for block in blocks:
        parts.append(block)
        n_samples += len(block)
        if is_long(n_samples / SAMPLE_RATE_HZ) and has_room:
            file = file or scratch_file()
            has_room = file is not None and _moved(parts, file)
    if file is not None and file.n_bytes:
        parts.insert(0, file.mapped(np.dtype(np.float32)))
    if len(parts) == 1:
        return parts[0]
    samples = np.empty(sum(map(len, parts)), np.float32)
    end = len(samples)
    while parts:  # which is emptied, so that peak memory is one song and not two
        part = parts.pop()
        samples[end - len(part) : end] = part
        end -= len(part)
    return samples


def _moved(parts: list[NDArray[np.float32]], file: ScratchFile) -> bool:
    """Whether all parts had room in a file. Those that are written are removed from the list."""
    with suppress(OSError):  # the disk is full
        while parts:
            file.append(parts[0])
            parts.pop(0)
    return not parts


def peak_of(samples: NDArray[np.floating]) -> float:
    """The largest magnitude of samples (S,), of which there is one or more. NaN if one is NaN."""
    return float(np.max([max(block.max(), -block.min()) for block in sample_blocks(samples)]))


def sample_blocks(samples: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Consecutive blocks (S_b,) of all samples, for which temporary arrays are small."""
    for part in frame_blocks(len(samples), _BLOCK_SAMPLES):
        yield samples[part]


def at_half_rate(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """Samples (S,) at half their rate, ((S + 1) // 2,)."""
    n_samples = (len(samples) + 1) // 2
    halved = soxr.resample(samples, 2, 1, quality="HQ")[:n_samples]
    return np.pad(halved, (0, n_samples - len(halved)))


def _notes(samples: NDArray[np.float32]) -> tuple[str, ...]:
    notes = []
    duration_s = len(samples) / SAMPLE_RATE_HZ
    if peak_of(samples) < SILENCE_PEAK:
        notes.append("the song is silent: the dance follows no beat")
    if duration_s < SEGMENT_S:
        notes.append(f"the song lasts {duration_s:.2f} s, less than the {SEGMENT_S} s of one segment")
    if duration_s > _LONG_S:
        notes.append(f"the song lasts {duration_s / 3600:.1f} h: this takes long")
    return tuple(notes)
