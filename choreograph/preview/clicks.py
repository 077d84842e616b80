"""Clicks on the counts, mixed into a song, so that anybody can count along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.preview.sound import Blocks, SongPart

COUNT_HZ, COUNT_ONE_HZ = 1000.0, 1500.0
_LENGTH_S, _DECAY_S = 0.06, 0.012
_CLICK_GAIN, _SONG_GAIN = 0.45, 0.5  # together below 1, so the mix does not clip


@dataclass(frozen=True)
class Clicks:
    """When to click, and on which counts.

    Raises `ParameterError` if times are not finite and increasing, or numbers do not match them.
    """

    times_s: Sequence[float]  # in the dance
    numbers: Sequence[int] = ()  # in the bar: 1 clicks higher; none: all click alike

    def __post_init__(self) -> None:
        times_s = np.asarray(self.times_s, np.float64)
        if times_s.ndim != 1 or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
            raise ParameterError("expected increasing finite times of clicks (Q,) in seconds")
        if len(self.numbers) not in (0, len(times_s)):
            raise ParameterError(
                f"expected a number for each of {len(times_s)} clicks, or none, got {len(self.numbers)}"
            )

    def over(self, part: SongPart) -> SongPart:
        """The part, half as loud, with the clicks in it."""
        return replace(part, blocks=self._mixed(part))

    def _mixed(self, part: SongPart) -> Blocks:
        starts = np.round(np.asarray(self.times_s, np.float64) * part.rate_hz).astype(np.int64)
        sounds = [click(COUNT_HZ, part.rate_hz), click(COUNT_ONE_HZ, part.rate_hz)]
        is_one = np.array(self.numbers or [0] * len(starts)) == 1
        position = 0
        for block in part.blocks:
            mix = _SONG_GAIN * block
            end = position + len(block)
            for index in np.flatnonzero((starts > position - len(sounds[0])) & (starts < end)):
                first, stop = max(starts[index], position), min(starts[index] + len(sounds[0]), end)
                heard = sounds[int(is_one[index])][first - starts[index] : stop - starts[index]]
                mix[first - position : stop - position] += heard[:, None]
            yield mix.astype(np.float32)
            position = end


def click(pitch_hz: float, rate_hz: int) -> NDArray[np.float32]:
    """A short sine (S,) that decays."""
    time_s = np.arange(round(_LENGTH_S * rate_hz)) / rate_hz
    return (_CLICK_GAIN * np.sin(2 * np.pi * pitch_hz * time_s) * np.exp(-time_s / _DECAY_S)).astype(
        np.float32
    )
