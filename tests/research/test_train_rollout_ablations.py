"""Synthesised songs that a rollout network can learn from: of the takes' genres, over the tempi of each."""

from __future__ import annotations

import pytest

from choreograph.music.song import load_song
from content.songs.synthesis.song import STYLES
from research import train_rollout_ablations as module


def test_songs_are_of_the_known_genres_over_their_tempi_and_rendered_once(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "SONG_S", 16.0)
    monkeypatch.setattr(module, "AGAIN_PER_GENRE", 2)
    tempi_bpm, render = [], module.render_song

    def rendered(genre, *, bpm, **settings):
        tempi_bpm.append(bpm)
        return render(genre, bpm=bpm, **settings)

    monkeypatch.setattr(module, "render_song", rendered)
    songs = module.synthesised_songs(["waltz", "minuet", "", "waltz"], tmp_path)
    assert list(songs.values()) == ["waltz", "waltz"] and tempi_bpm == list(STYLES["waltz"].bpm)
    assert all(load_song(path).duration_s == pytest.approx(16.0, abs=6.0) for path in songs)
    assert module.synthesised_songs(["waltz"], tmp_path) == songs and len(tempi_bpm) == 2
    assert module.synthesised_songs(["minuet"], tmp_path) == {}
