"""Bridged frames follow the smooth path; all others keep their bits."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from choreograph.motion import rotations as rot
from choreograph.motion.cleaning import bridged, bridged_rotations


@given(start=st.integers(2, 15), length=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
def test_lines_are_found_again(start, length, seed):
    rng = np.random.default_rng(seed)
    line = rng.normal(size=(1, 4, 3)) + np.arange(30)[:, None, None] * rng.normal(size=(1, 4, 3))
    broken = line.copy()
    broken[start : start + length] = rng.normal(size=(length, 4, 3))
    fixed = bridged(broken, [(start, start + length)])
    assert np.allclose(fixed, line)
    outside = np.delete(np.arange(30), np.s_[start : start + length])
    assert np.array_equal(fixed[outside], line[outside])


def test_a_corner_becomes_round():
    corner = np.abs(np.arange(-10.0, 11.0))[:, None]
    fixed = bridged(corner, [(8, 13)])
    assert np.abs(np.diff(fixed, n=2, axis=0)).max() < 0.8
    assert np.abs(np.diff(corner, n=2, axis=0)).max() == 2.0


@given(seed=st.integers(0, 2**32 - 1), sign=st.sampled_from((-1.0, 1.0)))
def test_rotations_are_bridged_by_the_shorter_arc_whatever_their_signs(seed, sign):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    turn = np.arange(20)[:, None] * 0.05 * axis / np.linalg.norm(axis)
    quat = rot.from_rotvec(turn)
    broken = quat.copy()
    broken[8:11] = rot.normalize(rng.normal(size=(3, 4)))
    broken[11:] *= sign
    fixed = bridged_rotations(broken, [(8, 11)])
    assert np.allclose(np.abs(np.sum(fixed * quat, axis=-1)), 1.0, atol=1e-6)
    assert (np.sum(fixed[1:] * fixed[:-1], axis=-1) > 0).all()


def test_spans_at_an_end_stay():
    values = np.random.default_rng(1).normal(size=(9, 3))
    assert np.array_equal(bridged(values, [(0, 2), (7, 9), (1, 3)]), values)
    quat = rot.normalize(np.random.default_rng(1).normal(size=(9, 4)))
    assert np.array_equal(np.abs(bridged_rotations(quat, [(1, 3)])), np.abs(quat))
