"""Training data of the motion-word network: words of takes, and pairs of augmented copies of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.motion.body import mirrored
from choreograph.motion.interpolation import interpolate_frames
from choreograph.timebase import WORD_FRAMES

_MIN_FRAMES, _MAX_FRAMES = 6, 40  # of a copy at another frame rate: 0.45 s at 13 to 90 fps
_BEAT_STD_S = 0.05  # error of the beats that bound a copy
_MAX_WARP = 0.15  # displacement of a copy's middle by the time warp, as a share of its length
_JOINT_STD_M = 0.015  # offset of each joint, the same for the whole copy
_MAX_SCALE = 0.05  # change of the dancer's size


@dataclass(frozen=True, eq=False)
class WordTake:
    """One take as training data: its motion, and the bounds of its words."""

    name: str
    body_pos_m: NDArray[np.floating]  # (T, 21, 3) world
    fps: float
    start_s: NDArray[np.float64]  # (N,) of its words
    end_s: NDArray[np.float64]  # (N,)


@dataclass(frozen=True, eq=False)
class AugmentedWords:
    """Words, and two augmented copies of each."""

    words: Tensor  # (B, 13, 21, 3)
    first: Tensor  # (B, 13, 21, 3)
    second: Tensor  # (B, 13, 21, 3)

    def to(self, device: torch.device) -> AugmentedWords:
        """The words and copies on a device."""
        return AugmentedWords(*(getattr(self, field.name).to(device) for field in fields(self)))


def augmented_words(
    takes: Sequence[WordTake], size: int, rng: np.random.Generator, *, mirrored_share: float = 0.5
) -> AugmentedWords:
    """Random words, some mirrored, and two independently augmented copies of each.

    A copy is time-warped within the word, has slightly early or late bounds, comes from another frame rate,
    and its dancer has another size and slightly different joint positions. Copies of a mirrored word are
    mirrored too.
    """
    ends = np.cumsum([len(take.start_s) for take in takes])
    words, copies = [], []
    for index in rng.integers(ends[-1], size=size):
        number = int(np.searchsorted(ends, index, side="right"))
        take = takes[number]
        word = int(index - ends[number])  # negative: counted from the take's end
        start_s, end_s = float(take.start_s[word]), float(take.end_s[word])
        words.append(_sampled(take, start_s, end_s, np.linspace(0.0, 1.0, WORD_FRAMES)))
        copies.append([_augmented_copy(take, start_s, end_s, rng) for _ in range(2)])
    clean, augmented = np.stack(words), np.stack(copies, axis=1)  # (B, 13, 21, 3), (2, B, 13, 21, 3)
    flip = (rng.random(size) < mirrored_share)[:, None, None, None]
    clean, augmented = np.where(flip, mirrored(clean), clean), np.where(flip, mirrored(augmented), augmented)
    first, second = torch.from_numpy(augmented.astype(np.float32))
    return AugmentedWords(torch.from_numpy(clean.astype(np.float32)), first, second)


def _augmented_copy(
    take: WordTake, start_s: float, end_s: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    duration = end_s - start_s
    start_s, end_s = start_s + rng.normal(0, _BEAT_STD_S), end_s + rng.normal(0, _BEAT_STD_S)
    if end_s - start_s < 0.5 * duration:  # the beat errors left too little of the word
        start_s, end_s = start_s - 0.25 * duration, end_s + 0.25 * duration
    even = np.linspace(0.0, 1.0, int(rng.integers(_MIN_FRAMES, _MAX_FRAMES + 1)))
    # Two bends, small enough for time to go forward: |slope - 1| < π (a + 2 b) < 1.
    bends = rng.uniform(-_MAX_WARP, _MAX_WARP) * np.sin(np.pi * even)
    bends += rng.uniform(-_MAX_WARP, _MAX_WARP) / 2 * np.sin(2 * np.pi * even)
    coarse = _sampled(take, start_s, end_s, even + bends)
    word = interpolate_frames(coarse, np.linspace(0, len(coarse) - 1, WORD_FRAMES)).astype(np.float32)
    word = word * rng.uniform(1 - _MAX_SCALE, 1 + _MAX_SCALE)
    return word + rng.normal(0, _JOINT_STD_M, (1, *word.shape[1:])).astype(np.float32)


def _sampled(take: WordTake, start_s: float, end_s: float, share: NDArray[np.float64]) -> NDArray[np.float32]:
    """Body positions (F, 21, 3) at shares (F,) of a word's duration."""
    frames = (start_s + (end_s - start_s) * share) * take.fps
    return interpolate_frames(take.body_pos_m, frames).astype(np.float32)
