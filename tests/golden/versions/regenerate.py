"""Files of every version that this program ever wrote, each written by the program of its time.

The program of a commit is taken from the history (so a full clone is needed) and writes the same synthetic
takes, plan or ratings as all others. Run it after a version changed, and commit what it adds:

    PYTHONPATH=tests python tests/golden/versions/regenerate.py

Files that are there are never written again: what opened once must open for ever.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, replace
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

import choreograph as cg
from choreograph.core.timebase import NET_FPS
from choreograph.library.writing import MeasuredTake, write_repertoire
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.plan import Plan, PlannedWord

FOLDER = Path(__file__).parent
CHECKOUT = FOLDER.parents[2]
PERIODS_S = (0.5, 0.75)
FPS = 20.0  # of the takes: for small files
NOW = "HEAD"  # the program of the working tree
# File: the commit that first wrote such a file, and what it called 16-bit motion ("" for none). The third
# file has integers, the fourth their differences, the fifth second differences, the sixth these folded.
REPERTOIRES: Mapping[str, tuple[str, str]] = {
    "repertoire-1.h5": ("8ac1068", ""),
    "repertoire-1-integers.h5": ("4c60f20", "packed"),
    "repertoire-1-differences.h5": ("565c1eb", "packed"),
    "repertoire-1-second-differences.h5": ("8a6fe48", "packed"),
    "repertoire-1-folded.h5": ("b0f1343", "packed"),
    "repertoire-2.h5": ("d979840", "compress"),
    "repertoire-2-doubt.h5": (NOW, "compress"),
}
PLANS: Mapping[str, str] = {
    "plan-1.json": "8ac1068", "plan-2.json": "a70e6f7", "plan-3.json": "3d20ec4", "plan-4.json": "fd722da",
    "plan-5.json": "d979840", "plan-6.json": "c9a6053", "plan-7.json": NOW,
}  # fmt: skip
STUDIES: Mapping[str, str] = {"study-1": "c6d086c", "study-2": NOW}

_WRITE_REPERTOIRE = """
import sys
import numpy as np
from choreograph.library.schema import Contents
from choreograph.library.writing import write_repertoire
from choreograph.library import schema
source, target, option = sys.argv[1:]
known = {**schema.DATASETS, **getattr(schema, "COUNTS", {})}
with np.load(source) as data:
    arrays = {name: data[name] for name in data.files if name in known}
options = {option: True} if option else {}
write_repertoire(target, Contents(arrays, "analytic", {"preset": "golden"}), **options)
"""

_WRITE_PLAN = """
import json, sys
from dataclasses import fields
from pathlib import Path
from choreograph import plan as plans
from choreograph.motion.motion import Credits
source, target = sys.argv[1:]
EARLIER = {"begins_s": "start_s", "fade_s": "transition_s"}
def made(kind, data):
    data = {f.name: data[f.name if f.name in data else EARLIER[f.name]] for f in fields(kind)}
    if "credits" in data:
        data["credits"] = Credits(**data["credits"])
    return kind(**{key: tuple(value) if isinstance(value, list) else value for key, value in data.items()})
data = json.loads(Path(source).read_text())
data["seconds"] = tuple(made(plans.PlannedSecond, second) for second in data["seconds"])
if hasattr(plans, "PlannedWord"):
    data["words"] = tuple(made(plans.PlannedWord, word) for word in data["words"])
Path(target).write_text(made(plans.Plan, data).to_json())
"""

_WRITE_STUDY = """
import sys
from pathlib import Path
from synthetic_studies import VARIANTS, rate_all, small_study
study = small_study(Path(sys.argv[1]), n_songs=2)
rate_all(study, dict(zip(VARIANTS, (4.0, 3.0, 1.0))), n_raters=2)
"""


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


def golden_plan(folder: Path) -> Plan:
    """A dance of 5 s of the golden takes, in which a word replaces half a second."""
    song = write_clicks(folder / "clicks.wav", duration_s=5.0)
    plan = cg.dance(song, FOLDER / "repertoire-2.h5", lock_feet=False).plan
    word = PlannedWord(2.0, 2.5, 3, "take0", 1.0, 1.5, plan.seconds[0].credits, pinned=True)
    return replace(plan, words=(word,), repertoire="rep.h5")


def write_by(commit: str, program: str, *arguments: str | Path) -> None:
    """Run a program with the package and the tests of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        place = CHECKOUT
        if commit != NOW:
            place = Path(folder)
            archive = place / "commit.tar"
            subprocess.run(["git", "archive", "-o", archive, commit], cwd=CHECKOUT, check=True)
            subprocess.run(["tar", "-xf", archive], cwd=place, check=True)
        environment = {**os.environ, "PYTHONPATH": f"{place}:{place / 'tests'}"}
        arguments = tuple(str(argument) for argument in arguments)
        subprocess.run([sys.executable, "-c", program, *arguments], env=environment, cwd=place, check=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        contents = synthetic_contents(golden_takes())
        arrays = Path(folder) / "arrays.npz"
        np.savez(arrays, **contents.arrays)
        for name, (commit, option) in REPERTOIRES.items():
            if not (FOLDER / name).exists() and commit != NOW:
                write_by(commit, _WRITE_REPERTOIRE, arrays, FOLDER / name, option)
        doubtful = FOLDER / "repertoire-2-doubt.h5"
        if not doubtful.exists():
            doubt = np.linspace(0.1, 0.6, len(contents.arrays["counts/time_s"])).astype(np.float32)
            with_motifs = with_vocabulary(contents, golden_takes())
            write_repertoire(
                doubtful, replace(with_motifs, arrays={**with_motifs.arrays, "counts/doubt": doubt}),
                compress=True,
            )  # fmt: skip
        source = Path(folder) / "plan.json"
        source.write_text(json.dumps(asdict(golden_plan(Path(folder)))), encoding="utf-8")
        for name, commit in PLANS.items():
            if not (FOLDER / name).exists():
                write_by(commit, _WRITE_PLAN, source, FOLDER / name)
        for name, commit in STUDIES.items():
            if not (FOLDER / name).exists():
                write_by(commit, _WRITE_STUDY, folder)
                made = next(Path(folder).glob("study-*"))
                (made / "study.html").unlink()
                made.rename(FOLDER / name)


if __name__ == "__main__":
    main()
