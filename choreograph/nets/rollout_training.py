"""Training of the rollout network with auto-conditioning (Rhythm is a Dancer, section 4.4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats
from choreograph.core.timebase import WORD_FRAMES
from choreograph.motion.motion import Motion
from choreograph.music.rhythm import FRAME_RHYTHM_NAMES
from choreograph.nets.configs import RolloutConfig
from choreograph.nets.processes import own_part
from choreograph.nets.rollout import RolloutBatch, RolloutLosses, RolloutNet
from choreograph.nets.rollout_poses import (
    N_FEET,
    ROLLOUT_FPS,
    ROOT_DIM,
    RolloutConditions,
    conditions_of_frames,
    to_poses,
)
from choreograph.nets.training import TrainingContext, forked_rng, load_pretrained, train
from choreograph.nets.words import WordNet

# Training sequences for the rollout network: takes with words and music, at several tempi, in batches.


BEAT = FRAME_RHYTHM_NAMES.index("beat")


@dataclass(frozen=True, eq=False)
class RolloutTake:
    """One take as training data. All arrays begin at the motion's first frame."""

    name: str
    motion: Motion  # at 30 fps
    rhythm: AnyFloats  # (T', 4) at 30 fps, to the end of the take or of the song
    count_phase: AnyFloats  # (T', 4) at 30 fps
    start_s: AnyFloats  # (N,) of the words
    end_s: AnyFloats  # (N,)
    motif: AnyFloats  # (N, 184) embedding of each word's motif, that is of its medoid
    embedding: AnyFloats  # (N, 184) of each word
    spectral: AnyFloats  # (N, 87) of each word's music
    genre: str = ""


