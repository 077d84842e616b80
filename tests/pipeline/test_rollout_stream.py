"""Dances streamed while their song plays: nothing is known too early, nothing changes afterwards."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_repertoire import synthetic_repertoire

import choreograph as cg
from choreograph.core.counts import NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.timebase import SAMPLE_RATE_HZ

pytestmark = pytest.mark.slow

BEAT_S = 0.5


@pytest.fixture(scope="module")
def counts():
    times_s = np.arange(0.2, 8.0, BEAT_S)
    return make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)


@pytest.fixture(scope="module")
def sound(song):
    return cg.load_song(song, duration_s=8.0).samples


def frames_of(rolling, counts, sound, *, block=4096, steer=None, **options):
    """All frames as rows (T, 3 + 4 J), from a stream fed in blocks; `steer(stream)` is called after 2 s."""
    stream, rows = cg.RolloutStream(counts, rolling, **options), []
    for start in range(0, len(sound) + block, block):
        stream.feed(sound[start : start + block])
        if start >= len(sound):
            stream.finish()
        for frame in stream:
            assert frame.time_s == pytest.approx(len(rows) / stream.fps)
            rows.append(np.concatenate([frame.root_pos_m, frame.local_quat.ravel()]))
            if steer is not None and len(rows) == 2 * stream.fps:
                steer(stream)
    return np.stack(rows), stream


@pytest.fixture(scope="module")
def streamed(rolling, counts, sound):
    return frames_of(rolling, counts, sound)


def first_difference(a, b):
    return int(np.flatnonzero((a[: len(b)] != b[: len(a)]).any(axis=1))[0])


def test_one_seed_one_dance_in_whatever_blocks(rolling, counts, sound, streamed):
    rows, _ = streamed
    assert len(rows) == 8 * 60 and np.isfinite(rows).all()
    again, _ = frames_of(rolling, counts, sound, block=1111)
    assert np.array_equal(rows, again)


def test_a_song_is_danced_as_its_counts_with_its_sound_fed(rolling, song):
    loaded = cg.load_song(song, duration_s=6.0)
    whole = cg.RolloutStream(loaded, rolling)
    rows = np.stack([np.concatenate([f.root_pos_m, f.local_quat.ravel()]) for f in whole])
    fed, stream = frames_of(rolling, whole.counts, loaded.samples, genre=whole.genre)
    assert np.array_equal(rows, fed) and stream.words == whole.words
    assert list(whole) == []


@pytest.mark.parametrize("heard_s", [2.0, 4.3])
def test_frames_depend_on_no_sound_after_the_look_ahead(rolling, counts, sound, streamed, heard_s):
    rows, _ = streamed
    altered = sound.copy()
    altered[round(heard_s * SAMPLE_RATE_HZ) :] = np.random.default_rng(0).normal(0, 0.5, 1)
    first = first_difference(rows, frames_of(rolling, counts, altered)[0]) / 60
    assert heard_s - cg.RolloutStream.look_ahead_s < first < heard_s + 0.1


def test_frames_come_as_soon_as_the_look_ahead_is_heard(rolling, counts, sound):
    stream = cg.RolloutStream(counts, rolling)
    stream.feed(sound[: 3 * SAMPLE_RATE_HZ])
    given = list(stream)
    assert given[-1].time_s >= 3.0 - cg.RolloutStream.look_ahead_s
    assert list(stream) == []
    stream.feed(sound[3 * SAMPLE_RATE_HZ : 4 * SAMPLE_RATE_HZ])
    assert next(iter(stream)).time_s == pytest.approx(given[-1].time_s + 1 / 60)


def test_a_requested_motif_is_danced_from_the_next_word_on(rolling, counts, sound, streamed):
    rows, plain = streamed
    next_word = next(i for i, w in enumerate(plain.words) if w.start_s > 2.0 + 0.17)
    wanted = 1 - plain.words[next_word].motif
    steered, stream = frames_of(rolling, counts, sound, steer=lambda s: s.request(wanted, n_words=3))
    assert [w.motif for w in stream.words[next_word : next_word + 3]] == [wanted] * 3
    assert stream.words[:next_word] == plain.words[:next_word]
    start_s = plain.words[next_word].start_s
    assert start_s - 0.2 < first_difference(rows, steered) / 60 < start_s + 0.2
    body = slice(round((start_s + 0.2) * 60), round((start_s + 1.5) * 60))
    assert np.abs(steered - rows)[body].max() > 1e-3


def test_rates_and_music_without_beats(rolling, sound):
    rows, stream = frames_of(rolling, NO_COUNTS, sound[: 2 * SAMPLE_RATE_HZ], fps=24.0)
    assert len(rows) == 48
    assert [w.end_s - w.start_s for w in stream.words] == pytest.approx([0.5] * len(stream.words))


def test_what_cannot_be_streamed_is_refused_in_one_line(rolling, counts, tmp_path):
    without = synthetic_repertoire(tmp_path / "rep.h5", vocabulary=True)
    with pytest.raises(cg.RepertoireError, match="build-db --rollout"):
        cg.RolloutStream(counts, without)
    with pytest.raises(cg.ParameterError, match="genre among"):
        cg.RolloutStream(counts, rolling, genre="polka")
    with pytest.raises(cg.ParameterError, match="fps"):
        cg.RolloutStream(counts, rolling, fps=0.0)
    with pytest.raises(cg.ParameterError, match="path or a Song"):
        cg.RolloutStream(5, rolling)
    stream = cg.RolloutStream(counts, rolling)
    for motif in (-1, rolling.vocabulary.n_motifs):
        with pytest.raises(cg.ParameterError, match="expected a motif as a whole number from 0 to"):
            stream.request(motif)
    with pytest.raises(cg.ParameterError, match="1 to 10000 words"):
        stream.request(0, n_words=0)
    with pytest.raises(cg.ParameterError, match="genre among"):
        stream.genre = "polka"
    stream.finish()
    with pytest.raises(cg.ParameterError, match="after the end"):
        stream.feed(np.zeros(10))
