"""Rows of a file joined with new ones: read as one array, and written to the same bytes as one array."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_takes

from choreograph.core.errors import RepertoireError
from choreograph.library.derived import with_derived
from choreograph.library.joined_rows import JoinedRows
from choreograph.library.schema import DATASETS
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import write_repertoire

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
