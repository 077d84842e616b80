"""FBX: animations of a skeleton, by way of Blender."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from choreograph.errors import FormatError
from choreograph.fbx import convert
from choreograph.importers import gltf
from choreograph.takes import Credits, Take

LAYOUT = "a single NAME.fbx, with Blender on this machine"
READS_BONE_MAP = True


def detect(path: Path) -> bool:
    """Whether `path` is one FBX file."""
    return path.is_file() and path.suffix.lower() == ".fbx"


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take]:
    """The file's animations as takes without music, named after the file; several also after themselves.

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
