"""Passages of takes: where they begin, which ones fit, how they are drawn, and when they return."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import choreograph as cg
from choreograph.choreography.constraints import make_constraints
from choreograph.choreography.engine import DanceRequest
from choreograph.choreography.material import Material, SectionGoal, takes_of_genre
from choreograph.choreography.mixer import engine as mixer
from choreograph.choreography.mixer.words import CandidatePool
from choreograph.choreography.motif_sequences import MotifGoal, motif_goal
from choreograph.choreography.passages import (
    DancedSoFar,
    TakeWords,
    draw_dance,
    draw_passage,
    drawn_words,
    first_slots,
    passage_slots,
)
from choreograph.choreography.rollout import engine as rollout
from choreograph.choreography.rollout.generation import ASKED_DISTANCE
from choreograph.choreography.slots import resolve
from choreograph.core.counts import UNKNOWN, make_counts, numbers_in_bar
from choreograph.core.numerics import chi_square_distance
from choreograph.evaluation.metrics.structure import n_gram_share
from choreograph.library.repertoire import starter_repertoire
from choreograph.library.vocabulary import find_motifs, make_vocabulary, signature
from choreograph.music.form import Form, Phrase, Sections
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures

COUNT_S = 0.5


def lengths(passages):
    return [passage.stop - passage.start for passage in passages]


def form_of(*labels: int, n_counts: int = 16) -> Form:
    """Phrases of equal length from 0 s on, with these labels."""
    length_s = n_counts * COUNT_S
    return Form(
        tuple(
            Phrase(i * length_s, (i + 1) * length_s, n_counts, 0, None if label == i else label)
            for i, label in enumerate(labels)
        )
    )


def in_bars(n_slots: int, metre: int, first: int = 1):
    return 100 * metre + (np.arange(n_slots) + first - 1) % metre + 1


@pytest.mark.parametrize(
    ("position", "phrase_counts", "found"),
    [
        (in_bars(32, 4), 8, [8, 8, 8, 8]),
        (in_bars(30, 4, first=3), 8, [2, 8, 8, 8, 4]),  # it begins with two counts before count 1
        (in_bars(24, 3), 8, [9, 9, 6]),
        (in_bars(20, 5), 8, [10, 10]),
        (in_bars(32, 4), 16, [16, 16]),
        (np.full(20, UNKNOWN), 8, [8, 8, 4]),
        (np.r_[np.full(3, UNKNOWN), in_bars(16, 4)], 8, [3, 8, 8]),
        (np.zeros(0, np.int64), 8, []),
    ],
)
def test_passages_begin_with_bars_and_fill_the_dance(position, phrase_counts, found):
    starts_s = np.arange(len(position)) * COUNT_S
    parts = np.zeros(len(position), np.int64)
    passages = passage_slots(position, parts, phrase_counts, starts_s, Form.empty())
    assert lengths(passages) == found
    assert [passage.start for passage in passages] == np.cumsum([0, *found])[: len(found)].tolist()


def test_passages_begin_with_phrases_and_parts_and_have_the_place_of_the_first_phrase():
    position, starts_s = in_bars(36, 4), np.arange(36) * COUNT_S
    form = form_of(0, 1, 0, n_counts=12)
    passages = passage_slots(position, np.zeros(36, np.int64), 8, starts_s, form)
    assert lengths(passages) == [8, 4] * 3
    places = [passage.place for passage in passages]
    assert [passage.ends for passage in passages] == [False, True] * 3
    assert places[:2] == places[4:] and not set(places[:2]) & set(places[2:4])
    parts = (np.arange(36) >= 20).astype(np.int64)
    assert 20 in [passage.start for passage in passage_slots(position, parts, 8, starts_s, form)]


def test_the_end_of_a_passage_is_a_passage_of_its_own_place():
    position, starts_s = in_bars(64, 4), np.arange(64) * COUNT_S
    passages = passage_slots(position, np.zeros(64, np.int64), 16, starts_s, form_of(0, 0, n_counts=32))
    head, end = passages[3].with_end(8)
    assert [(part.start, part.stop, part.ends) for part in (head, end)] == [(48, 56, False), (56, 64, True)]
    assert len({head.place, end.place, *(passage.place for passage in passages)}) == 4
    outside = passage_slots(position, np.zeros(64, np.int64), 16, starts_s, Form.empty())[0]
    assert [part.place for part in outside.with_end(8)] == [None, None]


# Two takes of waltz and two of rumba, all in bars of four. Every word of a genre has a motif of its own.
N_MOTIFS = 32


@pytest.fixture(scope="module")
def planted() -> TakeWords:
    word_motif = np.r_[0:16, 15:-1:-1, 16:32, 31:15:-1]
    motifs, _ = find_motifs(np.eye(N_MOTIFS), n_motifs=N_MOTIFS)
    start_s = np.tile(np.arange(16.0), 4)
    vocabulary = make_vocabulary(
        motifs, word_motif, np.repeat(np.arange(4), 16), start_s, start_s + 1.0,
        ["waltz", "waltz", "rumba", "rumba"],
    )  # fmt: skip
    return TakeWords(vocabulary, in_bars(64, 4))


def drawn(
    planted, seed=0, *, takes=(0, 1, 2, 3), position=None, allowed=None, signature=None, **danced_so_far
):
    position = in_bars(8, 4) if position is None else position
    shares = np.ones(N_MOTIFS) if signature is None else signature
    goal = MotifGoal(shares / shares.sum(), planted.vocabulary.transitions[-1])
    passage = draw_passage(
        planted, goal, DancedSoFar(**{"counts": np.zeros(N_MOTIFS), **danced_so_far}), slot_position=position,
        takes=np.isin(np.arange(4), takes), need="missing", rng=np.random.default_rng(seed),
        allowed=np.ones((len(position), N_MOTIFS), bool) if allowed is None else allowed,
    )  # fmt: skip
    return None if passage is None else tuple(passage.tolist())


def test_a_passage_is_a_run_of_words_of_one_take_on_the_counts_of_its_slots(planted):
    motif = planted.vocabulary.word_motif
    starts = [take + bar for take in (0, 16, 32, 48) for bar in (0, 4, 8)]
    runs = {tuple(motif[start : start + 8].tolist()) for start in starts}
    assert {drawn(planted, seed) for seed in range(150)} == runs
    assert {drawn(planted, seed, takes=(2,))[0] for seed in range(30)} == {16, 20, 24}
    from_count_3 = {drawn(planted, seed, takes=(0,), position=in_bars(2, 4, first=3)) for seed in range(60)}
    assert from_count_3 == {(2, 3), (6, 7), (10, 11), (14, 15)}
    assert drawn(planted, position=in_bars(6, 3)) is None  # no take is in three
    assert drawn(planted, position=in_bars(20, 4)) is None  # no take has as many words


def test_a_passage_has_the_motifs_that_are_allowed(planted):
    allowed = np.ones((8, N_MOTIFS), bool)
    allowed[5] = np.arange(N_MOTIFS) == 9  # a pin
    assert drawn(planted, allowed=allowed) == tuple(range(4, 12))
    allowed[:, 8] = False  # a ban
    assert drawn(planted, allowed=allowed) is None


def test_what_the_signature_lacks_is_drawn(planted):
    danced = np.zeros(N_MOTIFS)
    danced[:8] = 4.0  # the first half of the waltz
    found = [drawn(planted, seed, takes=(0,), counts=danced) for seed in range(40)]
    assert np.mean([run == tuple(range(8, 16)) for run in found]) > 0.9
    rumba = np.r_[np.zeros(16), np.ones(16)]
    assert all(drawn(planted, seed, signature=rumba)[0] >= 16 for seed in range(40))


def test_passages_are_joined_by_transitions_that_the_takes_have(planted):
    follows = [drawn(planted, seed, previous=3)[0] for seed in range(40)]
    assert np.mean([first == 4 for first in follows]) > 0.8
    leads = [drawn(planted, seed, following=28)[-1] for seed in range(40)]
    assert np.mean([last in (27, 29) for last in leads]) > 0.8


def test_a_passage_returns_even_if_the_signature_has_enough_of_its_motifs(planted):
    first, danced = np.arange(8, 16), np.full(N_MOTIFS, 9.0)
    found = {drawn(planted, seed, counts=danced, n_words=N_MOTIFS, returning=first) for seed in range(9)}
    assert found == {tuple(first)}


def test_a_passage_is_drawn_for_all_its_times(planted):
    """Half of the words shall be of the motifs 0 to 7, danced once: enough for one more, not four."""
    signature = np.r_[np.full(8, 2.0), np.zeros(8), np.ones(16)]
    danced = np.r_[np.ones(8), np.zeros(24)]
    for times, share in ((1, 0.0), (4, 1.0)):
        found = [drawn(planted, seed, counts=danced, signature=signature, times=times) for seed in range(40)]
        assert np.mean([sorted(run) == list(range(8)) for run in found]) == pytest.approx(share, abs=0.2)


def test_the_end_of_a_phrase_returns_while_half_of_its_motifs_are_lacking(planted):
    first = np.arange(8, 16)
    danced = np.zeros(N_MOTIFS)
    danced[first] = 1.0

    def returns(counts, n_words) -> bool:
        found = {
            drawn(planted, seed, counts=counts, n_words=n_words, returning=first, may_vary=True)
            for seed in range(9)
        }
        return found == {tuple(first)}

    assert returns(danced, 2 * N_MOTIFS) and not returns(2.0 * danced, 2 * N_MOTIFS)
    danced[first[:4]] = 2.0
    assert returns(danced, 2 * N_MOTIFS)
    danced[first[4]] = 2.0
    assert not returns(danced, 2 * N_MOTIFS)


# Whole dances of the built-in takes, without motion.


@pytest.fixture(scope="module")
def starter():
    return starter_repertoire()


def request_of(starter, genres, *, n_counts=128, metre=4, form=None, seed=0, phrase_counts=8, **constraints):
    """A request and its constraints: a song of equal parts of these genres."""
    counts = make_counts(np.arange(n_counts) * COUNT_S, numbers_in_bar(n_counts, metre), metre)
    duration_s = n_counts * COUNT_S
    n_seconds = int(duration_s)
    features = SongFeatures(
        "song", duration_s, counts, np.zeros((n_seconds, 32), np.float32), np.zeros(n_seconds, np.float32),
        np.zeros((n_seconds, 80), np.float32), Sections(np.zeros(0), np.zeros(0, np.int64)),
        np.ones(n_seconds, np.float32), 0.0, duration_s, np.zeros(n_seconds, np.float32),
        form=Form.empty() if form is None else form,
    )  # fmt: skip
    goals = tuple(
        SectionGoal(
            n_seconds * part // len(genres), motif_goal(starter.vocabulary, genre=genre),
            takes_of_genre(starter, genre), genre,
        )
        for part, genre in enumerate(genres)
    )  # fmt: skip
    material = Material(goals, counts)
    resolved = resolve(make_constraints(**constraints), starter, material, duration_s)
    config = cg.DanceConfig(engine="mixer", seed=seed, phrase_counts=phrase_counts)
    silence = Song(np.zeros(22050, np.float32), "song")
    return DanceRequest(silence, features, starter, config, resolved, material)


def motifs_of(request, *, pins=None, banned=(), **changes):
    rng = np.random.default_rng(request.config.seed)
    return draw_dance(request, request.constraints, rng=rng, pins=pins or {}, banned=banned, **changes)


def takes_of(starter):
    v = starter.vocabulary
    return [v.word_motif[v.words_of_take(take)] for take in range(len(starter.takes))]


@pytest.mark.parametrize(("genre", "metre"), [("house", 4), ("cha-cha", 4), ("waltz", 3)])
def test_long_sequences_are_those_of_takes_but_dances_are_not_copies(starter, genre, metre):
    """Chance is below 0.001."""
    shares = {
        phrase_counts: [
            [n_gram_share(motifs_of(request_of(
                starter, [genre], metre=metre, n_counts=120, seed=seed, phrase_counts=phrase_counts
            )), takes_of(starter), n) for n in (4, 8)]
            for seed in range(16)
        ]
        for phrase_counts in (1, 8)
    }  # fmt: skip
    four, eight = np.mean(shares[8], axis=0)
    assert four > 0.65 and 0.2 < eight < 0.6
    assert np.mean(shares[1], axis=0)[0] < 0.6 and np.mean(shares[1], axis=0)[1] < 0.2


@pytest.mark.parametrize("genre", ["house", "hip-hop"])
def test_passages_have_the_signature_of_their_genre(starter, genre):
    """They are nearer to it than motifs that are drawn at random by their shares."""
    wanted = motif_goal(starter.vocabulary, genre=genre).signature
    dances = [motifs_of(request_of(starter, [genre], seed=seed)) for seed in range(5)]
    away = [chi_square_distance(signature(motifs, len(wanted)), wanted) for motifs in dances]
    rng = np.random.default_rng(0)
    drawn = [rng.choice(len(wanted), len(dances[0]), p=wanted / wanted.sum()) for _ in range(100)]
    chance = [chi_square_distance(signature(motifs, len(wanted)), wanted) for motifs in drawn]
    assert np.mean(away) < 0.7 * np.mean(chance)


def test_of_several_draws_the_one_nearest_to_the_signature_is_danced(starter):
    wanted = motif_goal(starter.vocabulary, genre="house").signature

    def away(most_draws):
        requests = (request_of(starter, ["house"], n_counts=64, seed=seed) for seed in range(6))
        dances = [motifs_of(request, most_draws=most_draws) for request in requests]
        assert len({motifs.tobytes() for motifs in dances}) == 6  # another seed gives another dance
        return np.mean([chi_square_distance(signature(motifs, len(wanted)), wanted) for motifs in dances])

    assert away(8) < away(1)


def test_the_words_of_a_dance_are_those_of_its_passages(starter):
    v = starter.vocabulary
    request = request_of(starter, ["house", "swing"], n_counts=64)
    motifs = motifs_of(request)
    words = drawn_words(request, request.constraints, motifs)
    found = words >= 0
    assert found.mean() > 0.9
    np.testing.assert_array_equal(v.word_motif[words[found]], motifs[found])
    assert request.constraints.take_wanted[np.flatnonzero(found), v.word_take[words[found]]].all()
    assert np.mean(np.diff(words) == 1) > 0.8  # words of a passage follow one another in a take


def test_single_motifs_have_no_words(starter):
    request = request_of(starter, ["house"], n_counts=16, phrase_counts=1)
    assert (drawn_words(request, request.constraints, motifs_of(request)) == -1).all()


def test_the_rollout_is_conditioned_on_the_words_of_its_passages_and_on_medoids_of_requests(starter):
    request = request_of(starter, ["house"], n_counts=32, pins=[cg.MotifPin(4.1, motif=0)])
    motifs = motifs_of(request, pins=request.constraints.motifs)
    asked = rollout._asked(motifs, None, 0, request.constraints, request)
    medoids = starter.vocabulary.motifs.embeddings[motifs]
    np.testing.assert_array_equal(asked[list(request.constraints.motifs)], medoids[[8]])
    mean = starter.vocabulary.motifs.embeddings.mean(axis=0)
    words = drawn_words(request, request.constraints, motifs)
    words[list(request.constraints.motifs)] = -1
    of_words = mean + (asked - mean) / np.where(words >= 0, ASKED_DISTANCE, 1.0)[:, None]
    nearest = starter.vocabulary.motifs.nearest(of_words)
    assert np.mean(nearest == motifs) > 0.9 and np.mean((asked == medoids).all(axis=1)) < 0.5


def motifs_of_engine(engine, request):
    if engine == "rollout":
        return rollout._drawn_motifs(request, request.constraints, 0, {})
    pool = CandidatePool.of(request.constraints, request.repertoire, np.random.default_rng(0))
    return mixer._motifs(pool, request)


@pytest.mark.parametrize("engine", ["mixer", "rollout"])
@pytest.mark.parametrize("phrase_counts", [1, 8])
def test_every_part_of_a_song_is_drawn_from_the_takes_of_its_genre(starter, engine, phrase_counts):
    request = request_of(starter, ["house", "swing", "house"], n_counts=120, phrase_counts=phrase_counts)
    motifs = motifs_of_engine(engine, request)
    v = starter.vocabulary
    for part, genre in enumerate(["house", "swing", "house"]):
        of_genre = v.word_motif[takes_of_genre(starter, genre)[v.word_take]]
        assert np.isin(motifs[40 * part : 40 * (part + 1)], of_genre).all()
        away = {
            other: chi_square_distance(
                signature(motifs[40 * part : 40 * (part + 1)], v.n_motifs),
                motif_goal(v, genre=other).signature,
            )
            for other in ("house", "swing", "waltz")
        }
        assert min(away, key=away.get) == genre
    assert not np.array_equal(motifs[:40], motifs[80:])


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 99), st.dictionaries(st.integers(0, 31), st.integers(0, 99), max_size=6))
def test_pins_are_kept_and_bans_avoided(seed, pins):
    starter = starter_repertoire()
    banned = set(range(100, 160))
    request = request_of(starter, ["house"], n_counts=32, seed=seed)
    motifs = motifs_of(request, pins=pins, banned=banned)
    assert all(motifs[slot] == motif for slot, motif in pins.items()) and not set(motifs.tolist()) & banned


def test_a_phrase_returns_in_the_dance_and_others_differ(starter):
    form = form_of(0, 1, 0, 3, 0, 1, 6, 3)
    same = []
    for seed in range(5):
        phrases = motifs_of(request_of(starter, ["house"], form=form, seed=seed)).reshape(8, 16)
        returned = [np.mean(phrases[i] == phrases[j]) for i, j in ((0, 2), (0, 4), (1, 5), (3, 7))]
        others = [np.mean(phrases[i] == phrases[j]) for i, j in ((0, 1), (0, 3), (1, 3), (0, 6))]
        same.append((np.mean(returned), np.mean(others)))
    returned, others = np.mean(same, axis=0)
    assert returned > 0.7 > 0.1 > others  # the last 4 counts may vary


def test_long_passages_return_with_another_end(starter):
    """Of 16 counts, the first twelve are the same ones, and the last four vary if the signature has them."""
    form = form_of(0, 0, 0, 0, n_counts=16)
    kept, varied = 0, 0
    for seed in range(4):
        request = request_of(starter, ["house"], n_counts=64, form=form, seed=seed, phrase_counts=16)
        phrases = motifs_of(request).reshape(4, 16)
        kept += (phrases[1:, :12] == phrases[0, :12]).all(axis=1).sum()
        varied += (phrases[1:, 12:] != phrases[0, 12:]).any(axis=1).sum()
    assert kept == 12 and varied >= 6


def test_first_slots_are_those_of_the_first_phrase_where_the_motifs_return(starter):
    request = request_of(starter, ["house"], n_counts=48, form=form_of(0, 1, 0, n_counts=16))
    motifs = np.r_[np.arange(16), np.arange(16), np.arange(12), 20, 21, 22, 23]
    expected = np.r_[np.arange(32), np.arange(12), np.arange(44, 48)]
    np.testing.assert_array_equal(first_slots(request, request.constraints, motifs), expected)
    one_by_one = request_of(
        starter, ["house"], n_counts=48, form=form_of(0, 1, 0, n_counts=16), phrase_counts=1
    )
    np.testing.assert_array_equal(first_slots(one_by_one, request.constraints, motifs), np.arange(48))


def test_one_seed_draws_one_dance(starter):
    one, again, other = (motifs_of(request_of(starter, ["salsa"], seed=seed)) for seed in (3, 3, 4))
    assert np.array_equal(one, again) and not np.array_equal(one, other)
