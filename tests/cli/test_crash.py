"""What the program does about the unexpected: one line and a log, or the traceback where it is asked for."""

import os
import subprocess
import sys

import pytest

_BROKEN = """
import choreograph.cli.inspect
from choreograph.cli.main import run

def broken(**_):
    raise {error}

choreograph.cli.inspect.songs.callback = broken
run()
"""


@pytest.fixture
def run_broken(tmp_path):
    """Runs `choreograph songs` where it raises, with folders of its own for logs."""

    def run(error, **environment):
        own = {"HOME": str(tmp_path / "home"), "XDG_STATE_HOME": "", "CHOREOGRAPH_DEBUG": ""}
        (tmp_path / "home").mkdir(exist_ok=True)
        return subprocess.run(
            [sys.executable, "-c", _BROKEN.format(error=error), "songs"],
            env={**os.environ, **own, **environment}, capture_output=True, text=True, timeout=120,
        )  # fmt: skip

    return run


def test_an_unexpected_error_is_one_line_and_a_log(run_broken, tmp_path):
    done = run_broken("RuntimeError('first\\nsecond')")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("choreograph: unexpected RuntimeError: first second: ")
    (log,) = [path for path in (tmp_path / "home").rglob("*.log")]
    assert line.endswith(str(log))
    text = log.read_text()
    assert text.startswith("choreograph ") and "Traceback" in text and "in broken" in text


def test_the_log_goes_to_the_temporary_folder_where_there_is_no_home(run_broken, tmp_path):
    file, temporary = tmp_path / "file", tmp_path / "tmp"
    file.touch()
    temporary.mkdir()
    done = run_broken("MemoryError()", HOME=str(file), TMPDIR=str(temporary))
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.endswith(str(next(temporary.glob("*.log"))))


def test_the_traceback_is_shown_on_request(run_broken, tmp_path):
    done = run_broken("RuntimeError('first')", CHOREOGRAPH_DEBUG="1")
    assert done.returncode == 1
    assert "Traceback" in done.stderr and "in broken" in done.stderr
    assert not list((tmp_path / "home").rglob("*.log"))


def test_an_interruption_and_a_closed_pipe_are_quiet(run_broken):
    done = run_broken("KeyboardInterrupt()")
    assert (done.returncode, done.stderr) == (130, "choreograph: interrupted\n")
    done = run_broken("BrokenPipeError(32, 'Broken pipe')")
    assert done.returncode == 1 and done.stderr == ""
