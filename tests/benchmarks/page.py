"""A page of times: stages, whole processes, and ratios of ways to do the same work, by turns in one run.

    OMP_NUM_THREADS=1 python tests/benchmarks/page.py -o research/results/speed.md

All times are CPU seconds of all threads, beside which whole processes have wall times. Where two ways are
compared, each is measured several times by turns, and the ratio is that of the medians, so that other work on
the machine slows both.
"""

from __future__ import annotations

import argparse
import platform
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
from processes import process_table, processes
from stages import REST, measured, song_of, unit_s

import choreograph as cg
from choreograph.choreography.graph import engine as graph_engine
from choreograph.choreography.graph import kernels, planners
from choreograph.choreography.graph.warping import subsequence_dtw

SONGS_S = (60.0, 180.0)
ENGINES = ("graph", "mixer", "rollout")
N_WARPS = 512


def cpu_s(run: Callable[[], object]) -> float:
    """CPU seconds of all threads."""
    start = time.process_time()
    run()
    return time.process_time() - start


def compared(ours: Callable[[], object], other: Callable[[], object], n: int = 5) -> tuple[float, float]:
    """Median CPU seconds of two ways, measured by turns after one run of each."""
    ours(), other()
    times = [(cpu_s(ours), cpu_s(other)) for _ in range(n)]
    first, second = (median(column) for column in zip(*times, strict=True))
    return first, second


def stage_table(songs: dict[float, Path], repertoire: cg.Repertoire) -> list[str]:
    """CPU seconds of every stage, for each engine and song, and in units of the known work."""
    columns = [(engine, seconds) for engine in ENGINES for seconds in songs]
    spent = []
    for engine, seconds in columns:
        make = partial(cg.dance, songs[seconds], repertoire, engine=engine, duration_s=seconds)
        make()
        spent.append(measured(make))
    names = list(dict.fromkeys(name for one in spent for name in one))
    lines = [
        "| stage | " + " | ".join(f"{engine}, {seconds:g} s" for engine, seconds in columns) + " |",
        "| --- |" + " --- |" * len(columns),
    ]
    for name in names:
        lines.append(
            f"| {name} | " + " | ".join(f"{one[name]:.2f}" if name in one else "" for one in spent) + " |"
        )
    lines.append("| sum | " + " | ".join(f"{sum(one.values()):.2f}" for one in spent) + " |")
    return lines


