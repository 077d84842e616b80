"""Many dances in one process: memory and open files stay as they are.

    OMP_NUM_THREADS=1 PYTHONPATH=tests python -m faults.many_dances [--dances 200]

Each dance has another seed, and is written as BVH and as a page. Prints a line for every tenth dance.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.library.repertoire import Repertoire, starter_repertoire

DURATION_S = 10.0


@dataclass(frozen=True)
class Usage:
    """What this process has in use."""

    memory_mb: float  # resident
    open_files: int

    @classmethod
    def now(cls) -> Usage:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return cls(pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(os.listdir("/proc/self/fd")))


def usage_of_dances(
    n: int, folder: Path, repertoire: Repertoire | None = None, *, duration_s: float = DURATION_S
) -> Iterator[Usage]:
    """Dance `n` times to a song of clicks, with the built-in repertoire by default; usage after each."""
    repertoire = starter_repertoire() if repertoire is None else repertoire
    song = write_clicks(folder / "song.wav", duration_s=duration_s)
    for seed in range(n):
        made = cg.dance(song, repertoire, seed=seed)
        made.save(folder / "dance.bvh")
        made.save(folder / "dance.html")
        yield Usage.now()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--dances", type=int, default=200)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for done, usage in enumerate(usage_of_dances(given.dances, Path(folder)), start=1):
            if done == 1 or done % 10 == 0:
                print(f"{done:>4} dances {usage.memory_mb:8.1f} MB {usage.open_files:>4} files", flush=True)


if __name__ == "__main__":
    main()
