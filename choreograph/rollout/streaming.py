"""The rollout network's dance pose by pose, as what it depends on becomes known: `generation`, live."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from choreograph.blending.foot_lock_stream import FootLockStream
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.nets.rollout.data import LOOKAHEAD_FRAMES, ROLLOUT_FPS, to_poses
from choreograph.nets.rollout.model import RolloutConditions, RolloutNet
from choreograph.rollout.generation import SEED_FRAMES, SHIFT_S, check_skeleton
from choreograph.rollout.stage_path import FUTURE_FRAMES, Poses, StagePath

Floats = NDArray[np.float64]

POSES_AHEAD = FUTURE_FRAMES + 1  # of a final frame: its feet are locked one pose later than it is sampled
ROWS_AHEAD = POSES_AHEAD + LOOKAHEAD_FRAMES  # of the rhythm


@dataclass(frozen=True, eq=False)
class FrameCondition:
    """What one frame at 30 fps is conditioned on: a row of `RolloutConditions`, without rhythm and style."""

    motif: NDArray[np.floating]  # (184,)
    progress: float
    word_s: float
    count_phase: NDArray[np.floating]  # (4,)

    def with_rhythm(self, rhythm: NDArray[np.floating]) -> RolloutConditions:
        """The frame's conditions as tensors (1, 1, ...), with the rhythm (4,) some frames ahead."""
        rows = (self.motif, rhythm, self.progress, self.word_s, self.count_phase)
        motif, ahead, progress, word_s, phase = (
            torch.as_tensor(np.asarray(row, np.float32))[None, None] for row in rows
        )
        return RolloutConditions(motif, ahead, progress, word_s, phase, None)


class PoseStream:
    """Pose rows of the network, one for each frame's conditions, after recorded motion that leads up to them.

    Raises `ParameterError` if the skeleton of `seed_motion` is not the network's.
    """

    def __init__(self, net: RolloutNet, seed_motion: Motion) -> None:
        check_skeleton(net, seed_motion.skeleton)
        self._net = net
        self._state = net.initial_state(1)
        self._seed = torch.from_numpy(to_poses(seed_motion)[-SEED_FRAMES:])
        self._pose: torch.Tensor | None = None  # the last one

    @torch.no_grad()
    def next_row(self, conditions: RolloutConditions) -> NDArray[np.float32]:
        """The pose row (P,) that follows, contacts as probabilities."""
        gate_inputs, embedded = (values[:, 0] for values in self._net.embed_conditions(conditions))
        if self._pose is None:
            for row in self._seed[:-1]:
                _, self._state = self._net.step(row[None], gate_inputs, embedded, self._state)
            self._pose = self._seed[-1:]
        pose, self._state = self._net.step(self._pose, gate_inputs, embedded, self._state)
        self._pose = self._net.as_input(pose)
        return self._pose[0].numpy()


class DanceStream:
    """The dance of a network at `fps`, on its stage and with locked feet, as pose after pose is predicted."""

    def __init__(self, net: RolloutNet, seed_motion: Motion, fps: float) -> None:
        self._poses = PoseStream(net, seed_motion)
        self._path = StagePath()
        self._feet = FootLockStream(seed_motion.skeleton, fps, SHIFT_S)
        self._fps = fps
        self._n_predicted, self._n_sampled = 0, 0  # poses at 30 fps, frames at `fps`
        self._pending: list[Poses] = []
        self._last_quat: Floats | None = None  # (1, J, 4), for continuous signs

    def begin_word(self, n_frames: int) -> None:
        """Say that the next condition begins a word of so many frames at 30 fps."""
        self._path.begin_word(n_frames)

    def advance(self, condition: FrameCondition, rhythm: NDArray[np.floating]) -> list[tuple[Floats, Floats]]:
        """Predict one more pose; the frames final now, as root (3,) and rotations (J, 4).

        These are the frames from the pose `POSES_AHEAD` before it up to the next one.
        """
        self._path.add(self._poses.next_row(condition.with_rhythm(rhythm)))
        self._n_predicted += 1
        if self._n_predicted <= FUTURE_FRAMES:
            return []
        self._pending.append(self._sampled(self._n_predicted - 1 - FUTURE_FRAMES))
        if len(self._pending) < 2:
            return []
        done = self._pending.pop(0)
        if len(done.root_pos_m) == 0:
            return []
        quat = self._feet.pop(len(done.root_pos_m))
        before = quat[:1] if self._last_quat is None else self._last_quat
        quat = rot.make_continuous(np.concatenate([before, quat]))[1:]
        self._last_quat = quat[-1:]
        return list(zip(done.root_pos_m, quat, strict=True))

    def _sampled(self, pose: int) -> Poses:
        """Poses at the dance's frames from a pose of the network up to the next; their feet can be locked."""
        stop = int(np.ceil((pose + 1) * self._fps / ROLLOUT_FPS - 1e-6))
        frames = np.arange(self._n_sampled, stop)
        self._n_sampled = stop
        poses = self._path.between(frames * ROLLOUT_FPS / self._fps - pose)
        self._feet.push(poses.root_pos_m, poses.local_quat, poses.contacts)
        return poses