def warps() -> tuple[float, float]:
    """Our subsequence DTW of 512 clips, and librosa's in a loop over 16 of them, times 32."""
    import librosa

    rng = np.random.default_rng(0)
    query, targets = rng.random(80, np.float32), rng.random((N_WARPS, 160), np.float32)

    def in_a_loop() -> None:
        for target in targets[: N_WARPS // 32]:
            librosa.sequence.dtw(
                X=query[None], Y=target[None], metric="sqeuclidean", subseq=True,
                step_sizes_sigma=np.array([[1, 1], [1, 2], [2, 1]]), weights_mul=np.array([1.0, 1.0, 2.0]),
                weights_add=np.zeros(3),
            )  # fmt: skip

    ours, loop = compared(lambda: subsequence_dtw(query, targets), in_a_loop)
    return ours, 32 * loop


# What an exact plan does, besides the search itself.
PARTS_OF_PLAN = {
    "costs of edges": (
        "choreography.graph.planners:SearchStep._edges_to",
        *(f"choreography.graph.planners:_CompiledEdges.{name}" for name in ("of_pairs", "bound", "cheapest")),
    ),
    "costs of nodes": ("choreography.graph.planners:allowed_nodes",),
    "what was danced so far": ("choreography.graph.planners:with_history",),
    "greedy path beside it": ("choreography.graph.planners:_GreedyPath.extend",),
    "cheap nodes, and their edges": ("choreography.graph.local_search:CheapSoFar.add",),
    "local search": ("choreography.graph.local_search:CheapSoFar.improved",),
    "costs of the path": ("choreography.graph.planners:_path_along",),
}


def planned(song: Path, seconds: float, repertoire: cg.Repertoire) -> tuple[Callable[[], object], list]:
    """An exact plan whose layers are known, and these layers."""
    calls: list[tuple] = []
    plan_path = graph_engine._plan_path

    def kept(*args):
        calls.append(args)
        return plan_path(*args)

    graph_engine._plan_path = kept
    cg.dance(song, repertoire, duration_s=seconds)
    graph_engine._plan_path = plan_path
    source = calls[0][0]
    layers = [source.layer(second) for second in range(source.n_seconds)]
    source.layer = layers.__getitem__  # layers are no part of the search
    return lambda: plan_path(*calls[0]).costs, layers


class _KnownEdges(planners._Edges):
    """Edges that are read from an array (P, N). Which nodes continue others is known, too."""

    def __init__(self, edges, successors) -> None:
        self._edges, self.successors = edges, successors

    def of_pairs(self, here, there):
        return self._edges[here, there]

    def bound(self, costs):
        return np.full(self._edges.shape[1], -np.inf)

    def cheapest(self, block, part, beyond, most):
        edges = self._edges[block] if len(part) == self._edges.shape[1] else self._edges[block][:, part]
        rows, least = np.zeros(len(part), np.int32), np.full(len(part), np.inf, np.float32)
        kernels.cheapest_predecessors(beyond, edges, least, rows)
        return rows, edges[rows, np.arange(len(part))]


def searches(layers: list) -> tuple[Callable[[], float], Callable[[], float]]:
    """The steps of the exact search, and a bare Viterbi search, over the same float32 edges in arrays.

    There is an edge between each two nodes of consecutive layers. Both return the cost of the cheapest path,
    but the bare search keeps no path.
    """
    most = max(layer.n_nodes for layer in layers)
    random = np.random.default_rng(0).random((most, most), np.float32)
    edges = [np.ascontiguousarray(random[: a.n_nodes, : b.n_nodes]) for a, b in pairwise(layers)]

    known = [
        _KnownEdges(of_pair, a.successors_in(b))
        for of_pair, (a, b) in zip(edges, pairwise(layers), strict=True)
    ]

    def own() -> float:
        with ThreadPoolExecutor(1) as pool:
            step = planners.SearchStep((), None, pool)
            step._edges_to = lambda layer, following: known[layer.second]
            reached, parents = np.zeros(layers[0].n_nodes), []
            for layer, following in pairwise(layers):
                reached, parent = step(layer, following, reached)
                parents.append(parent)
        return float(reached.min())

    def bare() -> float:
        reached = np.zeros(layers[0].n_nodes, np.float32)
        for of_second in edges:
            n_nodes = of_second.shape[1]
            least, rows = np.full(n_nodes, np.inf, np.float32), np.zeros(n_nodes, np.int32)
            kernels.cheapest_predecessors(reached, of_second, least, rows)
            reached = least
        return float(reached.min())

    assert abs(own() - bare()) < 1e-3
    return own, bare


def plan_table(plan: Callable[[], object], layers: list) -> list[str]:
    """What the parts of an exact plan take, beside a bare search, as lines of a table in Markdown."""
    own, bare = searches(layers)
    plan_s, bare_s = compared(plan, bare, 5)
    own_s, own_bare_s = compared(own, bare, 9)
    spent = measured(plan, PARTS_OF_PLAN)
    spent["search itself: best predecessors, pruning and the way back"] = spent.pop(REST)
    whole_s = sum(spent.values())
    n_edges = sum(a.n_nodes * b.n_nodes for a, b in pairwise(layers))
    lines = [
        f"An exact plan of {len(layers)} s has {sum(layer.n_nodes for layer in layers):,} nodes and "
        f"{n_edges:,} edges between nodes of consecutive seconds. The bare search reads the cost of each "
        "edge from an array of float32. The planner computes these costs, of which some depend on what was "
        "danced so far, and improves the path afterwards.",
        "",
        "| part of the plan | s | share | times the bare search |",
        "| --- | --- | --- | --- |",
    ]
    edges_s, improved_s = spent["costs of edges"] + bare_s, spent["local search"]
    for name, cpu_s in sorted(spent.items(), key=lambda item: -item[1]):
        lines.append(f"| {name} | {cpu_s:.3f} | {cpu_s / whole_s:.0%} | {cpu_s / bare_s:.1f} |")
    return [
        *lines,
        f"| whole plan | {plan_s:.3f} | | {plan_s / bare_s:.1f} |",
        f"| the steps of the search alone, which read the same edges from arrays | {own_s:.4f} | | "
        f"{own_s / own_bare_s:.1f} |",
        f"| bare float32 Viterbi search | {bare_s:.4f} | | 1 |",
        "",
        f"A search reads an edge in {1e9 * bare_s / n_edges:.2f} ns, but the costs of the edges have to be "
        f"known first. Beside a bare search that computes them as the planner does ({edges_s:.3f} s), the "
        f"whole plan takes {whole_s / edges_s:.1f} times as long, and {(whole_s - improved_s) / edges_s:.1f} "
        "times without the local search, which a bare search does not have.",
    ]


def changes(song: Path, seconds: float, repertoire: cg.Repertoire) -> dict[str, tuple[float, float]]:
    """Changes in a session, and the same dances made anew."""
    session = cg.Session(song, repertoire, duration_s=seconds)
    take = session.dance().plan.seconds[5].take
    arguments = {
        "weight": {"weights": {"genre": 1.2}},
        "pin": {"pins": [cg.TakePin(seconds - 20.0, seconds - 16.0, take)]},
        "ban": {"bans": [cg.Ban(take=take)]},
        "seed": {"seed": 1},
        "mixer": {"engine": "mixer"},
        "rollout": {"engine": "rollout"},
    }
    times = {}
    for name, change in arguments.items():
        session.dance()
        in_session = cpu_s(partial(session.dance, **change))
        times[name] = in_session, cpu_s(partial(cg.dance, song, repertoire, duration_s=seconds, **change))
    return times


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    repertoire = cg.starter_repertoire()
    with TemporaryDirectory() as folder:
        songs = {seconds: song_of(seconds, Path(folder)) for seconds in SONGS_S}
        first = songs[SONGS_S[0]]
        stages = stage_table(songs, repertoire)
        ours_s, loop_s = warps()
        of_plan = plan_table(*planned(first, SONGS_S[0], repertoire))
        changed = changes(first, SONGS_S[0], repertoire)
        of_processes = processes(Path(folder))
    asked = ["git", "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    lines = [
        "# Speed",
        "",
        "CPU seconds of all threads, in one process, with kernels compiled and the song known. Written by "
        f"`make benchmark` at the commit `{commit}`. The songs are synthetic house songs, and the takes are "
        "the built-in ones.",
        "",
        f"Python {platform.python_version()}, NumPy {np.__version__}. A fixed amount of work, of which one "
        f"half is compiled and the other NumPy, took {unit_s():.3f} s.",
        "",
        "## Stages of a dance",
        "",
        *stages,
        "",
        "## Whole processes",
        "",
        "`choreograph dance` from the command to the file, with imports and the opening of the repertoire: "
        "medians of three runs, except for the one that compiles. CPU time is that of all processes.",
        "",
        *process_table(of_processes),
        "",
        "## Exact plan and bare search",
        "",
        *of_plan,
        "",
        "## Ratios",
        "",
        "Each pair was measured by turns in the same run.",
        "",
        "| what | s | beside it | s | ratio |",
        "| --- | --- | --- | --- | --- |",
    ]
    pairs = {
        f"{N_WARPS} warps": (ours_s, "librosa's DTW in a loop", loop_s),
        **{f"{name} in a session": (own_s, "made anew", anew_s) for name, (own_s, anew_s) in changed.items()},
    }
    for what, (own_s, other, other_s) in pairs.items():
        lines.append(f"| {what} | {own_s:.3f} | {other} | {other_s:.3f} | {own_s / other_s:.3f} |")
    options.output.write_text("\n".join([*lines, "", *_others(options.output)]), encoding="utf-8")


_OTHERS = "## Measured by other commands"


def _others(page: Path) -> list[str]:
    """The last section of a page, which is not measured here, and remains as it is."""
    text = page.read_text("utf-8") if page.exists() else ""
    return [_OTHERS + text.partition(_OTHERS)[2]] if _OTHERS in text else []


if __name__ == "__main__":
    main()
