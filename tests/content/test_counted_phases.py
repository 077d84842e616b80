"""Phases of counts, their likelihood, and the trunk that reads them."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from synthetic_counts import counted

from choreograph.core.counts import Counts
from choreograph.music.bar_pointer import METRES
from choreograph.nets.music_counts import N_OUTPUTS, curves_from
from content.count_networks import Trunk
from content.counted_phases import PhaseTargets, phase_loss, phases_at


@given(st.floats(0.3, 1.0), st.sampled_from(METRES), st.floats(0, 29))
def test_phases_run_evenly_from_count_to_count(period_s, metre, time_s):
    counts = counted(period_s, metre=metre, first_s=0.2)
    found = phases_at(counts, np.array([time_s]))
    position = (time_s - 0.2) / period_s
    assert found.known[0] == (0 <= position < len(counts) - 1)
    if found.known[0]:
        for phase, turns in ((found.beat, position), (found.bar, position / metre)):
            assert np.abs((phase[0] - turns + 0.5) % 1 - 0.5) < 1e-4
        assert METRES[found.metre[0]] == metre


def test_nothing_is_known_in_gaps_or_where_numbers_do_not_follow():
    counts = Counts(np.array([0.0, 0.5, 1.0, 3.0, 3.5, 4.0]), np.array([1, 2, 3, 1, 2, 4]), 4)
    known = phases_at(counts, np.array([0.2, 0.7, 2.0, 3.2, 3.7, 4.2])).known
    assert known.tolist() == [True, True, False, True, False, False]


@pytest.mark.parametrize("counts", [Counts(np.array([1.0]), np.array([1]), 3), counted(0.5, metre=0)])
def test_counts_without_phase(counts):
    assert not phases_at(counts, np.arange(10.0)).known.any()


def outputs_for(turns: np.ndarray, metre: int, concentration: float) -> torch.Tensor:
    """Outputs (1, N_OUTPUTS, T) that say exactly a position in beats (T,)."""
    vectors = np.zeros((1 + len(METRES), 2, len(turns)))
    for row, phase in ((0, turns), (1 + METRES.index(metre), turns / metre)):
        vectors[row] = concentration * np.stack([np.cos(2 * np.pi * phase), np.sin(2 * np.pi * phase)])
    return torch.from_numpy(vectors.reshape(1, N_OUTPUTS, -1).astype(np.float32))


def test_the_likelihood_prefers_the_right_phase_metre_and_concentration():
    times_s = np.arange(200) / 20
    targets = PhaseTargets.of([phases_at(counted(0.5, metre=3), times_s)])
    position = times_s / 0.5

    def loss(position, metre=3, concentration=4.0):
        return float(phase_loss(outputs_for(position, metre, concentration), targets, bar_weight=1.0))

    nothing = loss(position, concentration=0.0)
    assert nothing == pytest.approx(0.0, abs=1e-3)  # nats above a uniform density
    assert loss(position, concentration=8.0) < loss(position) < nothing
    assert loss(position + 0.5) > nothing
    assert loss(position, metre=4) > loss(position)


def test_unknown_frames_do_not_count():
    known = phases_at(counted(0.5, length_s=5.0), np.arange(200) / 20)
    targets = PhaseTargets.of([known])
    outputs = torch.randn(1, N_OUTPUTS, 200)
    changed = torch.where(torch.from_numpy(known.known), outputs, outputs + 3.0)
    args = {"targets": targets, "bar_weight": 1.0}
    assert not known.known.all()
    assert float(phase_loss(outputs, **args)) == float(phase_loss(changed, **args))


def test_outputs_become_curves():
    position = np.arange(40) / 10
    curves = curves_from(outputs_for(position, 4, 2.0)[0].numpy(), 20.0)
    assert curves.beat.shape == (40, 2) and curves.bar.shape == (40, 2, 2) and curves.fps == 20.0
    np.testing.assert_allclose(
        np.arctan2(curves.beat[:, 1], curves.beat[:, 0])[1], 2 * np.pi * 0.1, atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.norm(curves.bar, axis=2)[0], [0.0, 2.0], atol=1e-6)


def test_the_trunk_sees_what_it_says():
    trunk = Trunk(3, 8, 3, dropout=0.0).eval()
    x = torch.randn(1, 3, 200, requires_grad=True)
    trunk(x)[0, 0, 100].backward()
    seen = x.grad.abs().sum(dim=(0, 1)).nonzero()[:, 0]
    assert int(seen.max() - seen.min()) + 1 == trunk.n_seen == 33
