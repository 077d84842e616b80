"""Repertoires from untrusted sources: damaged content is refused in one line, with little memory."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import h5py
import numpy as np
import pytest
from synthetic_repertoire import (
    put_texts,
    read_all,
    synthetic_contents,
    synthetic_takes,
    with_counts,
    with_vocabulary,
)

from choreograph.core.errors import ChoreographError
from choreograph.library.schema import DATASETS, QUANTISATION_STEPS
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import write_repertoire
from choreograph.nets.configs import WordConfig

OF_FRAMES = (
    "body/pos_m",
    "body/density",
    "body/speed_m_s",
    "body/heading_rad",
    "body/sums",
    "body/root_frame",
)
BEYOND_BYTES = 2 << 30  # of memory, for a file of a few kilobytes
SLOWEST_S = 30.0


@dataclass(frozen=True)
class Crafted:
    """A change of a good file that must be refused, in words of its message."""

    name: str
    change: Callable[[h5py.File], None]
    message: str


def values(name: str, value, message: str = "") -> Crafted:
    def change(file: h5py.File) -> None:
        file[name][len(file[name]) // 2] = value

    return Crafted(f"{name} of {value}", change, message or name.split("_")[0])


def replaced(name: str, make: Callable[[h5py.File, np.ndarray], None], message: str, what: str) -> Crafted:
    """The array taken out and another put in by `make(file, array)`."""

    def change(file: h5py.File) -> None:
        array = file[name][()]
        del file[name]
        make(file, array)

    return Crafted(f"{name} as {what}", change, message)


def attribute(owner: str, name: str, value, message: str) -> Crafted:
    def change(file: h5py.File) -> None:
        file[owner].attrs[name] = np.bytes_(value) if isinstance(value, str) else value

    return Crafted(f"{owner} with {name} {str(value)[:20]}", change, message)


def _put(file, name, data, compression=None) -> None:
    file.create_dataset(name, data=data, compression=compression)


def _external_storage(file, array) -> None:
    file.create_dataset("body/density", array.shape, "f4", external=[("/etc/hostname", 0, array.nbytes)])


def _virtual(file, array) -> None:
    layout = h5py.VirtualLayout(array.shape, "f4")
    layout[:] = h5py.VirtualSource("other.h5", "x", array.shape)
    file.create_virtual_dataset("body/density", layout)


def _cycle(file, array) -> None:
    file["body/density"] = h5py.SoftLink("/body/again")
    file["body/again"] = h5py.SoftLink("/body/density")


def _references(file, array) -> None:
    file.create_dataset("clips/take", (len(array),), h5py.ref_dtype)


def _latin_1(file, array) -> None:
    file["takes/name"] = np.where(array > 0, array | 128, 0).astype(np.uint8)


def _huge_chunks(file, array) -> None:
    data = file.create_dataset("body/density", array.shape, "f4", maxshape=(None,), chunks=(1 << 28,))
    assert data.chunks


def _linked_group(file: h5py.File) -> None:
    del file["clips"]
    file["clips"] = h5py.ExternalLink("other.h5", "/clips")


def _empty_rows(file: h5py.File) -> None:
    """10⁹ frames that the file does not hold."""
    for name in OF_FRAMES:
        shape, kind = (10**9, *file[name].shape[1:]), file[name].dtype
        del file[name]
        file.create_dataset(name, shape, kind, chunks=True)
    file["takes/body_stop"][-1] = 10**9


def _deflated_zeros(file: h5py.File) -> None:
    """400 MB of positions in half a megabyte."""
    n_frames = 1_600_000
    for name in OF_FRAMES:
        shape, kind = (n_frames, *file[name].shape[1:]), file[name].dtype
        del file[name]
        chunks = (30_000, *shape[1:])
        rows = file.create_dataset(name, shape, kind, chunks=chunks, compression="gzip", fillvalue=1.0)
        zeros = zlib.compress(bytes(kind.itemsize * int(np.prod(chunks))))
        for row in range(0, n_frames, chunks[0]):  # as they are stored, or each would be compressed often
            rows.id.write_direct_chunk((row, *[0] * (len(shape) - 1)), zeros)
    file["takes/body_stop"][-1] = n_frames


def _long_notes(file: h5py.File) -> None:
    """One note of 4 MB among 5,000 takes: 80 GB if each row had room for it."""
    takes = file["takes"]
    for name in list(takes):
        if DATASETS[f"takes/{name}"][0] == "s":
            put_texts(file, f"takes/{name}", ["a"] * 5000)
            continue
        array = takes[name][()]
        del takes[name]
        takes.create_dataset(name, data=np.resize(array, (5000, *array.shape[1:])))
    put_texts(file, "takes/notes", ["x" * (4 << 20), *["a"] * 4999])


def provenance(text: str, message: str) -> Crafted:
    return Crafted(f"provenance {text[:20]}", lambda file: put_texts(file, "provenance", [text]), message)


def config(**changes) -> Crafted:
    def change(file: h5py.File) -> None:
        net = file["nets/words"].attrs
        net["config"] = np.bytes_(json.dumps({**json.loads(net["config"]), **changes}))

    return Crafted(f"a network of {changes}", change, "")


CRAFTED = (
    values("clips/take", 99),
    values("clips/take", -1),
    values("clips/start_frame", 10**9),
    values("clips/start_frame", -5),
    values("takes/fps", 0.0),
    values("takes/fps", -30.0),
    values("takes/fps", np.nan),
    values("takes/motion_stop", 10**12),
    values("takes/body_start", 0),
    values("takes/beat_stop", 0),
    values("takes/count_stop", -3),
    values("takes/metre", 99),
    values("counts/time_s", np.inf),
    values("counts/time_s", 0.0, "increasing"),
    values("counts/number", 11, "numbers"),
    values("figures/take", 77),
    values("motion/root_pos_m", np.nan),
    values("motion/local_quat", np.inf),
    values("body/pos_m", 1e30),
    values("body/density", np.nan),
    values("clips/style", np.nan),
    values("skeleton/parents", 23, "parent"),
    values("motifs/word_motif", 10**6),
    values("motifs/transitions", np.nan),
    values("nets/words/out.weight", np.nan, "finite"),
    replaced("body/density", _external_storage, "another place", "another file's bytes"),
    replaced("body/density", _virtual, "another place", "a part of another file"),
    replaced("body/density", _cycle, "link", "a link to itself"),
    replaced("clips/take", _references, "clips/take", "references to objects"),
    replaced("body/density", _huge_chunks, "chunks", "chunks of 1 GiB"),
    replaced("takes/fps", lambda file, a: _put(file, "takes/fps", ["25"] * len(a)), "fps", "text"),
    replaced("takes/name", lambda file, a: _put(file, "takes/name", np.arange(len(a))), "name", "numbers"),
    replaced("clips/style", lambda file, a: _put(file, "clips/style", a.astype("c8")), "style", "complex"),
    replaced("clips/style", lambda file, a: _put(file, "clips/style", a, "lzf"), "filters", "lzf"),
    replaced("clips/style", lambda file, a: file.create_group("clips/style"), "clips/style", "a group"),
    Crafted("a group of another file", _linked_group, "link"),
    Crafted("10⁹ empty rows", _empty_rows, "bytes"),
    Crafted("400 MB of zeros", _deflated_zeros, "unpacked"),
    Crafted("a long note", _long_notes, "characters"),
    attribute("/", "version", "2", "version"),
    attribute("/", "version", np.arange(3), "version"),
    attribute("/", "version", np.nan, "version"),
    attribute("/", "format", np.arange(3), "another kind"),
    attribute("/", "format", h5py.Empty("f"), "another kind"),
    provenance("[1, 2]", "object"),
    provenance("[" * 100_000, "JSON"),
    provenance('{"trained_on": 5}', "trained_on"),
    provenance('{"selection_beat_weight": "x"}', "selection_beat_weight"),
    attribute("/", "density", h5py.Empty("S1"), "density"),
    replaced("takes/name", lambda file, a: _put(file, "takes/name", a[:-1]), "zero", "texts without an end"),
    replaced("takes/name", _latin_1, "UTF-8", "Latin-1"),
    attribute("/", "density", np.zeros((2, 2)), "density"),
    attribute("nets/words", "config", "null", "object"),
    config(width=10**8),
    config(width=-4),
    config(width="64"),
    config(n_blocks=10**9),
    config(n_blocks=1.5),
    config(width=[64] * 40),
    config(mirrored_share=None),
)  # fmt: skip
QUANTISED = (
    attribute("motion/local_quat", "order", 10**9, "order"),
    attribute("motion/local_quat", "order", -1, "order"),
    attribute("motion/local_quat", "order", "2", "order"),
    attribute("motion/local_quat", "order", 1, "order 2, got"),
    attribute("motion/local_quat", "restart", 0, "restart"),
    attribute("motion/local_quat", "restart", 4096, "restart 8192, got"),
    attribute("motion/local_quat", "folded", False, "folded True, got"),
    attribute("motion/local_quat", "step", np.nan, "step"),
    attribute("motion/local_quat", "step", np.zeros(3), "step"),
    attribute("motion/local_quat", "folded", "yes", "folded"),
)
# Of a compressed file, whose body positions are made from its motion.
MADE = (
    values("takes/fps", 0.0),
    values("takes/fps", 1e-3, "rows"),
    values("takes/fps", 1000.0, "rows"),
    values("takes/body_stop", 5, "rows"),
    values("takes/motion_stop", 5, "rows"),
    values("skeleton/parents", 23, "parent"),
    values("skeleton/offsets_m", np.nan, "offsets"),
    replaced(
        "skeleton/names", lambda file, a: _put(file, "skeleton/names", a * 0 + (a > 0) * 120), "name", "x"
    ),
)
IN_A_CHILD = ("a network of {'width': 100000000}", "10⁹ empty rows", "400 MB of zeros", "a long note")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A good file of each way of storing arrays: plain, and quantised."""
    folder = tmp_path_factory.mktemp("good")
    takes = with_counts(synthetic_takes(duration_s=12.0))
    contents = with_vocabulary(synthetic_contents(takes), takes)
    write_repertoire(folder / "plain.h5", contents)
    write_repertoire(folder / "quantised.h5", contents, compress=True)
    read_all(folder / "plain.h5")
    read_all(folder / "quantised.h5")
    return folder


