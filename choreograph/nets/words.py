"""The motion-word network P, which maps 13 frames between two beats to 184 dimensions, and its training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache, partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, Indices, frame_weights, interpolate_frames
from choreograph.core.timebase import WORD_FRAMES
from choreograph.motion.body import BODY_JOINTS, mirrored
from choreograph.nets.configs import WORD_DIM, WordConfig
from choreograph.nets.inference import WordEmbedder
from choreograph.nets.processes import gathered, own_rows
from choreograph.nets.stored import StoredNet
from choreograph.nets.training import TrainingContext, forked_rng, load_pretrained, train

# The motion-word network P: 13 frames between two beats to 184 dimensions (Rhythm is a Dancer, 3.3).
#
# Distances between embeddings approximate mean joint distances in metres. The network moves a word to its
# root frame first, so that embeddings do not depend on the position on the floor. It is differentiable in the
# world positions, which the perceptual loss of the rollout network (equation 9) needs.


_N_VALUES = len(BODY_JOINTS) * 3
_LEFT, _RIGHT = (
    [BODY_JOINTS.index(f"{side}_{part}") for part in ("hip", "shoulder")] for side in ("left", "right")
)


class WordNet(StoredNet):
    """Words to embeddings, with the statistics that standardise its inputs."""

    config_class = WordConfig
    mean_m: Tensor
    std_m: Tensor

    def __init__(self, config: WordConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.linear = nn.Linear(WORD_FRAMES * _N_VALUES, WORD_DIM)
        self.into = nn.Conv1d(_N_VALUES, width, 3, padding=1)
        self.blocks = nn.Sequential(*(_Block(width) for _ in range(config.n_blocks)))
        self.out = nn.Linear(width * WORD_FRAMES, WORD_DIM)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)
        self.register_buffer("mean_m", torch.zeros(WORD_FRAMES, _N_VALUES))
        self.register_buffer("std_m", torch.ones(1))

    @torch.no_grad()
    def init_from_pca(self, words: Tensor) -> None:
        """Initialise with the principal components of words (N, 13, 21, 3), which almost keep distances."""
        values = clips_to_root_frame(words).flatten(2)  # (N, 13, 63)
        self.mean_m.copy_(values.mean(dim=0))
        self.std_m.copy_((values - self.mean_m).square().mean().sqrt())
        axes = torch.linalg.svd((values - self.mean_m).flatten(1), full_matrices=False).Vh[:WORD_DIM]
        self.linear.weight.zero_()
        self.linear.weight[: len(axes)] = axes
        self.linear.bias.zero_()

    def forward(self, body: Tensor) -> Tensor:
        """Body positions (B, T, 21, 3) in metres, anywhere on the floor, to embeddings (B, 184).

        Words of another length than 13 frames are resampled to 13, from the first frame to the last.
        """
        x = (clips_to_root_frame(_resampled_words(body)).flatten(2) - self.mean_m) / self.std_m  # (B, 13, 63)
        features = self.blocks(self.into(x.transpose(1, 2)))  # (B, C, 13)
        # From standard deviations summed over joints and frames to root mean joint distances in metres.
        scale_m = self.std_m / (WORD_FRAMES * len(BODY_JOINTS)) ** 0.5
        result: Tensor = scale_m * (self.linear(x.flatten(1)) + self.out(features.flatten(1)))
        return result

    def embed(self, words_m: NDArray[np.floating]) -> NDArray[np.float32]:
        """Embeddings (N, 184) of words (N, 13, 21, 3). Raises `ParameterError` for another shape or nan."""
        return WordEmbedder.from_arrays(*self.to_arrays()).embed(words_m)


def clips_to_root_frame(body: Tensor) -> Tensor:
    """`motion.body.clips_to_root_frame` of tensors (B, T, 21, 3), differentiable."""
    middle = body[:, body.shape[1] // 2]
    across = (middle[:, _LEFT] - middle[:, _RIGHT]).sum(dim=1)[:, [0, 2]]  # (B, 2)
    cos, sin = functional.normalize(across, dim=1).T[..., None, None]  # (B, 1, 1) each
    origin = body[:, :, :1].mean(dim=1, keepdim=True)  # (B, 1, 1, 3) mean position of the pelvis
    x, z = body[..., 0] - origin[..., 0], body[..., 2] - origin[..., 2]
    return torch.stack([cos * x + sin * z, body[..., 1], cos * z - sin * x], dim=-1)


def _resampled_words(body: Tensor) -> Tensor:
    if body.shape[1] == WORD_FRAMES:
        return body
    values = body.flatten(2).transpose(1, 2)  # (B, 63, T)
    resampled = functional.interpolate(values, WORD_FRAMES, mode="linear", align_corners=True)
    return resampled.transpose(1, 2).reshape(len(body), WORD_FRAMES, *body.shape[2:])  # (B, 13, 21, 3)


class _Block(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.GroupNorm(1, width), nn.GELU(), nn.Conv1d(width, width, 3, padding=1),
            nn.GroupNorm(1, width), nn.GELU(), nn.Conv1d(width, width, 3, padding=1),
        )  # fmt: skip

    def forward(self, x: Tensor) -> Tensor:
        result: Tensor = x + self.layers(x)
        return result


# Training data of the motion-word network: words of takes, and pairs of augmented copies of them.


_MIN_FRAMES, _MAX_FRAMES = 6, 40  # of a copy at another frame rate: 0.45 s at 13 to 90 fps
_BEAT_STD_S = 0.05  # error of the beats that bound a copy
_MAX_WARP = 0.15  # displacement of a copy's middle by the time warp, as a share of its length
_JOINT_STD_M = 0.015  # offset of each joint, the same for the whole copy
_MAX_SCALE = 0.05  # change of the dancer's size
_BLOCK_WORDS = 64  # of a take, copied at a time to bound memory


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
    takes: Sequence[WordTake],
    size: int,
    rng: np.random.Generator,
    *,
    mirrored_share: float = 0.5,
    at_once: int = _BLOCK_WORDS,
) -> AugmentedWords:
    """Random words, some mirrored, and two independently augmented copies of each.

    A copy is time-warped within the word, has slightly early or late bounds, comes from another frame rate,
    and its dancer has another size and slightly different joint positions. Copies of a mirrored word are
    mirrored too. Up to `at_once` words of a take are copied at a time, which changes nothing.
    """
    ends = np.cumsum([len(take.start_s) for take in takes])
    index = rng.integers(ends[-1], size=size)
    changes = _Changes.drawn(rng, 2 * size)
    flip = (rng.random(size) < mirrored_share)[:, None, None, None]

    take_of = np.searchsorted(ends, index, side="right")  # (B,)
    start_s = np.concatenate([take.start_s for take in takes])[index]
    end_s = np.concatenate([take.end_s for take in takes])[index]
    share = np.linspace(0.0, 1.0, WORD_FRAMES)
    words = np.empty((size, WORD_FRAMES, len(BODY_JOINTS), 3), np.float32)
    copies = np.empty((size, 2, *words.shape[1:]), np.float32)
    for number in np.unique(take_of):
        chosen = np.flatnonzero(take_of == number)
        for of_take in np.array_split(chosen, -(-len(chosen) // at_once)):
            start, end = start_s[of_take], end_s[of_take]
            words[of_take] = _sampled(takes[number], start[:, None], end[:, None], share)
            twice = np.stack([2 * of_take, 2 * of_take + 1], axis=1).ravel()  # a word's copies
            changed = changes.changed(takes[number], start.repeat(2), end.repeat(2), twice)
            copies[of_take] = changed.reshape(-1, *copies.shape[1:])
    augmented = copies.swapaxes(0, 1)  # (2, B, 13, 21, 3)
    clean, augmented = np.where(flip, mirrored(words), words), np.where(flip, mirrored(augmented), augmented)
    first, second = torch.from_numpy(augmented.astype(np.float32))
    return AugmentedWords(torch.from_numpy(clean.astype(np.float32)), first, second)


@dataclass(frozen=True, eq=False)
class _Changes:
    """What makes copies (C,) of words differ from them."""

    bounds_s: NDArray[np.float64]  # (C, 2) errors
    n_frames: NDArray[np.int64]  # (C,) at the copy's frame rate
    bends: NDArray[np.float64]  # (C, 2) of time
    scale: NDArray[np.float32]  # (C,)
    offset_m: NDArray[np.float32]  # (C, 21, 3)

    @classmethod
    def drawn(cls, rng: np.random.Generator, n_copies: int) -> _Changes:
        """Copy by copy."""
        drawn = [
            (
                (rng.normal(0, _BEAT_STD_S), rng.normal(0, _BEAT_STD_S)),
                rng.integers(_MIN_FRAMES, _MAX_FRAMES + 1),
                (rng.uniform(-_MAX_WARP, _MAX_WARP), rng.uniform(-_MAX_WARP, _MAX_WARP) / 2),
                rng.uniform(1 - _MAX_SCALE, 1 + _MAX_SCALE),
                rng.normal(0, _JOINT_STD_M, (len(BODY_JOINTS), 3)).astype(np.float32),
            )
            for _ in range(n_copies)
        ]
        bounds_s, n_frames, bends, scale, offset_m = map(np.array, zip(*drawn, strict=True))
        return cls(bounds_s, n_frames, bends, scale.astype(np.float32), offset_m)

    def changed(self, take: WordTake, start_s: Floats, end_s: Floats, copies: Indices) -> NDArray[np.float32]:
        """Some of the copies (N, 13, 21, 3), of words of a take that start and end at times (N,)."""
        duration_s = end_s - start_s
        start_s, end_s = start_s + self.bounds_s[copies, 0], end_s + self.bounds_s[copies, 1]
        short = end_s - start_s < 0.5 * duration_s  # the beat errors left too little of the word
        start_s = np.where(short, start_s - 0.25 * duration_s, start_s)
        end_s = np.where(short, end_s + 0.25 * duration_s, end_s)
        even, first_bend, second_bend, low, high, weight = (t[self.n_frames[copies]] for t in _frame_rates())
        # Two bends that are small enough for time to increase: |slope - 1| < π (a + 2 b) < 1.
        bends = self.bends[copies, :, None]
        share = even + (bends[:, 0] * first_bend + bends[:, 1] * second_bend)  # (N, 40)
        coarse = _sampled(take, start_s[:, None], end_s[:, None], share)  # (N, 40, 21, 3)
        each, weight = np.arange(len(copies))[:, None], weight[..., None, None]
        word: Floats = coarse[each, low] * (1 - weight) + coarse[each, high] * weight
        scale, offset_m = self.scale[copies, None, None, None], self.offset_m[copies, None]
        changed: NDArray[np.float32] = word.astype(np.float32) * scale + offset_m
        return changed


@cache
def _frame_rates() -> tuple[NDArray[Any], ...]:
    """By the number of frames of a copy: even times (41, 40), two bends of them, and how 13 frames are made.

    Times after the last frame are those of the last.
    """
    even = np.ones((_MAX_FRAMES + 1, _MAX_FRAMES))
    bends = np.zeros((2, *even.shape))
    to_word: list[Any] = [np.zeros((_MAX_FRAMES + 1, WORD_FRAMES), kind) for kind in (int, int, float)]
    for n in range(_MIN_FRAMES, _MAX_FRAMES + 1):
        even[n, :n] = np.linspace(0.0, 1.0, n)
        bends[:, n, :n] = np.sin(np.pi * even[n, :n]), np.sin(2 * np.pi * even[n, :n])
        for table, row in zip(to_word, frame_weights(np.linspace(0, n - 1, WORD_FRAMES), n), strict=True):
            table[n] = row
    return even, *bends, *to_word


def _sampled(take: WordTake, start_s: Floats, end_s: Floats, share: Floats) -> NDArray[np.float32]:
    """Body positions (N, F, 21, 3) at shares (N, F) or (F,) of the durations of words (N, 1)."""
    frames = (start_s + (end_s - start_s) * share) * take.fps
    return interpolate_frames(take.body_pos_m, frames).astype(np.float32)


# Training of the motion-word network (Rhythm is a Dancer, section 4.2.2).
#
# The paper uses a pretrained network, "trained to distinguish between groups of similar motions disregarding
# low level details, temporal warping and frame rate differences". Ours learns this from augmented words.


_PCA_WORDS = 2000


def train_word_net(
    takes: Sequence[WordTake],
    config: WordConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
) -> WordNet:
    """Train the network. Raises `ParameterError` if the takes have fewer than two words."""
    usable = [take for take in takes if len(take.start_s) > 0]
    if sum(len(take.start_s) for take in usable) < 2:
        raise ParameterError("expected takes of two motion words or more to learn from, got fewer")
    sampled = partial(augmented_words, usable, mirrored_share=config.mirrored_share)
    with forked_rng():
        torch.manual_seed(seed)
        net = WordNet(config)
    if pretrained is not None:
        load_pretrained(net, "words", pretrained)
    else:
        net.init_from_pca(sampled(_PCA_WORDS, np.random.default_rng(seed)).words)

    def loss(batch: AugmentedWords, device: torch.device) -> Tensor:
        return word_loss(net, batch.to(device))

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
        prepare=partial(sampled, config.batch_size),
    )
    return net


def word_loss(net: WordNet, batch: AugmentedWords) -> Tensor:
    """Contrast between augmented copies, and embedding distances that match mean joint distances.

    The contrast is the cross-entropy over the batch between two Gaussian kernels of distance of width
    `same_m`. One is for the embeddings of the copies, the other for the words without augmentation. Dances
    repeat movements, so similar words are not negatives of each other.

    The distance term is the squared logarithm of the ratio of embedding distance to mean joint distance, so
    that one centimetre has more weight between similar words than between different ones.
    """
    config = net.config
    true_m = mean_joint_distance_m(clips_to_root_frame(batch.words))  # (B, B)
    first, second = (gathered(net(own_rows(copies))) for copies in (batch.first, batch.second))
    distance_m = torch.cdist(first, second)  # (B, B)
    target = functional.softmax(-((true_m / config.same_m) ** 2), dim=1)
    logits = -((distance_m / config.same_m) ** 2)
    contrast = 0.5 * (functional.cross_entropy(logits, target) + functional.cross_entropy(logits.T, target))
    floor_m = 0.5 * config.same_m
    log_ratio = torch.log((distance_m + floor_m) / (true_m + floor_m))
    result: Tensor = config.contrast_weight * contrast + config.distance_weight * log_ratio.square().mean()
    return result


def mean_joint_distance_m(words: Tensor) -> Tensor:
    """Mean joint distance of every pair of words (B, T, J, 3), (B, B)."""
    points = words.flatten(1, 2).transpose(0, 1)  # (T J, B, 3)
    return torch.cdist(points, points).mean(dim=0)
