"""The mixer, and constraints on it and on the graph: pins, bans, genres, signatures, re-creation."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from synthetic_repertoire import synthetic_repertoire

import choreograph as cg
from choreograph.choreography.constraints import make_constraints
from choreograph.choreography.material import Material, target_goal
from choreograph.choreography.slots import resolve
from choreograph.core.counts import make_counts, numbers_in_bar
from choreograph.core.errors import NoPathError, ParameterError, RepertoireError
from choreograph.evaluation.metrics import counts
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.library.vocabulary import segment_words
from choreograph.motion.body import body_pos_m
from choreograph.music.count_grids import coming_to_rest_s
from choreograph.plan.runs import plan_runs
from content.songs.known_songs import BENCHMARK_SONGS
from content.songs.synthesis.song import write_song

pytestmark = pytest.mark.slow

SCHEMA = Path(__file__).resolve().parents[2] / "data_schema" / "plan.schema.json"
ENGINE_NAMES = ("graph", "mixer")


@pytest.fixture(scope="module")
def with_motifs(tmp_path_factory):
    """The synthetic repertoire with its words and motifs."""
    return synthetic_repertoire(tmp_path_factory.mktemp("motifs") / "rep.h5", vocabulary=True)


@pytest.fixture(scope="module")
def mixed(with_motifs, song):
    return cg.dance(song, with_motifs, engine="mixer")


def shown_motifs(dance, repertoire) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (N + 1,) and motifs (N,) of what a rendered dance does not hold, cut on the song's beats."""
    words = segment_words(body_pos_m(dance.motion.resampled(30.0)), 30.0, np.array(dance.plan.music_beats_s))
    motifs = repertoire.vocabulary.motifs.nearest(repertoire.word_net().embed(words.body_pos_m))
    plan = dance.plan
    end_s = plan.duration_s if plan.closing_s is None else coming_to_rest_s(plan.opening_s, plan.closing_s)[0]
    danced = np.flatnonzero((words.start_s >= plan.opening_s) & (words.end_s <= end_s))
    part = slice(danced[0], danced[-1] + 1)
    return np.append(words.start_s[part], words.end_s[danced[-1]]), motifs[part]


def motif_at(dance, repertoire, at_s: float) -> int:
    bounds, motifs = shown_motifs(dance, repertoire)
    return int(motifs[np.searchsorted(bounds, at_s, side="right") - 1])


def takes_between(dance, start_s: float, end_s: float) -> set[str]:
    return {
        b.planned.take for b in dance.plan.blocks if b.start_s < end_s - 1e-6 and b.end_s > start_s + 1e-6
    }


def test_a_mixed_dance_fills_its_song_with_words_on_the_beats(mixed, with_motifs):
    plan = mixed.plan
    assert (plan.engine, plan.seconds) == ("mixer", ())
    assert abs(mixed.motion.duration_s - 12.4) <= 1 / 60
    assert plan.words[0].start_s == 0.0 and plan.words[-1].end_s == 12.4
    borders = {word.start_s for word in plan.words}
    assert all(min(abs(beat - b) for b in borders) < 1e-5 for beat in plan.music_beats_s if 0.3 < beat < 12)
    v = with_motifs.vocabulary
    known = {
        (with_motifs.takes[t].name, round(s, 6), round(e, 6), int(m))
        for t, s, e, m in zip(v.word_take, v.word_start_s, v.word_end_s, v.word_motif, strict=True)
    }
    for word in plan.words[1:-1]:
        assert (word.take, word.source_start_s, word.source_end_s, word.motif) in known
        assert word.credits.licence == "CC0"
    jsonschema.validate(json.loads(plan.to_json()), json.loads(SCHEMA.read_text(encoding="utf-8")))
    assert cg.Plan.from_json(plan.to_json()) == plan


