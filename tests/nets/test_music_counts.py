"""The beat-tracking network: its excerpts, its input, what a tiny one learns, and its files."""

from __future__ import annotations

import numpy as np
import pytest
import soxr
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.library.builtin import example_songs
from choreograph.music.bar_pointer import METRES, PhaseCurves
from choreograph.music.mel import log_mel
from choreograph.music.song import Song, load_song
from choreograph.nets.music_counts import (
    CURVE_FPS,
    SHIPPED,
    MusicCounts,
    MusicCurves,
    NetworkBeats,
    activated_beats,
    at_one_level,
    decoded_beats,
    levelled,
    network_beats,
    read_music_counts,
    shipped_music_counts,
    write_music_counts,
)
from content import music_counting as music_augmentation
from content.count_networks import MusicCountsNet, music_counts_config
from content.music_counting import (
    CountedMel,
    MusicCountsData,
    activations,
    augmented,
    resampled,
    train_music_counts,
)
from content.songs.synthesis.song import render_song
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.training_songs import FIRST_UNSEEN_SEED

TINY = music_counts_config("tiny")


def untrained() -> MusicCounts:
    return MusicCounts.from_arrays(*MusicCountsNet(TINY).to_arrays())


def clicks(bpm: float = 120.0, metre: int = 4, duration_s: float = 20.0, first_s: float = 0.5) -> CountedMel:
    """Noise in which all bands jump on every beat and the lower third much more on the first of a bar."""
    times_s = np.arange(first_s, duration_s - 0.2, 60 / bpm)
    counts = Counts(times_s, numbers_in_bar(len(times_s), metre), metre)
    mel = np.random.default_rng(0).normal(-6.0, 0.3, (round(duration_s * 60), 96)).astype(np.float32)
    for time_s, number in zip(counts.times_s, counts.numbers, strict=True):
        frame = round(time_s * 60)
        mel[frame : frame + 4] += np.array([4.0, 3.0, 2.0, 1.0])[: len(mel) - frame, None]
        if number == 1:
            mel[frame : frame + 6, :32] += 6.0
    return CountedMel(mel, counts)


@given(st.floats(0.7, 1.4), st.floats(-1.5, 4.0))
@settings(max_examples=20, deadline=None)
def test_activations_stay_on_the_beats_of_a_resampled_song(tempo, start_s):
    song = clicks(bpm=100.0)
    mel = resampled(song.log_mel, start_s * 60 + tempo * np.arange(600))  # (600, 96) at 60 fps
    times_s = start_s + tempo * np.arange(300) / CURVE_FPS
    beat, downbeat = activations(song.counts, times_s, tempo)
    rise = np.diff(mel.mean(axis=1), prepend=mel[0].mean())
    for frame in np.flatnonzero(beat > 0.7)[1:-1]:
        assert rise[max(0, 2 * frame - 3) : 2 * frame + 4].max() > 0.8
    assert (downbeat <= beat + 1e-6).all()
    assert beat.max() <= 1 and (downbeat > 0.6).sum() >= (beat > 0.6).sum() // 5 - 1


@given(st.floats(-20, 20), st.integers(0, 50))
@settings(max_examples=20, deadline=None)
def test_gain_and_equalisation_do_not_change_the_input(gain, seed):
    mel = clicks().log_mel - 3.0
    response = np.random.default_rng(seed).normal(0, 0.4, 96).astype(np.float32)
    np.testing.assert_allclose(levelled(mel + np.float32(gain)), levelled(mel), atol=1e-3)
    np.testing.assert_allclose(levelled(mel + response), levelled(mel), atol=0.5)


CHANGES = (
    "pitch_shifted",
    "equalised",
    "band_limited",
    "compressed",
    "in_room",
    "noisy",
    "with_break",
    "voiced",
)


@pytest.mark.parametrize("name", CHANGES)
def test_each_change_makes_another_recording_of_the_same_length(name):
    mel = clicks().log_mel
    before = mel.copy()
    changed = getattr(music_augmentation, name)(mel, np.random.default_rng(1))
    assert changed.shape == mel.shape and np.isfinite(changed).all()
    assert not np.allclose(changed, mel)
    np.testing.assert_array_equal(mel, before)


