"""Goals: a genre's, or a custom signature."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.choreography.motif_sequences import motif_goal
from choreograph.core.errors import ParameterError
from choreograph.library.vocabulary import find_motifs, make_vocabulary


@pytest.fixture(scope="module")
def vocabulary():
    motifs, labels = find_motifs(np.repeat(np.eye(4), 10, axis=0), n_motifs=4)
    take = np.repeat([0, 1], 20)
    start = np.tile(np.arange(20.0), 2)
    return make_vocabulary(motifs, labels, take, start, start + 1, ["waltz", "rumba"])


def test_a_genres_goal_is_its_template_and_transitions(vocabulary):
    goal = motif_goal(vocabulary, genre="waltz")
    row = vocabulary.genre_index("waltz")
    assert np.array_equal(goal.signature, vocabulary.signatures[row])
    assert np.array_equal(goal.transitions, vocabulary.transitions[row])


def test_a_signature_has_the_transitions_of_all_takes_or_of_a_genre(vocabulary):
    shares = np.array([0.7, 0.3, 0.0, 0.0])
    assert np.array_equal(motif_goal(vocabulary, signature=shares).transitions, vocabulary.transitions[-1])
    mixed = motif_goal(vocabulary, signature=shares, genre="rumba")
    assert np.array_equal(mixed.signature, shares)
    assert np.array_equal(mixed.transitions, vocabulary.transitions[vocabulary.genre_index("rumba")])


@pytest.mark.parametrize(
    "wrong", [{"genre": "polka"}, {"signature": np.ones(3) / 3}, {"signature": np.ones(4)}]
)
def test_invalid_goals_are_refused_in_one_line(vocabulary, wrong):
    with pytest.raises(ParameterError) as error:
        motif_goal(vocabulary, **wrong)
    assert "\n" not in str(error.value)
