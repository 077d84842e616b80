"""What a default dance imports: neither torch nor librosa, which take seconds to import."""

from __future__ import annotations

import subprocess
import sys

import pytest

import choreograph as cg

HEAVY = ("torch", "librosa", "sklearn", "matplotlib", "networkx", "scipy.stats", "scipy.signal")


@pytest.mark.parametrize("engine", ["graph", "mixer"])
def test_a_dance_imports_neither_torch_nor_librosa(engine, tmp_path):
    song = str(cg.example_songs()["house"])
    arguments = ["dance", song, "-o", "dance.bvh", "--engine", engine, "--duration", "8"]
    code = f"""
import sys
from choreograph.cli import main
main({arguments!r}, standalone_mode=False)
print([name for name in {HEAVY!r} if name in sys.modules])
"""
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert (tmp_path / "dance.bvh").exists()
    assert shown.stdout.splitlines()[-1] == "[]"
