"""CPU time of reading, kinematics and rendering beside the ways of before, as ratios in one run.

    OMP_NUM_THREADS=1 pytest tests/benchmarks/test_render_speed.py -s

Both ways run in turns, so that other work on the machine slows both. The numbers are compared bit by bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from choreograph.core.cache import Memory
from choreograph.library.repertoire import starter_repertoire
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.plan.joins import sample_kept_run, sample_run
from choreograph.plan.runs import Run


def ratio(now: Callable[[], object], before: Callable[[], object], rounds: int = 3) -> float:
    """CPU time of `now` over that of `before`: the median of rounds in turns, after one that warms up."""
    ratios = []
    for _ in range(rounds + 1):
        spent = []
        for run in (now, before):
            start = time.process_time()
            run()
            spent.append(time.process_time() - start)
        ratios.append(spent[0] / max(spent[1], 1e-9))
    return float(np.median(ratios[1:]))


def test_parts_of_takes_are_read_from_blocks():
    """20 parts of 1 s, as the mixer reads them, beside a read of the file for each array of each part."""
    repertoire = starter_repertoire()
    rng = np.random.default_rng(0)
    parts = []
    for take in rng.integers(0, len(repertoire.takes), 20):
        info = repertoire.takes[take]
        first = int(rng.integers(info.motion[0], info.motion[1] - 60))
        parts.append((first, first + 60))
    file, name = repertoire._file, "motion/local_quat"

    def from_blocks():
        return [file.read_rows(name, *part) for part in parts]

    def from_file():
        return [file.read(name, slice(*part)) for part in parts]

    for a, b in zip(from_blocks(), from_file(), strict=True):
        np.testing.assert_array_equal(a, b)
    found = ratio(from_blocks, from_file, rounds=1)
    print(f"\nreading parts of takes: {found:.4f} of the time of before")
    assert found < 0.1


@pytest.mark.parametrize(("n_frames", "most"), [(2, 0.2), (4096, 0.6)])
def test_forward_kinematics_is_compiled(n_frames, most):
    """Beside one joint after another with functions of quaternions, for a few frames and for a song."""
    skeleton, rng = canonical_skeleton(), np.random.default_rng(0)
    quat = rot.normalize(rng.normal(size=(n_frames, 24, 4)))
    root = rng.normal(size=(n_frames, 3))

    def joint_by_joint():
        turned, pos_m = np.array(quat), np.zeros((n_frames, 24, 3))
        pos_m[:, 0] = root
        for joint in range(1, 24):
            parent = skeleton.parents[joint]
            turned[:, joint] = rot.multiply(turned[:, parent], quat[:, joint])
            pos_m[:, joint] = pos_m[:, parent] + rot.rotate(turned[:, parent], skeleton.offsets_m[joint])
        return pos_m

    np.testing.assert_array_equal(forward(skeleton, root, quat)[0], joint_by_joint())
    n = max(1, 40 // n_frames)
    found = ratio(
        lambda: [forward(skeleton, root, quat) for _ in range(n)],
        lambda: [joint_by_joint() for _ in range(n)],
    )
    print(f"\nkinematics of {n_frames} frames: {found:.4f} of the time of before")
    assert found < most


def test_runs_of_six_renderings_are_sampled_once():
    """15 words, as in each of the mixer's renderings, beside sampling them each time."""
    repertoire = starter_repertoire()
    names = [take.name for take in repertoire.takes]
    runs = [
        Run(names[index], index / 2, index / 2 + 0.5, np.linspace(3.0, 3.0 + 0.5, 11)) for index in range(15)
    ]

    def read(take, start_s, stop_s):
        return repertoire.motion(names.index(take), start_s, stop_s)

    def once():
        memory = Memory(1 << 26)
        return [sample_kept_run(memory, run, read, 60.0, 30) for _ in range(6) for run in runs]

    def each_time():
        return [sample_run(run, read, 60.0, 30) for _ in range(6) for run in runs]

    for a, b in zip(once(), each_time(), strict=True):
        np.testing.assert_array_equal(a.quat, b.quat)
    found = ratio(once, each_time, rounds=1)
    print(f"\nsampling the runs of six renderings: {found:.4f} of the time of before")
    assert found < 0.4
