"""Printed lines: no control characters, not too long, and with the reason, whatever files are called."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import assert_one_line, run
from synthetic_repertoire import synthetic_repertoire, synthetic_takes

from choreograph.cli.main import report_crash
from choreograph.cli.present import MAX_LINE, line_of, printable, show_notes

HOSTILE = "a\x1b[2J\x07[b]:smile:\x9b31m\u202e\r"
_CONTROLS = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")


def assert_printable(text: str, *, shows: str = "") -> None:
    assert not _CONTROLS.search(text), ascii(text)
    assert max(map(len, text.split("\n"))) <= MAX_LINE
    assert shows in text


def test_control_characters_become_escapes_and_letters_stay():
    assert printable("\x1b[31mé\t\n\u202e") == "\\x1b[31mé\\t\\n\\u202e"
    assert printable("Größe 歩き 👩‍👧 caf\udce9") == "Größe 歩き 👩‍👧 caf\udce9"
    assert printable("\udc9b31m") == "\\udc9b31m"  # a byte that some terminals obey


@pytest.mark.parametrize("word", ["x", "long "])
@pytest.mark.parametrize("n", [0, MAX_LINE, 10**7])
def test_of_a_long_line_the_ends_are_printed(word, n):
    line = line_of("first " + word * n + "\n" * (n > 0) + " last")
    assert len(line) <= MAX_LINE and line.startswith("first ") and line.endswith(" last")
    assert ("left out" in line) == (n > 0)


def test_a_long_path_or_value_does_not_hide_the_reason():
    path, reason = (
        "/" + "a" * 3000 + ".bvh",
        "expected takes, got nothing: " + "there is a reason for it. " * 30,
    )
    line = line_of(f"{path}: {reason}, got {path!r} and {path}: the end")
    assert reason in line and line.count("left out") == 3 and line.endswith(".bvh: the end")
    usual = "/".join(["a_usual_name"] * 30)
    assert line_of(f"{usual}: {reason}") == f"{usual}: {reason}"


def test_text_that_no_encoding_has_is_escaped():
    assert line_of("a\ud800\udfffb").encode() == b"a\\ud800\\udfffb"


def test_notes_are_lines(capfd):
    show_notes([HOSTILE, "long " * 200, "two\nlines"])
    shown = capfd.readouterr().err
    assert_printable(shown, shows="note: a\\x1b[2J")
    assert len(shown.splitlines()) == 3


@pytest.mark.parametrize(
    "arguments",
    [
        ["convert", f"{HOSTILE}.bvh", "a.glb"],
        ["convert", "x" * 3000 + ".bvh", "a.glb"],
        ["convert", "a.bvh", f"{HOSTILE}.xyz"],
        ["dance", f"{HOSTILE}.wav", "-o", "a.bvh"],
        ["dance", "a.wav", "--weight", HOSTILE],
        ["inspect", f"{HOSTILE}.h5"],
        ["evaluate", "--songs", HOSTILE, "--json", "-"],
    ],
)
def test_errors_are_lines(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert_one_line(result, says="choreograph: ")
    assert_printable(result.stderr)


@pytest.mark.parametrize(
    "arguments", [["dance", f"--{HOSTILE}"], [HOSTILE], [f"--{HOSTILE}"], ["songs", "x" * 999]]
)
def test_wrong_usage_is_printed_in_lines(arguments):
    result = run(*arguments)
    assert result.exit_code == 2 and "Error: " in result.stderr
    assert_printable(result.stderr)


def test_tables_of_songs_show_names_as_they_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = [f"{HOSTILE}.wav", "y" * 240 + ".wav"]
    for name in names:
        Path(name).write_bytes(b"no song")
    result = run("dance", *names, "-o", "{song}.npz")
    assert result.exit_code == 2
    assert_printable(result.stdout, shows="a\\x1b[2J\\x07[b]:smile:")
    assert_printable(result.stderr, shows="not danced: ")


def test_repertoires_are_listed_in_lines(tmp_path):
    takes = synthetic_takes(duration_s=10.0)
    takes[0] = replace(takes[0], take=replace(takes[0].take, name=HOSTILE))
    takes[1] = replace(takes[1], take=replace(takes[1].take, name="z" * 500))
    result = run("inspect", synthetic_repertoire(tmp_path / "rep.h5", takes).path)
    assert result.exit_code == 0
    assert_printable(result.stdout, shows="a\\x1b[2J")


@pytest.mark.parametrize("debug", ["", "1"])
def test_crashes_are_lines_and_so_are_their_logs(tmp_path, monkeypatch, capsys, debug):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", "")
    monkeypatch.setenv("CHOREOGRAPH_DEBUG", debug)
    monkeypatch.setattr("sys.argv", ["choreograph", HOSTILE])
    error = RuntimeError(HOSTILE)
    report_crash(RuntimeError, error, None)
    assert_printable(capsys.readouterr().err, shows="RuntimeError: a\\x1b")
    logs = list(tmp_path.rglob("*.log"))
    assert len(logs) == (not debug)
    for log in logs:
        assert not _CONTROLS.search(log.read_text())
