"""`choreograph evaluate` as a user meets it."""

import json

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping

from choreograph.formats.register import save_motion

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bvh(tmp_path_factory):
    path = tmp_path_factory.mktemp("dance") / "dance.bvh"
    save_motion(path, stepping(180))
    return path


def test_dances_are_made_measured_and_reported_three_ways(tmp_path, db, song):
    pytest.importorskip("matplotlib")
    out, page = tmp_path / "out.json", tmp_path / "r.html"
    result = run(
        "evaluate", "--db", db, "--songs", song.parent, "--seeds", 1, "--json", out, "--report", page
    )
    assert result.exit_code == 0, result.output
    data = json.loads(out.read_text(encoding="utf-8"))
    (dance,) = [d for d in data["dances"] if d["variant"] == "ours"]
    assert f"{dance['values']['f_score']:.2f}" in result.stdout
    assert "F-score" in page.read_text(encoding="utf-8")


def test_our_dance_and_its_song(tmp_path, db, song):
    bvh = tmp_path / "made.bvh"
    assert run("dance", song, "--db", db, "--beats", "tempo-path", "-o", bvh).exit_code == 0
    before = bvh.read_bytes()
    result = run("evaluate", bvh, song, "--json", "-")
    assert result.exit_code == 0, result.output
    values = json.loads(result.stdout)["dances"][0]["values"]
    assert values["f_score"] > 0.7  # poses are held before the first and after the last count
    assert values["foot_slide_cm_s"] >= 0
    assert bvh.read_bytes() == before


def test_beats_may_be_given(tmp_path, bvh, song):
    beats = tmp_path / "beats.txt"
    beats.write_text("\n".join(str(0.25 + 0.5 * i) for i in range(11)))
    off = json.loads(run("evaluate", bvh, song, "--beats", beats, "--json", "-").stdout)
    assert off["dances"][0]["values"]["f_score"] < 0.2  # the dancer rests between them
    assert off["facts"]["beats"] == "beats.txt"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "--songs DIR"),
        (["{bvh}"], "SONG"),
        (["{bvh}", "{song}", "--songs", "{songs}"], "--songs"),
        (["{bvh}", "{song}", "--variants", "engines"], "--variants"),
        (["{bvh}", "{song}", "--judge", "{db}"], "--judge"),
        (["{bvh}", "{song}", "--beats", "ear"], "ear"),
        (["{bvh}", "{song}", "--report", "no/such/r.html"], "no/such"),
        (["{song}", "{song}"], "expected takes at"),
        (["{bvh}", "{bvh}"], "dance.bvh"),
        (["--songs", "{songs}", "--db", "{db}", "--variants", "grace"], "grace"),
        (["--songs", "{songs}", "--db", "{db}", "--seeds", "0"], "seeds"),
        (["--songs", "{songs}", "--db", "{db}", "--only", "two"], "two"),
        (["--songs", "{songs}", "--db", "{db}", "--experts", "{bvh}"], "song"),
        (["--songs", "{songs}", "--db", "{db}", "--judge", "{db}"], "motifs"),
        (["--songs", "nowhere", "--db", "{db}"], "nowhere"),
    ],
)
def test_what_cannot_be_evaluated(tmp_path, monkeypatch, db, song, bvh, options, says):
    monkeypatch.chdir(tmp_path)
    names = {"{bvh}": bvh, "{song}": song, "{songs}": song.parent, "{db}": db}
    assert_one_line(run("evaluate", *(names.get(option, option) for option in options)), says=says)
    assert not list(tmp_path.iterdir())


def test_without_matplotlib_a_report_is_refused_in_one_line(tmp_path, monkeypatch, bvh, song):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    page = tmp_path / "r.html"
    assert_one_line(run("evaluate", bvh, song, "--report", page), says="'plots'")
    assert not page.exists()


def test_dances_of_several_systems_are_compared_in_one_table(tmp_path, bvh, song):
    np.save(tmp_path / "other.npy", stepping(180, seed=3).joint_pos_m())
    result = run("evaluate", bvh, tmp_path / "other.npy", song, "--json", "-")
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    assert list(data["variants"]) == [str(bvh), str(tmp_path / "other.npy")]
    alone = json.loads(run("evaluate", bvh, song, "--json", "-").stdout)
    assert data["dances"][0]["values"] == alone["dances"][0]["values"]
    assert data["dances"][1]["values"] != alone["dances"][0]["values"]
    assert_one_line(run("evaluate", bvh, bvh, song), says="got one of them twice")
    assert_one_line(run("evaluate", bvh), says="expected --songs DIR to dance to, or a DANCE and its SONG")
