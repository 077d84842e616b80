"""No stage of a dance may take twice its usual CPU time, relative to a loop in the same process."""

from __future__ import annotations

from functools import partial

import pytest
from benchmarks.stages import REST, measured, unit_s

import choreograph as cg

pytestmark = pytest.mark.slow

# CPU time of a dance of 20 s to the built-in house song, with kernels compiled and the song known, divided by
# `unit_s`. Both were measured on a machine with other work.
USUAL = {
    "graph": {
        "decoding": 0.1, "analysis": 0.1, "material": 0.3, "candidates": 0.1, "warping": 3.3,
        "motifs of nodes": 0.2, "layers": 0.9, "exact search": 1.6, "local search": 1.5,
        "costs of the path": 0.6, "timing of transitions": 0.2, "assembling": 0.5,
        "dynamics, held poses, feet": 1.3, REST: 1.3,
    },
    "mixer": {
        "decoding": 0.1, "analysis": 0.1, "material": 0.3, "drawing of words": 5.9, "assembling": 0.9,
        "dynamics, held poses, feet": 1.3, REST: 0.2,
    },
    "rollout": {
        "decoding": 0.1, "analysis": 0.1, "material": 0.3, "generation": 4.6, "rollout, rest": 2.8,
        "assembling": 0.4, "dynamics, held poses, feet": 1.3, REST: 0.2,
    },
}  # fmt: skip
_SLACK = 2.0
_LEAST = 1.0  # of a unit, which is about 20 ms: below, times are too short to compare


@pytest.mark.parametrize("engine", USUAL)
def test_no_stage_takes_twice_its_usual_time(engine):
    song, repertoire = cg.example_songs()["house"], cg.starter_repertoire()
    make = partial(cg.dance, song, repertoire, engine=engine, duration_s=20.0)
    make()
    unit = unit_s()
    runs = [measured(make) for _ in range(3)]
    unit = max(unit, unit_s())
    for name in runs[0]:
        took = min(run.get(name, 0.0) for run in runs) / unit
        usual = USUAL[engine].get(name, 0.0)
        assert took < _SLACK * usual + _LEAST, f"{name}: {took:.2f} units, usually {usual:.2f}"
    assert REST in runs[0]
