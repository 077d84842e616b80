"""The genres of a song's parts: takes and songs with planted style vectors, tempi and metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_takes, with_counts, with_vocabulary

from choreograph.choreography.constraints import Ban, make_constraints
from choreograph.choreography.genres import (
    LikelyGenre,
    genre_note,
    likely_genre,
    likely_genres,
    rhythm_losses,
    song_metre_at,
)
from choreograph.core.counts import NO_COUNTS, Counts, make_counts, numbers_in_bar
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import NetArrays
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.library.writing import write_repertoire
from choreograph.music.form import Sections
from choreograph.music.song_features import SongFeatures

GENRES = ("waltz", "rumba")
# So far apart that a second of one genre is worth 1.4 in it against the other, if clips do not vary.
STYLES = dict(zip(GENRES, 0.0532 * np.eye(2, 32, dtype=np.float32), strict=True))
ANYTHING = make_constraints()


def parts_of(features, repertoire, requested):
    return [(part.first_second, part.genre) for part in likely_genres(features, repertoire, requested)]


PERIODS_S = (0.5, 0.55, 0.6, 0.5)
N_SECONDS = 32


def takes_of(genres, metres=(4, 4, 4, 4)):
    takes = with_counts(synthetic_takes(periods_s=PERIODS_S, duration_s=12.0, genres=genres), PERIODS_S)
    return [
        replace(measured, take=replace(measured.take, counts=in_bars_of(measured.take.counts, metre)))
        for measured, metre in zip(takes, metres, strict=True)
    ]


def in_bars_of(counts: Counts, metre: int) -> Counts:
    numbers = numbers_in_bar(len(counts), metre) if metre else np.zeros(len(counts), int)
    return make_counts(counts.times_s, numbers, metre)


def planted(path, takes, *, nets=("style",), styles=STYLES) -> Repertoire:
    """Every clip has the style of its take's genre; nothing asks the style networks for more than a name."""
    contents = with_vocabulary(synthetic_contents(takes), takes)
    of_clip = [takes[index].take.credits.genre for index in contents.arrays["clips/take"]]
    unknown = np.full(32, 9.0, np.float32)
    arrays = {**contents.arrays, "clips/style": np.stack([styles.get(g, unknown) for g in of_clip])}
    arrays["clips/beat_count"] = np.zeros(len(of_clip), np.float32)
    more = {name: NetArrays({}, {"weight": np.zeros(1, np.float32)}) for name in nets}
    write_repertoire(path, replace(contents, arrays=arrays, nets={**contents.nets, **more}))
    return Repertoire.open(path)


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    return planted(tmp_path_factory.mktemp("planted") / "rep.h5", takes_of(GENRES))


def song(styles, *, counts: Counts = NO_COUNTS, borders_s=()) -> SongFeatures:
    """A song of one style vector a second; each says a genre, or how much of the first there is."""
    shares = [1.0 * (s == GENRES[0]) if isinstance(s, str) else s for s in styles]
    vectors = [share * STYLES[GENRES[0]] + (1 - share) * STYLES[GENRES[1]] for share in shares]
    n_seconds = len(vectors)
    bounds_s = np.array([0.0, *borders_s, n_seconds])
    return SongFeatures(
        "planted", float(n_seconds), counts, np.array(vectors, np.float32), np.zeros(n_seconds, np.float32),
        np.zeros((n_seconds, 80), np.float32), Sections(bounds_s, np.arange(len(bounds_s) - 1)),
        np.ones(n_seconds, np.float32), 0.0, float(n_seconds), np.full(n_seconds, 0.5, np.float32),
    )  # fmt: skip


def beats(metre: int, *, period_s: float = 0.5, confidence: float = 1.0) -> Counts:
    times_s = np.arange(0.0, N_SECONDS, period_s)
    return replace(make_counts(times_s, numbers_in_bar(len(times_s), metre), metre), confidence=confidence)


def with_pop(path, default) -> Repertoire:
    """A repertoire whose takes of one genre are pop, the genre of songs that are between others."""
    genres = tuple("pop" if genre == default else genre for genre in GENRES)
    return planted(path, takes_of(genres), styles=STYLES | {"pop": STYLES[default]})


@pytest.mark.parametrize(("default", "other"), [GENRES, GENRES[::-1]])
def test_a_song_between_genres_is_danced_as_pop(tmp_path, default, other):
    repertoire = with_pop(tmp_path / "rep.h5", default)
    between, sure = song([0.5] * N_SECONDS), song([other] * N_SECONDS)
    assert parts_of(between, repertoire, ANYTHING) == [(0, "pop")]
    assert likely_genre(between, repertoire, ANYTHING).genre == "pop"
    assert parts_of(sure, repertoire, ANYTHING) == [(0, other)]


def test_pop_is_danced_only_if_it_suits_nearly_as_well(tmp_path):
    repertoire = with_pop(tmp_path / "rep.h5", "waltz")
    assert parts_of(song([0.495] * N_SECONDS), repertoire, ANYTHING) == [(0, "pop")]
    assert parts_of(song([0.47] * N_SECONDS), repertoire, ANYTHING) == [(0, "rumba")]