def crafted(source, target, craft: Crafted):
    shutil.copy(source, target)
    with h5py.File(target, "a") as file:
        craft.change(file)
    return target


def refused(path) -> str:
    with pytest.raises(ChoreographError) as caught:
        read_all(path)
    message = str(caught.value)
    assert "\n" not in message and len(message) < 500
    assert str(path) in message
    return message


@pytest.mark.parametrize(
    "craft", [c for c in CRAFTED if c.name not in IN_A_CHILD], ids=lambda craft: craft.name
)
def test_a_crafted_file_is_refused_in_a_line(whole, tmp_path, craft):
    assert craft.message in refused(crafted(whole / "plain.h5", tmp_path / "crafted.h5", craft))


@pytest.mark.parametrize("craft", QUANTISED, ids=lambda craft: craft.name)
def test_crafted_quantisation_is_refused_in_a_line(whole, tmp_path, craft):
    assert "motion/local_quat" in QUANTISATION_STEPS
    assert craft.message in refused(crafted(whole / "quantised.h5", tmp_path / "crafted.h5", craft))


@pytest.mark.parametrize("craft", MADE, ids=lambda craft: craft.name)
def test_positions_are_not_made_from_crafted_motion(whole, tmp_path, craft):
    path = crafted(whole / "quantised.h5", tmp_path / "crafted.h5", craft)
    assert craft.message in refused(path)
    for read in (lambda: RepertoireFile(path).read("body/pos_m"), lambda: RepertoireFile(path).verify()):
        with pytest.raises(ChoreographError, match=r"crafted\.h5") as caught:
            read()
        assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_hungry_files_are_refused_with_little_memory(whole, tmp_path):
    """In a process that has no more than 2 GiB beyond what the program itself takes, for all of them."""
    crafts = [craft for craft in CRAFTED if craft.name in IN_A_CHILD]
    paths = [
        crafted(whole / "plain.h5", tmp_path / f"crafted{i}.h5", craft) for i, craft in enumerate(crafts)
    ]
    code = f"""if True:
        import resource, sys
        sys.path[:0] = {sys.path!r}
        from pathlib import Path
        from time import process_time
        from synthetic_repertoire import read_all
        from choreograph.core.errors import ChoreographError
        read_all(Path({str(whole / "plain.h5")!r}))
        base = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (base + {BEYOND_BYTES},) * 2)
        for path in {[str(path) for path in paths]!r}:
            began_s = process_time()
            try:
                read_all(Path(path))
            except ChoreographError as error:
                print(process_time() - began_s, error)
            else:
                print("read", path)
    """
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    assert child.returncode == 0, child.stderr
    told = child.stdout.splitlines()
    assert len(told) == len(crafts) == len(IN_A_CHILD)
    for craft, path, line in zip(crafts, paths, told, strict=True):
        assert craft.message in line and str(path) in line
        assert float(line.split()[0]) < SLOWEST_S


