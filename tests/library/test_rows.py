"""Rows of frames are read in blocks, which are kept up to a number of bytes, by any thread, from any file."""

from __future__ import annotations

import os
import pickle
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_takes

from choreograph.core.errors import RepertoireError
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.repertoire import Repertoire
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import write_repertoire

MOTION = ("motion/root_pos_m", "motion/local_quat", "body/pos_m")


@pytest.fixture(scope="module")
def contents():
    return synthetic_contents(synthetic_takes(duration_s=40.0))


@pytest.fixture(scope="module")
def plain(contents, tmp_path_factory):
    path = tmp_path_factory.mktemp("rows") / "plain.h5"
    write_repertoire(path, contents)
    return path


def spans(n_rows: int, n: int, seed: int = 0) -> list[tuple[int, int]]:
    rng = np.random.default_rng(seed)
    starts = rng.integers(0, n_rows - 1, n)
    stops = np.minimum(starts + rng.integers(1, 3000, n), n_rows)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


@pytest.mark.parametrize("kind", ["plain", "compressed"])
@pytest.mark.parametrize("name", MOTION)
def test_rows_equal_those_of_the_whole_array(plain, kind, name):
    file = RepertoireFile(STARTER_PATH if kind == "compressed" else plain)
    whole = file.read(name)
    borders = [(0, 1), (0, len(whole)), (len(whole) - 1, len(whole)), (8191, 8193), (5, 5)]
    for start, stop in borders + spans(len(whole), 30):
        rows = file.read_rows(name, start, stop)
        assert rows.dtype == whole.dtype
        np.testing.assert_array_equal(rows, whole[start:stop])


def test_each_block_is_read_once(monkeypatch):
    """300 parts of takes took 600 openings of the file, 10 ms each."""
    repertoire = Repertoire(RepertoireFile(STARTER_PATH))
    durations_s = [take.duration_s for take in repertoire.takes]
    reads = []
    read = RepertoireFile.read

    def counted(self, name, *part):
        reads.append(name)
        return read(self, name, *part)

    assert repertoire.skeleton.n_joints == 24
    monkeypatch.setattr(RepertoireFile, "read", counted)
    rng = np.random.default_rng(0)
    for take in rng.integers(0, len(durations_s), 300):
        start_s = rng.uniform(0.0, durations_s[take] - 2.0)
        repertoire.motion(int(take), start_s, start_s + 1.0)
    assert len(reads) <= 24, len(reads)


def test_what_is_read_cannot_change_what_is_kept(plain):
    file = RepertoireFile(plain)
    rows = file.read_rows("body/pos_m", 3, 9)
    rows[:] = 7.0
    assert not (file.read_rows("body/pos_m", 3, 9) == 7.0).any()
    repertoire = Repertoire.open(plain)
    motion, _ = repertoire.motion(0, 1.0, 2.0)
    motion.root_pos_m[:] = 7.0
    motion.local_quat[:] = 7.0
    assert abs(repertoire.motion(0, 1.0, 2.0)[0].local_quat).max() <= 1.0


def test_a_repertoire_can_be_sent_to_another_process(plain):
    repertoire = Repertoire.open(plain)
    motion, _ = repertoire.motion(0, 1.0, 2.0)
    again, _ = pickle.loads(pickle.dumps(repertoire)).motion(0, 1.0, 2.0)
    np.testing.assert_array_equal(again.local_quat, motion.local_quat)


def test_threads_read_the_same_rows(plain):
    file = RepertoireFile(plain)
    whole = {name: file.read(name) for name in MOTION}

    def equal(seed: int) -> bool:
        return all(
            np.array_equal(file.read_rows(name, start, stop), whole[name][start:stop])
            for name in MOTION
            for start, stop in spans(len(whole[name]), 20, seed)
        )

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(equal, range(16)))


def test_a_replaced_file_is_read_again_and_a_missing_one_named(contents, plain, tmp_path):
    path = tmp_path / "rep.h5"
    shutil.copy(plain, path)
    file = RepertoireFile(path)
    before = file.read_rows("body/density", 0, 50)
    changed = {**contents.arrays, "body/density": contents.arrays["body/density"] + 1}
    write_repertoire(path, type(contents)(changed, contents.density, contents.provenance, contents.nets))
    np.testing.assert_allclose(file.read_rows("body/density", 0, 50), before + 1, rtol=1e-6)
    path.unlink()
    with pytest.raises(RepertoireError, match=r"rep\.h5"):
        file.read_rows("body/density", 0, 50)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="the system does not list open files")
def test_no_file_stays_open(plain):
    file = RepertoireFile(plain)
    file.read_rows("body/pos_m", 0, 100)
    links = [os.readlink(link) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]
    assert str(plain) not in links


def test_frames_are_stored_with_all_their_joints(plain):
    """A chunk of frames is a part of a take. Chunks of one column were unpacked 96 times for a second."""
    with h5py.File(plain) as file:
        for name in MOTION:
            n_frames, *columns = file[name].shape
            assert file[name].chunks[1:] == tuple(columns)
            n_bytes = 1 << (15 if name == "body/pos_m" else 18)
            assert file[name].chunks[0] == min(n_frames, n_bytes // (4 * int(np.prod(columns))))
