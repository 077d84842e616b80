"""glTF: reads the animations of a rig as takes, for any bind pose of its skin."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.counts import Counts, Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import STORE_FPS, frame_times_s
from choreograph.formats.axes_and_units import unit_m
from choreograph.formats.count_marks import marks_of
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.gltf_rig import GltfRig, Rig, read_rig, rotations_of, world_matrices
from choreograph.formats.writer import distinct
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import take_bones
from choreograph.motion.kinematics import to_local
from choreograph.motion.motion import LONGEST_S, MAX_FRAME_JOINTS, Credits, Motion, Take
from choreograph.motion.rigs import roles_by_names
from choreograph.motion.skeleton import Skeleton

# Key times (K,), values and interpolation by bone and property.
Tracks = dict[tuple[int, str], tuple[Floats, Floats, str]]

LAYOUT = "a single NAME.glb, .gltf or .vrma with animations of a skeleton"
READS_BONE_MAP = True
SUFFIXES = (".glb", ".gltf", ".vrma")
_MAX_ANIMATIONS = 4096
_BLOCK_POSES = 1 << 18  # frames × bones at a time
_LARGEST = 1e12  # position or scale in any unit, tested so that NaN fails
_ROUNDED_TIME = 2.0**-22  # of a step between two keys, relative to their time
_WIDTHS = {"rotation": 4, "translation": 3, "scale": 3}


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take]:
    """The animations as takes without music, named after the file and, if several, the animation."""
    read = _read_animations(path, bone_map)
    for name, one in read.items():
        own = path.stem if len(read) == 1 else f"{path.stem}-{name}"
        yield Take(
            own, one.motion, Credits(source=path.name), source_paths=(path,), notes=one.notes,
            counts=one.counts, figures=one.figures,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Animation:
    """An animation as it was read."""

    motion: Motion
    notes: tuple[str, ...]
    counts: Counts  # that are stated with it
    figures: tuple[Figure, ...]


def read_gltf_motions(
    path: str | Path, bone_map: Mapping[str, str] | None = None
) -> dict[str, tuple[Motion, tuple[str, ...]]]:
    """The animations of a glTF file by name: the motion of the rig from its hips down, and notes.

    Motions are at 60 fps, or at the rate of their keys if that is lower. Rotations are measured from the bind
    pose, which is the rest pose of the skeleton. If the names of the bones are unknown, or `bone_map` is
    given, the skeleton has `roles` for the bones that were found. Raises `FormatError` if the file is
    damaged, or has no animation or no body.
    """
    return {name: (one.motion, one.notes) for name, one in _read_animations(path, bone_map).items()}


def _read_animations(path: str | Path, bone_map: Mapping[str, str] | None) -> dict[str, _Animation]:
    """The animations of a file by name. Raises as `read_gltf_motions`."""
    document = read_gltf(path, images=False)
    animations = document.json.get("animations", [])
    if not animations:
        raise FormatError(f"{path}: expected an animation, got none: export it with its animations")
    if len(animations) > _MAX_ANIMATIONS:
        raise FormatError(f"{path}: expected at most {_MAX_ANIMATIONS} animations, got {len(animations)}")
    found = read_rig(document)
    reader = _TrackReader(document, {node: bone for bone, node in enumerate(found.nodes)})
    motions: dict[str, _Animation] = {}
    try:
        body = _Body.of(_with_human_names(found), bone_map)
        for number, animation in enumerate(animations):
            tracks = reader.tracks(animation)
            if tracks:  # other animations move a camera or a prop
                name = animation.get("name") or f"{number + 1}"
                while name in motions:
                    name = f"{name} {number + 1}"
                motions[name] = _Animation(*body.motion(tracks), *marks_of(document, animation))
    except (FormatError, ParameterError) as error:
        raise FormatError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
    if not motions:
        raise FormatError(f"{path}: expected an animation of the skeleton, got animations of other nodes")
    return motions


@dataclass(eq=False)
class _Body:
    """The bones of a rig from the hips down."""

    rig: Rig
    below: list[int]  # (J,) bones, the pelvis first
    skeleton: Skeleton  # in metres
    metres: float  # per unit of the file
    notes: tuple[str, ...]  # on the unit and the bones
    poses_left: int = MAX_FRAME_JOINTS  # frames × bones that further animations may have

    @classmethod
    def of(cls, rig: Rig, bone_map: Mapping[str, str] | None) -> _Body:
        """The body of a rig. Raises `FormatError` or `ParameterError` if there is none."""
        roles, found_note = take_bones(rig.posed, bone_map=bone_map)
        below, parents, offsets = rig.below(_pelvis(rig) if roles is None else roles["pelvis"])
        joint_of = {bone: joint for joint, bone in enumerate(below)}
        names = tuple(rig.names[bone] for bone in below)
        known = None if roles is None else {role: joint_of[bone] for role, bone in roles.items()}
        skeleton = Skeleton(names, parents, offsets, roles=known)
        metres, note = unit_m(skeleton, rig.bind_pos_m[None, below])
        notes = tuple(line for line in (found_note, note if metres != 1.0 else "") if line)
        return cls(rig, below, replace(skeleton, offsets_m=metres * offsets), metres, notes)

    def motion(self, tracks: Tracks) -> tuple[Motion, tuple[str, ...]]:
        """One animation, and notes on how the rig was read."""
        times_s, fps = _frame_times(tracks)
        self.poses_left -= len(times_s) * self.rig.n_bones
        if self.poses_left < 0:
            raise FormatError(f"expected at most {MAX_FRAME_JOINTS} frames of bones, got more: export parts")
        n_block = max(1, _BLOCK_POSES // self.rig.n_bones)
        blocks = [self._posed(tracks, times_s[at : at + n_block]) for at in range(0, len(times_s), n_block)]
        root, turned = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        quat = rot.make_continuous(to_local(self.skeleton, turned))
        return Motion(self.skeleton, self.metres * root, quat, fps), self.notes

    def _posed(self, tracks: Tracks, times_s: Floats) -> tuple[Floats, Floats]:
        """Positions of the pelvis (T, 3) and rotations of the bones from their bind pose (T, J, 4)."""
        rig, n_frames = self.rig, len(times_s)
        local = {"translation": rig.rest_translation, "rotation": rig.rest_quat, "scale": rig.rest_scale}
        sampled = {path: np.repeat(rest[:, None], n_frames, axis=1) for path, rest in local.items()}
        for (bone, path), (keys_s, values, kind) in tracks.items():
            sampled[path][bone] = _sampled(keys_s, values, kind, path, times_s)
        with np.errstate(over="ignore", invalid="ignore"):
            world = world_matrices(
                rig.parents, sampled["translation"], sampled["rotation"], sampled["scale"]
            )[self.below]  # (J, T, 4, 4)
        if not (np.abs(world) < _LARGEST).all():
            raise FormatError("expected bones at finite positions, got some that are too far: damaged?")
        now = np.moveaxis(rotations_of(world), 0, 1)
        return world[0, :, :3, 3], rot.multiply(now, rot.invert(rig.bind_quat[self.below]))


def _with_human_names(found: GltfRig) -> Rig:
    """The rig with the names of bones in VRM, if it has them. All names differ."""
    human = {bone: name for name, bone in found.human_bones.items()}
    names = [human.get(bone, name) for bone, name in enumerate(found.rig.names)]
    return replace(found.rig, names=distinct(names, form="{} #{}"))


class _TrackReader:
    """Reads the tracks of the animations of a document. Shared data is read once."""

    def __init__(self, document: GltfDocument, bone_of: dict[int, int]) -> None:
        self.document = document
        self.bone_of = bone_of  # node -> bone
        self.values_left = document.n_plausible_values
        self.arrays: dict[tuple[int, bool], Floats] = {}  # (accessor, whether of rotations) -> its values

    def tracks(self, animation: dict[str, Any]) -> Tracks:
        """The tracks of an animation that move bones, the first of each bone and property."""
        samplers = animation.get("samplers", [])
        tracks: Tracks = {}
        read: dict[tuple[int, str], tuple[Floats, Floats, str]] = {}  # by sampler and property
        for channel in animation.get("channels", []):
            target, index = channel.get("target", {}), channel.get("sampler", -1)
            bone, path = self.bone_of.get(target.get("node", -1)), target.get("path", "")
            if bone is None or path not in _WIDTHS or (bone, path) in tracks:
                continue
            if not 0 <= index < len(samplers):
                raise FormatError("expected a sampler for every channel: the file is damaged")
            if (index, path) not in read:
                read[index, path] = self._track(samplers[index], path)
            tracks[bone, path] = read[index, path]
        return tracks

    def _track(self, sampler: dict[str, Any], path: str) -> tuple[Floats, Floats, str]:
        kind = sampler.get("interpolation", "LINEAR")
        keys_s = self._array(sampler.get("input"))
        values = self._array(sampler.get("output"), of_rotations=path == "rotation")
        n_values = len(keys_s) * (3 if kind == "CUBICSPLINE" else 1)
        if keys_s.ndim != 1 or values.shape != (n_values, _WIDTHS[path]) or (np.diff(keys_s) < 0).any():
            raise FormatError(f"expected increasing keys with a {path} each: damaged")
        return keys_s, values, kind

    def _array(self, index: int | None, *, of_rotations: bool = False) -> Floats:
        """The values of an accessor, rotations as `wxyz`."""
        self.document.entry("accessors", index)
        key = index or 0, of_rotations
        if key not in self.arrays:
            self.values_left -= self.document.n_values(index)
            if self.values_left < 0:
                raise FormatError("expected keys of its own in each track, got data that is used too often")
            values = self.document.array(index)
            if not (np.abs(values) < _LARGEST).all():
                raise FormatError("expected finite keys and values: the file is damaged")
            self.arrays[key] = np.roll(values, 1, axis=-1) if of_rotations else values
        return self.arrays[key]


def _frame_times(tracks: Tracks) -> tuple[Floats, float]:
    """Frame times (T,) from the first key to the last, and their rate."""
    keys = [keys_s for keys_s, _, _ in tracks.values()]
    start_s, end_s = min(k[0] for k in keys), max(k[-1] for k in keys)
    if end_s - start_s > LONGEST_S:
        raise FormatError(f"expected an animation of up to an hour, got {end_s - start_s:.0f} s")
    longest = max(keys, key=len)
    native = _rate(longest) if (np.diff(longest) > 0).any() else STORE_FPS
    fps = min(STORE_FPS, round(native, 3)) if native >= 1.0 else STORE_FPS
    rounding = max(1e-3, _ROUNDED_TIME * end_s * fps)  # of the last key, in frames
    n_frames = 1 + int(np.floor((end_s - start_s) * fps + rounding))
    return start_s + frame_times_s(n_frames, fps), fps


def _rate(keys_s: Floats) -> float:
    """Keys a second, from the median step. Times have 32 bits, so that all steps together are more exact."""
    steps = np.diff(np.asarray(keys_s, np.float64))
    steps = steps[steps > 0]
    rate = 1.0 / float(np.median(steps))
    of_all = float(np.round(steps * rate).sum() / steps.sum())
    rounding = _ROUNDED_TIME * float(keys_s[-1]) * rate  # of a step, relative to it
    return of_all if abs(of_all / rate - 1.0) <= rounding else rate


def _sampled(keys_s: Floats, values: Floats, kind: str, path: str, times_s: Floats) -> Floats:
    """Values (T, D) at times (T,), interpolated as the format defines."""
    if kind == "CUBICSPLINE":
        into, values, out = np.moveaxis(values.reshape(len(keys_s), 3, -1), 1, 0)
        if len(keys_s) > 1 and (np.diff(keys_s) > 0).all():
            return _cubic(keys_s, values, into, out, path, times_s)
    later = np.searchsorted(keys_s, times_s, side="right").clip(1)  # (T,) the first key after each time
    if kind == "STEP":
        held: Floats = values[later - 1]
        return held
    after = later.clip(max=max(len(keys_s) - 1, 1))
    low, high = after - 1, after.clip(max=len(keys_s) - 1)
    gap = np.maximum(keys_s[high] - keys_s[low], 1e-9)
    weight = ((times_s - keys_s[low]) / gap).clip(0.0, 1.0)
    if path == "rotation":
        return rot.slerp(rot.normalize(values[low]), rot.normalize(values[high]), weight)
    mixed: Floats = values[low] + weight[:, None] * (values[high] - values[low])
    return mixed


def _cubic(keys_s: Floats, values: Floats, into: Floats, out: Floats, path: str, times_s: Floats) -> Floats:
    """Cubic Hermite splines whose tangents at a key differ on its two sides."""
    inside = times_s.clip(keys_s[0], keys_s[-1])
    low = np.searchsorted(keys_s, inside, side="right").clip(1, len(keys_s) - 1) - 1
    gap = (keys_s[low + 1] - keys_s[low])[:, None]
    u = (inside - keys_s[low])[:, None] / gap  # (T, 1) 0 to 1 between two keys
    found = (
        (1 + 2 * u) * (1 - u) ** 2 * values[low]
        + u * (1 - u) ** 2 * gap * out[low]
        + u**2 * (3 - 2 * u) * values[low + 1]
        + u**2 * (u - 1) * gap * into[low + 1]
    )
    return rot.normalize(found) if path == "rotation" else found


def _pelvis(rig: Rig) -> int:
    """The pelvis by the names of the bones. Raises `ParameterError` if they are unknown."""
    pelvis = roles_by_names(("", *rig.names), (-1, *(rig.parents + 1).tolist()))["pelvis"] - 1
    if pelvis < 0:
        raise ParameterError("expected one body, got limbs below different roots")
    return pelvis
