"""Contacts of synthetic steps are found at any rate; lifted and fast feet are not contacts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.motion.body import BODY_JOINTS
from choreograph.motion.contacts import CONTACT_JOINTS, foot_contacts

FEET = [BODY_JOINTS.index(name) for name in CONTACT_JOINTS]


def _walking(fps: float, *, step_s: float = 0.6, seconds: float = 6.0) -> tuple[np.ndarray, np.ndarray]:
    """Body positions that step left and right in turn, and which foot (T, 2) stands."""
    times = np.arange(round(seconds * fps)) / fps
    pos = np.zeros((len(times), len(BODY_JOINTS), 3))
    standing = np.stack([np.floor(times / step_s) % 2 == 0, np.floor(times / step_s) % 2 == 1], axis=1)
    phase = (times % step_s) / step_s
    for column, joint in enumerate(FEET):
        swings = ~standing[:, column // 2]
        pos[swings, joint, 1] = 0.2 * np.sin(np.pi * phase[swings]) ** 2
        pos[:, joint, 2] = np.cumsum(swings * np.sin(np.pi * phase) ** 2) * 2.0 / fps
    return pos, standing


@pytest.mark.parametrize("fps", [20.0, 25.0, 60.0, 120.0])
def test_synthetic_steps_are_found(fps):
    pos, standing = _walking(fps)
    contacts = foot_contacts(pos, fps)
    for column in range(4):
        stands = standing[:, column // 2]
        assert np.mean((contacts[:, column] > 0.5) == stands) > 0.75
        assert contacts[stands, column].mean() > 0.7
        assert contacts[~stands, column].mean() < 0.35


@given(st.floats(10, 240), st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_contacts_are_between_0_and_1(fps, n_frames, seed):
    pos = np.random.default_rng(seed).normal(0, 0.1, (n_frames, len(BODY_JOINTS), 3))
    contacts = foot_contacts(pos, fps)
    assert contacts.shape == (n_frames, 4)
    assert ((contacts >= 0) & (contacts <= 1)).all()


def test_faster_feet_have_lower_confidence():
    means = []
    for speed_m_s in (0.0, 0.1, 0.5, 2.0):
        pos = np.zeros((60, len(BODY_JOINTS), 3))
        pos[..., 0] = (np.arange(60) / 60 * speed_m_s)[:, None]
        means.append(foot_contacts(pos, 60).mean())
    assert means == sorted(means, reverse=True)
    assert means[0] > 0.95
    assert means[-1] < 0.15


def test_rotating_and_moving_the_scene_changes_nothing():
    pos, _ = _walking(60.0)
    turned = pos[..., [2, 1, 0]] * [1.0, 1.0, -1.0] + [3.0, 0.4, -2.0]
    assert np.allclose(foot_contacts(pos, 60), foot_contacts(turned, 60))


@pytest.mark.parametrize("pos", [np.zeros((0, 21, 3)), np.zeros((5, 21)), np.full((5, 21, 3), np.nan)])
def test_invalid_positions_are_refused(pos):
    with pytest.raises(ParameterError, match="body positions"):
        foot_contacts(pos, 60)


@pytest.mark.parametrize("fps", [0.0, -5.0, np.nan])
def test_invalid_rates_are_refused(fps):
    with pytest.raises(ParameterError, match="rate"):
        foot_contacts(np.zeros((5, 21, 3)), fps)
