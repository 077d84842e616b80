"""Arrays that follow from others: velocities end with their take."""

from __future__ import annotations

import numpy as np

from choreograph.library.derived import root_frame_rows
from choreograph.motion.body import BODY_JOINTS, to_root_frame


def test_velocities_end_with_their_take():
    """Two takes that move at 1 and at 2 m/s. No difference is taken across their border."""
    times_s = np.arange(8) / 20
    body = np.random.default_rng(0).normal(size=(len(BODY_JOINTS), 3))
    pos = np.concatenate([body + v * times_s[:, None, None] * np.array([0.0, 1.0, 0.0]) for v in (1.0, 2.0)])
    made = root_frame_rows(lambda rows: pos[rows], np.arange(16), np.array([[0, 8], [8, 16]]))
    np.testing.assert_allclose(made[:, 0], to_root_frame(pos), atol=1e-6)
    np.testing.assert_allclose(made[:8, 1, :, 1], 1.0, atol=1e-5)
    np.testing.assert_allclose(made[8:, 1, :, 1], 2.0, atol=1e-5)
