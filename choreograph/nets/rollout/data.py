"""Motion as pose rows and back, and what the frames of a dance are conditioned on, for the rollout network.

Root motion is relative to the dancer: the shift on the ground since the last frame, seen from the heading of
the last frame, the height, and the change of heading. (The paper has shifts in the world and leaves the
heading in the root's rotation. What is learned in one heading is then unknown in another.) Rotations are
local, the root's without its heading. The sign of each joint's quaternions is such that w is mostly not
negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from choreograph.features.contacts import foot_contacts
from choreograph.features.frame_rhythm import FRAME_RHYTHM_FPS
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.rollout.model import N_FEET, ROOT_DIM, RolloutConditions
from choreograph.timebase import frame_times_s

ROLLOUT_FPS = FRAME_RHYTHM_FPS
LOOKAHEAD_FRAMES = 9  # of the rhythm: the whole window of `features.frame_rhythm`

Floats = NDArray[np.floating]


def to_poses(motion: Motion) -> NDArray[np.float32]:
    """Pose rows (T, 4 + 4 J + 2) of a motion at 30 fps; frame 0 has the root shift and yaw of frame 1."""
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


def to_motion(poses: Floats, skeleton: Skeleton, *, heading_rad: float = 0.0) -> Motion:
    """The motion (T frames) of pose rows (T, P); it begins above the origin."""
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
    start_s: Floats,
    end_s: Floats,
    n_frames: int,
    rhythm: Floats,
    count_phase: Floats,
    motif: Floats,
    spectral: Floats | None,
) -> RolloutConditions:
    """Conditioning (1, T, ...) of frames 0 … T - 1 on their words; frames before the first word belong to it.

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
    """What frames are conditioned on, save what they have of their word: see `RolloutConditions`."""

    word: NDArray[np.int64]  # (T,)
    rhythm: Floats  # (T, 4)
    progress: Floats  # (T,)
    word_s: Floats  # (T,)
    count_phase: Floats  # (T, 4)


def conditions_of_frames(
    start_s: Floats, end_s: Floats, n_frames: int, rhythm: Floats, count_phase: Floats
) -> FrameConditions:
    """The conditions of frames 0 … T - 1; arguments as of `word_conditions`."""
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


def word_of_frames(start_s: Floats, n_frames: int) -> NDArray[np.int64]:
    """The word that each frame lies in, (T,)."""
    times = frame_times_s(n_frames, ROLLOUT_FPS) + 1e-6
    return (np.searchsorted(start_s, times, side="right") - 1).clip(0)


def _batch_of_one(values: Floats) -> Tensor:
    return torch.from_numpy(np.asarray(values, np.float32))[None]