def test_words_begin_on_the_count_that_the_music_is_at(tmp_path):
    """Built-in takes to a song with true beats and bars: chance is 1 in 4 for count 1."""
    rendered = BENCHMARK_SONGS[5].render()
    write_song(tmp_path / "cha-cha.wav", rendered)
    starter = cg.starter_repertoire()
    made = cg.dance(tmp_path / "cha-cha.wav", starter, engine="mixer", duration_s=20.0)
    danced = danced_counts(made.plan, starter)
    truth_s = rendered.beat_times_s
    scores = counts.evaluate(
        danced.times_s, danced.numbers, truth_s, numbers_in_bar(len(truth_s), rendered.beats_per_bar)
    )
    assert scores["counts_within"] > 0.95 and scores["downbeat_share"] > 0.85


def test_its_words_still_show_their_motifs_after_blending(mixed, with_motifs):
    bounds, motifs = shown_motifs(mixed, with_motifs)
    wanted = {round(word.start_s, 4): word.motif for word in mixed.plan.words}
    resolved = [wanted[round(start, 4)] for start in bounds[:-1] if round(start, 4) in wanted]
    assert len(resolved) >= len(motifs) - 1
    assert np.mean(np.array(resolved) == motifs[-len(resolved) :]) >= 0.9


def test_its_plan_renders_the_same_dance(mixed, with_motifs):
    again = cg.render(cg.Plan.from_json(mixed.plan.to_json()), with_motifs)
    assert np.array_equal(again.local_quat, mixed.motion.local_quat)
    words = list(mixed.plan.words)
    words[3] = replace(words[3], source_end_s=99.0)
    with pytest.raises(ParameterError, match="99"):
        cg.render(replace(mixed.plan, words=tuple(words)), with_motifs)


def test_seeds_decide_the_dance(mixed, with_motifs, song):
    assert cg.dance(song, with_motifs, engine="mixer").plan == mixed.plan
    other = cg.dance(song, with_motifs, engine="mixer", config=cg.DanceConfig(seed=5))
    assert [w.motif for w in other.plan.words] != [w.motif for w in mixed.plan.words]


@pytest.mark.parametrize("engine", ENGINE_NAMES)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_pinned_motifs_are_danced(with_motifs, song, engine, seed):
    rng = np.random.default_rng(seed)
    times = [1.7, 2.2, 5.1, 9.9]  # two of them next to each other
    pins = [cg.MotifPin(at_s, int(rng.integers(with_motifs.vocabulary.n_motifs))) for at_s in times]
    made = cg.dance(song, with_motifs, engine=engine, pins=pins)
    for pin in pins:
        assert motif_at(made, with_motifs, pin.at_s) == pin.motif
    pinned = [word for word in made.plan.words if word.pinned]
    if engine == "mixer":
        assert [word.motif for word in pinned] == [pin.motif for pin in pins]
    else:
        assert {word.motif for word in pinned} <= {pin.motif for pin in pins}
        assert len(made.plan.seconds) == 13
    again = cg.render(made.plan, with_motifs)
    assert np.array_equal(again.local_quat, made.motion.local_quat)


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_only_a_pinned_take_is_danced_where_it_is_pinned(with_motifs, song, engine):
    pin = cg.TakePin(4.0, 8.0, "take2")
    made = cg.dance(song, with_motifs, engine=engine, pins=[pin], bans=[cg.Ban(take="take1")])
    assert takes_between(made, 4.0, 8.0) == {"take2"}
    assert "take1" not in made.plan.takes_s()


def test_transitions_do_not_reach_into_a_pinned_take(with_motifs, song):
    made = cg.dance(song, with_motifs, pins=[cg.TakePin(4.0, 8.0, "take2")], bans=[cg.Ban(take="take1")])
    runs = plan_runs(made.plan)
    assert {run.take for run in runs if run.start_s < 8.0 - 1e-6 and run.stop_s > 4.0 + 1e-6} == {"take2"}
    with pytest.raises(ParameterError, match="share second 4"):
        cg.dance(song, with_motifs, pins=[cg.TakePin(2.0, 4.2, "take2"), cg.TakePin(4.8, 6.0, "take1")])


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_a_motif_within_a_pinned_take(with_motifs, song, engine):
    v = with_motifs.vocabulary
    motif = int(v.word_motif[v.words_of_take(1)[8]])
    pins = [cg.TakePin(3.0, 7.0, "take1"), cg.MotifPin(5.2, motif)]
    made = cg.dance(song, with_motifs, engine=engine, pins=pins)
    assert takes_between(made, 3.0, 7.0) == {"take1"}
    assert motif_at(made, with_motifs, 5.2) == motif


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_bans_are_never_danced(with_motifs, song, mixed, engine):
    made = cg.dance(song, with_motifs, engine=engine, bans=[cg.Ban(genre="a")])
    assert "take0" not in made.plan.takes_s()
    free = mixed if engine == "mixer" else cg.dance(song, with_motifs, engine=engine)
    _, motifs = shown_motifs(free, with_motifs)
    banned = int(np.bincount(motifs).argmax())
    made = cg.dance(song, with_motifs, engine=engine, bans=[cg.Ban(motif=banned)])
    assert banned not in shown_motifs(made, with_motifs)[1]
    assert banned not in {word.motif for word in made.plan.words}


