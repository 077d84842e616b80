"""Builds that are resumed with other takes, songs or options, and builds of one file at the same time."""

import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

from choreograph.formats.register import save_motion
from choreograph.library.building.build import build_repertoire
from choreograph.library.building.options import BuildOptions

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("short_trainings")]

TINY = BuildOptions(preset="tiny", style_changes={"steps": 3})
BUILD = """
import sys
from short_trainings import shorten_trainings
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.build import build_repertoire
shorten_trainings()
options = BuildOptions(preset="tiny", style_changes={"steps": 3}, workers=1)
build_repertoire([sys.argv[1]], sys.argv[2], options)
"""
RESUMED = replace(TINY, resume=True)


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Three takes of 15 s to clicks, with words enough, and what was built of them; not to be changed."""
    folder = tmp_path_factory.mktemp("original") / "takes"
    folder.mkdir()
    for seed, (name, bpm) in enumerate({"slow": 90, "even": 110, "quick": 130}.items()):
        save_motion(folder / f"{name}.bvh", stepping(15 * 30, period_s=60 / bpm, seed=seed))
        write_clicks(folder / f"{name}.wav", duration_s=15.0, bpm=bpm)
    build_repertoire([folder], folder.parent / "a.h5", TINY)
    return folder.parent


@pytest.fixture
def folder(original, tmp_path):
    """A copy of the takes, beside one of the build."""
    shutil.copytree(original, tmp_path, dirs_exist_ok=True)
    return tmp_path / "takes"


def swap(one, other):
    content = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(content)


def anew(notes) -> list[str]:
    return [note for note in notes if "starts again" in note]


def another_motion(folder):
    swap(folder / "slow.bvh", folder / "quick.bvh")
    return {}, "take quick"


def another_song(folder):
    write_clicks(folder / "even.wav", duration_s=15.0, bpm=111)
    return {}, "take even"


def another_genre(folder):
    (folder / "manifest.csv").write_text("name,genre\nslow,waltz\neven,waltz\nquick,waltz\n")
    return {}, "take even"


def another_seed(folder):
    return {"seed": 1}, "seed = 0"


def other_feet(folder):
    return {"lock_feet": False}, "lock_feet"


def another_tracker(folder):
    return {"beats": "tempo-path"}, "beats"


@pytest.mark.parametrize(
    "change", [another_motion, another_song, another_genre, another_seed, other_feet, another_tracker]
)
def test_resuming_with_anything_else_trains_anew_and_says_what_changed(folder, tmp_path, change):
    changes, named = change(folder)
    resumed, notes = build_repertoire([folder], tmp_path / "a.h5", replace(RESUMED, **changes))
    if change is another_motion:
        fresh, _ = build_repertoire([folder], tmp_path / "b.h5", TINY)
        assert resumed.path.read_bytes() == fresh.path.read_bytes()
    told = anew(notes)
    assert [note.split(": ")[1] for note in told] == [
        f"training of {net} starts again" for net in ("style", "words")
    ]
    assert all(named in note for note in told)


def test_resuming_the_same_trains_nothing(original, folder, tmp_path):
    before, trained = (original / "a.h5").read_bytes(), []
    again, notes = build_repertoire(
        [original / "takes"], tmp_path / "a.h5", RESUMED, training_report=trained.append
    )
    assert again.path.read_bytes() == before and not trained and not anew(notes)


def test_a_damaged_checkpoint_is_named_and_only_its_network_trained_again(original, folder, tmp_path):
    before = (original / "a.h5").read_bytes()
    os.truncate(tmp_path / "a.h5.build" / "style.pt", 5000)
    trained = []
    again, notes = build_repertoire(
        [original / "takes"], tmp_path / "a.h5", RESUMED, training_report=trained.append
    )
    [note] = anew(notes)
    assert "style.pt" in note and "damaged" in note
    assert {state.name for state in trained} == {"style"}
    assert again.path.read_bytes() == before


def test_a_second_build_of_a_file_is_refused_and_disturbs_nothing(original, tmp_path):
    """Two with different seeds never mix: the file is the first one's to the bit."""
    folder = original / "takes"
    output = tmp_path / "a.h5"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    first = subprocess.Popen([sys.executable, "-c", BUILD, str(folder), str(output)], env=environment)
    while not (tmp_path / "a.h5.build" / "owner.json").exists():
        assert first.poll() is None
        time.sleep(0.01)
    second = run("build-db", folder, "--preset", "tiny", "--seed", 1, "-o", output)
    assert_one_line(second, says=f"process {first.pid} builds a.h5 since 20")
    assert first.wait() == 0
    assert output.read_bytes() == (original / "a.h5").read_bytes()


def test_the_starter_is_built_by_one_process(tmp_path):
    from choreograph.core.files import locked_folder

    with locked_folder(tmp_path / "work", doing="builds starter.h5"):
        command = [
            sys.executable,
            "-m",
            "content.starter",
            "--work",
            tmp_path / "work",
            "-o",
            tmp_path / "s.h5",
        ]
        again = subprocess.run(
            command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2]
        )
    assert again.returncode == 2
    (line,) = again.stderr.splitlines()
    assert f"process {os.getpid()} builds starter.h5" in line
    assert not (tmp_path / "s.h5").exists()
