"""The register of formats: what is built in, and what another package adds by an entry point."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from installed_packages import installed_package
from synthetic_motions import stepping

from choreograph import formats
from choreograph.cli.main import main
from choreograph.core.errors import ParameterError
from choreograph.formats import (
    BUILTIN,
    OutputFormat,
    builtin_formats,
    formats_using,
    motion_formats,
    motion_suffixes,
    output_formats,
    writer_of,
)
from choreograph.formats.register import get_writer, import_takes, save_motion

SOURCE = """
from choreograph.formats.npz import NpzWriter, read_npz
from choreograph.formats.writer import Writer
from choreograph.motion.motion import Credits, Take

LAYOUT = "a single NAME.mine"
SUFFIXES = (".mine",)


def detect(path):
    return path.is_file() and path.suffix == ".mine"


def read(path):
    yield Take(path.stem, read_npz(path), Credits(), source_paths=(path,))


class MineWriter(Writer):
    format = "mine"
    uses = ("character",)

    def write(self, motion, path):
        with path.open("wb") as file:
            NpzWriter().write(motion, file)


WRITERS = (MineWriter,)
"""

PATH_READER = """

from choreograph.motion.motion import Credits, Take
from choreograph.motion.skeleton import canonical_skeleton

LAYOUT = "a single NAME.path"
SUFFIXES = (".path",)


def read(path):
    table = np.loadtxt(path)  # (T, 4)
    fps = 1.0 / float(np.diff(table[:, 0]).mean())
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(table), canonical_skeleton().n_joints, 1))
    motion = Motion(canonical_skeleton(), table[:, 1:], still, fps)
    yield Take(path.stem, motion, Credits(), source_paths=(path,))
"""


@pytest.fixture
def mine(tmp_path):
    entry_points = "[choreograph.formats]\nmine = mine_format\n"
    with installed_package(tmp_path / "site", "mine_format", SOURCE, entry_points):
        yield


def test_every_built_in_format_reads_or_writes():
    for name, module in zip(BUILTIN, builtin_formats(), strict=True):
        detects = hasattr(module, "detect") or hasattr(module, "SUFFIXES")
        assert hasattr(module, "WRITERS") or (module.LAYOUT and module.read and detects), name
        assert all(writer_of(written.name).format == written.name for written in BUILTIN[name])
    assert tuple(motion_formats()) == ("bvh", "npz", "glb", "vrma", "vmd", "usda", "usdc", "fbx")
    assert set(motion_suffixes()) == {".bvh", ".c3d", ".glb", ".gltf", ".vrma", ".vmd", ".npz", ".fbx"}


@pytest.fixture
def path_format(tmp_path, monkeypatch):
    """The worked example of the documentation as a built-in format: one module and one line in `BUILTIN`."""
    page = Path(__file__).resolve().parents[2] / "docs/contributing/format.md"
    (writer,) = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    (tmp_path / "path.py").write_text(writer + PATH_READER)
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(tmp_path)])
    monkeypatch.setattr(formats, "BUILTIN", BUILTIN | {"path": (OutputFormat("path", "a path", ("loop",)),)})
    yield
    sys.modules.pop("choreograph.formats.path", None)


def test_a_new_format_is_one_module_and_one_line(path_format, tmp_path):
    folder = tmp_path / "takes"
    folder.mkdir()
    save_motion(folder / "a.bvh", stepping(30))
    done = CliRunner().invoke(main, ["convert", str(folder / "a.bvh"), str(folder / "b.path")])
    assert done.exit_code == 0, done.output
    # Its writer is listed, its reader reads a file and is one of those of a folder, and errors name it.
    assert (
        "path" in output_formats() and "path" in formats_using("loop") and "path" not in formats_using("bvh")
    )
    (take,) = import_takes(folder / "b.path")
    np.testing.assert_allclose(
        np.diff(take.motion.root_pos_m, axis=0), np.diff(stepping(30).root_pos_m, axis=0), atol=1e-4
    )
    assert [take.name for take in import_takes(folder)] == ["a", "b"]
    (folder / "a.unknown").touch()
    with pytest.raises(ParameterError, match=r"known layout: .*a single NAME\.path"):
        list(import_takes(folder / "a.unknown"))


def test_another_package_adds_a_reader_and_a_writer(mine, tmp_path):
    (tmp_path / "takes").mkdir()
    for name in ("a.mine", "b.bvh"):
        save_motion(tmp_path / "takes" / name, stepping(30))
    (tmp_path / "takes" / "a.wav").touch()
    assert [take.name for take in import_takes(tmp_path / "takes" / "a.mine")] == ["a"]
    takes = list(import_takes(tmp_path / "takes"))
    assert [take.name for take in takes] == ["a", "b"]
    assert takes[0].song_name == "a"
    assert "mine" in output_formats()
    assert "mine" in formats_using("character")
    assert "mine" in formats_using("loop")
    assert "mine" not in formats_using("bvh")


def test_commands_write_a_format_of_another_package(mine, tmp_path):
    save_motion(tmp_path / "a.bvh", stepping(30))
    done = CliRunner().invoke(main, ["convert", str(tmp_path / "a.bvh"), str(tmp_path / "b.mine")])
    assert done.exit_code == 0, done.output
    (take,) = import_takes(tmp_path / "b.mine")
    assert take.motion.n_frames == 30


def test_without_the_package_its_format_is_unknown(tmp_path):
    with pytest.raises(ParameterError, match=r"a motion format among bvh, .*fbx, got 'mine'"):
        get_writer("mine")


def test_the_help_of_dance_and_convert_names_every_format():
    for command, known in (("dance", output_formats()), ("convert", tuple(motion_formats()))):
        shown = CliRunner().invoke(main, [command, "--help"]).output
        assert not [name for name in known if f".{name}" not in shown]
