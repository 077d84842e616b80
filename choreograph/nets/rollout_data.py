"""Data of the rollout network: motion as pose rows and back, conditions of frames, training sequences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import AnyFloats
from choreograph.core.timebase import WORD_FRAMES, frame_times_s
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.contacts import foot_contacts
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.music.frame_rhythm import FRAME_RHYTHM_FPS, FRAME_RHYTHM_NAMES
from choreograph.nets.rollout import N_FEET, ROOT_DIM, RolloutConditions

# Conversion of motion to pose rows and back, and the conditions of the frames of a dance.
#
# Root motion is relative to the dancer. It consists of the shift on the ground since the last frame, relative
# to the heading of the last frame, the height, and the change of heading. (In the paper, shifts are in the
# world, and the heading stays in the rotation of the root. A movement learned in one heading is then not
# known in another.) Rotations are local, that of the root without its heading. The sign of the quaternions of
# each joint is such that w is mostly not negative.


ROLLOUT_FPS = FRAME_RHYTHM_FPS
LOOKAHEAD_FRAMES = 9  # of the rhythm: the whole window of `music.frame_rhythm`


def to_poses(motion: Motion) -> NDArray[np.float32]:
    """Pose rows (T, 4 + 4 J + 2) of a motion at 30 fps. Frame 0 has the root shift and yaw of frame 1."""
    quat = np.array(motion.local_quat)
    heading = np.unwrap(rot.yaw(quat[:, 0]))  # (T,)
    quat[:, 0] = rot.multiply(rot.about_y(-heading), quat[:, 0])
    quat = rot.make_continuous(quat)
    quat *= np.where(quat[..., 0].sum(axis=0) < 0, -1.0, 1.0)[:, None]  # (T, J, 4)
    shift = rot.rotate(rot.about_y(-heading[:-1]), np.diff(motion.root_pos_m, axis=0))  # (T - 1, 3)
    root = np.column_stack([shift[:, 0], shift[:, 2], motion.root_pos_m[1:, 1], np.diff(heading)])
    root = np.concatenate([root[:1] if len(root) else np.zeros((1, ROOT_DIM)), root])
    root[0, 2] = motion.root_pos_m[0, 1]
    contacts = foot_contacts(body_pos_m(motion), motion.fps)  # (T, 4) ankle and ball of each foot
    feet = contacts.reshape(len(contacts), 2, 2).max(axis=2)  # (T, 2)
    return np.concatenate([root, quat.reshape(len(quat), -1), feet], axis=1).astype(np.float32)


def to_motion(poses: AnyFloats, skeleton: Skeleton, *, heading_rad: float = 0.0) -> Motion:
    """The motion (T frames) of pose rows (T, P). It begins above the origin."""
    rows: NDArray[np.float64] = np.asarray(poses, np.float64)
    yaw = rows[:, 3].copy()
    yaw[0] = heading_rad
    heading = np.cumsum(yaw)  # (T,)
    shift = np.zeros((len(rows), 3))
    shift[1:, [0, 2]] = rows[1:, :2]
    shift[1:] = rot.rotate(rot.about_y(heading[:-1]), shift[1:])
    root_pos_m = np.cumsum(shift, axis=0)
    root_pos_m[:, 1] = rows[:, 2]
    quat = rot.normalize(rows[:, ROOT_DIM:-N_FEET].reshape(len(rows), -1, 4))
    quat[:, 0] = rot.multiply(rot.about_y(heading), quat[:, 0])
    return Motion(skeleton, root_pos_m, rot.make_continuous(quat), ROLLOUT_FPS)


def word_conditions(
    start_s: AnyFloats,
    end_s: AnyFloats,
    n_frames: int,
    rhythm: AnyFloats,
    count_phase: AnyFloats,
    motif: AnyFloats,
    spectral: AnyFloats | None,
) -> RolloutConditions:
    """Conditioning (1, T, ...) of frames 0 … T - 1 on their words. Frames before the first word belong to it.

    `start_s`, `end_s` (N,), `motif` (N, 184) and `spectral` (N, 87) are of the words, `rhythm` and
    `count_phase` (T', 4) of the song from the dance's first frame on. Their last rows are repeated after
    their end.
    """
    of = conditions_of_frames(start_s, end_s, n_frames, rhythm, count_phase)
    return RolloutConditions(
        motif=_batch_of_one(motif[of.word]),
        rhythm=_batch_of_one(of.rhythm),
        progress=_batch_of_one(of.progress),
        word_s=_batch_of_one(of.word_s),
        count_phase=_batch_of_one(of.count_phase),
        spectral=None if spectral is None else _batch_of_one(spectral[of.word]),
    )


@dataclass(frozen=True, eq=False)
class FrameConditions:
    """Conditions of frames, except those that they have from their word: see `RolloutConditions`."""

    word: NDArray[np.int64]  # (T,)
    rhythm: AnyFloats  # (T, 4)
    progress: AnyFloats  # (T,)
    word_s: AnyFloats  # (T,)
    count_phase: AnyFloats  # (T, 4)


def conditions_of_frames(
    start_s: AnyFloats, end_s: AnyFloats, n_frames: int, rhythm: AnyFloats, count_phase: AnyFloats
) -> FrameConditions:
    """The conditions of frames 0 … T - 1. The arguments are those of `word_conditions`."""
    word = word_of_frames(start_s, n_frames)
    word_s = np.asarray(end_s - start_s)[word]
    frame = np.arange(n_frames)
    return FrameConditions(
        word=word,
        rhythm=rhythm[np.minimum(frame + LOOKAHEAD_FRAMES, len(rhythm) - 1)],
        progress=((frame_times_s(n_frames, ROLLOUT_FPS) - start_s[word]) / word_s).clip(0.0, 1.0),
        word_s=word_s,
        count_phase=count_phase[np.minimum(frame, len(count_phase) - 1)],
    )


def word_of_frames(start_s: AnyFloats, n_frames: int) -> NDArray[np.int64]:
    """The word that contains each frame, (T,)."""
    times = frame_times_s(n_frames, ROLLOUT_FPS) + 1e-6
    return (np.searchsorted(start_s, times, side="right") - 1).clip(0)


def _batch_of_one(values: AnyFloats) -> Tensor:
    return torch.from_numpy(np.asarray(values, np.float32))[None]


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


@dataclass(frozen=True, eq=False)
class RolloutBatch:
    """Sequences of T frames: recorded poses, their conditions, and the words that lie within."""

    pose: Tensor  # (B, T, P)
    conditions: RolloutConditions
    word_frames: Tensor  # (M, 13) fractional frames of the words, in 0 … T - 1
    word_sequence: Tensor  # (M,) the sequence of each word
    word_motif: Tensor  # (M, 184) the embedding that each word is conditioned on


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
