"""Songs: the audio agrees with its ground truth."""

from __future__ import annotations

import json

import numpy as np
import pytest
import soundfile
from scipy.signal import butter, sosfilt

from choreograph.core.errors import ParameterError
from content.songs.known_songs import BENCHMARK_SONGS, FIRST_SEED
from content.songs.metre_styles import METRE_STYLES
from content.songs.synthesis.composition import form
from content.songs.synthesis.mixing import loudness_lufs
from content.songs.synthesis.song import STYLES, render_song, write_song
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.synthesis.style import Lane, SongStyle

pytestmark = pytest.mark.slow

CLICK = SongStyle(  # nothing but a kick on each beat
    name="click",
    bpm=(100.0, 100.0),
    lanes=(Lane("kick", ("x...x...x...x...",), send=0.0),),
    parts=(),
    progressions=("C F G C",),
    scales=("major",),
    fills=(("kick", "x..............."),),
    ending=("kick",),
    crash=None,
)


@pytest.fixture(scope="module")
def songs():
    return {name: render_song(name, n_bars=12, seed=3) for name in STYLES}


def _onsets(samples, near_s):
    """Time of the first loud sample near each time, in seconds."""
    mono = np.abs(samples.mean(axis=1))
    found = []
    for time_s in near_s:
        start = round((time_s - 0.03) * RATE_HZ)
        window = mono[max(0, start) : start + round(0.06 * RATE_HZ)]
        found.append((max(0, start) + np.argmax(window > 0.1 * window.max())) / RATE_HZ)
    return np.array(found)


@pytest.mark.parametrize("arguments", [{}, {"ramp_to_bpm": 140.0}, {"swing": 1.0}])
def test_a_beat_is_where_its_drum_begins(arguments):
    song = render_song(CLICK, bpm=90.0, n_bars=8, **arguments)
    assert _onsets(song.samples, song.beat_times_s) == pytest.approx(song.beat_times_s, abs=0.001)
    assert len(song.beat_times_s) == 8 * 4 + 1


@pytest.mark.parametrize("genre", ["house", "disco", "swing", "waltz", "cha-cha"])
def test_beats_of_genres_have_onsets_at_their_times(genre, songs):
    """In the full chorus the attack band rises more on beats than at the same lags around them."""
    song = songs[genre]
    chorus = next(section for section in song.sections if section.name == "chorus")
    bars = song.bar_times_s
    start_s, end_s = bars[chorus.first_bar], bars[chorus.first_bar + chorus.bars]
    beats = song.beat_times_s[(song.beat_times_s >= start_s) & (song.beat_times_s < end_s)]
    power = sosfilt(butter(2, 200.0, fs=RATE_HZ, output="sos"), song.samples.mean(axis=1)) ** 2
    hop = RATE_HZ // 441  # 100 samples, 2.3 ms
    level = np.add.reduceat(power, np.arange(0, len(power), hop))
    lags = np.arange(-50, 51)
    rise = [
        np.mean(
            [level[k : k + 6].sum() - level[k - 6 : k].sum() for k in np.rint(beats * 441).astype(int) + lag]
        )
        for lag in lags
    ]
    assert abs(lags[int(np.argmax(rise))]) <= 6  # 14 ms: the waves of a bass need as long to rise


def test_level_and_format_of_songs(songs):
    for genre, song in songs.items():
        assert song.samples.dtype == np.float32 and song.samples.shape[1] == 2, genre
        assert np.isfinite(song.samples).all(), genre
        assert np.abs(song.samples).max() < 0.9, genre
        assert loudness_lufs(song.samples) == pytest.approx(-14.0, abs=1.0), genre
        assert np.abs(song.samples.mean(axis=0)).max() < 1e-3, genre
        assert np.abs(song.samples[-100:]).max() < 1e-3, f"{genre} is cut off"
        assert np.abs(song.samples[:100]).max() < 1e-3, genre
        assert np.abs(song.samples[:, 0] - song.samples[:, 1]).max() > 0.01, f"{genre} is mono"


def test_sections_differ_in_fullness(songs):
    """Energy raises the level above 2 kHz."""
    for genre, song in songs.items():
        high = sosfilt(butter(2, 2000.0, "highpass", fs=RATE_HZ, output="sos"), song.samples, axis=0)
        level = {}
        for section in song.sections:
            start, end = (song.bar_times_s[i] for i in (section.first_bar, section.first_bar + section.bars))
            level[section.energy] = np.std(high[round(start * RATE_HZ) : round(end * RATE_HZ)])
        assert level[max(level)] > 1.1 * level[min(level)], genre


def test_one_seed_one_song_another_seed_another():
    songs = [render_song("hip-hop", n_bars=4, seed=seed) for seed in (5, 5, 6)]
    assert songs[0].samples.tobytes() == songs[1].samples.tobytes()
    length = min(len(songs[0].samples), len(songs[2].samples))
    assert not np.allclose(songs[0].samples[:length], songs[2].samples[:length], atol=0.01)


def test_a_waltz_counts_to_three():
    song = render_song("waltz", bpm=90.0, n_bars=8)
    assert song.beats_per_bar == 3 and song.n_bars == 8
    assert np.diff(song.bar_times_s) == pytest.approx(2.0, abs=1e-4)


