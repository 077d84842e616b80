"""VMD: motions for the models of MikuMikuDance and similar programs.

A file has keys of bones by name and no skeleton. Motions are written and read on the body of
`formats.vmd_body`, which has the proportions of common models.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.budgets import BUDGETS
from choreograph.core.counts import Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import read_bytes
from choreograph.core.timebase import frame_times_s, seconds_to_frames
from choreograph.formats.vmd_body import (
    CENTRE,
    CENTRE_POS_M,
    FINGERS,
    LOWER,
    SIDES,
    UNIT_M,
    UNKEYED,
    UPPER,
    bend_leg,
    finger_turns,
    hinged_thigh,
    mirrored,
    standard_body,
)
from choreograph.formats.vmd_file import VMD_FPS, BoneKeys, VmdFile, linear_curves, parse_vmd, vmd_bytes
from choreograph.formats.writer import Writer
from choreograph.motion import rotations as rot
from choreograph.motion.hands import hand_spans, shape_shares
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Credits, Motion, Take, check_length
from choreograph.motion.retargeting import retarget

LAYOUT = "a single NAME.vmd of MikuMikuDance"
SUFFIXES = (".vmd",)
# The name of the model in files, of 20 bytes. The second one marks files that a new dance may replace.
MODEL, DANCE_MODEL = "choreograph", "choreograph: a dance"

# Bones between those of the body, which turn in the same place, in the order in which they apply.
_TWISTS = {"ひじ": ("腕捩",), "手首": ("手捩",), "肩": ("肩P",)}
_Transform = tuple[NDArray[np.float64], NDArray[np.float64]]  # positions (T, 3), rotations (T, 4)


def read(path: Path) -> Iterator[Take]:
    """The file as a take without music, named after it."""
    motion, notes = read_vmd(path)
    yield Take(path.stem, motion, Credits(source=path.name), source_paths=(path,), notes=notes)


def read_vmd(path: str | Path) -> tuple[Motion, tuple[str, ...]]:
    """Read a VMD file at 30 fps, on the standard body.

    Legs are moved by the IK of their feet while it is on and has keys, as in MikuMikuDance, and otherwise by
    their own rotations.

    Returns
    -------
    motion : Motion             metres, Y up
    notes : tuple of str        bones that are not read, in one line

    Raises
    ------
    ParameterError   if the file does not exist
    FormatError      if it is not a valid VMD, or moves no body
    """
    path = Path(path)
    if not path.exists():
        raise ParameterError(f"expected a VMD file at {path}, got nothing: there is no such file")
    data = read_bytes(path, "a VMD file", max_bytes=BUDGETS["vmd"].file_bytes)
    try:
        reader = _Reader(parse_vmd(data))
        return reader.motion(), reader.notes()
    except (FormatError, ParameterError) as error:
        raise FormatError(f"{path}: {error}") from None


class _Reader:
    """The motion of the keys in a file."""

    def __init__(self, file: VmdFile) -> None:
        self.file, self.body = file, standard_body()
        known = [name for name in _known_bones() if name in file.bones]
        if not known:
            raise FormatError(
                f"expected keys of MikuMikuDance's bones, such as {CENTRE} or {UPPER}, got "
                f"{len(file.bones)} other bones: a camera, a face, or a model with other names?"
            )
        n_frames = 1 + max(int(file.bones[name].frames[-1]) for name in known)
        check_length(n_frames, self.body.n_joints, VMD_FPS)
        self.frames = np.arange(n_frames, dtype=np.float64)  # (T,)

    def notes(self) -> tuple[str, ...]:
        """What was left out, and the body, in a line each."""
        fingers = {
            unicodedata.normalize("NFKC", f"{mark}{name}")
            for mark in SIDES.values()
            for names in FINGERS.values()
            for name in names
        }
        others = sorted(set(self.file.bones) - set(_known_bones()) - fingers)
        height = "on a body of 1.60 m, the size of common models, since the file has no skeleton"
        left = f"left out the keys of {len(others)} bones, such as {others[0]}" if others else ""
        return tuple(note for note in (height, left) if note)

    def motion(self) -> Motion:
        """The motion on the standard body."""
        waist_m, waist = self._waist()
        local = np.tile(rot.IDENTITY, (len(self.frames), self.body.n_joints, 1))  # (T, J, 4)
        for joint, name in enumerate(self.body.names):
            if name[1:] not in UNKEYED:
                local[:, joint] = self._local(name)
        local[:, 0] = rot.multiply(waist, local[:, 0])
        upper = self.body.index(UPPER)
        local[:, upper] = rot.multiply(rot.invert(local[:, 0]), rot.multiply(waist, local[:, upper]))
        for side in SIDES:
            self._bend_leg(side, waist_m, local)
        return Motion(self.body, waist_m, rot.make_continuous(local), VMD_FPS)

    def _keys(self, name: str) -> _Transform:
        """Positions in metres and rotations of a bone in its parent, those of the rest pose without keys."""
        keys = self.file.bones.get(name)
        if keys is None:
            return np.zeros((len(self.frames), 3)), np.tile(rot.IDENTITY, (len(self.frames), 1))
        pos, quat = mirrored(*keys.sampled(self.frames))
        return pos * UNIT_M, quat

    def _local(self, name: str) -> NDArray[np.float64]:
        """Rotations (T, 4) of a bone, with those of the bones between it and its parent."""
        quat = self._keys(name)[1]
        for twist in _TWISTS.get(name[1:], ()):
            quat = rot.multiply(self._keys(name[0] + twist)[1], quat)
        if name[1:] == "腕":  # it does not turn with the parent of the shoulder
            quat = rot.multiply(rot.invert(self._keys(f"{name[0]}肩P")[1]), quat)
        return quat

    def _below(self, parent: _Transform, name: str, offset_m: NDArray[np.float64]) -> _Transform:
        """The transform of a bone whose rest position is `offset_m` (3,) from that of its parent."""
        pos_m, quat = self._keys(name)
        return parent[0] + rot.rotate(parent[1], pos_m + offset_m), rot.multiply(parent[1], quat)

    def _root(self) -> _Transform:
        return self._keys("全ての親")

    def _waist(self) -> _Transform:
        """Positions of the waist and rotations of all bones above upper and lower body."""
        centre = self._below(self._root(), CENTRE, CENTRE_POS_M)
        groove = self._below(centre, "グルーブ", np.zeros(3))
        return self._below(groove, "腰", self.body.offsets_m[0] - CENTRE_POS_M)

    def _bend_leg(self, side: str, waist_m: NDArray[np.float64], local: NDArray[np.float64]) -> None:
        """Move a leg in `local` (T, J, 4) by the IK of its foot, in the frames in which it is on."""
        mark, body = SIDES[side], self.body
        if f"{mark}足IK" not in self.file.bones:
            return
        hip, knee, ankle, toe = (body.index(f"{mark}{part}") for part in ("足", "ひざ", "足首", "つま先"))
        ankle_m = body.rest_pos_m()[ankle]
        above_m = ankle_m * np.array([1.0, 0.0, 1.0])
        above = self._below(self._root(), f"{mark}足IK親", above_m)
        target_m, target = self._below(above, f"{mark}足IK", ankle_m - above_m)
        hip_m = waist_m + rot.rotate(local[:, 0], body.offsets_m[hip])
        thigh, bent = bend_leg(rot.multiply(local[:, 0], local[:, hip]), hip_m, target_m)
        shin = rot.multiply(thigh, bent)
        foot = rot.multiply(shin, local[:, ankle])  # (T, 4)
        along = rot.rotate(foot, np.broadcast_to(body.offsets_m[toe], target_m.shape))
        toe_m = target_m + rot.rotate(target, self._keys(f"{mark}つま先IK")[0] + body.offsets_m[toe])
        reached_m = hip_m + rot.rotate(thigh, body.offsets_m[knee]) + rot.rotate(shin, body.offsets_m[ankle])
        pointed = rot.multiply(rot.between(along, toe_m - reached_m), foot)
        foot = np.where(self._is_on(f"{mark}つま先IK")[:, None], pointed, foot)
        on = self._is_on(f"{mark}足IK")
        for joint, quat in (
            (hip, rot.multiply(rot.invert(local[:, 0]), thigh)),
            (knee, bent),
            (ankle, rot.multiply(rot.invert(shin), foot)),
        ):
            local[on, joint] = quat[on]

    def _is_on(self, name: str) -> NDArray[np.bool_]:
        """Whether the IK of a bone is on (T,), as it is before its first key."""
        on = np.ones(len(self.frames), bool)
        for frame, state in self.file.switches.get(name, ()):
            on[frame:] = state
        return on


def _known_bones() -> tuple[str, ...]:
    """The bones whose keys are read, in the form of names of `VmdFile`."""
    above = ("全ての親", CENTRE, "グルーブ", "腰")
    own = tuple(name for name in standard_body().names if name[1:] not in UNKEYED)
    limbs = ("腕捩", "手捩", "肩P", "足IK親", "足IK", "つま先IK")
    return (*above, *own, *(f"{mark}{name}" for mark in SIDES.values() for name in limbs))


class VmdWriter(Writer):
    """Writes a key of each bone in each frame, at 30 fps, for standard models of any size.

    A motion on another skeleton is retargeted to the standard body. Feet have IK, which is on, and legs have
    the rotations that the IK gives on that body. Knees bend about one axis, as in the models, and not
    backwards. In a dance, fingers are relaxed, or open or a fist in its `figures`.
    """

    format = "vmd"
    figures: Sequence[Figure] = ()  # that are danced, in seconds of the motion

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`. Raises `ParameterError` if its joint names are unknown."""
        body = standard_body()
        n_frames = max(1, seconds_to_frames(motion.duration_s, VMD_FPS))
        frames = frame_times_s(n_frames, VMD_FPS) * motion.fps
        motion = motion if motion.fps == VMD_FPS else motion.sampled_smooth(frames, fps=VMD_FPS)
        dancer = motion if motion.skeleton.same_as(body) else retarget(motion, body)
        keys = _bone_keys(on_hinges(dancer))
        if self.is_dance:
            keys |= _finger_keys(n_frames, self.figures)
        content = vmd_bytes(
            DANCE_MODEL if self.is_dance else MODEL,
            keys,
            [f"{mark}{name}" for name in ("足ＩＫ", "つま先ＩＫ") for mark in SIDES.values()],
        )
        path.write_bytes(content)


