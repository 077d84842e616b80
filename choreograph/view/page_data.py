"""The content of a self-contained page: compressed motion and mesh, characters, scripts."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import frame_blocks, zigzag_encode
from choreograph.formats.gltf_document import GltfDocument
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS
from choreograph.motion.skinned_mesh import SkinnedMesh, build_mannequin, palette_of

# Compression of motion and mesh. `page/decompress.js` is the decoder.
#
# A motion is quantised to a table of integers with one row per channel: the root position in steps of half a
# millimetre, then the rotation vector of each joint in steps of 0.25 mrad. Its second differences in time are
# small. They are zigzag-encoded, split into a plane of low and one of high bytes, and deflated. Four minutes
# of 24 joints at 60 fps need about 0.9 MB in base64, with an error of a millimetre at the fingertips.


ROTVEC_STEP_RAD = 2.5e-4  # pi is 12,566 steps, so that any rotation fits into two bytes
_ROOT_STEP_M = 5e-4
_LARGEST = 32_000  # steps: fits into two bytes with a margin
_MAX_FPS = 60.0
_SMALLEST = 9  # the level of zlib for pages that are kept
_MAX_MOTION_BYTES = 2_200_000  # leaves room for the rest of the page within 3 MB


@dataclass(frozen=True)
class CompressedMotion:
    """A quantised, deflated motion and the parameters to decode it."""

    text: str  # base64 of deflated bytes
    fps: float
    n_frames: int
    root_step_m: float
    root_origin_m: tuple[float, ...]  # (3,)


def compress_motion(
    motion: Motion, *, max_bytes: int = _MAX_MOTION_BYTES, level: int = _SMALLEST
) -> CompressedMotion:
    """Compress at 60 fps or the rate of the motion if lower, halved until the text fits `max_bytes`.

    With a lower `level` of zlib, it is faster and the text is longer.
    """
    motion = motion.resampled(min(motion.fps, _MAX_FPS))
    compressed = _compressed(motion, level)
    while len(compressed.text) > max_bytes and motion.n_frames > 2:
        motion = motion.resampled(motion.fps / 2)
        compressed = _compressed(motion, level)
    return compressed


def _compressed(motion: Motion, level: int) -> CompressedMotion:
    origin = np.round((motion.root_pos_m.min(axis=0) + motion.root_pos_m.max(axis=0)) / 2, 3)
    root = motion.root_pos_m - origin
    root_step_m = max(_ROOT_STEP_M, float(np.abs(root).max()) / _LARGEST)
    n_channels = 3 + 3 * motion.skeleton.n_joints
    planes = np.empty((2, n_channels, motion.n_frames), np.uint8)  # of low and of high bytes
    before = np.zeros((n_channels, 2), np.int64)  # the last two frames before a block
    for block in frame_blocks(motion.n_frames):  # since the table of a long motion is large
        turns = rot.to_rotvec(motion.local_quat[block]).reshape(block.stop - block.start, -1)  # (T_b, 3J)
        table = np.concatenate([root[block] / root_step_m, turns / ROTVEC_STEP_RAD], axis=1)
        steps = np.concatenate([before, np.round(table.T).astype(np.int64)], axis=1)  # (3 + 3J, 2 + T_b)
        before = steps[:, -2:]
        # The differences wrap around, as the sums in the decoder do.
        folded = zigzag_encode(np.diff(steps, n=2, axis=1).astype(np.int16))
        planes[0, :, block], planes[1, :, block] = folded & 0xFF, folded >> 8
    return CompressedMotion(
        deflate_base64(planes.data, level), motion.fps, motion.n_frames, root_step_m,
        tuple(map(float, origin)),
    )  # fmt: skip


def compress_mesh(mesh: SkinnedMesh) -> tuple[str, dict[str, object]]:
    """The mesh as text, and the parameters that the page needs to decode it.

    The arrays are, in this order, positions (V, 3) int16 in steps of `step_m`, triangles (F, 3) uint32,
    joints (V, 2) uint16, first weights (V,) uint8 of 255, normals (V, 3) int8 of 127, parts (V,) uint8.
    """
    step_m = max(float(np.abs(mesh.vertices_m).max()) / _LARGEST, 1e-9)
    arrays: list[NDArray[Any]] = [
        np.round(mesh.vertices_m / step_m).astype("<i2"),
        mesh.triangles.astype("<u4"),
        mesh.joints.astype("<u2"),
        np.round(255 * mesh.weights[:, 0]).astype(np.uint8),
        np.round(127 * mesh.normals).astype(np.int8),
        mesh.parts.astype(np.uint8),
    ]
    text = deflate_base64(b"".join(array.tobytes() for array in arrays))
    numbers = {
        "vertices": len(mesh.vertices_m),
        "triangles": len(mesh.triangles),
        "step_m": step_m,
        "palette": np.round(mesh.palette, 4).tolist(),
        "bind_pos_m": np.round(mesh.bind_pos_m, 6).tolist(),
        "bind_quat": np.round(mesh.bind_quat, 8).tolist(),
    }
    return text, numbers


def deflate_base64(data: bytes | memoryview, level: int = _SMALLEST) -> str:
    """The bytes deflated, in base64."""
    return base64.b64encode(zlib.compress(data, level)).decode("ascii")


# Assembly of pages.


_OF_MODULES = re.compile(r"^(?:import \{[^{}]*\} from [^;\n]*;\n|export )", re.MULTILINE)


def page_part(name: str, *, package: str = "choreograph.view", folder: str = "page") -> str:
    """The text of a part of a page, from this package or another."""
    return (resources.files(package) / folder / name).read_text(encoding="utf-8")


def bundle_scripts(modules: Sequence[str]) -> str:
    """ES modules as one script without imports and exports. Each module follows those that it imports."""
    return "\n".join(_OF_MODULES.sub("", text) for text in modules)


def to_script_json(data: Any) -> str:
    """JSON that cannot end its script element, with any names of takes."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def fill_template(template: str, **parts: str) -> str:
    """The template with every `@@name@@` replaced. The inserted texts are not searched again."""
    return "".join(filled_pieces(template, **parts))


