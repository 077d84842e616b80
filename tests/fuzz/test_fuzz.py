"""The readers against damaged and hostile files: those that once failed, and a few new ones."""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from acceptance.corpus import SaneFile
from fuzz.__main__ import main
from fuzz.harness import Input, Tally, Target, accepted, fuzz, in_jobs, input_of, replay
from fuzz.mutations import MAX_BYTES, _join, _lengthen_digits
from fuzz.repeats import Repeated, _repeated_json, repeated
from fuzz.targets import all_targets, made_pickles

from choreograph.core.errors import FormatError

CORPUS = Path(__file__).with_name("corpus")
N_PICKLES, SEED_OF_PICKLES = 100, 7
N_INPUTS = 15  # of each target; `make fuzz`, which CI runs, tries as many as there is time for


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
    tally = replay(target, [Input(b"ok"), Input(content), Input(b"ok")])
    assert tally.tried == 3
    assert [number for number, _ in tally.failures.values()] == ([] if found is None else [1])
    assert found is None or found in next(iter(tally.failures))


@pytest.mark.parametrize(
    ("power", "step_s", "found"),
    [
        (1.0, 0.0, False),
        (2.0, 0.0, True),
        (0.0, 0.2, False),  # does more from some length on, all at once
    ],
)
def test_cpu_time_that_grows_faster_than_the_input_is_found(tmp_path, monkeypatch, power, step_s, found):
    """At 0.15 s for all repeats, of which a quarter and a half are tried as well."""
    monkeypatch.setattr("fuzz.harness.SLOPE_CPU_S", (0.1, 1.0))

    def read(path: Path) -> None:
        share = len(path.read_bytes()) / 1000
        end = time.process_time() + 0.15 * share**power + step_s * (share > 0.7)
        while time.process_time() < end:
            pass

    target = Target("planted", "file", "bytes", [b"ok"], read, tmp_path)
    made = Repeated(1000, lambda n: b"x" * n)
    tally = replay(target, [Input(made.make(made.times), made)])
    assert bool(tally.failures) == found
    assert not found or "planted: CPU time grows as n^" in next(iter(tally.failures))


def test_refused_seeds_and_sane_files_are_found(tmp_path):
    def written(content: bytes):
        def write(folder: Path) -> Path:
            (folder / "any name").write_bytes(content)
            return folder / "any name"

        return write

    def files(n_refused: int) -> list[SaneFile]:
        return [SaneFile(f"{i}", written(b"refused" if i < n_refused else b"ok")) for i in range(100)]

    target = Target("planted", "file", "bytes", [b"ok", b"refused"], _planted, tmp_path)
    assert "an untouched seed is refused" in accepted(target).failures
    for n_refused in (0, 1, 2):
        own = tmp_path / f"{n_refused}"
        own.mkdir()
        tally = accepted(replace(target, seeds=[b"ok"], folder=own, sane=files(n_refused)))
        named = [f"refused, though sane: {i}" for i in range(n_refused)]
        assert list(tally.failures) == (named if n_refused == 2 else [])
        assert tally.tried == 101


def test_what_is_lost_between_reading_and_writing_is_found(tmp_path):
    def round_trip(read: bytes, folder: Path) -> None:
        (folder / "again").write_bytes(read[:3])
        assert (folder / "again").read_bytes() == read, "shorter"

    target = Target("planted", "file", "bytes", [b"ok"], Path.read_bytes, tmp_path, round_trip)
    assert not replay(target, [Input(b"abc")]).failures
    ((_, what),) = replay(target, [Input(b"abcd")]).failures.values()
    assert what.startswith("lost round trip: shorter")


def test_operators(tmp_path):
    """Parts are there 10 to 1,000,000 times, files are joined, and runs of digits made longer."""
    times = []
    for number in range(200):
        made = repeated("words", [b"one 1\ntwo 2\n"], np.random.default_rng(number))
        times.append(made.times)
        few, more = (len(made.make(n)) for n in (10, 20))
        assert few < more and len(made.make(made.times)) <= MAX_BYTES + more
    assert min(times) < 20 and max(times) > 300_000
    for content, n_entries in ((b"[1, 2]", 1001), (b'{"a": 1}', 1000)):
        make = _repeated_json(content, np.random.default_rng(0))
        assert len(json.loads(make(1000))) == n_entries and json.loads(make(1)) == json.loads(content)
    seeds, rng = [b"one 1", b"two 2"], np.random.default_rng(0)
    assert {_join(b"one 1", seeds, rng) for _ in range(20)} == {b"one 1one 1", b"one 1two 2"}
    longer = _lengthen_digits(b"a 12 b", seeds, rng)
    assert longer.startswith(b"a 12") and longer.endswith(b" b") and longer[2:-2].isdigit()
    assert _lengthen_digits(b"none", seeds, rng) == b"none"


def test_inputs_follow_from_the_seed(tmp_path):
    target = Target("planted", "file", "json", [b'{"a": [1, 2, 3]}'], _planted, tmp_path)
    inputs = [input_of(target, 1, number) for number in range(30)]
    assert inputs == [input_of(target, 1, number) for number in range(30)]
    assert len({given.data for given in inputs}) > 20
    assert inputs != [input_of(target, 2, number) for number in range(30)]


