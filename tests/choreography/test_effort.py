"""Energy and density of steps of motion against those of a song."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from choreograph.choreography.selection import energy_mismatch, steps_mismatch

RANKS = np.linspace(0.0, 1.0, 11)


@given(st.floats(0.01, 1.0))
def test_loud_parts_ask_for_large_motion_and_soft_parts_for_small_motion(louder):
    loud, soft = energy_mismatch(louder, RANKS), energy_mismatch(-louder, RANKS)
    assert (np.diff(loud) < 0).all() and loud[-1] == 0.0
    assert (np.diff(soft) > 0).all() and soft[0] == 0.0
    np.testing.assert_allclose(loud, soft[::-1])


def test_a_part_as_loud_as_its_song_asks_for_nothing():
    assert not energy_mismatch(0.0, RANKS).any()


@given(st.floats(0, 1))
def test_the_motion_of_the_same_rank_is_nearest_in_steps(density):
    away = steps_mismatch(density, RANKS)
    assert abs(RANKS[np.argmin(away)] - density) <= 0.05 + 1e-9