def test_a_link_of_a_network_is_refused(whole, tmp_path):
    path = shutil.copy(whole / "plain.h5", tmp_path / "crafted.h5")
    with h5py.File(path, "a") as file:
        del file["nets/words/out.weight"]
        file["nets/words/out.weight"] = h5py.ExternalLink("other.h5", "/x")
    assert "link" in refused(path)


def test_a_configuration_may_change_what_does_not_shape_the_network(whole, tmp_path):
    """Checks do not refuse what is only unusual: a network that was trained for longer."""
    craft = config(steps=10 * WordConfig().steps)
    read_all(crafted(whole / "plain.h5", tmp_path / "longer.h5", craft))


def test_a_changed_byte_of_any_array_is_found(whole, tmp_path):
    """HDF5 verifies the checksum of a block when it reads it, and `verify` reads all blocks."""
    path = tmp_path / "changed.h5"
    for name in ("body/pos_m", "motion/local_quat", "clips/style", "takes/name", "counts/time_s"):
        shutil.copy(whole / "plain.h5", path)
        with h5py.File(path) as file:
            at = file[name].id.get_chunk_info(0)
        data = bytearray(path.read_bytes())
        data[at.byte_offset + at.size // 2] ^= 1
        path.write_bytes(data)
        with pytest.raises(ChoreographError, match=r"changed\.h5"):
            RepertoireFile(path).verify()


def test_a_text_in_a_heap_is_not_read(whole, tmp_path):
    """HDF5 2.0 loops endlessly on damaged heaps."""
    path = shutil.copy(whole / "plain.h5", tmp_path / "crafted.h5")
    with h5py.File(path, "a") as file:
        file.attrs["density"] = "analytic"
    assert "density" in refused(path)
