"""A small evaluation from end to end: synthetic takes, songs of clicks, every table and its contents."""

import json
import math
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from synthetic_motions import stepping, swaying
from synthetic_repertoire import synthetic_repertoire, synthetic_takes, with_counts, write_clicks

from choreograph.core.counts import NO_COUNTS, Counts, numbers_in_bar
from choreograph.core.errors import FormatError, ParameterError
from choreograph.evaluation.dance_scores import evaluate
from choreograph.evaluation.plan_scores import (
    CountedDance,
    DancedMotifs,
    MotifScorer,
    plan_scores,
    transition_scores,
    transition_times_s,
)
from choreograph.evaluation.report import write_report
from choreograph.evaluation.results import FAMILIES, METRICS, number_text, tables, to_json
from choreograph.evaluation.run import (
    VARIANTS,
    EvaluationConfig,
    dance_variant,
    evaluate_variants,
    variants_named,
)
from choreograph.evaluation.scores import energy_scores
from choreograph.evaluation.songs import beats_of, find_songs, read_experts, song_music
from choreograph.formats.register import save_motion
from choreograph.library.repertoire import Repertoire
from choreograph.music.bars import tempo_bpm
from choreograph.music.form import Sections
from choreograph.music.song import load_song
from research.spliced_songs import genre_by_second
from research.variants import VARIANTS as RESEARCH_VARIANTS

pytestmark = pytest.mark.slow

SCHEMA = json.loads(
    (Path(__file__).resolve().parents[2] / "data_schema" / "evaluation.schema.json").read_text(
        encoding="utf-8"
    )
)

