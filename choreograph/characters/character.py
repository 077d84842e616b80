"""Characters in glTF files (.glb, .gltf, .vrm): their rigs, dances on them, and dances as their animations.

`perform` retargets a dance to a character: its bones, twist bones and IK bones. The bind pose of the
character and the rest pose of the canonical body are compared bone by bone. An A pose, another roll of a
bone, or a figure that faces elsewhere in its file makes no difference. Trunk, neck and head rotate like those
of the dancer and keep the posture of the figure. Arms and legs have the directions of the dancer's.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.characters.body import body_parts, keep_hands_out, placed_feet, sole_offsets_m, with_fingers
from choreograph.core.arguments import as_list, check_kind, check_text
from choreograph.core.counts import Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.progress import one_line
from choreograph.core.timebase import frame_times_s
from choreograph.formats.fbx import convert
from choreograph.formats.gltf import Rig, SkinPoints, read_rig, read_skin_points, rotations_of
from choreograph.formats.gltf_document import GltfDocument, read_gltf
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.bone_map import find_bones
from choreograph.motion.contacts import DANCE_SHIFT_S, foot_contacts, lock_feet
from choreograph.motion.hands import HandSpan, hand_spans
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import CANONICAL_JOINTS, CANONICAL_PARENTS, Skeleton, canonical_skeleton

# Helper bones. Twist bones share the roll of a limb, and IK bones follow hands and feet. Fingers
# have poses of their own. All others, such as those of faces, keep their local transforms.


_TWIST = re.compile(r"twist|roll", re.IGNORECASE)
_IK = re.compile(r"^ik_(foot|hand)_(l|r)$", re.IGNORECASE)  # Unreal's
_ROOT = re.compile(r"(?:^|[^a-z])root$", re.IGNORECASE)  # as "root", "Root" or "hero_root"
_IK_ROLES = {"foot": "ankle", "hand": "wrist"}
_SIDES = {"l": "left", "r": "right"}
# Bones of limbs. An upper bone has its roll from the bone above, a lower one from the bone at its end.
_UPPER = {"shoulder": "elbow", "hip": "knee"}
_LOWER = {"elbow": "wrist", "knee": "ankle"}
LIMB_ENDS = {
    f"{side}_{start}": f"{side}_{end}"
    for side in ("left", "right")
    for start, end in (_UPPER | _LOWER).items()
}


def twist_bones(rig: Rig, bones: Mapping[str, int]) -> dict[int, tuple[str, float]]:
    """Twist bones below limbs: the canonical name of the limb, and their place along it, 0 to 1."""
    known = set(bones.values())
    found = {}
    for bone, name in enumerate(rig.names):
        if bone in known or not _TWIST.search(name):
            continue
        for role, end in LIMB_ENDS.items():
            if bones.get(role) == rig.parents[bone] and end in bones:
                along = rig.bind_pos_m[bones[end]] - rig.bind_pos_m[bones[role]]
                place = (
                    (rig.bind_pos_m[bone] - rig.bind_pos_m[bones[role]]) @ along / max(along @ along, 1e-12)
                )
                found[bone] = role, float(np.clip(place, 0.0, 1.0))
    return found


def twist_turn(role: str, place: float, along: Floats, above: Floats, own: Floats, below: Floats) -> Floats:
    """World rotations (T, 4) of a twist bone from those of the bone above its limb, the limb and its end.

    All are rotations from the bind pose. `along` (3,) is the direction of the limb there. The roll of an
    upper limb grows along it from 0, and that of a lower limb grows towards its end.
    """
    if role.split("_")[1] in _UPPER:
        roll, share = rolled(rot.multiply(rot.invert(above), own), along), place - 1.0
    else:
        roll, share = rolled(rot.multiply(rot.invert(own), below), along), place
    return rot.multiply(own, rot.from_rotvec(share * rot.to_rotvec(roll)))


def rolled(quat: Floats, axis: Floats) -> Floats:
    """The part of rotations (T, 4) about an axis (3,)."""
    axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
    part = np.concatenate([quat[:, :1], (quat[:, 1:] @ axis)[:, None] * axis], axis=1)
    return rot.make_continuous(rot.normalize(part))


def ik_bones(rig: Rig, bones: Mapping[str, int]) -> dict[int, int]:
    """The bone of the hand or foot of each IK bone."""
    pairs = {}
    for bone, name in enumerate(rig.names):
        matched = _IK.match(name)
        if matched:
            role = f"{_SIDES[matched[2].lower()]}_{_IK_ROLES[matched[1].lower()]}"
            if role in bones:
                pairs[bone] = bones[role]
    return pairs


# The performance.


_SPINE = ("pelvis", "spine1", "spine2", "spine3")
_BALL_AHEAD, _TIP_AHEAD = 0.166, 0.27  # of the leg, from the ankle to the ball and the tip of a foot
_UP = np.array([0.0, 1.0, 0.0])
_FRONT = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Performance:
    """The motion of the bones of a character."""

    fps: float
    n_frames: int
    local_quat: dict[int, Floats]  # (T, 4) by bone
    translation: dict[int, Floats]  # (T, 3) by bone, in the units of its parent
    motion: Motion  # on the bones of the figure, in the world, with canonical names of known bones


def perform(
    motion: Motion,
    rig: Rig,
    bones: Mapping[str, int],
    skin: SkinPoints | None = None,
    hands: Sequence[HandSpan] = (),
) -> Performance:
    """The motion on a rig with the given `bones` by canonical joint. Hands stay out of its `skin`.

    Fingers, if there are any, have the shapes of `hands`, and are relaxed elsewhere.

    Raises `ParameterError` if bones of the body are not below the pelvis.
    """
    canonical = canonical_skeleton()
    dancer = motion if motion.skeleton.same_as(canonical) else retarget(motion, canonical)
    skeleton, bone_of_joint = figure_skeleton(rig, bones)
    facing = _facing(rig, bones)
    _, world = forward(canonical, dancer.root_pos_m, dancer.local_quat)  # (T, 24, 4)
    turned = _turned(world, skeleton, facing)
    figure, shift_m = placed_feet(
        dancer, Motion(skeleton, np.zeros_like(dancer.root_pos_m), turned, dancer.fps)
    )
    contacts = foot_contacts(body_pos_m(dancer), dancer.fps)
    figure = lock_feet(figure, contacts, shift_s=DANCE_SHIFT_S, feet_shift_m=shift_m)
    if skin is not None:
        front = rot.rotate(facing, _FRONT)
        figure = keep_hands_out(figure, body_parts(skeleton, bone_of_joint, skin, front), front)
    joint_of = {bone: joint for joint, bone in enumerate(bone_of_joint)}
    figure = with_fingers(_with_twist(figure, rig, bones, joint_of), rig, bones, joint_of, hands)
    return _on_bones(figure, rig, bones, joint_of)


def figure_skeleton(rig: Rig, bones: Mapping[str, int]) -> tuple[Skeleton, list[int]]:
    """The rig from its pelvis down as a skeleton, and the bone of each joint.

    Its rest pose is the bind pose, with identity rotations. Known joints have their canonical names.
    """
    order, parents, offsets = rig.below(bones["pelvis"])
    outside = [name for name, bone in bones.items() if bone not in order]
    if outside:
        raise ParameterError(f"expected all of the body below the pelvis, got {', '.join(outside)} elsewhere")
    joint_of = {bone: joint for joint, bone in enumerate(order)}
    role_of = {bone: role for role, bone in bones.items()}
    names = tuple(role_of.get(bone, f"#{bone}") for bone in order)
    tip_parents, tips = _soles(rig, bones, joint_of)
    return Skeleton(names, parents, offsets, tip_parents, tips), order


def _soles(
    rig: Rig, bones: Mapping[str, int], joint_of: Mapping[int, int]
) -> tuple[NDArray[np.int64], Floats]:
    """End sites at the soles: their joints (E,) and offsets (E, 3).

    They are below heel and ball of both feet, and below the tip of feet that cannot bend at the ball.
    """
    bends = {"left_foot", "right_foot"} <= bones.keys()
    parents, tips = [], []
    for side in ("left", "right"):
        ankle = bones[f"{side}_ankle"]
        ankle_m = rig.bind_pos_m[ankle]
        if bends:
            points_m = [ankle_m, rig.bind_pos_m[bones[f"{side}_foot"]]]
        else:
            along_m = leg_m(rig, bones, side) * rot.rotate(_facing(rig, bones), _FRONT)
            points_m = [ankle_m + share * along_m for share in (0.0, _BALL_AHEAD, _TIP_AHEAD)]
        parents += [joint_of[ankle]] * len(points_m)
        tips.append(sole_offsets_m(ankle_m, points_m, rig.floor_m))
    return np.array(parents), np.concatenate(tips)


def leg_m(rig: Rig, bones: Mapping[str, int], side: str) -> float:
    """Length of a leg along its bones in the bind pose."""
    hip, knee, ankle = (rig.bind_pos_m[bones[f"{side}_{part}"]] for part in ("hip", "knee", "ankle"))
    return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))


def _facing(rig: Rig, bones: Mapping[str, int]) -> Floats:
    """The rotation about Y (4,) from +Z to the direction that the figure faces in its bind pose."""
    left = rig.bind_pos_m[bones["left_hip"]] - rig.bind_pos_m[bones["right_hip"]]
    front = np.cross(left, _UP)
    if np.linalg.norm(front) < 1e-9:
        raise ParameterError("expected a character with hips side by side in its bind pose, got none")
    return rot.about_y(np.arctan2(front[0], front[2]))


def _alignments(skeleton: Skeleton, facing: Floats) -> Floats:
    """The rotations (J, 4) from the canonical rest pose to that of the figure, joint by joint.

    Joints of trunk and feet rotate only to the direction that the figure faces. Those of arms and legs also
    rotate from the direction of the canonical bone to that of the figure, after the rotation of their parent.
    """
    canonical, rest = canonical_skeleton(), skeleton.rest_pos_m()
    canonical_rest = canonical.rest_pos_m()
    aligned = np.tile(facing, (skeleton.n_joints, 1))
    for joint, name in enumerate(skeleton.names):
        if LIMB_ENDS.get(name) in skeleton.names:
            start, end = CANONICAL_JOINTS.index(name), CANONICAL_JOINTS.index(LIMB_ENDS[name])
            own = rest[skeleton.index(LIMB_ENDS[name])] - rest[joint]
            before = aligned[_known_parent(skeleton, joint)] if name.endswith(("knee", "elbow")) else facing
            bone = rot.rotate(before, canonical_rest[end] - canonical_rest[start])
            aligned[joint] = rot.multiply(rot.between(bone, own), before)
        elif name.endswith(("wrist", "hand")):
            aligned[joint] = aligned[_known_parent(skeleton, joint)]
        elif name.endswith(("ankle", "_foot")):
            aligned[joint] = rot.multiply(_toe_out(skeleton, name.split("_")[0], facing), facing)
    return aligned


def _toe_out(skeleton: Skeleton, side: str, facing: Floats) -> Floats:
    """The rotation about Y (4,) from the direction that the figure faces to that of a foot."""
    rest = skeleton.rest_pos_m()
    if f"{side}_foot" not in skeleton.names:
        return rot.IDENTITY
    foot = rest[skeleton.index(f"{side}_foot")] - rest[skeleton.index(f"{side}_ankle")]
    foot = rot.rotate(rot.invert(facing), foot)
    return rot.about_y(np.arctan2(foot[0], foot[2]))


def _known_parent(skeleton: Skeleton, joint: int) -> int:
    """The nearest ancestor that has a canonical name, or the root."""
    parent = int(skeleton.parents[joint])
    while parent > 0 and skeleton.names[parent] not in CANONICAL_JOINTS:
        parent = int(skeleton.parents[parent])
    return parent


def _turned(world: Floats, skeleton: Skeleton, facing: Floats) -> Floats:
    """Local rotations (T, J, 4) of the figure from world rotations (T, 24, 4) of the dancer."""
    back = rot.invert(_alignments(skeleton, facing))
    turned = np.empty((len(world), skeleton.n_joints, 4))
    spine = _spine_heights(skeleton)
    for joint, name in enumerate(skeleton.names):
        if joint in spine:
            low = min(int(spine[joint]), len(_SPINE) - 2)
            ends = [world[:, CANONICAL_JOINTS.index(part)] for part in _SPINE[low : low + 2]]
            source = rot.slerp(ends[0], ends[1], spine[joint] - low)
        elif name in CANONICAL_JOINTS:
            source = world[:, CANONICAL_JOINTS.index(name)]
        else:
            turned[:, joint] = turned[:, skeleton.parents[joint]]
            continue
        turned[:, joint] = rot.multiply(source, back[joint])
    return rot.make_continuous(to_local(skeleton, turned))


def _spine_heights(skeleton: Skeleton) -> dict[int, float]:
    """The joints of the spine, from above the pelvis, at places from 0 to 3 among the dancer's three."""
    path = [skeleton.index("left_shoulder")]
    while path[-1]:
        path.append(int(skeleton.parents[path[-1]]))
    other = {skeleton.index("right_shoulder")}
    joint = skeleton.index("right_shoulder")
    while joint:
        joint = int(skeleton.parents[joint])
        other.add(joint)
    trunk = [joint for joint in path[::-1] if joint in other and joint]
    return {joint: 3.0 * (i + 1) / len(trunk) for i, joint in enumerate(trunk)}


