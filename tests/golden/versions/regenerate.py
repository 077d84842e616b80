"""A file of every version of plans, repertoires and studies, each written by the program of its time.

Run it after a version changed, and commit what it adds:

    PYTHONPATH=tests python tests/golden/versions/regenerate.py

Files that are there are never written again.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from synthetic_motions import stepping
from synthetic_repertoire import (
    synthetic_contents,
    synthetic_takes,
    with_counts,
    with_vocabulary,
    write_clicks,
)
from synthetic_studies import VARIANTS, rate_all, small_study

import choreograph as cg
from choreograph.core.timebase import NET_FPS
from choreograph.library.schema import VERSION as REPERTOIRE_VERSION
from choreograph.library.writing import MeasuredTake, write_repertoire
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.plan.plan import VERSION as PLAN_VERSION
from choreograph.plan.plan import PlannedWord
from choreograph.studio.ratings import VERSION as STUDY_VERSION

FOLDER = Path(__file__).parent
PERIODS_S = (0.5, 0.75)
FPS = 20.0  # of the takes: for small files


def golden_takes() -> list[MeasuredTake]:
    """Two takes of 10 s with counts and figures."""
    takes = []
    for index, (measured, period_s) in enumerate(
        zip(synthetic_takes(periods_s=PERIODS_S, duration_s=1.0), PERIODS_S, strict=True)
    ):
        motion = stepping(round(10 * FPS), fps=FPS, period_s=period_s, seed=index)
        pos_m = body_pos_m(motion)
        beats_s = motion_beat_times_s(pos_m, FPS)
        take = replace(measured.take, motion=motion)
        takes.append(MeasuredTake(take, body_pos_m(motion.resampled(NET_FPS)).astype(np.float32), beats_s))
    return with_counts(takes, PERIODS_S)


def write_golden_repertoire(path: Path) -> None:
    """Write the golden takes with all optional arrays, in 16 bits."""
    contents = with_vocabulary(synthetic_contents(golden_takes()), golden_takes())
    uncertainty = np.linspace(0.1, 0.6, len(contents.arrays["counts/time_s"])).astype(np.float32)
    contents = replace(contents, arrays={**contents.arrays, "counts/doubt": uncertainty})
    write_repertoire(path, contents, compress=True)


def write_golden_plan(path: Path, repertoire: Path) -> None:
    """Write the plan of a dance of 5 s of the golden takes, in which a word replaces half a second."""
    with tempfile.TemporaryDirectory() as folder:
        song = write_clicks(Path(folder) / "clicks.wav", duration_s=5.0)
        plan = cg.dance(song, repertoire, lock_feet=False).plan
    word = PlannedWord(2.0, 2.5, 3, "take0", 1.0, 1.5, plan.seconds[0].credits, pinned=True)
    path.write_text(replace(plan, words=(word,), repertoire="rep.h5").to_json(), encoding="utf-8")


def write_golden_study(target: Path) -> None:
    """Write the key of a study and the answers of two raters."""
    with tempfile.TemporaryDirectory() as folder:
        study = small_study(Path(folder), n_songs=2)
        rate_all(study, dict(zip(VARIANTS, (4.0, 3.0, 1.0), strict=True)), n_raters=2)
        target.mkdir()
        for path in study.glob("*.json"):
            (target / path.name).write_bytes(path.read_bytes())


def main() -> None:
    repertoire = FOLDER / f"repertoire-{REPERTOIRE_VERSION}.h5"
    plan = FOLDER / f"plan-{PLAN_VERSION}.json"
    study = FOLDER / f"study-{STUDY_VERSION}"
    if not repertoire.exists():
        write_golden_repertoire(repertoire)
    if not plan.exists():
        write_golden_plan(plan, repertoire)
    if not study.exists():
        write_golden_study(study)


if __name__ == "__main__":
    main()
