"""The repertoire file: published layout, atomic and deterministic writing, damage reported in one line."""

from __future__ import annotations

import json
import os
import pickle
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_repertoire import put_texts, synthetic_contents, synthetic_takes, with_counts

from choreograph.core.errors import ChoreographError, ParameterError, RepertoireError
from choreograph.library import schema
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.derived import with_derived
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import (
    ATTRIBUTES,
    DATASETS,
    DELTA_ORDER,
    DELTA_RESTART,
    DERIVED,
    FORMAT,
    HALF_PRECISION,
    MADE_WHEN_READ,
    NETS,
    OPTIONAL,
    POSES,
    QUANTISATION_STEPS,
    UNCERTAINTY,
    VERSION,
    NetArrays,
    delta_encode,
    quantised,
)
from choreograph.library.store import JoinedRows, RepertoireFile
from choreograph.library.writing import write_repertoire
from choreograph.motion.body import BODY_JOINTS
from choreograph.nets.configs import WORD_DIM

# The repertoire file: published layout, atomic and deterministic writing, damage reported in one line.


LAYOUT = json.loads(
    (Path(__file__).resolve().parents[2] / "data_schema" / "repertoire.json").read_text(encoding="utf-8")
)
WITHOUT_MOTIFS = LAYOUT["datasets"]
NET = NetArrays({"width": 3}, {"linear.weight": np.arange(6.0).reshape(2, 3), "bias": np.float32(2.0)})


@pytest.fixture(scope="module")
def contents():
    return replace(synthetic_contents(synthetic_takes(duration_s=12.0)), nets={"style": NET})


@pytest.fixture(scope="module")
def path(contents, tmp_path_factory):
    path = tmp_path_factory.mktemp("store") / "rep.h5"
    write_repertoire(path, contents)
    return path


def test_uncertainty_is_stored_where_a_network_counted(tmp_path):
    """The counts of one of two takes are estimated. A file with uncertainty of other counts is refused."""
    takes = with_counts(synthetic_takes())
    assert not set(UNCERTAINTY) & set(synthetic_contents(takes).arrays)
    given_counts, read = takes[0].take.counts, takes[1].take.counts
    uncertainty = np.linspace(0.1, 0.6, len(read))
    estimated = replace(read, confidence=0.9, uncertainty=uncertainty)
    takes[1] = replace(takes[1], take=replace(takes[1].take, counts=estimated))
    contents = synthetic_contents(takes)
    write_repertoire(tmp_path / "rep.h5", contents)
    repertoire = Repertoire.open(tmp_path / "rep.h5")
    assert np.allclose(repertoire.counts(1).uncertainty, uncertainty)
    assert np.array_equal(repertoire.counts(0).uncertainty, np.zeros(len(given_counts)))
    clips = np.array([np.flatnonzero(repertoire.clip_take == take)[2] for take in (0, 1)])
    found = repertoire.clip_motion.count_uncertainty(
        clips, np.full(2, 30.0), np.full(2, 50.0)
    )  # 2 s from their starts
    middle_s = repertoire.clip_start_s(int(clips[1])) + 2.0
    # A tenth of the counts is expected to be wrong, at an uncertainty of a quarter.
    expected = 0.1 * np.interp(middle_s, read.times_s, uncertainty) / 0.25
    assert found == pytest.approx([0.0, expected], abs=1e-6)
    wrong = replace(contents, arrays={**contents.arrays, "counts/doubt": uncertainty})
    with pytest.raises(RepertoireError, match="counts/doubt"):
        write_repertoire(tmp_path / "rep.h5", wrong)


def stored(datasets):
    return {name: (dataset.kind, dataset.axes) for name, dataset in datasets.items()}