def _with_twist(figure: Motion, rig: Rig, bones: Mapping[str, int], joint_of: Mapping[int, int]) -> Motion:
    """The figure with the roll of its limbs shared among their twist bones."""
    skeleton = figure.skeleton
    _, turned = forward(skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 4)
    for bone, (role, place) in twist_bones(rig, bones).items():
        joint, end = skeleton.index(role), skeleton.index(LIMB_ENDS[role])
        along = rig.bind_pos_m[bones[LIMB_ENDS[role]]] - rig.bind_pos_m[bones[role]]
        above = turned[:, skeleton.parents[joint]]
        turned[:, joint_of[bone]] = twist_turn(role, place, along, above, turned[:, joint], turned[:, end])
    return replace(figure, local_quat=rot.make_continuous(to_local(skeleton, turned)))


def _on_bones(figure: Motion, rig: Rig, bones: Mapping[str, int], joint_of: Mapping[int, int]) -> Performance:
    """The motion of the figure as local transforms of the bones of the rig."""
    pos_m, turned = forward(figure.skeleton, figure.root_pos_m, figure.local_quat)  # (T, J, 3), (T, J, 4)
    world = rot.multiply(turned, rig.bind_quat[list(joint_of)])  # (T, J, 4)
    rest = rig.rest_world()
    pelvis = bones["pelvis"]
    local: dict[int, Floats] = {}
    for bone, joint in joint_of.items():
        parent = int(rig.parents[bone])
        over = world[:, joint_of[parent]] if parent in joint_of else _rotation_above(rest, parent)
        local[bone] = rot.make_continuous(rot.multiply(rot.invert(over), world[:, joint]))
    translation = {pelvis: _in_space_of(rest, int(rig.parents[pelvis]), pos_m[:, 0])}
    for bone, goal in ik_bones(rig, bones).items():
        parent, joint = int(rig.parents[bone]), joint_of[goal]
        if bone in joint_of or parent in joint_of:
            continue
        own = rot.multiply(turned[:, joint], rig.bind_quat[bone])
        local[bone] = rot.make_continuous(rot.multiply(rot.invert(_rotation_above(rest, parent)), own))
        offset = rot.rotate(turned[:, joint], rig.bind_pos_m[bone] - rig.bind_pos_m[goal])
        translation[bone] = _in_space_of(rest, parent, pos_m[:, joint] + offset)
    return Performance(figure.fps, figure.n_frames, local, translation, figure)


