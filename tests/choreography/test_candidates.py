"""Candidates are clips that can be danced, and no request fails because others were left out."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import choreograph as cg
from choreograph.choreography.graph import engine
from choreograph.choreography.graph.candidates import (
    _FEWEST_OF_METRE,
    FIRST,
    IF_TOO_FEW,
    NEVER,
    AllowedNodes,
    take_ranks,
)
from choreograph.core.counts import Counts, make_counts
from choreograph.core.errors import NoPathError
from choreograph.library.clips import TakeTempi

DURATION_S = 12.0
FEWEST = _FEWEST_OF_METRE


@pytest.fixture(scope="module")
def starter():
    return cg.starter_repertoire()


@pytest.fixture
def sources(monkeypatch):
    """The layers of every search, as the planners get them."""
    made, make_layers = [], engine.make_layers

    def kept(*arguments, **options):
        made.append(make_layers(*arguments, **options))
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


def a_request(metre_of_song, metre_of_take, *, clips=FEWEST, seconds=2, **counts):
    """A song of bars of `metre_of_song` beats, and takes in these metres, each with so many clips."""
    times_s = np.arange(4.0 * seconds + 1) / 4
    numbers = np.arange(len(times_s)) % metre_of_song + 1
    found = make_counts(times_s, numbers, metre_of_song, **{"confidence": 1.0, **counts})
    n_takes = len(metre_of_take)
    zeros = np.zeros(n_takes)
    tempi = TakeTempi(np.array(metre_of_take), zeros, zeros.astype(int), zeros, zeros > 0)
    return SimpleNamespace(
        song_features=Features(found, seconds),
        material=SimpleNamespace(counts=found),
        repertoire=SimpleNamespace(
            takes=[None] * n_takes, take_tempi=tempi, clip_take=np.repeat(np.arange(n_takes), clips)
        ),
        config=cg.DanceConfig(),
    )


@dataclass(frozen=True)
class Features:
    counts: Counts
    n_seconds: int


def test_ranks_of_takes_follow_their_costs():
    cost = np.array([[0.0, 20.0, np.inf], [20.0, 0.0, 0.0]])
    allowed = AllowedNodes(cost, np.zeros(2, bool))
    request = a_request(4, (4, 4, 4))
    alone = take_ranks(request, (), allowed, of_music_alone=True)
    assert alone.tolist() == [[FIRST, IF_TOO_FEW, 2 * NEVER], [IF_TOO_FEW, FIRST, FIRST]]
    ranks = take_ranks(request, (), allowed, of_music_alone=False)
    assert ranks.tolist() == [[0, 0, 2 * NEVER], [0, 0, 0]]


def test_takes_that_a_pin_excludes_are_selected_before_those_that_are_banned():
    beside = np.array([[0.0, 20.0, np.inf]])
    allowed = AllowedNodes(np.array([[np.inf, np.inf, np.inf]]), np.zeros(2, bool), beside)
    ranks = take_ranks(a_request(4, (4, 4, 4), seconds=1), (), allowed, of_music_alone=True)
    assert ranks.tolist() == [[NEVER, NEVER + IF_TOO_FEW, 2 * NEVER]]


def test_takes_of_another_metre_are_selected_only_if_there_are_too_few_others():
    def of_other_metre(metre_of_song, metre_of_take, **how):
        request = a_request(metre_of_song, metre_of_take, seconds=8, **how)
        ranks = take_ranks(request, (), None, of_music_alone=True)
        assert set(np.unique(ranks)) <= {FIRST, IF_TOO_FEW}
        return [take for take in range(ranks.shape[1]) if (ranks[:, take] == IF_TOO_FEW).all()]

    assert of_other_metre(3, (3, 4, 0, 4)) == [1, 3]
    assert of_other_metre(4, (3, 4, 0, 4)) == [0]
    assert of_other_metre(3, (4, 4)) == []  # none of the metre
    assert of_other_metre(3, (3, 4), clips=FEWEST - 1) == []  # too few of it
    assert of_other_metre(3, (3, 4), confidence=0.4) == []
    everything = take_ranks(a_request(3, (3, 4)), (), None, of_music_alone=False)
    assert (everything == FIRST).all()


def test_a_single_bar_of_another_length_changes_no_metre():
    request = a_request(4, (3, 4), seconds=12)
    counts = request.material.counts
    numbers = np.concatenate([counts.numbers[:16], [1, 2, 3], counts.numbers[: len(counts) - 19]])
    request.material.counts = make_counts(counts.times_s, numbers, 4)
    ranks = take_ranks(request, (), None, of_music_alone=True)
    assert ranks.tolist() == [[IF_TOO_FEW, FIRST]] * 12


def test_takes_of_all_metres_are_selected_where_the_metre_changes():
    request = a_request(4, (3, 4), seconds=12)
    half = make_counts(
        request.material.counts.times_s,
        np.concatenate([np.arange(24) % 4 + 1, np.arange(25) % 3 + 1]), 4,
    )  # fmt: skip
    request.material.counts = half
    assert (take_ranks(request, (), None, of_music_alone=True) == FIRST).all()


def test_every_seed_has_the_same_candidates_if_all_are_drawn(starter, sources):
    for seed in (0, 1):
        dance(starter, seed=seed)
    a, b = sources
    assert np.array_equal(a._segments.clip, b._segments.clip)