def test_a_genre_and_a_signature_are_followed(with_motifs, song):
    v = with_motifs.vocabulary
    for genre in ("b", "c"):
        made = cg.dance(song, with_motifs, engine="mixer", genre=genre)
        shares = v.signatures[v.genre_index(genre)]
        assert all(shares[word.motif] > 0 for word in made.plan.words)
    only = np.zeros(v.n_motifs)
    only[2] = 1.0
    made = cg.dance(song, with_motifs, engine="mixer", signature=only)
    motifs = [word.motif for word in made.plan.words]
    assert motifs.count(2) > len(motifs) / 3
    np.testing.assert_array_equal(cg.signature_of("b", with_motifs), v.signatures[1])


def test_a_dance_is_recreated_to_another_song(with_motifs, song):
    motifs = cg.motifs_of("take2", with_motifs)
    assert list(motifs) == with_motifs.vocabulary.word_motif[with_motifs.vocabulary.words_of_take(2)].tolist()
    made = cg.dance(song, with_motifs, motifs=motifs)  # a sequence asks for the mixer
    n_words = len(made.plan.words)
    assert made.plan.engine == "mixer"
    assert [word.motif for word in made.plan.words] == list(motifs[:n_words])
    assert any(f"{len(motifs)} motifs were given" in note for note in made.notes)
    few = cg.dance(song, with_motifs, motifs=motifs[:4])
    assert [word.motif for word in few.plan.words[:4]] == list(motifs[:4])
    assert any("the rest is drawn" in note for note in few.notes)


@pytest.mark.slow
def test_a_motion_file_is_recreated(with_motifs, mixed, song, tmp_path):
    mixed.save(tmp_path / "old.bvh")
    (tmp_path / "old.wav").write_bytes(Path(song).read_bytes())
    motifs = np.array(cg.motifs_of(tmp_path / "old.bvh", with_motifs))
    _, shown = shown_motifs(mixed, with_motifs)
    n = len(shown)
    same = max(np.mean(motifs[i : i + n] == shown) for i in range(len(motifs) - n + 1))
    assert same > 0.8
    with pytest.raises(ParameterError, match="nobody"):
        cg.motifs_of("nobody", with_motifs)


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_variations_differ(with_motifs, song, engine):
    made = cg.vary(song, with_motifs, 3, engine=engine, duration_s=6.0)
    assert len(made) == 3
    for i, one in enumerate(made):
        for other in made[:i]:
            # Synthetic takes repeat themselves: what differs is what of which take is danced.
            sources = [[(b.planned.take, b.source_start_s) for b in d.plan.blocks] for d in (one, other)]
            assert sum(a != b for a, b in zip(*sources, strict=False)) >= len(sources[0]) / 2
    with pytest.raises(ParameterError, match="got 0"):
        cg.vary(song, with_motifs, 0)


