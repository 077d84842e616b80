"""CPU time of changes in a session beside the same dances made anew, as ratios in one run.

    OMP_NUM_THREADS=1 pytest --benchmark-only tests/benchmarks/test_session_speed.py -s

Both ways are measured one after the other, so that other work on the machine slows both. The song has 60 s.
`CHOREOGRAPH_SESSION_SONG` and `CHOREOGRAPH_SESSION_DB` name another song and another repertoire.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import choreograph as cg
from content.songs.synthesis.song import render_song, write_song

pytestmark = pytest.mark.slow

DURATION_S = 60.0


def timed(make: Callable[[], cg.Dance]) -> tuple[float, cg.Dance]:
    """CPU seconds of all threads, and the dance."""
    start = time.process_time()
    dance = make()
    return time.process_time() - start, dance


def test_changes_of_a_dance_of_a_minute(benchmark, tmp_path):
    benchmark.pedantic(measure_changes, args=(tmp_path,), rounds=1)


def measure_changes(folder: Path) -> None:
    """Print the CPU seconds of each change, in a session and anew, which must give the same dance."""
    path = os.environ.get("CHOREOGRAPH_SESSION_SONG")
    if path is None:
        path = str(folder / "house.wav")
        write_song(path, render_song("house", n_bars=32, seed=4101))
    db = os.environ.get("CHOREOGRAPH_SESSION_DB")
    repertoire = cg.starter_repertoire() if db is None else cg.Repertoire.open(db)
    session = cg.Session(path, repertoire, duration_s=DURATION_S)
    first = session.dance()
    take = first.plan.seconds[5].take
    changes = {
        "weight": {"weights": {"genre": 1.2}},
        "another weight": {"weights": {"front": 1.0}},
        "pin": {"pins": [cg.TakePin(40.0, 44.0, take)]},
        "ban": {"bans": [cg.Ban(take=take)]},
        "seed": {"seed": 1},
        "keep": {"existing": first, "keep": [cg.Keep(0.0, DURATION_S / 2)]},
        "genre": {"genre": "disco"},
        "mixer": {"engine": "mixer"},
        "rollout": {"engine": "rollout"},
        "nothing": {},
    }
    ratios = {}
    for name, arguments in changes.items():
        in_session_s, dance = timed(lambda arguments=arguments: session.dance(**arguments))
        fresh_s, fresh = timed(
            lambda arguments=arguments: cg.dance(path, repertoire, duration_s=DURATION_S, **arguments)
        )
        assert dance.plan == fresh.plan
        assert np.array_equal(dance.motion.local_quat, fresh.motion.local_quat)
        ratios[name] = in_session_s / fresh_s
        print(f"{name}: {in_session_s:.2f} s, anew {fresh_s:.2f} s, ratio {ratios[name]:.2f}")
    assert ratios["weight"] < 0.95
    assert ratios["nothing"] < 0.1
