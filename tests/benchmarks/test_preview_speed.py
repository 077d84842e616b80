"""How fast the dancer is drawn: pytest tests/benchmarks --benchmark-only"""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import swaying

from choreograph.view.renderer import follow_camera

pytestmark = pytest.mark.slow


def test_a_picture_of_720_lines(benchmark):
    shots = follow_camera(swaying(60), np.array([0.5]), aspect=16 / 9)
    shots.render(0, (1280, 720))  # compiled before it is timed
    benchmark(shots.render, 0, (1280, 720))
