"""Plug-in-gait markers on a synthetic body, and C3D files of them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import c3d
import numpy as np

from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion

# Marker -> joint it moves with, and its offset there on the left side; metres, X left, Z forward.
_MIDDLE = {
    "C7": ("spine3", (0.0, 0.2, -0.06)), "CLAV": ("spine3", (0.0, 0.16, 0.08)),
    "T10": ("spine3", (0.0, -0.05, -0.09)), "STRN": ("spine3", (0.0, -0.02, 0.11)),
}  # fmt: skip
_LEFT = {
    "FHD": ("head", (0.07, 0.09, 0.09)), "BHD": ("head", (0.07, 0.09, -0.09)),
    "SHO": ("collar", (0.10, 0.085, -0.01)), "UPA": ("shoulder", (0.14, 0.0, -0.05)),
    "ELB": ("shoulder", (0.26, 0.042, 0.0)), "FRM": ("elbow", (0.12, 0.04, 0.0)),
    "WRA": ("elbow", (0.25, 0.0, 0.066)), "WRB": ("elbow", (0.25, 0.0, -0.066)),
    "FIN": ("wrist", (0.085, 0.0, 0.0)),
    "FWT": ("pelvis", (0.12, 0.02, 0.07)), "BWT": ("pelvis", (0.05, 0.02, -0.11)),
    "THI": ("hip", (0.08, -0.2, 0.03)), "KNE": ("hip", (0.055, -0.39, 0.0)),
    "SHN": ("knee", (0.06, -0.2, 0.03)), "ANK": ("knee", (0.042, -0.395, -0.02)),
    "HEE": ("ankle", (0.0, -0.04, -0.05)), "TOE": ("ankle", (0.0, -0.04, 0.16)),
    "MT5": ("ankle", (0.05, -0.05, 0.07)),
}  # fmt: skip


def markers_on(motion: Motion) -> dict[str, np.ndarray]:
    """Positions (T, 3) in metres, Y up, of 41 markers on a body with the canonical joints."""
    pos_m, world = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)

    def at(joint: str, offset) -> np.ndarray:
        index = motion.skeleton.index(joint)
        return pos_m[:, index] + rot.rotate(world[:, index], np.array(offset))

    markers = {name: at(joint, offset) for name, (joint, offset) in _MIDDLE.items()}
    for side, word, sign in (("L", "left", 1.0), ("R", "right", -1.0)):
        for name, (part, offset) in _LEFT.items():
            joint = part if part in ("head", "pelvis") else f"{word}_{part}"
            markers[side + name] = at(joint, np.array(offset) * [sign, 1.0, 1.0])
    return markers


def write_c3d(
    path: Path,
    markers_m: Mapping[str, np.ndarray],
    *,
    fps: float = 80.0,
    prefix: str = "dancer:",
    missing: Mapping[str, slice] | None = None,
    zeros: Mapping[str, slice] | None = None,
    unit: str | None = None,
    point_scale: float = -1.0,
    analog: np.ndarray | None = None,
    adapt: Callable[[c3d.Writer], None] = lambda writer: None,
) -> Path:
    """Write markers as C3D in mm, Z up; samples in `missing` get a residual of -1, those in `zeros` are 0.

    Coordinates are integers where `point_scale` is positive. `analog` (channels, samples a frame) is the same
    in every frame; `adapt` changes the writer before it writes.
    """
    n_frames = len(next(iter(markers_m.values())))
    points = np.zeros((n_frames, len(markers_m), 5))
    for column, (name, pos_m) in enumerate(markers_m.items()):
        points[:, column, :3] = 1000.0 * pos_m[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
        if name in (missing or {}):
            points[missing[name], column] = [0.5, 0.5, 0.5, -1.0, 0.0]
        if name in (zeros or {}):
            points[zeros[name], column] = 0.0
    samples = np.zeros((0, 0)) if analog is None else analog
    writer = c3d.Writer(point_rate=fps, analog_rate=fps * samples.shape[1], point_scale=point_scale)
    writer.set_point_labels([prefix + name for name in markers_m])
    if unit is not None:
        writer.point_group.set_str("UNITS", "", unit, len(unit))
    writer.add_frames([(frame, samples) for frame in points.astype(np.float32)])
    adapt(writer)
    with open(path, "wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is no analog data
        writer.write(file)
    return path
