"""Motion as the rollout network sees it, and sequences of it to learn from.

Where the root goes is told from the dancer's own place: the shift on the ground since the last frame, seen
from the last frame's heading, the height, and the turn of the heading. (The paper shifts in the world and
leaves the heading in the root's rotation: what is learned facing the door is then not known facing the
window.) Rotations are local, the root's without its heading, each joint's signs such that w is not negative
on the whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.errors import ParameterError
from choreograph.features.contacts import foot_contacts
from choreograph.features.frame_rhythm import FRAME_RHYTHM_FPS
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.rollout.model import N_FEET, ROOT_DIM, RolloutConditions
from choreograph.timebase import WORD_FRAMES, frame_times_s

ROLLOUT_FPS = FRAME_RHYTHM_FPS
AHEAD_FRAMES = 9  # so much earlier the network hears: the whole of the window of `features.frame_rhythm`

Floats = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class RolloutTake:
    """One take as the rollout network learns from it; all begins at the motion's first frame."""

    name: str
    motion: Motion  # at 30 fps
    rhythm: Floats  # (T', 4) at 30 fps, T' as long as the song goes on
    start_s: Floats  # (N,) of the words
    end_s: Floats  # (N,)
    motif: Floats  # (N, 184) embedding of each word's motif, that is of the medoid
    embedding: Floats  # (N, 184) of each word itself
    spectral: Floats  # (N, 87)


@dataclass(frozen=True, eq=False)
class Sequences:
    """A batch of sequences of T frames: what was danced, and what was asked for in each frame."""

    pose: Tensor  # (B, T, P)
    conditions: RolloutConditions
    word_frames: Tensor  # (M, 13) fractional frames, in 0 … T - 1, of the words that lie within
    word_sequence: Tensor  # (M,) which sequence each is of
    word_motif: Tensor  # (M, 184) what it was asked to be


def to_poses(motion: Motion) -> NDArray[np.float32]:
    """Rows (T, 4 + 4 J + 2) of a motion at 30 fps; the shift and turn of frame 0 are those of frame 1."""
    quat = np.array(motion.local_quat)
    heading = np.unwrap(rot.yaw(quat[:, 0]))  # (T,)
    quat[:, 0] = rot.multiply(rot.about_y(-heading), quat[:, 0])
    quat = rot.make_continuous(quat)
    quat *= np.where(quat[..., 0].sum(axis=0) < 0, -1.0, 1.0)[:, None]  # (T, J, 4)
    shift = rot.rotate(rot.about_y(-heading[:-1]), np.diff(motion.root_pos_m, axis=0))  # (T - 1, 3)
    root = np.column_stack([shift[:, 0], shift[:, 2], motion.root_pos_m[1:, 1], np.diff(heading)])
    root = np.concatenate([root[:1] if len(root) else np.zeros((1, ROOT_DIM)), root])
    root[0, 2] = motion.root_pos_m[0, 1]
    surely = foot_contacts(body_pos_m(motion), motion.fps)  # (T, 4) ankle and ball of each foot
    feet = surely.reshape(len(surely), 2, 2).max(axis=2)
    return np.concatenate([root, quat.reshape(len(quat), -1), feet], axis=1).astype(np.float32)


def to_motion(poses: Floats, skeleton: Skeleton, *, heading_rad: float = 0.0) -> Motion:
    """The motion (T frames) of rows (T, P), beginning above the origin."""
    rows: NDArray[np.float64] = np.asarray(poses, np.float64)
    turns = rows[:, 3].copy()
    turns[0] = heading_rad
    heading = np.cumsum(turns)  # (T,)
    shift = np.zeros((len(rows), 3))
    shift[1:, [0, 2]] = rows[1:, :2]
    shift[1:] = rot.rotate(rot.about_y(heading[:-1]), shift[1:])
    root_pos_m = np.cumsum(shift, axis=0)
    root_pos_m[:, 1] = rows[:, 2]
    quat = rot.normalize(rows[:, ROOT_DIM:-N_FEET].reshape(len(rows), -1, 4))
    quat[:, 0] = rot.multiply(rot.about_y(heading), quat[:, 0])
    return Motion(skeleton, root_pos_m, rot.make_continuous(quat), ROLLOUT_FPS)


def word_conditions(
    start_s: Floats, end_s: Floats, n_frames: int, rhythm: Floats, motif: Floats, spectral: Floats | None
) -> RolloutConditions:
    """Conditions (1, T, ...) of frames 0 … T - 1, each asked for its word; before the first word, for that.

    `start_s`, `end_s` (N,), `motif` (N, 184) and `spectral` (N, 87) are of the words, `rhythm` (T', 4) of
    the song from the dance's first frame on; where it ends, its last row holds.
    """
    times = frame_times_s(n_frames, ROLLOUT_FPS)
    word = word_of_frames(start_s, n_frames)
    lasts = np.asarray(end_s - start_s)[word]
    progress = ((times - start_s[word]) / lasts).clip(0.0, 1.0)
    heard = np.minimum(np.arange(n_frames) + AHEAD_FRAMES, len(rhythm) - 1)
    return RolloutConditions(
        motif=_row(motif[word]),
        rhythm=_row(rhythm[heard]),
        progress=_row(progress),
        word_s=_row(lasts),
        spectral=None if spectral is None else _row(spectral[word]),
    )


