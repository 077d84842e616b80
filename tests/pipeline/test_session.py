"""A session makes the dances that `dance` makes, to the byte, whatever was danced before."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import choreograph as cg
from choreograph.core.cache import Memory
from choreograph.core.errors import NoPathError
from choreograph.pipeline.dancing import dance_with
from choreograph.plan.plan import Plan

DURATION_S = 8.0
GENRES = ["house", "cha-cha", "waltz"]
COSTS = ["genre", "transition", "front", "variety", "signature", "motif_transition", "form", "energy", "seed"]
STARTER = cg.starter_repertoire()
TAKES = [take.name for take in STARTER.takes if take.credits.genre == "house"]
MOTIFS = STARTER.vocabulary.n_motifs


def content(dance: cg.Dance) -> tuple[object, ...]:
    """Everything in a dance, with the bytes of its motion."""
    motion = dance.motion
    return dance.plan, dance.notes, motion.root_pos_m.tobytes(), motion.local_quat.tobytes()


def spans(longest_s: float):
    """A start and an end in the dance, on half seconds."""
    start_s = st.integers(0, 9).map(lambda half: half / 2)
    length_s = st.integers(2, int(2 * longest_s)).map(lambda half: half / 2)
    return st.tuples(start_s, length_s).map(lambda pair: (pair[0], min(sum(pair), DURATION_S - 0.5)))


take_pins = st.builds(lambda span, take: cg.TakePin(*span, take), spans(3.0), st.sampled_from(TAKES))
motif_pins = st.builds(
    lambda half, motif: cg.MotifPin(half / 2, motif), st.integers(1, 14), st.integers(0, MOTIFS - 1)
)
bans = st.one_of(
    st.sampled_from(TAKES).map(lambda take: cg.Ban(take=take)),
    st.sampled_from(GENRES).map(lambda genre: cg.Ban(genre=genre)),
    st.integers(0, MOTIFS - 1).map(lambda motif: cg.Ban(motif=motif)),
)
weights = st.dictionaries(st.sampled_from(COSTS), st.sampled_from([0.0, 0.5, 1.0, 3.0, 8.0]), max_size=2)
settings_of_a_dance = st.fixed_dictionaries(
    {},
    optional={
        "weights": weights,
        "seed": st.integers(0, 3),
        "pins": st.lists(take_pins | motif_pins, max_size=1),
        "bans": st.lists(bans, max_size=2),
        "genre": st.sampled_from(GENRES),
        "keeps": spans(5.0),
        "planner": st.sampled_from(["exact", "greedy"]),
        "front": st.sampled_from(["audience", "free"]),
        "selection": st.sampled_from(["style", "genre"]),
        "warping": st.sampled_from(["counts", "dtw"]),
        "dynamics": st.sampled_from([0.0, 1.0]),
    },
)
ENGINES = ["graph", "graph", "graph", "mixer"]  # the rollout engine takes more seconds
ONLY_OF_THE_GRAPH = ("weights", "front", "selection", "warping")


def arguments_of(drawn: dict[str, object], engine: str, first: cg.Dance) -> dict[str, object]:
    """The keywords of `dance` for settings that were drawn and an engine."""
    arguments = {"engine": engine, **drawn}
    if engine != "graph":
        arguments = {name: value for name, value in arguments.items() if name not in ONLY_OF_THE_GRAPH}
        arguments.pop("planner", None)
    kept = arguments.pop("keeps", None)
    if kept is not None:
        arguments |= {"existing": first, "keep": [cg.Keep(*kept)]}
    return arguments


def outcome(dance, arguments: dict[str, object]) -> object:
    """The content of a dance, or the message of the error."""
    try:
        return content(dance(**arguments))
    except (NoPathError, cg.ParameterError) as error:
        return str(error)


@pytest.fixture(scope="module")
def first() -> cg.Dance:
    return cg.dance(cg.example_songs()["house"], STARTER, duration_s=DURATION_S)


def assert_a_chain_is_made_as_fresh(chain, first):
    song = cg.example_songs()["house"]
    session = cg.Session(song, STARTER, duration_s=DURATION_S)
    for drawn, engine in chain:
        arguments = arguments_of(drawn, engine, first)
        fresh = outcome(lambda **one: cg.dance(song, STARTER, duration_s=DURATION_S, **one), arguments)
        assert outcome(session.dance, arguments) == fresh, arguments


changes = st.tuples(settings_of_a_dance, st.sampled_from(ENGINES))


@settings(max_examples=2, suppress_health_check=[HealthCheck.too_slow])
@given(chain=st.lists(changes, min_size=3, max_size=3))
def test_a_chain_of_changes_is_made_as_fresh(chain, first):
    assert_a_chain_is_made_as_fresh(chain, first)


@pytest.mark.slow
@settings(max_examples=3, suppress_health_check=[HealthCheck.too_slow])
@given(chain=st.lists(changes, min_size=20, max_size=20))
def test_a_chain_of_twenty_changes_is_made_as_fresh(chain, first):
    assert_a_chain_is_made_as_fresh(chain, first)


def test_the_layers_of_another_weight_are_not_made_again(monkeypatch):
    from choreograph.choreography.graph import segments

    session = cg.Session(cg.example_songs()["house"], STARTER, duration_s=DURATION_S)
    session.dance()
    made = []
    monkeypatch.setattr(segments, "_warped_second", lambda *_, **__: made.append("second"))
    monkeypatch.setattr(segments, "one_per_time_map", lambda *_: made.append("layer"))
    heavier = session.dance(weights={"genre": 2.0})
    assert heavier.plan.weights["genre"] == 2.0
    assert made == []


class Recorder(cg.Cost):
    """Records what all layers hold."""

    def __init__(self) -> None:
        self.layers = []

    def node(self, layer, song_features):
        if layer.n_nodes > 1:  # not the nodes of the path
            self.layers.append(layer)


def test_layers_that_are_taken_over_in_part_are_those_of_a_fresh_dance():
    song = cg.example_songs()["house"]
    session = cg.Session(song, STARTER, duration_s=DURATION_S)
    session.dance()
    changes = ({"seed": 1}, {"seed": 2, "bans": [cg.Ban(take=TAKES[0])]}, {"seed": 2, "genre": "waltz"})
    for arguments in changes:
        ours, fresh = Recorder(), Recorder()
        session.dance(costs=[ours], **arguments)
        cg.dance(song, STARTER, duration_s=DURATION_S, costs=[fresh], **arguments)
        assert len(ours.layers) == len(fresh.layers) == DURATION_S
        for one, other in zip(ours.layers, fresh.layers, strict=True):
            for name, values in vars(other).items():
                if isinstance(values, np.ndarray):
                    assert values.tobytes() == getattr(one, name).tobytes(), name
    assert {genre for layer in ours.layers for genre in layer.genre} == {"waltz"}  # no other may be danced


def test_a_dance_with_the_same_arguments_is_made_once_and_may_be_changed(monkeypatch):
    from choreograph.pipeline import session as module

    session = cg.Session(cg.example_songs()["house"], STARTER, duration_s=4.0)
    first = session.dance(seed=3, weights={"front": 2.0})
    expected = content(first)
    first.motion.root_pos_m[:] = 0.0
    with monkeypatch.context() as patch:
        patch.delattr(module, "dance_with")
        again = session.dance(weights={"front": 2.0}, seed=3)
        assert content(again) == expected
        again.motion.local_quat[:] = 0.0
        assert content(session.dance(weights={"front": 2.0}, seed=3)) == expected
        with pytest.raises(NameError):
            session.dance(seed=4, weights={"front": 2.0})


@pytest.mark.parametrize(
    "arguments",
    [
        {"costs": [Recorder()]},
        {"existing": "dance.json"},
        {"beats": "beats.txt"},
        {"style_song": "song.wav"},
        {"report": print},
        {"config": cg.DanceConfig(style_song="song.wav", engine="rollout")},
        {"weights": 5},
        {"engine": "of_another_package"},
    ],
)
def test_files_and_code_of_others_are_read_and_run_for_every_dance(arguments):
    from choreograph.pipeline.session import _content_of

    assert _content_of(arguments) is None
    assert _content_of({"seed": 1}) is not None


def test_a_file_of_beats_that_has_changed_is_read_again(tmp_path):
    path = tmp_path / "beats.txt"
    session = cg.Session(cg.example_songs()["house"], STARTER, duration_s=DURATION_S)
    plans: list[Plan] = []
    for period_s in (0.5, 0.4, 0.5):
        path.write_text("\n".join(f"{at:.2f}" for at in np.arange(0.2, DURATION_S, period_s)))
        plans.append(session.dance(beats=path).plan)
    assert plans[0] == plans[2]
    assert all(one.music_beats_s != other.music_beats_s for one, other in pairwise(plans))


def test_what_a_memory_keeps_is_bounded():
    song, memory = cg.example_songs()["house"], Memory(1 << 20)  # less than one layer and its segments
    for seed in (0, 1, 0):
        fresh = cg.dance(song, STARTER, duration_s=4.0, seed=seed)
        assert content(dance_with(memory, song, STARTER, duration_s=4.0, seed=seed)) == content(fresh)
    assert 0 < memory.n_bytes <= 1 << 20
