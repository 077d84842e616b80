"""Counts from a take's own song: only where the motion keeps to its beats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_motions import stepping
from synthetic_repertoire import synthetic_takes, without_counts, write_clicks

from choreograph.core.counts import ANNOTATED, FROM_MOTION, FROM_MUSIC, NO_COUNTS, make_counts, numbers_in_bar
from choreograph.evaluation.metrics.counts import counts_within
from choreograph.formats.register import import_takes
from choreograph.library.building.counting import (
    MIN_PHASE_LOCK,
    SURE_MOTION_CONFIDENCE,
    Counting,
    counted_take,
    counts_from_song,
    phase_lock,
    uncounted_notes,
)
from choreograph.library.builtin import (
    MAX_MOTION_UNCERTAINTY,
    MIN_MOTION_CONFIDENCE,
    load_motion_counter,
    pretrained_set,
)
from choreograph.library.notes import summary
from choreograph.library.repertoire import starter_repertoire
from choreograph.library.songs import SongCache
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import mean_joint_speed_m_s

FPS, PERIOD_S, DURATION_S = 60.0, 0.5, 20.0
POS_M = body_pos_m(stepping(round(DURATION_S * FPS), fps=FPS, period_s=PERIOD_S))  # at rest every period
SPEED_M_S = mean_joint_speed_m_s(POS_M, FPS)


def beats(period_s: float = PERIOD_S, first_s: float = 0.0) -> np.ndarray:
    return np.arange(first_s, DURATION_S, period_s)


def test_a_motion_that_rests_on_the_beats_is_locked():
    assert phase_lock(SPEED_M_S, FPS, beats()) > 0.95


@given(st.floats(0.0, 1.0))
def test_the_lock_is_the_cosine_of_a_constant_phase(phase):
    lock = phase_lock(SPEED_M_S, FPS, beats(first_s=phase * PERIOD_S))
    assert lock == pytest.approx(max(0.0, np.cos(2 * np.pi * phase)), abs=0.06)


@pytest.mark.parametrize("period_s", [0.41, 0.47, 0.53, 0.7])
def test_another_tempo_is_not_locked(period_s):
    assert phase_lock(SPEED_M_S, FPS, beats(period_s)) < 0.3


def test_too_few_beats_say_nothing():
    assert phase_lock(SPEED_M_S, FPS, beats()[:20]) == 0.0
    assert phase_lock(SPEED_M_S, FPS, np.zeros(0)) == 0.0


def test_a_motion_at_rest_is_not_locked():
    assert phase_lock(np.zeros(1200), FPS, beats()) == 0.0


@pytest.mark.parametrize("start_s", [0.0, 3.0])
def test_the_song_counts_the_take(start_s):
    times_s = beats() + start_s
    song = make_counts(
        times_s, numbers_in_bar(len(times_s), 3, first=2), 3, source=FROM_MUSIC, confidence=0.8
    )
    counts = counts_from_song(song, POS_M, FPS, song_start_s=start_s)
    np.testing.assert_allclose(counts.times_s, beats(), atol=1e-9)
    np.testing.assert_array_equal(counts.numbers[:4], [2, 3, 1, 2])
    assert (counts.metre, counts.source) == (3, FROM_MUSIC)
    assert MIN_PHASE_LOCK * 0.8 < counts.confidence <= 0.8


def test_a_song_of_another_phase_does_not():
    times_s = beats(first_s=0.2)
    song = make_counts(times_s, np.zeros(len(times_s)), 0, source=FROM_MUSIC)
    assert counts_from_song(song, POS_M, FPS) is NO_COUNTS


def counted_takes(takes, songs, count_motion=None):
    """The counted takes, and notes on those that had no counts."""
    counts = Counting(songs, count_motion).song_counts([m.take for m in takes])
    found = [counted_take(count_motion, m, song) for m, song in zip(takes, counts, strict=True)]
    counted = [m for m, _ in found]
    return counted, [*(note for _, note in found if note is not None), *uncounted_notes(counted)]


def test_takes_and_notes(tmp_path):
    """Clicks at 120 BPM count the take that rests on them, not the one at 100 BPM, nor what is counted."""
    song = write_clicks(tmp_path / "clicks.wav", duration_s=30.0)
    on, off, silent, known = synthetic_takes(periods_s=(0.5, 0.6, 0.5, 0.5))
    given_counts = make_counts([1.0, 2.0], [0, 0], 0)
    first_s = float(SongCache().analysed(song).beat_times_s[0])
    takes = [replace(m, take=replace(m.take, song_path=song, song_start_s=first_s)) for m in (on, off)] + [
        silent,
        replace(known, take=replace(known.take, song_path=song, counts=given_counts)),
    ]
    counted, notes = counted_takes(takes, SongCache())
    assert [len(m.take.counts) for m in counted] == [pytest.approx(60, abs=3), 0, 0, 2]
    assert counted[0].take.counts.source == FROM_MUSIC
    assert notes[0].values == {"confidence": counted[0].take.counts.confidence}
    kinds = [(note.kind, note.subject) for note in notes]
    assert kinds == [
        ("counts from song", "take0"), ("no counts", "take1"), ("no counts", "take2"),
        ("uncounted left out", ""),
    ]  # fmt: skip


def test_takes_without_counts_are_read_from_their_motion_if_that_is_likely_to_be_right():
    """Two of four are refused, for confidence or uncertainty. Annotated counts stay."""
    *takes, known = synthetic_takes(periods_s=(0.5, 0.6, 0.75, 0.8, 0.5))
    given_counts = make_counts([1.0, 2.0], [0, 0], 0, source=ANNOTATED)
    known = replace(known, take=replace(known.take, counts=given_counts))
    confidences = [SURE_MOTION_CONFIDENCE, MIN_MOTION_CONFIDENCE, 0.42, 0.7]
    uncertainties = [0.1, MAX_MOTION_UNCERTAINTY, 0.1, 0.4]
    read_bodies = []

    def read(pos_m):
        confidence, uncertainty = confidences[len(read_bodies)], uncertainties[len(read_bodies)]
        read_bodies.append(pos_m)
        read = make_counts([1.0, 1.5], [3, 4], 4, source=FROM_MOTION, confidence=confidence)
        return replace(read, uncertainty=np.full(2, uncertainty))

    counted, notes = counted_takes([*takes, known], SongCache(), read)
    assert [m.take.counts.source for m in counted] == [FROM_MOTION, FROM_MOTION, "", "", ANNOTATED]
    assert [id(body) for body in read_bodies] == [id(take.body_pos_m) for take in takes]
    assert summary(notes, len(counted), "a.h5") == (
        "take0: counts are estimated from the motion, confidence 0.70",
        "take1: counts are estimated from the motion and are uncertain, confidence 0.50",
        "2 of 5 takes: there are no counts, since those estimated from the motion are too uncertain, "
        "confidence 0.42 to 0.70, uncertainty 0.10 to 0.40 (take2, take3)",
        "takes without counts are not danced beside takes with counts",
        "`choreograph inspect a.h5 --notes` prints all 5 notes",
    )


def test_if_no_take_has_counts_all_are_danced_by_motion_beats():
    _, notes = counted_takes(synthetic_takes(periods_s=(0.5,)), SongCache())
    assert [note.kind for note in notes] == ["no counts", "uncounted danced"]


def test_the_song_comes_before_the_motion(tmp_path):
    song = write_clicks(tmp_path / "clicks.wav", duration_s=30.0)
    (take,) = synthetic_takes(periods_s=(0.5,))
    first_s = float(SongCache().analysed(song).beat_times_s[0])
    with_song = replace(take, take=replace(take.take, song_path=song, song_start_s=first_s))
    counted, _ = counted_takes([with_song], SongCache(), lambda pos_m: pytest.fail("its song counts it"))
    assert counted[0].take.counts.source == FROM_MUSIC


HIDDEN = ("house-03", "waltz-07")


def hidden_takes(repertoire):
    starter = starter_repertoire()
    index = [repertoire.take_index(name) for name in HIDDEN]
    return [(repertoire.counts(i), starter.counts(i)) for i in index]


def test_a_repertoire_estimates_the_counts_that_its_file_does_not_have(tmp_path):
    repertoire = without_counts(starter_repertoire(), tmp_path / "hidden.h5", HIDDEN)
    estimated = hidden_takes(repertoire)
    for counts, true in estimated:
        assert counts.source == FROM_MOTION and counts.metre == true.metre
        assert counts_within(true.times_s, counts.times_s) > 0.95 and len(counts.uncertainty) == len(counts)
    assert repertoire.counts(0).source == ANNOTATED
    take = repertoire.take_index(HIDDEN[0])
    clip = np.flatnonzero(repertoire.clip_take == take)[:1]
    uncertainty = repertoire.clip_motion.count_uncertainty(clip, np.zeros(1), np.full(1, 20.0))
    assert 0.0 < uncertainty[0] < 0.2


@pytest.mark.parametrize("provenance", [{"pretrained": "nothing"}, {"pretrained": 3}, {}])
def test_a_repertoire_that_was_built_without_the_network_estimates_no_counts(tmp_path, provenance):
    path = tmp_path / "hidden.h5"
    repertoire = without_counts(starter_repertoire(), path, HIDDEN, provenance=provenance)
    assert not any(len(counts) for counts, _ in hidden_takes(repertoire))


def test_no_reader_without_a_network():
    assert load_motion_counter(pretrained_set("nothing")) is None


@pytest.mark.slow
def test_takes_of_arbitrary_phase_are_not_counted_by_their_songs(shared_data):
    """dance-with-melody: recording and song do not begin together, which the data's own counts prove."""
    songs = SongCache()
    for name in ("DANCE_C_6", "DANCE_R_3", "DANCE_W_5", "DANCE_W_22"):
        (take,) = import_takes(shared_data / "dance-with-melody" / name)
        song = songs.analysed(take.song_path).counts
        pos_m = body_pos_m(take.motion.resampled(FPS))
        assert not len(counts_from_song(song, pos_m, FPS, song_start_s=take.song_start_s))
