"""FBX: read and written with Blender, in a separate process."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import BUDGETS
from choreograph.formats import gltf
from choreograph.formats.glb import GlbWriter
from choreograph.formats.writer import Writer
from choreograph.motion.motion import Credits, Motion, Take

# Blender converts between FBX and GLB.


VARIABLE = "CHOREOGRAPH_BLENDER"
_TIMEOUT_S = 600.0
_MAX_BYTES = BUDGETS["fbx"].file_bytes


def find_blender() -> tuple[str, ...] | None:
    """The command that runs a script in Blender, None if Blender is not found.

    The environment variable names the program, or a Python with the module bpy. Otherwise it is `blender` on
    the path. bpy cannot be installed beside choreograph, because it needs an older NumPy.
    """
    named = os.environ.get(VARIABLE) or shutil.which("blender")
    if not named or shutil.which(named) is None:
        return None
    if Path(named).name.lower().startswith("python"):
        return (named,)
    return (named, "--background", "--factory-startup", "--python")


def require_blender(path: str | Path) -> tuple[str, ...]:
    """The command of `find_blender`. Raises `ParameterError`, which names `path`, if there is none."""
    blender = find_blender()
    if blender is None:
        raise ParameterError(
            f"{path}: expected Blender for FBX, found none: install it (blender.org) so that `blender` is on "
            f"the path, or set {VARIABLE} to it or to a Python 3.11 with bpy (`pip install bpy`), or use .glb"
        )
    return blender


def convert(source: str | Path, target: str | Path) -> None:
    """Convert a .fbx to a .glb, or a .glb to a .fbx.

    Raises
    ------
    ParameterError   if Blender is not found
    FormatError      if Blender cannot read or write the file, or takes over ten minutes
    """
    blender = require_blender(source if str(source).lower().endswith(".fbx") else target)
    source = Path(source)
    if not source.is_file():
        raise FormatError(f"{source}: expected a file, found none")
    if source.stat().st_size > _MAX_BYTES:
        raise FormatError(f"{source}: expected at most {_MAX_BYTES >> 20} MiB, got more")
    script = Path(__file__).with_name("_in_blender.py")
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / f"made{Path(target).suffix.lower()}"
        command = [*blender, str(script), "--", str(source.resolve()), str(made)]
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        try:
            ran = subprocess.run(
                command, capture_output=True, timeout=_TIMEOUT_S, check=False, env=environment, cwd=folder,
                text=True, errors="replace", stdin=subprocess.DEVNULL,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            raise FormatError(f"{source}: Blender did not convert it: {type(error).__name__}") from error
        if not made.is_file():
            said = [line for line in (ran.stderr + ran.stdout).splitlines() if "Error" in line]
            why = said[-1].strip()[:200] if said else f"exit status {ran.returncode}"
            raise FormatError(f"{source}: Blender did not convert it: {why}")
        shutil.move(made, target)


# Takes.


LAYOUT = "a single NAME.fbx, with Blender on this machine"
SUFFIXES = (".fbx",)
READS_BONE_MAP = True


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take]:
    """The animations of the file as takes without music, named after the file and, if several, the animation.

    Raises `ParameterError` without Blender, `FormatError` if the file is damaged or has no animation.
    """
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / f"{path.stem}.glb"
        convert(path, converted)
        try:
            takes = list(gltf.read(converted, bone_map))
        except FormatError as error:
            raise FormatError(str(error).replace(str(converted), str(path))) from None
    yield from (replace(take, credits=Credits(source=path.name), source_paths=(path,)) for take in takes)


class FbxWriter(Writer):
    """Writes a GLB and converts it with Blender. The same motion need not give the same bytes."""

    format = "fbx"

    @classmethod
    def check(cls, path: str | Path) -> None:
        """Raise `ParameterError` without Blender."""
        require_blender(path)

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`. Raises `ParameterError` without Blender, `FormatError` if Blender fails."""
        with tempfile.TemporaryDirectory() as folder:
            GlbWriter().write(motion, Path(folder) / "dance.glb")
            made = Path(folder) / "dance.fbx"
            convert(Path(folder) / "dance.glb", made)
            path.write_bytes(made.read_bytes())


WRITERS = (FbxWriter,)