@pytest.mark.parametrize("genre", GENRES)
def test_a_song_of_one_genre_has_one_part(repertoire, genre):
    features = song([genre] * N_SECONDS, borders_s=[9.0, 20.0])
    assert parts_of(features, repertoire, ANYTHING) == [(0, genre)]
    assert likely_genre(features, repertoire, ANYTHING).genre == genre


@pytest.mark.parametrize("genres", [GENRES, GENRES[::-1]])
def test_two_halves_of_different_genres_are_two_parts(repertoire, genres):
    first, second = genres
    # The style of a second describes the 4 s from it: it changes before the section does.
    features = song([first] * 13 + [second] * 19, borders_s=[16.0])
    assert parts_of(features, repertoire, ANYTHING) == [(0, first), (16, second)]


def test_a_genre_whose_takes_have_no_counts_is_not_likely_beside_others_with_counts(tmp_path):
    """Its takes would not be danced on the counts of the song, and those of other genres would."""
    takes = takes_of(GENRES, metres=(4, 4, 4, 4))
    uncounted = [
        replace(m, take=replace(m.take, counts=NO_COUNTS, figures=()))
        if m.take.credits.genre == "rumba"
        else m
        for m in takes
    ]
    features = song(["rumba"] * N_SECONDS)
    assert parts_of(features, planted(tmp_path / "one.h5", uncounted), ANYTHING) == [(0, "waltz")]
    none = [replace(m, take=replace(m.take, counts=NO_COUNTS, figures=())) for m in takes]
    assert parts_of(features, planted(tmp_path / "none.h5", none), ANYTHING) == [(0, "rumba")]


def test_a_passage_that_is_not_much_nearer_to_another_genre_changes_nothing(repertoire):
    doubtful = song(["waltz"] * 12 + [0.45] * 4 + ["waltz"] * 16, borders_s=[12.0, 16.0])
    assert parts_of(doubtful, repertoire, ANYTHING) == [(0, "waltz")]
    certain = song(["waltz"] * 10 + ["rumba"] * 14 + ["waltz"] * 8, borders_s=[10.0, 24.0])
    assert [g for _, g in parts_of(certain, repertoire, ANYTHING)] == ["waltz", "rumba", "waltz"]


def test_a_few_odd_seconds_do_not_decide_for_a_section(repertoire):
    """However far they are from the genre of the rest."""
    features = song(["waltz"] * 16 + ["waltz"] * 12 + [-9.0] * 4, borders_s=[16.0])
    assert parts_of(features, repertoire, ANYTHING) == [(0, "waltz")]


def test_a_genre_changes_only_where_the_style_does(repertoire):
    """Not inside a section, nor where the tempo changes alone, nor where a section is like the last."""
    half = ["waltz"] * 16
    other, similar = [0.1] * 16, [0.4] * 16
    for styles, borders_s, n_parts in (
        (half + other, [16.0], 2),
        (half + other, [], 1),
        (half + similar, [16.0], 1),
    ):
        assert len(parts_of(song(styles, borders_s=borders_s), repertoire, ANYTHING)) == n_parts
    times_s = np.r_[np.arange(0, 16, 0.5), np.arange(16, N_SECONDS, 0.53)]
    counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)
    features = song(half + similar, counts=counts, borders_s=[16.0])
    assert len(parts_of(features, repertoire, ANYTHING)) == 1


def test_no_genre_is_danced_at_a_tempo_of_none_of_its_takes(tmp_path):
    """The waltzes are danced at 120 BPM, the rumbas at 100 to 109."""
    takes = synthetic_takes(periods_s=(0.5, 0.55, 0.5, 0.6), duration_s=12.0, genres=GENRES)
    repertoire = planted(tmp_path / "rep.h5", with_counts(takes, (0.5, 0.55, 0.5, 0.6)))
    for bpm, genre, tempo in (
        (120, "waltz", ""),
        (123, "waltz", ""),
        (105, "rumba", ""),
        (97, "rumba", ""),
        (90, "rumba", "slower"),
        (140, "waltz", "faster"),
    ):
        features = song([0.0 if genre == "waltz" else 1.0] * N_SECONDS, counts=beats(4, period_s=60 / bpm))
        likely = likely_genre(features, repertoire, ANYTHING)
        assert (likely.genre, likely.tempo) == (genre, tempo)
        assert likely_genres(features, repertoire, ANYTHING) == [likely]
        assert ("than its takes" in genre_note([likely])) == bool(tempo)
    features = song(["waltz"] * N_SECONDS, counts=beats(4, period_s=60 / 117))  # both reach it
    assert likely_genre(features, repertoire, ANYTHING).genre == "waltz"


