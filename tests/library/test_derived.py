"""Body positions that a compressed file leaves out are those of its motion, whichever rows are read."""

from __future__ import annotations

import pickle
from dataclasses import replace

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_motions import stepping
from synthetic_repertoire import synthetic_contents, synthetic_takes

from choreograph.core.errors import RepertoireError
from choreograph.core.timebase import NET_FPS
from choreograph.library.building.takes import measure_take
from choreograph.library.catalogue import open_files
from choreograph.library.derived import BodyPositions, root_frame_rows
from choreograph.library.repertoire import Repertoire
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import write_repertoire
from choreograph.motion.body import BODY_JOINTS, body_pos_m, to_root_frame

RATES = (20.0, 25.0, 23.976, 30.0, 60.0, 119.88)


@pytest.fixture(scope="module")
def takes():
    """Takes at several rates, of one frame and of thirty seconds."""
    like = synthetic_takes(periods_s=(0.5,), duration_s=9.0)[0]
    made = []
    for index, fps in enumerate(RATES):
        for n_frames in (1, round(30 * fps) + index):
            motion = replace(stepping(n_frames, period_s=0.5, seed=index), fps=fps)
            take = replace(like.take, name=f"{fps:g} with {n_frames}", motion=motion)
            made.append(replace(measure_take(take), motion_beats_s=np.zeros(0)))
    return made


@pytest.fixture(scope="module")
def path(takes, tmp_path_factory):
    path = tmp_path_factory.mktemp("positions") / "compressed.h5"
    write_repertoire(path, synthetic_contents(takes), compress=True)
    return path


def test_positions_are_those_of_the_motion(path, takes):
    with h5py.File(path) as file:
        assert "body/pos_m" not in file
    repertoire = Repertoire.open(path)
    for index, measured in enumerate(takes):
        made = repertoire.body_pos_m(index)
        motion, _ = repertoire.motion(index)
        np.testing.assert_allclose(made, body_pos_m(motion.resampled(NET_FPS)), atol=1e-6)
        np.testing.assert_allclose(made, measured.body_pos_m, atol=0.003)  # of rotations in 16 bits


@given(st.data())
def test_rows_do_not_depend_on_what_is_read_with_them(path, data):
    file = RepertoireFile(path)
    whole = _whole(path)
    start = data.draw(st.integers(0, len(whole) - 1))
    stop = data.draw(st.integers(start, min(start + 900, len(whole))))
    step = data.draw(st.integers(1, 7))
    np.testing.assert_array_equal(file.read("body/pos_m", slice(start, stop, step)), whole[start:stop:step])
    np.testing.assert_array_equal(file.read_rows("body/pos_m", start, stop), whole[start:stop])


_KEPT = {}


def _whole(path):
    if path not in _KEPT:
        _KEPT[path] = RepertoireFile(path).read("body/pos_m")
    return _KEPT[path]


def test_what_follows_from_positions_is_that_of_the_ones_that_are_made(path):
    repertoire = Repertoire.open(path)
    speed = repertoire._file.read("body/speed_m_s")
    whole = _whole(path).astype(np.float64)
    start, stop = repertoire.takes[3].body
    moved = np.linalg.norm(np.diff(whole[start:stop], axis=0), axis=-1).mean(axis=1) * NET_FPS
    middle = 0.5 * (moved[:-1] + moved[1:])
    assert np.corrcoef(middle, speed[start + 1 : stop - 1])[0, 1] > 0.95


def test_a_file_is_written_again_to_the_same_bytes(path, takes, tmp_path):
    file = RepertoireFile(path)
    contents = replace(synthetic_contents(takes), arrays=file.arrays(), provenance=file.provenance)
    write_repertoire(tmp_path / "again.h5", contents, compress=True)
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()


def test_a_plain_file_of_a_compressed_one_holds_the_positions(path, takes, tmp_path):
    contents = replace(synthetic_contents(takes), arrays=RepertoireFile(path).arrays())
    write_repertoire(tmp_path / "plain.h5", contents)
    with h5py.File(tmp_path / "plain.h5") as file:
        np.testing.assert_array_equal(file["body/pos_m"][()], _whole(path))


def test_compressed_and_plain_files_are_read_as_one(tmp_path):
    for name, compress in (("a", True), ("b", False)):
        takes = [
            replace(measured, take=replace(measured.take, name=f"{name}{index}"))
            for index, measured in enumerate(synthetic_takes(duration_s=12.0))
        ]
        write_repertoire(tmp_path / f"{name}.h5", synthetic_contents(takes), compress=compress)
    both = open_files([tmp_path / "a.h5", tmp_path / "b.h5"])
    parts = [RepertoireFile(tmp_path / f"{name}.h5").read("body/pos_m") for name in "ab"]
    np.testing.assert_array_equal(both.read("body/pos_m"), np.concatenate(parts))
    rows = np.array([[0, len(parts[0]) - 1], [len(parts[0]), len(parts[0]) + 7]])
    np.testing.assert_array_equal(both.rows("body/pos_m", rows), np.concatenate(parts)[rows])
    np.testing.assert_allclose(parts[0], parts[1], atol=0.003)


def test_a_file_in_another_process_makes_the_same(path):
    file = RepertoireFile(path)
    file.read_rows("body/pos_m", 3, 9)
    again = pickle.loads(pickle.dumps(file))
    np.testing.assert_array_equal(again.read_rows("body/pos_m", 3, 9), _whole(path)[3:9])


def test_motion_that_gives_another_number_of_rows_is_refused(path):
    repertoire = Repertoire.open(path)
    file = repertoire._file
    shapes = file.shapes["motion/root_pos_m"][0], file.shapes["body/pos_m"][0]
    BodyPositions.of(file.read, repertoire.skeleton, *shapes)

    def wrong(name):
        return file.read(name) * (1.1 if name == "takes/fps" else 1)

    with pytest.raises(RepertoireError, match="as many rows as the motion gives"):
        BodyPositions.of(wrong, repertoire.skeleton, *shapes)
    with pytest.raises(RepertoireError, match="gaps or overlaps"):
        BodyPositions.of(file.read, repertoire.skeleton, shapes[0], shapes[1] + 1)


def test_velocities_end_with_their_take():
    """Two takes that move at 1 and at 2 m/s. No difference is taken across their border."""
    times_s = np.arange(8) / 20
    body = np.random.default_rng(0).normal(size=(len(BODY_JOINTS), 3))
    pos = np.concatenate([body + v * times_s[:, None, None] * np.array([0.0, 1.0, 0.0]) for v in (1.0, 2.0)])
    made = root_frame_rows(lambda rows: pos[rows], np.arange(16), np.array([[0, 8], [8, 16]]))
    np.testing.assert_allclose(made[:, 0], to_root_frame(pos), atol=1e-6)
    np.testing.assert_allclose(made[:8, 1, :, 1], 1.0, atol=1e-5)
    np.testing.assert_allclose(made[8:, 1, :, 1], 2.0, atol=1e-5)
