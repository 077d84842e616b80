"""Dances on the count: counts of the takes on the song's beats, bars on bars, held poses at both ends."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from synthetic_repertoire import (
    PERIODS_S,
    synthetic_repertoire,
    synthetic_takes,
    with_counts,
    without_counts,
    write_clicks,
)

import choreograph as cg
from choreograph.choreography.enforcement import danced_motifs
from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.timebase import STORE_FPS
from choreograph.evaluation.metrics.counts import signed_errors_beats
from choreograph.evaluation.metrics.transitions import closing_speed_m_s, opening_speed_m_s
from choreograph.evaluation.plan_scores import counted_share, danced_counts
from choreograph.library.vocabulary import dance_bounds_s
from choreograph.motion.body import body_pos_m

pytestmark = pytest.mark.slow

DURATION_S = 24.0
BPM = 110.0
FIRST_NUMBER = 3  # of the beat at 0 s


@pytest.fixture(scope="module")
def clicks(tmp_path_factory):
    """A song of clicks, and its beats with their numbers in the bar."""
    folder = tmp_path_factory.mktemp("songs")
    song = write_clicks(folder / "clicks.wav", duration_s=DURATION_S, bpm=BPM)
    times_s = np.arange(0.0, DURATION_S, 60.0 / BPM)
    numbers = numbers_in_bar(len(times_s), 4, first=FIRST_NUMBER)
    lines = [f"{at_s:.6f} {number}" for at_s, number in zip(times_s, numbers, strict=True)]
    (folder / "beats.txt").write_text("\n".join(lines), encoding="utf-8")
    return song, folder / "beats.txt", make_counts(times_s, numbers, 4)


@pytest.fixture(scope="module")
def counted(tmp_path_factory):
    return synthetic_repertoire(
        tmp_path_factory.mktemp("counted") / "rep.h5", with_counts(synthetic_takes()), vocabulary=True
    )


@pytest.fixture(scope="module")
def on_the_count(clicks, counted):
    song, beats, _ = clicks
    return cg.dance(song, counted, beats=beats)


def off_beats_s(counts, instants_s) -> np.ndarray:
    return np.abs(counts.times_s[:, None] - instants_s).min(axis=1)


def test_counts_lie_on_beats_and_count_1_on_downbeats(on_the_count, counted, clicks):
    _, _, beats = clicks
    counts = danced_counts(on_the_count.plan, counted)
    assert counted_share(on_the_count.plan, counted) == 1.0
    danced = (beats.times_s >= on_the_count.plan.opening_s) & (beats.times_s <= on_the_count.plan.closing_s)
    assert len(counts) == pytest.approx(danced.sum(), abs=2)
    assert off_beats_s(counts, beats.times_s).max() < 0.02
    first = replace(counts, times_s=counts.times_s[counts.numbers == 1])
    assert len(first.times_s) > 8 and off_beats_s(first, beats.downbeat_times_s).max() < 0.02


def test_takes_change_on_downbeats(clicks, counted):
    song, path, beats = clicks
    plan = cg.dance(song, counted, beats=path, weights={"completeness": 0.5}).plan  # takes change often
    joins_s = np.array([b.start_s for a, b in pairwise(plan.seconds) if a.take != b.take])
    joins_s = joins_s[(joins_s > plan.opening_s) & (joins_s < plan.closing_s)]
    assert len(joins_s) >= 2
    assert np.abs(joins_s[:, None] - beats.downbeat_times_s).min(axis=1).max() < 1e-4


def test_the_first_and_last_pose_are_held(on_the_count, clicks):
    _, _, beats = clicks
    plan = on_the_count.plan
    assert {plan.opening_s, plan.closing_s} <= {round(t, 6) for t in beats.times_s}
    assert 0.7 <= plan.opening_s < 3.0 and DURATION_S - 3.0 < plan.closing_s <= DURATION_S - 0.3
    body = body_pos_m(on_the_count.motion.resampled(STORE_FPS))
    assert opening_speed_m_s(body, STORE_FPS) < 0.15 and closing_speed_m_s(body, STORE_FPS) < 0.15
    for held in (
        body[: round((plan.opening_s - 0.9) * STORE_FPS)],
        body[round((plan.closing_s + 0.15) * STORE_FPS) :],
    ):
        assert np.ptp(held, axis=0).max(initial=0.0) < 0.12  # it breathes and shifts its weight


def test_the_plan_says_beats_numbers_and_metre(on_the_count, clicks):
    _, _, beats = clicks
    plan = on_the_count.plan
    assert plan.music_beats_s == pytest.approx(beats.times_s, abs=1e-5)
    assert plan.music_beat_numbers == tuple(beats.numbers) and plan.metre == 4
    assert cg.Plan.from_json(plan.to_json()) == plan


@pytest.mark.parametrize(
    "settings", [{"warping": "dtw"}, {"transitions": "seconds"}, {"planner": "greedy"}, {"warping": "none"}]
)
def test_other_settings_still_dance(clicks, counted, settings):
    song, beats, truth = clicks
    made = cg.dance(song, counted, beats=beats, **settings)
    assert abs(made.motion.duration_s - DURATION_S) <= 1 / 60
    starts_s = np.array([second.start_s for second in made.plan.seconds])
    if settings.get("transitions") == "seconds":
        assert np.array_equal(starts_s, np.arange(len(starts_s)))
    if "warping" not in settings:
        assert off_beats_s(danced_counts(made.plan, counted), truth.times_s).max() < 0.02


def test_a_dance_keeps_to_the_counts_that_are_not_in_doubt(clicks, tmp_path):
    """The first half of every take is uncertain; without uncertainty most of the dance is from there."""
    song, beats, _ = clicks
    takes = with_counts(synthetic_takes())
    danced_s = []
    for uncertainty in (0.0, 0.8):
        counts = [m.take.counts for m in takes]
        uncertainties = [np.where(c.times_s < 15.0, uncertainty, 0.0) for c in counts]
        read = [
            replace(m, take=replace(m.take, counts=replace(c, confidence=0.7, uncertainty=d)))
            for m, c, d in zip(takes, counts, uncertainties, strict=True)
        ]
        repertoire = synthetic_repertoire(tmp_path / f"{uncertainty}.h5", read)
        seconds = cg.dance(song, repertoire, beats=beats).plan.seconds
        danced_s.append(np.array([np.mean(second.source_times_s) for second in seconds]))
    certain, doubted = danced_s
    assert (certain < 14.0).mean() > 0.5
    assert (doubted < 14.0).mean() < 0.1


def test_takes_whose_counts_are_estimated_are_danced_beside_counted_ones(tmp_path):
    """Half of the counts of the built-in takes are hidden. They are compared with the dances."""
    true = cg.starter_repertoire()
    hidden = {take.name for take in true.takes[1::2]}
    repertoire = without_counts(true, tmp_path / "half.h5", hidden)
    beats_off, hidden_s = [], 0.0
    for song in ("cha-cha", "house", "waltz"):
        plan = cg.dance(cg.example_songs()[song], repertoire, duration_s=12, candidates=48).plan
        hidden_s += sum(seconds for take, seconds in plan.takes_s().items() if take in hidden)
        of_hidden = np.array([second.take in hidden for second in plan.seconds])
        counts = danced_counts(plan, true)  # the true ones
        counts_s = counts.times_s[of_hidden[np.minimum(counts.times_s.astype(int), len(of_hidden) - 1)]]
        beats_off.append(np.abs(signed_errors_beats(counts_s, plan.music_beats_s)))
    assert hidden_s >= 0.1 * 36  # the network of counts was trained on earlier dancers
    assert (np.concatenate(beats_off) <= 0.15).mean() >= 0.9


def test_takes_without_counts_are_warped_by_their_density(clicks, tmp_path):
    song, beats, _ = clicks
    plain = synthetic_repertoire(tmp_path / "plain.h5")
    made, dtw = (cg.dance(song, plain, beats=beats, **how) for how in ({}, {"warping": "dtw"}))
    assert danced_counts(made.plan, plain) is NO_COUNTS
    assert [s.source_times_s for s in made.plan.seconds] == [s.source_times_s for s in dtw.plan.seconds]


def test_a_take_without_counts_takes_part_where_others_are_banned(clicks, tmp_path):
    song, beats, _ = clicks
    takes = [*with_counts(synthetic_takes())[:2], synthetic_takes()[2]]
    mixed = synthetic_repertoire(tmp_path / "mixed.h5", takes)
    free = cg.dance(song, mixed, beats=beats)
    assert counted_share(free.plan, mixed) > 0.8  # counted takes are on the beat and in the bar
    made = cg.dance(song, mixed, beats=beats, bans=[cg.Ban(take="take0"), cg.Ban(take="take1")])
    assert {second.take for second in made.plan.seconds} == {"take2"}


def test_bars_of_another_metre_are_avoided(clicks, tmp_path):
    """Of two takes at the same tempo, one counted in threes, the other is danced to a song of four."""
    song, beats, _ = clicks
    periods_s = (PERIODS_S[1], PERIODS_S[1])
    takes = with_counts(synthetic_takes(periods_s=periods_s), periods_s)
    times_s = takes[0].take.counts.times_s
    in_three = make_counts(times_s, numbers_in_bar(len(times_s), 3), 3)
    takes[0] = replace(takes[0], take=replace(takes[0].take, counts=in_three, figures=()))
    mixed = synthetic_repertoire(tmp_path / "metres.h5", takes)
    made = cg.dance(song, mixed, beats=beats, weights={"variety": 0.0})
    assert [second.take for second in made.plan.seconds].count("take1") >= 0.9 * len(made.plan.seconds)


@pytest.mark.parametrize("at_s", [0.1, DURATION_S - 0.3])
def test_motifs_pinned_at_the_very_ends_are_danced(clicks, counted, at_s):
    song, beats, _ = clicks
    motif = int(np.bincount(counted.vocabulary.word_motif).argmin())
    made = cg.dance(song, counted, beats=beats, pins=[cg.MotifPin(at_s, motif)])
    bounds_s = dance_bounds_s(np.array(made.plan.music_beats_s), DURATION_S)
    assert danced_motifs(made.motion, bounds_s, counted)[0 if at_s < 1 else -1] == motif
    pinned = [word for word in made.plan.words if word.pinned]
    assert [word.motif for word in pinned] == [motif]
    if at_s < 1:
        assert made.plan.opening_s == 0.0 and pinned[0].start_s <= at_s
    else:
        assert made.plan.closing_s is None and pinned[0].end_s >= at_s
