"""The work of a real scheduler and of workers in processes of their own, which are killed and paused."""

from __future__ import annotations

import os
import signal
import threading
import time
from functools import partial
from pathlib import Path

import pytest
from schedulers import ended, free_port, scheduler_at, scheduler_with_workers, started, wait_for, worker_of

from choreograph.core.clusters import connected
from choreograph.core.errors import ChoreographError, FormatError
from choreograph.core.workers import cluster, each

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A scheduler with two workers, each with a nanny that starts it again."""
    with scheduler_with_workers(tmp_path_factory.mktemp("workers")) as address:
        yield address


def square(number: int) -> int:
    return number * number


def where(number: int) -> int:
    time.sleep(0.05)
    return os.getpid()


def fails_at(wrong: int, number: int) -> int:
    if number == wrong:
        raise FormatError(f"{number}.bvh: expected a hierarchy, got nothing")
    return number


def dies_once(folder: Path, number: int) -> int:
    flag = folder / "died"
    if number == 4 and not flag.exists():
        flag.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def always_dies(number: int) -> int:
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def test_results_come_in_order_from_the_workers(address):
    with cluster(address):
        assert list(each(square, range(9))) == [square(i) for i in range(9)]
        assert list(each(square, [])) == []
        found = set(each(where, range(8)))
    assert os.getpid() not in found and len(found) == 2


def test_files_that_workers_lack_are_found(address, tmp_path):
    (tmp_path / "song.wav").touch()
    with cluster(address) as workers:
        assert not workers.lacks([tmp_path, tmp_path / "song.wav"])
        assert workers.lacks([tmp_path, tmp_path / "other.wav"])


def test_results_are_given_up_to_an_error(address):
    with cluster(address):
        results = each(partial(fails_at, 6), range(9))
        assert [next(results) for _ in range(6)] == list(range(6))
        with pytest.raises(FormatError, match=r"^6\.bvh: expected a hierarchy, got nothing$"):
            next(results)


def test_work_of_a_worker_that_is_killed_is_done_again(address, tmp_path):
    with cluster(address):
        assert list(each(partial(dies_once, tmp_path), range(8))) == [square(i) for i in range(8)]
    assert (tmp_path / "died").exists()


def test_an_input_that_kills_its_workers_is_named(address):
    with cluster(address):
        found = list(each(always_dies, range(4), killed=lambda number: -number))
        assert found == [0, 1, -2, 9]
        with pytest.raises(ChoreographError, match=r"the work on 2 to end, .* killed"):
            list(each(always_dies, range(4)))


def test_a_scheduler_that_is_started_again_gets_the_work_again(tmp_path):
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    first, worker = scheduler_at(port), worker_of(address, tmp_path)
    with ended(worker, first):
        wait_for(address, 1)
        with cluster(address):
            results = each(where, range(30))
            seen = [next(results) for _ in range(3)]
            first.kill()
            first.wait()
            second = scheduler_at(port)
            again = worker_of(address, tmp_path)
            with ended(again, second):
                seen += list(results)
    assert len(seen) == 30


def test_a_scheduler_that_is_gone_is_said_in_a_line(tmp_path):
    address = f"tcp://127.0.0.1:{(port := free_port())}"
    scheduler, worker = scheduler_at(port), worker_of(address, tmp_path)
    with ended(worker, scheduler):
        wait_for(address, 1)
        with cluster(address):
            results = each(where, range(30))
            next(results)
            scheduler.kill()
            with pytest.raises(ChoreographError, match=f"expected the scheduler {address} .* lost them"):
                list(results)


def test_a_paused_worker_holds_up_only_its_own_work(tmp_path):
    """It goes on when it may, and the order is kept."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = scheduler_at(port)
    workers = [worker_of(address, tmp_path, "--no-nanny") for _ in range(2)]
    with ended(*workers, scheduler):
        wait_for(address, 2)
        with cluster(address):
            results = each(square, range(20))
            seen = [next(results)]
            workers[0].send_signal(signal.SIGSTOP)
            threading.Timer(3.0, workers[0].send_signal, [signal.SIGCONT]).start()
            seen += list(results)
    assert seen == [square(i) for i in range(20)]


def test_schedulers_without_fitting_workers_are_refused_in_a_line(tmp_path):
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    with pytest.raises(ChoreographError, match=f"expected a Dask scheduler at {address}"), connected(address):
        pass
    scheduler = scheduler_at(port)
    with ended(scheduler):
        with (
            pytest.raises(ChoreographError, match=r"expected workers of the scheduler .*, got none"),
            connected(address),
        ):
            pass
        worker = started("dask_worker", address, "--nthreads", "2", "--no-dashboard")
        with ended(worker):
            wait_for(address, 1)
            with (
                pytest.raises(ChoreographError, match="expected workers with one thread, got 2"),
                connected(address),
            ):
                pass
