"""glTF: the animations of a rig, each a take, whatever pose its skin was bound in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from choreograph.errors import FormatError, ParameterError
from choreograph.gltf import GltfDocument, GltfRig, Rig, read_gltf, read_rig
from choreograph.gltf.rig import rotations_of, world_matrices
from choreograph.importers._axes_and_units import unit_m
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import to_local
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles
from choreograph.motion.skeleton import Skeleton
from choreograph.takes import Credits, Take
from choreograph.timebase import STORE_FPS, frame_times_s

Floats = NDArray[np.float64]
# Key times (K,), values and interpolation by bone and property.
Tracks = dict[tuple[int, str], tuple[Floats, Floats, str]]

LAYOUT = "a single NAME.glb, .gltf or .vrma with animations of a skeleton"
SUFFIXES = (".glb", ".gltf", ".vrma")
_LONGEST_S = 3600.0
_WIDTHS = {"rotation": 4, "translation": 3, "scale": 3}


def detect(path: Path) -> bool:
    """Whether `path` is one glTF file."""
    return path.is_file() and is_gltf(path)


def is_gltf(path: Path) -> bool:
    """Whether the name is that of a glTF file."""
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def read(path: Path) -> Iterator[Take]:
    """The file's animations as takes without music, named after the file; several also after themselves."""
    motions = read_gltf_motions(path)
    for name, (motion, notes) in motions.items():
        own = path.stem if len(motions) == 1 else f"{path.stem}-{name}"
        yield Take(own, motion, Credits(source=path.name), source_paths=(path,), notes=notes)


def read_gltf_motions(path: str | Path) -> dict[str, tuple[Motion, tuple[str, ...]]]:
    """The animations of a glTF file by name: the motion of the rig, from its hips down, and notes.

    Motions are at 60 fps, or at their keys' rate if lower. Rotations are measured from the bind pose, which
    is the skeleton's rest pose. Raises `FormatError` if the file is damaged, or has no animation or no body.
    """
    document = read_gltf(path)
    animations = document.json.get("animations", [])
    if not animations:
        raise FormatError(f"{path}: expected an animation, got none: export it with its animations")
    found = read_rig(document)
    motions: dict[str, tuple[Motion, tuple[str, ...]]] = {}
    for number, animation in enumerate(animations):
        tracks = _tracks(document, found, animation)
        if tracks:  # others move a camera or a prop
            name = str(animation.get("name") or f"{number + 1}")
            motions[name if name not in motions else f"{name} {number + 1}"] = _motion(
                document, found, tracks
            )
    if not motions:
        raise FormatError(f"{path}: expected an animation of the skeleton, got one of other things")
    return motions


def _motion(document: GltfDocument, found: GltfRig, tracks: Tracks) -> tuple[Motion, tuple[str, ...]]:
    """One animation on the rig's bones from the hips down."""
    rig = _with_human_names(found)
    times_s, fps = _frame_times(document, tracks)
    local = {"translation": rig.rest_translation, "rotation": rig.rest_quat, "scale": rig.rest_scale}
    sampled = {path: np.repeat(rest[None], len(times_s), axis=0) for path, rest in local.items()}  # (T, B, …)
    for (bone, path), (keys_s, values, kind) in tracks.items():
        sampled[path][:, bone] = _sampled(keys_s, values, kind, path, times_s)
    world = world_matrices(
        rig.parents, *(np.moveaxis(sampled[p], 1, 0) for p in ("translation", "rotation", "scale"))
    )
    pelvis = _pelvis(document, rig)
    below = _below(rig, pelvis)
    joint_of = {bone: joint for joint, bone in enumerate(below)}
    parents = np.array([-1, *(joint_of[int(rig.parents[bone])] for bone in below[1:])])
    offsets = rig.bind_pos_m[below].copy()
    offsets[1:] -= rig.bind_pos_m[rig.parents[below[1:]]]
    skeleton = Skeleton(tuple(rig.names[bone] for bone in below), parents, offsets)
    turned = rot.multiply(np.moveaxis(rotations_of(world[below]), 0, 1), rot.invert(rig.bind_quat[below]))
    root = world[pelvis, :, :3, 3]
    metres, note = unit_m(skeleton, rig.bind_pos_m[None, below])
    if metres != 1.0:
        skeleton, root = replace(skeleton, offsets_m=metres * offsets), metres * root
    quat = rot.make_continuous(to_local(skeleton, turned))
    return Motion(skeleton, root, quat, fps), (note,) if metres != 1.0 else ()


def _with_human_names(found: GltfRig) -> Rig:
    """The rig with the names that a VRM file gives its bones, and every name once."""
    human = {bone: name for name, bone in found.human_bones.items()}
    names: list[str] = []
    for bone, name in enumerate(found.rig.names):
        own = human.get(bone, name)
        names.append(own if own not in names else f"{own} #{bone}")
    return replace(found.rig, names=tuple(names))