def test_the_published_layout_is_the_one_in_the_code():
    assert (LAYOUT["format"], LAYOUT["version"]) == (FORMAT, VERSION)
    assert {name: (d["kind"], " ".join(d["axes"])) for name, d in LAYOUT["datasets"].items()} == stored(
        DATASETS
    )
    assert tuple(LAYOUT["attributes"]) == ATTRIBUTES
    assert tuple(LAYOUT["nets"]["names"]) == NETS
    groups = {part: LAYOUT[part]["datasets"] for part in OPTIONAL}
    for part, names in OPTIONAL.items():
        assert {name: (d["kind"], " ".join(d["axes"])) for name, d in groups[part].items()} == stored(names)
    assert str(WORD_DIM) in groups["motifs"]["motifs/embeddings"]["axes"]
    entries = (*LAYOUT["datasets"].values(), *(d for names in groups.values() for d in names.values()))
    letters = {axis for d in entries for axis in d["axes"] if axis.isalpha()}
    assert set(LAYOUT["axes"]) == letters
    assert str(len(BODY_JOINTS)) in LAYOUT["datasets"]["body/pos_m"]["axes"]


def test_a_file_is_laid_out_as_published(path):
    with h5py.File(path) as file:
        found = []
        file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        assert {name for name in found if not name.startswith("nets/")} == {*WITHOUT_MOTIFS, *POSES}
        assert set(file.attrs) == set(LAYOUT["attributes"])
        sizes: dict[str, int] = {}
        for name, entry in WITHOUT_MOTIFS.items():
            data = file[name]
            if entry["kind"] == "s":
                assert data.dtype == np.uint8 and data.ndim == 1, name
                continue
            assert data.dtype == np.dtype(entry["kind"]) and data.ndim == len(entry["axes"]), name
            assert data.fletcher32 or data.size == 0, name
            for axis, size in zip(entry["axes"], data.shape, strict=True):
                assert sizes.setdefault(axis, int(axis) if axis.isdigit() else size) == size, name


def test_written_contents_are_read_back(path, contents):
    file = RepertoireFile(path)
    for name in contents.arrays:
        kind, expected = DATASETS[name][0], np.asarray(contents.arrays[name])
        read = file.read(name)
        assert np.array_equal(read, expected if kind == "s" else expected.astype(kind)), name
        assert np.array_equal(file.read(name, slice(1, 2)), read[1:2]), name
    assert file.provenance == contents.provenance
    assert file.density == "analytic"
    net = file.read_net("style")
    assert net.config == NET.config
    assert {k: np.asarray(v).tolist() for k, v in net.weights.items()} == {
        "linear.weight": [[0, 1, 2], [3, 4, 5]], "bias": 2.0,
    }  # fmt: skip
    with pytest.raises(RepertoireError, match="'music_density'"):
        file.read_net("music_density")


def test_the_same_contents_give_the_same_bytes(path, contents, tmp_path):
    write_repertoire(tmp_path / "again.h5", contents)
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()


def test_a_failure_while_writing_leaves_what_was_there(path, contents, tmp_path, monkeypatch):
    target = tmp_path / "rep.h5"
    target.write_bytes(b"precious")

    def full_disk(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(h5py.Group, "create_dataset", full_disk)
    with pytest.raises(ChoreographError, match="No space left"):
        write_repertoire(target, contents)
    assert target.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [target]


def test_contents_that_do_not_match_the_layout_are_not_written(contents, tmp_path):
    arrays = dict(contents.arrays)
    incomplete = {name: array for name, array in arrays.items() if name != "clips/style"}
    for wrong in (
        incomplete,
        {**arrays, "clips/style": arrays["clips/style"][:, :5]},
        {**arrays, "body/density": arrays["body/density"][:-1]},
        {**arrays, "takes/fps": np.float64(30.0)},
    ):
        with pytest.raises(RepertoireError):
            write_repertoire(tmp_path / "rep.h5", replace(contents, arrays=wrong))
    with pytest.raises(RepertoireError, match="got oracle"):
        write_repertoire(tmp_path / "rep.h5", replace(contents, nets={"oracle": NET}))
    with pytest.raises(ParameterError, match="no folder"):
        write_repertoire(tmp_path / "none" / "rep.h5", contents)
    assert list(tmp_path.iterdir()) == []


def refused(path) -> str:
    with pytest.raises(RepertoireError) as error:
        Repertoire.open(path)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_files_that_are_not_repertoires_are_refused(path, tmp_path):
    assert "no such repertoire" in refused(tmp_path / "none.h5")
    assert "folder" in refused(tmp_path)
    (tmp_path / "text.h5").write_text("hello")
    assert "HDF5" in refused(tmp_path / "text.h5")
    (tmp_path / "empty.h5").write_bytes(b"")
    assert "HDF5" in refused(tmp_path / "empty.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    assert "another kind" in refused(tmp_path / "other.h5")


def test_other_versions_and_missing_parts_are_named(path, tmp_path):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "a") as file:
        del file["clips/style"]
    assert "clips/style" in refused(copy)
    with h5py.File(copy, "a") as file:
        file.attrs["version"] = VERSION + 1
    assert f"version {VERSION}, got {VERSION + 1}" in refused(copy)
    assert "`choreograph build-db TAKES -o copy.h5`" in refused(copy)


@pytest.mark.parametrize("damage", ["provenance", "shape", "dataset is a group"])
def test_damage_inside_a_file_is_reported(path, tmp_path, damage):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "a") as file:
        if damage == "provenance":
            put_texts(file, "provenance", ["{not json"])
        elif damage == "shape":
            del file["clips/style"]
            file["clips/style"] = np.zeros((2, 32), np.float32)
        else:
            del file["clips/style"]
            file.create_group("clips/style")
    refused(copy)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 0.999))
