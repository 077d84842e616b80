"""Builds by workers that do not have the takes, or that run out of memory."""

from __future__ import annotations

from contextlib import contextmanager

import pytest
from schedulers import ended, free_port, scheduler_at, wait_for, worker_of
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.formats.register import save_motion

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

SETTINGS = {"preset": "tiny", "words": False}
# Workers that start with this refuse to open files of the takes.
BLIND = """
import sys
def refuse(event, given):
    if event == "open" and str(given[0]).startswith({folder!r}):
        raise FileNotFoundError(2, "there is no such file on this machine", str(given[0]))
sys.addaudithook(refuse)
"""
# The take "greedy" takes up more and more memory.
GREEDY = """
import time
from choreograph.formats import manifest
attempted = manifest.__dict__.setdefault("attempted_alone", manifest.attempted)  # it is loaded twice
def greedy(read, path):
    held = []
    while path.stem == "greedy" and len(held) < 60:
        held.append(bytearray(b"1" * (50 << 20)))
        time.sleep(0.05)
    return attempted(read, path)
manifest.attempted = greedy
"""


@pytest.fixture(scope="module")
def takes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    for seed, name in enumerate(("a", "b", "greedy")):
        save_motion(folder / f"{name}.bvh", stepping(9 * 30, period_s=0.5, seed=seed))
    write_clicks(folder / "a.wav", duration_s=9.0)
    (folder / "damaged.bvh").write_text("HIERARCHY")
    return folder


@contextmanager
def worker_with(preload: str, folder, *options: str):
    """The address of a scheduler with one worker, which runs a program when it starts."""
    address = f"tcp://127.0.0.1:{(port := free_port())}"
    (folder / "preload.py").write_text(preload)
    processes = (
        worker_of(address, folder, "--preload", str(folder / "preload.py"), *options),
        scheduler_at(port),
    )
    with ended(*processes):
        wait_for(address, 1)
        yield address


def test_takes_are_sent_along_to_a_worker_that_does_not_have_them(takes, tmp_path):
    here = cg.build(takes, tmp_path / "here.h5", skip_bad=True, workers=1, **SETTINGS)
    with worker_with(BLIND.format(folder=str(takes)), tmp_path) as address:
        there = cg.build(takes, tmp_path / "there.h5", skip_bad=True, dask=address, stage=True, **SETTINGS)
        with pytest.raises(ChoreographError, match="could not"):
            cg.build(takes, tmp_path / "without.h5", leave_out=["damaged"], dask=address, **SETTINGS)
    assert here.path.read_bytes() == there.path.read_bytes()
    assert [note for note in here.notes if "damaged.bvh" in note] != []
    assert here.notes == tuple(note.replace("there.h5", "here.h5") for note in there.notes)


def test_a_take_that_runs_out_of_memory_is_named_and_left_out(takes, tmp_path, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")  # as few restarts as possible
    with worker_with(GREEDY, tmp_path, "--memory-limit", "1 GiB") as address:
        built = cg.build(takes, tmp_path / "2.h5", skip_bad=True, dask=address, **SETTINGS)
    [note] = [note for note in built.notes if "greedy" in note]
    assert "killed twice" in note
    assert [take.name for take in built.repertoire.takes] == ["a", "b"]


def test_stage_needs_a_scheduler():
    with pytest.raises(ParameterError, match=r"expected the address of a Dask scheduler .* beside stage"):
        cg.BuildOptions(stage=True)
