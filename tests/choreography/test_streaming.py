"""Dances of the rollout network pose by pose: motifs, stage, rates, and how near they are to whole dances."""

from itertools import pairwise

import numpy as np
import pytest
from synthetic_rollouts import BEAT_S, motif_sequence, synthetic_motion

from choreograph.choreography.rollout.generation import generate_motion
from choreograph.choreography.rollout.streaming import DanceStream, FrameCondition, StagePath
from choreograph.evaluation.metrics.physical import foot_slide_cm_s, joint_jerk_m_s3
from choreograph.library.vocabulary import segment_words
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.nets.rollout_poses import LOOKAHEAD_FRAMES, ROLLOUT_FPS, to_poses

pytestmark = pytest.mark.slow


def streamed(net, sequence, seed_motion, fps=60.0):
    """The dance of a whole sequence, a pose at a time."""
    dance = DanceStream(net, seed_motion, fps)
    frames = []
    for start_s, end_s, motif in zip(sequence.start_s, sequence.end_s, sequence.motif, strict=True):
        poses = range(round(start_s * ROLLOUT_FPS), round(end_s * ROLLOUT_FPS))
        dance.begin_word(len(poses))
        for pose in poses:
            progress = (pose / ROLLOUT_FPS - start_s) / (end_s - start_s)
            condition = FrameCondition(motif, progress, end_s - start_s, sequence.count_phase[pose])
            row = min(pose + LOOKAHEAD_FRAMES, len(sequence.rhythm) - 1)
            frames += dance.advance(condition, sequence.rhythm[row])
    root_pos_m, local_quat = (np.stack(values) for values in zip(*frames, strict=True))
    return Motion(seed_motion.skeleton, root_pos_m, local_quat, fps)


def test_motifs_are_danced_as_asked_and_as_smoothly_as_in_a_whole_dance(trained):
    net, words, embeddings = trained
    kinds = np.random.default_rng(7).integers(0, 3, 40)
    sequence, seed = motif_sequence(kinds, embeddings), synthetic_motion(kinds[:2])
    dance = streamed(net, sequence, seed)
    bounds = np.arange(40) * BEAT_S
    danced = words.embed(segment_words(body_pos_m(dance.resampled(30)), 30, bounds).body_pos_m)
    nearest = np.linalg.norm(danced[:, None] - embeddings, axis=-1).argmin(axis=1)
    assert (nearest == kinds[: len(nearest)]).mean() > 0.9
    whole = generate_motion(net, sequence, seed, fps=60).sliced(0, dance.n_frames)
    off_m = np.linalg.norm(body_pos_m(dance) - body_pos_m(whole), axis=-1)
    assert np.median(off_m) < 0.03
    jerk, of_whole = (joint_jerk_m_s3(body_pos_m(one), 60)[1].mean() for one in (dance, whole))
    assert jerk < 1.1 * of_whole
    assert foot_slide_cm_s(body_pos_m(dance), 60) < foot_slide_cm_s(body_pos_m(whole), 60) + 3.0


def test_a_stream_at_another_rate_is_the_same_dance(trained):
    net, _, embeddings = trained
    sequence, seed = motif_sequence(np.array([0, 1, 2, 0]), embeddings), synthetic_motion(np.array([0, 1]))
    slow, quick = (streamed(net, sequence, seed, fps) for fps in (24.0, 120.0))
    assert slow.n_frames == pytest.approx(quick.n_frames / 5, abs=1)
    every_fifth = body_pos_m(quick)[::5][: slow.n_frames]
    assert np.abs(every_fifth - body_pos_m(slow)[: len(every_fifth)]).max() < 0.02


def test_a_path_that_walks_away_is_steered_back():
    rows = to_poses(synthetic_motion(np.zeros(2, int)))[:1].repeat(1800, axis=0)  # a minute
    rows[:, :2] = 0.0, 0.6 / ROLLOUT_FPS  # straight ahead
    rows[:, 3] = 0.0
    path, far = StagePath(), []
    for frame, row in enumerate(rows):
        if frame % 15 == 0:
            path.begin_word(15)
        path.add(row)
        if frame >= 3:
            far.append(np.linalg.norm(path.between(np.zeros(1)).root_pos_m[0, [0, 2]]))
    assert max(far) < 4.0 < 0.6 * 60


def test_poses_go_on_smoothly_from_frame_to_frame():
    rows = to_poses(synthetic_motion(np.array([0, 1, 2])))
    path, ends = StagePath(), []
    for row in rows:
        path.add(row)
        if len(path._root_pos_m) == 4:
            ends.append(path.between(np.array([0.0, 1.0])))
    for before, after in pairwise(ends):
        assert np.allclose(before.root_pos_m[1], after.root_pos_m[0])
        assert np.allclose(before.local_quat[1], after.local_quat[0])
