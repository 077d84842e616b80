"""`choreograph scene`: files by default, plans, and what is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import assert_one_line, run


@pytest.fixture
def asked(tmp_path, monkeypatch, db, song):
    monkeypatch.chdir(tmp_path)
    return ("scene", song, "--db", db, "--set", "candidates=4", "--dancers", "2")


@pytest.mark.slow
def test_files_by_default_and_from_the_plan(asked, db):
    result = run(*asked, "--relation", "mirror", "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert facts["outputs"] == ["song-1.bvh", "song-2.bvh", "song.html"] and len(facts["dancers"]) == 2
    assert all(Path(name).exists() for name in facts["outputs"])
    assert run(*asked, "-o", "a.json", "-o", "a.npz", "-q").output == ""
    again = run("scene", "--db", db, "--plan", "a.json", "-o", "b.npz")
    assert again.exit_code == 0 and "b.npz: 2 dancers, 1 dance, 6.0 s" in again.output
    assert Path("a-2.npz").read_bytes() == Path("b-2.npz").read_bytes()


@pytest.mark.slow
def test_files_of_others_are_kept_unless_forced(asked):
    Path("song-2.bvh").write_text("mine")
    result = run(*asked)
    assert result.exit_code == 0 and "the scene is written to song-new" in result.stderr
    assert Path("song-2.bvh").read_text() == "mine" and Path("song-new-2.bvh").exists()
    assert run(*asked, "--force").exit_code == 0 and Path("song-2.bvh").read_text() != "mine"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--dancers", "0"), "expected 1 to 32 --dancers, got 0"),
        (("--formation", "star"), "expected a formation among"),
        (("--formation", "v", "--formation", "line"), "expected one formation for the whole song"),
        (("--relation", "canon:x"), "expected a relation among"),
        (("--genre", "a", "--genre", "b"), "expected one genre unless dancers are free"),
        (("-o", "a.xyz"), "expected a format among"),
        (("--camera", "cuts", "-o", "a.bvh"), "expected .html, .mp4, .glb, .usda or .usdc for"),
        (
            ("--genre", "a", "--genre", "b", "--genre", "c", "--relation", "free"),
            "expected a genre for each of 2",
        ),
        (("--character", "gone.glb", "-o", "a.bvh"), "expected .glb or .fbx for --character"),
        (("-o", "a.bvh", "-o", "a-1.bvh", "-o", "./a.bvh"), "expected a file of its own"),
    ],
)
def test_other_options_are_refused(asked, options, says):
    words = asked[:-2] if "--dancers" in options else asked
    assert_one_line(run(*words, *options), says=says)
    assert not list(Path().iterdir())


def test_a_plan_decides_the_rest(asked, db):
    Path("a.json").write_text("{}")
    assert_one_line(run("scene", "--plan", "a.json", "--db", db), says="expected a choreograph-scene")
    assert_one_line(
        run("scene", "--plan", "a.json", "--seed", "3"),
        says="expected no --seed beside --plan, which decides what is",
    )
    assert_one_line(run("scene"), says="expected a SONG, or --plan FILE")