@pytest.mark.parametrize("n_jobs", [2, 3])
def test_jobs_try_the_inputs_of_one_process(tmp_path, n_jobs):
    targets = [Target(name, "file", "bytes", [b"ok", b"kk"], _planted, tmp_path) for name in ("a", "b", "c")]
    for target in targets:
        (tmp_path / target.name).mkdir()
    targets = [replace(target, folder=tmp_path / target.name) for target in targets]

    def tried(some):
        return fuzz(some, seed=3, n_inputs=20)

    alone, together = tried(targets), in_jobs(tried, targets, n_jobs)
    assert list(together) == ["a", "b", "c"]
    for name, tally in alone.items():
        other = together[name]
        assert (other.tried, other.was_read, other.failures) == (20, tally.was_read, tally.failures)
        assert tally.failures


def _of_cost(target: Target) -> int:
    return int(target.name)


def test_jobs_have_about_the_same_work(tmp_path):
    targets = [Target(name, "file", "bytes", [b"ok"], _planted, tmp_path) for name in ("2", "5", "3")]
    found = in_jobs(
        lambda some: {target.name: Tally(tried=os.getpid()) for target in some}, targets, 2, cost=_of_cost
    )
    assert list(found) == ["2", "5", "3"] and found["2"] == found["3"] != found["5"]
    assert in_jobs(lambda some: {target.name: Tally() for target in some}, targets[:1], 3) == {"2": Tally()}


def _slow(path: Path) -> None:
    time.sleep(0.02)


def test_each_target_gets_its_share_of_the_time(tmp_path):
    targets = [Target(name, "file", "bytes", [b"ok"], _slow, tmp_path) for name in "abcd"]
    began = time.monotonic()
    tallies = fuzz(targets, seed=0, seconds=1.2)
    assert time.monotonic() - began < 10.0
    assert all(tally.tried >= 3 for tally in tallies.values())


def test_a_target_after_a_slow_one_gets_an_input(tmp_path):
    def slower(path: Path) -> None:
        time.sleep(0.5)

    targets = [Target(name, "file", "bytes", [b"ok"], slower, tmp_path) for name in "abc"]
    assert all(tally.tried for tally in fuzz(targets, seed=0, seconds=0.1).values())


def _run(tmp_path, monkeypatch, *arguments: str, read=_slow, sane_s: float = 0.0) -> int:
    """The status of `python -m fuzz` with two targets, which have one sane file each."""

    def write(folder: Path) -> Path:
        time.sleep(sane_s)
        (folder / "file").write_bytes(b"ok")
        return folder / "file"

    def two(folder: Path) -> list[Target]:
        made = []
        for name in ("first", "second"):
            (folder / name).mkdir()
            made.append(Target(name, "file", "bytes", [b"ok"], read, folder / name))
        return [replace(target, sane=[SaneFile("good", write)]) for target in made]

    monkeypatch.setattr("fuzz.__main__.all_targets", two)
    monkeypatch.setattr("fuzz.__main__.CORPUS", tmp_path)
    return main(["--seed", "1", *arguments])


def test_a_run_without_time_for_a_target_fails(tmp_path, monkeypatch, capsys):
    assert _run(tmp_path, monkeypatch, "--minutes", "0") == 1
    assert capsys.readouterr().err == "\nnot tried: first, second\n"


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_the_time_begins_after_the_sane_files(tmp_path, monkeypatch, capsys, jobs):
    assert _run(tmp_path, monkeypatch, "--minutes", "0.01", "--jobs", jobs, sane_s=0.7) == 0
    printed = capsys.readouterr()
    rows = [line.split(" | ") for line in printed.out.split("seed 1")[1].splitlines() if "| " in line]
    assert [row[0] for row in rows[2:]] == ["| first", "| second"] and not printed.err
    assert all(int(row[1]) > 3 for row in rows[2:])


def test_a_failure_fails_the_run_and_is_kept(tmp_path, monkeypatch):
    def broken(path: Path) -> None:
        if path.read_bytes() != b"ok":
            raise KeyError

    assert _run(tmp_path, monkeypatch, "--minutes", "0.01", "--targets", "first", read=broken) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["first"] and list((tmp_path / "first").iterdir())


def test_unknown_targets_are_refused(tmp_path, monkeypatch, capsys):
    with pytest.raises(SystemExit) as caught:
        _run(tmp_path, monkeypatch, "--targets", "frist")
    assert caught.value.code == 2 and "got frist" in capsys.readouterr().err


def test_pickles_made_by_construction_are_read_or_refused(tmp_path):
    """Of those before `core.pickles`, some ended the process, and others raised other errors."""
    for target in made_pickles(tmp_path):
        tally = fuzz([target], seed=SEED_OF_PICKLES, n_inputs=N_PICKLES)[target.name]
        assert (tally.tried, tally.failures) == (N_PICKLES, {}), target.name


@pytest.fixture(scope="module")
def targets(tmp_path_factory):
    return all_targets(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.slow
def test_good_files_are_read(targets):
    """Otherwise no changed part of them would be read. Good files have tests of their own."""
    for target in targets:
        tally = accepted(replace(target, sane=()))
        assert (tally.was_read, tally.failures) == (len(target.seeds), {}), target.name


@pytest.mark.slow
def test_what_once_failed_is_read_or_refused(targets):
    by_name = {target.name: target for target in targets}
    for folder in sorted(path for path in CORPUS.iterdir() if path.is_dir()):
        files = sorted(folder.iterdir())
        tally = replay(by_name[folder.name], [Input(file.read_bytes()) for file in files])
        assert not tally.failures, folder.name


@pytest.mark.slow
def test_new_inputs_are_read_or_refused(targets):
    for name, tally in fuzz(targets, seed=0, n_inputs=N_INPUTS).items():
        assert tally.tried == N_INPUTS
        assert not tally.failures, name
