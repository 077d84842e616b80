"""What a large archive costs: measured costs of a take and a clip, and those of 10,000 hours of takes.

    OMP_NUM_THREADS=1 python tests/benchmarks/scale.py TAKES [-o data_schema] [--clips 1000 10000 100000]
        [--libraries FOLDER]

TAKES is a folder of `build-db` with at least 16 takes, such as `build/starter/takes`. Eight of them are added
to a build of eight others, with the networks kept, in one process.
Writes scale.md and scale.png. Needs Matplotlib, and 37 kB of disk for a clip. With --libraries, libraries of
`archive.py` in a folder are used, and kept there.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from archive import library_in, measured
from processes import spent

import choreograph as cg

HOURS = 10_000.0
N_TAKES = 8  # that are added to as many others
SONG_S = 20.0


@dataclass(frozen=True)
class BuildCosts:
    """What a minute of motion costs in a build, and in the file."""

    cpu_s: float
    clips: float
    mb: float
    compressed_mb: float


def build_costs(takes: Path, folder: Path) -> BuildCosts:
    """The costs of takes that are added to a build of as many others."""
    names = sorted({path.stem for path in takes.glob("*.bvh")})
    if len(names) < 2 * N_TAKES:
        raise SystemExit(f"{takes}: expected at least {2 * N_TAKES} BVH takes, got {len(names)}")
    # Every genre: takes are sorted by genre.
    chosen = [names[index] for index in np.linspace(0, len(names) - 1, 2 * N_TAKES).astype(int)]
    for part, of_part in (("first", chosen[::2]), ("added", chosen[1::2])):
        (folder / part).mkdir()
        for name in of_part:
            for path in takes.glob(f"{name}.*"):
                shutil.copy(path, folder / part)
    build = ["-m", "choreograph", "build-db"]
    options = ["--workers", "1", "--no-cache", "--quiet", "-o"]
    new = [*build, str(folder / "first"), "--pretrained", "clean", "--keep-networks", *options]
    first, grown, small, larger = (folder / f"{name}.h5" for name in ("first", "grown", "small", "larger"))
    spent([*new, str(small), "--compress"], folder / "cache")  # compiles
    spent([*new, str(larger), "--compress", str(folder / "added")], folder / "cache")
    spent([*new, str(first)], folder / "cache")
    used = spent([*build, str(first), "--add", str(folder / "added"), *options, str(grown)], folder / "cache")
    few, many = cg.Repertoire.open(first), cg.Repertoire.open(grown)
    minutes = _minutes(many) - _minutes(few)
    return BuildCosts(
        used.cpu_s / minutes,
        (many.n_clips - few.n_clips) / minutes,
        (grown.stat().st_size - first.stat().st_size) / 1e6 / minutes,
        (larger.stat().st_size - small.stat().st_size) / 1e6 / minutes,
    )


def _minutes(repertoire: cg.Repertoire) -> float:
    return sum(take.duration_s for take in repertoire.takes) / 60


# The measured part, and what follows from its last two sizes.


def projected(clips: np.ndarray, values: Sequence[float], n: Any) -> Any:
    """The values for `n` clips if each further clip costs as much as those between the two largest sizes.

    Measured values grew less from size to size.
    """
    slope = (values[-1] - values[-2]) / (clips[-1] - clips[-2])
    return values[-1] + slope * (n - clips[-1])


def plot(path: Path, rows: list[dict[str, Any]], n_projected: float) -> None:
    """Seconds of CPU and memory by the number of clips: measured as points, projected as dashed lines."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    clips = np.array([row["clips"] for row in rows], float)
    beyond = np.geomspace(clips[-1], n_projected)
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), constrained_layout=True)
    series = {
        "open": [row["open"][1] for row in rows],
        "first dance": [row["first"][1] for row in rows],
        "second dance": [row["second"][1] for row in rows],
    }
    for axis, of_axis, unit in (
        (axes[0], series, "CPU seconds"),
        (axes[1], {"peak memory": [row["peak_gb"] for row in rows]}, "GB"),
    ):
        for name, values in of_axis.items():
            [line] = axis.plot(clips, values, "o-", label=name)
            axis.plot(beyond, projected(clips, values, beyond), "--", color=line.get_color())
        axis.set(xscale="log", yscale="log", xlabel="clips", ylabel=unit)
        axis.legend(title="dashed: projected")
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def page(costs: BuildCosts, rows: list[dict[str, Any]], asked: Sequence[int]) -> str:
    """The page in Markdown. `asked` are the numbers of clips that libraries were asked to have at least."""
    clips = np.array([row["clips"] for row in rows], float)
    n_clips = HOURS * 60 * costs.clips
    lines = [
        "# What an archive costs",
        "",
        "`OMP_NUM_THREADS=1 python tests/benchmarks/scale.py build/starter/takes --clips "
        f"{' '.join(str(n) for n in asked)}` wrote this page. Seconds "
        "are of CPU time on one core of the machine that ran it. A projection supposes that every further "
        "clip costs as much as those between the two largest sizes. Costs grew less from size to size.",
        "",
        "![Measured and projected](scale.png)",
        "",
        "## To build",
        "",
        f"Networks are kept. Measured as the addition of {N_TAKES} takes to as many others.",
        "",
        "| | a minute of motion | 10,000 hours, projected |",
        "| --- | --- | --- |",
        f"| CPU | {costs.cpu_s:.1f} s | {HOURS * 60 * costs.cpu_s / 3600:,.0f} hours |",
        f"| clips | {costs.clips:.0f} | {n_clips / 1e6:.1f} million |",
        *(
            f"| {what} | {mb:.2f} MB | {HOURS * 60 * mb / 1e6:.2f} TB |"
            for what, mb in (("file", costs.mb), ("compressed file", costs.compressed_mb))
        ),
        "",
        "## To dance",
        "",
        "The built-in takes, copied with other sizes and styles. "
        f"Each dance lasts {SONG_S:g} s and is made in a new process.",
        "",
        "| clips | hours of takes | open | first dance | second dance | peak memory |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        lines.append(
            f"| {row['clips']:,} | {row['clips'] / costs.clips / 60:,.0f} | {row['open'][1]:.2f} s | "
            f"{row['first'][1]:.1f} s | {row['second'][1]:.1f} s | {row['peak_gb']:.2f} GB |"
        )
    for n in [n for n in (1e6, n_clips) if n > clips[-1]]:
        columns = (
            [row["open"][1] for row in rows], [row["first"][1] for row in rows],
            [row["second"][1] for row in rows], [row["peak_gb"] for row in rows],
        )  # fmt: skip
        cells = [projected(clips, values, n) for values in columns]
        lines.append(
            f"| {n:,.0f}, projected | {n / costs.clips / 60:,.0f} | {cells[0]:.1f} s | {cells[1]:,.0f} s | "
            f"{cells[2]:,.0f} s | {cells[3]:,.1f} GB |"
        )
    return "\n".join([*lines, ""])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("takes", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("data_schema"))
    parser.add_argument("--clips", type=int, nargs="+", default=[1_000, 10_000, 100_000])
    parser.add_argument("--libraries", type=Path)
    options = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        costs = build_costs(options.takes, folder)
        print(costs, flush=True)
        rows = []
        for n_clips in options.clips:
            path = library_in(options.libraries or folder, n_clips)
            rows.append(measured(path, SONG_S))
            print(rows[-1], flush=True)
            if options.libraries is None:
                path.unlink()
    plot(options.output / "scale.png", rows, HOURS * 60 * costs.clips)
    (options.output / "scale.md").write_text(page(costs, rows, options.clips), encoding="utf-8")


if __name__ == "__main__":
    main()
