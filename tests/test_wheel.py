"""The wheel, installed away from the clone: it dances, reads nothing of the clone, and lists licences."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow

_CLONE = Path(__file__).resolve().parents[1]
_DATA = (".h5", ".npz", ".ogg", ".min.js", ".ttf", ".woff2", ".glb", ".bvh")
# Fails at the first file of the clone that Python opens; the tests' environment may lie inside it.
_SITE = """
import sys

def _refuse(event, arguments):
    path = str(arguments[0]) if event == "open" else ""
    if path.startswith({clone!r}) and not path.startswith({environment!r}):
        raise RuntimeError(f"opened {{path}}")

sys.addaudithook(_refuse)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    _run(
        sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
        "--wheel-dir", folder, _CLONE,
    )  # fmt: skip
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory) -> Path:
    """An environment with the wheel, and what it needs from the environment of the tests."""
    folder = tmp_path_factory.mktemp("installed") / "venv"
    _run(sys.executable, "-m", "venv", "--without-pip", folder)
    python = folder / "bin" / "python"
    _run(
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        wheel,
    )
    (site,) = folder.glob("lib/python*/site-packages")
    # A .pth file inside the other folder, such as that of an editable install, is not read.
    (site / "shared.pth").write_text(str(Path(np.__file__).parents[1]) + "\n")
    (site / "sitecustomize.py").write_text(_SITE.format(clone=str(_CLONE), environment=sys.prefix))
    return folder


def _run(*command: object, **options) -> str:
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=600, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_installed_wheel_dances(environment, tmp_path):
    # Kernels and analyses of other tests lie in the clone: kernels are read from a copy of them.
    own = {"NUMBA_CACHE_DIR": f"{tmp_path}/k", "CHOREOGRAPH_CACHE": f"{tmp_path}/c"}
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | own
    if (compiled := Path(os.environ["NUMBA_CACHE_DIR"])).is_dir():
        shutil.copytree(compiled, tmp_path / "k", ignore=shutil.ignore_patterns("lock", ".*"))
    options = {"cwd": tmp_path, "env": clean}
    program = environment / "bin" / "choreograph"
    song = _run(program, "songs", "--path", "house", **options).strip()
    assert song.startswith(str(environment))  # and so is the program that found it
    _run(program, "dance", song, "--duration", "8", "-o", "a.bvh", "-o", "a.html", **options)
    assert (tmp_path / "a.bvh").stat().st_size > 100_000
    assert (tmp_path / "a.html").stat().st_size > 100_000


def test_what_ships_beside_code_has_its_licence_listed(wheel):
    listed = (_CLONE / "THIRD_PARTY.md").read_text(encoding="utf-8")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    licences = {Path(name).name for name in names if "/licenses/" in name}
    assert {"LICENSE", "THIRD_PARTY.md"} <= licences
    data = [Path(n) for n in names if n.endswith(_DATA)]
    assert len(data) >= 6
    for path in data:
        within = path.relative_to("choreograph")
        assert str(within) in listed or str(within.parent / f"*{within.suffix}") in listed, path
    assert not [name for name in names if name.startswith(("tests/", "examples/"))]
