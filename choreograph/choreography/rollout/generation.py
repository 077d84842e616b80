"""Generation of motion from a sequence of motifs by the rollout network (Rhythm is a Dancer, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.slots import ResolvedConstraints
from choreograph.choreography.song_analysis import analyses_cache
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, frame_blocks
from choreograph.core.progress import substage
from choreograph.core.timebase import frame_times_s, seconds_to_frames, times_to_frames
from choreograph.library.songs import DEFAULT_BEATS, names_a_tracker, song_counts
from choreograph.library.vocabulary import Motifs, dance_bounds_s
from choreograph.motion.contacts import contacts_of, lock_feet_in_place
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.music.mel import log_mel
from choreograph.music.rhythm import rhythm_from, word_spectra
from choreograph.music.song import Song
from choreograph.nets.rollout_poses import (
    N_FEET,
    ROLLOUT_FPS,
    PosePredictor,
    root_path,
    to_motion,
    to_poses,
    word_conditions,
    word_of_frames,
)
from choreograph.plan.joins import steer_rad

SEED_FRAMES = 15  # recorded poses before the first generated one, as in the paper
# Gaussian deviations. The network jumps at a new motif. Smoothing reduces its jerk to that of people.
_SMOOTH_S = 0.02
SMOOTH_HEADING_S = 0.08
SHIFT_S = 0.1  # of locked feet. Generated motion is so smooth that fast shifts add no motion beats
STEER_FRAMES = 2 * ROLLOUT_FPS  # path and heading ahead are those of the next two seconds
_SMOOTHED_COLUMNS = 8  # at once
_EMBEDDED_FRAMES = 512  # whose conditions are embedded at once
_MAX_STEER_RAD = 0.4  # per word, over all of it


# What the network reads of the song.


@dataclass(frozen=True, eq=False)
class SongMusic:
    """What the network reads of the song, the same in every attempt."""

    rhythm: NDArray[np.float32]  # (T, 4) at 30 fps
    spectral: NDArray[np.float32]  # (N, 87) of each word, of the song or of another one

    @classmethod
    def of(cls, request: DanceRequest, constraints: ResolvedConstraints) -> SongMusic:
        """The features of the song of a dance, from the cache if they are kept there."""
        song, config, bounds_s = request.song, request.config, constraints.bounds_s
        report = substage(request.report, "analysing the music of motifs")

        def kept(name: str, times_s: Floats, make: Callable[[], NDArray[np.float32]]) -> NDArray[np.float32]:
            inputs = name, times_s, song.samples_sha256
            cached = (lambda: analyses_cache().value(make, *inputs)) if config.cache else make
            return request.memory.value(cached, *inputs)

        beats_s = request.song_features.beat_times_s
        rhythm = kept("rhythm", beats_s, lambda: rhythm_from(song, beats_s, 0.0))
        if request.style_song is not None:
            return cls(rhythm, _repeated_spectra(request.style_song, constraints.n_words, config.beats))
        spectral = kept("spectra", bounds_s, lambda: word_spectra(song, bounds_s, report=report))
        return cls(rhythm, spectral)


def _repeated_spectra(song: Song, n_words: int, beats: str | Path) -> NDArray[np.float32]:
    """Spectral features (N, 87) of a song from beat to beat, repeated where it ends.

    `beats` is the dance's setting. A file belongs to the song of the dance, so this song is tracked instead.
    """
    tracker = beats if names_a_tracker(beats) else DEFAULT_BEATS
    tracked_s = song_counts(song, log_mel(song.samples), tracker).times_s
    spectra = word_spectra(song, dance_bounds_s(tracked_s, song.duration_s))
    return spectra[np.arange(n_words) % len(spectra)]


# Generation of motion.


ASKED_DISTANCE = 1.2  # from the mean of all motifs, of the distance of the word that is wanted


def asked_embeddings(wanted: NDArray[np.floating], motifs: Motifs) -> NDArray[np.float32]:
    """Embeddings (..., 184) that the network is asked for, to show words (..., 184).

    A network that was trained for minutes shows words that are nearer to the mean than those it is asked for
    (ours, `research/results/form_dances.md`).
    """
    mean = motifs.embeddings.mean(axis=0)
    asked: NDArray[np.float32] = (mean + ASKED_DISTANCE * (wanted - mean)).astype(np.float32)
    return asked


@dataclass(frozen=True, eq=False)
class MotifSequence:
    """The motifs to dance, word after word without gaps, and the features of the music."""

    start_s: Floats  # (N,) of the words
    end_s: Floats  # (N,)
    motif: NDArray[np.floating]  # (N, 184) embedding of each word's motif
    rhythm: NDArray[np.floating]  # (T', 4) of the song, of `music.rhythm`
    count_phase: NDArray[np.floating]  # (T', 4) of the song, of `core.counts`
    spectral: NDArray[np.floating] | None  # (N, 87) of each word's music, or None without style


@dataclass(frozen=True, eq=False)
class HeldPoses:
    """Poses that the network continues from, instead of its own."""

    poses: NDArray[np.float32]  # (T, P) at 30 fps
    held: NDArray[np.bool_]  # (T,) which of them are given

    @classmethod
    def of(cls, motion: Motion, spans: Sequence[tuple[int, int]]) -> HeldPoses:
        """The poses of a motion within spans of frames, each the first and the one after the last."""
        poses = to_poses(motion.resampled(ROLLOUT_FPS))
        frame = np.arange(len(poses)) * motion.fps / ROLLOUT_FPS
        held = [(frame >= first) & (frame < stop) for first, stop in spans]
        return cls(poses, np.any(held, axis=0))


def generate_motion(
    net: PosePredictor,
    sequence: MotifSequence,
    seed_motion: Motion,
    *,
    fps: float,
    to_front: bool = True,
    stage: str = "near",
    held: HeldPoses | None = None,
    report: Callable[[int, int], None] | None = None,
) -> Motion:
    """Dance a sequence of motifs, with locked feet, on the skeleton of `seed_motion`.

    Parameters
    ----------
    seed_motion : two frames or more of recorded motion at 30 fps that leads up to the first word. The last 15
        frames initialise the network's state and are not part of the dance.
    fps : of the dance
    to_front : whether the dancer is steered back to face the audience
    stage : to which the path is steered back, as in `DanceConfig`
    held : poses of another dance to the song, which is continued

    Poses from the network are smoothed slightly, and the heading more. Unlike in the paper, the dancer is
    steered to the front, and the path back if it leaves the stage. Feet are locked if the network predicts
    contact and they nearly stand (`motion.contacts`).

    Raises `ParameterError` if the sequence is empty or the skeleton is not the network's.
    """
    poses, contacts = generate_poses(net, sequence, seed_motion, held=held, report=report)
    motion = _on_stage(poses, sequence, seed_motion.skeleton, to_front=to_front, stage=stage)
    del poses
    motion, contacts = _at_rate(motion, contacts, fps, sequence.end_s[-1])
    contacts = contacts.repeat(2, axis=1) * contacts_of(motion)  # (T, 4)
    lock_feet_in_place(motion, np.sqrt(contacts), shift_s=SHIFT_S)
    lock_feet_in_place(motion)  # after the first pass, more feet nearly stand
    return motion


def generate_poses(
    net: PosePredictor,
    sequence: MotifSequence,
    seed_motion: Motion,
    *,
    held: HeldPoses | None = None,
    report: Callable[[int, int], None] | None = None,
) -> tuple[NDArray[np.float32], Floats]:
    """Pose rows (T, P) at 30 fps as the network predicts them, with style, and contacts (T, 2)."""
    if len(sequence.start_s) == 0:
        raise ParameterError("expected a sequence of one motion word or more, got none")
    check_skeleton(net, seed_motion.skeleton)
    n_frames = max(1, seconds_to_frames(float(sequence.end_s[-1]), ROLLOUT_FPS))
    word = word_of_frames(sequence.start_s, n_frames)
    conditions = word_conditions(
        sequence.start_s,
        sequence.end_s,
        n_frames,
        sequence.rhythm,
        sequence.count_phase,
        sequence.motif[:, :0],  # which are large, and added block by block
        sequence.spectral,
    )
    seed_poses, state = to_poses(seed_motion)[-SEED_FRAMES:], net.initial_state()
    pose = seed_poses[-1]
    generated = np.empty((n_frames, len(pose)), np.float32)
    for frames in frame_blocks(n_frames, _EMBEDDED_FRAMES):
        of_block = conditions.mapped(itemgetter(frames))
        embedded = net.embed_conditions(replace(of_block, motif=sequence.motif[word[frames]]))
        if frames.start == 0:
            for row in seed_poses[:-1]:
                _, state = net.step(row, embedded[0][0], embedded[1][0], state)
        for frame, gate_inputs, condition in zip(range(frames.start, frames.stop), *embedded, strict=True):
            pose, state = net.step(pose, gate_inputs, condition, state)
            generated[frame] = pose
            if held is not None and frame < len(held.held) and held.held[frame]:
                pose = held.poses[frame]
            done = frame + 1
            if report is not None and (done % ROLLOUT_FPS == 0 or done == n_frames):
                report(-(-done // ROLLOUT_FPS), -(-n_frames // ROLLOUT_FPS))  # seconds
    rows = net.apply_style(generated, conditions)
    return rows, rows[:, -N_FEET:].astype(np.float64)


def check_skeleton(net: PosePredictor, skeleton: Skeleton) -> None:
    """Raise `ParameterError` unless the network was trained on a skeleton of as many joints."""
    if skeleton.n_joints != net.config.n_joints:
        raise ParameterError(
            f"expected a skeleton of {net.config.n_joints} joints, which the rollout network was trained on, "
            f"got one of {skeleton.n_joints}"
        )


def _on_stage(
    poses: NDArray[np.float32], sequence: MotifSequence, skeleton: Skeleton, *, to_front: bool, stage: str
) -> Motion:
    """The motion of pose rows (T, P), smoothed, and steered to the front and to the stage word by word.

    The heading that is steered to the front is the mean of the next two seconds, so that figures may turn.
    """
    rows: Floats = np.empty(poses.shape)
    for columns in frame_blocks(poses.shape[1], _SMOOTHED_COLUMNS):
        rows[:, columns] = scipy.ndimage.gaussian_filter1d(
            poses[:, columns].astype(np.float64), _SMOOTH_S * ROLLOUT_FPS, axis=0, mode="nearest"
        )
    rows[:, 3] = scipy.ndimage.gaussian_filter1d(rows[:, 3], SMOOTH_HEADING_S * ROLLOUT_FPS, mode="nearest")
    rows[0, 3] = 0.0
    bounds = np.rint(times_to_frames([*sequence.start_s, sequence.end_s[-1]], ROLLOUT_FPS)).astype(np.int64)
    position, heading = np.zeros(3), 0.0  # of the frame before the word
    for first, stop in zip(bounds[:-1], bounds[1:].clip(max=len(rows)), strict=True):
        before = max(first - 1, 0)
        ahead = rows[before : max(stop, first + STEER_FRAMES)]
        travel = root_path(ahead, heading_rad=heading)[0][-1] * [1.0, 0.0, 1.0]
        faces = heading + np.cumsum(ahead[1:, 3])
        turned = float(np.arctan2(np.sin(faces).sum(), np.cos(faces).sum())) if to_front else 0.0
        window = np.hanning(stop - before + 2)[1:-1]
        window[0] = 0.0
        steered_rad = steer_rad(position, travel, turned, stage=stage, most_rad=_MAX_STEER_RAD)
        rows[before:stop, 3] += steered_rad * window / max(window.sum(), 1e-9)
        steered_m, _ = root_path(rows[before:stop], heading_rad=heading)
        position = position + steered_m[-1] * [1.0, 0.0, 1.0]
        heading += float(rows[before + 1 : stop, 3].sum())
    return to_motion(rows, skeleton)


def _at_rate(motion: Motion, contacts: Floats, fps: float, duration_s: float) -> tuple[Motion, Floats]:
    """Motion, by cubic splines, and contacts (T, 2) at the dance's rate."""
    n_frames = max(1, seconds_to_frames(duration_s, fps))
    times = np.minimum(frame_times_s(n_frames, fps), (motion.n_frames - 1) / ROLLOUT_FPS)
    knots = frame_times_s(motion.n_frames, ROLLOUT_FPS)
    contacts = np.stack([np.interp(times, knots, column) for column in contacts.T], axis=1)
    return motion.sampled_smooth(times * ROLLOUT_FPS, fps=fps), contacts
