"""What layers and songs offer to costs of one's own: motion during the second, sections and phrases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_layers import random_source
from synthetic_repertoire import synthetic_repertoire, write_clicks

import choreograph as cg
from choreograph.core.timebase import NET_FPS
from choreograph.motion.body import body_pos_m, ground_pos_m, heading_rad
from choreograph.music.form import Form, Phrase, Sections


@pytest.fixture(scope="module")
def layer():
    source, _ = random_source(0)
    return source.layer(3)


def test_the_motion_at_both_ends_is_that_of_the_fields_of_the_layer(layer):
    poses_m = layer.poses_m([0.0, 1.0])
    assert poses_m.shape == (layer.n_nodes, 2, 21, 3)
    np.testing.assert_allclose(poses_m[:, 0], layer.first_pose_m, atol=1e-5)
    np.testing.assert_allclose(poses_m[:, 1], layer.last_pose_m, atol=1e-5)
    np.testing.assert_allclose(
        layer.headings_rad([0.0, 0.35, 1.0]), layer.heading_rad[:, [0, 7, 20]], atol=1e-5
    )


def test_a_share_between_two_frames_is_interpolated(layer):
    frames = layer.source_frames[:, 4] + 0.5 * (layer.source_frames[:, 5] - layer.source_frames[:, 4])
    by_hand, _ = layer.bank.poses_m(layer.clip, frames)
    np.testing.assert_allclose(layer.poses_m([4.5 / 20])[:, 0], by_hand, atol=1e-6)


def test_travel_begins_at_zero_and_adds_up(layer):
    travel_m = layer.travel_m([0.0, 0.5, 1.0])
    frames = layer.source_frames[:, [0, 10, 20]]
    assert (travel_m[:, 0] == 0).all()
    np.testing.assert_allclose(travel_m[..., 0], 0.01 * (frames - frames[:, :1]), atol=1e-5)
    np.testing.assert_allclose(layer.subset([2, 0]).travel_m([1.0]), travel_m[[2, 0], 2:], atol=1e-6)


@pytest.mark.parametrize("shares", [[1.5], [-0.1], [[0.5]], [np.nan], 0.5, ["a"]])
@pytest.mark.parametrize("method", ["poses_m", "headings_rad", "travel_m"])
def test_other_shares_are_refused(layer, method, shares):
    with pytest.raises(cg.ParameterError, match="shares of the second"):
        getattr(layer, method)(shares)


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("costs") / "rep.h5")


def test_the_places_of_a_repertoire_are_those_of_its_takes(repertoire):
    """The way between two frames of a clip, by hand from the take, turned so that its front is +Z."""
    bank, clip = repertoire.clip_motion, repertoire.n_clips - 1
    take, start = int(repertoire.clip_take[clip]), int(repertoire.clip_start_frame[clip])
    (places_m,) = bank.places_m(np.array([clip]), np.array([[0.0, 10.0, 10.5]]))
    body = body_pos_m(repertoire.motion(take)[0].resampled(NET_FPS))[start : start + 12]
    ground_m = ground_pos_m(body)[[0, 10], ::2]
    way_m = np.diff(ground_m, axis=0)[0]
    assert np.linalg.norm(places_m[1] - places_m[0]) == pytest.approx(np.linalg.norm(way_m), abs=2e-3)
    (heading,) = bank.headings_rad(np.array([clip]), np.array([[0.0]]))[0]
    front = heading_rad(body)[0] - heading  # of the take
    turned = np.arctan2(*(places_m[1] - places_m[0])) - np.arctan2(*way_m)
    if np.linalg.norm(way_m) > 0.02:
        assert np.cos(turned + front) == pytest.approx(1.0, abs=0.02)


class Recorder(cg.Cost):
    """Records what it is given, and prefers the dancer to stay."""

    def __init__(self):
        self.names = {}

    def node(self, layer, song_features):
        self.names[layer.second] = song_features.section_at(layer.second)
        return np.linalg.norm(layer.travel_m([1.0])[:, 0], axis=1)


def test_a_dance_with_a_cost_of_travel_and_sections(repertoire, tmp_path):
    song, cost = cg.load_song(write_clicks(tmp_path / "clicks.wav", duration_s=4.0)), Recorder()
    weights = {"recorder": 1000.0}
    stays = cg.dance(song, repertoire, candidates=8, costs=[cost], weights=weights, hold_ends=False)
    moves = cg.dance(
        song, repertoire, candidates=8, costs=[cost], weights={"recorder": -1000.0}, hold_ends=False
    )
    assert set(cost.names) == {0, 1, 2, 3} and set(cost.names.values()) <= {"", "A"}
    stays_m, moves_m = (sum(s.costs["recorder"] for s in d.plan.seconds) / w
                        for d, w in ((stays, 1000.0), (moves, -1000.0)))  # fmt: skip
    assert 0 <= stays_m < moves_m


@pytest.mark.parametrize("engine", ["mixer", "rollout"])
def test_engines_that_do_not_plan_seconds_say_so(repertoire, engine, tmp_path):
    song = cg.load_song(write_clicks(tmp_path / "clicks.wav", duration_s=4.0))
    with pytest.raises(cg.ParameterError, match=f"expected no costs with the {engine} engine"):
        cg.dance(song, repertoire, engine=engine, costs=[Recorder()])


@pytest.fixture
def features():
    _, features = random_source(0, n_seconds=6)
    sections = Sections(np.array([0.0, 1.2, 3.6, 4.6, 6.0]), np.array([7, 2, 7, 3]))
    form = Form((Phrase(0.4, 2.4, 4, 0, None), Phrase(2.4, 4.4, 4, 1, 0)))
    return replace(features, sections=sections, form=form)


def test_sections_have_letters_and_the_same_music_has_the_same(features):
    assert features.sections.names == ("A", "B", "A", "C")
    assert [features.section_at(second) for second in range(6)] == ["A", "B", "B", "B", "A", "C"]
    many = Sections(np.arange(31.0), np.arange(30))
    assert many.names[25:28] == ("Z", "A1", "B1")


def test_phrases_are_those_in_the_middle_of_a_second(features):
    first, second = features.form.phrases
    assert [features.phrase_at(s) for s in range(6)] == [first, first, second, second, None, None]


def test_without_sections_and_phrases_there_is_no_name(features):
    plain = replace(features, sections=Sections(np.zeros(1), np.zeros(0, int)), form=Form.empty())
    assert plain.section_at(0) == "" and plain.phrase_at(0) is None


@pytest.mark.parametrize("second", [-1, 6, 0.5])
def test_seconds_outside_the_song_are_refused(features, second):
    for method in (features.section_at, features.phrase_at):
        with pytest.raises(cg.ParameterError, match="second"):
            method(second)
