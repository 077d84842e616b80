"""Smooth sampling: through the frames, without corners between them, still outside."""

import numpy as np
import pytest
from synthetic_motions import stepping, swaying


def test_at_whole_frames_it_is_the_motion():
    motion = swaying(20)
    same = motion.sampled_smooth(np.arange(20.0))
    np.testing.assert_allclose(same.root_pos_m, motion.root_pos_m, atol=1e-12)
    np.testing.assert_allclose(same.local_quat, motion.local_quat, atol=1e-9)


def test_it_knows_what_was_between_better_than_slerp():
    fine, coarse = stepping(120, fps=60.0), stepping(60, fps=30.0)
    frames = np.arange(8, 100) / 2
    truth = fine.local_quat[8:100]
    smooth = np.abs(coarse.sampled_smooth(frames, fps=60.0).local_quat - truth).max()
    corners = np.abs(coarse.sampled(frames, fps=60.0).local_quat - truth).max()
    assert smooth < 0.1 * corners


@pytest.mark.parametrize("n_frames", [1, 2, 3, 10])
def test_outside_the_end_poses_hold(n_frames):
    motion = swaying(n_frames)
    held = motion.sampled_smooth(np.array([-3.0, n_frames + 5.0]), fps=12.0)
    assert held.fps == 12.0
    np.testing.assert_allclose(held.root_pos_m, motion.root_pos_m[[0, -1]])
    np.testing.assert_allclose(np.linalg.norm(held.local_quat, axis=-1), 1.0)
