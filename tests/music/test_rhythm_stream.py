"""Rhythm of a stream of music: near that of the whole song, and a function of the samples so far."""

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.music.rhythm import RhythmStream, frame_rhythm

BEATS_S = np.arange(0.25, 8.0, 0.5)


@pytest.fixture(scope="module")
def samples():
    """8 s of noise, softer and louder, with a click on every beat."""
    rng = np.random.default_rng(0)
    sound = rng.normal(0, 0.03, 8 * 22050) * (1 + np.sin(np.arange(8 * 22050) / 22050))
    for beat_s in BEATS_S:
        first = round(beat_s * 22050)
        sound[first : first + 800] += rng.normal(0, 0.5, 800)
    return sound.astype(np.float32)


def rows_of(samples, block, n_rows=10_000):
    stream, rows = RhythmStream(BEATS_S), []
    for start in range(0, len(samples), block):
        stream.feed(samples[start : start + block])
        while stream.has_row() and len(rows) < n_rows:
            rows.append(stream.next_row())
    return np.stack(rows)


def test_rows_are_near_those_of_the_whole_song(samples):
    whole = frame_rhythm(samples, BEATS_S)
    rows = rows_of(samples, 1000)
    assert len(rows) >= len(whole) - 2
    settled = slice(60, len(rows))
    assert np.abs(rows - whole[: len(rows)])[settled, [0]].max() < 0.02
    assert np.abs(rows - whole[: len(rows)])[settled, [1]].max() < 0.1
    assert np.corrcoef(rows[settled, 2], whole[settled, 2][: len(rows) - 60])[0, 1] > 0.95
    assert np.array_equal(rows[:, 3], whole[: len(rows), 3])


def test_rows_do_not_depend_on_blocks_nor_on_later_sound(samples):
    rows = rows_of(samples, 22050)
    assert np.array_equal(rows, rows_of(samples, 777)[: len(rows)])
    altered = samples.copy()
    altered[4 * 22050 + 1025 :] = 0.9
    assert np.array_equal(rows[:121], rows_of(altered, 5000)[:121])  # up to 4 s
    assert not np.array_equal(rows[121:], rows_of(altered, 5000)[121:])


def test_the_last_row_stays_and_nothing_follows_the_end(samples):
    stream = RhythmStream(BEATS_S)
    stream.feed(samples[:22050])
    stream.finish()
    rows = [stream.next_row() for _ in range(40)]
    assert np.array_equal(rows[29], rows[39]) and not np.array_equal(rows[28], rows[29])
    with pytest.raises(ParameterError, match="after the end"):
        stream.feed(samples[:10])
    with pytest.raises(ParameterError, match="finite mono"):
        RhythmStream(BEATS_S).feed(np.array([np.nan]))


def test_silence_is_no_number_but_zero():
    stream = RhythmStream(BEATS_S)
    stream.feed(np.zeros(22050))
    assert np.array_equal(np.stack([stream.next_row() for _ in range(20)])[:, :3], np.zeros((20, 3)))


@pytest.mark.parametrize("sound", ["x", b"", None, object(), 1.0, [["x"]], [[0.0]]])
def test_what_is_no_sound_is_refused_in_one_line(sound):
    with pytest.raises(ParameterError, match=r"^expected [^\n]+, got [^\n]+$"):
        RhythmStream(BEATS_S).feed(sound)
