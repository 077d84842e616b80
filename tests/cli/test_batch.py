"""Several songs at once: a file for each, made folders, one table; one bad song stops no other."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import assert_one_line, run
from schedulers import scheduler_with_workers

from choreograph.cli.dance import DanceJob, SongDances, _Sent, _with_files_inside
from choreograph.cli.dance import command as dance
from choreograph.cli.dance_options import DanceOptions, FileOptions, options_of
from choreograph.core.clusters import Cluster, on_staged, sent_files, staged
from choreograph.formats.bvh import read_bvh


@pytest.fixture
def songs(tmp_path, monkeypatch, song) -> list[Path]:
    monkeypatch.chdir(tmp_path)
    for name in ("a.wav", "b.wav"):
        shutil.copy(song, tmp_path / name)
    return [Path("a.wav"), Path("b.wav")]


def test_each_song_gets_its_files_and_a_row(songs, db):
    danced = run(
        "dance", *songs, "--db", db, "--duration", 5, "-o", "out/{song}.bvh", "-o", "plans/{song}.json"
    )
    assert danced.exit_code == 0, danced.output
    rows = danced.stdout.splitlines()
    assert rows[0].split()[:3] == ["song", "files", "seconds"]
    assert [row.split()[0] for row in rows[1:]] == ["a.wav", "b.wav"]
    assert all("5.0" in row and "out/" in row for row in rows[1:])
    assert sorted(str(path) for path in Path().glob("*/*")) == [
        "out/a.bvh", "out/b.bvh", "plans/a.json", "plans/b.json",
    ]  # fmt: skip


def test_a_bad_song_is_said_and_the_others_are_danced(songs, db):
    Path("bad.mp3").write_bytes(b"no song")
    danced = run("dance", "bad.mp3", *songs, "--db", db, "--duration", 8, "-o", "{song}.bvh")
    assert danced.exit_code == 2 and "1 of 3 songs could not be danced" in danced.stderr
    assert "bad.mp3" in danced.stdout.splitlines()[1]
    assert Path("a.bvh").exists() and Path("b.bvh").exists() and not Path("bad.bvh").exists()


def test_facts_of_all_songs_as_json(songs, db):
    Path("bad.mp3").write_bytes(b"no song")
    danced = run("dance", *songs, "bad.mp3", "--db", db, "--duration", 8, "--json", "-o", "{song}.bvh")
    facts = json.loads(danced.stdout)
    assert [fact.get("outputs") for fact in facts] == [["a.bvh"], ["b.bvh"], None]
    assert "bad.mp3" in facts[2]["error"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["a.wav", "b.wav", "-o", "x.bvh"], "{song}"),
        (["a.wav", "a.wav"], "a.bvh twice"),
        (["a.wav", "b.wav", "--open"], "one SONG"),
        (["a.wav", "b.wav", "--plan", "a.json"], "one SONG"),
        (["a.wav", "b.wav", "-o", "new/{song}.xyz"], "xyz"),
        (["a.wav", "b.wav", "-o", "a.wav/{song}.bvh"], "folder"),
        ([], "expected a SONG"),
        (["a.wav", "b.wav", "--workers", -1], "expected --workers of 0 or more, got -1"),
        (["a.wav", "--loop", "-o", "a.html"], "for --loop, got .html: add -o NAME.bvh"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_said_before_any_work(songs, arguments, says):
    assert_one_line(run("dance", *arguments), says=says)
    assert not Path("new").exists()


def test_a_dance_that_loops_ends_where_it_begins(songs, db):
    danced = run("dance", "a.wav", "--db", db, "--loop", "-o", "a.bvh", "-o", "a.json")
    assert danced.exit_code == 0, danced.output
    assert re.search(r"\d bars? from", danced.stderr)
    pos_m = read_bvh(Path("a.bvh"))[0].joint_pos_m()
    assert np.allclose(pos_m[0], pos_m[-1], atol=1e-4)


def outputs_of(folder: Path, *options: object) -> tuple[int, dict[str, bytes], str]:
    """What the dances to two songs and to a damaged one write to a folder, and what is printed."""
    danced = run(
        "dance", "a.wav", "bad.mp3", "b.wav", "--duration", 5, "-o", f"{folder}/{{song}}.bvh", "-o",
        f"{folder}/{{song}}.html", *options,
    )  # fmt: skip
    files = {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}
    printed = (danced.stdout + danced.stderr).replace(f"{folder}/", "")
    return danced.exit_code, files, " ".join(printed.split())


@pytest.fixture
def alone(songs, db):
    Path("bad.mp3").write_bytes(b"no song")
    found = code, files, printed = outputs_of(Path("alone"), "--db", db)
    assert (code, sorted(files)) == (2, ["a.bvh", "a.html", "b.bvh", "b.html"])
    assert "1 of 3 songs" in printed
    return found


@pytest.mark.slow
def test_songs_that_are_danced_at_once_have_the_same_bytes(alone, db):
    assert outputs_of(Path("pool"), "--db", db, "--workers", 2) == alone


@pytest.mark.slow
def test_songs_that_are_danced_by_a_cluster_have_the_same_bytes(alone, db, tmp_path):
    pytest.importorskip("distributed")
    with scheduler_with_workers(tmp_path / "workers") as address:
        assert outputs_of(Path("dask"), "--db", db, "--dask", address) == alone


@pytest.mark.slow
def test_songs_and_repertoire_are_sent_along_to_a_cluster_that_lacks_them(alone, db, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(Cluster, "lacks", lambda self, paths: True)
    with scheduler_with_workers(tmp_path / "workers") as address:
        assert outputs_of(Path("staged"), "--db", db, "--dask", address) == alone


def test_what_was_sent_is_danced_without_the_files_it_was_made_of(songs, db, tmp_path):
    here = tmp_path / "here.h5"
    here.write_bytes(Path(db).read_bytes())
    given = dance.make_context("dance", ["a.wav", "--duration", "4"]).params
    job = DanceJob(Path("a.wav").absolute(), ((Path("a.bvh"),),))
    files, asked = options_of(FileOptions, given), options_of(DanceOptions, given)
    dances = SongDances((here,), asked, files, None, False, None, None)
    sent = _Sent(dances, Path.cwd(), job, True)
    arriving = staged(sent, sent.files()), sent_files(_with_files_inside([here]))
    expected = sent.result()
    here.unlink()
    job.song.unlink()
    found = on_staged(_Sent.result, *arriving).received()
    assert not found[0].error
    assert (found[0].job, found[1]) == (expected[0].job, expected[1])


def test_a_scheduler_that_is_not_there_is_said_in_a_line(songs, db):
    pytest.importorskip("distributed")
    refused = run("dance", *songs, "--db", db, "--dask", "tcp://127.0.0.1:9")
    assert_one_line(refused, says="expected a Dask scheduler at tcp://127.0.0.1:9")
    assert not Path("a.bvh").exists()
