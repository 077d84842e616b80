"""The network that counts motion: its features, its data, a short training, storage."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from synthetic_counts import counted
from synthetic_motions import stepping

from choreograph.core.counts import FROM_MOTION, NO_COUNTS
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.counts import counts_within
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, mirrored
from choreograph.nets.motion_counts import N_FEATURES, MotionCounts, MotionCountsConfig, motion_features
from content.count_networks import MotionCountsNet, motion_counts_config
from content.motion_counting import CountedMotion, MotionData, train_motion_counts

TINY = motion_counts_config("tiny")


def take(period_s: float, name: str = "take", *, genre: str = "walk", metre: int = 4) -> CountedMotion:
    """Half a minute of steps, at rest on every count."""
    motion = stepping(600, fps=20.0, period_s=period_s)
    return CountedMotion(name, genre, body_pos_m(motion).astype(np.float32), counted(period_s, metre=metre))


@pytest.fixture(scope="module")
def trained():
    takes = [take(period_s, f"{period_s}") for period_s in (0.4, 0.5, 0.6, 0.7)]
    return train_motion_counts(takes, motion_counts_config("tiny", steps=120), seed=0).for_inference()


def test_features_do_not_depend_on_place_or_heading():
    body = take(0.5).body_pos_m
    moved = rot.rotate(rot.about_y(2.1), body.astype(np.float64)) + np.array([3.0, 0.0, -1.0])
    here, there = (motion_features(np.float32(b)) for b in (body, moved))
    assert here.shape == (600, N_FEATURES)
    np.testing.assert_allclose(here, there, atol=2e-4)


def test_what_is_not_there_does_not_matter():
    net = MotionCountsNet(TINY)
    torch.nn.init.normal_(net.head.weight)
    net.eval()
    body = torch.from_numpy(take(0.5).body_pos_m[None, :100])
    present = torch.ones(1, 100)
    present[:, 60:] = 0.0
    other = body.clone()
    other[:, 62:] += 1.0  # beyond the velocity of the last frame there is
    with torch.no_grad():
        np.testing.assert_allclose(net(body, present).numpy(), net(other, present).numpy(), atol=1e-5)


def test_samples_carry_the_phases_of_what_they_show():
    """A sample at another tempo is at rest where its phase in the beat is 0."""
    data = MotionData([take(0.5)], motion_counts_config("tiny", tempo_range=(0.7, 1.4), mirrored_share=0.0))
    batch = data.batch(16, np.random.default_rng(0))
    speed = np.stack([motion_features(body)[:, -21:].mean(axis=1) for body in batch.body.numpy()])
    phase, known = batch.targets.beat.numpy(), batch.targets.known.numpy()
    on = speed[known & (np.abs((phase + 0.5) % 1 - 0.5) < 0.1)].mean()
    between = speed[known & (np.abs(phase - 0.5) < 0.1)].mean()
    assert on < 0.7 * between
    assert known.mean() > 0.9


def test_mirrored_as_often_as_configured():
    batches = [
        MotionData([take(0.5)], motion_counts_config("tiny", mirrored_share=share))
        .batch(4, np.random.default_rng(3))
        .body.numpy()
        for share in (0.0, 1.0)
    ]
    # Augmentation does not depend on the side, so only the swing of the body is mirrored.
    assert np.abs(batches[0] - batches[1]).max() > 0.05


def test_built_in_and_recorded_takes_and_their_genres_are_balanced():
    takes = [take(0.5, f"w{i}", genre="waltz") for i in range(6)] + [take(0.5, "r", genre="rumba")]
    built_in = CountedMotion("b", "disco", takes[0].body_pos_m, takes[0].counts, is_built_in=True)
    data = MotionData([*takes, built_in], motion_counts_config("tiny", recorded_share=0.6))
    np.testing.assert_allclose(data._probability, [0.05] * 6 + [0.3, 0.4])


def test_counts_of_another_tempo_are_read_from_the_motion(trained):
    unseen = take(0.55)
    counts = trained.counts(unseen.body_pos_m)
    assert counts.source == FROM_MOTION and counts.confidence == 0.5  # not fitted
    assert counts_within(counts.times_s, unseen.counts.times_s) > 0.9
    turned = trained.counts(mirrored(unseen.body_pos_m) @ np.diag([-1.0, 1.0, -1.0]))
    assert counts_within(turned.times_s, unseen.counts.times_s) > 0.9


def test_the_curves_of_a_take_are_the_mean_of_those_at_the_tempi(trained):
    body = take(0.55).body_pos_m
    slow, fast, both = (trained.curves(body, tempi) for tempi in ((0.9,), (1.1,), (0.9, 1.1)))
    np.testing.assert_allclose(both.beat, 0.5 * (slow.beat + fast.beat))
    np.testing.assert_allclose(both.bar, 0.5 * (slow.bar + fast.bar))
    assert np.abs(slow.beat - fast.beat).max() > 0.01


def test_storage(trained):
    again = MotionCounts.from_arrays(*trained.to_arrays())
    body = take(0.5).body_pos_m
    np.testing.assert_array_equal(again.curves(body).beat, trained.curves(body).beat)


def test_takes_without_counts_are_refused():
    without = CountedMotion("a", "walk", take(0.5).body_pos_m, NO_COUNTS)
    with pytest.raises(ParameterError, match="expected takes with counts"):
        train_motion_counts([without], TINY, seed=0)


def test_positions_must_be_a_body(trained):
    with pytest.raises(ParameterError, match="expected"):
        trained.counts(np.zeros((10, 3, 3)))


@pytest.mark.parametrize("changes", [{"width": 0}, {"window_s": 0.0}, {"tempo_range": (0.0, 1.0)}])
def test_malformed_configurations(changes):
    with pytest.raises(ParameterError, match="expected"):
        MotionCountsConfig(**changes)
