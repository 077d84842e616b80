"""Stillness: planted poses and speeds where the first and the last pose are held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_layers import random_source

from choreograph.choreography.graph.costs import Stillness
from choreograph.motion.body import BODY_JOINTS

LEFT_ANKLE = BODY_JOINTS.index("left_ankle")


class PlantedPoses:
    """Clip c moves at c m/s as recorded, with its left foot lifted by a centimetre a frame."""

    def poses_m(self, clip, frames):
        pose = np.zeros((len(clip), 21, 3))
        pose[:, LEFT_ANKLE, 1] = 0.01 * frames
        velocity = np.zeros((len(clip), 21, 3))
        velocity[..., 2] = np.asarray(clip, float)[:, None]
        return pose, velocity


@pytest.fixture
def source_and_song():
    source, song_features = random_source(0, n_seconds=8)
    return source, replace(song_features, opening_s=2.95, closing_s=6.5)


def test_only_the_seconds_of_the_held_poses_cost(source_and_song):
    source, song_features = source_and_song
    cost = Stillness(PlantedPoses())
    at = [cost.node(source.layer(second), song_features) is not None for second in range(8)]
    assert at == [second in (2, 6) for second in range(8)]


def test_it_is_the_speed_of_the_pose_as_played_and_ten_times_the_height_of_a_lifted_foot(source_and_song):
    source, song_features = source_and_song
    layer = source.layer(2)
    # Played at 1.5 times the speed: 2.25 s is 5 frames into the second, 7.5 frames into its part of the clip.
    layer = replace(layer, source_frames=3.0 + 1.5 * np.tile(np.arange(21.0), (layer.n_nodes, 1)))
    expected = 1.5 * layer.warp.clip + 10 * 0.01 * (3.0 + 7.5)
    assert Stillness(PlantedPoses()).node(layer, song_features) == pytest.approx(expected)


def test_a_count_between_frames_is_where_the_map_says(source_and_song):
    source, song_features = source_and_song
    layer = source.layer(2)
    doubled = np.where(np.arange(21) < 5, np.arange(21), 5 + 2 * (np.arange(21) - 5.0))
    layer = replace(layer, source_frames=np.tile(doubled, (layer.n_nodes, 1)))
    cost = Stillness(PlantedPoses()).node(layer, replace(song_features, opening_s=2.975))  # frame 5.5
    assert cost == pytest.approx(2.0 * layer.warp.clip + 0.1 * 6.0)


def test_both_ends_in_one_second_are_added(source_and_song):
    source, song_features = source_and_song
    cost, layer = Stillness(PlantedPoses()), source.layer(4)
    alone = [
        replace(song_features, opening_s=o, closing_s=c) for o, c in ((4.8, 7.9), (0.0, 5.1), (4.8, 5.1))
    ]
    first, last, both = (cost.node(layer, features) for features in alone)
    assert both == pytest.approx(first + last)


def test_a_song_danced_to_its_very_end_holds_no_last_pose():
    source, song_features = random_source(0, n_seconds=8)
    assert song_features.closing_s == 8.0
    assert Stillness(PlantedPoses()).node(source.layer(7), song_features) is None