def on_hinges(motion: Motion) -> Motion:
    """The motion on the standard body with knees that bend about their X axis alone, and not backwards.

    Hips, ankles and feet do not move. Knees that bend backwards do.
    """
    body = motion.skeleton
    pos_m, world = forward(body, motion.root_pos_m, motion.local_quat)
    world = world.copy()
    for mark in SIDES.values():
        hip, knee, ankle = (body.index(f"{mark}{part}") for part in ("足", "ひざ", "足首"))
        bones = pos_m[:, knee] - pos_m[:, hip], pos_m[:, ankle] - pos_m[:, knee]
        thigh, bent = bend_leg(hinged_thigh(world[:, hip], *bones), pos_m[:, hip], pos_m[:, ankle])
        world[:, hip], world[:, knee] = thigh, rot.multiply(thigh, bent)
    return Motion(body, motion.root_pos_m, rot.make_continuous(to_local(body, world)), motion.fps)


def _bone_keys(motion: Motion) -> dict[str, BoneKeys]:
    """Keys of all bones that are written, by name, for a motion on the standard body."""
    body, local = motion.skeleton, motion.local_quat
    pos_m, world = forward(body, motion.root_pos_m, local)
    rest_m = body.rest_pos_m()
    still, unturned = np.zeros_like(motion.root_pos_m), np.tile(rot.IDENTITY, (motion.n_frames, 1))
    bones: dict[str, _Transform] = {CENTRE: (motion.root_pos_m - rest_m[0], unturned)}
    for joint, name in enumerate(body.names):
        if name[1:] not in UNKEYED:
            # The upper body is a child of the centre in a model, and of the lower body here.
            bones[name] = still, world[:, joint] if name in (LOWER, UPPER) else local[:, joint]
    for mark in SIDES.values():
        ankle = body.index(f"{mark}足首")
        bones[f"{mark}足ＩＫ"] = pos_m[:, ankle] - rest_m[ankle], world[:, ankle]
        bones[f"{mark}つま先ＩＫ"] = still, unturned
    return {name: _dense_keys(*of) for name, of in bones.items()}


