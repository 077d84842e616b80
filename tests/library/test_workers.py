"""A build has the same bytes with any number of processes, and names takes whose process is killed."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from schedulers import scheduler_with_workers
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.core.errors import ChoreographError
from choreograph.core.workers import workers
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.formats.register import import_takes, save_motion
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes

pytestmark = pytest.mark.slow
N_TAKES = 7


@pytest.fixture(scope="module")
def takes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    for seed in range(N_TAKES):
        period_s = (0.5, 0.6)[seed % 2]
        save_motion(folder / f"t{seed}.bvh", stepping(12 * 30, period_s=period_s, seed=seed))
    write_clicks(folder / "t0.wav", duration_s=12.0)  # of one song, no network is trained
    return folder


def test_a_build_has_the_same_bytes_with_any_number_of_workers(tmp_path, takes):
    for n in (1, 2):
        cg.build(takes, tmp_path / f"{n}.h5", preset="tiny", words=False, workers=n)
    assert (tmp_path / "1.h5").read_bytes() == (tmp_path / "2.h5").read_bytes()


def test_a_build_has_the_same_bytes_with_a_cluster(tmp_path, takes, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.chdir(takes.parent)
    cg.build(takes.name, tmp_path / "1.h5", preset="tiny", words=False, workers=1)
    stages = []
    with scheduler_with_workers(tmp_path) as address:
        cg.build(
            takes.name, tmp_path / "2.h5", preset="tiny", words=False, dask=address,
            report=lambda stage, done, total: stages.append(stage),
        )  # fmt: skip
    assert (tmp_path / "1.h5").read_bytes() == (tmp_path / "2.h5").read_bytes()
    assert stages[0].startswith("connected, http")


def test_takes_are_measured_alike_with_progress(takes):
    stages: dict[str, list[int]] = {}

    def report(stage: str, done: int, total: int) -> None:
        stages.setdefault(stage, []).append(done)

    alone, notes = measured_takes([takes], BuildOptions(), None)
    with workers(2):
        measured, notes_of_two = measured_takes([takes], BuildOptions(), report)
    assert [str(note) for note in notes] == [str(note) for note in notes_of_two]
    for one, two in zip(alone, measured, strict=True):
        assert one.take.name == two.take.name
        np.testing.assert_array_equal(one.body_pos_m, two.body_pos_m)
        np.testing.assert_array_equal(one.take.motion.local_quat, two.take.motion.local_quat)
    assert stages["measuring"] == list(range(1, N_TAKES + 1))


def test_damaged_takes_are_named_alike(takes, tmp_path):
    for path in takes.glob("*.bvh"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "t3.bvh").write_text("HIERARCHY")
    (tmp_path / "t5.bvh").write_text("nothing")
    texts = []
    for n in (1, 2):
        with workers(n), pytest.raises(ChoreographError) as raised:
            list(import_takes(tmp_path))
        texts.append(str(raised.value))
    assert texts[0] == texts[1]
    assert "t3.bvh" in texts[0]


def kill_this_process(path: Path) -> str:
    if path.stem == "bad":
        os.kill(os.getpid(), signal.SIGKILL)
    return path.stem


def test_a_file_whose_process_is_killed_is_skipped():
    paths = [Path(f"{name}.bvh") for name in ("a", "b", "c", "bad", "d", "e", "f")]
    with workers(2):
        found = list(each_attempted((kill_this_process, path) for path in paths))
    assert [one for one in found if isinstance(one, str)] == ["a", "b", "c", "d", "e", "f"]
    [skipped] = [one for one in found if isinstance(one, SkippedFile)]
    assert skipped.path == Path("bad.bvh")
    assert "killed twice" in skipped.why