def filled_pieces(template: str, **parts: str) -> Iterator[str]:
    """The pieces of `fill_template` in order, since the sound of a long song is large."""
    for i, piece in enumerate(template.split("@@")):
        yield parts[piece] if i % 2 else piece


# The mannequin, or a character that three.js draws.
#
# Both have their own renderer in `page/`, with the same methods, and their own data. Only the page of a
# character contains three.js. `page/three/` has the bundle and the files to make it.


_MAX_CHARACTER_BYTES = 100_000_000  # decoded by browsers in some seconds, also on phones
_NEED_DECODERS = (
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_texture_basisu",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PageCharacter:
    """A character whose only animation is the dance."""

    document: GltfDocument
    nodes: Mapping[str, int]  # of its document by canonical joint, with hips and pelvis


@dataclass(frozen=True, eq=False)
class PageBody:
    """The data and scripts of a page that show the dancer."""

    facts: dict[str, Any]  # JSON
    data: dict[str, str]  # text by element
    scripts: tuple[str, ...]  # the last one opens the page
    sources: str = ""  # added to the page's security policy


def mannequin_body(motion: Motion, others: Sequence[Motion] = ()) -> PageBody:
    """The mannequin: its mesh and the compressed motion, and those of `others` in a scene.

    The others have the skeleton of the first one, of any size.
    """
    most = _MAX_MOTION_BYTES // (1 + len(others))
    compressed = compress_motion(motion, max_bytes=most)
    mesh, mesh_layout = compress_mesh(build_mannequin(motion.skeleton, motion))
    facts: dict[str, Any] = {
        "fps": compressed.fps,
        "frames": compressed.n_frames,
        "root_step_m": compressed.root_step_m,
        "root_origin_m": compressed.root_origin_m,
        "rotvec_step_rad": ROTVEC_STEP_RAD,
        "names": motion.skeleton.names,
        "parents": motion.skeleton.parents.tolist(),
        "offsets_m": np.round(motion.skeleton.offsets_m, 6).tolist(),
        "mesh": mesh_layout,
    }
    data = {"motion": compressed.text, "mesh": mesh}
    for number, other in enumerate(others, start=2):
        own = compress_motion(other, max_bytes=most)
        data[f"motion-{number}"] = own.text
        facts.setdefault("others", []).append(other_facts(own, other, number - 1, motion, mesh_layout))
    scripts = (
        "skeleton.js", "crowd.js", "skin.js", "webgl.js", "body.js", "shadows.js", "renderer.js", "main.js",
    )  # fmt: skip
    return PageBody(facts, data, scripts)


def other_facts(
    compressed: CompressedMotion, other: Motion, dancer: int, first: Motion, layout: dict[str, Any]
) -> dict[str, Any]:
    """What differs between another dancer of a scene and the first one."""
    size = float(np.abs(other.skeleton.offsets_m).sum() / np.abs(first.skeleton.offsets_m).sum())
    mesh = layout | {
        "step_m": layout["step_m"] * size,
        "bind_pos_m": np.round(np.array(layout["bind_pos_m"]) * size, 6).tolist(),
        "palette": np.round(palette_of(dancer), 4).tolist(),
    }
    return {
        "fps": compressed.fps,
        "frames": compressed.n_frames,
        "root_step_m": compressed.root_step_m,
        "root_origin_m": compressed.root_origin_m,
        "offsets_m": np.round(other.skeleton.offsets_m, 6).tolist(),
        "mesh": mesh,
    }


def character_body(character: PageCharacter, fps: float) -> PageBody:
    """A character as a GLB, and three.js with its licence. Raises as `check_page_character`."""
    check_page_character(character.document)
    glb = character.document.to_glb()
    if len(glb) > _MAX_CHARACTER_BYTES:
        raise ParameterError(_too_large(character.document.name, len(glb)))
    licence, code = (page_part(name, folder="page/three") for name in ("LICENSE", "three.min.js"))
    names = [name for name in CANONICAL_JOINTS if name in character.nodes]
    facts = {"fps": fps, "names": names, "nodes": [character.nodes[name] for name in names]}
    data = {"three": deflate_base64(f"/*\n{licence}*/\n{code}".encode()), "character": deflate_base64(glb)}
    scripts = ("figure.js", "character_renderer.js", "character_main.js")
    return PageBody(facts, data, scripts, " blob:; connect-src blob:")


def check_page_character(document: GltfDocument) -> None:
    """Raise `ParameterError` if a page cannot show the character. It is checked before there is a dance."""
    used = document.json.get("extensionsUsed", [])
    compressed = [name for name in _NEED_DECODERS if isinstance(used, list) and name in used]
    if compressed:
        raise ParameterError(
            f"{document.name}: expected plain meshes and textures for a page, got {', '.join(compressed)}: "
            "export the character without compression, or write a .glb"
        )
    if document.n_bytes > _MAX_CHARACTER_BYTES:
        raise ParameterError(_too_large(document.name, document.n_bytes))


def _too_large(name: str, n_bytes: int) -> str:
    return (
        f"{name}: expected at most {_MAX_CHARACTER_BYTES // 10**6} MB of character and dance for a page, got "
        f"{n_bytes // 10**6} MB: write a .glb, or make its textures smaller"
    )
