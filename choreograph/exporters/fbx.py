"""FBX writer: what a GLB holds, converted by Blender."""

from __future__ import annotations

import tempfile
from pathlib import Path

from choreograph.exporters._base import Writer
from choreograph.exporters.glb import GlbWriter
from choreograph.fbx import convert
from choreograph.motion.motion import Motion


class FbxWriter(Writer):
    """Needs Blender on this machine (`fbx.find_blender`); the same motion need not give the same bytes."""

    format = "fbx"

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`; `ParameterError` without Blender, `FormatError` if it fails."""
        with tempfile.TemporaryDirectory() as folder:
            GlbWriter().write(motion, Path(folder) / "dance.glb")
            made = Path(folder) / "dance.fbx"
            convert(Path(folder) / "dance.glb", made)
            path.write_bytes(made.read_bytes())