def _tracks(document: GltfDocument, found: GltfRig, animation: dict[str, Any]) -> Tracks:
    """The tracks of an animation that move bones."""
    bone_of = {node: bone for bone, node in enumerate(found.nodes)}
    samplers = animation.get("samplers", [])
    tracks: Tracks = {}
    for channel in animation.get("channels", []):
        target, index = channel.get("target", {}), channel.get("sampler")
        bone, path = bone_of.get(target.get("node", -1)), target.get("path")
        if bone is None or path not in _WIDTHS:
            continue
        if not (isinstance(index, int) and 0 <= index < len(samplers)):
            raise FormatError(f"{document.name}: expected a sampler for every channel: the file is damaged")
        keys_s = document.array(samplers[index].get("input"))
        values = document.array(samplers[index].get("output"))
        kind = samplers[index].get("interpolation", "LINEAR")
        n_values = len(keys_s) * (3 if kind == "CUBICSPLINE" else 1)
        if keys_s.ndim != 1 or values.shape != (n_values, _WIDTHS[path]) or (np.diff(keys_s) < 0).any():
            raise FormatError(f"{document.name}: expected increasing keys with a {path} each: damaged")
        if not (np.isfinite(keys_s).all() and np.isfinite(values).all()):
            raise FormatError(f"{document.name}: expected finite keys and values: the file is damaged")
        if path == "rotation":
            values = np.roll(values, 1, axis=-1)
        tracks[bone, path] = keys_s, values, kind
    return tracks


def _frame_times(document: GltfDocument, tracks: Tracks) -> tuple[Floats, float]:
    """Frame times (T,) from the first key to the last, and their rate."""
    keys = [keys_s for keys_s, _, _ in tracks.values()]
    start_s, end_s = min(k[0] for k in keys), max(k[-1] for k in keys)
    if end_s - start_s > _LONGEST_S:
        raise FormatError(
            f"{document.name}: expected an animation of up to an hour, got {end_s - start_s:.0f} s"
        )
    longest = max(keys, key=len)
    steps = np.diff(longest)
    native = 1.0 / float(np.median(steps[steps > 0])) if (steps > 0).any() else STORE_FPS
    fps = min(STORE_FPS, round(native, 3)) if native >= 1.0 else STORE_FPS
    n_frames = 1 + int(np.floor((end_s - start_s) * fps + 1e-3))
    return start_s + frame_times_s(n_frames, fps), fps


def _sampled(keys_s: Floats, values: Floats, kind: str, path: str, times_s: Floats) -> Floats:
    """Values (T, D) at times (T,), by the interpolation of the format."""
    if kind == "CUBICSPLINE":
        into, values, out = np.moveaxis(values.reshape(len(keys_s), 3, -1), 1, 0)
        if len(keys_s) > 1 and (np.diff(keys_s) > 0).all():
            return _cubic(keys_s, values, into, out, path, times_s)
    after = np.searchsorted(keys_s, times_s, side="right").clip(1, max(len(keys_s) - 1, 1))
    low, high = after - 1, after.clip(max=len(keys_s) - 1)
    if kind == "STEP":
        return values[np.searchsorted(keys_s, times_s, side="right").clip(1) - 1]
    gap = np.maximum(keys_s[high] - keys_s[low], 1e-9)
    weight = ((times_s - keys_s[low]) / gap).clip(0.0, 1.0)
    if path == "rotation":
        values = rot.normalize(values)
        return rot.slerp(values[low], values[high], weight)
    return values[low] + weight[:, None] * (values[high] - values[low])


def _cubic(keys_s: Floats, values: Floats, into: Floats, out: Floats, path: str, times_s: Floats) -> Floats:
    """Cubic splines whose tangents at a key differ on its two sides."""
    inside = times_s.clip(keys_s[0], keys_s[-1])
    index = np.searchsorted(keys_s, inside, side="right").clip(1, len(keys_s) - 1) - 1
    found = np.empty((len(times_s), values.shape[1]))
    for piece in np.unique(index):
        ends = slice(piece, piece + 2)
        tangents = np.stack([out[piece], into[piece + 1]])
        spline = CubicHermiteSpline(keys_s[ends], values[ends], tangents)
        found[index == piece] = spline(inside[index == piece])
    return rot.normalize(found) if path == "rotation" else found


def _pelvis(document: GltfDocument, rig: Rig) -> int:
    """The bone from which the body hangs; `FormatError` if the bones' names are unknown."""
    names = ("", *rig.names)
    parents = np.concatenate([[-1], rig.parents + 1])
    try:
        return joint_roles(Skeleton(names, parents, np.zeros((len(names), 3))))["pelvis"] - 1
    except ParameterError as error:
        raise FormatError(f"{document.name}: {error}") from None


def _below(rig: Rig, top: int) -> list[int]:
    """A bone and all that hangs from it, parents first."""
    inside = {top}
    for bone in range(top + 1, rig.n_bones):
        if int(rig.parents[bone]) in inside:
            inside.add(bone)
    return sorted(inside)