def with_root_motion(performance: Performance, rig: Rig, bones: Mapping[str, int]) -> Performance:
    """The performance, with the path of the hips on the floor in a bone named root above them.

    All bones stay where they are in the world. Without such a bone, nothing changes.
    """
    pelvis = bones["pelvis"]
    root = next((bone for bone in _above(rig, pelvis) if _ROOT.search(rig.names[bone])), None)
    if root is None:
        return performance
    rest, ground = rig.rest_world(), np.array([1.0, 0.0, 1.0])
    path_m = (performance.motion.root_pos_m - rig.bind_pos_m[pelvis]) * ground  # (T, 3)
    translation = {
        bone: pos - _along_axes_of(rest, int(rig.parents[bone]), path_m) if root in _above(rig, bone) else pos
        for bone, pos in performance.translation.items()
    }
    moved = _along_axes_of(rest, int(rig.parents[root]), path_m)
    return replace(performance, translation=translation | {root: rig.rest_translation[root] + moved})


def _above(rig: Rig, bone: int) -> list[int]:
    """The bones above one, from its parent to the root."""
    found = [int(rig.parents[bone])]
    while found[-1] >= 0:
        found.append(int(rig.parents[found[-1]]))
    return found[:-1]


def _along_axes_of(rest: Floats, parent: int, moved_m: Floats) -> Floats:
    """World displacements (T, 3) in the units and along the axes of a bone that the dance does not turn."""
    return moved_m if parent < 0 else moved_m @ np.linalg.inv(rest[parent])[:3, :3].T


