"""Motions to files: `save_motion` by suffix, `get_writer` by format.

bvh   one skeleton, Euler angles
npz   plain arrays, exact; SMPL's where the skeleton is the canonical one
glb   glTF: a skinned body, its skeleton standing, and the motion as an animation
vrma  a VRM animation, for VRM avatars
usda  what a glb holds, for UsdSkel; usdc: the same in binary
fbx   what a glb holds, by way of Blender

A new format is one module here with a `Writer`.
"""

from __future__ import annotations

from pathlib import Path

from choreograph.arguments import unexpected
from choreograph.exporters._base import DANCE_GENERATOR, GENERATOR, Writer
from choreograph.exporters.bvh import BvhOptions, BvhWriter
from choreograph.exporters.fbx import FbxWriter
from choreograph.exporters.glb import GlbWriter
from choreograph.exporters.npz import NpzWriter
from choreograph.exporters.usd import UsdaWriter, UsdcWriter
from choreograph.exporters.vrma import VrmaWriter
from choreograph.files import atomic_path
from choreograph.motion.motion import Motion
from choreograph.numerics import default_numerics

__all__ = [
    "DANCE_GENERATOR",
    "FORMATS",
    "GENERATOR",
    "BvhOptions",
    "BvhWriter",
    "FbxWriter",
    "GlbWriter",
    "NpzWriter",
    "UsdaWriter",
    "UsdcWriter",
    "VrmaWriter",
    "Writer",
    "get_writer",
    "save_motion",
]

_WRITERS: dict[str, type[Writer]] = {
    writer.format: writer
    for writer in (BvhWriter, NpzWriter, GlbWriter, VrmaWriter, UsdaWriter, UsdcWriter, FbxWriter)
}
FORMATS = tuple(_WRITERS)


def get_writer(format: str) -> Writer:
    """The writer, with its default options, of a format such as "bvh"; `ParameterError` if unknown."""
    if format.lower() not in _WRITERS:
        raise unexpected(f"a motion format among {', '.join(_WRITERS)}", format)
    return _WRITERS[format.lower()]()


@default_numerics()
def save_motion(path: str | Path, motion: Motion, *, writer: Writer | None = None) -> None:
    """Write `motion` atomically, in the format of the path's suffix or with `writer`.

    Raises `ParameterError` for an unknown suffix or a missing folder, `ChoreographError` if the disk
    is full or write-protected.
    """
    writer = writer or get_writer(Path(path).suffix.removeprefix("."))
    with atomic_path(path) as temporary:
        writer.write(motion, temporary)
