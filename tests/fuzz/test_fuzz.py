"""The readers against damaged and hostile files: those that once failed, and a few hundred new ones."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from fuzz.harness import Target, fuzz, input_of, replay
from fuzz.targets import all_targets

from choreograph.errors import FormatError

CORPUS = Path(__file__).with_name("corpus")
N_INPUTS = 60  # of each target; `make fuzz` tries as many as there is time for


def _planted(path: Path) -> None:
    """A reader with a bug for each first byte but those of "ok" and "refused"."""
    kind = path.read_bytes()[:1]
    if kind == b"r":
        raise FormatError("refused")
    if kind == b"k":
        raise KeyError("not found")
    if kind == b"m":
        np.ones(1 << 30)
    if kind == b"a":
        os.abort()
    if kind == b"h":
        time.sleep(30)
    if kind == b"x":
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"ok", None),
        (b"refused", None),
        (b"k", "KeyError"),
        (b"m", "MemoryError"),
        (b"a", "ended by -6"),
        (b"x", "ended by -9"),
        (b"h", "hangs"),
    ],
)
def test_the_harness_finds_planted_failures(tmp_path, monkeypatch, content, found):
    """The failure is of the input that caused it, and the inputs after it are tried as well."""
    monkeypatch.setattr("fuzz.harness.WALL_S", 2.0)
    target = Target("planted", "file", "bytes", [b"ok"], _planted, tmp_path)
    tally = replay(target, [b"ok", content, b"ok"])
    assert tally.tried == 3
    assert [number for number, _ in tally.failures.values()] == ([] if found is None else [1])
    assert found is None or found in next(iter(tally.failures))


def test_inputs_follow_from_the_seed(tmp_path):
    target = Target("planted", "file", "json", [b'{"a": [1, 2, 3]}'], _planted, tmp_path)
    inputs = [input_of(target, 1, number) for number in range(50)]
    assert inputs == [input_of(target, 1, number) for number in range(50)]
    assert len(set(inputs)) > 30
    assert inputs != [input_of(target, 2, number) for number in range(50)]


@pytest.fixture(scope="module")
def targets(tmp_path_factory):
    return all_targets(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.slow
def test_good_files_are_read(targets):
    """Else nothing of what is changed in them would be looked at."""
    for target in targets:
        tally = replay(target, target.seeds)
        assert (tally.was_read, tally.failures) == (len(target.seeds), {}), target.name


@pytest.mark.slow
def test_what_once_failed_is_read_or_refused(targets):
    by_name = {target.name: target for target in targets}
    for folder in sorted(path for path in CORPUS.iterdir() if path.is_dir()):
        files = sorted(folder.iterdir())
        tally = replay(by_name[folder.name], [file.read_bytes() for file in files])
        assert not tally.failures, folder.name


@pytest.mark.slow
def test_new_inputs_are_read_or_refused(targets):
    for name, tally in fuzz(targets, seed=0, n_inputs=N_INPUTS).items():
        assert tally.tried == N_INPUTS
        assert not tally.failures, name
