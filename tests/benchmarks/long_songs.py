"""How much time and memory dances to long songs take, and whether they say what they are doing.

    OMP_NUM_THREADS=1 python tests/benchmarks/long_songs.py [--minutes 1 5 20 60] [--engines graph]

The songs are the built-in ones, one after another at changing levels with gaps between. Every dance is made
by `choreograph dance` in a process of its own, as a motion alone (npz) and as motion and page (bvh, html):
CPU seconds, peak resident memory, and how long `--json` printed no progress at most, and after which line.
"""

from __future__ import annotations

import argparse
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import soundfile
from numpy.typing import NDArray
from processes import reported, started

import choreograph as cg
from choreograph.core.timebase import SAMPLE_RATE_HZ

OUTPUTS = (("npz",), ("bvh", "html"))


@dataclass(frozen=True)
class Cost:
    """What one run took."""

    cpu_s: float
    peak_mb: float
    silent_s: float  # the longest time without a line of progress
    silent_after: str


def long_song(minutes: float, seed: int = 0) -> NDArray[np.float32]:
    """Mono samples (S,) at 22.05 kHz."""
    rng = np.random.default_rng(seed)
    songs = [cg.load_song(path).samples for path in cg.example_songs().values()]
    wanted, parts = round(minutes * 60 * SAMPLE_RATE_HZ), []
    while sum(map(len, parts)) < wanted:
        gap = np.zeros(round(rng.uniform(0.0, 3.0) * SAMPLE_RATE_HZ), np.float32)
        parts += [songs[rng.integers(len(songs))] * np.float32(rng.uniform(0.3, 1.0)), gap]
    return np.concatenate(parts)[:wanted]


def cost_of(song: Path, engine: str, outputs: list[Path]) -> Cost:
    """Dance to a song in another process. Raises `RuntimeError` if that fails."""
    arguments = ["-m", "choreograph", "dance", str(song), "--engine", engine, "--json"]
    arguments += [text for path in outputs for text in ("-o", str(path))]
    command = started(arguments)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stderr is not None
    silent, last, latest = (0.0, "the start"), "the start", time.monotonic()
    for line in process.stderr:
        now = time.monotonic()
        silent = max(silent, (now - latest, last))
        last, latest = line.strip(), now
    spent = reported(process.stdout.read())
    process.wait()
    return Cost(spent.cpu_s, 1024 * spent.peak_gb, *silent)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, nargs="+", default=[1.0, 5.0, 20.0, 60.0])
    parser.add_argument("--engines", nargs="+", default=["graph"], choices=["graph", "mixer", "rollout"])
    options = parser.parse_args()
    print("| song | engine | files | CPU s | peak MB | silent for at most |")
    print("| --- | --- | --- | --- | --- | --- |", flush=True)
    with TemporaryDirectory() as folder:
        for minutes in options.minutes:
            song = Path(folder) / "song.flac"
            soundfile.write(song, long_song(minutes), SAMPLE_RATE_HZ)
            for engine in options.engines:
                for suffixes in OUTPUTS:
                    cost = cost_of(song, engine, [Path(folder) / f"dance.{suffix}" for suffix in suffixes])
                    print(
                        f"| {minutes:g} min | {engine} | {', '.join(suffixes)} | {cost.cpu_s:.0f} | "
                        f"{cost.peak_mb:,.0f} | {cost.silent_s:.1f} s after `{cost.silent_after}` |",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
