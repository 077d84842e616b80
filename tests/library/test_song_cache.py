"""Every song of a build is decoded and analysed once, whoever needs it."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_takes, write_clicks

from choreograph.core.errors import FormatError, ParameterError
from choreograph.library import songs as song_cache
from choreograph.library.building.networks import style_take
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import segment_takes
from choreograph.library.songs import SongCache, song_counts
from choreograph.music.mel import log_mel


@pytest.fixture
def decoded(monkeypatch):
    """How often each file was decoded."""
    counts: Counter = Counter()
    load_song = song_cache.load_song

    def counted(path):
        counts[path] += 1
        return load_song(path)

    monkeypatch.setattr(song_cache, "load_song", counted)
    return counts


def test_training_and_segmentation_share_one_decoding(tmp_path, decoded):
    song = write_clicks(tmp_path / "clicks.wav", duration_s=31.0)
    measured = [
        replace(m, take=replace(m.take, song_path=song)) for m in synthetic_takes(periods_s=[0.5, 0.6])
    ]
    songs = SongCache()
    mels = [style_take(m, songs).log_mel for m in measured]
    segmented, notes = segment_takes(measured, songs)
    assert decoded == {song: 1}
    assert len(mels) == 2 and not notes
    assert all(np.allclose(np.diff(take.words.start_s), 0.5, atol=0.05) for take in segmented)


def test_samples_are_kept_only_where_they_are_needed(tmp_path):
    path = write_clicks(tmp_path / "clicks.wav", duration_s=4.0)
    assert SongCache().analysed(path).song is None
    kept = SongCache(keep_samples=True).analysed(path)
    assert kept.song is not None and kept.song.duration_s == kept.duration_s


def test_a_song_that_cannot_be_read(tmp_path):
    with pytest.raises(FormatError, match="no such file"):
        SongCache().analysed(tmp_path / "gone.wav")


def test_songs_are_tracked_as_asked(tmp_path):
    path = write_clicks(tmp_path / "clicks.wav", duration_s=12.0)
    song = song_cache.load_song(path)
    for tracker in ("librosa", "tempo-path"):
        expected = song_counts(song, log_mel(song.samples), tracker)
        assert np.array_equal(SongCache(tracker).analysed(path).beat_times_s, expected.times_s)


def test_a_build_takes_its_beats_from_a_tracker_and_not_from_a_file(tmp_path):
    with pytest.raises(ParameterError, match=r"expected beats among .*librosa.*, got 'beats.txt'"):
        BuildOptions(beats="beats.txt")