def _dense_keys(pos_m: NDArray[np.float64], quat: NDArray[np.float64]) -> BoneKeys:
    """A key in each frame, or a single one for a bone that does not move."""
    moving = any(bool((values != values[0]).any()) for values in (pos_m, quat))
    n_keys = len(pos_m) if moving else 1
    pos, quat = mirrored(pos_m[:n_keys] / UNIT_M, rot.make_continuous(quat[:n_keys]))
    return BoneKeys(np.arange(n_keys), pos, quat, linear_curves(n_keys))


def _finger_keys(n_frames: int, figures: Sequence[Figure]) -> dict[str, BoneKeys]:
    """Keys of the bones of fingers, in the frames in which they begin, change, or come to rest."""
    shares = shape_shares(n_frames, VMD_FPS, hand_spans(figures))  # (T, S)
    changes = (np.diff(shares, axis=0) != 0.0).any(axis=1)  # (T - 1,)
    keyed = np.flatnonzero(np.append(changes, False) | np.insert(changes, 0, True))
    keys = {}
    for side in SIDES:
        for name, turns in finger_turns(side, shares[keyed]).items():
            pos, quat = mirrored(np.zeros((len(keyed), 3)), rot.make_continuous(turns))
            keys[name] = BoneKeys(keyed, pos, quat, linear_curves(len(keyed)))
    return keys


WRITERS = (VmdWriter,)