def word_of_frames(start_s: Floats, n_frames: int) -> NDArray[np.int64]:
    """The word that each frame lies in, (T,)."""
    times = frame_times_s(n_frames, ROLLOUT_FPS) + 1e-6
    return (np.searchsorted(start_s, times, side="right") - 1).clip(0)


class RolloutData:
    """All takes as tensors, and random sequences of them."""

    def __init__(self, takes: Sequence[RolloutTake], n_frames: int) -> None:
        self._n_frames = n_frames
        self._takes: list[_Prepared] = []
        for take in takes:
            prepared = _prepared(take)
            if prepared is not None and prepared.stop - prepared.start > n_frames:
                self._takes.append(prepared)
        if not self._takes:
            raise ParameterError(
                f"expected a take of motion words for over {n_frames / ROLLOUT_FPS:.1f} s, got none"
            )
        rooms = np.array([t.stop - t.start - n_frames for t in self._takes])
        self._chance = rooms / rooms.sum()

    def all_poses(self) -> Tensor:
        """Every frame that is learned from, (T, P)."""
        return torch.cat([t.pose[t.start : t.stop] for t in self._takes])

    def all_of(self, name: str) -> Tensor:
        """The conditions of every frame, (T, D), by their field's name in `RolloutConditions`."""
        return torch.cat([getattr(t.conditions, name)[0, t.start : t.stop] for t in self._takes])

    def sequences(
        self, size: int, rng: np.random.Generator, *, own_embedding_share: float, with_style: bool
    ) -> Sequences:
        """Random sequences; a share `own_embedding_share` of them is asked for the words' own embeddings."""
        parts, frames, owners, goals = [], [], [], []
        for row in range(size):
            take = self._takes[rng.choice(len(self._takes), p=self._chance)]
            begin = int(rng.integers(take.start, take.stop - self._n_frames))
            span = slice(begin, begin + self._n_frames)
            of_words = take.embedding if rng.random() < own_embedding_share else take.motif
            parts.append((take.pose[span], of_words[take.word[span]], *take.rows(span)))
            inside = np.flatnonzero(
                (take.first_frame >= begin) & (take.last_frame <= begin + self._n_frames - 1)
            )
            even = np.linspace(0.0, 1.0, WORD_FRAMES)
            first, last = take.first_frame[inside, None] - begin, take.last_frame[inside, None] - begin
            frames.append(first + (last - first) * even)  # (m, 13)
            owners.append(np.full(len(inside), row))
            goals.append(of_words[inside])
        pose, motif, rhythm, progress, word_s, spectral = (torch.stack(p) for p in zip(*parts, strict=True))
        conditions = RolloutConditions(motif, rhythm, progress, word_s, spectral if with_style else None)
        return Sequences(
            pose, conditions, torch.from_numpy(np.concatenate(frames)).float(),
            torch.from_numpy(np.concatenate(owners)), torch.cat(goals),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Prepared:
    pose: Tensor  # (T, P)
    conditions: RolloutConditions  # (1, T, ...)
    word: NDArray[np.int64]  # (T,)
    motif: Tensor  # (N, 184)
    embedding: Tensor  # (N, 184)
    first_frame: Floats  # (N,) fractional
    last_frame: Floats  # (N,)
    start: int  # frames between the first and the last beat
    stop: int

    def rows(self, span: slice) -> tuple[Tensor, ...]:
        conditions = self.conditions
        assert conditions.spectral is not None  # prepared with it
        return tuple(
            v[0, span]
            for v in (conditions.rhythm, conditions.progress, conditions.word_s, conditions.spectral)
        )


def _prepared(take: RolloutTake) -> _Prepared | None:
    """None for a take without words."""
    if len(take.start_s) == 0 or take.motion.n_frames < 2:
        return None
    n_frames = take.motion.n_frames
    motif, embedding = (torch.from_numpy(np.asarray(v, np.float32)) for v in (take.motif, take.embedding))
    first_frame, last_frame = take.start_s * ROLLOUT_FPS, take.end_s * ROLLOUT_FPS
    return _Prepared(
        torch.from_numpy(to_poses(take.motion)),
        word_conditions(take.start_s, take.end_s, n_frames, take.rhythm, take.motif, take.spectral),
        word_of_frames(take.start_s, n_frames), motif, embedding, first_frame, last_frame,
        start=int(np.ceil(first_frame[0])), stop=min(n_frames, int(last_frame[-1]) + 1),
    )  # fmt: skip


def _row(values: Floats) -> Tensor:
    return torch.from_numpy(np.asarray(values, np.float32))[None]
