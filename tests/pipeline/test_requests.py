"""Every parameter of `dance` with every engine changes the dance, or is refused; a few are noted."""

from __future__ import annotations

import inspect
from dataclasses import fields
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.choreography.engine import engines
from choreograph.cli.dance import command
from choreograph.core.errors import ChoreographError
from choreograph.pipeline import dancing
from choreograph.plan import joins as stage

pytestmark = pytest.mark.slow

STARTER = cg.starter_repertoire()
TAKE = STARTER.takes[0].name  # of another genre than the song's
OF_GENRE = [take.name for take in STARTER.takes if take.credits.genre == "house"][4]


class OnlyTake(cg.Cost):
    """One take, whatever it costs."""

    def node(self, layer, song_features):
        return np.where(layer.take_names == OF_GENRE, 0.0, 1000.0)


class Hop(cg.Cost):
    """Each second another take."""

    def edge(self, previous, next, song_features):
        return 1000.0 * (previous.take_names[:, None] == next.take_names[None, :])


@pytest.fixture(scope="module")
def dance(tmp_path_factory):
    """Dances with an engine and parameters; the song is analysed once for each way of counting it."""
    song, analysed, original = (
        cg.load_song(cg.example_songs()["house"], duration_s=9.0),
        {},
        dancing.analyse_song,
    )

    def analyse(song, repertoire, **options):
        key = song.start_s, song.duration_s, options["beats"], options["genre"]
        if key not in analysed:
            analysed[key] = original(song, repertoire, **options)
        return analysed[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dancing, "analyse_song", analyse)
        patch.setattr(stage, "STAGE_RADIUS_M", 0.2)  # so that 5 s are enough to leave it
        yield lambda **options: cg.dance(song, STARTER, **options)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with a song and with beats."""
    folder = tmp_path_factory.mktemp("requests")
    write_clicks(folder / "other.wav", duration_s=9.0, bpm=150.0)
    beats = "".join(f"{0.3 + 0.45 * beat:.2f} {beat % 4 + 1}\n" for beat in range(19))
    (folder / "song.beats").write_text(beats)
    return folder


SHARES = [1.0] + [0.0] * (STARTER.vocabulary.n_motifs - 1)
ALL, TAKES = {"graph", "mixer", "rollout"}, {"graph", "mixer"}
# Parameter -> the engines that use it; what is given for it (a name of `files`), beside what else.
TABLE = {
    "planner": (TAKES, "greedy", {"seed": 1}),
    "bound": ({"graph"}, True, {}),
    "candidates": ({"graph"}, 8, {"costs": (Hop(),)}),
    "selection": ({"graph"}, "random", {}),
    "warping": ({"graph"}, "none", {}),
    "density": (set(), "learned", {}),  # of a repertoire that has one
    "time_maps": ({"graph"}, "raw", {"warping": "dtw"}),
    "blending": (TAKES, "linear", {"costs": (Hop(),)}),
    "transitions": ({"graph"}, "seconds", {"costs": (Hop(),)}),
    "lock_feet": (TAKES, False, {}),
    "hold_ends": (ALL, False, {}),
    "dynamics": (ALL, 0.0, {}),
    "stage": (ALL, "1x1", {"genre": "waltz", "costs": (Hop(),), "seed": 1}),
    "front": (ALL, "free", {"costs": (Hop(),)}),
    "motif_draw": ({"mixer", "rollout"}, "absolute", {"genre": "salsa"}),
    "phrase_counts": ({"mixer", "rollout"}, 1, {}),
    "style_strength": ({"rollout"}, 9.0, {}),
    "style_window": ({"rollout"}, "hamming", {"style_strength": 9.0}),
    "fps": (ALL, 30.0, {}),
    "seed": (ALL, 5, {}),
    "beats": (ALL, "song.beats", {}),
    "genre": (ALL, "salsa", {}),
    "signature": (ALL, SHARES, {}),
    "motifs": ({"mixer", "rollout"}, [1, 0, 1, 0, 1, 0], {}),
    "pins": (TAKES, [cg.TakePin(2.0, 4.0, TAKE)], {}),
    "bans": (TAKES, [cg.Ban(genre="house")], {}),
    "style_song": ({"rollout"}, "other.wav", {"style_strength": 9.0}),
    "config": (ALL, cg.DanceConfig(seed=5), {}),
    "weights": ({"graph"}, {"variety": 100.0, "repeat": 100.0}, {}),
    "costs": (ALL, [OnlyTake()], {}),
    "start_s": (ALL, 1.3, {}),
    "duration_s": (ALL, 4.0, {}),
}  # fmt: skip
ELSEWHERE = {
    "song",
    "repertoire",
    "engine",
    "keep",
    "existing",
    "report",
    "cache",
}  # tested in test_keeping and test_cached_analysis, or not to


def test_the_table_is_whole():
    settings = {field.name for field in fields(cg.DanceConfig)}
    parameters = set(inspect.signature(cg.dance).parameters) - {"settings"}
    assert set(TABLE) | ELSEWHERE == settings | parameters
    assert set(engines()) == ALL
    on_the_command_line = {option.name for option in command.params} | settings
    renamed = {"start_s": "start", "duration_s": "duration", "pins": "pin", "bans": "ban"}
    assert {renamed.get(name, name) for name in TABLE} - {"costs"} <= on_the_command_line


@pytest.fixture(scope="module")
def plain(dance):
    """The dances without a parameter, made once: by engine, and what is given beside."""
    return cache(lambda engine, beside: dance(engine=engine, **dict(beside)).motion)


@pytest.mark.parametrize("engine", sorted(ALL))
@pytest.mark.parametrize("parameter", sorted(TABLE))
def test_a_parameter_changes_the_dance_or_is_refused(dance, plain, files, parameter, engine):
    users, value, beside = TABLE[parameter]
    given = {parameter: files / value if parameter in ("beats", "style_song") else value}
    if engine not in users:
        with pytest.raises(ChoreographError):
            dance(engine=engine, **given)
        return
    if engine == "graph":
        beside = {"candidates": 24, **beside}
    else:
        beside = {name: value for name, value in beside.items() if name != "costs"}  # of the graph engine
    without = plain(engine, tuple(sorted(beside.items())))
    made = dance(engine=engine, **(beside | given))
    motion = made.motion
    if parameter == "bound":  # changes the plan alone
        assert 0.0 < made.plan.least_cost <= made.plan.total_cost
        return
    assert motion.n_frames != without.n_frames or not np.allclose(motion.local_quat, without.local_quat)


def test_what_another_setting_makes_useless_is_refused_or_noted(dance):
    for name, value in (("time_maps", "raw"), ("density", "repertoire")):
        with pytest.raises(cg.ParameterError, match=f"no {name.replace('_', ' ')} with the warping none"):
            dance(warping="none", **{name: value})
    with pytest.raises(cg.ParameterError, match="a weight of 'genre', got motion-graph"):
        dance(planner="motion-graph", weights={"genre": 3.0, "transition": 2.0})
    noted = [note for note in dance(candidates=8, time_maps="raw").notes if "no effect" in note]
    assert noted == [
        "no effect of time maps, because takes are aligned by counts: choose the warping dtw to use them"
    ]
    assert not [
        note for note in dance(candidates=8, time_maps="raw", warping="dtw").notes if "no effect" in note
    ]
    vocabulary = STARTER.vocabulary
    begins_a_take = int(vocabulary.word_motif[vocabulary.words_of_take(0)][0])  # not within a bar, as others
    noted = [
        note for note in dance(motifs=[begins_a_take] * 40, signature=SHARES).notes if "no effect" in note
    ]
    assert noted == ["the signature has no effect, since all motifs were given"]


def test_costs_of_the_user_count_in_the_motion_graph_as_well(dance):
    given = {"planner": "motion-graph", "candidates": 24}
    takes = [[s.take for s in dance(**given, costs=costs).plan.seconds] for costs in ((), [Hop()])]
    assert any(before == after for before, after in pairwise(takes[0]))
    assert all(before != after for before, after in pairwise(takes[1]))


def test_beats_beside_counts_alone_are_refused():
    with pytest.raises(cg.ParameterError, match="no beats beside counts"):
        cg.RolloutStream(STARTER.counts(0), STARTER, beats="librosa")