def test_augmented_songs_still_have_their_beats():
    """The mean rise at the beats stays above that elsewhere, in nearly every recording."""
    song = clicks()
    frames = np.rint(song.counts.times_s * 60).astype(int)
    n_kept = 0
    for seed in range(20):
        mel = augmented(song.log_mel.copy(), np.random.default_rng(seed))
        rise = np.maximum(0, np.diff(mel, axis=0, prepend=mel[:1])).mean(axis=1)
        n_kept += np.mean([rise[f - 1 : f + 2].max() for f in frames]) > 1.5 * np.median(rise)
    assert n_kept >= 17


def test_a_batch_has_its_shapes_and_its_truth():
    data = MusicCountsData([clicks(), clicks(metre=3, bpm=90)], TINY)
    mel, activation, phases = data.batch(np.random.default_rng(0))
    n_frames = round(TINY.excerpt_s * CURVE_FPS)
    assert mel.shape == (TINY.batch_size, 2 * n_frames, 96)
    assert activation.shape == (TINY.batch_size, 2, n_frames)
    assert phases.beat.shape == phases.known.shape == (TINY.batch_size, n_frames)
    on_beat = (activation[:, 0] > 0.9) & phases.known
    away = phases.beat[on_beat]
    assert on_beat.any() and bool(((away < 0.2) | (away > 0.8)).all())


def test_songs_without_bars_are_refused():
    song = clicks()
    unknown = Counts(song.counts.times_s, np.zeros(len(song.counts), np.int64), 0)
    for songs in ([], [CountedMel(song.log_mel, unknown)], [CountedMel(song.log_mel, unknown.within(0, 1))]):
        with pytest.raises(ParameterError, match="songs"):
            MusicCountsData(songs, TINY)


@pytest.mark.slow
def test_a_tiny_network_learns_the_counts_of_clicks():
    config = music_counts_config("tiny", steps=160)
    net = train_music_counts([clicks(), clicks(metre=3), clicks(bpm=95)], config, seed=0)
    song = clicks(bpm=108.0, first_s=0.9)
    curves = net.curves(song.log_mel)
    activated = activated_beats(curves, song.log_mel)
    for beats_s in (decoded_beats(curves)[0], activated, network_beats(song.log_mel, net)):
        assert f_score(beats_s, song.counts.times_s) > 0.85
    on_beat = np.rint(song.counts.times_s * CURVE_FPS).astype(int)
    assert curves.beat[on_beat].mean() > 2 * curves.beat.mean()


class Planted:
    """A network with beats at 100 BPM in its activation, and phases of another tempo at any confidence."""

    def __init__(self, phase_bpm: float, concentration: float) -> None:
        turns = np.arange(900) / CURVE_FPS * phase_bpm / 60
        noise = np.random.default_rng(0).normal(0, 2, (2, 900))
        angle = 2 * np.pi * turns + (noise[0] if concentration < 1 else 0)
        vectors = concentration * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        activation = 0.02 * np.abs(noise[1])
        activation[np.arange(5, 900, 18)] = 0.9
        bars = np.zeros((900, len(METRES), 2))
        self.curves_of_song = MusicCurves(activation, activation, PhaseCurves(vectors, bars, CURVE_FPS))

    def curves(self, log_mel):
        return self.curves_of_song


@pytest.mark.parametrize(("concentration", "bpm"), [(3.0, 150.0), (0.5, 100.0)])
def test_sure_phases_are_followed_and_else_the_activation(concentration, bpm):
    beats_s = network_beats(clicks(duration_s=30.0).log_mel, Planted(150.0, concentration))
    assert np.median(np.diff(beats_s)) == pytest.approx(60 / bpm, rel=0.02)


@pytest.mark.parametrize("n_frames", [1, 2, 61, 600])
def test_curves_of_any_length_have_half_the_rate(n_frames):
    net = untrained()
    curves = net.curves(clicks().log_mel[:n_frames])
    assert len(curves.beat) == len(curves.downbeat) == len(curves.phases.beat) == (n_frames + 1) // 2


@pytest.mark.parametrize("mel", [np.zeros((10, 4)), np.zeros((0, 96)), np.zeros(96)])
def test_another_shape_is_refused(mel):
    with pytest.raises(ParameterError, match="log-mel"):
        untrained().curves(mel)


