"""Writes dances to files. The suffix of a name selects the format."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.characters.character import GltfCharacter
from choreograph.core.counts import Figure, bars_of
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path, atomic_path, check_apart, check_target, ends_of
from choreograph.core.progress import ProgressReport, substage
from choreograph.formats import formats_using, motion_formats, output_formats, writer_of
from choreograph.formats.bvh import DANCE_DIGITS, BvhOptions, BvhWriter
from choreograph.formats.fbx import convert
from choreograph.formats.glb import GlbWriter, as_dance, with_camera
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.register import get_writer, save_motion
from choreograph.formats.vmd import DANCE_MODEL, VmdWriter
from choreograph.formats.writer import TARGETS, TargetName, check_target_format, clip_name, placed, reads
from choreograph.motion.cameras import CameraPath
from choreograph.motion.motion import Motion
from choreograph.plan.plan import FORMAT as PLAN_FORMAT
from choreograph.plan.plan import Plan
from choreograph.plan.scenes import FORMAT as SCENE_FORMAT

if TYPE_CHECKING:
    from choreograph.view.page import PageCharacter

# The marks of dances near one end of a file: the generator, the frame time of a BVH, the model of a VMD, the
# format of a plan.
_SAVED_DANCE = re.compile(
    rb"choreograph [\w.+-]{1,32}: a d"  # the compression of .usdc leaves out "ance", which "/Dance" ends in
    rb"|\nMOTION\nFrames: \d+\nFrame Time: \d\.\d{10}" + DANCE_DIGITS.encode() + rb"\n"
    rb"|\0"
    + DANCE_MODEL.encode()
    + rb'|"format": "(?:'
    + PLAN_FORMAT.encode()
    + b"|"
    + SCENE_FORMAT.encode()
    + rb')"'
)
_STRIP_POSES = 40
_WIDE: dict[str, Any] = {"tile": (640, 220), "columns": 3}  # pictures of several dancers


@dataclass(frozen=True, eq=False)
class SavedParts:
    """A dance with the data that its files need."""

    motion: Motion  # the dance
    plan: Plan  # its plan
    motion_beats_s: Callable[[], NDArray[np.float64]]  # returns the motion beats, which only pages need
    song_path: Path | None  # file of the sound, if there is one
    with_clicks: bool = False  # on the counts, in a video
    character: GltfCharacter | None = None  # that dances instead of the mannequin
    bvh: BvhOptions | None = None  # options of a .bvh
    others: tuple[Motion, ...] = ()  # further dancers of a scene, in a video or in pictures
    camera: CameraPath | None = None  # that films it
    target: TargetName | None = None  # the program that it is for
    from_s: float = 0.0  # where the motion begins in the dance of the plan
    loops: bool = False  # whether the motion ends where it begins
    figures: tuple[Figure, ...] = ()  # that are danced, in its seconds, which say what hands do


def save_dance(path: str | Path, parts: SavedParts, report: ProgressReport | None = None) -> None:
    """Write a dance to `path` as motion, plan, page, video or picture, by its suffix.

    Raises `ParameterError` for an unknown suffix or a missing folder, `ChoreographError` if the file cannot
    be written, `FormatError` if the song can no longer be read.
    """
    check_outputs([path])
    character = parts.character
    read = [parts.song_path] if parts.song_path is not None else []
    check_apart([path], [*read, *([Path(character.document.name)] if character is not None else [])])
    suffix = format_of(path)
    if suffix in ("glb", "fbx") and character is not None:
        if parts.target is None:
            document = character.dancing(parts.motion, figures=parts.figures)
        else:
            target = TARGETS[parts.target]
            document = character.dancing(
                placed(parts.motion, target), _clip_name(parts, parts.target), parts.figures,
                root_motion=bool(target.root),
            )  # fmt: skip
        if suffix == "glb" and parts.camera is not None:
            document = with_camera(document, parts.camera)
        save_document(path, as_dance(document))
    elif suffix in motion_formats():
        writer = BvhWriter(parts.bvh) if suffix == "bvh" else get_writer(suffix)
        writer.is_dance, writer.camera = True, parts.camera
        if isinstance(writer, GlbWriter) and parts.target is not None:
            writer.target, writer.clip = TARGETS[parts.target], _clip_name(parts, parts.target)
        if isinstance(writer, VmdWriter):
            writer.figures = parts.figures
        sound = None
        if suffix == "vmd" and parts.target is not None and parts.song_path is not None:
            sound = sound_beside(path, [parts.song_path])
        save_motion(path, parts.motion, writer=writer)
        if sound is not None:
            _save_sound(parts, sound)
    else:
        resolve_name(output_formats()[suffix].saved_by)(parts, Path(path), report)


def sound_beside(path: str | Path, inputs: Sequence[Path]) -> Path:
    """The WAV file beside a .vmd, which players of MikuMikuDance load after it.

    Raises `ParameterError` if it is one of the `inputs`, or a file beside which there is no such dance.
    """
    sound = Path(path).with_suffix(".wav")
    check_apart([sound], inputs)
    if sound.exists() and not (Path(path).exists() and is_saved_dance(path)):
        raise ParameterError(
            f"expected no file {sound}, where the sound of {path} is written: use another -o"
        )
    return sound


def _save_sound(parts: SavedParts, path: Path) -> None:
    """Write the danced part of the song as WAV."""
    from choreograph.view.sound import song_part, write_wav

    assert parts.song_path is not None
    start_s = parts.plan.start_s + parts.from_s
    with atomic_path(path) as temporary:
        part = song_part(parts.song_path, start_s=start_s, duration_s=parts.motion.duration_s)
        write_wav(temporary, part)


def _clip_name(parts: SavedParts, target: TargetName) -> str:
    return clip_name(parts.plan.song, TARGETS[target], loops=parts.loops)


def save_on_character(
    path: str | Path, motion: Motion | Mapping[str, Motion], character: GltfCharacter
) -> None:
    """Write the character again, as GLB or FBX, with the motion as its animation. Raises as `save_dance`.

    Several motions by their names are animations of one .glb.
    """
    check_apart([path], [Path(character.document.name)])
    if isinstance(motion, Motion):
        save_document(path, character.dancing(motion))
    else:
        save_document(path, character.dancing_clips(motion))


def save_document(path: str | Path, document: GltfDocument) -> None:
    """Write a document as GLB, or as FBX by Blender. Raises `FormatError` if Blender fails."""
    content = document.to_glb()
    with atomic_path(path) as temporary:
        if format_of(path) != "fbx":
            temporary.write_bytes(content)
            return
        with TemporaryDirectory() as folder:
            glb, fbx = Path(folder) / "a.glb", Path(folder) / "a.fbx"
            glb.write_bytes(content)
            convert(glb, fbx)
            temporary.write_bytes(fbx.read_bytes())


def check_options(path: str | Path, given: Mapping[str, object]) -> None:
    """Raise `ParameterError` for an option of `Dance.save` that the format of a file does not use."""
    for name in (name for name, value in given.items() if value):
        if format_of(path) not in formats_using(name):
            users = ", ".join(f".{format}" for format in formats_using(name))
            raise ParameterError(f"expected a file among {users} for {name}, got {path}: leave out {name}")
    if (target := given.get("target")) is not None:
        check_target_format(str(target), path)


def options_used(path: str | Path, given: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the options of `Dance.save` that the format of a file uses."""
    used = {name: value for name, value in given.items() if format_of(path) in formats_using(name)}
    if used.get("target") is not None and not reads(used["target"], path):
        del used["target"]  # a .vmd beside a .glb for an engine, or the other way round
    return used


