"""Synthetic takes for the rollout network: a body swings its left or right arm, or both, on every beat."""

from copy import deepcopy
from functools import cache

import numpy as np

from choreograph.choreography.rollout.generation import MotifSequence
from choreograph.core.counts import count_phase, make_counts, numbers_in_bar
from choreograph.library.vocabulary import segment_words
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.music.rhythm import FRAME_RHYTHM_FPS
from choreograph.nets.configs import word_config
from choreograph.nets.rollout_poses import ROLLOUT_FPS
from choreograph.nets.rollout_training import RolloutTake
from choreograph.nets.words import WordNet, WordTake, train_word_net

BEAT_S = 0.5
N_BEATS = 24
KINDS = 3  # of beats: left arm, right arm, both


def synthetic_motion(kinds: np.ndarray) -> Motion:
    """The arms of each beat's kind, of `kinds` (N,), are raised and lowered on it."""
    skeleton = canonical_skeleton()
    n_frames = round(len(kinds) * BEAT_S * ROLLOUT_FPS) + 1
    times = np.arange(n_frames) / ROLLOUT_FPS
    beat = np.minimum((times / BEAT_S).astype(int), len(kinds) - 1)
    raised = np.sin(np.pi * (times / BEAT_S - beat)) ** 2
    quat = np.tile(rot.IDENTITY, (n_frames, skeleton.n_joints, 1))
    for name, sign, of in (("left_shoulder", 1.0, (0, 2)), ("right_shoulder", -1.0, (1, 2))):
        angle = sign * 1.2 * raised * np.isin(kinds[beat], of)
        vector = np.stack([np.zeros(n_frames), np.zeros(n_frames), angle], axis=1)
        quat[:, skeleton.index(name)] = rot.from_rotvec(vector)
    root = np.tile(skeleton.offsets_m[0], (n_frames, 1))
    return Motion(skeleton, root, quat, ROLLOUT_FPS)


def random_motion(seed: int, n_frames: int = 40) -> Motion:
    """A random walk of the root and of all rotations."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(0, 0.05, (n_frames, 24, 3))
    quat = rot.from_rotvec(np.cumsum(steps, axis=0))
    root = np.cumsum(rng.normal(0, 0.02, (n_frames, 3)), axis=0) + np.array([0.0, 0.9, 0.0])
    return Motion(canonical_skeleton(), root, rot.make_continuous(quat), ROLLOUT_FPS)


def synthetic_takes(n_takes: int = 3) -> list[RolloutTake]:
    """Takes of random kinds of beats. Embeddings and motifs are empty: `synthetic_words` fills them in."""
    takes = []
    for seed in range(n_takes):
        rng = np.random.default_rng(seed)
        kinds = rng.integers(0, KINDS, N_BEATS)
        motion = synthetic_motion(kinds)
        bounds = np.arange(N_BEATS + 1) * BEAT_S
        rhythm = np.zeros((motion.n_frames, 4), np.float32)
        rhythm[:: round(BEAT_S * ROLLOUT_FPS), 3] = 1.0
        phase = count_phase(
            make_counts(bounds, numbers_in_bar(len(bounds), 4), 4), np.arange(motion.n_frames) / ROLLOUT_FPS
        )
        empty = np.zeros((N_BEATS, 184), np.float32)
        spectral = rng.normal(size=(N_BEATS, 87)).astype(np.float32)
        takes.append(
            RolloutTake(
                f"take {seed}", motion, rhythm, phase, bounds[:-1], bounds[1:], empty, empty, spectral
            )
        )
    return takes


def synthetic_words(takes: list[RolloutTake]) -> WordNet:
    """A word network trained on `synthetic_takes`; fills in their embeddings and, the same, motifs."""
    net = deepcopy(_trained_words(len(takes)))
    for take in takes:
        bounds = np.append(take.start_s, take.end_s[-1])
        body = body_pos_m(take.motion)
        take.embedding[:] = net.embed(segment_words(body, ROLLOUT_FPS, bounds).body_pos_m)
        take.motif[:] = take.embedding
    return net


@cache
def _trained_words(n_takes: int) -> WordNet:
    words = [
        WordTake(t.name, body_pos_m(t.motion), ROLLOUT_FPS, t.start_s, t.end_s)
        for t in synthetic_takes(n_takes)
    ]
    return train_word_net(words, word_config("tiny", steps=10), seed=0)


def motif_sequence(kinds, embeddings, beat_s=BEAT_S) -> MotifSequence:
    """The beats' kinds as motifs, with music that has a beat where each begins."""
    bounds = np.arange(len(kinds) + 1) * beat_s
    rhythm = np.zeros((round(bounds[-1] * FRAME_RHYTHM_FPS) + 1, 4))
    rhythm[np.rint(bounds * FRAME_RHYTHM_FPS).astype(int), 3] = 1.0
    counts = make_counts(bounds, numbers_in_bar(len(bounds), 4), 4)
    phase = count_phase(counts, np.arange(len(rhythm)) / FRAME_RHYTHM_FPS)
    return MotifSequence(bounds[:-1], bounds[1:], embeddings[kinds], rhythm, phase, None)
