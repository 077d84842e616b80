"""Characters in glTF files (.glb, .gltf, .vrm): reads their rigs and adds dances as animations."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from choreograph.characters.performance import Performance, leg_m, perform, with_root_motion
from choreograph.core.arguments import as_list, check_kind, check_text
from choreograph.core.counts import Figure
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import default_numerics
from choreograph.core.progress import one_line
from choreograph.core.timebase import frame_times_s
from choreograph.formats.fbx import convert
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.gltf_rig import Rig, SkinPoints, read_rig, read_skin_points
from choreograph.motion.bone_map import find_bones
from choreograph.motion.hands import HandSpan, hand_spans
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, CANONICAL_PARENTS

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
