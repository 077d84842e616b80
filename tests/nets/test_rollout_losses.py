"""Losses of the rollout network for right and wrong poses."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from synthetic_rollouts import synthetic_takes, synthetic_words

from choreograph.nets.configs import rollout_config
from choreograph.nets.rollout import RolloutLosses, RolloutNet, _border_speed_m_s
from choreograph.nets.rollout_poses import N_FEET, ROLLOUT_FPS, ROOT_DIM
from choreograph.nets.rollout_training import RolloutData, unroll

pytestmark = pytest.mark.slow


def test_the_loss_is_near_zero_only_for_the_right_poses():
    takes = synthetic_takes()
    config = rollout_config("tiny", perceptual_weight=0.0)
    net = RolloutNet(config)
    batch = RolloutData(takes, config.frames).batch(
        4, np.random.default_rng(0), own_embedding_share=1.0, with_style=False
    )
    losses = RolloutLosses(takes[0].motion.skeleton, synthetic_words(takes), config)
    poses = batch.pose[:, 1:].clone()
    poses[..., -N_FEET:] = torch.logit(poses[..., -N_FEET:].clamp(0.01, 0.99))
    right = float(losses.total(net, poses, batch, self_fed_frames=5))
    wrong = float(losses.total(net, poses.flip(1), batch, self_fed_frames=5))
    assert right < 0.15 and wrong > 3 * right


def test_the_perceptual_loss_is_lower_where_words_match_their_motifs():
    takes = synthetic_takes()
    words = synthetic_words(takes)
    data = RolloutData(takes, 60)
    config = rollout_config("tiny")
    losses = RolloutLosses(takes[0].motion.skeleton, words, config)
    batch = data.batch(8, np.random.default_rng(0), own_embedding_share=1.0, with_style=False)
    world_m = losses._world_pos_m(RolloutNet(config), batch.pose[:, 1:])
    right = float(losses._perceptual_m(world_m, batch))
    shuffled = torch.roll(batch.word_motif, 1, dims=0)
    wrong = float((batch.word_motif - shuffled).norm(dim=-1).mean())
    assert right < 0.3 * wrong


def test_the_speed_at_borders_is_the_dancers_own():
    takes = synthetic_takes()
    data = RolloutData(takes, 60)
    batch = data.batch(4, np.random.default_rng(0), own_embedding_share=1.0, with_style=False)
    config = rollout_config("tiny")
    losses = RolloutLosses(takes[0].motion.skeleton, synthetic_words(takes), config)
    target_m = losses._world_pos_m(RolloutNet(config), batch.pose[:, 1:])
    assert float(_border_speed_m_s(target_m, target_m, batch)) == 0
    # Arms are at rest where words meet: half a word later they are not.
    late_m = torch.roll(target_m, round(0.25 * ROLLOUT_FPS), dims=1)
    assert float(_border_speed_m_s(late_m, target_m, batch)) > 0.02


def test_the_coherence_of_the_paper_is_that_of_equations_7_and_8():
    takes = synthetic_takes()
    config = rollout_config(
        "tiny", loss="paper", teacher_frames=3, perceptual_weight=0.0, position_weight=0.0, contact_weight=0.0
    )
    net = RolloutNet(config)
    batch = RolloutData(takes, config.frames).batch(
        2, np.random.default_rng(0), own_embedding_share=0.0, with_style=True
    )
    predicted = torch.roll(batch.pose[:, 1:], 4, dims=1)
    losses = RolloutLosses(takes[0].motion.skeleton, synthetic_words(takes), config)
    found = float(losses.total(net, predicted, batch, self_fed_frames=2))
    rotations = [
        Rotation.from_quat(pose[..., ROOT_DIM:-N_FEET].reshape(-1, 4).numpy(), scalar_first=True)
        for pose in (predicted, batch.pose[:, 1:])
    ]
    angles = (rotations[0].inv() * rotations[1]).magnitude().reshape(2, config.frames - 1, -1).sum(axis=2)
    given_truth = np.arange(config.frames - 1) % 5 < 3  # three teacher-forced frames, then two self-fed ones
    expected = angles[:, given_truth].mean() + angles[:, ~given_truth].mean()
    assert found == pytest.approx(expected, abs=0.05 + 1e-3 * expected)  # smooth where rotations agree
    assert expected > 0.5


@pytest.mark.parametrize("loss", ["weighted", "paper"])
def test_the_mean_loss_of_equal_parts_of_a_batch_is_that_of_the_batch(loss):
    """Also where the parts have different numbers of words."""
    takes = synthetic_takes()
    config = rollout_config("tiny", loss=loss)
    losses = RolloutLosses(takes[0].motion.skeleton, synthetic_words(takes), config)
    torch.manual_seed(0)
    net = RolloutNet(config)
    batch = RolloutData(takes, config.frames).batch(
        6, np.random.default_rng(0), own_embedding_share=0.5, with_style=True
    )
    kept = batch.word_sequence > 1
    batch = replace(
        batch, word_frames=batch.word_frames[kept], word_sequence=batch.word_sequence[kept],
        word_motif=batch.word_motif[kept],
    )  # fmt: skip
    parts = [batch.part(slice(0, 3)), batch.part(slice(3, 6))]
    assert 0 < len(parts[0].word_motif) < len(parts[1].word_motif)
    whole, first, second = (
        float(losses.total(net, unroll(net, each, self_fed_frames=5), each, self_fed_frames=5).detach())
        for each in (batch, *parts)
    )
    assert (first + second) / 2 == pytest.approx(whole, rel=1e-5)
    assert first != pytest.approx(whole, rel=1e-3)
