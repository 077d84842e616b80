"""The heading that the graph engine plans is the one that is danced, and faces the audience."""

from __future__ import annotations

import numpy as np
import pytest

import choreograph as cg
from choreograph.choreography.mixer import engine as mixer
from choreograph.choreography.mixer.words import SEARCHES, CandidatePool, Candidates, search_words
from choreograph.evaluation.metrics import front
from choreograph.motion.body import body_pos_m


class PathRecorder(cg.Cost):
    """Costs nothing, and keeps the nodes of the path, whose costs are computed last."""

    of_path = True

    def __init__(self) -> None:
        self.nodes = {}

    def edge(self, previous, next, song_features):
        if previous.n_nodes == next.n_nodes == 1:
            self.nodes |= {previous.second: previous, next.second: next}
        return np.zeros((previous.n_nodes, next.n_nodes))


@pytest.fixture(scope="module")
def danced():
    """A dance to a waltz that faces the audience, with the nodes of its path."""
    path = PathRecorder()
    dance = cg.dance(cg.example_songs()["waltz"], duration_s=16, front="audience", seed=2, costs=[path])
    return dance, [path.nodes[second] for second in range(16)]


def test_the_planned_heading_is_that_of_the_dance(danced):
    dance, path = danced
    planned_rad = np.array([node.path.turn_rad[0] + node.heading_rad[0, 10] for node in path])
    middles = np.round((np.arange(len(planned_rad)) + 0.5) * dance.motion.fps).astype(np.int64)
    headings_rad = front.heading_rad(body_pos_m(dance.motion))[middles]
    inside = slice(2, -2)  # the dance is not at full speed at its ends
    off_rad = np.abs(np.angle(np.exp(1j * (headings_rad - planned_rad))))[inside]
    assert len({node.take[0] for node in path}) > 1
    assert np.median(off_rad) < 0.2
    assert off_rad.max() < 0.6


def test_a_dance_to_the_front_ends_there_and_shows_the_back_less_than_a_free_one():
    away = {"audience": [], "free": []}
    for seed in range(8):  # some free dances face the audience by chance
        faces = {}
        for setting in ("audience", "free"):
            dance = cg.dance(cg.example_songs()["waltz"], duration_s=30, front=setting, seed=seed)
            faces[setting] = front.evaluate(body_pos_m(dance.motion), dance.motion.fps)
        assert faces["audience"]["ends_to_front"] == 1.0
        for setting, of_seeds in away.items():
            of_seeds.append(faces[setting]["turned_away_share"])
    assert np.mean(away["audience"]) <= 0.03 and max(away["audience"]) <= 0.07
    assert np.mean(away["free"]) > 0.1


@pytest.mark.parametrize("engine", ["mixer", "rollout"])
def test_other_engines_face_the_audience_more_than_free_dances(engine):
    faces = {}
    for setting in ("audience", "free"):
        of_seeds = []
        for seed in range(4):
            dance = cg.dance(
                cg.example_songs()["waltz"], duration_s=16, engine=engine, front=setting, seed=seed
            )
            assert dance.plan.front == setting
            of_seeds.append(front.evaluate(body_pos_m(dance.motion), dance.motion.fps))
        faces[setting] = {name: np.mean([face[name] for face in of_seeds]) for name in of_seeds[0]}
    assert faces["audience"]["last_heading_deg"] < faces["free"]["last_heading_deg"] - 15.0
    assert faces["audience"]["turned_away_share"] < faces["free"]["turned_away_share"] + 0.01


def test_words_are_chosen_that_lead_to_the_front():
    """Of two words that fit nearly equally, one ends with the back to the audience."""
    poses = np.zeros((2, 3, 3, 21, 3))
    takes = np.arange(3)
    headings_rad = np.array([[0.0, 0.0, 0.0], [0.0, np.pi / 2, np.pi], [0.0, 0.1, 0.2]])
    ways = headings_rad, np.zeros((3, 2, 2))
    here = Candidates(np.array([0, 2, 4]), takes, np.array([0.1, 0.0, 0.05]), *poses, *ways)
    slots = [here.without(2, 4), here.without(0)]
    for search in SEARCHES:
        assert search_words(slots, search=search).tolist() == [0, 2]
        assert search_words(slots, search=search, last_slot=1).tolist() == [0, 4]


def test_passages_are_drawn_that_face_the_audience():
    """The motifs that a mixer draws are danced with the back to the audience in fewer words than without."""
    ratios = []
    for genre in ("waltz", "cha-cha", "tango", "salsa"):
        away = {setting: _turned_away(genre, setting) for setting in ("audience", "free")}
        assert away["audience"] < away["free"]
        ratios.append(away["audience"] / away["free"])
    assert np.mean(ratios) < 0.9


def _turned_away(genre: str, setting: str) -> float:
    """How far the words of the motifs that the mixer draws are turned from the audience, from 0 to 1."""
    requests = []
    with pytest.MonkeyPatch.context() as patch:
        mixing = mixer.Mixing
        patch.setattr(mixer, "Mixing", lambda request: requests.append(request) or mixing(request))
        song = cg.example_songs()["waltz"]
        cg.dance(song, duration_s=16, engine="mixer", genre=genre, front=setting)
    backs = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        pool = CandidatePool.of(requests[0].constraints, requests[0].repertoire, rng)
        heading_rad, _ = pool.ways(np.arange(len(pool.vocabulary.word_take)))
        turns = (0.5 - 0.5 * np.cos(heading_rad)).mean(axis=1)  # (W,)
        wanted = mixer._motifs(pool, requests[0])
        backs += [turns[pool.vocabulary.word_motif == motif].mean() for motif in wanted]
    return float(np.mean(backs))