def _rotation_above(rest: Floats, parent: int) -> Floats:
    """World rotation (1, 4) of a bone that the dance does not move, the identity if there is no bone."""
    return rotations_of(rest[parent])[None] if parent >= 0 else rot.IDENTITY[None]


def _in_space_of(rest: Floats, parent: int, pos_m: Floats) -> Floats:
    """World positions (T, 3) in the space of a bone that the dance does not move."""
    if parent < 0:
        return pos_m
    inverse = np.linalg.inv(rest[parent])
    return pos_m @ inverse[:3, :3].T + inverse[:3, 3]


# Characters in files.


_MOST_POINTS = 5000  # of a skin, of which the thickness is measured


@dataclass(frozen=True, eq=False)
class GltfCharacter:
    """A character with one skeleton, as `read_character` returns it.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, start_s=0.0, stop_s=2.0)
    >>> cg.save_motion("mannequin.glb", motion)
    >>> character = cg.read_character("mannequin.glb")
    >>> character.rig.n_bones, character.bones["left_knee"]
    (24, 4)
    >>> document = character.dancing(motion)
    >>> [animation["name"] for animation in document.json["animations"]]
    ['dance']
    """

    document: GltfDocument
    """The file."""

    rig: Rig
    """Its skeleton, of B bones."""

    nodes: tuple[int, ...]
    """(B,) index of each bone's node in the document."""

    bones: dict[str, int]
    """Bone by canonical joint, such as "left_knee"."""

    skin: SkinPoints
    """The points of its skin in the bind pose."""

    __repr__ = one_line

    @property
    def leg_m(self) -> float:
        """The mean length of both legs, from hip to ankle along the bones."""
        return sum(leg_m(self.rig, self.bones, side) for side in ("left", "right")) / 2

    @property
    def flesh_m(self) -> float:
        """How far the skin is from the bones of the body, in the bind pose: 99 of 100 points are nearer.

        Points beyond the ends of bones, such as those of hands, are left out. It is 0 without a skin.
        """
        ends = [(bone, self._above(joint)) for joint, bone in self.bones.items()]
        low, high = (self.rig.bind_pos_m[list(side)] for side in zip(*ends, strict=True))  # (S, 3)
        points_m = self.skin.pos_m[:: 1 + len(self.skin.pos_m) // _MOST_POINTS, None]  # (V, 1, 3)
        along = high - low
        share = ((points_m - low) * along).sum(axis=-1) / np.maximum((along * along).sum(axis=-1), 1e-12)
        away_m = np.linalg.norm(points_m - low - share.clip(0.0, 1.0)[..., None] * along, axis=-1)  # (V, S)
        if away_m.size == 0:
            return 0.0
        nearest = np.arange(len(away_m)), away_m.argmin(axis=1)
        beside = (share[nearest] > 0.0) & (share[nearest] < 1.0)
        return float(np.percentile(away_m[nearest][beside], 99)) if beside.any() else 0.0

    def _above(self, joint: str) -> int:
        """The bone of the nearest joint above one, or its own."""
        above = CANONICAL_PARENTS[CANONICAL_JOINTS.index(joint)]
        while above >= 0 and CANONICAL_JOINTS[above] not in self.bones:
            above = CANONICAL_PARENTS[above]
        return self.bones[CANONICAL_JOINTS[above] if above >= 0 else joint]

    def dancing(
        self,
        motion: Motion,
        name: str = "dance",
        figures: Sequence[Figure] = (),
        *,
        root_motion: bool = False,
    ) -> GltfDocument:
        """The document with a dance of the character as its only animation.

        Fingers, if it has any, are relaxed, or open or closed by the names of the `figures` that are danced.
        With `root_motion`, a bone named root above the hips has the path on the floor, if there is one.

        Raises `ParameterError` if the bones of the body are not all below the pelvis.
        """
        check_text("the name of an animation", name)
        check_kind("root_motion", root_motion, bool)
        figures = as_list("the figures of a dance", figures, "Figure", Figure)
        document = self._without_animations()
        performance = self._performed(motion, hand_spans(figures))
        if root_motion:
            performance = with_root_motion(performance, self.rig, self.bones)
        self._animate(document, performance, name)
        return document

    def dancing_clips(self, motions: Mapping[str, Motion]) -> GltfDocument:
        """The document with motions of the character, by their names, as its only animations.

        Raises `ParameterError` as `dancing`.
        """
        check_kind("motions by their names", motions, Mapping)
        document = self._without_animations()
        for name, motion in motions.items():
            self._animate(document, self._performed(motion), name)
        return document

    def _performed(self, motion: Motion, hands: Sequence[HandSpan] = ()) -> Performance:
        check_kind("a motion", motion, Motion)
        try:
            return perform(motion, self.rig, self.bones, self.skin, hands)
        except ParameterError as error:
            raise ParameterError(f"{self.document.name}: {error}") from None

    def with_animation(self, performance: Performance, name: str) -> GltfDocument:
        """The document with a performance as its only animation, called `name`."""
        document = self._without_animations()
        self._animate(document, performance, name)
        return document

    def _without_animations(self) -> GltfDocument:
        document = self.document.copy()
        document.json["animations"] = []
        return document

    def _animate(self, document: GltfDocument, performance: Performance, name: str) -> None:
        check_kind("a performance", performance, Performance)
        check_text("the name of an animation", name)
        tracks = [(self.nodes[b], "rotation", quat) for b, quat in performance.local_quat.items()]
        tracks += [(self.nodes[b], "translation", pos) for b, pos in performance.translation.items()]
        document.add_animation(name, frame_times_s(performance.n_frames, performance.fps), tracks)


@default_numerics()
def read_character(path: str | Path, bone_map: Mapping[str, str] | None = None) -> GltfCharacter:
    """Read a character, to be passed to `Dance.save`.

    Parameters
    ----------
    path : str or Path          a .glb, .gltf or .vrm file, or an .fbx file if Blender is installed
    bone_map : mapping of str   names of bones by canonical joint, instead of those that are found

    Returns
    -------
    character : GltfCharacter

    Raises
    ------
    FormatError      if the file cannot be read, or has no skeleton, two characters or over 4096 bones
    ParameterError   if its bones cannot be found, or an .fbx is given and Blender is not installed

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, start_s=0.0, stop_s=2.0)
    >>> cg.save_motion("mannequin.glb", motion)
    >>> character = cg.read_character("mannequin.glb")
    >>> sorted(character.bones)[:3]
    ['head', 'left_ankle', 'left_collar']
    """
    document = _document(as_path("a character", path))
    if not document.json.get("skins"):
        raise FormatError(f"{path}: expected a character with a skeleton, got none: export it with its skin")
    found = read_rig(document)
    try:
        bones = find_bones(found.rig.posed, found.human_bones, bone_map)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    return GltfCharacter(document, found.rig, found.nodes, bones, read_skin_points(document, found))


def _document(path: Path) -> GltfDocument:
    """The file as a glTF document."""
    if path.suffix.lower() != ".fbx":
        return read_gltf(path)
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / "character.glb"
        convert(path, converted)
        document = read_gltf(converted)
    document.name = str(path)
    return document
