"""Training in several processes, which is that of one: losses, Ctrl-C, resumption, lost processes."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from command_line import run
from shared_trainings import NETS, STEPS, ended, start, train_all, train_toy
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks
from threadpoolctl import threadpool_limits

from choreograph.core.errors import ParameterError
from choreograph.formats.register import save_motion
from choreograph.library.repertoire import Repertoire
from choreograph.nets import processes
from choreograph.nets.processes import agreed, from_first, gathered, joined, own_rows


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """As in the processes that are started: with more threads, sums have another order."""
    with threadpool_limits(1):
        yield


def test_without_torchrun_one_process_has_everything():
    rows = torch.ones(3, 2)
    with joined() as is_first:
        assert is_first
        assert own_rows(rows) is rows and gathered(rows) is rows
        assert agreed(1.5, True) == (1.5, True)
        assert from_first(lambda: b"state") is None


def test_each_row_is_computed_by_one_process(monkeypatch):
    monkeypatch.setattr(processes, "n_processes", lambda: 4)
    parts = []
    for index in range(4):
        monkeypatch.setattr(processes, "process_index", lambda index=index: index)
        parts += range(8)[processes.own_part(8)]
    assert parts == list(range(8))
    with pytest.raises(ParameterError, match="divides a batch of 9 samples, got 4"):
        processes.own_part(9)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The folders of trainings in one process and in two, and what the two printed."""
    one, two = tmp_path_factory.mktemp("one"), tmp_path_factory.mktemp("two")
    running = start("all", two)
    train_all(one)
    results = ended(running)
    assert [status for status, _, _ in results] == [0, 0], results
    return one, two, [printed for _, printed, _ in results]


@pytest.mark.slow
@pytest.mark.parametrize("name", NETS)
def test_two_processes_train_every_network_as_one_does(trained, name):
    """The loss before the first step, and those after steps, which depend on all gradients."""
    one, two, _ = trained
    losses = [
        np.array([json.loads(line)["loss"] for line in (folder / f"{name}.jsonl").read_text().splitlines()])
        for folder in (one, two)
    ]
    assert losses[0] == pytest.approx(losses[1], rel=2e-3) and len(losses[0]) == STEPS
    assert losses[0][:2] == pytest.approx(losses[1][:2], rel=1e-5)
    assert abs(losses[0][0] - losses[0][1]) > 1e-3  # a step changes it


@pytest.mark.slow
def test_only_the_first_process_reports_and_writes(trained):
    _, two, printed = trained
    assert printed[0].split() == [name for name in NETS for _ in range(STEPS)] and printed[1] == ""
    assert {path.name for path in two.iterdir()} == {
        f"{name}.{kind}" for name in NETS for kind in ("pt", "jsonl")
    }


def _checkpoint(folder):
    return torch.load(folder / "toy.pt", weights_only=True)


@pytest.mark.slow
def test_ctrl_c_in_any_process_saves_and_any_number_of_processes_continues(tmp_path):
    (tmp_path / "whole").mkdir()
    expected = train_toy(tmp_path / "whole")
    results = ended(start("toy", tmp_path, 12))
    assert [(status, printed) for status, printed, _ in results] == [(0, "interrupted\n"), (0, "")]
    assert _checkpoint(tmp_path)["step"] == 12
    with pytest.raises(KeyboardInterrupt):
        train_toy(tmp_path, stop=9)
    assert _checkpoint(tmp_path)["step"] == 21
    assert [status for status, _, _ in ended(start("toy", tmp_path, -1))] == [0, 0]
    found = list(_checkpoint(tmp_path)["module"].values())
    for one, several in zip(expected, found, strict=True):
        torch.testing.assert_close(several, one, rtol=1e-3, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [0, 1])
def test_a_process_that_is_lost_ends_the_others(tmp_path, lost):
    results = ended(start("toy", tmp_path, -1, lost, 3), timeout_s=120)
    assert results[lost][0] == 1
    status, printed, errors = results[1 - lost]
    if lost == 1:
        (line,) = printed.splitlines()
        assert status == 2 and line.startswith("expected 2 processes to train, lost one")
    else:
        assert status == 0 and printed == ""
    assert "Traceback" not in errors


@pytest.mark.slow
@pytest.mark.usefixtures("short_trainings")
def test_a_build_of_torchrun_is_that_of_one_process(tmp_path):
    folder = tmp_path / "takes"
    folder.mkdir()
    for seed, (name, bpm) in enumerate({"slow": 90, "even": 110, "quick": 130}.items()):
        save_motion(folder / f"{name}.bvh", stepping(15 * 30, period_s=60 / bpm, seed=seed))
        write_clicks(folder / f"{name}.wav", duration_s=15.0, bpm=bpm)
    program = tmp_path / "program.py"
    program.write_text(
        "from short_trainings import shorten_trainings\n"
        "from choreograph.cli.main import run\n"
        "shorten_trainings()\n"
        "run()\n"
    )
    environment = {
        **os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OMP_NUM_THREADS": "1"
    }  # fmt: skip
    build = ["build-db", folder, "--preset", "tiny", "--workers", 1, "-o"]
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    said = subprocess.run(
        [*torchrun, program, *map(str, build), tmp_path / "two.h5"],
        text=True, capture_output=True, check=True, env=environment,
    ).stdout  # fmt: skip
    expected = run(*build, tmp_path / "one.h5").stdout
    assert said == expected.replace("one.h5", "two.h5")  # the second process says nothing
    one, two = (Repertoire.open(tmp_path / name) for name in ("one.h5", "two.h5"))
    assert one.net_names == two.net_names and len(one.takes) == len(two.takes) == 3
    for name, weights in one.net("words").weights.items():
        assert two.net("words").weights[name] == pytest.approx(weights, abs=1e-3)
    # Dropout differs.
    style = {name: value for name, value in one.net("style").weights.items() if "running" not in name}
    changed = max(np.abs(two.net("style").weights[name] - value).max() for name, value in style.items())
    assert 0 < changed < 0.2