def test_a_truncated_file_is_refused(path, tmp_path_factory, part):
    cut = tmp_path_factory.getbasetemp() / "cut.h5"
    whole = path.read_bytes()
    cut.write_bytes(whole[: int(part * len(whole))])
    refused(cut)


def test_opening_a_file_reads_no_array(path, monkeypatch):
    read = []
    original = h5py.Dataset.__getitem__

    def counting(self, key, *args, **kwargs):
        read.append(self.name)
        return original(self, key, *args, **kwargs)

    monkeypatch.setattr(h5py.Dataset, "__getitem__", counting)
    repertoire = Repertoire.open(path)
    assert repertoire.n_clips == 15
    assert read == ["/provenance"]
    motion, _ = repertoire.motion(1, 2.0, 3.0)
    assert motion.n_frames < 40
    assert not any(name.startswith("/body") for name in read)


def test_a_compressed_file_is_smaller_and_hardly_different(contents, path, tmp_path):
    small = tmp_path / "compressed.h5"
    write_repertoire(small, contents, compress=True)
    n_bytes = sum(array.nbytes for array in contents.arrays.values())
    assert small.stat().st_size < min(0.1 * n_bytes, path.stat().st_size)
    whole, compressed = RepertoireFile(path), RepertoireFile(small)
    for name in DATASETS:
        a, b = whole.read(name), compressed.read(name)
        if name in QUANTISATION_STEPS:
            assert b.dtype == a.dtype
            np.testing.assert_allclose(b, a, atol=QUANTISATION_STEPS[name] / 2 + 1e-7)
            for part in (slice(3, 9), slice(0, 0), slice(len(b) - 2, len(b)), slice(100, 240)):
                np.testing.assert_array_equal(compressed.read(name, part), b[part])
        else:
            if name in (*DERIVED, *MADE_WHEN_READ):
                continue  # from the quantised motion
            np.testing.assert_array_equal(a, b)
    np.testing.assert_allclose(compressed.read_net("style").weights["bias"], NET.weights["bias"], rtol=1e-3)
    assert compressed.read_net("style").weights["bias"].dtype == np.float32
    assert set(LAYOUT["compressed"]["datasets"]) == set(QUANTISATION_STEPS)
    assert tuple(LAYOUT["compressed"]["left_out"]) == MADE_WHEN_READ
    assert set(LAYOUT["compressed"]["half_precision"]) == set(HALF_PRECISION)


def test_delta_coding_restarts(contents, tmp_path, monkeypatch):
    for module in ("schema", "writing", "store"):
        monkeypatch.setattr(f"choreograph.library.{module}.DELTA_RESTART", 7)
    monkeypatch.setitem(schema.ENCODING, "restart", 7)
    write_repertoire(tmp_path / "often.h5", contents, compress=True)
    compressed = RepertoireFile(tmp_path / "often.h5")
    whole = compressed.read("motion/root_pos_m")
    np.testing.assert_allclose(whole, contents.arrays["motion/root_pos_m"], atol=0.0002)
    np.testing.assert_array_equal(compressed.read("motion/root_pos_m", slice(20, 23)), whole[20:23])


