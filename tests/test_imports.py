"""What a default dance imports: neither torch nor librosa, which take seconds to import."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import choreograph as cg

HEAVY = ("torch", "librosa", "sklearn", "matplotlib", "networkx")
PEAKS = ("scipy.signal", "scipy.stats")  # for the motion beats on a page, 0.6 s


@pytest.mark.parametrize("engine", ["graph", "mixer", "rollout"])
def test_a_dance_imports_neither_torch_nor_librosa(engine, tmp_path):
    song = str(cg.example_songs()["house"])
    arguments = ["dance", song, "-o", "dance.bvh", "-o", "dance.html", "--engine", engine, "--duration", "8"]
    code = f"""
import sys
from choreograph.cli import main
main({arguments!r}, standalone_mode=False)
print([name for name in {HEAVY!r} if name in sys.modules])
"""
    assert last_line_of(code, tmp_path) == "[]"
    assert (tmp_path / "dance.bvh").exists() and (tmp_path / "dance.html").exists()


def test_a_dance_without_a_page_imports_no_search_for_peaks(tmp_path):
    arguments = ["dance", str(cg.example_songs()["house"]), "-o", "dance.bvh", "--duration", "8"]
    code = f"""
import sys
from choreograph.cli import main
main({arguments!r}, standalone_mode=False)
print([name for name in {HEAVY + PEAKS!r} if name in sys.modules])
"""
    assert last_line_of(code, tmp_path) == "[]"


@pytest.mark.parametrize("command", [[], ["dance"], ["scene"], ["build-db"]])
def test_help_imports_no_compiler(command, tmp_path):
    code = f"""
import sys
from choreograph.cli import main
main({[*command, "--help"]!r}, standalone_mode=False)
print([name for name in {("numba", "h5py", *HEAVY, *PEAKS)!r} if name in sys.modules])
"""
    assert last_line_of(code, tmp_path) == "[]"


def test_a_stream_imports_neither_torch_nor_librosa(tmp_path):
    code = f"""
import sys
import choreograph as cg
song = cg.load_song(cg.example_songs()["house"], duration_s=2)
assert len(list(cg.RolloutStream(song, genre="house"))) == 120
print([name for name in {HEAVY + PEAKS!r} if name in sys.modules])
"""
    assert last_line_of(code, tmp_path) == "[]"


def last_line_of(code: str, folder: Path) -> str:
    """The last line that a program prints."""
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=folder
    )
    return shown.stdout.splitlines()[-1]
