"""What pages show: planted changes are found, and the waveform has the peaks of the song."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from choreograph.music.song import Song
from choreograph.studio.facts import changed_spans, motion_data, waveform


def test_planted_changes_are_found_and_near_ones_joined(made):
    motion = made.motion.sliced(0, 600)
    quat = motion.local_quat.copy()
    for first, stop in ((100, 130), (136, 150), (400, 401)):
        quat[first:stop, 5] = [0.0, 1.0, 0.0, 0.0]
    root = motion.root_pos_m + np.array([0.1, 0.0, 0.0])  # the place on the floor is no other pose
    spans = changed_spans(motion, replace(motion, local_quat=quat, root_pos_m=root))
    assert spans == [pytest.approx((100 / 60, 150 / 60)), pytest.approx((400 / 60, 401 / 60))]
    assert changed_spans(motion, motion) == []


def test_dances_of_other_lengths_are_compared_as_far_as_both_go(made):
    assert changed_spans(made.motion, made.motion.sliced(0, 300)) == []


@pytest.mark.parametrize("points", [1, 7, 100, 5000])
def test_the_waveform_has_the_peak_of_each_part(points):
    samples = np.zeros(1000, np.float32)
    samples[[100, 900]] = [0.5, -0.25]
    shown = waveform(Song(samples, "a"), points)
    assert len(shown) == points and max(shown) == 1.0
    assert points == 1 or 0.5 in shown


def test_small_figures_have_few_frames(made):
    part = made.motion.sliced(0, 120)
    assert motion_data(part)["facts"]["frames"] == 120
    assert motion_data(part, small=True)["facts"] | {"fps": 20.0} == motion_data(part, small=True)["facts"]
