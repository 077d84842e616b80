"""Several songs at once: a file for each, made folders, one table; one bad song stops no other."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import assert_one_line, run

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
        (["a.wav", "--loop", "-o", "a.html"], "for --loop, got .html: add -o NAME.bvh"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_said_before_any_work(songs, arguments, says):
    assert_one_line(run("dance", *arguments), says=says)
    assert not Path("new").exists()


def test_a_dance_that_loops_ends_where_it_begins(songs, db):
    danced = run("dance", "a.wav", "--db", db, "--loop", "--rest", "t", "-o", "a.bvh", "-o", "a.json")
    assert danced.exit_code == 0, danced.output
    assert re.search(r"\d bars? from", danced.stderr)
    pos_m = read_bvh(Path("a.bvh"))[0].joint_pos_m()
    assert np.allclose(pos_m[0], pos_m[-1], atol=1e-4)
