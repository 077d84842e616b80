"""`each` gives the results in order, with any number of processes, also when some of them are killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from choreograph.core.errors import ChoreographError, FormatError
from choreograph.core.workers import FEWEST, beside, each, workers


def square(number: int) -> int:
    return number * number


def where(number: int) -> int:
    return os.getpid()


def fails_at(wrong: int, number: int) -> int:
    if number == wrong:
        raise FormatError(f"{number}.bvh: expected a hierarchy, got nothing")
    return number


def dies_once(folder: Path, number: int) -> int:
    """The process is killed when it first works on 4."""
    flag = folder / "died"
    if number == 4 and not flag.exists():
        flag.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def always_dies(number: int) -> int:
    if number == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


_HELD: list[bytearray] = []


def grows(number: int) -> int:
    """The process grows by 400 MB after its first input, as one that imports torch."""
    time.sleep(0.3)
    if number > 1 and not _HELD:
        _HELD.append(bytearray(b"1" * (400 << 20)))
    return os.getpid()


@pytest.mark.parametrize("n", [1, 2])
def test_results_come_in_the_order_of_the_inputs(n):
    with workers(n):
        assert list(each(square, range(9))) == [square(i) for i in range(9)]
        assert list(each(square, [])) == []


@pytest.mark.slow
def test_a_process_that_grows_is_not_started_again(recwarn):
    with workers(2):
        assert len(set(each(grows, range(16)))) == 2
    assert not [warning for warning in recwarn if "stopped" in str(warning.message)]


def test_a_few_inputs_are_shared_where_each_takes_long():
    with workers(2):
        assert os.getpid() not in set(each(where, range(2), fewest=2))


def test_few_inputs_are_worked_on_in_this_process():
    with workers(2):
        assert set(each(where, range(FEWEST - 1))) == {os.getpid()}
        assert os.getpid() not in set(each(where, range(FEWEST)))
    assert set(each(where, range(20))) == {os.getpid()}


@pytest.mark.parametrize("n", [1, 2])
def test_results_are_given_up_to_an_error(n):
    with workers(n):
        results = each(partial(fails_at, 6), range(9))
        assert [next(results) for _ in range(6)] == list(range(6))
        with pytest.raises(FormatError, match=r"^6\.bvh: expected a hierarchy, got nothing$"):
            next(results)


def test_work_of_a_process_that_is_killed_is_done_again(tmp_path):
    with workers(2):
        assert list(each(partial(dies_once, tmp_path), range(12))) == [square(i) for i in range(12)]
    assert (tmp_path / "died").exists()


def test_an_input_whose_process_is_killed_twice_is_named(tmp_path):
    with workers(2):
        found = list(each(always_dies, range(9), killed=lambda number: -number))
        assert found == [square(i) if i != 5 else -5 for i in range(9)]
        with pytest.raises(ChoreographError, match=r"the work on 5 to end, .* killed more than once"):
            list(each(always_dies, range(9)))


def add(one: int, other: int) -> int:
    return one + other


def fails() -> int:
    raise FormatError("x.bvh: expected frames, got none")


def dies() -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


@pytest.mark.parametrize("n", [1, 2])
def test_work_beside_other_work_gives_its_result_or_its_error(n):
    with workers(n):
        with beside(partial(add, 1, 2), partial(add, 1, 2)) as result:
            other = add(3, 4)
        assert (other, n) == (7, n)
        with beside(partial(add, 1, 2), partial(add, 1, 2)) as result:
            assert result() == 3
        with beside(fails, fails) as result, pytest.raises(FormatError, match="expected frames"):
            result()
        with beside(partial(add, 1, 2), None) as result:
            assert result() == 3


def test_work_whose_process_is_killed_is_done_here():
    with workers(2), beside(partial(add, 1, 2), dies) as result:
        assert result() == 3


def test_an_error_beside_ends_the_other_process():
    with workers(2), pytest.raises(ZeroDivisionError), beside(fails, partial(time.sleep, 60)):
        raise ZeroDivisionError
    with workers(2):
        assert list(each(square, range(8))) == [square(i) for i in range(8)]


FORKED = """
import os
from choreograph.core.workers import each, workers

def twice():
    with workers(2):
        return list(each(abs, range(8)))

twice()
pid = os.fork()
if pid == 0:
    os._exit(0 if twice() == list(range(8)) else 1)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks on this system")
def test_a_fork_starts_processes_of_its_own():
    """It would wait for ever for those of its parent."""
    subprocess.run([sys.executable, "-c", FORKED], check=True, timeout=120)