def check_outputs(paths: Sequence[str | Path]) -> None:
    """Raise `ParameterError` before any work if a format is unknown or a folder does not exist."""
    for path in paths:
        as_path("a file to write", path)
        format, formats = format_of(path), output_formats()
        if format not in formats:
            raise ParameterError(f"{path}: expected a format among {', '.join(formats)}, got {format!r}")
        if format in motion_formats():
            writer_of(format).check(path)
        check_target(path)


def is_saved_dance(path: str | Path) -> bool:
    """Whether a file is a dance that `save_dance` wrote, which another dance may replace.

    False for an .fbx, since Blender writes no such mark, and for a dance that another program saved.
    """
    return _SAVED_DANCE.search(ends_of(path)) is not None


def check_character(character: GltfCharacter, paths: Sequence[str | Path]) -> None:
    """Raise `ParameterError` before any work if one of the files is a page that cannot show the character."""
    from choreograph.view.page import check_page_character

    if any(format_of(path) == "html" for path in paths):
        check_page_character(character.document)


def format_of(path: str | Path) -> str:
    """The format that is written to a path: its suffix, in lower case and without the dot."""
    return Path(path).suffix.lower().removeprefix(".")


def save_plan(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    """Write the plan as JSON."""
    with atomic_path(path) as temporary:
        temporary.write_text(parts.plan.to_json(), encoding="utf-8")


def save_page(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    """Write the page to watch."""
    from choreograph.view.page import write_page

    if report is not None:
        report("writing the page", 0, 0)
    write_page(
        path, parts.motion, parts.plan, song_path=parts.song_path, motion_beats_s=parts.motion_beats_s(),
        character=None if parts.character is None else _in_page(parts.character, parts),
        others=parts.others, camera=parts.camera, report=substage(report, "writing the page"),
    )  # fmt: skip


def _in_page(character: GltfCharacter, parts: SavedParts) -> PageCharacter:
    from choreograph.view.page import PageCharacter

    nodes = {name: character.nodes[bone] for name, bone in character.bones.items()}
    return PageCharacter(character.dancing(parts.motion, figures=parts.figures), nodes)


def save_video(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    """Write the video."""
    from choreograph.view.sound import Clicks
    from choreograph.view.video import write_video

    plan = parts.plan
    clicks = Clicks(plan.music_beats_s, plan.music_beat_numbers) if parts.with_clicks else None
    write_video(
        path,
        parts.motion,
        others=parts.others,
        song_path=parts.song_path,
        start_s=plan.start_s,
        clicks=clicks,
        camera=parts.camera,
        report=report,
    )


def save_strip(parts: SavedParts, path: Path, report: ProgressReport | None) -> None:
    """Write the poses on the beats as a picture."""
    from choreograph.view.strip import write_strip

    plan, duration_s = parts.plan, parts.motion.duration_s
    shown_as: dict[str, Any] = {"others": parts.others, **(_WIDE if parts.others else {})}
    shown = _shown_beats(plan, duration_s)
    if len(shown) == 0:
        times_s = np.arange(0.0, duration_s)[:_STRIP_POSES]
        write_strip(path, parts.motion, times_s.tolist(), **shown_as)
        return
    labels = _labels(plan)
    times_s = np.array(plan.music_beats_s)[shown]
    write_strip(path, parts.motion, times_s.tolist(), labels=[labels[index] for index in shown], **shown_as)


def _shown_beats(plan: Plan, duration_s: float) -> NDArray[np.int64]:
    """Indices of at most `_STRIP_POSES` beats. If some must be left out, count 1 is kept."""
    beats = np.flatnonzero(np.array(plan.music_beats_s) <= duration_s)
    every = max(1, -(-len(beats) // _STRIP_POSES))
    ones = np.flatnonzero(np.array(plan.music_beat_numbers) == 1)
    if every == 1 or plan.metre == 0 or len(ones) == 0:
        return beats[::every]
    while every % plan.metre and plan.metre % every:
        every += 1
    return beats[ones[0] % every :: every]


def _labels(plan: Plan) -> list[str]:
    """The label under the pose of each beat: its time and its count, or its index."""
    if not plan.music_beat_numbers:
        return [f"beat {index + 1} · {time:.1f} s" for index, time in enumerate(plan.music_beats_s)]
    counts = zip(plan.music_beats_s, bars_of(plan.music_beat_numbers), plan.music_beat_numbers, strict=True)
    return [f"{time:.2f} s   bar {bar} · {number}" for time, bar, number in counts]
