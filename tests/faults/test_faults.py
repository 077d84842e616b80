"""A handful of the faults of `make faults`, and a few of the many dances."""

import sys

import numpy as np
import pytest
from faults.many_dances import usage_of_dances
from faults.tasks import TASKS, write_inputs
from faults.trials import Trials

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc"),
]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs") / "inputs"
    write_inputs(folder)
    return folder


@pytest.mark.parametrize("name", ["build", "dance", "evaluate"])
def test_killed_work_leaves_the_old_or_the_new_and_can_go_on(inputs, tmp_path, name):
    trials, rng = Trials(name, TASKS[name], inputs, tmp_path), np.random.default_rng(1)
    for at_a_file in (True, True, False):
        trials.kill(rng, at_a_file=at_a_file)
    trials.fill_disk(rng, mount=False)
    assert not trials.failures
    assert trials.n_killed + trials.n_ended_before == 3 and trials.n_killed >= 2


def test_dances_leave_nothing_open_and_no_memory_in_use(repertoire, tmp_path):
    usages = list(usage_of_dances(16, tmp_path, repertoire, duration_s=5.0))
    assert usages[-1].open_files == usages[1].open_files
    assert usages[-1].memory_mb < usages[7].memory_mb + 5  # caches fill in the first ones