@pytest.mark.parametrize("n_frames", [30, 600])
def test_silence_has_no_counts(n_frames):
    song = Song(np.zeros(n_frames * SAMPLE_RATE_HZ // 60, np.float32), "silence")
    assert NetworkBeats(untrained()).beats(song, np.full((n_frames, 96), -13.8)).shape == (0,)


def test_beats_lie_inside_the_song():
    mel = clicks(duration_s=8.0).log_mel
    song = Song(np.zeros(round(7.5 * SAMPLE_RATE_HZ), np.float32), "short")
    beats_s = NetworkBeats(untrained()).beats(song, mel)
    assert len(beats_s) and (np.diff(beats_s) > 0).all() and beats_s[0] >= 0 and beats_s[-1] < 7.5


def test_weights_come_back_in_half_precision_with_their_training_songs(tmp_path):
    net = untrained()
    write_music_counts(tmp_path / "net.npz", net, {"songs": 3})
    again, about = read_music_counts(tmp_path / "net.npz")
    assert about == {"songs": 3} and again.config == TINY
    mel = clicks().log_mel
    np.testing.assert_allclose(again.curves(mel).beat, net.curves(mel).beat, atol=0.02)


def test_another_file_is_refused(tmp_path):
    (tmp_path / "text.npz").write_text("no weights")
    np.savez(tmp_path / "other.npz", about="{}", config='{"width": 3}', odd=np.zeros(3))
    for name in ("text.npz", "other.npz", "absent.npz"):
        with pytest.raises(FormatError, match="weights"):
            read_music_counts(tmp_path / name)


def test_the_shipped_network_is_small_and_trained_on_the_synthesiser_alone():
    assert SHIPPED.stat().st_size < 500_000
    _, about = read_music_counts(SHIPPED)
    assert about["songs"] > 100 and about["without_genres"] == about["real"] == []


@pytest.mark.slow
@pytest.mark.parametrize("genre", ["salsa", "waltz"])
def test_the_shipped_network_keeps_a_fast_genre_at_its_own_tempo(genre):
    """At 175 BPM, which a prior on tempi halves; the seed is not among its training songs."""
    rendered = render_song(genre, bpm=175.0, duration_s=25.0, seed=FIRST_UNSEEN_SEED + 901)
    mono = soxr.resample(rendered.samples.mean(axis=1), RATE_HZ, SAMPLE_RATE_HZ)
    beats_s = network_beats(log_mel(mono), shipped_music_counts())
    inside = beats_s[(beats_s > rendered.beat_times_s[0] - 0.1) & (beats_s < rendered.beat_times_s[-1] + 0.1)]
    assert f_score(inside, rendered.beat_times_s) > 0.9


def test_after_the_music_has_died_away_the_beat_goes_on():
    """What a network makes of silence is not a beat: at the end of this song it counted at half the tempo."""
    song = load_song(example_songs()["house"])
    beats_s = network_beats(log_mel(song.samples), shipped_music_counts())
    intervals_s = np.diff(beats_s)
    assert np.ptp(intervals_s[-8:]) < 0.05 * np.median(intervals_s)
    assert beats_s[-1] > song.duration_s - 1.1 * intervals_s[-1]


@pytest.mark.parametrize("first", [0.0, 20.0])
def test_a_slip_to_half_the_tempo_is_mended(first):
    """In a quarter of the song; where half of it is slower, it is left, and so is any other tempo."""
    true = np.arange(0.3, 80.0, 0.5)
    inside = (true >= first) & (true < first + 20.0)
    slipped = true[~inside | (np.arange(len(true)) % 2 == 0)]
    np.testing.assert_allclose(at_one_level(slipped), true)
    half = np.concatenate([np.arange(0.0, 40.0, 0.5), np.arange(40.0, 80.0, 1.0)])
    other = np.concatenate([np.arange(0.0, 60.0, 0.5), np.arange(60.0, 80.0, 0.75)])
    for beats_s in (true, half, other, true[:3], true[:0]):
        np.testing.assert_array_equal(at_one_level(beats_s), beats_s)
