"""What a dance is made of: as requested, else of the likely genre of each part of the song."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_repertoire import (
    synthetic_contents,
    synthetic_repertoire,
    synthetic_takes,
    with_counts,
    with_vocabulary,
)

from choreograph.choreography.constraints import Ban, make_constraints
from choreograph.choreography.material import Material, choose_material, counts_on_bars, takes_of_signature
from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import NetArrays
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.library.writing import write_repertoire
from choreograph.music.form import Sections
from choreograph.music.song_features import SongFeatures

GENRES = ("waltz", "rumba")
STYLES = dict(zip(GENRES, np.eye(2, 32, dtype=np.float32), strict=True))
N_SECONDS = 24
PERIODS_S = (0.5, 0.6, 0.75, 0.5)


def takes():
    return synthetic_takes(periods_s=PERIODS_S, duration_s=12.0, genres=GENRES)


def counted_takes():
    return with_counts(takes(), PERIODS_S)


def in_three(measured):
    counts = measured.take.counts
    numbers = numbers_in_bar(len(counts), 3)
    return replace(
        measured, take=replace(measured.take, counts=make_counts(counts.times_s, numbers, 3), figures=())
    )


def planted(path, made):
    """Takes whose clips have the style of their genre."""
    contents = with_vocabulary(synthetic_contents(made), made)
    style = np.stack([STYLES[made[take].take.credits.genre] for take in contents.arrays["clips/take"]])
    nets = {**contents.nets, "style": NetArrays({}, {"weight": np.zeros(1, np.float32)})}
    write_repertoire(path, replace(contents, arrays={**contents.arrays, "clips/style": style}, nets=nets))
    return Repertoire.open(path)


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    """Two takes of each of two genres."""
    return planted(tmp_path_factory.mktemp("planted") / "rep.h5", takes())


def song(genres, counts=NO_COUNTS) -> SongFeatures:
    """A song whose halves are of these genres."""
    half = N_SECONDS // 2
    style = np.repeat([STYLES[genre] for genre in genres], half, axis=0)
    return SongFeatures(
        "planted", float(N_SECONDS), counts, style, np.zeros(N_SECONDS, np.float32),
        np.zeros((N_SECONDS, 80), np.float32), Sections(np.array([0.0, half, N_SECONDS]), np.arange(2)),
        np.ones(N_SECONDS, np.float32), 0.0, float(N_SECONDS), np.full(N_SECONDS, 0.5, np.float32),
    )  # fmt: skip


def material(repertoire, genres, **constraints) -> Material:
    return choose_material(song(genres), repertoire, make_constraints(**constraints))


def signature_of(repertoire, genre):
    return repertoire.vocabulary.signatures[repertoire.vocabulary.genre_index(genre)]


def genres_of(repertoire, takes):
    return {repertoire.takes[take].credits.genre for take in np.flatnonzero(takes)}


@pytest.mark.parametrize("genres", [("waltz", "rumba"), ("rumba", "waltz")])
def test_two_halves_have_two_goals(repertoire, genres):
    made = material(repertoire, genres)
    assert [goal.first_second for goal in made.goals] == [0, N_SECONDS // 2]
    assert made.parts_at(np.array([-1.0, 0.0, 11.9, 12.0, 30.0])).tolist() == [0, 0, 0, 1, 1]
    for goal, genre in zip(made.goals, genres, strict=True):
        assert np.array_equal(goal.goal.signature, signature_of(repertoire, genre))
        assert genres_of(repertoire, goal.takes) == {genre} and not goal.requested
    first, second = genres
    assert f"follows {first} (99 % sure, else {second}), then {second} (99 % sure" in made.notes[0]


def test_a_song_of_one_genre_has_one_goal(repertoire):
    made = material(repertoire, ("rumba", "rumba"))
    (goal,), (note,) = made.goals, made.notes
    assert goal.first_second == 0 and "rumba" in note and "then" not in note
    assert np.array_equal(goal.goal.signature, signature_of(repertoire, "rumba"))


def test_a_likely_genre_with_too_little_to_dance_leaves_the_others(tmp_path):
    few = planted(tmp_path / "rep.h5", takes()[:3])  # one rumba of 12 s for a song of 24 s
    (goal,) = material(few, ("rumba", "rumba")).goals
    assert goal.genre == "rumba" and goal.takes.all()
    (goal,) = material(few, ("rumba", "rumba"), genre="rumba").goals
    assert genres_of(few, goal.takes) == {"rumba"}


def test_what_is_requested_holds_for_the_whole_song(repertoire):
    made = material(repertoire, GENRES, genre="waltz")
    (goal,) = made.goals
    assert goal.first_second == 0 and made.notes == () and made.is_requested
    assert np.array_equal(goal.goal.signature, signature_of(repertoire, "waltz"))
    assert genres_of(repertoire, goal.takes) == {"waltz"}
    banned = np.array([take.credits.genre != "waltz" for take in repertoire.takes])
    assert np.array_equal(goal.takes_among(banned), banned)
    (goal,) = material(repertoire, GENRES, genre=ALL_GENRES).goals
    assert goal.takes.all()


def test_takes_suit_a_signature_by_the_motifs_they_have(repertoire):
    wanted = signature_of(repertoire, "rumba")
    made = material(repertoire, GENRES, signature=wanted)
    assert np.allclose(made.goals[0].goal.signature, wanted) and made.notes == ()
    word_take = np.repeat(np.arange(3), 4)
    words = SimpleNamespace(
        word_take=word_take, word_motif=np.array([0, 0, 1, 1, 0, 1, 1, 2, 2, 2, 2, 2]), n_motifs=3,
        words_of_take=lambda take: np.flatnonzero(word_take == take),
    )  # fmt: skip
    for shares, suits in (((0.5, 0.5, 0), [1, 1, 0]), ((0, 0, 1.0), [0, 1, 1]), ((0.3, 0.3, 0.4), [1, 1, 1])):
        assert takes_of_signature(words, np.array(shares), 3).tolist() == suits
    assert takes_of_signature(words, np.array([1.0, 0, 0]), 4).tolist() == [True, True, False, False]


def test_without_motifs_or_style_no_genre_is_likely(tmp_path):
    plain = synthetic_repertoire(tmp_path / "plain.h5", takes())
    worded = synthetic_repertoire(tmp_path / "worded.h5", takes(), vocabulary=True)
    assert material(plain, GENRES).goals == () and material(plain, GENRES).notes == ()
    features = song(GENRES)
    features = replace(features, style=np.zeros_like(features.style))
    (goal,) = choose_material(features, worded, make_constraints()).goals
    assert goal.genre == ALL_GENRES and goal.takes.all()
    (goal,) = choose_material(features, worded, make_constraints(motifs=[0, 1])).goals
    assert goal.genre is None


# Counts of one metre on the bars of another.


def beats(metre, n_bars=6, *, first=1, period_s=0.5):
    n_beats = n_bars * metre + 1
    return make_counts(period_s * np.arange(n_beats), numbers_in_bar(n_beats, metre, first=first), metre)


@pytest.mark.parametrize(
    ("song_metre", "metre", "bpm", "of_two_bars"),
    [
        (4, 3, 100.0, [0, 2, 3, 4, 6, 7]),  # slow, quick, quick
        (4, 3, 200.0, [0, 1, 1.5, 2, 3, 3.5]),  # two bars on one
        (3, 4, 160.0, [0, 1, 2, 2.5, 3, 4, 5, 5.5]),
        (3, 4, 75.0, [0, 2, 3, 5]),  # a bar of four on two of three
        (5, 4, 100.0, [0, 2, 3, 4, 5, 7, 8, 9]),
        (7, 4, 60.0, [0, 2, 4, 6, 7, 9, 11, 13]),
        (7, 4, 55.0, [0, 4, 7, 11]),  # the last count of a bar would be faster than double
        (4, 3, [90.0, 170.0, 170.0, 170.0], [0, 2, 3, 4, 6, 7]),  # the nearest takes decide
        (4, 3, [170.0, 170.0], [0, 1, 1.5, 2, 3, 3.5]),
        (6, 3, 120.0, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),  # every beat is a count
    ],
)
def test_every_bar_begins_on_a_downbeat_at_the_nearest_tempo(song_metre, metre, bpm, of_two_bars):
    counts = beats(song_metre)
    laid = counts_on_bars(counts, metre, bpm)
    assert laid.metre == metre
    assert laid.times_s[: len(of_two_bars)] == pytest.approx(0.5 * np.array(of_two_bars))
    assert np.isin(laid.downbeat_times_s, counts.times_s).all()
    numbers = [int(number) for number in laid.numbers]
    assert numbers == [k % metre + 1 for k in range(len(numbers))]


def test_counts_follow_beats_that_change_and_begin_on_the_first_downbeat():
    times_s = np.r_[0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0]
    counts = make_counts(times_s, [4, 1, 2, 3, 4, 1, 2, 3, 4], 4)
    laid = counts_on_bars(counts, 3, 80.0)
    assert laid.numbers.tolist() == [1, 2, 3, 1, 2, 3]
    assert laid.times_s.tolist() == [0.5, 1.5, 2.0, 3.0, 5.0, 6.0]


def test_counts_in_the_metre_and_songs_without_bars_stay():
    counts = beats(3)
    assert counts_on_bars(counts, 3, 120.0) is counts
    single = make_counts([0.0, 0.5], [1, 2], 4)
    assert counts_on_bars(single, 3, 120.0) is single


def test_a_requested_genre_of_another_metre_is_laid_on_the_bars_and_noted(tmp_path):
    three = [in_three(take) if take.take.credits.genre == "waltz" else take for take in counted_takes()]
    repertoire = planted(tmp_path / "rep.h5", three)
    features = song(GENRES, beats(4, 12))
    made = choose_material(features, repertoire, make_constraints(genre="waltz"))
    assert made.counts.metre == 3
    assert made.metre_notes == ("the bars of takes in 3 (waltz) are danced on bars in 4",)
    made = choose_material(features, repertoire, make_constraints(genre="rumba"))
    assert made.counts is features.counts and made.metre_notes == ()


def test_takes_are_laid_on_the_bars_if_none_that_may_be_danced_is_in_the_metre(tmp_path):
    three = [in_three(take) if take.take.credits.genre == "waltz" else take for take in counted_takes()]
    repertoire = planted(tmp_path / "rep.h5", three)
    four, five = song(GENRES, beats(4, 12)), song(GENRES, beats(5, 12))
    assert choose_material(four, repertoire, make_constraints()).counts is four.counts
    made = choose_material(five, repertoire, make_constraints())
    metre = made.counts.metre
    assert metre in (3, 4) and np.isin(made.counts.downbeat_times_s, five.counts.times_s).all()
    note = f"the bars of takes in {metre} (all that may be danced) are danced on bars in 5"
    assert made.metre_notes == (note,)
    others = [Ban(genre="rumba")]
    assert choose_material(four, repertoire, make_constraints(bans=others)).counts.metre == 3


@pytest.mark.parametrize(("metre", "bpm", "beats"), [(3, 90.0, 1.0), (3, 180.0, 1.0), (4, 120.0, 1.5)])
def test_both_halves_of_a_bar_of_six_begin_with_a_count(metre, bpm, beats):
    """Three counts on beats 1, 3 and 5 would be nearest to the tempo of a slow waltz."""
    eighths = make_counts(np.arange(60) / 3.0, numbers_in_bar(60, 6), 6)  # 6/8 at 60 dotted quarters a minute
    laid = counts_on_bars(eighths, metre, bpm)
    halves_s = eighths.times_s[eighths.numbers % 3 == 1]
    assert np.abs(halves_s[:, None] - laid.times_s).min(axis=1).max() < 1e-9
    assert np.isin(laid.downbeat_times_s, halves_s).all()
    assert np.diff(laid.times_s).mean() == pytest.approx(beats / 3.0, rel=0.05)
