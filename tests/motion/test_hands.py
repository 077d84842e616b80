"""Shapes of hands by figures, and fingers of a T pose that bend in them."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.counts import Figure
from choreograph.motion import rotations as rot
from choreograph.motion.hands import (
    FINGERS,
    SHAPES,
    HandSpan,
    finger_quats,
    hand_spans,
    shape_of,
    shape_shares,
)

ALONG = {"left": np.array([1.0, 0.0, 0.0]), "right": np.array([-1.0, 0.0, 0.0])}


def test_figures_say_what_hands_do():
    for name, shape in (
        ("New Yorker", "open"), ("point to the sky", "open"), ("hand to hand", "open"),
        ("stomp and turn", "fist"), ("running man", "fist"), ("natural turn", "relaxed"), ("", "relaxed"),
    ):  # fmt: skip
        assert shape_of(name) == shape
    figures = [Figure("jack", 1.0, 2.0, 4), Figure("basic", 2.0, 3.0, 4), Figure("fan", 3.0, 4.0, 4)]
    assert hand_spans(figures) == (HandSpan(1.0, 2.0, "fist"), HandSpan(3.0, 4.0, "open"))


def test_shares_of_shapes_change_smoothly_in_half_a_second_and_add_up_to_one():
    shares = shape_shares(120, 60.0, [HandSpan(0.5, 1.5, "fist")])
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert shares[0].tolist() == [1.0, 0.0, 0.0] and shares[60, SHAPES.index("fist")] == pytest.approx(1.0)
    assert 0.3 < shares[30, SHAPES.index("fist")] < 0.7
    assert np.abs(np.diff(shares, axis=0)).max() < 0.08


@pytest.mark.parametrize("side", ["left", "right"])
def test_fingers_of_a_t_pose_are_straight_when_open_and_bend_down_to_a_fist(side):
    """The tip of a finger of three segments of 3 cm, from its first joint."""
    for shape in SHAPES:
        quats = finger_quats(side, np.eye(len(SHAPES))[[SHAPES.index(shape)]])
        assert tuple(quats) == FINGERS
        for finger in FINGERS[1:]:
            turned, tip = rot.IDENTITY, np.zeros(3)
            for quat in quats[finger][0]:
                turned = rot.multiply(turned, quat)
                tip = tip + 0.03 * rot.rotate(turned, ALONG[side])
            reach = {"open": (0.0899, 0.0901), "relaxed": (0.07, 0.0899), "fist": (0.0, 0.05)}[shape]
            assert reach[0] <= np.linalg.norm(tip) <= reach[1]
            assert abs(tip[2]) < 1e-9
            knuckle = 0.03 * rot.rotate(quats[finger][0, 0], ALONG[side])
            assert (knuckle[1] < -0.005) == (shape != "open")


def test_thumbs_bend_down_and_to_the_fingers_and_both_hands_are_mirrored():
    fist = np.eye(len(SHAPES))[[SHAPES.index("fist")]]
    left, right = finger_quats("left", fist), finger_quats("right", fist)
    before = np.array([1.0, 0.0, 1.0])
    after = rot.rotate(left["thumb"][0, 0], before)
    assert after[1] < -0.1 and after[2] < 0.9
    for finger in FINGERS:
        np.testing.assert_allclose(right[finger], left[finger] * [1.0, 1.0, -1.0, -1.0], atol=1e-12)
