"""One process at a time works in a folder; a killed one does not block it."""

import os
import re
import signal
import subprocess
import sys
import threading

import pytest

from choreograph.core.errors import ChoreographError
from choreograph.core.files import locked_folder

_HOLD = """
import sys, time
from pathlib import Path
from choreograph.core.files import locked_folder
with locked_folder(Path(sys.argv[1]), doing="builds rep.h5"):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds a folder."""
    process = subprocess.Popen(
        [sys.executable, "-c", _HOLD, str(tmp_path / "work")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()


def test_a_second_process_is_told_who_holds_the_folder(tmp_path, holder):
    with pytest.raises(ChoreographError) as caught, locked_folder(tmp_path / "work", doing="trains"):
        pass
    told = str(caught.value)
    assert "\n" not in told
    assert re.search(rf"process {holder.pid} builds rep\.h5 since \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d", told)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_process_does_not_block(tmp_path, holder, number):
    holder.send_signal(number)
    holder.wait()
    assert (tmp_path / "work" / "lock").exists()
    with locked_folder(tmp_path / "work", doing="builds rep.h5"):
        (tmp_path / "work" / "kept").touch()
    assert os.listdir(tmp_path / "work") == ["kept"]


def test_nothing_is_left_where_nothing_was_made(tmp_path):
    with locked_folder(tmp_path / "work", doing="builds rep.h5"):
        pass
    with pytest.raises(ZeroDivisionError), locked_folder(tmp_path / "work", doing="builds rep.h5"):
        _ = 1 / 0
    assert not (tmp_path / "work").exists()


def test_threads_of_one_process_are_told_apart(tmp_path):
    held, errors = threading.Event(), []

    def second():
        held.wait()
        try:
            with locked_folder(tmp_path / "work", doing="builds rep.h5"):
                pass
        except ChoreographError as error:
            errors.append(str(error))

    thread = threading.Thread(target=second)
    thread.start()
    with locked_folder(tmp_path / "work", doing="builds rep.h5"):
        held.set()
        thread.join()
    assert len(errors) == 1


def test_a_folder_that_cannot_be_made_is_an_error_in_a_line(tmp_path):
    (tmp_path / "file").touch()
    with (
        pytest.raises(ChoreographError, match="cannot write"),
        locked_folder(tmp_path / "file" / "work", doing="x"),
    ):
        pass
