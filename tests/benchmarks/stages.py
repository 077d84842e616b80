"""CPU seconds of a dance by stage, beside a loop that takes a known amount of work.

    OMP_NUM_THREADS=1 python tests/benchmarks/stages.py [--seconds 60 180] [--engines graph] [--repertoire R]

Stages are functions of the program, which are replaced by ones that measure the CPU time of all threads. A
stage does not include the stages inside it. All stages of a dance add up to the CPU time of the dance.
"""

from __future__ import annotations

import argparse
import importlib
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import numpy as np

import choreograph as cg
from choreograph.core.kernel_cache import njit
from content.songs.synthesis.song import render_song, write_song

REST = "rest"
STAGES = {  # name: functions, each as module:qualified name
    "decoding": ("pipeline.dancing:part_of",),
    "analysis": ("pipeline.dancing:analyse_song",),
    "material": ("pipeline.dancing:choose_material", "pipeline.dancing:resolve"),
    "candidates": ("choreography.graph.engine:candidate_clips",),
    "warping": (
        "choreography.graph.engine:warp_segments",
        "choreography.graph.engine:_counted_clips",
        "choreography.graph.engine:_clip_beats",
    ),
    "motifs of nodes": ("choreography.graph.engine:node_motifs",),
    "layers": ("choreography.graph.segments:LayerSource.layer",),
    "exact search": ("choreography.graph.planners:_search",),
    "local search": ("choreography.graph.local_search:CheapSoFar.improved",),
    "costs of the path": ("choreography.graph.planners:_path_along",),
    "timing of transitions": ("choreography.graph.engine:with_transitions_on_counts",),
    "drawing of words": ("choreography.mixer.engine:MixerEngine.plan",),
    "generation": ("choreography.rollout.engine:generate_motion",),
    "rollout, rest": ("choreography.rollout.engine:RolloutEngine.plan",),
    "assembling": ("render.rendering:assemble",),
    "dynamics, held poses, feet": ("render.rendering:with_dynamics",),
}


def measured(make: Callable[[], object], stages: Mapping[str, tuple[str, ...]] = STAGES) -> dict[str, float]:
    """CPU seconds of each stage of what `make` does, and of the rest."""
    spent: Counter[str] = Counter()
    open_stages: list[float] = []  # CPU seconds of the stages inside each open one

    def timed(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def run(*args: Any, **kwargs: Any) -> Any:
            start = time.process_time()
            open_stages.append(0.0)
            try:
                return function(*args, **kwargs)
            finally:
                took = time.process_time() - start
                spent[name] += took - open_stages.pop()
                if open_stages:
                    open_stages[-1] += took

        return run

    with _replaced(timed, stages):
        timed(REST, make)()
    return dict(spent)


@contextmanager
def _replaced(
    timed: Callable[[str, Callable[..., Any]], Callable[..., Any]], stages: Mapping[str, tuple[str, ...]]
) -> Iterator[None]:
    with ExitStack() as stack:
        for name, places in stages.items():
            for place in places:
                module, _, path = place.partition(":")
                *owners, function = path.split(".")
                owner: Any = importlib.import_module(f"choreograph.{module}")
                for one in owners:
                    owner = getattr(owner, one)
                stack.enter_context(mock.patch.object(owner, function, timed(name, getattr(owner, function))))
        yield


@njit("float64(int64)")
def _iterated(n: int) -> float:  # pragma: no cover - compiled
    """A loop that the compiler cannot shorten: the logistic map."""
    x = 0.4
    for _ in range(n):
        x = 3.9 * x * (1.0 - x)
    return x


def unit_s() -> float:
    """CPU seconds of a fixed amount of work, half compiled and half in NumPy, on this machine now."""
    numbers = np.random.default_rng(0).random((300, 300))
    times = []
    for _ in range(3):
        start = time.process_time()
        _iterated(10_000_000)
        for _ in range(20):
            numbers = np.sort(np.sqrt(numbers), axis=1)[:, ::-1] * 1.01
        times.append(time.process_time() - start)
    return min(times)


def song_of(seconds: float, folder: Path) -> Path:
    """A synthetic house song of at least this length."""
    path = folder / f"house{seconds:g}.wav"
    write_song(path, render_song("house", n_bars=round(seconds / 1.9) + 1, seed=4101))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, nargs="+", default=[60.0])
    parser.add_argument("--engines", nargs="+", default=["graph"], choices=["graph", "mixer", "rollout"])
    parser.add_argument("--repertoire", type=Path)
    options = parser.parse_args()
    repertoire = (
        cg.starter_repertoire() if options.repertoire is None else cg.Repertoire.open(options.repertoire)
    )
    print(f"unit: {unit_s():.3f} s", flush=True)
    with TemporaryDirectory() as folder:
        for seconds in options.seconds:
            song = song_of(seconds, Path(folder))
            for engine in options.engines:
                make = partial(cg.dance, song, repertoire, engine=engine, duration_s=seconds)
                make()  # compiles, and keeps the analysis
                spent = measured(make)
                for name, cpu_s in (*spent.items(), ("sum", sum(spent.values()))):
                    print(f"{engine}, {seconds:g} s, {name}: {cpu_s:.3f}", flush=True)


if __name__ == "__main__":
    main()
