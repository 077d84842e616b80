"""`choreograph study` as a user meets it."""

import json

import pytest
from command_line import assert_one_line, run
from synthetic_studies import choose_all, rate_all


def test_a_study_is_written_rated_and_shown(tmp_path, db, song):
    study = tmp_path / "study"
    options = ("--db", db, "--songs", song.parent, "-o", study)
    written = run("study", "write", *options, "--variants", "random", "--variants", "ours",
                  "--excerpt", 2.0, "--silent")  # fmt: skip
    assert written.exit_code == 0, written.output
    assert "2 dances of 2 variants" in written.stdout
    rate_all(study, {"random": 1.0, "ours": 4.0}, n_raters=3)
    shown = run("study", "show", study)
    assert shown.exit_code == 0, shown.output
    assert shown.stdout.index("ours") < shown.stdout.index("random") and "3 raters, 1 song;" in shown.stdout
    ratings = tmp_path / "ratings.json"
    assert run("study", "show", study, "--json", ratings).exit_code == 0
    assert json.loads(ratings.read_text()) == json.loads(run("study", "show", study, "--json", "-").stdout)
    assert_one_line(run("study", "write", *options), says="already")


def test_pairs_are_written_answered_and_shown(tmp_path, db, song):
    study = tmp_path / "study"
    written = run("study", "write", "--db", db, "--songs", song.parent, "-o", study, "--variants", "random",
                  "--variants", "ours", "--excerpt", 2.0, "--silent", "--ask", "pairs")  # fmt: skip
    assert written.exit_code == 0, written.output
    choose_all(study, {"random": 1e6, "ours": 1.0}, n_raters=3)
    shown = run("study", "show", study)
    assert shown.exit_code == 0, shown.output
    assert "Which was made by a computer?" in shown.stdout and "random, not ours: 1.00" in shown.stdout


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["write", "--songs", "nowhere", "-o", "new"], "nowhere"),
        (["write", "--songs", "{songs}", "-o", "new", "--variants", "grace"], "grace"),
        (["show", "nowhere"], "nowhere"),
    ],
)
def test_what_cannot_be_studied(tmp_path, monkeypatch, db, song, options, says):
    monkeypatch.chdir(tmp_path)
    result = run("study", *(song.parent if option == "{songs}" else option for option in options))
    assert_one_line(result, says=says)
    assert not list(tmp_path.iterdir())