class RolloutData:
    """All takes as tensors, at each of some tempi, and random batches of sequences."""

    def __init__(self, takes: Sequence[RolloutTake], n_frames: int, tempi: Sequence[float] = (1.0,)) -> None:
        self._n_frames = n_frames
        self._takes: list[_TakeTensors] = []
        for take, tempo in product(takes, tempi):
            tensors = _take_tensors(at_tempo(take, tempo))
            if tensors is not None and tensors.stop - tensors.start > n_frames:
                self._takes.append(tensors)
        if not self._takes:
            raise ParameterError(
                f"expected a take of motion words for over {n_frames / ROLLOUT_FPS:.1f} s, got none"
            )
        n_starts = np.array([t.stop - t.start - n_frames for t in self._takes])
        self._probability = n_starts / n_starts.sum()

    def all_poses(self) -> Tensor:
        """Every training frame, (T, P)."""
        return torch.cat([t.pose[t.start : t.stop] for t in self._takes])

    def all_conditions(self, name: str) -> Tensor:
        """`motif`, `rhythm` or `spectral` of every training frame, (T, D)."""
        spans = [(t, slice(t.start, t.stop)) for t in self._takes]
        if name == "rhythm":
            return torch.cat([t.rhythm[span] for t, span in spans])
        return torch.cat([getattr(t, name)[t.word[span]] for t, span in spans])

    def batch(
        self, size: int, rng: np.random.Generator, *, own_embedding_share: float, with_style: bool
    ) -> RolloutBatch:
        """Random sequences, `own_embedding_share` of them conditioned on the words' own embeddings."""
        parts, word_frames, word_sequence, word_motif = [], [], [], []
        for row in range(size):
            take = self._takes[rng.choice(len(self._takes), p=self._probability)]
            start = int(rng.integers(take.start, take.stop - self._n_frames))
            span = slice(start, start + self._n_frames)
            embeddings = take.embedding if rng.random() < own_embedding_share else take.motif
            word = take.word[span]
            frames = (take.pose, take.rhythm, take.progress, take.word_s, take.count_phase)
            parts.append((*(rows[span] for rows in frames), embeddings[word], take.spectral[word]))
            inside = np.flatnonzero(
                (take.first_frame >= start) & (take.last_frame <= start + self._n_frames - 1)
            )
            even = np.linspace(0.0, 1.0, WORD_FRAMES)
            first, last = take.first_frame[inside, None] - start, take.last_frame[inside, None] - start
            word_frames.append(first + (last - first) * even)  # (m, 13)
            word_sequence.append(np.full(len(inside), row))
            word_motif.append(embeddings[inside])
        pose, rhythm, progress, word_s, count_phase, motif, spectral = (
            torch.stack(p) for p in zip(*parts, strict=True)
        )
        conditions = RolloutConditions(
            motif, rhythm, progress, word_s, count_phase, spectral if with_style else None
        )
        return RolloutBatch(
            pose, conditions, torch.from_numpy(np.concatenate(word_frames)).float(),
            torch.from_numpy(np.concatenate(word_sequence)), torch.cat(word_motif),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _TakeTensors:
    """A take as tensors, with the range of frames that words cover."""

    pose: Tensor  # (T, P)
    rhythm: Tensor  # (T, 4)
    progress: Tensor  # (T,)
    word_s: Tensor  # (T,)
    count_phase: Tensor  # (T, 4)
    word: NDArray[np.int64]  # (T,)
    motif: Tensor  # (N, 184)
    embedding: Tensor  # (N, 184)
    spectral: Tensor  # (N, 87)
    first_frame: AnyFloats  # (N,) fractional
    last_frame: AnyFloats  # (N,)
    start: int  # first frame of the first word
    stop: int  # after the last frame of the last word


def at_tempo(take: RolloutTake, tempo: float) -> RolloutTake:
    """The take and its music, played at a multiple of their tempo."""
    if tempo == 1.0:
        return take
    n_frames = int((take.motion.n_frames - 1) / tempo) + 1
    return replace(
        take,
        motion=take.motion.sampled(np.arange(n_frames, dtype=np.float64) * tempo, fps=ROLLOUT_FPS),
        rhythm=_with_beats_of(_played_at(take.rhythm, tempo), take.rhythm, tempo),
        count_phase=_played_at(take.count_phase, tempo),
        start_s=take.start_s / tempo,
        end_s=take.end_s / tempo,
    )


def _with_beats_of(played: AnyFloats, rhythm: AnyFloats, tempo: float) -> AnyFloats:
    """The rhythm at another tempo, with every beat once, even if its frame is dropped or repeated."""
    beats = np.rint(np.flatnonzero(rhythm[:, BEAT] > 0) / tempo).astype(np.int64)
    is_beat = np.isin(np.arange(len(played)), beats)
    return np.concatenate([played[:, :BEAT], is_beat[:, None]], axis=1)


def _played_at(rows: AnyFloats, tempo: float) -> AnyFloats:
    """The rows (T, D) nearest to each frame at another tempo."""
    frames = np.rint(np.arange(int((len(rows) - 1) / tempo) + 1) * tempo).astype(np.int64)
    result: AnyFloats = rows[np.minimum(frames, len(rows) - 1)]
    return result


def _take_tensors(take: RolloutTake) -> _TakeTensors | None:
    """The take as tensors, or None for a take without words."""
    if len(take.start_s) == 0 or take.motion.n_frames < 2:
        return None
    n_frames = take.motion.n_frames
    of = conditions_of_frames(take.start_s, take.end_s, n_frames, take.rhythm, take.count_phase)
    first_frame, last_frame = take.start_s * ROLLOUT_FPS, take.end_s * ROLLOUT_FPS
    return _TakeTensors(
        pose=torch.from_numpy(to_poses(take.motion)),
        rhythm=_tensor(of.rhythm),
        progress=_tensor(of.progress),
        word_s=_tensor(of.word_s),
        count_phase=_tensor(of.count_phase),
        word=of.word,
        motif=_tensor(take.motif),
        embedding=_tensor(take.embedding),
        spectral=_tensor(take.spectral),
        first_frame=first_frame,
        last_frame=last_frame,
        start=int(np.ceil(first_frame[0])),
        stop=min(n_frames, int(last_frame[-1]) + 1),
    )


def _tensor(rows: AnyFloats) -> Tensor:
    return torch.from_numpy(np.asarray(rows, np.float32))


# Training with auto-conditioning.


def train_rollouts(
    takes: Sequence[RolloutTake],
    words: WordNet,
    config: RolloutConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
) -> Iterator[RolloutNet]:
    """Train the network, or with `config.by_genre` one for each genre, in the order of their names.

    Raises as `train_rollout`.
    """
    if not config.by_genre:
        yield train_rollout(takes, words, config, seed=seed, context=context, pretrained=pretrained)
        return
    of_genres = {name: [t for t in takes if t.genre == name] for name in sorted({t.genre for t in takes})}
    for genre, of_genre in of_genres.items():  # before hours of training
        try:
            RolloutData(of_genre, config.frames, config.tempi)
        except ParameterError as error:
            raise ParameterError(f"the genre {genre!r}: {error}: leave out its takes") from error
    for index, (genre, of_genre) in enumerate(of_genres.items()):
        yield train_rollout(
            of_genre, words, replace(config, genre=genre),
            seed=seed, context=context, pretrained=pretrained, name=f"rollout_{index}",
        )  # fmt: skip


def train_rollout(
    takes: Sequence[RolloutTake],
    words: WordNet,
    config: RolloutConfig,
    *,
    seed: int,
    context: TrainingContext | None = None,
    pretrained: Mapping[str, NDArray[Any]] | None = None,
    name: str = "rollout",
) -> RolloutNet:
    """Train the network on takes of one skeleton. `words` is the frozen P of the perceptual loss.

    `name` is that of its checkpoint.

    Raises `ParameterError` if no take has motion words for longer than a training sequence.
    """
    data = RolloutData(takes, config.frames, config.tempi)
    skeleton = takes[0].motion.skeleton
    config = replace(config, n_joints=skeleton.n_joints)
    with forked_rng():
        torch.manual_seed(seed)
        net = RolloutNet(config)
    if pretrained is not None:
        load_pretrained(net, "rollout", pretrained)
    elif config.standardised:
        _init_statistics(net, data)
    losses = RolloutLosses(skeleton, words, config)

    def loss(rng: np.random.Generator, device: torch.device) -> Tensor:
        with_style = rng.random() >= config.style_dropout
        batch = data.batch(
            config.batch_size, rng, own_embedding_share=config.own_embedding_share, with_style=with_style
        )
        self_fed_frames = int(rng.choice(config.self_fed_frames))
        batch = batch.part(own_part(config.batch_size)).to(device)
        predicted = unroll(net, batch, self_fed_frames=self_fed_frames)
        return losses.to(device).total(net, predicted, batch, self_fed_frames=self_fed_frames)

    train(
        net,
        loss,
        name=name,
        n_steps=config.steps,
        learning_rate=config.learning_rate,
        weight_decay=config.weight_decay,
        seed=seed,
        schedule=config.schedule,
        configuration={**asdict(config), "takes": [take.name for take in takes]},
        context=context,
    )
    return net


def unroll(net: RolloutNet, batch: RolloutBatch, *, self_fed_frames: int) -> Tensor:
    """Poses (B, T - 1, P) predicted for frames 1 … T - 1, before style and with contacts as logits.

    The input is the true pose for `teacher_frames` frames, then the network's own prediction for
    `self_fed_frames` frames, and so on in turns: the paper's auto-conditioning.
    """
    # Slices of the frames would each have a gradient of the size of the whole.
    gate_inputs, condition = (values.unbind(1) for values in net.embed_conditions(batch.conditions))
    state = net.initial_state(len(batch.pose))
    period = net.config.teacher_frames + self_fed_frames
    predicted: list[Tensor] = []
    for frame in range(batch.pose.shape[1] - 1):
        teacher_forced = frame % period < net.config.teacher_frames
        pose = batch.pose[:, frame] if teacher_forced else net.as_input(predicted[-1])
        pose, state = net.step(pose, gate_inputs[frame + 1], condition[frame + 1], state)
        predicted.append(pose)
    return torch.stack(predicted, dim=1)


@torch.no_grad()
def _init_statistics(net: RolloutNet, data: RolloutData) -> None:
    """Set the standardisation to the statistics of the data, and the bias of the output to the mean pose."""
    roots = data.all_poses()[:, :ROOT_DIM]
    for name, values in (
        ("root", roots),
        ("rhythm", data.all_conditions("rhythm")),
        ("spectral", data.all_conditions("spectral")),
    ):
        getattr(net, f"{name}_mean").copy_(values.mean(dim=0))
        getattr(net, f"{name}_std").copy_(values.std(dim=0).clamp_min(1e-4))
    net.motif_std.copy_(data.all_conditions("motif").std())
    net.out.bias.copy_(data.all_poses().mean(dim=0))
    net.out.bias[:ROOT_DIM] = 0.0
    net.out.bias[-N_FEET:] = 0.0
