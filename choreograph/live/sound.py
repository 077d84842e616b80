"""Plays a song and tells the time in it. Sound devices need the extra `live`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.errors import ChoreographError
from choreograph.music.decoding import decode

_START_S = 0.5  # before the song begins


def sound_device(use: str, instead: str = "") -> Any:
    """The package `sounddevice`. Raises `ChoreographError` if it, or PortAudio, is not installed."""
    try:
        import sounddevice
    except (ImportError, OSError) as error:  # an OSError if PortAudio is missing
        raise ChoreographError(
            f"expected the extra `live` {use}, it is not installed: pip install 'choreograph[live]'{instead} "
            f"({' '.join(str(error).split())[:80]})"
        ) from error
    return sounddevice


@contextmanager
def silent() -> Iterator[Callable[[], float]]:
    """The clock of a song that is not played."""
    start_s = time.perf_counter() + _START_S
    yield lambda: time.perf_counter() - start_s


@contextmanager
def playing(song: Path) -> Iterator[Callable[[], float]]:
    """Plays a song. The clock is that of the sound device, with its latency.

    Raises `ChoreographError` without the package or a device.
    """
    sounddevice = sound_device("to play a song", ", or --silent")
    decoding = decode(song)
    samples = np.concatenate(list(decoding.blocks))[:, :2]
    position = 0
    began: list[float] = []

    def fill(out: np.ndarray, n: int, times: object, status: object) -> None:
        nonlocal position
        if not began:
            began.append(float(getattr(times, "outputBufferDacTime", 0.0)))
        part = samples[position : position + n]
        out[: len(part)] = part
        out[len(part) :] = 0.0
        position += n

    try:
        with sounddevice.OutputStream(
            decoding.rate_hz, channels=samples.shape[1], dtype="float32", callback=fill
        ) as stream:
            yield lambda: stream.time - began[0] if began else -_START_S
    except sounddevice.PortAudioError as error:
        raise ChoreographError(
            f"expected a sound device to play the song on, got: {error} (--silent plays none)"
        ) from None