@pytest.mark.parametrize(
    ("constraints", "message"),
    [
        ({"pins": [cg.MotifPin(1.0, 99)]}, "motif 99"),
        ({"pins": [cg.MotifPin(13.0, 1)]}, "12.4 s"),
        ({"pins": [cg.MotifPin(1.1, 1), cg.MotifPin(1.2, 2)]}, "one beat"),
        ({"pins": [cg.MotifPin(1.1, 1)], "bans": [cg.Ban(motif=1)]}, "banned"),
        ({"pins": [cg.TakePin(2, 20, "take0")]}, "12.4 s"),
        ({"pins": [cg.TakePin(5, 2, "take0")]}, "before its end"),
        ({"pins": [cg.TakePin(2, 5, "nobody")]}, "nobody"),
        ({"pins": [cg.TakePin(2, 5, "take0"), cg.TakePin(4, 6, "take1")]}, "overlap"),
        ({"pins": [cg.TakePin(2, 5, "take0")], "bans": [cg.Ban(genre="a")]}, "banned"),
        ({"bans": [cg.Ban(take="nobody")]}, "nobody"),
        ({"bans": [cg.Ban(genre="polka")]}, "polka"),
        ({"bans": [cg.Ban(motif=99)]}, "motif 99"),
        ({"bans": [cg.Ban(genre=g) for g in "abc"]}, "every take"),
        ({"bans": ["take0"]}, "as Ban"),
        ({"pins": ["1=motif:2"]}, "as MotifPin"),
        ({"genre": "polka"}, "polka"),
        ({"signature": [0.5, 0.6]}, "sum to 1"),
        ({"signature": [0.5, 0.5]}, "another repertoire"),
        ({"motifs": [cg.MotifPin(1.0, 1), 2]}, "all have times"),
        ({"motifs": [1.5]}, "as whole numbers"),
        ({"motifs": [99]}, "motif 99"),
    ],
)
def test_constraints_that_cannot_be_met(with_motifs, constraints, message):
    def check() -> None:
        wanted = make_constraints(**constraints)
        counts = make_counts(np.arange(0.0, 12.6, 0.5), np.zeros(26), 0)
        resolve(wanted, with_motifs, Material((), counts), 12.4)
        target_goal(wanted, with_motifs)

    with pytest.raises(ParameterError, match=message) as raised:
        check()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_every_engine_refuses_constraints_that_cannot_be_met(with_motifs, song, engine):
    for constraints in (
        {"pins": [cg.MotifPin(13.0, 1)]},
        {"signature": [0.5, 0.5]},
        {"bans": [cg.Ban(motif=99)]},
    ):
        with pytest.raises(ParameterError):
            cg.dance(song, with_motifs, engine=engine, **constraints)


def test_arguments_of_other_engines_are_refused(with_motifs, song):
    with pytest.raises(ParameterError, match="graph engine"):
        cg.dance(song, with_motifs, engine="graph", motifs=[1, 2, 3])
    with pytest.raises(ParameterError, match="your own costs with the mixer engine, got 'genre'"):
        cg.dance(song, with_motifs, engine="mixer", weights={"genre": 1.0})
    with pytest.raises(ParameterError, match="motion-graph"):
        cg.dance(song, with_motifs, engine="mixer", config=cg.DanceConfig(planner="motion-graph"))
    with pytest.raises(ParameterError, match="steam"):
        cg.dance(song, with_motifs, engine="steam")
    with pytest.raises(ParameterError, match="one take, genre, performer, licence or motif"):
        cg.Ban()


def test_a_ban_that_leaves_no_path_is_named(with_motifs, song):
    motifs = [cg.Ban(motif=motif) for motif in range(with_motifs.vocabulary.n_motifs - 1)]
    with pytest.raises(NoPathError, match="--ban motif:0"):
        cg.dance(song, with_motifs, bans=motifs)


@pytest.mark.parametrize("constraints", [{"engine": "mixer"}, {"engine": "rollout"}, {"genre": "a"}])
def test_a_repertoire_without_motifs(repertoire, song, constraints):
    with pytest.raises(RepertoireError, match="build-db"):
        cg.dance(song, repertoire, **constraints)


def test_takes_can_be_pinned_and_banned_without_motifs(repertoire, song):
    made = cg.dance(song, repertoire, pins=[cg.TakePin(2, 5, "take1")], bans=[cg.Ban(take="take0")])
    assert takes_between(made, 2, 5) == {"take1"}
    assert "take0" not in made.plan.takes_s()
