"""Candidates are clips that can be danced, and no request fails because others were left out."""

from __future__ import annotations

import numpy as np
import pytest

import choreograph as cg
from choreograph.choreography.graph import engine, layer_source
from choreograph.choreography.graph.candidates import FIRST, IF_TOO_FEW, NEVER, AllowedNodes, take_ranks
from choreograph.core.errors import NoPathError

DURATION_S = 12.0


@pytest.fixture(scope="module")
def starter():
    return cg.starter_repertoire()


@pytest.fixture
def sources(monkeypatch):
    """The layers of every search, as the planners get them."""
    made = []

    def kept(*arguments, **options):
        made.append(layer_source.make_layers(*arguments, **options))
        return made[-1]

    monkeypatch.setattr(engine, "make_layers", kept)
    return made


def dance(starter, **arguments):
    return cg.dance(cg.example_songs()["house"], starter, duration_s=DURATION_S, **arguments)


def genres(source):
    return [set(source.layer(second).genre.tolist()) for second in range(source.n_seconds)]


def clips_of(starter, genre):
    of_take = np.array([take.credits.genre == genre for take in starter.takes])
    return int(of_take[starter.clip_take].sum())


@pytest.mark.parametrize("arguments", [{}, {"genre": "house"}], ids=["likely", "requested"])
def test_candidates_are_all_clips_of_the_genre_and_no_others(starter, sources, arguments):
    dance(starter, **arguments)
    (source,) = sources
    assert genres(source) == [{"house"}] * source.n_seconds
    assert source._segments.clip.shape[1] == clips_of(starter, "house")


def test_few_candidates_are_of_the_genre_too(starter, sources):
    dance(starter, candidates=16)
    (source,) = sources
    assert genres(source) == [{"house"}] * source.n_seconds
    assert source._segments.clip.shape[1] == 8  # the other half would be of other genres


class Salsa(cg.Cost):
    """Much higher for other takes than those of salsa."""

    def node(self, layer, song_features):
        return np.where(layer.genre == "salsa", 0.0, 50.0)


def test_a_cost_of_the_user_chooses_among_all_genres(starter, sources):
    made = dance(starter, costs=[Salsa()])
    assert {second.credits.genre for second in made.plan.seconds} == {"salsa"}
    assert "house" in genres(sources[0])[0]
    assert sources[0]._segments.clip.shape[1] == cg.DanceConfig().candidates
    seconds = dance(starter, costs=[Salsa()], weights={"salsa": 0.0}).plan.seconds
    assert {second.credits.genre for second in seconds} == {"house"}


@pytest.mark.parametrize("how", [{"selection": "style"}, {"selection": "random"}])
def test_other_selections_are_of_all_genres(starter, sources, how):
    dance(starter, **how)
    assert len(set().union(*genres(sources[0]))) > 1


def test_other_genres_are_searched_if_the_likely_one_cannot_be_danced(starter, sources, monkeypatch):
    def node(self, layer, song_features):  # as if a ban of motifs left nothing of the genre
        return np.where(layer.genre == "house", np.inf, self.of_take[layer.second, layer.take])

    monkeypatch.setattr(AllowedNodes, "node", node)
    made = dance(starter)
    assert len(sources) == 2
    assert "house" not in {second.credits.genre for second in made.plan.seconds}


def test_a_request_that_nothing_meets_is_an_error_that_names_it(starter, sources, monkeypatch):
    monkeypatch.setattr(AllowedNodes, "node", lambda self, layer, _: np.full(layer.n_nodes, np.inf))
    with pytest.raises(NoPathError, match="every node of second 0 is forbidden"):
        dance(starter, genre="house")
    assert len(sources) == 1


def test_ranks_of_takes_follow_their_costs():
    cost = np.array([[0.0, 20.0, np.inf], [20.0, 0.0, 0.0]])
    allowed = AllowedNodes(cost, np.zeros(2, bool))
    assert allowed.is_graded
    alone = take_ranks(None, allowed, of_genre_alone=True)
    assert alone.tolist() == [[FIRST, IF_TOO_FEW, 2 * NEVER], [IF_TOO_FEW, FIRST, FIRST]]
    assert take_ranks(None, allowed, of_genre_alone=False).tolist() == [[0, 0, 2 * NEVER], [0, 0, 0]]
    assert not replace_cost(allowed, np.where(cost == 20.0, 0.0, cost)).is_graded


def replace_cost(allowed, cost):
    return AllowedNodes(cost, allowed.motif_banned[:-1])


def test_takes_that_a_pin_excludes_are_selected_before_those_that_are_banned():
    beside = np.array([[0.0, 20.0, np.inf]])
    allowed = AllowedNodes(np.array([[np.inf, np.inf, np.inf]]), np.zeros(2, bool), beside)
    ranks = take_ranks(None, allowed, of_genre_alone=True)
    assert ranks.tolist() == [[NEVER, NEVER + IF_TOO_FEW, 2 * NEVER]]


def test_every_seed_has_the_same_candidates_if_all_are_drawn(starter, sources):
    for seed in (0, 1):
        dance(starter, seed=seed)
    a, b = sources
    assert np.array_equal(a._segments.clip, b._segments.clip)
