"""The rollout network: auto-conditioning, style, ablations, training and storage."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from synthetic_rollouts import random_motion, synthetic_takes, synthetic_words

from choreograph.core.errors import ParameterError
from choreograph.nets.configs import rollout_config
from choreograph.nets.rollout import RolloutNet
from choreograph.nets.rollout_poses import N_FEET, ROOT_DIM, PosePredictor, to_poses, word_conditions
from choreograph.nets.rollout_training import RolloutData, train_rollout, train_rollouts, unroll
from choreograph.nets.training import TrainingContext
from choreograph.pipeline.published import ROLLOUT

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def synthetic():
    takes = synthetic_takes()
    return takes, synthetic_words(takes)


def predictor(**changes) -> PosePredictor:
    """An untrained network without torch, which `test_inference.py` compares with the one in torch."""
    return PosePredictor.from_arrays(*RolloutNet(rollout_config("tiny", **changes)).to_arrays())


def test_inputs_are_true_poses_and_then_the_networks_own(synthetic):
    takes, _ = synthetic
    config = rollout_config("tiny", frames=20, teacher_frames=3)
    net = RolloutNet(config)
    batch = RolloutData(takes, 20).batch(
        2, np.random.default_rng(0), own_embedding_share=0.0, with_style=False
    )
    inputs, step = [], net.step
    net.step = lambda pose, *rest: (inputs.append(pose), step(pose, *rest))[1]
    predicted = unroll(net, batch, self_fed_frames=4)
    assert predicted.shape == (2, 19, batch.pose.shape[2])
    for frame, pose in enumerate(inputs):
        if frame % 7 < 3:
            assert torch.equal(pose, batch.pose[:, frame])
        else:
            assert torch.equal(pose[..., :-N_FEET], predicted[:, frame - 1, :-N_FEET])


def test_the_papers_style_does_not_change_the_bounds_of_words_and_the_root():
    net = predictor(style_fade_s=0.0)
    poses = to_poses(random_motion(1, 45))
    conditions = word_conditions(
        np.array([0.0, 0.5, 1.0]), np.array([0.5, 1.0, 1.5]), 45, *np.zeros((2, 45, 4)), np.zeros((3, 184)),
        np.random.default_rng(0).normal(size=(3, 87)),
    )  # fmt: skip
    change = np.abs(net.apply_style(poses, conditions) - poses)
    assert change[[0, 15, 30]].max() < 1e-5
    assert change[7, ROOT_DIM:-N_FEET].max() > 1e-3
    assert change[:, :ROOT_DIM].max() == 0 and change[:, -N_FEET:].max() == 0


def test_style_as_published_is_of_length_one_in_a_word_and_grows_with_its_strength():
    net = predictor()
    poses = to_poses(random_motion(1, 30))
    conditions = word_conditions(
        np.array([0.0]), np.array([1.0]), 30, *np.zeros((2, 30, 4)), np.zeros((1, 184)),
        np.random.default_rng(0).normal(size=(1, 87)),
    )  # fmt: skip
    assert net.with_style(None, None) is net and net.with_style(1.5, "smooth") is net

    def change(strength, window):
        styled = net.with_style(strength, window).apply_style(poses, conditions)
        return np.linalg.norm((styled - poses)[:, ROOT_DIM:-N_FEET], axis=1)  # (T,)

    assert change(0.0, "hamming").max() < 1e-6
    small, twice = change(0.1, "hamming"), change(0.2, "hamming")
    assert np.allclose(twice[10:20], 2 * small[10:20], rtol=0.05)
    assert change(0.1, "smooth")[15] > 3 * small[15]  # of length one in every pose, not in the word
    assert change(40.0, "hamming")[15] > change(1.5, "smooth")[15]


def test_style_changes_smoothly_from_word_to_word():
    net = predictor(style_fade_s=0.5)
    poses = to_poses(random_motion(1, 1)).repeat(60, axis=0)  # one pose throughout
    spectra = np.random.default_rng(0).normal(size=(2, 87))
    conditions = word_conditions(
        np.array([0.0, 1.0]), np.array([1.0, 2.0]), 60, *np.zeros((2, 60, 4)), np.zeros((2, 184)), spectra
    )
    quat = net.apply_style(poses, conditions)[:, ROOT_DIM:-N_FEET]
    steps = np.linalg.norm(np.diff(quat, axis=0), axis=1)
    assert steps[:12].max() < 1e-5 and steps[-12:].max() < 1e-5  # style moves nothing within a word
    assert 0 < steps.max() < 0.15 * np.linalg.norm(quat[0] - quat[-1])  # and does not jump between words


@pytest.mark.parametrize("off", ["use_audio", "motifs", "count_phase"])
def test_conditions_that_are_switched_off_have_no_effect(off):
    net = predictor(**{off: False})
    starts, ends = np.array([0.0, 0.5]), np.array([0.5, 1.0])
    rng = np.random.default_rng(0)

    def gate_inputs(motif, rhythm, phase):
        conditions = word_conditions(starts, ends, 30, rhythm, phase, motif, None)
        return net.embed_conditions(conditions)[0]

    motif, rhythm, phase = rng.normal(size=(2, 184)), rng.normal(size=(30, 4)), rng.normal(size=(30, 4))
    other = {
        "use_audio": (motif, *rng.normal(size=(2, 30, 4))),
        "motifs": (rng.normal(size=(2, 184)), rhythm, phase),
        "count_phase": (motif, rhythm, rng.normal(size=(30, 4))),
    }[off]
    assert np.array_equal(gate_inputs(motif, rhythm, phase), gate_inputs(*other))


def test_training_lowers_the_loss_and_is_deterministic(synthetic, tmp_path):
    takes, words = synthetic
    config = rollout_config("tiny", steps=12)
    seen = []
    context = TrainingContext(tmp_path, report=seen.append)
    net = train_rollout(takes, words, config, seed=1, context=context)
    assert seen[-1].loss < seen[0].loss
    again = train_rollout(takes, words, config, seed=1)
    for name, value in net.state_dict().items():
        assert torch.equal(value, again.state_dict()[name]), name
    arrays, stored = net.to_arrays()
    assert RolloutNet.from_arrays(arrays, stored).config == net.config


def test_training_in_bfloat16_follows_training_in_float32(synthetic):
    takes, words = synthetic
    losses = {}
    for precision in ("float32", "bfloat16"):
        seen = []
        context = TrainingContext(precision=precision, report=seen.append)
        net = train_rollout(takes, words, rollout_config("tiny", steps=12), seed=1, context=context)
        assert all(value.dtype == torch.float32 for value in net.state_dict().values())
        losses[precision] = np.array([progress.loss for progress in seen])
    assert 0 < np.abs(losses["bfloat16"] / losses["float32"] - 1).max() < 0.05


def test_takes_too_short_are_refused_in_one_line(synthetic):
    takes, words = synthetic
    with pytest.raises(ParameterError, match=r"motion words for over 333\.3 s"):
        train_rollout(takes, words, rollout_config("tiny", frames=10_000), seed=0)


def test_conditions_of_the_paper_enter_the_lstm_as_they_are(synthetic):
    takes, words = synthetic
    changes = {**ROLLOUT, "by_genre": False, "steps": 2, "frames": 40, "batch_size": 2}
    net = train_rollout(takes, words, rollout_config("tiny", **changes), seed=0)
    assert net.into.in_features == 184 + 4 + 3  # of which the three phases are 0
    assert net.out.in_features == net.config.width
    assert torch.equal(net.rhythm_mean, torch.zeros(4)) and torch.equal(net.motif_std, torch.ones(1))
    arrays, stored = net.to_arrays()
    assert RolloutNet.from_arrays(arrays, stored).config == net.config


def test_a_genre_of_short_takes_is_named_before_any_training(synthetic):
    takes, words = synthetic
    short = replace(takes[1], start_s=takes[1].start_s[:1], end_s=takes[1].end_s[:1], genre="a")
    config = rollout_config("tiny", by_genre=True, steps=2)
    with pytest.raises(ParameterError, match="the genre 'a': expected a take of motion words"):
        next(train_rollouts([takes[0], short], words, config, seed=0))


def test_each_genre_has_its_own_network(synthetic):
    takes, words = synthetic
    of_genres = [replace(take, genre=genre) for take, genre in zip(takes, ("b", "a", "b"), strict=True)]
    config = rollout_config("tiny", by_genre=True, steps=2)
    nets = list(train_rollouts(of_genres, words, config, seed=0))
    assert [net.config.genre for net in nets] == ["a", "b"]
    alone = train_rollout([of_genres[1]], words, replace(config, genre="a"), seed=0)
    for name, value in nets[0].state_dict().items():
        assert torch.equal(value, alone.state_dict()[name]), name
