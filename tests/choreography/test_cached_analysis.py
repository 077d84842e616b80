"""Analyses in the cache: the same dance, other keys, damaged files, two processes, a bound in bytes."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import soundfile

import choreograph as cg
from choreograph.choreography import song_analysis
from choreograph.choreography.graph import engine
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.cache import DiskCache
from choreograph.music import song as song_module
from choreograph.music.song import cached_song, load_song
from choreograph.nets.inference import WordEmbedder

STARTER = cg.starter_repertoire()
SONG = cg.load_song(cg.example_songs()["house"], duration_s=9.0)


@pytest.fixture(scope="module")
def analysed():
    features, notes = analyse_song(SONG, STARTER)
    return dataclasses.replace(features, stops_s=((3.1, 5.05),)), notes  # as if a bar were silent


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("CHOREOGRAPH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "analyses"


@pytest.fixture
def made(monkeypatch, analysed):
    """The number of analyses that were made rather than read."""
    calls = []

    def analysis(*arguments):
        calls.append(arguments)
        return analysed

    monkeypatch.setattr(song_analysis, "_analysis", analysis)
    return calls


def flat(value):
    """A nested dataclass as bytes and plain values."""
    if isinstance(value, np.ndarray):
        return str(value.dtype), value.shape, value.tobytes()
    if dataclasses.is_dataclass(value):
        return [flat(getattr(value, field.name)) for field in dataclasses.fields(value)]
    return [flat(item) for item in value] if isinstance(value, tuple) else value


def test_an_analysis_comes_back_bit_by_bit(cache, made, analysed):
    first, again = (analyse_song(SONG, STARTER, keep=True) for _ in range(2))
    assert flat(first) == flat(again) == flat(analysed)
    assert len(analysed[0].form.phrases) and len(made) == 1 and len(list(cache.iterdir())) == 1


def test_dances_have_the_same_bytes_with_and_without_the_cache(cache, tmp_path):
    paths = [tmp_path / name for name in ("without.npz", "made.npz", "read.npz")]
    dances = [cg.dance(SONG, cache=use) for use in (False, True, True)]
    for dance, path in zip(dances, paths, strict=True):
        dance.save(path)
    assert len({path.read_bytes() for path in paths}) == 1
    assert len({dance.plan.to_json() for dance in dances}) == len({dance.notes for dance in dances}) == 1
    assert len(list(cache.iterdir())) == 1


@pytest.fixture
def decoded(monkeypatch):
    """The number of files that were decoded."""
    calls = []

    def counted(*arguments, **keywords):
        calls.append(arguments)
        return load_song(*arguments, **keywords)

    monkeypatch.setattr(song_module, "load_song", counted)
    return calls


def test_a_file_of_which_all_is_known_is_not_decoded(cache, tmp_path, decoded):
    path = tmp_path / "song.wav"
    soundfile.write(path, SONG.samples, 22050)
    first, again = (cg.dance(path, duration_s=8.0) for _ in range(2))
    assert len(decoded) == 1
    assert first.plan.to_json() == again.plan.to_json() and first.notes == again.notes
    known, whole = cached_song(path, start_s=0.0, duration_s=8.0), cg.load_song(path, duration_s=8.0)
    assert (known.name, known.notes, known.start_s) == (whole.name, whole.notes, whole.start_s)
    assert known.duration_s == whole.duration_s and known.samples_sha256 == whole.samples_sha256
    assert not hasattr(known, "another") and len(decoded) == 1
    assert (known.samples == whole.samples).all() and len(decoded) == 2
    assert known.part(2.0, 3.0).samples_sha256 == whole.part(2.0, 3.0).samples_sha256 and len(decoded) == 2
    known.forget_samples()
    assert (known.samples == whole.samples).all() and len(decoded) == 3


def test_other_content_other_parts_and_other_names_of_files_are_decoded(cache, tmp_path, decoded):
    paths = [tmp_path / name for name in ("a.wav", "b.wav")]
    for path in paths:
        soundfile.write(path, SONG.samples, 22050)
    parts = ((paths[0], 0.0, 3.0), (paths[1], 0.0, 3.0), (paths[0], 0.0, 4.0), (paths[0], 1.0, 3.0))
    for n_decoded, (path, start_s, duration_s) in enumerate(parts, start=1):
        song = cached_song(path, start_s=start_s, duration_s=duration_s)
        assert song.duration_s == duration_s and len(decoded) == n_decoded
    soundfile.write(paths[0], 0.5 * SONG.samples, 22050)
    cached_song(paths[0], start_s=0.0, duration_s=3.0)
    assert len(decoded) == 5
    cached_song(paths[0], start_s=0.0, duration_s=3.0)
    assert len(decoded) == 5


def test_a_known_song_that_ends_early_has_its_note_again(cache, tmp_path, decoded):
    path = tmp_path / "short.wav"
    soundfile.write(path, SONG.samples[: 5 * 22050], 22050)
    first, again = (cached_song(path, start_s=0.0, duration_s=8.0) for _ in range(2))
    assert len(decoded) == 1 and first.notes == again.notes and "the song ends" in again.notes[0]


def test_files_that_are_no_songs_are_refused_as_ever(cache, tmp_path):
    (tmp_path / "empty.wav").touch()
    (tmp_path / "text.wav").write_text("no sound")
    for name in ("empty.wav", "text.wav", "missing.wav", "."):
        with pytest.raises(cg.FormatError):
            cached_song(tmp_path / name, start_s=0.0, duration_s=None)


def test_without_the_setting_nothing_is_kept(cache):
    cg.dance(SONG, engine="mixer", cache=False)
    assert not cache.exists()


def test_anything_that_an_analysis_depends_on_makes_another_entry(cache, made, tmp_path):
    beats = tmp_path / "song.beats"
    beats.write_text("0.5\n1.0\n")
    louder = dataclasses.replace(SONG, samples=SONG.samples * np.float32(0.5))
    copied = tmp_path / "copy.h5"
    copied.write_bytes(STARTER.path.read_bytes() + b" ")
    requests = [
        (SONG, {}), (louder, {}), (dataclasses.replace(SONG, name="other"), {}), (SONG, {"genre": "waltz"}),
        (SONG, {"beats": "tempo-path"}), (SONG, {"beats": beats}),
        (dataclasses.replace(SONG, start_s=1.0), {"beats": beats}),
    ]  # fmt: skip
    for song, options in requests:
        analyse_song(song, STARTER, keep=True, **options)
    beats.write_text("0.6\n1.0\n")
    analyse_song(SONG, STARTER, keep=True, beats=beats)
    analyse_song(SONG, cg.Repertoire.open(copied), keep=True)
    assert len(made) == len(list(cache.iterdir())) == len(requests) + 2


@pytest.mark.parametrize(
    "damage", [lambda data: data[:-9], lambda data: b"", lambda data: data[:99] + b"!" + data[100:]]
)
def test_a_damaged_entry_is_made_anew(cache, made, damage, caplog):
    analyse_song(SONG, STARTER, keep=True)
    (entry,) = cache.iterdir()
    whole = entry.read_bytes()
    entry.write_bytes(damage(whole))
    analyse_song(SONG, STARTER, keep=True)
    assert "damaged" in caplog.text and len(made) == 2 and entry.read_bytes() == whole


def test_the_entries_used_last_are_kept_within_the_bound(cache, made, monkeypatch):
    songs = [dataclasses.replace(SONG, name=f"song {number}") for number in range(4)]
    for number, song in enumerate(songs[:3]):
        analyse_song(song, STARTER, keep=True)
        os.utime(max(cache.iterdir(), key=lambda path: path.stat().st_mtime_ns), (number, number))
    analyse_song(songs[0], STARTER, keep=True)  # the oldest, used now
    size = max(path.stat().st_size for path in cache.iterdir())
    monkeypatch.setattr(song_analysis, "analyses_cache", lambda: DiskCache.of_user("analyses", 3 * size + 99))
    analyse_song(songs[3], STARTER, keep=True)
    assert len(list(cache.iterdir())) == 3 and len(made) == 4
    for song, n_made in ((songs[0], 4), (songs[2], 4), (songs[3], 4), (songs[1], 5)):
        analyse_song(song, STARTER, keep=True)
        assert len(made) == n_made


def test_two_processes_at_once_leave_one_whole_entry(cache, tmp_path):
    code = (
        "import sys, choreograph as cg\n"
        "song = cg.load_song(cg.example_songs()['house'], duration_s=8.0)\n"
        "cg.dance(song).save(sys.argv[1])\n"
    )
    paths = [tmp_path / f"{number}.npz" for number in range(2)]
    running = [subprocess.Popen([sys.executable, "-c", code, str(path)]) for path in paths]
    assert [process.wait(timeout=600) for process in running] == [0, 0]
    assert len({path.read_bytes() for path in paths}) == 1
    (entry,) = cache.iterdir()
    stored = entry.read_bytes()
    assert hashlib.sha256(stored[32:]).digest() == stored[:32]


def test_where_nothing_can_be_written_the_song_is_analysed(made, monkeypatch, tmp_path, caplog):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("CHOREOGRAPH_CACHE", str(blocked))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(blocked))
    for _ in range(2):
        analyse_song(SONG, STARTER, keep=True)
    assert len(made) == 2 and "not kept" in caplog.text


# The motifs of spans of takes.


@pytest.fixture
def motifs_cache(cache):
    return cache.parent / "motifs"


@pytest.fixture
def embedded(monkeypatch):
    """The number of words that were embedded."""
    calls = []
    embed = WordEmbedder.embed

    def counted(net, words_m):
        calls.append(len(words_m))
        return embed(net, words_m)

    monkeypatch.setattr(WordEmbedder, "embed", counted)
    return calls


def looked_up(n_spans=600, path=STARTER.path, **options):
    """Motifs of spans of takes of a repertoire, by default the built-in one, which is opened again."""
    repertoire = cg.Repertoire.open(path)
    take, start_s = np.divmod(np.arange(n_spans), 200)
    with engine.cached_spans(repertoire, **options) as spans:
        return spans.motifs_of(take, start_s / 10, start_s / 10 + 0.5), repertoire


def test_the_motifs_of_spans_are_kept(motifs_cache, embedded):
    first, _ = looked_up()
    assert sum(embedded) >= 600 and len(list(motifs_cache.iterdir())) == 1
    embedded.clear()
    again, _ = looked_up()
    assert not embedded
    np.testing.assert_array_equal(first, again)


def test_few_new_spans_are_not_written_and_many_are_added(motifs_cache, embedded):
    looked_up(n_spans=100)
    assert not list(motifs_cache.iterdir())
    looked_up(n_spans=600)
    looked_up(n_spans=1400)
    embedded.clear()
    looked_up(n_spans=1400)
    assert not embedded


def test_no_more_spans_than_the_bound_are_written(motifs_cache):
    looked_up(most_spans=599)
    assert not list(motifs_cache.iterdir())


def test_spans_of_a_file_that_was_changed_are_looked_up_again(motifs_cache, embedded, tmp_path):
    path = shutil.copy(STARTER.path, tmp_path / "rep.h5")
    looked_up(path=path)
    embedded.clear()
    looked_up(path=path)
    assert not embedded
    os.utime(path, (0, 0))
    looked_up(path=path)
    assert sum(embedded) >= 600


def test_damaged_spans_are_looked_up_again(motifs_cache, embedded, caplog):
    first, _ = looked_up()
    (entry,) = motifs_cache.iterdir()
    content = bytearray(entry.read_bytes())
    content[-20] ^= 1
    entry.write_bytes(bytes(content))
    again, _ = looked_up()
    assert "damaged" in caplog.text
    np.testing.assert_array_equal(first, again)
