"""What layers and songs offer to costs of one's own: motion during the second, sections and phrases."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from synthetic_layers import random_source
from synthetic_repertoire import synthetic_repertoire, write_clicks

import choreograph as cg
from choreograph.choreography.graph.layers import WordLayers
from choreograph.core.timebase import NET_FPS
from choreograph.library.vocabulary import poses_at
from choreograph.motion.body import body_pos_m, ground_pos_m, heading_rad, to_root_frame
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
    by_hand, _ = layer.bank.poses_m(layer.warp.clip, frames)
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


class Restless(Recorder):
    """As `Recorder`, but prefers the dancer to go."""

    name = "recorder"

    def node(self, layer, song_features):
        return -super().node(layer, song_features)


def test_a_dance_with_a_cost_of_travel_and_sections(repertoire, tmp_path):
    song, cost = cg.load_song(write_clicks(tmp_path / "clicks.wav", duration_s=4.0)), Recorder()
    stays, moves = (
        cg.dance(song, repertoire, candidates=8, costs=[one], weights={"recorder": 1000.0}, hold_ends=False)
        for one in (cost, Restless())
    )
    assert set(cost.names) == {0, 1, 2, 3} and set(cost.names.values()) <= {"", "A"}
    stays_m, moves_m = (sum(s.costs["recorder"] for s in d.plan.seconds) / w
                        for d, w in ((stays, 1000.0), (moves, -1000.0)))  # fmt: skip
    assert 0 <= stays_m < moves_m


class Travel(cg.Cost):
    """How far the dancer goes, or with the sign -1, how far it does not go."""

    def __init__(self, sign=1.0):
        self.sign = sign

    def node(self, layer, song_features):
        return self.sign * np.linalg.norm(layer.travel_m([1.0])[:, 0], axis=1)


class OfPath(Travel):
    of_path = True


class NoneLeft(cg.Cost):
    def node(self, layer, song_features):
        return np.full(layer.n_nodes, np.inf)


class OneTake(cg.Cost):
    def __init__(self, name):
        self.take = name

    def node(self, layer, song_features):
        return np.where(layer.take_names == self.take, 0.0, np.inf)


def travel_m(dance, repertoire):
    """How far the takes go in the words of a dance, in metres."""
    names = [take.name for take in repertoire.takes]
    way_m = 0.0
    for word in dance.plan.words:
        body = repertoire.body_pos_m(names.index(word.take))
        frames = np.rint(np.array([word.source_start_s, word.source_end_s]) * NET_FPS).astype(int)
        ground_m = ground_pos_m(body[frames.clip(max=len(body) - 1)].astype(np.float64))
        way_m += float(np.linalg.norm(ground_m[1] - ground_m[0]))
    return way_m


@pytest.fixture(scope="module")
def starter():
    return cg.starter_repertoire()


@pytest.fixture(scope="module")
def house():
    return cg.load_song(cg.example_songs()["house"]).part(0.0, 16.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_mixer_takes_costs_of_words(starter, house, sign):
    made = [
        cg.dance(house, starter, engine="mixer", seed=2, costs=[Travel(sign)], weights={"travel": weight})
        for weight in (0.0, 200.0)
    ]
    plain_m, with_cost_m = (travel_m(dance, starter) for dance in made)
    assert (with_cost_m - plain_m) * sign < 0


def test_a_cost_that_is_zero_changes_no_byte(starter, house):
    plain = cg.dance(house, starter, engine="mixer", seed=2)
    made = cg.dance(house, starter, engine="mixer", seed=2, costs=[Travel()], weights={"travel": 0.0})
    np.testing.assert_array_equal(plain.motion.local_quat, made.motion.local_quat)


def test_a_take_that_a_cost_leaves_is_the_only_one_in_the_mixer(starter, house):
    take = next(take.name for take in starter.takes if take.credits.genre == "house")
    made = cg.dance(house, starter, engine="mixer", costs=[OneTake(take)], genre="house")
    assert set(made.plan.takes_s()) == {take}


def test_the_mixer_takes_costs_of_edges(starter, house):
    made = cg.dance(house, starter, engine="mixer", phrase_counts=1, genre="house", seed=1)
    jumps = cg.dance(house, starter, engine="mixer", seed=1, genre="house", costs=[Follow()], phrase_counts=1,
                     weights={"follow": 100.0})  # fmt: skip
    assert changes_of(jumps) < changes_of(made)


class Follow(cg.Cost):
    """1 where a word does not follow the one before it in its take."""

    def edge(self, previous, next, song_features):
        cost = np.ones((previous.n_nodes, next.n_nodes))
        cost[previous.successors_in(next)] = 0.0
        return cost


def changes_of(dance):
    return sum(
        one.take != two.take or abs(one.source_end_s - two.source_start_s) > 1e-3
        for one, two in pairwise(dance.plan.words)
    )


def test_the_rollout_takes_costs_of_nodes(starter, house):
    """The passages that steer it are those of the takes that a cost leaves."""
    v, names = starter.vocabulary, [take.name for take in starter.takes]
    take = next(take.name for take in starter.takes if take.credits.genre == "house")
    made = cg.dance(house, starter, engine="rollout", costs=[OneTake(take)], genre="house")
    of_take = set(v.word_motif[v.words_of_take(names.index(take))].tolist())
    assert {word.motif for word in made.plan.words} <= of_take


@pytest.mark.parametrize("engine", ["mixer", "rollout"])
def test_what_engines_of_words_cannot_do_is_said_in_a_line(starter, house, engine):
    def dance(*costs, **settings):
        return cg.dance(house, starter, engine=engine, costs=costs, **settings)

    with pytest.raises(cg.ParameterError, match=f"costs without of_path with the {engine} engine"):
        dance(OfPath())
    with pytest.raises(cg.ParameterError, match=f"your own costs with the {engine} engine, got 'variety'"):
        dance(Travel(), weights={"variety": 2.0})
    with pytest.raises(cg.ParameterError, match="a different name for each cost"):
        dance(Travel(), Travel())
    with pytest.raises(cg.NoPathError, match="every word of the genre at"):
        dance(NoneLeft())


def test_what_the_rollout_cannot_do_is_said_in_a_line(starter, house):
    with pytest.raises(cg.ParameterError, match="expected costs of nodes with the rollout engine"):
        cg.dance(house, starter, engine="rollout", costs=[Follow()])
    with pytest.raises(cg.ParameterError, match="expected phrase_counts above 1"):
        cg.dance(house, starter, engine="rollout", costs=[Travel()], phrase_counts=1)


class TravelAndFollow(Travel):
    def edge(self, previous, next, song_features):
        return np.zeros((previous.n_nodes, next.n_nodes))


def test_the_rollout_notes_that_it_has_no_edges(starter, house):
    made = cg.dance(house, starter, engine="rollout", costs=[TravelAndFollow()])
    assert [note for note in made.notes if "only the costs of nodes of travelandfollow" in note]


def test_edges_that_forbid_every_way_are_said_in_a_line(starter, house):
    with pytest.raises(cg.NoPathError, match="every way to slot"):
        cg.dance(house, starter, engine="mixer", costs=[NoWay()])


class NoWay(cg.Cost):
    def edge(self, previous, next, song_features):
        return np.full((previous.n_nodes, next.n_nodes), np.inf)


def test_layers_of_words_are_the_motion_of_their_takes(starter):
    """Poses, travel and headings, by hand from the takes. The next word of a take is the successor."""
    v, layers = starter.vocabulary, WordLayers(starter)
    words = np.array([3, 200, 40])
    layer = layers.layer(words, slot=5, second=2, length_s=0.4)
    middles_s = 0.5 * (v.word_start_s + v.word_end_s)[words]
    for row, word in enumerate(words):
        body = starter.body_pos_m(int(v.word_take[word])).astype(np.float64)
        middle = poses_at(body, NET_FPS, middles_s[row : row + 1])
        np.testing.assert_allclose(layer.poses_m([0.5])[row], to_root_frame(middle), atol=0.02)
        ends = poses_at(body, NET_FPS, np.array([v.word_start_s[word], v.word_end_s[word]]))
        way_m = np.linalg.norm(np.diff(ground_pos_m(ends)[:, ::2], axis=0)[0])
        assert np.linalg.norm(layer.travel_m([1.0])[row, 0]) == pytest.approx(way_m, abs=2e-3)
    assert layer.take_names.tolist() == [starter.takes[take].name for take in v.word_take[words]]
    assert (layer.second, layer.style.shape, layer.motifs[:, 0].tolist()) == (
        2, (3, 32), v.word_motif[words].tolist(),
    )  # fmt: skip
    following = layers.layer(np.array([41, 4, 199, 201]), slot=6, second=2, length_s=0.4)
    assert [rows.tolist() for rows in layer.successors_in(following)] == [[2, 0, 1], [0, 1, 3]]


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
