"""The rollout: a network dances from pose to pose what motifs ask for (Rhythm is a Dancer, section 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from choreograph.blending.foot_locking import lock_feet
from choreograph.blending.stage import steer_rad
from choreograph.errors import ParameterError
from choreograph.features.contacts import foot_contacts
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.rollout.data import ROLLOUT_FPS, to_motion, to_poses, word_conditions
from choreograph.nets.rollout.model import N_FEET, RolloutNet
from choreograph.timebase import frame_times_s, seconds_to_frames, times_to_frames

Floats = NDArray[np.float64]

SEED_FRAMES = 15  # real poses that a rollout begins with, as the paper's
_SMOOTH_S = 0.02  # deviation: where the motif changes the network starts; with that it jerks as people do
_SMOOTH_HEADING_S = 0.08
_LOOK_FRAMES = 2 * ROLLOUT_FPS  # where the way leads is where it has led in two seconds


@dataclass(frozen=True, eq=False)
class MotifScore:
    """What is to be danced when: words without a gap from the dance's first instant to its last."""

    start_s: Floats  # (N,)
    end_s: Floats  # (N,)
    motif: NDArray[np.floating]  # (N, 184) embedding of each word's motif
    rhythm: NDArray[np.floating]  # (T', 4) of the song, `features.frame_rhythm`
    spectral: NDArray[np.floating] | None  # (N, 87) of each word's music; None: no style


def roll_out(
    net: RolloutNet,
    score: MotifScore,
    seed: Motion,
    *,
    fps: float,
    report: Callable[[int, int], None] | None = None,
) -> Motion:
    """The dance of a score, with its feet held, on the skeleton of `seed`.

    Parameters
    ----------
    seed : real motion at 30 fps, two frames or more, that leads up to the first word; of it the last 15
        frames are given to the network before it begins, and are not part of the dance
    fps : of the dance

    After the network: poses are smoothed a little and the heading more, the way is steered home where it
    leads off the stage (ours), and feet that the network says stand, and that do nearly stand, are held
    (`blending.foot_locking`).

    Raises `ParameterError` if the score is empty or the skeleton is not the network's.
    """
    poses, contacts = rolled_poses(net, score, seed, report=report)
    motion = _on_stage(poses, score, seed.skeleton)
    motion, contacts = _at_rate(motion, contacts, fps, score.end_s[-1])
    held = contacts.repeat(2, axis=1) * foot_contacts(body_pos_m(motion), motion.fps)
    return lock_feet(motion, np.sqrt(held))


@torch.no_grad()
def rolled_poses(
    net: RolloutNet, score: MotifScore, seed: Motion, *, report: Callable[[int, int], None] | None = None
) -> tuple[NDArray[np.float32], Floats]:
    """Rows (T, P) at 30 fps as the network makes them, styled, and the contacts (T, 2) it predicts."""
    if len(score.start_s) == 0:
        raise ParameterError("expected a score of one motion word or more, got none")
    if seed.skeleton.n_joints != net.config.n_joints:
        raise ParameterError(
            f"expected a skeleton of {net.config.n_joints} joints, which the rollout network was trained on, "
            f"got one of {seed.skeleton.n_joints}"
        )
    n_frames = max(1, seconds_to_frames(float(score.end_s[-1]), ROLLOUT_FPS))
    conditions = word_conditions(
        score.start_s, score.end_s, n_frames, score.rhythm, score.motif, score.spectral
    )
    into, condition = (values[0] for values in net.conditioned(conditions))  # (T, ...)
    given = torch.from_numpy(to_poses(seed)[-SEED_FRAMES:])
    state = net.begin(1)
    for row in given[:-1]:
        _, state = net.step(row[None], into[:1], condition[:1], state)
    pose, made = given[-1:], []
    for frame in range(n_frames):
        pose, state = net.step(pose, into[frame : frame + 1], condition[frame : frame + 1], state)
        made.append(pose)
        pose = net.fed(pose)
        if report is not None and frame % ROLLOUT_FPS == 0:
            report(frame // ROLLOUT_FPS, n_frames // ROLLOUT_FPS)
    rows = net.fed(net.styled(torch.stack(made, dim=1), conditions))[0].numpy()
    return rows, rows[:, -N_FEET:].astype(np.float64)


def _on_stage(poses: NDArray[np.float32], score: MotifScore, skeleton: Skeleton) -> Motion:
    """The motion of rows (T, P), smoothed, its heading more, and word by word steered home."""
    rows = gaussian_filter1d(poses.astype(np.float64), _SMOOTH_S * ROLLOUT_FPS, axis=0, mode="nearest")
    rows[:, 3] = gaussian_filter1d(rows[:, 3], _SMOOTH_HEADING_S * ROLLOUT_FPS, mode="nearest")
    rows[0, 3] = 0.0
    borders = np.rint(times_to_frames([*score.start_s, score.end_s[-1]], ROLLOUT_FPS)).astype(np.int64)
    place, heading = np.zeros(3), 0.0  # of the frame before the word
    for first, stop in zip(borders[:-1], borders[1:].clip(max=len(rows)), strict=True):
        before = max(first - 1, 0)
        coming = rows[before : max(stop, first + _LOOK_FRAMES)]
        way = to_motion(coming, skeleton, heading_rad=heading).root_pos_m[-1] * [1.0, 0.0, 1.0]
        window = np.hanning(stop - before + 2)[1:-1]
        window[0] = 0.0
        rows[before:stop, 3] += steer_rad(place, way) * window / max(window.sum(), 1e-9)
        steered = to_motion(rows[before:stop], skeleton, heading_rad=heading)
        place = place + steered.root_pos_m[-1] * [1.0, 0.0, 1.0]
        heading += float(rows[before + 1 : stop, 3].sum())
    return to_motion(rows, skeleton)


def _at_rate(motion: Motion, contacts: Floats, fps: float, duration_s: float) -> tuple[Motion, Floats]:
    """Motion and contacts (T, 2) at the dance's rate, by cubic splines."""
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    times = np.minimum(frame_times_s(n_frames, fps), (motion.n_frames - 1) / ROLLOUT_FPS)
    knots = frame_times_s(motion.n_frames, ROLLOUT_FPS)
    contacts = np.stack([np.interp(times, knots, column) for column in contacts.T], axis=1)
    return motion.sampled_smooth(times * ROLLOUT_FPS, fps=fps), contacts
