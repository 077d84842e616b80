"""Constraints and settings of `choreograph dance`, and how those that cannot be met are refused."""

from __future__ import annotations

import json

import pytest
from command_line import assert_one_line, run

pytestmark = pytest.mark.slow


@pytest.fixture
def here(song, db_with_motifs, tmp_path, monkeypatch):
    """A working folder with the song and the repertoire."""
    (tmp_path / "rep.h5").symlink_to(db_with_motifs)
    (tmp_path / "song.wav").symlink_to(song)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def danced(*options: object) -> dict:
    result = run("dance", "song.wav", "--db", "rep.h5", "-o", "p.json", "--json", *options)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_engine_pins_and_bans(here):
    facts = danced(
        "--engine", "mixer", "--pin", "1.2=motif:1", "--pin", "3-5=take:take1", "--ban", "take:take2"
    )
    assert facts["engine"] == "mixer"
    plan = json.loads((here / "p.json").read_text())
    assert [w["motif"] for w in plan["words"] if w["start_s"] <= 1.2 < w["end_s"]] == [1]
    assert {w["take"] for w in plan["words"] if w["start_s"] >= 3 and w["end_s"] <= 5} == {"take1"}
    assert "take2" not in {take["name"] for take in facts["takes"]}
    assert sum(take["seconds"] for take in facts["takes"]) == pytest.approx(6.0, abs=0.01)
    again = run("dance", "song.wav", "--db", "rep.h5", "--plan", "p.json", "-o", "again.html", "-o", "a.png")
    assert again.exit_code == 0, again.output
    assert "motion words" in again.output


def test_a_signature_is_written_and_followed(here):
    assert run("inspect", "rep.h5", "--signature", "b", "-o", "mine.json").exit_code == 0
    facts = danced("--engine", "mixer", "--signature", "mine.json")
    shares = json.loads((here / "mine.json").read_text())["shares"]
    assert all(shares[motif] > 0 for motif in facts["motifs"])


def test_a_sequence_from_a_plan_from_a_list_and_from_a_take(here):
    first = danced("--engine", "mixer", "--genre", "c")["motifs"]
    (here / "old.json").write_text((here / "p.json").read_text())
    assert danced("--motifs", "old.json", "--seed", 3)["motifs"] == first
    (here / "list.json").write_text(json.dumps(first[:3]))
    assert danced("--motifs", "list.json")["motifs"][:3] == first[:3]
    facts = danced("--motifs", "take1")
    assert facts["engine"] == "mixer" and any("motifs were given" in note for note in facts["notes"])


def test_variations_are_numbered(here):
    result = run(
        "dance", "song.wav", "--db", "rep.h5", "--engine", "mixer", "--variations", 2, "-o", "v.json"
    )
    assert result.exit_code == 0, result.output
    assert not (here / "v.json").exists()
    words = [json.loads((here / f"v-{n}.json").read_text())["words"] for n in (1, 2)]
    assert words[0] != words[1]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--engine", "steam"], "engine"),
        (["--pin", "1.0=motif"], "--pin"),
        (["--ban", "nobody"], "--ban"),
        (["--pin", "1.0=motif:99"], "motif 99"),
        (["--pin", "7=motif:1"], "6 s"),
        (["--pin", "1-3=take:nobody"], "nobody"),
        (["--genre", "polka"], "polka"),
        (["--signature", "none.json"], "none.json"),
        (["--motifs", "none.json"], "none.json"),
        (["--motifs", "nobody"], "nobody"),
        (["--set", "planer=greedy"], "the most similar one is 'planner'"),
        (["--set", "candidates"], "expected NAME=VALUE, got 'candidates'"),
        (["--set", "candidates=few"], "expected candidates as whole number of 1 or more, got 'few'"),
        (["--set", "fps=30", "--fps", "60"], "expected fps once, got --fps and --set fps"),
        (["--set", "fps=30", "--set", "fps=60"], "expected a value of fps once, got several"),
        (["--weight", "genre=1", "--weight", "genre=2"], "expected the weight of genre once, got several"),
        (["--engine", "graph", "--motifs", "take1"], "graph engine"),
        (["--variations", "0"], "1 to 1000 variations"),
    ],
)
def test_constraints_that_cannot_be_met(here, options, says):
    assert_one_line(run("dance", "song.wav", "--db", "rep.h5", "-o", "x.bvh", *options), says=says)
    assert not (here / "x.bvh").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--engine", "mixer", "--set", "warping=none"], "graph engine"),
        (["--engine", "mixer", "--set", "warping=dtw"], "graph engine"),  # its default, but given
        (["--engine", "mixer", "--set", "candidates=3"], "graph engine"),
        (["--engine", "mixer", "--set", "selection=random"], "graph engine"),
        (["--engine", "mixer", "--set", "transitions=seconds"], "graph engine"),
        (["--engine", "mixer", "--weight", "genre=2"], "graph engine"),
        (["--engine", "mixer", "--set", "style_song=song.wav"], "rollout engine"),
        (["--engine", "rollout", "--set", "planner=greedy"], "rollout engine"),
    ],
)
def test_a_setting_that_the_engine_does_not_use_is_refused(here, options, says):
    result = run("dance", "song.wav", "--db", "rep.h5", "-o", "x.bvh", *options)
    assert_one_line(result, says=says)
    assert not (here / "x.bvh").exists()


@pytest.mark.parametrize(
    "options",
    [
        ["--engine", "graph"],
        ["--set", "planner=greedy"],
        ["--seed", "0"],
        ["--weight", "genre=2"],
        ["--start", "0"],
        ["--fps", "60"],
        ["--pin", "1=motif:1"],
        ["--variations", "2"],
        ["--config", "none.toml"],
    ],
)
def test_a_setting_that_the_plan_decides_is_refused(here, options):
    result = run("dance", "song.wav", "--db", "rep.h5", "-o", "x.bvh", "--plan", "none.json", *options)
    assert_one_line(result, says=f"expected no {options[0]} beside --plan, which decides what")


def test_a_signature_needs_a_file_and_a_name(here):
    for options in (["--signature", "b"], ["-o", "x.json"], ["--signature", "nobody", "-o", "x.json"]):
        assert run("inspect", "rep.h5", *options).exit_code == 2


def test_clicks_are_for_videos(here):
    refused = run("dance", "song.wav", "--db", "rep.h5", "-o", "x.bvh", "--click")
    assert_one_line(refused, says="expected .mp4 for --click, got")
    assert run("dance", "song.wav", "--db", "rep.h5", "--duration", "1", "-o", "p.json").exit_code == 0
    refused = run("dance", "song.wav", "--db", "rep.h5", "--plan", "p.json", "-o", "x.html", "--click")
    assert_one_line(refused, says="expected .mp4 for --click, got")
    assert not (here / "x.html").exists()
    again = run(
        "dance", "song.wav", "--db", "rep.h5", "--plan", "p.json", "-o", "x.mp4", "-o", "x.bvh", "--click"
    )
    assert again.exit_code == 0, again.output
    assert (here / "x.mp4").exists() and (here / "x.bvh").exists()
