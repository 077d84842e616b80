"""The pages on contributing hold: their example code is added to a copy of the package as they say."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import choreograph as cg

ROOT = Path(cg.__file__).parent
PAGES = ROOT.parent / "docs" / "contributing"


def first_block(page: str) -> str:
    (block, *_) = re.findall(r"^```python\n(.*?)^```$", (PAGES / page).read_text("utf-8"), flags=re.S | re.M)
    return str(block)


def linked_package(folder: Path, *changed: str) -> Path:
    """A package in a folder whose files are links to those of the program, except for `changed` files."""
    of_changed = [ROOT / name for name in changed]
    made = {ROOT, *(parent for file in of_changed for parent in file.parents if ROOT in parent.parents)}
    for real in made:
        (folder / "choreograph" / real.relative_to(ROOT)).mkdir(parents=True, exist_ok=True)
    for real in made:
        for file in real.iterdir():
            copy = folder / "choreograph" / file.relative_to(ROOT)
            if file in of_changed:
                shutil.copy(file, copy)
            elif file not in made and file.name != "__pycache__":
                copy.symlink_to(file)
    return folder / "choreograph"


def printed(folder: Path, code: str) -> str:
    """What Python prints, with the package in the folder."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_cost_is_one_class_and_one_name_in_the_register(tmp_path):
    name = "choreography/graph/costs.py"
    package = linked_package(tmp_path, name)
    text = (package / name).read_text("utf-8")
    _, _, written = first_block("cost.md").partition("\n\n\n")  # the module has the import
    text = text.replace("# The register.", f"{written}\n\n# The register.", 1)
    text = re.sub(r"(BUILTIN_COSTS: .*?)\n\)", r"\1 HighHands,\n)", text, count=1, flags=re.S)
    (package / name).write_text(text, "utf-8")
    code = (
        "import choreograph as cg\n"
        "from choreograph.cli.main import main\n"
        "from choreograph.studio.dance_json import of_dance, reasons, weight_choices\n"
        "print([choice for choice in weight_choices() if choice['name'] == 'highhands'])\n"
        "song = cg.example_songs()['house']\n"
        "made = cg.dance(song, duration_s=3, candidates=8, planner='greedy', weights={'highhands': 2.0})\n"
        "print(made.plan.weights['highhands'], reasons({'highhands': 1.0}, of_dance()))\n"
        "assert all(second.costs['highhands'] < 0 for second in made.plan.seconds)\n"
        "main(['settings', 'weights'], standalone_mode=False)\n"
    )
    shown = printed(tmp_path, code)
    assert shown.count("All joints are near to the floor.") == 2
    assert "highhands = 0.0" in shown and "Raise its weight for higher hands." in " ".join(shown.split())


def test_a_metric_is_one_module_and_one_line(tmp_path):
    stub = "evaluation/metrics/__init__.pyi"
    package = linked_package(tmp_path, stub, stub.removesuffix("i"))
    with (package / stub).open("a", encoding="utf-8") as file:
        file.write("from . import travel as travel\n")
    (package / stub).with_name("travel.py").write_text(first_block("metric.md"), "utf-8")
    code = (
        "import doctest, runpy\n"
        "import numpy as np\n"
        "import choreograph as cg\n"
        "names, travel = {'cg': cg, 'np': np}, cg.metrics.travel\n"
        "print(doctest.testmod(travel, extraglobs=names), travel.evaluate(np.eye(3), 30.0))\n"
        f"print(runpy.run_path({str(PAGES.parent / 'conf.py')!r})['page_of_metrics']())\n"
    )
    shown = printed(tmp_path, code)
    assert shown.startswith("TestResults(failed=0, attempted=2) {'travel_speed_m_s': ")
    assert "metrics.travel\n^^^^^^^^^^^^^^\n" in shown
