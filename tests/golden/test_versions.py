"""A file of every version of repertoires, plans and studies is still read.

`versions/regenerate.py` wrote them.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import VERSION as REPERTOIRE_VERSION
from choreograph.plan.plan import VERSION as PLAN_VERSION
from choreograph.plan.plan import Plan
from choreograph.studio.ratings import VERSION as STUDY_VERSION
from research.study.results import read_study

FOLDER = Path(__file__).parent / "versions"
REPERTOIRES = sorted(FOLDER.glob("repertoire-*.h5"))
PLANS = sorted(FOLDER.glob("plan-*.json"))
STUDIES = sorted(FOLDER.glob("study-*"))
PERIODS_S, FPS = (0.5, 0.75), 20.0  # of the takes


def version_of(path: Path) -> int:
    return int(path.stem.split("-")[1])


def names(paths):
    return [path.stem for path in paths]


@pytest.fixture(scope="module")
def song(tmp_path_factory):
    return write_clicks(tmp_path_factory.mktemp("songs") / "clicks.wav", duration_s=5.0)


def test_every_version_has_its_file():
    """A new version needs one: run `versions/regenerate.py`."""
    assert {version_of(path) for path in REPERTOIRES} == set(range(1, REPERTOIRE_VERSION + 1))
    assert {version_of(path) for path in PLANS} == set(range(1, PLAN_VERSION + 1))
    assert {version_of(path) for path in STUDIES} == set(range(1, STUDY_VERSION + 1))


@pytest.mark.parametrize("path", REPERTOIRES, ids=names(REPERTOIRES))
def test_repertoires_hold_the_motion_that_was_written(path):
    repertoire = Repertoire.open(path)
    assert [take.name for take in repertoire.takes] == ["take0", "take1"]
    for index, period_s in enumerate(PERIODS_S):
        written = stepping(round(10 * FPS), fps=FPS, period_s=period_s, seed=index)
        motion, _ = repertoire.motion(index)
        assert motion.fps == FPS and motion.n_frames == written.n_frames
        np.testing.assert_allclose(motion.root_pos_m, written.root_pos_m, atol=2e-4)
        np.testing.assert_allclose(motion.local_quat, written.local_quat, atol=3e-4)
        counts = repertoire.counts(index)
        assert len(counts) > 0 and counts.uncertainty.any()


@pytest.mark.parametrize("path", REPERTOIRES, ids=names(REPERTOIRES))
def test_repertoires_dance_and_are_inspected(path, song):
    before = path.read_bytes()
    dance = cg.dance(song, path)
    assert dance.motion.n_frames == pytest.approx(5 * 60, abs=1)
    assert {second.take for second in dance.plan.seconds} <= {"take0", "take1"}
    result = run("inspect", path)
    assert result.exit_code == 0 and "take1" in result.output
    assert path.read_bytes() == before


@pytest.mark.parametrize("path", PLANS, ids=names(PLANS))
def test_plans_are_danced_again(path):
    data, plan = json.loads(path.read_text(encoding="utf-8")), Plan.read(path)
    assert data["version"] == version_of(path)
    assert [second.take for second in plan.seconds] == [second["take"] for second in data["seconds"]]
    assert len(plan.words) == 1
    assert Plan.from_json(plan.to_json()) == plan
    motion = cg.render(plan, Repertoire.open(REPERTOIRES[0]))
    assert motion.n_frames == pytest.approx(5 * 60, abs=1)


@pytest.mark.parametrize("path", STUDIES, ids=names(STUDIES))
def test_studies_are_read(path):
    results = read_study(path)
    assert results.n_raters == 2
