"""A library of 10,000 clips is opened, danced with and added to within budgets of CPU time and memory."""

from __future__ import annotations

import pytest
from benchmarks.archive import make_library, measured, measured_adding
from benchmarks.stages import unit_s

import choreograph as cg

pytestmark = pytest.mark.slow

# CPU time, divided by `unit_s`. Both were measured on a machine with other work.
USUAL = {"open": 3.0, "first": 300.0, "second": 130.0, "add": 160.0}
_SLACK = 2.0
_PEAK_GB = 1.0


def test_a_library_of_10_000_clips_keeps_to_its_budgets(tmp_path):
    path = tmp_path / "archive.h5"
    make_library(path, 10_000)
    cg.Repertoire.open(path)
    unit = unit_s()
    found = measured(path, 20.0)
    added = measured_adding(path)
    unit = max(unit, unit_s())
    assert added["clips"] > found["clips"] >= 10_000
    for name, usual in USUAL.items():
        took = {**found, **added}[name][1] / unit
        assert took < _SLACK * usual, f"{name}: {took:.1f} units, usually {usual:.1f}"
    assert max(found["peak_gb"], added["peak_gb"]) < _PEAK_GB
