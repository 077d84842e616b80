"""The preview page: one HTML file with the dance, its song and a player, for any browser, offline.

The page has its own small WebGL renderer for the mannequin (`page/renderer.js` and its imports, 600 lines). A
general engine would add 0.2 MB to every page to draw one skinned body, a floor and a shadow. Characters of
users, which have materials of any kind, are drawn by three.js.

The parts of the page are in `page/`: ES modules, which are bundled in the order of `_SCRIPTS`, a style sheet
and the template. Only the data differs between dances: JSON, and compressed bytes in base64.

The page has a read-only state for scripts, `window.choreograph`:

- time, duration, and shownFrom and shownTo of the timeline, in seconds, and audioTime, null without sound
- frame, fps, framesDrawn, and pixelScale, which is below 1 on slow machines
- playing, speed, loop {on, from, to}, mirrored, following
- shot, the name of the current shot of the cameras, or null without cameras or if the viewer has turned
- take, the name of the current take, and count, the current {bar, number} or null
- dancers, for each dancer of a scene its `joints`
- joints, J positions [x, y, z] in metres, as in `motion.joint_pos_m()`, or those of the bones of the
  character that are known, in canonical order
"""

from __future__ import annotations

import base64
import html
import json
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, check_apart, check_target
from choreograph.core.numerics import frame_blocks
from choreograph.core.progress import StepReport, part
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.writer import DANCE_GENERATOR
from choreograph.library.schema import zigzag_encode
from choreograph.motion import rotations as rot
from choreograph.motion.cameras import CameraPath
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS
from choreograph.motion.skinned_mesh import SkinnedMesh, build_mannequin, palette_of
from choreograph.plan.plan import Block, Plan, PlannedSecond
from choreograph.view.sound import Levels, encode_mp4, song_part

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


# The page of a dance.


_SCRIPTS = (
    "math.js", "decompress.js", "ground_path.js", "clock.js", "film.js", "camera.js", "shaders.js",
    "stage_colours.js", "resolution.js", "stage.js", "orbit.js", "colours.js", "gestures.js", "counts.js",
    "timeline.js", "elements.js", "card.js", "player.js", "controls.js", "page.js",
)  # fmt: skip
_STEPS = 100  # of its progress
_LEVELS_PER_S = 50
_NETWORK = "rollout network"  # shown instead of the name of a take
_WRITTEN_AT_ONCE = 1 << 20  # characters
_LENGTH_SLACK_S = 0.1  # the plan has the song's length, the motion a whole number of frames


def write_page(
    path: str | Path,
    motion: Motion,
    plan: Plan,
    *,
    song_path: str | Path | None,
    motion_beats_s: Sequence[float] | NDArray[np.floating],
    start_s: float | None = None,
    duration_s: float | None = None,
    title: str | None = None,
    character: PageCharacter | None = None,
    others: Sequence[Motion] = (),
    camera: CameraPath | None = None,
    report: StepReport | None = None,
) -> None:
    """Write the dance as one self-contained HTML file. The same dance gives the same bytes.

    Parameters
    ----------
    path : the file to write, atomically
    motion, plan : of one dance. The timeline shows the blocks of the plan
    song_path : the song file, whose danced part is embedded. None makes a silent page
    motion_beats_s : (Q,) increasing times in the dance
    start_s : start of the dance in the song file. None uses `start_s` of the plan
    duration_s : seconds to show from the start. None shows the whole motion
    title : heading of the page. None uses the name of the song
    character : the character that dances. None uses the mannequin
    others : further dancers of a scene on mannequins, with the length and the skeleton of `motion`
    camera : the cameras that film it, until the viewer turns the view. None follows the dancer
    report : called with the steps that are done and their total

    Raises
    ------
    ParameterError     if the folder is missing, motion and plan differ in length, a time is out of range, or
                       the character is compressed or larger than 100 MB
    FormatError        if the song cannot be read
    ChoreographError   if the disk is full or read-only
    """
    path = check_target(path)
    check_apart([path], [] if song_path is None else [song_path])
    beats_s = np.asarray(motion_beats_s, np.float64)
    if beats_s.ndim != 1 or not np.isfinite(beats_s).all() or (np.diff(beats_s) < 0).any():
        raise ParameterError("expected increasing finite motion_beats_s (Q,) in seconds")
    duration_s = _checked_duration(motion, plan, duration_s)
    start_s = plan.start_s if start_s is None else start_s
    if character is None:
        end = int(np.ceil(duration_s * motion.fps)) + 1
        shown_motions = [one.sliced(0, min(one.n_frames, end)) for one in (motion, *others)]
        body = mannequin_body(shown_motions[0], shown_motions[1:])
    else:
        body = character_body(character, motion.fps)
    if report is not None:
        report(30, _STEPS)
    sound, levels, levels_per_s = _sound(song_path, start_s, duration_s, part(report, 30, 95, _STEPS))
    title = title or plan.song or "Dance"
    shown = dance_facts(plan, duration_s, title=title, motion_beats_s=beats_s)
    head = {name: shown.pop(name) for name in ("title", "duration_s")}
    filmed = {} if camera is None else {"shots": camera_facts(camera)}
    dance = {**head, **body.facts, "levels_per_s": levels_per_s, **shown, **filmed}
    text = _page_text(title, body, to_script_json(dance), levels, sound)
    with (
        atomic_path(path) as temporary,
        temporary.open("w", encoding="utf-8", errors="replace", newline="\n") as file,
    ):
        for piece in text:
            for begin in range(0, len(piece), _WRITTEN_AT_ONCE):
                file.write(piece[begin : begin + _WRITTEN_AT_ONCE])
    if report is not None:
        report(_STEPS, _STEPS)