def test_of_genres_that_reach_the_tempo_the_one_that_often_dances_it_is_likelier(tmp_path):
    periods_s = (0.95, 0.5, 0.5, 0.52)  # the first genre is danced at 63 and 120 BPM, the other at 115 to 120
    takes = with_counts(synthetic_takes(periods_s=periods_s, duration_s=12.0, genres=GENRES), periods_s)
    counts = make_counts(np.arange(0.0, 32.0, 0.5), numbers_in_bar(64, 4), 4)
    losses = rhythm_losses(counts, N_SECONDS, planted(tmp_path / "rep.h5", takes), GENRES)
    assert (losses[:, 1] < losses[:, 0] - 0.1).all()


@pytest.mark.parametrize(("off_beat", "genre"), [(0.55, "house"), (0.35, "cha-cha"), (1.0, "house")])
def test_music_without_off_beats_is_no_house(tmp_path, off_beat, genre):
    styles = dict(zip(("house", "cha-cha"), STYLES.values(), strict=True))
    repertoire = planted(tmp_path / "rep.h5", takes_of(("house", "cha-cha")), styles=styles)
    features = replace(song(["waltz"] * N_SECONDS), off_beat=off_beat)  # the style of house
    assert likely_genre(features, repertoire, ANYTHING).genre == genre


def test_the_probability_falls_as_another_genre_comes_near(repertoire):
    sure, less, doubtful = (
        likely_genre(song([share] * N_SECONDS), repertoire, ANYTHING) for share in (1.0, 0.6, 0.5)
    )
    assert sure.genre == "waltz" and sure.runner_up == "rumba"
    assert sure.probability > 0.98 > less.probability > 0.5
    assert doubtful.probability == pytest.approx(0.5)


def test_banned_genres_are_not_likely(repertoire):
    features = song(["waltz"] * 16 + ["rumba"] * 16, borders_s=[16.0])
    for banned, other in (GENRES, GENRES[::-1]):
        requested = make_constraints(bans=[Ban(genre=banned)])
        assert parts_of(features, repertoire, requested) == [(0, other)]


def test_a_genre_of_the_songs_metre_is_likelier(tmp_path):
    takes = takes_of(GENRES, metres=(3, 4, 3, 4))
    waltzes_in_three = planted(tmp_path / "rep.h5", takes)
    doubtful = [0.5] * N_SECONDS
    for metre, genre in ((3, "waltz"), (4, "rumba"), (6, "waltz")):  # two bars of waltz on a bar of six
        features = song(doubtful, counts=beats(metre))
        assert parts_of(features, waltzes_in_three, ANYTHING) == [(0, genre)]
        # A metre that is certain outweighs any style: however near, a waltz would be off the bar.
        other = [0.0 if genre == "waltz" else 1.0] * N_SECONDS
        assert likely_genre(song(other, counts=beats(metre)), waltzes_in_three, ANYTHING).genre == genre
    # Style that is certain outweighs a metre that is not.
    features = song(["waltz"] * N_SECONDS, counts=beats(4, confidence=0.5))
    assert likely_genre(features, waltzes_in_three, ANYTHING).genre == "waltz"


def test_halves_that_differ_in_metre_alone_are_two_parts(tmp_path):
    repertoire = planted(tmp_path / "rep.h5", takes_of(GENRES, metres=(3, 4, 3, 4)))
    numbers = np.r_[numbers_in_bar(32, 4), numbers_in_bar(30, 3)]
    counts = make_counts(0.5 * np.arange(len(numbers)), numbers, 4)
    features = song([0.5] * N_SECONDS, counts=counts, borders_s=[16.0])
    assert parts_of(features, repertoire, ANYTHING) == [(0, "rumba"), (16, "waltz")]


def test_the_metre_of_each_second_is_that_of_its_bar():
    numbers = np.r_[numbers_in_bar(16, 4), numbers_in_bar(18, 3)]
    features = song(["waltz"] * 20, counts=make_counts(0.5 * np.arange(len(numbers)), numbers, 4))
    assert song_metre_at(features).tolist() == [4] * 8 + [3] * 12
    for counts in (NO_COUNTS, make_counts([0.5, 1.0], [0, 0], 0), make_counts([0.5, 1.0], [1, 2], 2)):
        assert not song_metre_at(song(["waltz"] * 5, counts=counts)).any()


@pytest.mark.parametrize("lacking", ["style", "genres"])
def test_without_style_or_genres_none_is_likely(tmp_path, lacking):
    plain = planted(tmp_path / "rep.h5", takes_of(GENRES if lacking == "style" else ("",)))
    features = song(["waltz"] * N_SECONDS)
    if lacking == "style":
        features = replace(features, style=np.zeros_like(features.style))
    assert parts_of(features, plain, ANYTHING) == [(0, ALL_GENRES)]
    assert likely_genre(features, plain, ANYTHING).genre == ALL_GENRES


def test_the_note_names_genres_runners_up_and_how_sure_they_are():
    note = genre_note([LikelyGenre(0, "waltz", 0.871, "rumba"), LikelyGenre(9, "rumba", 1.0, "")])
    assert "follows waltz (87 % sure, else rumba), then rumba (100 % sure)" in note
    assert "all genres" in genre_note([LikelyGenre(0, ALL_GENRES)])