NO_SECTIONS = Sections(np.zeros(0), np.zeros(0, np.int64))


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory) -> Repertoire:
    takes = with_counts(synthetic_takes())
    return synthetic_repertoire(tmp_path_factory.mktemp("db") / "rep.h5", takes, vocabulary=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Two songs with a real dance that rests on every beat, and a third one without."""
    folder = tmp_path_factory.mktemp("songs")
    for name, period_s, seed in (("slow", 0.6, 5), ("quick", 0.5, 6)):
        save_motion(folder / f"{name}.bvh", stepping(24 * 30, period_s=period_s, seed=seed))
        write_clicks(folder / f"{name}.wav", duration_s=24.0, bpm=60 / period_s)
    write_clicks(folder / "alone.wav", duration_s=9.0, bpm=100)
    (folder / "manifest.csv").write_text("name,genre\nslow,b\nquick,a\n")
    return folder


@pytest.fixture(scope="module")
def evaluation(repertoire, folder):
    songs = find_songs(folder, duration_s=21.0)
    return evaluate_variants(repertoire, songs, EvaluationConfig(variants_named(["ours", "random"]), seeds=2))


def cells(evaluation, metric: str) -> dict:
    table = next(t for t in tables(evaluation) if t.family == METRICS[metric].family)
    row = next(row for row in table.rows if row.metric.name == metric)
    return dict(zip(table.columns, row.cells, strict=True))


def test_all_dances_are_measured_by_catalogued_metrics(evaluation):
    kinds = [(d.variant, d.song, d.seed) for d in evaluation.dances if d.variant != "takes"]
    wanted = [(v, s, i) for v in ("ours", "random") for s in ("quick", "slow", "alone") for i in (0, 1)]
    assert sorted(kinds) == sorted([*wanted, ("real", "slow", 0), ("real", "quick", 0)])
    for dance in (*evaluation.dances, *evaluation.sets):
        assert set(dance.scores.values) <= set(METRICS)
        assert set(dance.scores.chance) <= set(dance.scores.values)
    families = [table.family for table in tables(evaluation)]
    assert set(families) == set(FAMILIES) - {"energy"}  # songs of one loudness


def test_huge_numbers_stay_readable():
    assert [number_text(v, 1) for v in (0.25, -3.0, 12345.6, 4.88e20)] == [
        "0.2",
        "-3.0",
        "12345.6",
        "4.9e+20",
    ]


def test_synthetic_beats_separate_ours_from_chance(evaluation):
    f_score = cells(evaluation, "f_score")
    assert f_score["ours"].n == f_score["random"].n == 6
    # Synthetic takes sway over feet that slide. At joins, feet are held, which adds motion beats.
    assert f_score["ours"].mean > 0.85
    assert f_score["real"].mean > 0.9  # the takes rest on every click
    assert f_score["ours"].chance < 0.5 < f_score["ours"].mean
    assert f_score["random"].mean < f_score["ours"].mean


def test_front_tempi_and_seeds_have_chance_beside_them(evaluation):
    away = cells(evaluation, "turned_away_share")
    assert set(away) == {"ours", "random", "real"}
    assert away["ours"].chance == pytest.approx(4 / 9)
    assert away["real"].mean == 0.0  # by the direction that it faces most
    assert 0 <= cells(evaluation, "outside_tempi")["ours"].mean <= 1
    distance = cells(evaluation, "seed_distance_m")
    assert distance["random"].mean > 0.01 and distance["random"].chance > 0.01
    assert distance["real"] is None  # one take to each song
    assert cells(evaluation, "foot_slide_ratio_at_joins")["ours"].chance in (None, 1.0)


def test_cells_are_mean_and_spread_over_songs_and_seeds(evaluation):
    values = [d.scores.values["f_score"] for d in evaluation.dances if d.variant == "random"]
    cell = cells(evaluation, "f_score")["random"]
    assert cell.mean == pytest.approx(np.mean(values))
    assert cell.spread == pytest.approx(np.std(values))


def test_real_dances_are_not_compared_with_themselves(evaluation):
    fpd = cells(evaluation, "fpd")
    assert fpd["real"].mean > 0.01
    assert all(cell.chance is not None for cell in fpd.values() if cell)


def test_deterministic_variants_are_danced_once(repertoire, folder):
    songs = find_songs(folder, only=["alone"])
    found = evaluate_variants(
        repertoire, songs, EvaluationConfig((RESEARCH_VARIANTS["greedy-published"],), seeds=3)
    )
    assert [d.seed for d in found.dances if d.variant == "greedy-published"] == [0]


def test_the_report_contains_all_tables_and_numbers(evaluation, tmp_path):
    pytest.importorskip("matplotlib")
    write_report(tmp_path / "r.html", evaluation)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    for table in tables(evaluation):
        assert f'<section id="{table.family}">' in page
        for row in table.rows:
            assert row.metric.label.split("'")[0] in page
            for cell in filter(None, row.cells):
                assert f"<b>{number_text(cell.mean, row.metric.digits)}</b>" in page
    for section in ("songs", "speed", "costs", "slopes", "signatures", "convergence", "poses"):
        assert f"<section id={section}>" in page or f'<section id="{section}">' in page
    assert page.count("data:image/png;base64,") == len(evaluation.example.dances)
    assert 'src="http' not in page and "<script" not in page


def test_json_contains_the_same_and_follows_its_schema(evaluation):
    data = json.loads(to_json(evaluation))
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(data, SCHEMA)
    assert len(data["dances"]) == len(evaluation.dances)
    for table, written in zip(tables(evaluation), data["tables"], strict=True):
        assert written["columns"] == list(table.columns)
        for row in table.rows:
            assert [c and c["mean"] for c in written["rows"][row.metric.name]] == [
                c and c.mean for c in row.cells
            ]


def test_songs_the_repertoire_was_built_from_are_refused(repertoire, tmp_path):
    write_clicks(tmp_path / "song1.wav", duration_s=5.0)
    songs = find_songs(tmp_path)
    with pytest.raises(ParameterError, match=r"song1.*--seen"):
        evaluate_variants(repertoire, songs)
    found = evaluate_variants(
        repertoire, songs, EvaluationConfig(variants_named(["random"]), seeds=1, seen=True)
    )
    assert found.facts["seen"] is True


def test_a_renamed_song_is_recognised_by_its_checksum(repertoire, tmp_path, monkeypatch):
    from choreograph.core.files import sha256_of
    from choreograph.evaluation.songs import check_unseen

    path = write_clicks(tmp_path / "renamed.wav", duration_s=5.0)
    check_unseen(find_songs(tmp_path), repertoire)
    monkeypatch.setattr(Repertoire, "source_checksums", frozenset({sha256_of(path)}))
    with pytest.raises(ParameterError, match="renamed"):
        check_unseen(find_songs(tmp_path), repertoire)


def test_find_songs(folder, tmp_path):
    assert [s.name for s in find_songs(folder)] == ["quick", "slow", "alone"]
    (quick,) = find_songs(folder, only=["quick"], duration_s=7.0)
    assert quick.take is not None and quick.duration_s == 7.0 and quick.take.credits.genre == "a"
    with pytest.raises(ParameterError, match="fast"):
        find_songs(folder, only=["fast"])
    (tmp_path / "empty").mkdir()
    for none in (tmp_path / "none", tmp_path / "empty"):
        with pytest.raises(ParameterError, match=str(none)):
            find_songs(none)


def test_a_damaged_take_is_an_error(folder, tmp_path):
    (tmp_path / "a.bvh").write_text("HIERARCHY\nnot more")
    write_clicks(tmp_path / "a.wav", duration_s=5.0)
    with pytest.raises(FormatError, match=r"a\.bvh"):
        find_songs(tmp_path)


def test_beats_from_files(tmp_path):
    song = load_song(write_clicks(tmp_path / "song.wav", duration_s=5.0))
    beats = tmp_path / "song.txt"
    beats.write_text("# by hand\n0.5 1\n1.0\n\n2.5\n9.0\n")
    for given in (beats, tmp_path):
        assert beats_of(song, given).times_s.tolist() == [0.5, 1.0, 2.5]
    assert beats_of(song.part(0.75), beats).times_s.tolist() == [0.25, 1.75]
    beats.write_text("1.0\n0.5\n")
    with pytest.raises(FormatError, match="increasing"):
        beats_of(song, beats)
    beats.write_text("one\n")
    with pytest.raises(FormatError, match=r"song\.txt"):
        beats_of(song, beats)
    with pytest.raises(ParameterError, match="ear"):
        beats_of(song, "ear")


def test_random_clips_are_unwarped_and_depend_on_the_seed(repertoire, folder):
    song = find_songs(folder, only=["alone"])[0].load()
    one, again, other = (
        dance_variant(VARIANTS["random"], song, repertoire, seed=seed).plan for seed in (0, 0, 1)
    )
    assert one == again != other
    for second in one.seconds:
        assert np.diff(second.source_times_s) == pytest.approx(0.05)
        assert second.source_times_s[0] == pytest.approx(second.clip_start_s + 2.0 + second.second % 4)
    assert set(transition_times_s(one)) <= {4.0, 8.0}
    scores = plan_scores(one, repertoire).values
    assert (scores["slope_median"], scores["share_at_fastest"]) == (pytest.approx(1.0), 0.0)
    assert scores["distinct_takes_per_minute"] == len({s.take for s in one.seconds}) * 60 / 9


def test_a_clip_played_twice_is_a_repeat(repertoire, folder):
    song = find_songs(folder, only=["alone"])[0].load()
    plan = dance_variant(VARIANTS["random"], song, repertoire).plan
    again = tuple(
        replace(second, second=i, start_s=float(i)) for i, second in enumerate(plan.seconds[:4] * 2)
    )
    twice = replace(plan, seconds=again, duration_s=8.0)
    assert plan_scores(twice, repertoire).values["longest_repeat_s"] == pytest.approx(4.0, abs=0.5)


def test_unknown_variants_and_empty_comparisons_are_refused():
    with pytest.raises(ParameterError, match="grace"):
        variants_named(["grace"])
    assert [v.name for v in variants_named(["baselines", "ours"])].count("ours") == 1
    with pytest.raises(ParameterError):
        EvaluationConfig(variants_named(["ours"]), seeds=0)
    with pytest.raises(ParameterError):
        EvaluationConfig(())


def test_one_dance_of_any_system(repertoire, tmp_path):
    song = load_song(write_clicks(tmp_path / "song.wav", duration_s=12.0))
    on_beat = evaluate(stepping(400, period_s=0.5), song, repertoire=repertoire)
    off_beat = evaluate(swaying(400), song)
    assert cells(on_beat, "f_score")["dance"].mean > 0.9 > 0.6 > cells(off_beat, "f_score")["dance"].mean
    assert {"fpd", "signature_chi2"} <= set(on_beat.dances[0].scores.values)
    assert "fpd" not in off_beat.dances[0].scores.values
    jsonschema.validate(json.loads(to_json(off_beat)), SCHEMA)


def test_a_motion_without_motion_beats_still_has_tables(tmp_path):
    song = load_song(write_clicks(tmp_path / "song.wav", duration_s=6.0))
    still = stepping(180).sampled(np.zeros(180))
    found = evaluate(still, song)
    assert math.isnan(found.dances[0].scores.values["motion_to_music"])
    (beats,) = [table for table in tables(found) if table.family == "beats"]
    assert "motion_to_music" not in [row.metric.name for row in beats.rows]
    assert cells(found, "f_score")["dance"].mean == 0.0
    jsonschema.validate(json.loads(to_json(found)), SCHEMA)


def test_sections_of_the_same_music_danced_alike(repertoire):
    scorer = MotifScorer(repertoire)
    sections = Sections(np.array([0.0, 4.0, 8.0, 12.0, 16.0]), np.array([0, 1, 0, 1]))

    def scores(motifs):
        starts_s = np.arange(16.0)
        return scorer.section_scores(DancedMotifs(np.array(motifs), starts_s, starts_s + 1), sections)

    perfect = scores([0, 1, 0, 1, 2, 2, 2, 2] * 2)
    assert set(perfect.values.values()) == {1.0} and set(perfect.chance.values()) == {0.0}
    reordered = scores([0, 1, 0, 1, 2, 2, 2, 2, 1, 0, 1, 0, 2, 2, 2, 2]).values
    assert reordered["section_agreement"] == 1.0 and reordered["section_agreement_in_step"] == 0.5
    assert set(scores([0] * 16).values.values()) == {0.0}  # repeats, but not because of the song
    assert (
        scorer.section_scores(DancedMotifs(np.zeros(0, int), np.zeros(0), np.zeros(0)), sections).values == {}
    )
    assert (
        scorer.section_scores(DancedMotifs(np.zeros(1, int), np.zeros(1), np.ones(1)), NO_SECTIONS).values
        == {}
    )


def test_every_metric_says_what_it_does_not_tell():
    assert all(metric.label and metric.limits.endswith(".") for metric in METRICS.values())
    assert {metric.better for metric in METRICS.values()} == {"higher", "lower", "real"}
    assert {metric.family for metric in METRICS.values()} == set(FAMILIES)


def test_counts_transitions_and_endings_are_measured(evaluation):
    within = cells(evaluation, "counts_within")
    assert within["ours"].mean > within["ours"].chance  # the synthetic takes count where they rest
    assert within["ours"].chance == pytest.approx(0.3, abs=0.1)
    assert cells(evaluation, "counted_share")["random"].mean == pytest.approx(1.0)
    assert cells(evaluation, "transitions_per_minute")["random"].mean > 5.0
    assert cells(evaluation, "opening_speed_m_s")["real"].n == 2
    assert cells(evaluation, "f_score_mean")["real"].mean > 0.9
    assert cells(evaluation, "f_score_mean_second")["real"].n == 2


def test_a_dance_that_rests_where_its_song_is_soft():
    moving = swaying(60 * 30)
    frames = np.arange(moving.n_frames)
    frames[600:1200] = 600  # at 30 fps: still from 20 s to 40 s
    motion = replace(moving, root_pos_m=moving.root_pos_m[frames], local_quat=moving.local_quat[frames])
    bounds_s = np.array([0.0, 20.0, 40.0, 60.0])
    scores = energy_scores(motion, (0.0, 60.0), bounds_s, np.array([0.0, -9.0, 0.0]))
    assert scores.values["energy_response"] > 0.95 and scores.values["soft_to_loud_speed"] < 0.1
    assert abs(scores.chance["energy_response"]) < 0.2
    assert energy_scores(motion, (0.0, 60.0), bounds_s, np.zeros(3)).values == {}


def test_a_reference_stands_beside_the_variants(repertoire, folder):
    songs = find_songs(folder, only=["alone"])
    made = dance_variant(VARIANTS["ours"], songs[0].load(), repertoire)
    expert = CountedDance.from_plan("expert", "alone", made.motion, made.plan, repertoire)
    config = EvaluationConfig(variants_named(["random"]), seeds=1)
    found = evaluate_variants(repertoire, songs, config, references=[expert])
    assert cells(found, "counts_within")["expert"].mean > cells(found, "counts_within")["random"].mean
    assert "expert" in found.variants
    elsewhere = evaluate_variants(repertoire, songs, config, references=[replace(expert, song="other")])
    assert {d.song for d in elsewhere.dances} == {"alone"}  # it only shows how its genre is danced


def test_motifs_judged_by_another_network(repertoire, folder, tmp_path):
    judge = synthetic_repertoire(
        tmp_path / "other.h5", synthetic_takes(periods_s=(0.4, 0.55, 0.8)), vocabulary=True
    )
    songs = find_songs(folder, only=["alone"])
    config = EvaluationConfig(variants_named(["random"]), seeds=1)
    own, judged = (evaluate_variants(repertoire, songs, config, judge=by) for by in (None, judge))
    assert (own.facts["motifs_judged_by"], judged.facts["motifs_judged_by"]) == ("own network", "other.h5")
    assert own.dances[0].scores.values["signature_chi2"] != judged.dances[0].scores.values["signature_chi2"]
    assert own.dances[0].scores.values["f_score"] == judged.dances[0].scores.values["f_score"]
    with pytest.raises(ParameterError, match="another --seed"):
        evaluate_variants(repertoire, songs, config, judge=repertoire)


def test_transitions_of_a_plan(repertoire, folder):
    song = find_songs(folder, only=["alone"])[0].load()
    plan = dance_variant(VARIANTS["random"], song, repertoire).plan
    music = Counts(0.6 * np.arange(15), numbers_in_bar(15, 4), 4)
    scores = transition_scores(plan, repertoire, music)
    assert scores.values["transitions_per_minute"] == pytest.approx(len(transition_times_s(plan)) * 60 / 9)
    assert scores.chance["transitions_at_bar_borders"] == pytest.approx(0.075)
    genres = genre_by_second(plan, repertoire)
    assert len(genres) == 9
    assert genres == [repertoire.takes[repertoire.take_index(s.take)].credits.genre for s in plan.seconds]


def test_experts_are_read_from_a_folder(folder, tmp_path):
    songs = find_songs(folder, only=["alone", "slow"])
    save_motion(tmp_path / "alone.bvh", stepping(24 * 30, period_s=0.6, seed=1))
    save_motion(tmp_path / "another.bvh", stepping(60))
    rows = "\n".join(f"{0.6 * i:.2f},{i % 4 + 1}" for i in range(40))
    (tmp_path / "alone.counts.csv").write_text(f"time_s,number\n{rows}\n")
    (tmp_path / "manifest.csv").write_text("name,genre\nanother,b\n")
    expert, another = read_experts(tmp_path, [replace(song, duration_s=9.0) for song in songs])
    assert (another.song, another.genre, another.motion.n_frames) == ("another", "b", 60)
    assert (expert.variant, expert.song, expert.motion.n_frames) == ("expert", "alone", 270)
    assert expert.counts.times_s == pytest.approx(0.6 * np.arange(16))
    with pytest.raises(ParameterError, match="quick"):
        read_experts(tmp_path, find_songs(folder, only=["quick"]))


def test_a_dance_is_measured_at_the_level_it_counts_at(folder):
    song = find_songs(folder, only=["slow"])[0].load()
    music = song_music(song, "tempo-path")
    beats_s = music.beats_s
    for every in (1, 2):
        danced = Counts(beats_s[::every], numbers_in_bar(len(beats_s[::every]), 4), 4)
        assert tempo_bpm(music.counted_as(danced)) == pytest.approx(tempo_bpm(danced), rel=0.02)
    assert music.counted_as(NO_COUNTS) is music.levels[0]
