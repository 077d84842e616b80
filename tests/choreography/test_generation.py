"""Generation with the rollout network: duration, stage, determinism, and what it refuses."""

import numpy as np
import pytest
from synthetic_rollouts import motif_sequence, synthetic_motion

from choreograph.choreography.rollout import generation
from choreograph.choreography.rollout.generation import MotifSequence, generate_motion, generate_poses
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.library.vocabulary import segment_words
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.skeleton import Skeleton
from choreograph.nets.configs import rollout_config
from choreograph.nets.rollout import RolloutNet
from choreograph.nets.rollout_poses import ROLLOUT_FPS, ROOT_DIM, PosePredictor, to_motion, to_poses

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def untrained():
    """An untrained network, no word network, and embeddings of three motifs."""
    net = PosePredictor.from_arrays(*RolloutNet(rollout_config("tiny")).to_arrays())
    return net, None, np.random.default_rng(0).normal(size=(3, 184))


@pytest.mark.slow
@pytest.mark.parametrize("beat_s", [0.5, 0.6])
def test_trained_motifs_are_danced_in_another_order_and_tempo(trained, beat_s):
    net, words, embeddings = trained
    kinds = np.random.default_rng(7).integers(0, 3, 30)
    dance = generate_motion(
        net, motif_sequence(kinds, embeddings, beat_s), synthetic_motion(kinds[:2]), fps=60
    )
    assert dance.n_frames == round(30 * beat_s * 60)
    bounds = np.minimum(np.arange(31) * beat_s, dance.duration_s - 0.04)
    danced = words.embed(segment_words(body_pos_m(dance.resampled(30)), 30, bounds).body_pos_m)
    nearest = np.linalg.norm(danced[:, None] - embeddings, axis=-1).argmin(axis=1)
    assert (nearest == kinds).mean() > 0.9


@pytest.mark.slow
def test_three_minutes_neither_freeze_nor_drift_nor_diverge(trained):
    net, _, embeddings = trained
    kinds = np.random.default_rng(1).integers(0, 3, 360)
    dance = generate_motion(net, motif_sequence(kinds, embeddings), synthetic_motion(kinds[:2]), fps=30)
    body = body_pos_m(dance)
    speed = np.linalg.norm(np.diff(body, axis=0), axis=-1).mean(axis=1) * 30  # (T - 1,)
    thirds = [part.mean() for part in np.array_split(speed, 3)]
    assert min(thirds) > 0.7 * max(thirds) > 0
    assert np.abs(dance.root_pos_m[:, [0, 2]]).max() < 3.0
    assert np.abs(dance.root_pos_m[:, 1] - 0.93).max() < 0.15
    assert foot_slide_cm_s(body, 30) < 15


def test_generation_is_deterministic_and_depends_on_the_motifs(untrained):
    net, _, embeddings = untrained
    seed = synthetic_motion(np.array([0, 1]))
    first, again, other = (
        generate_poses(net, motif_sequence(np.array(kinds), embeddings), seed)[0]
        for kinds in ([0, 1], [0, 1], [2, 2])
    )
    assert np.array_equal(first, again) and not np.allclose(first, other)


def test_rotations_are_unit_and_contacts_are_probabilities(untrained):
    net, _, embeddings = untrained
    rows, contacts = generate_poses(
        net, motif_sequence(np.array([0, 1, 2]), embeddings), synthetic_motion(np.array([0, 1]))
    )
    quat = rows[:, ROOT_DIM:-2].reshape(len(rows), -1, 4)
    assert np.allclose(np.linalg.norm(quat, axis=-1), 1.0, atol=1e-5)
    assert contacts.shape == (len(rows), 2) and contacts.min() >= 0 and contacts.max() <= 1


@pytest.mark.parametrize("to_front", [True, False])
def test_a_dance_that_walks_away_is_steered_back(to_front):
    poses = to_poses(synthetic_motion(np.zeros(120, int)))  # a minute
    poses[:, 1] = 0.6 / ROLLOUT_FPS  # straight ahead
    bounds = np.arange(0.0, 60.1, 0.5)
    walk = MotifSequence(bounds[:-1], bounds[1:], np.zeros((120, 184)), *np.zeros((2, 1800, 4)), None)
    skeleton = synthetic_motion(np.zeros(2, int)).skeleton
    away = np.linalg.norm(to_motion(poses, skeleton).root_pos_m[:, [0, 2]], axis=1).max()
    steered = generation._on_stage(poses, walk, skeleton, to_front=to_front, stage="near")
    home = np.linalg.norm(steered.root_pos_m[:, [0, 2]], axis=1).max()
    assert away > 30 and home < (8 if to_front else 4)


def test_a_dance_that_is_turned_is_steered_to_the_front():
    poses = to_poses(synthetic_motion(np.zeros(12, int)))
    poses[:, 1] = 0.0
    poses[:60, 3] = np.pi / 2 / 60  # a quarter turn in two seconds
    bounds = np.arange(0.0, 6.1, 0.5)
    given = MotifSequence(bounds[:-1], bounds[1:], np.zeros((12, 184)), *np.zeros((2, 180, 4)), None)
    skeleton = synthetic_motion(np.zeros(2, int)).skeleton
    for to_front, least, most in ((True, 0.0, 0.1), (False, 1.4, 2.0)):
        turned = generation._on_stage(poses, given, skeleton, to_front=to_front, stage="near")
        assert least <= abs(rot.yaw(turned.local_quat[-1, 0])) < most


def test_impossible_requests_are_refused_in_one_line(untrained):
    net, _, embeddings = untrained
    seed = synthetic_motion(np.array([0, 1]))
    with pytest.raises(ParameterError, match="sequence of one motion word"):
        generate_motion(net, motif_sequence(np.zeros(0, int), embeddings), seed, fps=60)
    arm = Skeleton(("a", "b"), np.array([-1, 0]), np.zeros((2, 3)))
    two = type(seed)(arm, seed.root_pos_m, seed.local_quat[:, :2], seed.fps)
    with pytest.raises(ParameterError, match="24 joints"):
        generate_motion(net, motif_sequence(np.array([0]), embeddings), two, fps=60)