def dance_facts(
    plan: Plan, duration_s: float, *, title: str, motion_beats_s: Sequence[float] | NDArray[np.floating]
) -> dict[str, Any]:
    """What a page shows of a plan from its start to `duration_s`, as JSON: beats, takes and blocks.

    `motion_beats_s` (Q,) are times in the dance.
    """
    numbered = zip(plan.music_beats_s, plan.music_beat_numbers, strict=False)
    return {
        "title": title,
        "duration_s": round(duration_s, 6),
        "music_beats_s": _rounded(plan.music_beats_s, duration_s),
        # None if bars are not known.
        "music_beat_numbers": [number for time, number in numbered if 0 <= time <= duration_s],
        "metre": plan.metre,
        "motion_beats_s": _rounded(motion_beats_s, duration_s),
        **_sources(plan, duration_s),
    }


def camera_facts(camera: CameraPath) -> list[dict[str, Any]]:
    """The shots of a page's cameras, as JSON. Directions are fixed in a shot, so that targets follow."""
    return [
        {
            "name": shot.name,
            "start_s": round(shot.start_s, 4),
            "times_s": np.round(shot.times_s, 4).tolist(),
            "eyes": np.round(shot.eye_m, 3).tolist(),
            "sight": np.round(shot.target_m[0] - shot.eye_m[0], 4).tolist(),
        }
        for shot in camera.shots
    ]


def _checked_duration(motion: Motion, plan: Plan, duration_s: float | None) -> float:
    if abs(motion.duration_s - plan.duration_s) > _LENGTH_SLACK_S:
        raise ParameterError(
            f"expected the motion of the plan, got {motion.duration_s:.2f} s of motion and a plan of "
            f"{plan.duration_s:.2f} s: are they of different dances?"
        )
    if duration_s is None:
        return min(motion.duration_s, plan.blocks[-1].end_s)
    if not (np.isfinite(duration_s) and 0 < duration_s <= motion.duration_s + _LENGTH_SLACK_S):
        raise ParameterError(
            f"expected a duration of up to {motion.duration_s:.2f} s, its length, got {duration_s:g}"
        )
    return min(duration_s, motion.duration_s)


def _sound(
    song_path: str | Path | None, start_s: float, duration_s: float, report: StepReport | None
) -> tuple[str, str, float]:
    """The sound in base64, the levels of the waveform, and their rate in Hz."""
    if song_path is None:
        return "", "", float(_LEVELS_PER_S)
    levels = Levels(_LEVELS_PER_S)
    sound = encode_mp4(levels.through(song_part(song_path, start_s=start_s, duration_s=duration_s), report))
    # The peaks come before the RMS values, because similar neighbours are compressed better.
    planes = np.ascontiguousarray(levels.to_bytes().T)
    return base64.b64encode(sound).decode("ascii"), deflate_base64(planes.tobytes()), levels.bins_per_s


def _rounded(times_s: Sequence[float] | NDArray[np.floating], duration_s: float) -> list[float]:
    return [round(float(time), 4) for time in times_s if 0 <= time <= duration_s]


def _sources(plan: Plan, duration_s: float) -> dict[str, Any]:
    """The blocks of the timeline, and the table of takes that they refer to by index."""
    shown = [block for block in plan.blocks if block.start_s < duration_s]
    credits = {block.source: block.planned.credits for block in shown}
    names = sorted(credits)
    takes = [{"name": name or _NETWORK, **asdict(credits[name])} for name in names]
    index = {name: i for i, name in enumerate(names)}
    return {"takes": takes, "blocks": [_block(block, index[block.source], duration_s) for block in shown]}


def _block(block: Block, take: int, duration_s: float) -> dict[str, Any]:
    shown: dict[str, Any] = {
        "take": take,
        "start_s": round(block.start_s, 4),
        "end_s": round(min(block.end_s, duration_s), 4),
    }
    planned = block.planned
    if block.source:
        shown |= {"from_s": round(block.source_start_s, 3), "to_s": round(block.source_end_s, 3)}
        shown |= {
            "speed": round((block.source_end_s - block.source_start_s) / (block.end_s - block.start_s), 4)
        }
    if isinstance(planned, PlannedSecond):
        shown |= {"clip": planned.clip, "clip_start_s": round(planned.clip_start_s, 3)}
        return shown | {"costs": {name: round(cost, 4) for name, cost in planned.costs.items()}}
    if block.kept:
        return shown | {"kept": True, "costs": {}}
    shown |= {"mirrored": True} if planned.mirrored else {}
    return shown | {"motif": planned.motif, "pinned": planned.pinned, "costs": {}}


def _page_text(title: str, body: PageBody, dance: str, levels: str, sound: str) -> Iterator[str]:
    """Pieces of the page's template, filled."""
    elements = [f'<script type="text/plain" id="{name}">{text}</script>' for name, text in body.data.items()]
    return filled_pieces(
        page_part("index.html"),
        generator=DANCE_GENERATOR,
        title=html.escape(title),
        style=page_part("style.css"),
        dance=dance,
        sources=body.sources,
        body="\n".join(elements),
        levels=levels,
        sound=sound,
        script=bundle_scripts([page_part(name) for name in (*_SCRIPTS, *body.scripts)]),
    )
