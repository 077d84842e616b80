"""Every example runs, and every command of the README is one the program knows."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from synthetic_repertoire import synthetic_repertoire, write_clicks

from choreograph.cli import main

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def run_example(name: str, *arguments: object) -> str:
    command = [sys.executable, str(ROOT / "examples" / name), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def synthetic(tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples")
    synthetic_repertoire(folder / "rep.h5")
    return write_clicks(folder / "song.wav", duration_s=6.0), folder / "rep.h5"


def test_low_poses(synthetic, tmp_path):
    shown = run_example("10_low_poses.py", *synthetic, tmp_path / "low.bvh")
    usual, low = (float(height) for height in re.findall(r"([\d.]+) m", shown))
    assert low <= usual
    assert (tmp_path / "low.bvh").exists()


def test_forbid_a_take(synthetic, tmp_path):
    shown = run_example("11_forbid_a_take.py", *synthetic, "take0", tmp_path / "out.bvh")
    assert "take0" not in shown
    assert "rhythm" in shown


def test_controls(synthetic, tmp_path):
    synthetic_repertoire(tmp_path / "spoken.h5", vocabulary=True)
    shown = run_example("46_controls.py", synthetic[0], tmp_path / "spoken.h5", tmp_path / "out.bvh")
    assert "pinned" in shown and "again: motifs" in shown
    assert (tmp_path / "out.bvh").exists()


MEASURING = [p for p in EXAMPLES if p.name > "4" and p.name != "46_controls.py"]


@pytest.mark.parametrize("path", MEASURING, ids=lambda p: p.name)
def test_measuring_examples_say_how_they_are_run(path):
    assert "usage" in run_example(path.name, "--help")


@pytest.mark.slow
def test_the_table_of_dances(shared_data, synthetic, tmp_path):
    songs = tmp_path / "songs.txt"
    songs.write_text("DANCE_C_8\n")
    shown = run_example(
        "42_evaluate_dances.py", shared_data / "dance-with-melody", synthetic[1], "--songs", songs
    )
    assert "f_score" in shown


@pytest.mark.slow
def test_the_papers_tables_of_a_repertoire_of_other_takes(shared_data, synthetic, tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    (data / "DANCE_C_8").symlink_to(shared_data / "dance-with-melody" / "DANCE_C_8")
    songs = tmp_path / "songs.txt"
    songs.write_text("DANCE_C_8\n")
    made = tmp_path / "tables.md"
    run_example("51_paper_tables.py", data, synthetic[1], "-o", made, "--only", songs, "--variants", "ours")
    tables = made.read_text()
    assert "| ours |" in tables and "| takes |" in tables and "as-recorded" not in tables


def readme_commands() -> list[str]:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```\n(.*?)```", text, flags=re.S)
    lines = [line for block in blocks for line in block.splitlines()]
    return [line for line in lines if line.startswith("choreograph ")]


@pytest.mark.parametrize("line", readme_commands())
def test_readme_commands_name_known_commands_and_options(line):
    words = shlex.split(re.sub(r"[\[\]]|\.\.\.", " ", line).split("#")[0])
    shown = CliRunner().invoke(main, [words[1], "--help"])
    assert shown.exit_code == 0
    for word in words[2:]:
        if word.startswith("-"):
            assert word in shown.output
