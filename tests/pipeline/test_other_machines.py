"""The same dance on other machines: any number of threads, and the kernels of other CPUs."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from choreograph.formats.register import import_takes
from choreograph.plan.plan import Plan

pytestmark = pytest.mark.slow

_ENGINES = ("graph", "mixer", "rollout")
_DANCE = """
import sys
import choreograph as cg
song = cg.load_song(cg.example_songs()["house"], duration_s=8.0)
for engine in sys.argv[2:]:
    made = cg.dance(song, engine=engine, cache=False)
    for kind in ("json", "npz", "bvh"):
        made.save(f"{sys.argv[1]}/{engine}.{kind}")
"""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# The oldest kernels that OpenBLAS, torch and numpy have, instead of those that suit this CPU.
_OLD_CPU = {
    "OPENBLAS_CORETYPE": "Prescott", "ATEN_CPU_CAPABILITY": "default", "MKL_CBWR": "COMPATIBLE",
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX2 FMA3",
}  # fmt: skip
_BOUND_M = 1e-3  # as the README says


@pytest.fixture(scope="module")
def dances(tmp_path_factory):
    """Folders of the same dances made with one thread, with four, and with the kernels of an old CPU."""
    environments = {
        "one": dict.fromkeys(_THREADS, "1"),
        "four": dict.fromkeys(_THREADS, "4"),
        "old": {**dict.fromkeys(_THREADS, "1"), **_OLD_CPU},
    }
    folders = {}
    for name, environment in environments.items():
        folders[name] = tmp_path_factory.mktemp(name)
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", _DANCE, str(folders[name]), *_ENGINES],
            env={**os.environ, **environment}, check=True, timeout=600, capture_output=True,
        )  # fmt: skip
    return folders


@pytest.mark.parametrize("engine", _ENGINES)
def test_any_number_of_threads_gives_the_same_bytes(dances, engine):
    for kind in ("json", "npz", "bvh"):
        one, four = ((dances[name] / f"{engine}.{kind}").read_bytes() for name in ("one", "four"))
        assert one == four, kind


@pytest.mark.parametrize("engine", _ENGINES)
def test_other_cpus_choose_the_same_and_move_within_the_bound(dances, engine):
    plans = [json.loads((dances[name] / f"{engine}.json").read_text()) for name in ("one", "old")]
    chosen = [
        [tuple(part[key] for key in keys) for part in plan[parts]]
        for parts, keys in (("seconds", ("take", "clip", "offset")), ("words", ("take", "motif")))
        for plan in plans
    ]
    assert chosen[0] == chosen[1] and chosen[2] == chosen[3]
    assert any(chosen)
    pos_m = [_joint_pos_m(dances[name], engine) for name in ("one", "old")]
    assert np.abs(pos_m[0] - pos_m[1]).max() < _BOUND_M


def _joint_pos_m(folder, engine) -> np.ndarray:
    (take,) = import_takes(folder / f"{engine}.npz")
    return take.motion.joint_pos_m()


def test_costs_in_a_plan_have_no_more_digits_than_cpus_agree_on(dances):
    plan = Plan.read(dances["one"] / "graph.json")
    costs = np.array([list(second.costs.values()) for second in plan.seconds])
    assert np.array_equal(costs, costs.round(4))
