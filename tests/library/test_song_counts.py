"""A song's counts by a tracker or from a file."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import write_clicks

from choreograph.core.errors import ParameterError
from choreograph.library.songs import check_beats, song_beats, song_counts
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song


@pytest.fixture(scope="module")
def clicks(tmp_path_factory):
    song = load_song(write_clicks(tmp_path_factory.mktemp("clicks") / "a.wav", duration_s=12.4))
    return song, log_mel(song.samples)


def test_bars_of_a_file_are_kept(clicks, tmp_path):
    song, mel = clicks
    path = tmp_path / "a.beats"
    path.write_text("".join(f"{3 + 0.5 * i} {i % 3 + 1}\n" for i in range(12)))
    counts = song_counts(replace(song, start_s=3.0), mel, path)
    assert counts.source == "annotation" and counts.metre == 3
    assert counts.times_s.tolist() == (0.5 * np.arange(12)).tolist()


def test_bars_are_tracked_where_a_file_has_none(clicks, tmp_path):
    song, mel = clicks
    path = tmp_path / "a.beats"
    path.write_text("\n".join(str(0.25 + 0.5 * i) for i in range(20)))
    assert not song_beats(song, mel, path).has_bars
    counts = song_counts(song, mel, str(path))
    assert counts.has_bars and counts.source == "music" and len(counts) == 20


@pytest.mark.parametrize("name", ["tempo-path", "network"])
def test_a_tracker_by_name(clicks, name):
    song, mel = clicks
    counts = song_counts(song, mel, name)
    assert counts.has_bars and np.median(np.diff(counts.times_s)) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("beats", ["ear", 5, None, "no/such/file.txt"])
def test_neither_tracker_nor_file(clicks, beats):
    with pytest.raises(ParameterError, match="expected beats"):
        check_beats(beats)
    with pytest.raises(ParameterError, match="tempo-path"):
        song_counts(*clicks, beats)