def test_arrays_beyond_16_bits_are_not_quantised(contents, tmp_path):
    name = "motion/root_pos_m"
    far = replace(contents, arrays={**contents.arrays, name: contents.arrays[name] + 100.0})
    write_repertoire(tmp_path / "far.h5", far, compress=True)
    file = RepertoireFile(tmp_path / "far.h5")
    np.testing.assert_array_equal(file.read(name), far.arrays[name].astype(np.float32))
    np.testing.assert_allclose(file.read("body/pos_m"), contents.arrays["body/pos_m"] + 100.0, atol=0.002)


def test_a_compressed_file_that_holds_body_positions_is_read(contents, tmp_path):
    """As those of before November 2026."""
    name, step = "body/pos_m", 0.001
    write_repertoire(tmp_path / "before.h5", contents, compress=True)
    with h5py.File(tmp_path / "before.h5", "a") as file:
        assert name not in file
        encoded = delta_encode(quantised(contents.arrays[name], step))
        file.create_dataset(name, data=encoded).attrs.update(
            step=step, order=DELTA_ORDER, restart=DELTA_RESTART, folded=True
        )
    file = RepertoireFile(tmp_path / "before.h5")
    np.testing.assert_allclose(file.read(name), contents.arrays[name], atol=0.0006)
    np.testing.assert_array_equal(file.read_rows(name, 5, 9), file.read(name)[5:9])


# Rows of frames are read in blocks, which are kept up to a number of bytes, by any thread, from any file.


MOTION = ("motion/root_pos_m", "motion/local_quat", "body/pos_m")


@pytest.fixture(scope="module")
def row_contents():
    return synthetic_contents(synthetic_takes(duration_s=40.0))


@pytest.fixture(scope="module")
def plain(row_contents, tmp_path_factory):
    path = tmp_path_factory.mktemp("rows") / "plain.h5"
    write_repertoire(path, row_contents)
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


def test_a_replaced_file_is_read_again_and_a_missing_one_named(row_contents, plain, tmp_path):
    path = tmp_path / "rep.h5"
    shutil.copy(plain, path)
    file = RepertoireFile(path)
    before = file.read_rows("body/density", 0, 50)
    changed = {**row_contents.arrays, "body/density": row_contents.arrays["body/density"] + 1}
    write_repertoire(
        path, type(row_contents)(changed, row_contents.density, row_contents.provenance, row_contents.nets)
    )
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


# Rows of a file joined with new ones: read as one array, and written to the same bytes as one array.


LARGE = (
    "motion/root_pos_m",
    "motion/local_quat",
    "body/pos_m",
    "body/root_frame",
    "body/sums",
    "body/density",
)


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "compressed"])
def written(request, tmp_path_factory):
    """Contents of several chunks of each large array, their file, and whether it is compressed."""
    compress = request.param
    contents = synthetic_contents(synthetic_takes(periods_s=(0.5, 0.7), duration_s=145.0))
    contents = replace(contents, arrays=with_derived(contents.arrays, compress=compress))
    path = tmp_path_factory.mktemp("joined") / "rep.h5"
    write_repertoire(path, contents, compress=compress)
    return contents, RepertoireFile(path), compress


def joined(file, name, array, parts):
    """The same rows as `array`: ranges of rows of the file, and where `parts` has a number, new rows."""
    kind = DATASETS[name][0] if name in DATASETS else "f4"
    rows = [array[slice(*map(abs, part))] if part[0] < 0 else part for part in parts]
    return JoinedRows(file, name, rows, kind)


