"""`python -m research.study` as its user meets it."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from synthetic_repertoire import synthetic_repertoire, write_clicks
from synthetic_studies import choose_all, rate_all

from choreograph.core.errors import ChoreographError, ParameterError
from research.study import __main__ as program


@pytest.fixture
def db(tmp_path_factory) -> Path:
    return synthetic_repertoire(tmp_path_factory.mktemp("db") / "rep.h5").path


@pytest.fixture
def song(tmp_path_factory) -> Path:
    return write_clicks(tmp_path_factory.mktemp("songs") / "song.wav", duration_s=6.0)


def run(*arguments: object) -> Result:
    """The result of `python -m research.study ARGUMENTS`."""
    return CliRunner().invoke(program.command, [str(argument) for argument in arguments])


def test_a_study_is_written_rated_and_shown(tmp_path, db, song):
    study = tmp_path / "study"
    options = ("--db", db, "--songs", song.parent, "-o", study)
    written = run("write", *options, "--variants", "random", "--variants", "ours",
                  "--excerpt", 2.0, "--silent")  # fmt: skip
    assert written.exit_code == 0, written.output
    assert "2 dances of 2 variants" in written.stdout
    rate_all(study, {"random": 1.0, "ours": 4.0}, n_raters=3)
    shown = run("show", study)
    assert shown.exit_code == 0, shown.output
    assert shown.stdout.index("ours") < shown.stdout.index("random") and "3 raters, 1 song;" in shown.stdout
    ratings = tmp_path / "ratings.json"
    assert run("show", study, "--json", ratings).exit_code == 0
    assert json.loads(ratings.read_text()) == json.loads(run("show", study, "--json", "-").stdout)
    refused = run("write", *options).exception
    assert isinstance(refused, ParameterError) and "already" in str(refused)


def test_pairs_are_written_answered_and_shown(tmp_path, db, song):
    study = tmp_path / "study"
    written = run("write", "--db", db, "--songs", song.parent, "-o", study, "--variants", "random",
                  "--variants", "ours", "--excerpt", 2.0, "--silent", "--ask", "pairs")  # fmt: skip
    assert written.exit_code == 0, written.output
    choose_all(study, {"random": 1e6, "ours": 1.0}, n_raters=3)
    shown = run("show", study)
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
    result = run(*(song.parent if option == "{songs}" else option for option in options))
    assert says in (
        str(result.exception) if isinstance(result.exception, ChoreographError) else result.stderr
    )
    assert result.exit_code != 0 and not list(tmp_path.iterdir())
