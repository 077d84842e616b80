"""Who dances in a page: the mannequin, or a character of the user's that three.js draws.

Each has its own renderer in `page/`, behind the same few methods, and its own data. three.js is in the page
of a character only: `page/three/` has it bundled, and what rebuilds the bundle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from choreograph.errors import ParameterError
from choreograph.gltf import GltfDocument
from choreograph.mannequin.skinned_mesh import build_mannequin
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS
from choreograph.preview.compression import ROTVEC_STEP_RAD, compress_mesh, compress_motion, deflate_base64
from choreograph.preview.page_assembly import page_part

_MAX_CHARACTER_BYTES = 100_000_000  # browsers decode it in some seconds, and phones can hold it
_NEED_DECODERS = (
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_texture_basisu",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class PageCharacter:
    """A character, the dance its only animation."""

    document: GltfDocument
    nodes: Mapping[str, int]  # of its document, by canonical joint; hips and pelvis are among them


@dataclass(frozen=True, eq=False)
class PageBody:
    """What a page needs beside the dance's own facts to show who dances."""

    facts: dict[str, Any]  # JSON
    data: dict[str, str]  # element -> text
    scripts: tuple[str, ...]  # the last one opens the page
    sources: str = ""  # added to the page's security policy


def mannequin_body(motion: Motion) -> PageBody:
    """The mannequin: its mesh, and the motion compressed."""
    compressed = compress_motion(motion)
    mesh, mesh_layout = compress_mesh(build_mannequin(motion.skeleton, motion))
    facts = {
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
    scripts = ("skeleton.js", "skin.js", "renderer.js", "main.js")
    return PageBody(facts, {"motion": compressed.text, "mesh": mesh}, scripts)


def character_body(character: PageCharacter, fps: float) -> PageBody:
    """A character as a GLB, and three.js with its licence; `ParameterError` if a page cannot show it."""
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
    """Raise `ParameterError` if a page cannot show the character, before there is a dance for it."""
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
