"""Training of the motion-word network: what stays near and what goes away (Rhythm is a Dancer, 4.2.2).

The paper takes its network ready-made, "trained to distinguish between groups of similar motions
disregarding low level details, temporal warping and frame rate differences". Ours learns that from
pairs of altered copies of words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from choreograph.errors import ParameterError
from choreograph.motion.body import mirrored
from choreograph.nets.density.random_warp import resampled
from choreograph.nets.training import TrainingContext, load_pretrained, train
from choreograph.nets.words.config import WordConfig
from choreograph.nets.words.model import WordNet, clips_to_root_frame
from choreograph.timebase import WORD_FRAMES

_BEGIN_WORDS = 2000
_FEWEST_FRAMES, _MOST_FRAMES = 6, 40  # of a copy at another frame rate: 0.45 s at 13 to 90 fps
_BEAT_S = 0.05  # a copy's beats are heard that much (deviation) off
_WARP = 0.15  # share of its length by which a copy's middle instants are displaced at most
_NOISE_M = 0.015  # a copy's joints stay so much (deviation) elsewhere for the whole word
_SIZE = 0.05  # a copy's dancer is that much larger or smaller at most


@dataclass(frozen=True, eq=False)
class WordTake:
    """One take as the word network learns from it."""

    name: str
    body_pos_m: NDArray[np.floating]  # (T, 21, 3) world
    fps: float
    start_s: NDArray[np.float64]  # (N,) of its words
    end_s: NDArray[np.float64]  # (N,)


@dataclass(frozen=True, eq=False)
class WordCopies:
    """Words as they are, and two altered copies of each."""

    words: Tensor  # (B, 13, 21, 3)
    first: Tensor  # (B, 13, 21, 3)
    second: Tensor  # (B, 13, 21, 3)

    def on(self, device: torch.device) -> WordCopies:
        """The same copies on a device."""
        return WordCopies(self.words.to(device), self.first.to(device), self.second.to(device))


def train_word_net(
    takes: Sequence[WordTake],
    config: WordConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    start: Mapping[str, NDArray] | None = None,
) -> WordNet:
    """Train the network; `ParameterError` if the takes hold fewer than two words."""
    usable = [take for take in takes if len(take.start_s) > 0]
    if sum(len(take.start_s) for take in usable) < 2:
        raise ParameterError("expected takes of two motion words or more to learn from, got fewer")
    drawn = partial(word_copies, usable, mirrored_share=config.mirrored_share)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        net = WordNet(config)
    if start is not None:
        load_pretrained(net, "words", start)
    else:
        net.begin_with(drawn(_BEGIN_WORDS, np.random.default_rng(seed)).words)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        return word_loss(net, drawn(config.batch_size, rng).on(device))

    train(
        net,
        loss,
        name="words",
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        configuration={**asdict(config), "takes": [take.name for take in usable]},
        context=context,
    )
    return net


def word_copies(
    takes: Sequence[WordTake], size: int, rng: np.random.Generator, *, mirrored_share: float = 0.5
) -> WordCopies:
    """Random words, some of them mirrored, and two copies of each, both altered in their own ways.

    A copy is time-warped within the word, its beats are heard a little early or late, it was sampled at
    another frame rate, its dancer has another size and holds the joints a little differently. The copies
    of a mirrored word are altered in the mirror.
    """
    ends = np.cumsum([len(take.start_s) for take in takes])
    chosen = rng.integers(ends[-1], size=size)
    words, copies = [], []
    for index in chosen:
        which = int(np.searchsorted(ends, index, side="right"))
        take = takes[which]
        at = int(index - ends[which])  # from the take's end
        start_s, end_s = float(take.start_s[at]), float(take.end_s[at])
        even = np.linspace(0.0, 1.0, WORD_FRAMES)
        words.append(_sampled(take, start_s, end_s, even))
        copies.append([_altered(take, start_s, end_s, rng) for _ in range(2)])
    clean, altered = np.stack(words), np.stack(copies, axis=1)  # (B, 13, 21, 3), (2, B, 13, 21, 3)
    flip = (rng.random(size) < mirrored_share)[:, None, None, None]
    clean, altered = np.where(flip, mirrored(clean), clean), np.where(flip, mirrored(altered), altered)
    first, second = torch.from_numpy(altered.astype(np.float32))
    return WordCopies(torch.from_numpy(clean.astype(np.float32)), first, second)


def word_loss(net: WordNet, copies: WordCopies) -> Tensor:
    """A copy's nearest in the batch should be the other copy, or what looks like it, and distances true.

    Contrast: cross-entropy over the batch between two Gaussians of distance, `same_m` wide: of embeddings
    of altered copies, and of the words as they are. Dances repeat: what looks like a word is no negative.
    Distance: the squared logarithm of the ratio of embedding distances to mean joint distances, so that a
    centimetre counts among near words more than among far.
    """
    config = net.config
    true_m = mean_joint_distance_m(clips_to_root_frame(copies.words))  # (B, B)
    first, second = net(copies.first), net(copies.second)
    apart = torch.cdist(first, second)  # (B, B)
    target = functional.softmax(-((true_m / config.same_m) ** 2), dim=1)
    logits = -((apart / config.same_m) ** 2)
    contrast = 0.5 * (functional.cross_entropy(logits, target) + functional.cross_entropy(logits.T, target))
    floor_m = 0.5 * config.same_m
    ratio = torch.log((apart + floor_m) / (true_m + floor_m))
    return config.contrast_weight * contrast + config.distance_weight * ratio.square().mean()


def mean_joint_distance_m(words: Tensor) -> Tensor:
    """Mean joint distance of every pair of words (B, T, J, 3), (B, B)."""
    points = words.flatten(1, 2).transpose(0, 1)  # (T J, B, 3)
    return torch.cdist(points, points).mean(dim=0)


def _altered(take: WordTake, start_s: float, end_s: float, rng: np.random.Generator) -> NDArray[np.float32]:
    duration = end_s - start_s
    start_s, end_s = start_s + rng.normal(0, _BEAT_S), end_s + rng.normal(0, _BEAT_S)
    if end_s - start_s < 0.5 * duration:  # beats heard wrong beyond the word's own length
        start_s, end_s = start_s - 0.25 * duration, end_s + 0.25 * duration
    even = np.linspace(0.0, 1.0, int(rng.integers(_FEWEST_FRAMES, _MOST_FRAMES + 1)))
    # Two bends, small enough for time to go forward: |slope - 1| < π (a + 2 b) < 1.
    bends = rng.uniform(-_WARP, _WARP) * np.sin(np.pi * even)
    bends += rng.uniform(-_WARP, _WARP) / 2 * np.sin(2 * np.pi * even)
    rough = _sampled(take, start_s, end_s, even + bends)
    word = resampled(rough, np.linspace(0, len(rough) - 1, WORD_FRAMES))
    word = word * rng.uniform(1 - _SIZE, 1 + _SIZE)
    return word + rng.normal(0, _NOISE_M, (1, *word.shape[1:])).astype(np.float32)


def _sampled(take: WordTake, start_s: float, end_s: float, share: NDArray[np.float64]) -> NDArray[np.float32]:
    return resampled(take.body_pos_m, (start_s + (end_s - start_s) * share) * take.fps)
