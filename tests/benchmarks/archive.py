"""Libraries of many clips, and what opening them and dancing with them takes.

    OMP_NUM_THREADS=1 python tests/benchmarks/archive.py --clips 10000 100000 [--folder F] [--seconds 20]

A library is made of copies of the built-in takes. Each copy has another size, and its style vectors are moved
at random. Rows are written straight to the file, so 10^5 clips take a minute and 3 GB. Every measurement is
made in a new process: opening, the first dance, a second one with another seed, and the most memory, and in
another one the addition of a take of 20 s with its song, which includes the imports.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

import choreograph as cg
from choreograph.formats.register import save_motion
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.schema import layout_of
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import Contents, write_repertoire, write_texts

STYLE_STD = 0.01  # of each of 32 numbers of a vector of length 1
SIZE_STD = 0.03
# Arrays of lengths, which are multiplied by the size of a copy.
SCALED = (
    "motion/root_pos_m",
    "body/pos_m",
    "body/root_frame",
    "body/speed_m_s",
    "body/sums",
    "takes/centre_m",
)
OF_FILE = ("J", "E", "J 3", "E 3", "1", "K", "K 184", "G", "G K", "G K K", "H", "H 2", "Z", "O")
OFFSETS = {
    "clips/take": "X", "sources/take": "X", "figures/take": "X", "motifs/word_take": "X",
}  # fmt: skip
for _part, _axis in (("motion", "M"), ("body", "B"), ("beat", "Q"), ("count", "U")):
    OFFSETS |= {f"takes/{_part}_start": _axis, f"takes/{_part}_stop": _axis}


def make_library(path: Path, n_clips: int, *, seed: int = 0) -> None:
    """Write a library of at least `n_clips` clips."""
    base = path.with_suffix(".base.h5")
    source = RepertoireFile(STARTER_PATH)
    arrays = source.arrays()
    for name in [name for name in arrays if name.startswith(("notes/", "body/root_frame"))]:
        del arrays[name]
    nets = {name: source.read_net(name) for name in source.net_names}
    write_repertoire(base, Contents(arrays, source.density, source.provenance, nets))
    file = RepertoireFile(base)
    n_copies = -(-n_clips // file.shapes["clips/take"][0])
    rng = np.random.default_rng(seed)
    sizes = np.append(1.0, np.exp(SIZE_STD * rng.normal(size=n_copies - 1)))
    with h5py.File(base) as old, h5py.File(path, "w", libver=("v110", "v110")) as new:
        new.attrs.update(old.attrs)
        old.copy("nets", new)
        for name, (kind, axes, *_) in layout_of(file.names).items():
            array = file.read(name)
            if axes in OF_FILE:
                old.copy(name, new, name) if "/" in name else old.copy(name, new)
            elif kind == "s":
                texts = [
                    f"{text}~{copy}" if name == "takes/name" else text
                    for copy in range(n_copies)
                    for text in array
                ]
                write_texts(new, name, np.array(texts))
            else:
                _write_copies(new, name, old[name], file, array, sizes, rng)
        for name in ("motifs/counts",) if "motifs/counts" in new else ():
            new[name][...] = np.asarray(new[name]) * n_copies
    base.unlink()


def library_in(folder: Path, n_clips: int) -> Path:
    """The library of at least `n_clips` clips in a folder, which is made if it is not there."""
    path = folder / f"archive-{n_clips}.h5"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".part")
        make_library(unfinished, n_clips)
        unfinished.rename(path)
    return path


def _write_copies(
    new: h5py.File, name: str, like: h5py.Dataset, file: RepertoireFile, array: NDArray[Any],
    sizes: NDArray[np.float64], rng: np.random.Generator,
) -> None:  # fmt: skip
    """The rows of an array for every copy."""
    rows = len(array)
    options = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if like.compression else {}
    shape, chunks = (rows * len(sizes), *array.shape[1:]), like.chunks or (max(1, rows), *array.shape[1:])
    data = new.create_dataset(
        name, shape, like.dtype, chunks=chunks, fletcher32=True, track_times=False, **options
    )
    step = 0 if name not in OFFSETS else _length(file, OFFSETS[name])
    for part in np.array_split(np.arange(len(sizes)), -(-len(sizes) // 8)):
        copies = np.concatenate([_copy(name, array, copy, float(sizes[copy]), step, rng) for copy in part])
        data[part[0] * rows : part[0] * rows + len(copies)] = copies


def _copy(
    name: str, array: NDArray[Any], copy: int, size: float, step: int, rng: np.random.Generator
) -> NDArray[Any]:
    if name in SCALED:
        return (array * size).astype(array.dtype)
    if name == "clips/style" and copy:
        moved = array + STYLE_STD * rng.normal(size=array.shape)
        return (moved / np.linalg.norm(moved, axis=1, keepdims=True)).astype(array.dtype)
    return array + array.dtype.type(step * copy) if step else array


def _length(file: RepertoireFile, axis: str) -> int:
    names = {
        "X": "takes/fps",
        "M": "motion/root_pos_m",
        "B": "body/density",
        "Q": "beats/motion_s",
        "U": "counts/time_s",
    }
    return file.shapes[names[axis]][0]


# Measurements in new processes.


_MEASURED = """
import json, sys, time
import choreograph as cg
path, seconds = sys.argv[1], float(sys.argv[2])
clock = lambda: (time.perf_counter(), time.process_time())
def took(since): now = clock(); return [round(b - a, 3) for a, b in zip(since, now)]
cg.example_songs(), cg.Repertoire  # what they import is not counted
start = clock(); repertoire = cg.Repertoire.open(path); repertoire.takes; opened = took(start)
song = cg.load_song(cg.example_songs()["house"])
start = clock(); first = cg.dance(song, repertoire, duration_s=seconds); dance = took(start)
start = clock(); cg.dance(song, repertoire, duration_s=seconds, seed=1); second = took(start)
# Not `ru_maxrss`, which a process inherits from the one that started it.
peak = int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) / 1e6
found = {"open": opened, "first": dance, "second": second}
print(json.dumps({"clips": repertoire.n_clips, **found, "peak_gb": peak, "cost": first.plan.total_cost}))
"""


_MEASURED_ADDING = """
import json, sys, time
clock = lambda: (time.perf_counter(), time.process_time())
start = clock()
import choreograph as cg
added = cg.change_takes(sys.argv[1], add=sys.argv[2], output=sys.argv[3], workers=1)
took = [round(b - a, 3) for a, b in zip(start, clock())]
peak = int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) / 1e6
print(json.dumps({"clips": added.repertoire.n_clips, "add": took, "peak_gb": peak}))
"""


def measured(path: Path, seconds: float) -> dict[str, Any]:
    """Seconds by the clock and of CPU of opening and of two dances, and the peak of memory in GB."""
    return _printed_by(_MEASURED, str(path), str(seconds))


def measured_adding(path: Path) -> dict[str, Any]:
    """The same of the addition of a take, to a file beside, which is removed."""
    source = path.with_suffix(".new")
    source.mkdir(exist_ok=True)
    starter = cg.starter_repertoire()
    save_motion(source / "added.bvh", starter.motion(0, stop_s=20.0)[0])
    shutil.copy(cg.example_songs()["cha-cha"], source / "added.ogg")
    output = path.with_suffix(".grown.h5")
    try:
        return _printed_by(_MEASURED_ADDING, str(path), str(source), str(output))
    finally:
        output.unlink(missing_ok=True)
        shutil.rmtree(source)


def _printed_by(code: str, *words: str) -> dict[str, Any]:
    """The JSON object that a new process prints last."""
    run = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    return dict(json.loads(run.stdout.splitlines()[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--clips", type=int, nargs="+", default=[10_000])
    parser.add_argument("--folder", type=Path, default=Path("build"))
    parser.add_argument("--seconds", type=float, default=20.0)
    options = parser.parse_args()
    for n_clips in options.clips:
        path = library_in(options.folder, n_clips)
        print(json.dumps(measured(path, options.seconds)), flush=True)
        print(json.dumps(measured_adding(path)), flush=True)


if __name__ == "__main__":
    main()
