"""Every example runs, the README is short, and it names only commands, options and files that exist."""

from __future__ import annotations

import json
import re
import runpy
import shlex
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import soundfile
from command_line import run
from synthetic_motions import stepping
from synthetic_repertoire import synthetic_repertoire, write_clicks

import choreograph as cg
from choreograph.choreography.graph.warping import subsequence_dtw
from choreograph.core.counts import make_counts, numbers_in_bar
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.formats.manifest import write_counts
from choreograph.formats.register import save_motion
from research import dynamics

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
SCRIPTS = sorted(
    path for path in (ROOT / "research").glob("*.py") if "__main__" in path.read_text(encoding="utf-8")
)
PAPERS = [path for path in SCRIPTS if "__main__" in path.read_text(encoding="utf-8")]  # not what they share
GUIDES = [ROOT / "README.md", ROOT / "blender_extension" / "README.md"]
PAGES = [
    *GUIDES,
    *sorted((ROOT / "research" / "results").glob("*.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
MODEL_CARDS = [ROOT / "choreograph" / "library" / "shipped" / name for name in ("STARTER.md", "NETWORKS.md")]
WRITTEN = {
    "01_own_library.py": ("rep.h5", "own.bvh"),
    "02_own_cost.py": ("low.bvh",),
    "03_edit_a_plan.py": ("plan.json", "edited.json", "edited.bvh"),
    "04_batch_of_songs.py": ("dances.csv",),
    "05_controls.py": ("controlled.bvh",),
    "07_moving_picture.py": ("dance.webp",),
    "08_rollout_stream.py": ("stream.bvh",),
}
# What takes long is given less: a short song, or a shorter picture.
OF_A_WHOLE_SONG = ("08_rollout_stream.py",)
OF_SECONDS = {"07_moving_picture.py": 1.0}


@pytest.fixture(scope="module")
def short_song(tmp_path_factory):
    """The first twelve seconds of a built-in song."""
    path = tmp_path_factory.mktemp("short") / "house.wav"
    soundfile.write(path, cg.load_song(cg.example_songs()["house"], duration_s=12.0).samples, SAMPLE_RATE_HZ)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_an_example_runs_as_it_is(path, short_song, tmp_path, monkeypatch, capsys):
    if "rollout" in path.name and "rollout" not in cg.starter_repertoire().net_names:
        pytest.skip("the built-in repertoire has no rollout network")
    monkeypatch.chdir(tmp_path)
    arguments = [str(short_song)] if path.name in OF_A_WHOLE_SONG else []
    monkeypatch.setattr(sys, "argv", [str(path), *arguments])
    if path.name in OF_SECONDS:
        main = runpy.run_path(str(path), run_name="example")["main"]
        monkeypatch.setitem(main.__globals__, "DURATION_S", OF_SECONDS[path.name])
        main()
    else:
        runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out
    for name in WRITTEN[path.name]:
        assert (tmp_path / name).stat().st_size > 0


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.name)
def test_a_notebook_runs_and_is_stored_without_outputs(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cells = [c for c in json.loads(path.read_text(encoding="utf-8"))["cells"] if c["cell_type"] == "code"]
    assert cells and not any(cell["outputs"] or cell["execution_count"] for cell in cells)
    names: dict[str, object] = {}
    for number, cell in enumerate(cells):
        exec(compile("".join(cell["source"]), f"{path.name}, code cell {number}", "exec"), names)
    assert (tmp_path / "dance.bvh").exists() and (tmp_path / "dance.html").exists()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.name)
def test_an_example_is_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) < 40


def run_as_script(name: str, *arguments: object) -> str:
    """What a research script prints, run as a person does."""
    command = [sys.executable, str(ROOT / "research" / name), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def run_script(monkeypatch, capsys):
    """What a research script prints, run in this process, which has loaded all that scripts import."""

    def run_script(name: str, *arguments: object, **constants: object) -> str:
        script = import_module(f"research.{name}")
        for constant, value in constants.items():
            monkeypatch.setattr(script, constant, value)
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        script.main()
        return capsys.readouterr().out

    return run_script


@pytest.mark.slow
@pytest.mark.parametrize("path", PAPERS, ids=lambda p: p.name)
def test_what_reproduces_the_papers_shows_its_usage(path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [str(path), "--help"])
    monkeypatch.syspath_prepend(path.parent)  # as it is for a script
    with pytest.raises(SystemExit, match="0"):
        runpy.run_path(str(path), run_name="__main__")
    assert "usage" in capsys.readouterr().out


@pytest.fixture(scope="module")
def db(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("examples") / "rep.h5").path


@pytest.mark.slow
def test_the_dtw_of_phase_curves_finds_a_planted_warp_and_is_the_engines_in_one_dimension():
    script = runpy.run_path(str(ROOT / "research" / "warping_experiment.py"))
    rng = np.random.default_rng(0)
    query, targets = rng.normal(size=80).astype(np.float32), rng.normal(size=(5, 160)).astype(np.float32)
    paths, _ = subsequence_dtw(query, targets)
    assert np.allclose(script["dtw_paths"](query[:, None], targets[..., None]), paths)
    warp = np.cumsum(np.r_[30.0, np.full(39, 0.7), np.full(40, 1.4)])  # (80,) target frames

    def phases(frames: np.ndarray) -> np.ndarray:
        turns = frames[:, None] / [9.0, 36.0]  # beat and bar
        return np.concatenate([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)], axis=1)

    (found,) = script["dtw_paths"](phases(warp), phases(np.arange(160.0))[None])
    off = (found - warp + 18.0) % 36.0 - 18.0  # another bar will do as well
    assert np.abs(off).max() < 1.0


@pytest.fixture(scope="module")
def held_out(shared_data, tmp_path_factory):
    """A folder with one real take, and a list of its song."""
    folder = tmp_path_factory.mktemp("held-out")
    (folder / "data").mkdir()
    (folder / "data" / "DANCE_C_8").symlink_to(shared_data / "dance-with-melody" / "DANCE_C_8")
    (folder / "songs.txt").write_text("DANCE_C_8\n")
    return folder / "data", folder / "songs.txt"


@pytest.mark.slow
def test_the_table_of_dances(held_out, db, run_script):
    data, songs = held_out
    assert "f_score" in run_script("held_out_dances", data, db, "--songs", songs)


@pytest.mark.slow
def test_the_papers_tables_of_a_repertoire_of_other_takes(held_out, db, tmp_path):
    data, songs = held_out
    made = tmp_path / "tables.md"
    run_as_script("paper_tables.py", data, db, "-o", made, "--only", songs, "--variants", "ours")
    tables = made.read_text()
    assert "| ours |" in tables and "| takes |" in tables and "as-recorded" not in tables


@pytest.fixture(scope="module")
def stepped(tmp_path_factory, short_trainings):
    """Three counted takes of 16 s that step to clicks, and a repertoire of two with learned densities."""
    folder = tmp_path_factory.mktemp("stepped")
    takes = folder / "takes"
    takes.mkdir()
    for seed, (name, bpm) in enumerate({"slow": 90, "even": 110, "quick": 130}.items()):
        save_motion(takes / f"{name}.bvh", stepping(16 * 30, period_s=60 / bpm, seed=seed))
        write_clicks(takes / f"{name}.wav", duration_s=16.0, bpm=bpm)
        times_s = np.arange(0.0, 16.0, 60 / bpm)
        counts = make_counts(times_s, numbers_in_bar(len(times_s), 4), 4)
        write_counts(takes / f"{name}.counts.csv", counts, ())
    built = cg.build(
        takes, folder / "l.h5", preset="tiny", density="learned", words=False, leave_out=("quick",)
    )
    return takes, built.path


@pytest.mark.slow
def test_the_experiment_on_densities(stepped, run_script, tmp_path):
    takes, path = stepped
    only = tmp_path / "only.txt"
    only.write_text("quick\n")
    given = ("--only", only, "--clips", 4, "--best", 2, "--stiffness", 0, 40000)
    shown = run_script("density_experiment", takes, path, *given)
    lines = [line.split(" | ") for line in shown.splitlines() if line.startswith("| ")]
    found = {tuple(cells[:3]): cells for cells in lines}
    assert ("| recovery, ms", "learned", "40000") in found
    assert ("| learned motion, analytic music", "another song", "0") in found
    # These takes rest on every count, so that aligned rests bring counts to beats; a constant brings nothing.
    within = {key[0]: float(cells[4].split(" ± ")[0]) for key, cells in found.items() if key[2] == "0"}
    assert within["| analytic motion, analytic music"] > 0.7
    assert within["| analytic motion, constant music"] < 0.6


@pytest.mark.slow
def test_the_figure_of_a_warp(stepped, tmp_path):
    takes, path = stepped
    made = tmp_path / "figure.png"
    shown = run_as_script("warp_figure.py", path, takes / "quick.wav", "-o", made, "--second", 5)
    assert "squared difference" in shown
    assert made.stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Mean of empty slice")  # of scores that none of the few dances has
def test_the_table_of_loud_and_soft_sections(db, run_script):
    given = ("--repertoires", db, "--genres", "house", "--seeds", 1)
    shown = run_script("section_energy", *given, DURATION_S=32.0)
    for expected in ("own form: 1 songs", "softened: 1 songs", "energy 2:", "chance:", "response speed"):
        assert expected in shown


@pytest.mark.slow
def test_the_table_of_dynamics(run_script):
    given = ("--genres", "house", "--groups", "crescendo", "--seeds", 1)
    few = {name: replace(config, candidates=24) for name, config in dynamics.SETTINGS.items()}
    shown = run_script("dynamics", *given, DURATION_S={"crescendo": 16.0}, SETTINGS=few)
    for expected in ("crescendo: 1 songs, 1 seeds, graph", "crescendo, default:", "dynamics 0, energy 0:"):
        assert expected in shown


def commands(page: Path) -> list[str]:
    """The `choreograph …` lines of a page's code blocks; a line that ends in \\ goes on."""
    blocks = re.findall(r"```\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.S)
    lines = [line.strip() for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return [line for line in lines if line.startswith("choreograph ")]


@pytest.mark.parametrize("line", [line for page in PAGES for line in commands(page)])
def test_a_command_on_a_page_is_known_and_so_are_its_options(line):
    words = shlex.split(re.sub(r"[\[\]]|\.\.\.", " ", line).split("#")[0])
    shown = run(words[1], "--help")
    assert shown.exit_code == 0, shown.output
    for word in words[2:]:
        if word.startswith("-"):
            assert re.search(rf"(^|[\s,/]){re.escape(word)}\b", shown.output), word


def test_options_in_the_makefile_are_known():
    lines = [line for line in (ROOT / "Makefile").read_text().splitlines() if "$(BIN)/choreograph " in line]
    for line in lines:
        command = line.split("$(BIN)/choreograph ")[1].split()[0].rstrip(")")
        shown = run(command, "--help").output
        for option in re.findall(r"(?<!\w)--[a-z-]+", line):
            assert option in shown, (command, option)


@pytest.mark.parametrize("page", [*PAGES, *MODEL_CARDS], ids=lambda p: p.parent.name + "-" + p.name)
def test_files_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#:]+)\)", text)
    named = re.findall(r"\b(?:examples|choreograph|data_schema)/[\w./-]*\w", text)
    for path in [*(page.parent / link for link in links), *(ROOT / name for name in named)]:
        assert path.exists(), path


@pytest.mark.slow
def test_the_first_command_prints_what_the_readme_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    song = run("songs", "--path", "house").stdout.strip()
    printed = re.search(r"first command prints `(.*?)`", (ROOT / "README.md").read_text(encoding="utf-8"))[1]
    assert run("dance", song).stdout.strip() == printed


def test_the_readme_is_short():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 110 and len(text.split()) <= 700
