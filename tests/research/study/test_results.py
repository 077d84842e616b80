"""Study results: the synthetic favourite wins, intervals cover, foreign and damaged files are refused."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from synthetic_studies import VARIANTS, choose_all, rate_all, rating, read_key, small_study, write_rating

from choreograph.core.errors import FormatError
from research.study.results import _Bootstrap, read_study
from research.study.writing import QUESTIONS

SCHEMA = json.loads(
    (Path(__file__).resolve().parents[3] / "data_schema" / "rating.schema.json").read_text(encoding="utf-8")
)
BEST, MIDDLE, WORST = VARIANTS
MEANS = {BEST: 3.6, MIDDLE: 2.4, WORST: 1.4}
IDS = [question.id for question in QUESTIONS]


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    return small_study(tmp_path_factory.mktemp("study"), n_songs=5)


@pytest.fixture
def study(written, tmp_path) -> Path:
    """A study without ratings."""
    (tmp_path / "key.json").write_bytes((written / "key.json").read_bytes())
    return tmp_path


def answers_for(key: dict, points: dict[str, int], questions=IDS) -> dict:
    return {d["dance"]: dict.fromkeys(questions, points[d["variant"]]) for d in key["dances"]}


def test_the_synthetic_favourite_wins_and_intervals_contain_the_truth(study):
    rate_all(study, MEANS, n_raters=12)
    for path in study.glob("rating-*.json"):
        jsonschema.validate(json.loads(path.read_text(encoding="utf-8")), SCHEMA)
    results = read_study(study)
    assert (results.n_raters, results.n_songs) == (12, 5)
    for question in IDS:
        scores = [score for score in results.scores if score.question == question]
        assert [score.variant for score in scores] == [BEST, MIDDLE, WORST]
        assert all(score.n_ratings == 60 for score in scores)
        assert all(score.low < MEANS[score.variant] < score.high for score in scores)
        pairs = {(d.variant, d.other): d for d in results.differences if d.question == question}
        assert set(pairs) == {(BEST, MIDDLE), (BEST, WORST), (MIDDLE, WORST)}
        assert all(difference.is_clear and difference.mean > 0 for difference in pairs.values())


def test_means_and_counts_by_hand(study):
    key = read_key(study)
    write_rating(study, rating(key, answers_for(key, {BEST: 5, MIDDLE: 3, WORST: 0}), rater=1))
    partly = {d["dance"]: {"style": 2} for d in key["dances"] if d["variant"] == BEST}
    write_rating(study, rating(key, partly, rater=2))
    results = read_study(study)
    score = {(s.variant, s.question): s for s in results.scores}
    assert (score[BEST, "style"].mean, score[BEST, "style"].n_ratings) == (3.5, 10)
    assert (score[BEST, "rhythm"].mean, score[BEST, "rhythm"].n_ratings) == (5.0, 5)
    difference = next(d for d in results.differences if d.question == "style" and d.other == MIDDLE)
    assert (difference.mean, difference.n_pairs) == (2.0, 5)  # from the one rater who rated both
    assert json.loads(json.dumps(results.to_dict()))["n_raters"] == 2


def test_generosity_cancels_out_of_differences(study):
    """Raters differ, but all see one point between two variants: a clear difference of unclear means."""
    key = read_key(study)
    for rater, base in enumerate((0, 1, 2, 3, 4, 0, 4), start=1):
        write_rating(
            study, rating(key, answers_for(key, {BEST: base + 1, MIDDLE: base, WORST: 0}), rater=rater)
        )
    results = read_study(study)
    difference = next(d for d in results.differences if (d.variant, d.other) == (BEST, MIDDLE))
    assert (difference.mean, difference.low, difference.high) == (1.0, 1.0, 1.0)
    score = next(s for s in results.scores if s.variant == BEST)
    assert score.high - score.low > 1.5


def test_equal_variants_seldom_differ_clearly(study):
    clear = 0
    for seed in range(8):
        rate_all(study, dict.fromkeys(VARIANTS, 2.5), n_raters=8, seed=seed)
        clear += sum(difference.is_clear for difference in read_study(study).differences)
    assert clear <= 0.1 * 8 * 12


@pytest.mark.parametrize(("n_raters", "n_songs"), [(20, 10), (8, 6)])
def test_intervals_have_their_nominal_coverage(n_raters, n_songs):
    rng = np.random.default_rng(0)
    bootstrap = _Bootstrap.from_rng(rng, n_raters, np.arange(n_songs))
    covered = 0
    for _ in range(200):
        noise = rng.normal(0, 0.7, (n_raters, n_songs))
        points = 3.0 + rng.normal(0, 0.5, (n_raters, 1)) + rng.normal(0, 0.4, n_songs) + noise
        points[rng.random(points.shape) < 0.2] = np.nan
        _, low, high = bootstrap.interval(points)
        covered += low < 3.0 < high
    assert 0.87 <= covered / 200 <= 0.99


def test_one_rating_has_no_interval(study):
    key = read_key(study)
    write_rating(study, rating(key, {key["dances"][0]["dance"]: {"style": 4}}))
    (score,) = read_study(study).scores
    assert (score.mean, score.low, score.high, score.n_ratings) == (4.0, None, None, 1)
    assert read_study(study).differences == ()


def test_the_last_save_of_a_rater_counts(study):
    key = read_key(study)
    first, last = (answers_for(key, dict.fromkeys(VARIANTS, points)) for points in (1, 4))
    write_rating(study, rating(key, last, save=2), "rating (1).json")
    write_rating(study, rating(key, first, save=1))
    results = read_study(study)
    assert results.n_raters == 1 and all(score.mean == 4.0 for score in results.scores)
    write_rating(study, rating(key, last, save=2), "the same once more.json")
    assert read_study(study) == results
    write_rating(study, rating(key, first, save=2), "edited.json")
    with pytest.raises(FormatError, match="edited"):
        read_study(study)


BROKEN_RATINGS = {
    "truncated": lambda key: json.dumps(rating(key, {}))[:40],
    "not JSON": lambda key: "<html>",
    "a list": lambda key: [],
    "foreign": lambda key: {"format": "choreograph-plan", "version": 1},
    "of a later version": lambda key: rating(key, {}, version=2),
    "without a key": lambda key: {k: v for k, v in rating(key, {}).items() if k != "save"},
    "with another key": lambda key: rating(key, {}, more=1),
    "of another study": lambda key: rating(key, {}, study="0" * 16),
    "with a malformed rater_id": lambda key: rating(key, {}, rater_id="../x"),
    "with save 0": lambda key: rating(key, {}, save=0),
    "with a boolean save": lambda key: rating(key, {}, save=True),
    "with a name that is no string": lambda key: rating(key, {}, rater_name=None),
    "with a list of answers": lambda key: rating(key, []),
    "of an unknown dance": lambda key: rating(key, {"99": {"style": 3}}),
    "with points for a dance": lambda key: rating(key, {key["dances"][0]["dance"]: 3}),
    "of an unknown question": lambda key: rating(key, {key["dances"][0]["dance"]: {"looks": 3}}),
    "with too many points": lambda key: rating(key, {key["dances"][0]["dance"]: {"style": 6}}),
    "with fractional points": lambda key: rating(key, {key["dances"][0]["dance"]: {"style": 2.5}}),
    "with null points": lambda key: rating(key, {key["dances"][0]["dance"]: {"style": None}}),
    "without an answer": lambda key: rating(key, {}),
}


@pytest.mark.parametrize("broken", BROKEN_RATINGS)
def test_a_broken_rating_is_refused_in_a_line(study, broken):
    write_rating(study, BROKEN_RATINGS[broken](read_key(study)), "given back.json")
    with pytest.raises(FormatError) as refused:
        read_study(study)
    assert "\n" not in str(refused.value)


@pytest.fixture(scope="module")
def compared(tmp_path_factory) -> Path:
    return small_study(tmp_path_factory.mktemp("pairs"), n_songs=6, ask="both", sound=False)


@pytest.fixture
def pairs(compared, tmp_path) -> Path:
    """A study of ratings and pairs, without answers."""
    (tmp_path / "key.json").write_bytes((compared / "key.json").read_bytes())
    return tmp_path


def test_a_planted_preference_is_found_and_its_interval_covers_it(pairs):
    choose_all(pairs, {BEST: 9.0, MIDDLE: 3.0, WORST: 1.0}, n_raters=20)
    for path in pairs.glob("rating-*.json"):
        jsonschema.validate(json.loads(path.read_text(encoding="utf-8")), SCHEMA)
    results = read_study(pairs)
    assert results.scores == () and results.n_raters == 20
    found = {(p.variant, p.other): p for p in results.preferences if p.question == "computer"}
    planted = {(BEST, MIDDLE): 0.75, (BEST, WORST): 0.9, (MIDDLE, WORST): 0.75}
    assert set(found) == set(planted)
    for pair, share in planted.items():
        assert found[pair].low < share < found[pair].high and found[pair].is_clear
        assert found[pair].n_answers == 20 * 6
    assert sum(p.n_answers for p in results.preferences if p.question == "genre") == 20 * 3  # one song's


def test_choices_by_chance_are_seldom_clear(pairs):
    clear = 0
    for seed in range(8):
        choose_all(pairs, dict.fromkeys(VARIANTS, 1.0), n_raters=12, seed=seed)
        of_computer = [p for p in read_study(pairs).preferences if p.question == "computer"]
        clear += sum(p.is_clear for p in of_computer)
        assert all(0.5 <= p.share < 0.75 for p in of_computer)
    assert clear <= 0.15 * 8 * 3


def test_a_preference_by_hand(pairs):
    key = read_key(pairs)
    variant = {dance["dance"]: dance["variant"] for dance in key["dances"]}
    of_two = [p for p in key["pairs"] if {variant[d] for d in p["dances"]} == {BEST, WORST}]
    worst = [next(d for d in p["dances"] if variant[d] == WORST) for p in of_two]
    answers = {p["pair"]: {"computer": d} for p, d in zip(of_two[:3], worst, strict=False)}
    best = next(d for d in of_two[3]["dances"] if variant[d] == BEST)
    write_rating(pairs, rating(key, answers | {of_two[3]["pair"]: {"computer": best}}))
    (preference,) = read_study(pairs).preferences
    assert (preference.variant, preference.other) == (WORST, BEST)
    assert (preference.share, preference.n_answers) == (0.75, 4)


def test_other_versions_are_refused_with_the_command_that_makes_a_study_anew(study):
    key = read_key(study)
    write_rating(study, rating(key, {}, version=2))
    with pytest.raises(
        FormatError, match=r"version 1, got version 2: rate .* `python -m research.study write`"
    ):
        read_study(study)
    write_rating(study, key | {"version": 2}, "key.json")
    with pytest.raises(
        FormatError, match=r"version 1, got version 2: make .* `python -m research.study write`"
    ):
        read_study(study)


BROKEN_PAIRS = {
    "a dance of another pair": lambda key: {"p1": {"computer": "zebra"}},
    "points": lambda key: {"p1": {"computer": 3}},
    "a list": lambda key: {"p1": {"computer": key["pairs"][0]["dances"]}},
    "an unknown question": lambda key: {"p1": {"looks": key["pairs"][0]["dances"][0]}},
    "an unknown pair": lambda key: {"p99": {"computer": key["pairs"][0]["dances"][0]}},
    "a dance for points": lambda key: {key["dances"][0]["dance"]: {"variation": "1"}},
}


@pytest.mark.parametrize("broken", BROKEN_PAIRS)
def test_a_broken_choice_is_refused_in_a_line(pairs, broken):
    key = read_key(pairs)
    write_rating(pairs, rating(key, BROKEN_PAIRS[broken](key)))
    with pytest.raises(FormatError) as refused:
        read_study(pairs)
    assert "\n" not in str(refused.value)


def changed_pair(key: dict, **changed) -> dict:
    return {**key, "pairs": [{**key["pairs"][0], **changed}, *key["pairs"][1:]]}


def twice(key: dict) -> dict:
    return {**key, "dances": [*key["dances"], key["dances"][0]]}


BROKEN_KEYS = {
    "truncated": lambda key: json.dumps(key)[:50],
    "foreign": lambda key: {"format": "choreograph-rating"},
    "without dances": lambda key: {**key, "dances": []},
    "with malformed dances": lambda key: {**key, "dances": [3]},
    "of an unknown question": lambda key: {**key, "questions": ["looks"]},
    "without a study": lambda key: {**key, "study": None},
    "with a dance twice": twice,
    "without questions": lambda key: {**key, "questions": [], "pairs": []},
    "with pairs that are no list": lambda key: {**key, "pairs": 3},
    "with malformed pairs": lambda key: {**key, "pairs": [3]},
    "with a pair of one dance": lambda key: changed_pair(key, dances=key["pairs"][0]["dances"][:1]),
    "with a pair of itself": lambda key: changed_pair(key, dances=[key["dances"][0]["dance"]] * 2),
    "with an unknown question about a pair": lambda key: changed_pair(key, questions=["looks"]),
    "with a pair twice": lambda key: {**key, "pairs": [*key["pairs"], key["pairs"][0]]},
    "with a pair named as a dance": lambda key: changed_pair(key, pair=key["dances"][0]["dance"]),
}


@pytest.mark.parametrize("broken", BROKEN_KEYS)
def test_a_broken_key_is_refused_in_a_line(pairs, broken):
    key = read_key(pairs)
    write_rating(pairs, rating(key, answers_for(key, MEANS_WHOLE, ["variation"])))
    write_rating(pairs, BROKEN_KEYS[broken](key), "key.json")
    with pytest.raises(FormatError) as refused:
        read_study(pairs)
    assert "\n" not in str(refused.value)


MEANS_WHOLE = {BEST: 4, MIDDLE: 2, WORST: 1}


def test_a_folder_without_key_or_ratings(study, tmp_path):
    with pytest.raises(FormatError, match="answers"):
        read_study(study)
    (study / "key.json").unlink()
    with pytest.raises(FormatError, match="key of a rating study"):
        read_study(study)
