"""Counts of files: songs, motions with and without counts beside them, and what is written."""

from __future__ import annotations

import json

import numpy as np
import pytest
import soundfile
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.core.counts import ANNOTATED, FROM_MOTION, FROM_MUSIC
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.manifest import read_counts
from choreograph.pipeline.counting import count_file, save_counts


@pytest.fixture(scope="module")
def waltz():
    return count_file(cg.example_songs()["waltz"])


def saved_take(folder, name="waltz-03", suffix=".glb"):
    """A built-in take as a file, and its true counts."""
    repertoire = cg.starter_repertoire()
    take = repertoire.take_index(name)
    motion, _ = repertoire.motion(take, start_s=0.0, stop_s=repertoire.takes[take].duration_s)
    path = folder / f"{name}{suffix}"
    cg.save_motion(path, motion)
    return path, repertoire.counts(take)


def test_a_song_has_tempo_metre_loops_and_phrases(waltz):
    assert (waltz.kind, waltz.counts.metre, waltz.counts.source) == ("song", 3, FROM_MUSIC)
    assert waltz.tempo_bpm == pytest.approx(90.0, rel=0.01) and waltz.is_sure
    names = [figure.name for figure in waltz.figures]
    assert names[0] == "A" and len(set(names)) < len(names)  # something is repeated
    ones = waltz.counts.downbeat_times_s
    for loop in waltz.loops:
        assert np.isclose(ones, loop.start_s).any() and np.isclose(ones, loop.end_s).any()
    assert min(loop.distance for loop in waltz.loops) < 0.2


@pytest.mark.parametrize("name", ["waltz-03", "house-02"])
def test_a_motion_is_counted_from_its_movement(tmp_path, name):
    path, true = saved_take(tmp_path, name)
    counted = count_file(path)
    assert (counted.kind, counted.counts.source, counted.counts.metre) == ("motion", FROM_MOTION, true.metre)
    assert counted.tempo_bpm == pytest.approx(60 / np.median(np.diff(true.times_s)), rel=0.02)
    assert counted.is_sure and counted.counts.confidence > 0.7
    assert all(0.0 <= loop.distance < 0.5 for loop in counted.loops) and len(counted.loops) >= 3


def test_counts_beside_a_motion_are_taken(tmp_path, waltz):
    path, _ = saved_take(tmp_path)
    (tmp_path / "waltz-03.counts.csv").write_text("time_s,number,figure\n1,1,box\n2,2,\n3,1,-\n")
    counted = count_file(path)
    assert counted.counts.source == ANNOTATED and counted.is_sure
    assert counted.counts.times_s.tolist() == [1.0, 2.0, 3.0]
    assert [figure.name for figure in counted.figures] == ["box"]


def test_a_song_without_a_beat_has_no_tempo(tmp_path):
    soundfile.write(tmp_path / "quiet.wav", np.zeros(3 * 22050), 22050)
    counted = count_file(tmp_path / "quiet.wav")
    assert counted.tempo_bpm is None and not counted.is_sure and counted.loops == ()
    with pytest.raises(ParameterError, match="no clear beat"):
        save_counts(tmp_path / "quiet.csv", counted)
    assert not (tmp_path / "quiet.csv").exists()


def test_counts_are_written_as_table_facts_and_labels(tmp_path, waltz):
    for suffix in ("csv", "json", "txt"):
        save_counts(tmp_path / f"a.{suffix}", waltz)
    counts, figures = read_counts(tmp_path / "a.csv")
    np.testing.assert_allclose(counts.times_s, waltz.counts.times_s, atol=1e-5)
    assert [f.name for f in figures] == [f.name for f in waltz.figures]
    assert json.loads((tmp_path / "a.json").read_text()) == waltz.facts()
    rows = [line.split("\t") for line in (tmp_path / "a.txt").read_text().splitlines()]
    assert len(rows) == len(waltz.counts) + len(waltz.figures)
    assert [float(start) for start, _, text in rows if text == "1"] == pytest.approx(
        waltz.counts.downbeat_times_s, abs=1e-5
    )
    with pytest.raises(ParameterError, match=r"expected a name ending in \.csv, \.json, \.txt"):
        save_counts(tmp_path / "a.mid", waltz)


def test_what_cannot_be_counted_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="there is no such file"):
        count_file(tmp_path / "none.wav")
    (tmp_path / "text.wav").write_text("no sound")
    with pytest.raises(FormatError, match=r"text\.wav"):
        count_file(tmp_path / "text.wav")
    path, _ = saved_take(tmp_path)
    with pytest.raises(ParameterError, match="leave out beats"):
        count_file(path, beats="tempo-path")


def test_given_beats_are_used(tmp_path):
    song = write_clicks(tmp_path / "clicks.wav", duration_s=12.0)
    (tmp_path / "beats.txt").write_text("".join(f"{0.4 * k:.2f}\n" for k in range(30)))
    assert count_file(song, beats=tmp_path / "beats.txt").tempo_bpm == pytest.approx(150.0)