# Of an array of n rows. Negative ranges are new rows.
SPLITS = {
    "all kept": lambda n: [(0, n)],
    "one row added": lambda n: [(0, n - 1), (-(n - 1), -n)],
    "half added": lambda n: [(0, n // 2), (-(n // 2), -n)],
    "the middle replaced": lambda n: [(0, n // 3), (-(n // 3), -(n // 2)), (n // 2, n)],
    "in two ranges": lambda n: [(0, n // 3), (n // 3, n)],
}


@pytest.mark.parametrize("split", SPLITS)
def test_joined_rows_are_written_to_the_bytes_of_one_array(tmp_path, written, split):
    contents, file, compress = written
    arrays = dict(contents.arrays)
    for name in set(LARGE) & set(arrays):
        array = np.asarray(arrays[name])
        arrays[name] = joined(file, name, array, SPLITS[split](len(array)))
    write_repertoire(tmp_path / "rep.h5", replace(contents, arrays=arrays), compress=compress)
    assert (tmp_path / "rep.h5").read_bytes() == file.path.read_bytes()


def test_kept_chunks_are_not_unpacked(tmp_path, written, monkeypatch):
    contents, file, compress = written
    name = "motion/local_quat"
    n_rows, read = file.shapes[name][0], []
    new = np.asarray(contents.arrays[name])[-10:]
    real = RepertoireFile.read
    monkeypatch.setattr(
        RepertoireFile,
        "read",
        lambda file, name, part=slice(None): read.append(part) or real(file, name, part),
    )
    arrays = {**contents.arrays, name: JoinedRows(file, name, [(0, n_rows - 10), new], "f4")}
    write_repertoire(tmp_path / "rep.h5", replace(contents, arrays=arrays), compress=compress)
    with h5py.File(file.path) as stored:
        chunk_rows = stored[name].chunks[0]
    assert (
        sum(part.stop - part.start for part in read) < chunk_rows
    )  # those of the last, of which some are new


def test_rows_are_those_of_the_parts(written):
    contents, file, _ = written
    density = np.asarray(contents.arrays["body/density"])
    rows = joined(file, "body/density", density, [(5, 40), (-7, -9), (100, 103)])
    expected = np.concatenate([density[5:40], density[7:9], density[100:103]])
    assert rows.shape == (40,) and rows.size == 40 and rows.nbytes == 160 and rows.dtype == np.float32
    np.testing.assert_array_equal(np.asarray(rows), expected)
    for start in range(40):
        np.testing.assert_array_equal(rows.rows(start, start + 4), expected[start : start + 4])
    assert rows.n_kept == 0
    assert joined(file, "body/density", density, [(0, 8), (8, 11), (-11, -12), (12, 20)]).n_kept == 11
    assert joined(file, "body/density", density, []).shape == (0,)


def test_new_rows_that_16_bits_do_not_hold_are_stored_as_they_are(tmp_path, written):
    contents, file, compress = written
    if not compress:
        pytest.skip("only compressed files are quantised")
    root = np.asarray(contents.arrays["motion/root_pos_m"], np.float32).copy()
    root[-5:] += 100.0
    arrays = {name: array for name, array in contents.arrays.items()}
    arrays["motion/root_pos_m"] = joined(
        file, "motion/root_pos_m", root, [(0, len(root) - 5), (5 - len(root), -len(root))]
    )
    write_repertoire(tmp_path / "far.h5", replace(contents, arrays=arrays), compress=True)
    stored = RepertoireFile(tmp_path / "far.h5")
    assert "motion/root_pos_m" not in stored.quantised
    np.testing.assert_allclose(stored.read("motion/root_pos_m"), root, atol=0.000126)


def test_a_damaged_block_that_has_to_be_read_is_an_error(tmp_path, written):
    _, file, _ = written
    with h5py.File(file.path) as stored:
        chunk = stored["body/density"].id.get_chunk_info(0)
    content = bytearray(file.path.read_bytes())
    content[chunk.byte_offset + 9] ^= 1
    (tmp_path / "bad.h5").write_bytes(content)
    bad = RepertoireFile(tmp_path / "bad.h5")
    rows = JoinedRows(bad, "body/density", [(1, bad.shapes["body/density"][0])], "f4")
    with pytest.raises(RepertoireError, match=r"bad\.h5"):
        rows.rows(0, 3)
