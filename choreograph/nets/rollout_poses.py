"""Poses of the rollout network and their prediction, without torch.

A pose is a row of 4 + 4 J + 2 numbers: root motion, rotations, and contacts of both feet. `nets.rollout`
defines the network in torch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.counts import COUNT_PHASE_DIM
from choreograph.core.numerics import AnyFloats, Floats, frame_blocks
from choreograph.core.timebase import frame_times_s
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.contacts import foot_contacts
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.music.rhythm import FRAME_RHYTHM_FPS, FRAME_RHYTHM_NAMES
from choreograph.music.spectral import SPECTRAL_DIM
from choreograph.nets.configs import WORD_DIM, RolloutConfig
from choreograph.nets.inference import TrainedNet
from choreograph.nets.layers import Array, Shapes, gelu, linear, sigmoid, unit

# Conversion of motion to pose rows and back, and the conditions of the frames of a dance.
#
# Root motion is relative to the dancer. It consists of the shift on the ground since the last frame, relative
# to the heading of the last frame, the height, and the change of heading. (In the paper, shifts are in the
# world, and the heading stays in the rotation of the root. A movement learned in one heading is then not
# known in another.) Rotations are local, that of the root without its heading. The sign of the quaternions of
# each joint is such that w is mostly not negative.


ROOT_DIM = 4  # shift sideways and forward, height, change of heading
N_FEET = 2
RHYTHM_DIM = len(FRAME_RHYTHM_NAMES)
PHASE_DIM = 3
STYLE_WIDTH = 128  # of the MLP of equation 4
ROLLOUT_FPS = FRAME_RHYTHM_FPS
LOOKAHEAD_FRAMES = 9  # of the rhythm: the whole window of `music.rhythm`

_Rows = TypeVar("_Rows")  # arrays, or the tensors of a training


@dataclass(frozen=True, eq=False)
class RolloutConditions(Generic[_Rows]):
    """Conditioning of each frame, (T, ...) of one dance, or (B, T, ...) in a training."""

    motif: _Rows  # (T, 184) embedding of the frame's motif
    rhythm: _Rows  # (T, 4) of `music.rhythm`, some frames ahead
    progress: _Rows  # (T,) phase in the frame's word, 0 to 1
    word_s: _Rows  # (T,) duration of the word
    count_phase: _Rows  # (T, 4) of `core.counts`
    spectral: _Rows | None  # (T, 87) of the music of the word, or None without style

    def mapped(self, change: Callable[[_Rows], _Rows]) -> RolloutConditions[_Rows]:
        """The conditions with each of their arrays changed."""
        spectral = None if self.spectral is None else change(self.spectral)
        return RolloutConditions(
            change(self.motif), change(self.rhythm), change(self.progress), change(self.word_s),
            change(self.count_phase), spectral,
        )  # fmt: skip


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
    root_pos_m, heading = root_path(rows, heading_rad=heading_rad)
    quat = np.empty((len(rows), skeleton.n_joints, 4))
    for block in frame_blocks(len(rows)):
        quat[block] = rot.normalize(rows[block, ROOT_DIM:-N_FEET].reshape(-1, skeleton.n_joints, 4))
    quat[:, 0] = rot.multiply(rot.about_y(heading), quat[:, 0])
    return Motion(skeleton, root_pos_m, rot.make_continuous(quat, out=quat), ROLLOUT_FPS)


def root_path(rows: Floats, *, heading_rad: float = 0.0) -> tuple[Floats, Floats]:
    """Positions (T, 3) and headings (T,) of the root of pose rows (T, P), from above the origin."""
    yaw = rows[:, 3].copy()
    yaw[0] = heading_rad
    heading = np.cumsum(yaw)  # (T,)
    shift = np.zeros((len(rows), 3))
    shift[1:, [0, 2]] = rows[1:, :2]
    shift[1:] = rot.rotate(rot.about_y(heading[:-1]), shift[1:])
    root_pos_m = np.cumsum(shift, axis=0)
    root_pos_m[:, 1] = rows[:, 2]
    return root_pos_m, heading


def word_conditions(
    start_s: AnyFloats,
    end_s: AnyFloats,
    n_frames: int,
    rhythm: AnyFloats,
    count_phase: AnyFloats,
    motif: AnyFloats,
    spectral: AnyFloats | None,
) -> RolloutConditions[AnyFloats]:
    """Conditioning of frames 0 … T - 1 on their words. Frames before the first word belong to it.

    `start_s`, `end_s` (N,), `motif` (N, 184) and `spectral` (N, 87) are of the words, `rhythm` and
    `count_phase` (T', 4) of the song from the dance's first frame on. Their last rows are repeated after
    their end.
    """
    of = conditions_of_frames(start_s, end_s, n_frames, rhythm, count_phase)
    return RolloutConditions(
        motif=motif[of.word],
        rhythm=of.rhythm,
        progress=of.progress,
        word_s=of.word_s,
        count_phase=of.count_phase,
        spectral=None if spectral is None else spectral[of.word],
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


# The network (Rhythm is a Dancer, section 4).


State = list[tuple[Array, Array]]  # hidden and cell (W,) of each layer


class PosePredictor(TrainedNet):
    """The rollout network `nets.rollout.RolloutNet`, for one dance."""

    config_class = RolloutConfig

    def __init__(self, weights: Mapping[str, Array], config: RolloutConfig) -> None:
        super().__init__(weights, config)
        # The weights of a layer's input and of its state beside each other, for one product in each frame.
        into = [weights["pose.weight"], *(weights[f"between.{i}.weight"] for i in range(config.n_layers - 1))]
        self._gates = [
            np.concatenate([matrix, weights[f"recurrent.{layer}.weight"]], axis=1)
            for layer, matrix in enumerate(into)
        ]

    @staticmethod
    def shapes(config: RolloutConfig) -> Shapes:
        """The shapes of all weights."""
        width, n_quat = config.width, 4 * config.n_joints
        n_pose, embedded = ROOT_DIM + n_quat + N_FEET, config.condition_width
        n_conditions = WORD_DIM + RHYTHM_DIM + PHASE_DIM + COUNT_PHASE_DIM * config.count_phase
        shapes: Shapes = {
            "into.weight": (4 * width, embedded or n_conditions), "into.bias": (4 * width,),
            "pose.weight": (4 * width, n_pose),
            "out.weight": (n_pose, width + embedded), "out.bias": (n_pose,),
            "style.0.weight": (STYLE_WIDTH, SPECTRAL_DIM), "style.0.bias": (STYLE_WIDTH,),
            "style.2.weight": (2 * n_quat, STYLE_WIDTH), "style.2.bias": (2 * n_quat,),
            "motif_std": (1,),
        }  # fmt: skip
        if embedded:
            for layer, n_in in ((0, n_conditions), (2, embedded)):
                shapes[f"conditions.{layer}.weight"] = (embedded, n_in)
                shapes[f"conditions.{layer}.bias"] = (embedded,)
        for layer in range(config.n_layers):
            shapes[f"recurrent.{layer}.weight"] = (4 * width, width)
        for layer in range(config.n_layers - 1):
            shapes |= {f"between.{layer}.weight": (4 * width, width), f"between.{layer}.bias": (4 * width,)}
        for name, size in (("root", ROOT_DIM), ("rhythm", RHYTHM_DIM), ("spectral", SPECTRAL_DIM)):
            shapes |= {f"{name}_mean": (size,), f"{name}_std": (size,)}
        return shapes

    def initial_state(self) -> State:
        """Hidden and cell states before the first frame."""
        zero = np.zeros(self.config.width, np.float32)
        return [(zero, zero)] * self.config.n_layers

    def embed_conditions(
        self, conditions: RolloutConditions[AnyFloats], frames: slice = slice(None)
    ) -> tuple[Array, Array]:
        """Conditions of frames as gate inputs of the first layer (T, 4 W), and as input of the last (T, C).

        C is 0 where they are not embedded, as in the paper, whose last layer has the LSTM alone as its input.
        """
        weights, config = self.weights, self.config
        motif, rhythm, progress, word_s, count_phase = (
            np.asarray(getattr(conditions, name)[frames], np.float32)
            for name in ("motif", "rhythm", "progress", "word_s", "count_phase")
        )
        angle = np.float32(2 * np.pi) * progress
        phase = np.stack([np.sin(angle), np.cos(angle), word_s], axis=1)  # (T, 3)
        inputs = [
            motif / weights["motif_std"] * np.float32(config.motifs),
            (rhythm - weights["rhythm_mean"]) / weights["rhythm_std"] * np.float32(config.use_audio),
            phase * np.float32(config.use_audio and config.phase),
        ]
        if config.count_phase:
            inputs.append(count_phase * np.float32(config.use_audio))
        condition = np.concatenate(inputs, axis=1)
        if config.condition_width:
            for layer in (0, 2):
                condition = gelu(linear(condition, weights, f"conditions.{layer}"))
        return linear(condition, weights, "into"), condition[:, : config.condition_width]

    def step(self, pose: Array, gate_inputs: Array, condition: Array, state: State) -> tuple[Array, State]:
        """The pose (P,) that follows `pose` (P,), with unit rotations, and contacts as probabilities."""
        weights, width = self.weights, self.config.width
        inputs = pose.copy()
        inputs[:ROOT_DIM] = (pose[:ROOT_DIM] - weights["root_mean"]) / weights["root_std"]
        next_state: State = []
        for layer, (hidden, cell) in enumerate(state):
            gates = self._gates[layer] @ np.concatenate([inputs, hidden])
            gates += weights[f"between.{layer - 1}.bias"] if layer else gate_inputs
            admitted, kept, _, shown = sigmoid(gates).reshape(4, width)
            cell = kept * cell + admitted * np.tanh(gates[2 * width : 3 * width])
            inputs = shown * np.tanh(cell)
            next_state.append((inputs, cell))
        output: Array = weights["out.weight"] @ np.concatenate([inputs, condition])
        output += weights["out.bias"]
        output[:ROOT_DIM] = output[:ROOT_DIM] * weights["root_std"] + weights["root_mean"]
        output[ROOT_DIM:-N_FEET] = _unit_quaternions(output[ROOT_DIM:-N_FEET])
        output[-N_FEET:] = sigmoid(output[-N_FEET:])
        return output, next_state

    def apply_style(self, poses: Array, conditions: RolloutConditions[AnyFloats]) -> Array:
        """Poses (T, P) with the style of their songs, as by `RolloutNet.apply_style`."""
        if conditions.spectral is None:
            return poses
        fade_s, blocks = self.config.style_fade_s, list(frame_blocks(len(poses)))
        vector = np.empty((len(poses), 2 * (poses.shape[1] - ROOT_DIM - N_FEET)), np.float32)  # (T, 2 * 4 J)
        for block in blocks:
            vector[block] = self._style(conditions.spectral[block])
        if fade_s > 0:
            n_frames = 2 * (round(fade_s * FRAME_RHYTHM_FPS) // 2) + 1
            for column in vector.T:
                for _ in range(2):
                    column[:] = scipy.ndimage.uniform_filter1d(column, n_frames, mode="nearest")
        else:
            window = 0.5 - 0.5 * np.cos(2 * np.pi * conditions.progress)  # (T,)
            word_frames = np.maximum(conditions.word_s * FRAME_RHYTHM_FPS, 1.0)
            vector *= (window / np.sqrt(word_frames)).astype(np.float32)[:, None]
        styled = poses.copy()
        for block in blocks:
            scale, shift = np.split(np.float32(self.config.style_strength) * vector[block], 2, axis=1)
            quat = poses[block, ROOT_DIM:-N_FEET]
            styled[block, ROOT_DIM:-N_FEET] = _unit_quaternions((1 + scale) * quat + shift)
        return styled

    def _style(self, spectral: AnyFloats) -> Array:
        """The vectors (T, 2 * 4 J) of equation 4 of spectral features (T, 87)."""
        weights = self.weights
        normal = (np.asarray(spectral, np.float32) - weights["spectral_mean"]) / weights["spectral_std"]
        return unit(linear(gelu(linear(normal, weights, "style.0")), weights, "style.2"))

    def with_style(self, strength: float | None, window: str | None) -> PosePredictor:
        """The same network with another β of equation 4, or another window: "smooth" or "hamming".

        None keeps the value of the network. The values of the paper are 40 and hamming.
        """
        config, smooth_s = self.config, RolloutConfig().style_fade_s
        if strength is not None:
            config = replace(config, style_strength=strength)
        if window is not None:
            config = replace(config, style_fade_s=smooth_s if window == "smooth" else 0.0)
        return self if config == self.config else PosePredictor(self.weights, config)


def _unit_quaternions(values: Array) -> Array:
    """Values (..., 4 J) as those of unit quaternions."""
    return unit(values.reshape(*values.shape[:-1], -1, 4)).reshape(values.shape)
