"""Scenes: planted gaps and hidden dancers."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import swaying

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import scene
from choreograph.motion.body import BODY_JOINTS, body_pos_m

BODY = body_pos_m(swaying(30))


def at(*places: tuple[float, float]) -> np.ndarray:
    return np.stack([BODY + np.array([x, 0.0, z]) for x, z in places])


def test_gaps_grow_with_the_distance_of_equal_bodies():
    near, far = (scene.gaps_m(at((0.0, 0.0), (x, 0.0))) for x in (2.5, 3.0))
    assert (near > 0).all() and (far - near > 0.4).all() and (far - near < 0.5 + 1e-9).all()
    assert scene.gaps_m(at((0.0, 0.0), (0.1, 0.0))).max() == 0.0


def test_an_arm_over_another_dancer_leaves_no_gap():
    pos_m = at((0.0, 0.0), (1.6, 0.0))
    assert scene.gaps_m(pos_m).min() > 0.1
    pos_m[0, :, BODY_JOINTS.index("left_wrist")] = [1.6, 2.5, 0.0]
    assert scene.gaps_m(pos_m).max() == 0.0


def test_the_nearest_two_of_several_count():
    assert np.allclose(
        scene.gaps_m(at((0.0, 0.0), (3.0, 0.0), (9.0, 0.0))), scene.gaps_m(at((0.0, 0.0), (3.0, 0.0)))
    )


def test_the_one_behind_is_hidden():
    assert scene.hidden(at((0.0, 0.0), (0.0, -2.0))).mean(axis=1).tolist() == [0.0, 1.0]
    assert not scene.hidden(at((0.0, 0.0), (1.0, -2.0))).any()
    assert scene.longest_hidden_s(at((0.0, 0.0), (0.0, -2.0)), 30.0) == 1.0
    halves = at((0.0, 0.0), (0.0, -2.0))
    halves[1, 10:15] += [3.0, 0.0, 0.0]
    assert scene.longest_hidden_s(halves, 30.0) == 0.5


def test_others_are_refused():
    for pos_m in (BODY, BODY[None], np.full((2, 3, 21, 3), np.nan)):
        with pytest.raises(ParameterError):
            scene.evaluate(pos_m, 60.0)