def test_a_ramp_arrives():
    song = render_song("house", bpm=90.0, ramp_to_bpm=140.0, duration_s=30.0)
    tempo = 60.0 / np.diff(song.beat_times_s)
    assert tempo[0] == pytest.approx(90.0, abs=1.0) and tempo[-1] == pytest.approx(140.0, abs=1.0)
    assert (np.diff(tempo) > 0).all()
    assert song.beat_times_s[-1] - song.beat_times_s[0] == pytest.approx(30.0, abs=2.5)


def test_a_map_of_tempi_is_kept():
    song = render_song("disco", n_bars=8, tempo_map=[(0, 100), (16, 100), (32, 130)])
    tempo = 60.0 / np.diff(song.beat_times_s)
    assert tempo[:15] == pytest.approx(100.0, abs=0.05) and tempo[-1] == pytest.approx(130.0, abs=1.0)
    timed = render_song("disco", duration_s=20.0, tempo_map=[(0, 100), (16, 100), (32, 130)])
    assert timed.beat_times_s[-1] == pytest.approx(20.25, abs=2.5)


@pytest.mark.parametrize("n_bars", [*range(2, 40), 70, 129])
def test_sections_tile_the_song(n_bars):
    for phrase in (4, 8):
        sections = form(n_bars, phrase)
        ends = [section.first_bar + section.bars for section in sections]
        assert [0, *ends[:-1]] == [section.first_bar for section in sections] and ends[-1] == n_bars
        assert all(section.bars >= 1 and 0 < section.energy <= 1 for section in sections)
        assert any(section.name == "chorus" for section in sections)


def test_a_song_and_its_ground_truth_are_written(tmp_path, songs):
    song = songs["waltz"]
    for suffix in ("flac", "wav", "ogg"):
        path = tmp_path / f"song.{suffix}"
        write_song(path, song, truth_path=tmp_path / "song.json")
        samples, rate_hz = soundfile.read(path, dtype="float32")
        assert rate_hz == RATE_HZ and samples.shape == song.samples.shape
        assert np.corrcoef(samples[:, 0], song.samples[:, 0])[0, 1] > 0.99
    truth = json.loads((tmp_path / "song.json").read_text())
    assert truth["beat_times_s"] == song.beat_times_s.tolist()
    assert truth["sections"][-1]["end_s"] == song.beat_times_s[-1]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["song.flac", "song.json", "song.ogg", "song.wav"]


def test_wrong_arguments_are_named(tmp_path, songs):
    for wrong, message in [
        ({"style": "polka", "n_bars": 4}, "genre among"),
        ({"style": "house"}, "either n_bars or duration_s"),
        ({"style": "house", "n_bars": 4, "duration_s": 9.0}, "either n_bars or duration_s"),
        ({"style": "house", "n_bars": 1}, "two bars"),
        ({"style": "house", "n_bars": 4, "bpm": 5.0}, "tempo of"),
        ({"style": "house", "n_bars": 4, "bpm": float("nan")}, "tempo of"),
        ({"style": "house", "n_bars": 4, "swing": 1.5}, "swing"),
        ({"style": "house", "n_bars": 4, "seed": -1}, "seed"),
        ({"style": "house", "n_bars": 4, "lead_in_s": -1.0}, "lead-in"),
        ({"style": "house", "duration_s": float("nan")}, "duration"),
    ]:
        with pytest.raises(ParameterError, match=message):
            render_song(**wrong)
    with pytest.raises(ParameterError, match="song file"):
        write_song(tmp_path / "song.mp3", songs["house"])
    with pytest.raises(ParameterError, match="no folder"):
        write_song(tmp_path / "nowhere" / "song.wav", songs["house"])


def test_patterns_fill_whole_bars():
    for style in STYLES.values():
        sources = [*style.lanes, *style.parts]
        for pattern in [p for source in sources for p in source.patterns] + [p for _, p in style.fills]:
            assert len(pattern) % style.steps_per_bar == 0, (style.name, pattern)


def test_benchmark_songs_cover_the_tempi():
    groups = {
        group: [song for song in BENCHMARK_SONGS if song.group == group]
        for group in ("steady", "ramp", "swung")
    }
    assert len(groups["steady"]) >= 8 and len(groups["ramp"]) >= 3 and len(groups["swung"]) >= 3
    assert min(s.bpm for s in groups["steady"]) == 85 and max(s.bpm for s in groups["steady"]) > 160
    assert (
        len({song.seed for song in BENCHMARK_SONGS}) == len(BENCHMARK_SONGS)
        and min(s.seed for s in BENCHMARK_SONGS) >= FIRST_SEED
    )
    metres = [METRE_STYLES[s.genre].beats_per_bar for s in BENCHMARK_SONGS if s.group == "metre"]
    assert sorted(set(metres)) == [5, 6, 7]
    assert {164.0, 172.0} <= {s.bpm for s in BENCHMARK_SONGS if s.group == "level"}
    song = groups["ramp"][0].render()
    assert 45.0 < song.duration_s < 60.0
