"""Songs that rollouts learn from beside those of the takes: of the takes' genres, over the tempi of each."""

from __future__ import annotations

from dataclasses import replace

import pytest
from synthetic_repertoire import synthetic_repertoire, synthetic_takes, with_counts

from choreograph.motion.motion import Credits
from choreograph.music.song import load_song
from choreograph.music.synthesis.song import STYLES
from choreograph.pipeline import building as module
from choreograph.pipeline.building import synthesised_songs, teach_rollout


@pytest.fixture(autouse=True)
def two_short_songs(monkeypatch):
    monkeypatch.setattr(module, "SONG_S", 16.0)
    monkeypatch.setattr(module, "SONGS_PER_GENRE", 2)


def test_songs_are_of_the_known_genres_over_their_tempi_and_rendered_once(tmp_path, monkeypatch):
    tempi_bpm, seen = [], []
    render = module.render_song

    def rendered(genre, *, bpm, **settings):
        tempi_bpm.append(bpm)
        return render(genre, bpm=bpm, **settings)

    monkeypatch.setattr(module, "render_song", rendered)
    songs = synthesised_songs(["waltz", "minuet", "", "waltz"], tmp_path, lambda *done: seen.append(done[1:]))
    assert list(songs.values()) == ["waltz", "waltz"]
    assert tempi_bpm == list(STYLES["waltz"].bpm) and seen == [(1, 2), (2, 2)]
    assert all(load_song(path).duration_s == pytest.approx(16.0, abs=6.0) for path in songs)
    assert synthesised_songs(["waltz"], tmp_path) == songs and len(tempi_bpm) == 2
    assert synthesised_songs(["minuet"], tmp_path) == {}


@pytest.mark.slow
def test_the_teacher_dances_to_them_on_their_count(tmp_path):
    house = Credits(genre="house")
    counted = [replace(m, take=replace(m.take, credits=house)) for m in with_counts(synthetic_takes())]
    repertoire = synthetic_repertoire(tmp_path / "rep.h5", counted, vocabulary=True)
    song = tmp_path / "own.flac"
    module.write_song(song, module.render_song("house", bpm=120.0, duration_s=16.0, seed=1))
    takes = [replace(counted[0].take, song_path=song)]
    dances = teach_rollout(repertoire, takes, tmp_path / "dances", beats="tempo-path", seed=0)
    assert [dance.song_path.stem for dance in dances] == ["own", "house-0", "house-1"]
    assert all(dance.credits == house and dance.counts.has_bars for dance in dances)
