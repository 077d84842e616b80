"""The 512 nearest of many style vectors: NumPy without an index, usearch and faiss side by side.

    OMP_NUM_THREADS=1 python tests/benchmarks/index.py --clips 100000 1000000

Needs usearch and faiss-cpu, which the program does not use. Vectors are those of the built-in clips, each
copied with another random step, as in `archive.py`, and the wanted ones are moved farther. Seconds are of CPU
time.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

N_NEAREST, N_WANTED, DIM = 512, 20, 32
STEP_STD, WANTED_STD = 0.01, 0.03
METHODS = ("numpy", "faiss flat", "faiss ivf 8", "faiss ivf 32", "usearch 512", "usearch 2048")
Search = Callable[[NDArray[np.float32]], NDArray[np.int64]]  # (Q, D) -> (Q, 512)


def vectors(base: NDArray[np.float32], n_clips: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Vectors (N, D) of clips, and wanted ones (Q, D)."""
    rng = np.random.default_rng(0)
    rows = np.tile(base, (-(-n_clips // len(base)), 1))[:n_clips]
    rows += rng.normal(0, STEP_STD, rows.shape).astype(np.float32)
    wanted = base[rng.choice(len(base), N_WANTED, replace=False)]
    wanted = wanted + rng.normal(0, WANTED_STD, wanted.shape).astype(np.float32)
    return tuple(v / np.linalg.norm(v, axis=1, keepdims=True) for v in (rows, wanted))


def brute_force(rows: NDArray[np.float32]) -> Search:
    """The smallest distances of all. Blocks of rows stay in the cache of the processor."""
    squares = np.einsum("nd,nd->n", rows, rows)

    def search(wanted: NDArray[np.float32]) -> NDArray[np.int64]:
        distances = np.empty((len(wanted), len(rows)), np.float32)
        for start in range(0, len(rows), 1 << 16):
            block = slice(start, start + (1 << 16))
            np.matmul(wanted, rows[block].T, out=distances[:, block])
        distances *= -2.0
        distances += squares
        found = np.argpartition(distances, N_NEAREST - 1, axis=1)[:, :N_NEAREST]
        return found

    return search


def made(method: str, rows: NDArray[np.float32]) -> Search:
    """A method's search, after its index was built."""
    kind, *given = method.split()
    if kind == "numpy":
        return brute_force(rows)
    if kind == "usearch":
        from usearch.index import Index

        index = Index(ndim=DIM, metric="l2sq", dtype="f32", expansion_search=int(given[0]))
        index.add(np.arange(len(rows)), rows, threads=1)  # keeps a copy of the rows, as faiss does
        return lambda wanted: np.asarray(index.search(wanted, N_NEAREST, threads=1).keys, np.int64)
    import faiss

    faiss.omp_set_num_threads(1)
    if given[0] == "flat":
        index = faiss.IndexFlatL2(DIM)
    else:
        index = faiss.IndexIVFFlat(faiss.IndexFlatL2(DIM), DIM, 1024)
        index.train(rows[:: max(1, len(rows) // 50_000)])
        index.nprobe = int(given[1])
    index.add(rows)
    return lambda wanted: index.search(wanted, N_NEAREST)[1]


def measured(method: str, base: NDArray[np.float32], n_clips: int) -> str:
    """A row of the table: seconds to build, milliseconds of searches, megabytes of memory, recall."""
    rows, wanted = vectors(base, n_clips)
    exact = brute_force(rows)(wanted)
    before = _resident_mb()
    start = time.process_time()
    search = made(method, rows)
    built_s = time.process_time() - start
    grown = _resident_mb() - before
    one, many = [], []
    for number in range(5):
        start = time.process_time()
        search(wanted[number : number + 1])
        one.append(time.process_time() - start)
        start = time.process_time()
        found = search(wanted)
        many.append(time.process_time() - start)
    recall = np.mean([len(np.intersect1d(a, b)) / N_NEAREST for a, b in zip(found, exact, strict=True)])
    times = f"{1e3 * min(one):.1f} | {1e3 * min(many) / N_WANTED:.1f}"
    return f"| {n_clips:,} | {method} | {built_s:.1f} | {times} | {grown:.0f} | {recall:.3f} |"


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--clips", type=int, nargs="+", default=[100_000])
    parser.add_argument("--base", type=Path, help="style vectors of clips (N, 32) as .npy")
    parser.add_argument("--method", choices=METHODS)
    options = parser.parse_args()
    if options.base is None:
        from choreograph.library.repertoire import starter_repertoire

        options.base = Path("build/styles.npy")
        options.base.parent.mkdir(exist_ok=True)
        np.save(options.base, starter_repertoire().clip_style.astype(np.float32))
    base = np.load(options.base)
    if options.method:
        print(measured(options.method, base, options.clips[0]), flush=True)
        return
    print("| clips | method | build, s | one second, ms | of twenty, ms each | memory, MB | recall |")
    print("| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for n_clips in options.clips:
        for method in METHODS:  # each in a process of its own, for its memory
            arguments = ["--clips", str(n_clips), "--base", str(options.base), "--method", method]
            subprocess.run([sys.executable, __file__, *arguments], check=True)


if __name__ == "__main__":
    main()
