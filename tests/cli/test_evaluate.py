"""`choreograph evaluate` as a user meets it."""

import json

import pytest
from click.testing import CliRunner
from synthetic_motions import stepping
from synthetic_repertoire import synthetic_repertoire, write_clicks
from synthetic_studies import rate_all

from choreograph.cli import main
from choreograph.exporters import save_motion


@pytest.fixture(scope="module")
def db(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("db") / "rep.h5").path


@pytest.fixture(scope="module")
def songs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("songs")
    write_clicks(folder / "one.wav", duration_s=6.0)
    return folder


@pytest.fixture(scope="module")
def bvh(tmp_path_factory):
    path = tmp_path_factory.mktemp("dance") / "dance.bvh"
    save_motion(path, stepping(180))
    return path


def run(*arguments: object):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def assert_one_line(result, *, says: str) -> None:
    assert result.exit_code == 2, result.output
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert says in result.stderr and "Traceback" not in result.output


def test_dances_are_made_measured_and_told_three_ways(tmp_path, db, songs):
    pytest.importorskip("matplotlib")
    out, page = tmp_path / "out.json", tmp_path / "r.html"
    result = run("evaluate", "--db", db, "--songs", songs, "--seeds", 1, "--json", out, "--report", page)
    assert result.exit_code == 0, result.output
    data = json.loads(out.read_text(encoding="utf-8"))
    (dance,) = [d for d in data["dances"] if d["variant"] == "ours"]
    assert f"{dance['values']['f_score']:.2f}" in result.stdout
    assert "F-score" in page.read_text(encoding="utf-8")


def test_a_dance_of_ours_and_its_song(tmp_path, db, songs):
    song, bvh = songs / "one.wav", tmp_path / "made.bvh"
    assert run("dance", song, "--db", db, "-o", bvh).exit_code == 0
    before = bvh.read_bytes()
    result = run("evaluate", bvh, song, "--json", "-")
    assert result.exit_code == 0, result.output
    values = json.loads(result.stdout)["dances"][0]["values"]
    assert values["f_score"] > 0.8
    assert values["foot_slide_cm_s"] >= 0
    assert bvh.read_bytes() == before


def test_beats_may_be_given(tmp_path, bvh, songs):
    beats = tmp_path / "beats.txt"
    beats.write_text("\n".join(str(0.25 + 0.5 * i) for i in range(11)))
    off = json.loads(run("evaluate", bvh, songs / "one.wav", "--beats", beats, "--json", "-").stdout)
    assert off["dances"][0]["values"]["f_score"] < 0.2  # it rests between them
    assert off["facts"]["beats"] == "beats.txt"


def test_a_study_is_written_and_its_ratings_are_read(tmp_path, db, songs):
    study = tmp_path / "study"
    written = run("evaluate", "--db", db, "--songs", songs, "--variants", "random", "--variants", "ours",
                  "--study", study, "--excerpt", 2.0, "--silent")  # fmt: skip
    assert written.exit_code == 0, written.output
    assert "2 dances of 2 variants" in written.stdout
    rate_all(study, {"random": 1.0, "ours": 4.0}, n_raters=3)
    told = run("evaluate", "--study", study)
    assert told.exit_code == 0, told.output
    assert told.stdout.index("ours") < told.stdout.index("random") and "3 raters, 1 songs" in told.stdout
    assert_one_line(run("evaluate", "--db", db, "--songs", songs, "--study", study), says="already")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "--songs DIR"),
        (["{bvh}"], "SONG"),
        (["{bvh}", "{song}", "--songs", "{songs}"], "--songs DIR"),
        (["{bvh}", "{song}", "--variants", "paper"], "--variants"),
        (["{bvh}", "{song}", "--beats", "ear"], "ear"),
        (["{bvh}", "{song}", "--report", "no/such/r.html"], "no/such"),
        (["{song}", "{song}"], "no takes"),
        (["{bvh}", "{bvh}"], "dance.bvh"),
        (["--songs", "{songs}", "--db", "{db}", "--variants", "grace"], "grace"),
        (["--songs", "{songs}", "--db", "{db}", "--seeds", "0"], "seeds"),
        (["--songs", "{songs}", "--db", "{db}", "--only", "two"], "two"),
        (["--songs", "nowhere", "--db", "{db}"], "nowhere"),
    ],
)
def test_what_cannot_be_evaluated(tmp_path, monkeypatch, db, songs, bvh, options, says):
    monkeypatch.chdir(tmp_path)
    names = {"{bvh}": bvh, "{song}": songs / "one.wav", "{songs}": songs, "{db}": db}
    assert_one_line(run("evaluate", *(names.get(option, option) for option in options)), says=says)
    assert not list(tmp_path.iterdir())


def test_without_matplotlib_a_report_is_refused_in_one_line(tmp_path, monkeypatch, bvh, songs):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    page = tmp_path / "r.html"
    assert_one_line(run("evaluate", bvh, songs / "one.wav", "--report", page), says="'plots'")
    assert not page.exists()
