"""`choreograph convert`, `retarget` and `count`, for one animation or song.

The first two write motions to other formats and characters. The last prints tempo, counts and loop points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from choreograph.cli.declared import Command, Input, Output, argument, option, unused_options, whole
from choreograph.cli.present import examples, say, show, show_notes, stages
from choreograph.core.arguments import unexpected
from choreograph.core.counts import ANNOTATED, DATA_SET, FROM_MOTION, FROM_MUSIC
from choreograph.core.errors import ParameterError
from choreograph.core.files import check_target
from choreograph.core.progress import counted as number_of
from choreograph.formats import motion_formats

if TYPE_CHECKING:
    from choreograph.characters.character import GltfCharacter
    from choreograph.core.counts import Figure
    from choreograph.formats.bvh import BvhOptions, Naming, RestPose
    from choreograph.formats.writer import TargetName
    from choreograph.motion.motion import Motion
    from choreograph.pipeline.counting import CountedFile, LoopPoints

AnyCommand = TypeVar("AnyCommand", bound=Callable[..., Any])
NAMINGS: tuple[Naming, ...] = ("smpl", "mixamo", "ue", "vrm", "humanoid", "rigify")
TARGET_NAMES: tuple[TargetName, ...] = ("unreal", "unity", "vrchat", "blender", "mmd", "godot")
RESTS: tuple[RestPose, ...] = ("t", "a")
UNITS = {"cm": 100.0, "m": 1.0}  # units of a .bvh, with their number per metre


def for_program(command: AnyCommand) -> AnyCommand:
    """Add the option of the program that a file is for. The function gets it as `target`."""
    shown = f"Program that the file is for: {', '.join(TARGET_NAMES)}."
    kind = click.Choice(TARGET_NAMES)
    added: AnyCommand = option(
        "--for", "target", type=kind, metavar="PROGRAM", saves="target", written="motions", help=shown
    )(command)
    return added


def bvh_options(command: AnyCommand) -> AnyCommand:
    """Add the options of BVH files. The function gets them by the names of `bvh_of`'s arguments."""
    bvh = partial(option, saves="bvh", written="motions")
    options = (
        bvh("--names", "naming", type=click.Choice(NAMINGS), help="Joint names (smpl)."),
        bvh("--units", type=click.Choice(tuple(UNITS)), help="Units (cm)."),
        bvh("--rest", type=click.Choice(RESTS), help="A standing rest pose: T or A."),
        bvh("--in-place", is_flag=True, help="The hips stay in one place."),
    )
    for one in reversed(options):
        command = one(command)
    return command


def bvh_of(naming: Naming | None, units: str | None, rest: RestPose | None, in_place: bool) -> BvhOptions:
    """The options of .bvh files."""
    from choreograph.formats.bvh import BvhOptions

    return BvhOptions(UNITS[units or "cm"], naming=naming or "smpl", in_place=in_place, rest=rest)


@click.command(
    cls=Command,
    short_help="Convert a motion to another format.",
    epilog=examples(
        "choreograph convert take.bvh take.glb     a body that moves, for Blender, Unreal, Godot, the web",
        "choreograph convert recording.c3d take.bvh",
        "choreograph convert take.bvh ue.bvh --names ue --fps 30",
        "choreograph convert walk.bvh salsa.glb clips.glb --for godot     an animation of each, in one .glb",
    ),
    help="Write MOTION, a file of any format that build-db reads, to OUTPUT.\n\n"
    f"The suffix selects the format: {', '.join(f'.{name}' for name in motion_formats())}. Several are "
    "animations of one body in a .glb, each with the name of its file. OUTPUT must be a new file, unless "
    "--force is given.",
)
@argument("motions", nargs=-1, required=True, type=Input("motion"), metavar="MOTION...")
@argument("output", type=Output())
@option(
    "--fps",
    type=click.FloatRange(1, 1000),
    saves="fps",
    written="motions",
    help="Frames per second. Default: MOTION's.",
)
@option("--map", "map_path", type=Input("map"), help="Map of the bones of MOTION (.json).")
@for_program
@bvh_options
@option("--force", is_flag=True, help="Replace OUTPUT if it exists.")
def convert(
    motions: tuple[Path, ...],
    output: Path,
    fps: float | None,
    map_path: Path | None,
    target: TargetName | None,
    naming: Naming | None,
    units: str | None,
    rest: RestPose | None,
    in_place: bool,
    force: bool,
) -> None:
    """Write motions to a file."""
    from choreograph.formats.bvh import BvhWriter
    from choreograph.formats.glb import clips_document
    from choreograph.formats.register import save_motion
    from choreograph.formats.writer import TARGETS, check_target_format, named_clips
    from choreograph.motion.bone_map import read_bone_map
    from choreograph.pipeline.saving import check_outputs, save_document

    if output.suffix.lower().removeprefix(".") not in motion_formats():
        raise unexpected(f"a file of {', '.join(f'.{name}' for name in motion_formats())}", str(output))
    check_outputs([output])
    if output.exists() and not force:
        raise ParameterError(
            f"expected a new file as OUTPUT, the last name, got {output}, which exists: name the output, or "
            "use --force to replace this file"
        )
    unused_options([output])
    _check_several(motions, output)
    if target is not None:
        check_target_format(target, output)
    bvh = bvh_of(naming, units, rest, in_place)
    bone_map = read_bone_map(map_path) if map_path else None
    moving = {path: motion_of(path, bone_map) for path in motions}
    if fps is not None:
        moving = {path: motion.resampled(fps) for path, motion in moving.items()}
    first = moving[motions[0]]
    if output.suffix.lower() == ".glb" and (len(motions) > 1 or target is not None):
        program = TARGETS[target] if target is not None else None
        clips = named_clips([(path.stem, motion) for path, motion in moving.items()], program)
        save_document(output, clips_document(clips, program))
        say(f"{output}: {_said_of(clips)}, {first.skeleton.n_joints} joints")
        return
    save_motion(output, first, writer=BvhWriter(bvh) if output.suffix.lower() == ".bvh" else None)
    say(f"{output}: {first.duration_s:.1f} s, {first.skeleton.n_joints} joints")


def _check_several(motions: Sequence[Path], output: Path) -> None:
    """Raise `ParameterError` for several motions of a file that holds one, or one that is named twice."""
    if len(motions) > 1 and output.suffix.lower() != ".glb":
        raise unexpected(f"a .glb for {len(motions)} motions", str(output))
    for path in motions:
        if motions.count(path) > 1:
            raise unexpected("each motion once", f"{path} again")


def _said_of(clips: Mapping[str, Motion]) -> str:
    """What was written: the names of clips, with their lengths."""
    return ", ".join(f"{name} {motion.duration_s:.1f} s" for name, motion in clips.items())


@click.command(
    cls=Command,
    short_help="Retarget a motion to a character.",
    epilog=examples(
        "choreograph retarget dance.bvh hero.glb -o out.glb",
        "choreograph retarget dance.bvh hero.glb -o out.glb --save-map map.json   which bones were found",
        "choreograph retarget dance.bvh hero.glb -o out.glb --map map.json        uses the edited map",
        "choreograph retarget walk.bvh salsa.bvh hero.glb -o out.glb              an animation of each",
    ),
)
@argument("motions", nargs=-1, required=True, type=Input("motion"), metavar="MOTION...")
@argument("character", type=Input("character"))
@option("-o", "--output", required=True, type=Output(), help="The character with the motion (.glb or .fbx).")
@option("--map", "map_path", type=Input("map"), help="Map of the bones, as written by --save-map (.json).")
@option("--save-map", type=Output(), help="Write the map of bones that were found (.json), to be edited.")
@for_program
def retarget(
    motions: tuple[Path, ...],
    character: Path,
    output: Path,
    map_path: Path | None,
    save_map: Path | None,
    target: TargetName | None,
) -> None:
    """Retarget MOTION, a file of any format that build-db reads, to CHARACTER (.glb, .gltf, .vrm or .fbx).

    Several are animations of the character in a .glb, each with the name of its file.
    """
    from choreograph.formats.writer import TARGETS, check_target_format, named_clips, placed
    from choreograph.pipeline.saving import check_outputs, save_on_character

    if output.suffix.lower() not in (".glb", ".fbx"):
        raise unexpected("a .glb or .fbx for the animated character", str(output))
    _check_several(motions, output)
    check_outputs([output])
    check_map_target(save_map)
    unused_options([output])
    if target is not None:
        check_target_format(target, output)
    figure = character_of(character, map_path)
    moving = [(path.stem, motion_of(path)) for path in motions]
    write_map(save_map, figure)
    known = f"{len(figure.bones)} bones of {figure.rig.n_bones} known"
    if len(moving) > 1 or target is not None:
        program = TARGETS[target] if target is not None else None
        clips = named_clips(moving, program)
        if program is not None:
            clips = {name: placed(motion, program) for name, motion in clips.items()}
        save_on_character(output, clips, figure)
        say(f"{output}: {_said_of(clips)}, {known}")
        return
    [(_, first)] = moving
    save_on_character(output, first, figure)
    say(f"{output}: {first.duration_s:.1f} s, {known}")


def character_of(path: Path, map_path: Path | None) -> GltfCharacter:
    """The character of a file, with the user's map."""
    from choreograph.characters.character import read_character
    from choreograph.motion.bone_map import read_bone_map

    return read_character(path, read_bone_map(map_path) if map_path else None)


def check_map_target(path: Path | None) -> None:
    """Raise `ParameterError` if no map of bones can be written to the path, which may be None."""
    if path is None:
        return
    if path.suffix.lower() != ".json":
        raise unexpected("a .json for --save-map", str(path))
    check_target(path)


def write_map(path: Path | None, character: GltfCharacter | None) -> None:
    """Write the map of bones of the character that were found, if a path is given."""
    from choreograph.motion.bone_map import write_bone_map

    if path is not None and character is not None:
        write_bone_map(path, character.rig.names, character.bones)


def motion_of(path: Path, bone_map: Mapping[str, str] | None = None) -> Motion:
    """The motion of a file with one take. Prints its notes. Raises `ParameterError` for several takes."""
    from choreograph.formats.register import read_take
    from choreograph.library.building.takes import check_map_fits

    take = read_take(path, bone_map=bone_map)
    if bone_map:
        check_map_fits([take], bone_map)
    show_notes(take.notes)
    return take.motion


# `choreograph count`.


_SOURCES = {
    ANNOTATED: "stated beside the file",
    DATA_SET: "stated by the data set",
    FROM_MUSIC: "tracked in the song",
    FROM_MOTION: "estimated from the motion",
}


@click.command(
    cls=Command,
    short_help="Count an animation or a song.",
    epilog=examples(
        "choreograph count walk.glb                    tempo, count 1 and loop points of an animation",
        "choreograph count song.mp3 -o song.txt        and its counts as labels for a sound editor",
        "choreograph count dance.bvh -o dance.counts.csv --json",
        "choreograph count walk.glb -o walk-counted.glb        with its counts in the animation",
    ),
)
@argument("file", type=Input("motion"))
@option(
    "-o", "--output", type=Output(), metavar="FILE",
    help="Write the counts: a table (.csv), JSON (.json), labels of Audacity (.txt), or the animation with "
    "its counts (.glb, .usda, .usdc).",
)  # fmt: skip
@option("--json", "as_json", is_flag=True, help="Print all facts as JSON.")
@option(
    "--beats", type=Input("beats", whole), metavar="TRACKER|FILE",
    help="Tracker of a song's beats, or a file of them. Default: network.",
)  # fmt: skip
def count(file: Path, output: Path | None, as_json: bool, beats: str | None) -> None:
    """Print the tempo, the metre, the counts and the loop points of FILE, an animation or a song.

    Counts that are stated beside an animation are used. Otherwise a network estimates them from the motion,
    with the confidence that a count is right. The figures of an animation are those that are stated with it,
    and those of a song are its phrases, where the same letter means the same music.
    """
    from choreograph.library.songs import DEFAULT_BEATS
    from choreograph.pipeline.counting import count_file, save_counts

    with stages(quiet=as_json) as shown:
        shown.report("counting", 0, 0)
        counted = count_file(file, beats=beats or DEFAULT_BEATS)
    if output is not None:
        save_counts(output, counted)
    lines = _text(counted)
    if output is not None:
        lines.append(f"{output}: {number_of(len(counted.counts), 'count')}")
    show(counted.facts(), lines, as_json=as_json)


def _text(counted: CountedFile) -> list[str]:
    counts = counted.counts
    about = f"{counted.name}: {counted.duration_s:.1f} s, a {counted.kind}"
    if counted.tempo_bpm is None:
        return [f"{about}, without a clear beat"]
    bars = f"{counts.metre} counts in a bar" if counts.has_bars else "bars are not known"
    lines = [
        f"{about} at {counted.tempo_bpm:.1f} BPM, {bars}",
        f"counts: {len(counts)}, {counts.times_s[0]:.2f} s to {counts.times_s[-1]:.2f} s, {_doubt(counted)}",
    ]
    if counts.has_bars:
        ones_s = counts.downbeat_times_s
        more = f" and {len(ones_s) - 4} more" if len(ones_s) > 4 else ""
        lines.append("count 1: " + ", ".join(f"{time_s:.2f}" for time_s in ones_s[:4]) + f" s{more}")
    lines += [_loop(loop, counted) for loop in counted.loops]
    return lines + [_figure(figure, counted) for figure in counted.figures]


def _doubt(counted: CountedFile) -> str:
    """The source of the counts and how certain they are."""
    counts = counted.counts
    source = _SOURCES.get(counts.source, "of an unknown source")
    if counts.source in (ANNOTATED, DATA_SET):
        return source
    doubt = "" if counted.is_sure else ", which is uncertain"
    return f"{source}, confidence {counts.confidence:.2f}{doubt}"


def _loop(loop: LoopPoints, counted: CountedFile) -> str:
    length = number_of(loop.n_counts, "count")
    if counted.counts.has_bars and loop.n_counts % counted.counts.metre == 0:
        length = number_of(loop.n_counts // counted.counts.metre, "bar")
    apart = f"poses {100 * loop.distance:.1f} cm apart"
    if counted.kind == "song":
        apart = f"music {loop.distance:.2f} apart, where 1 is any other place"
    return f"loop of {length}: {loop.start_s:.2f} s to {loop.end_s:.2f} s, {apart}"


def _figure(figure: Figure, counted: CountedFile) -> str:
    what = "figure" if counted.kind == "motion" else "phrase"
    length = number_of(figure.n_counts, "count")
    return f"{what} {figure.name}: {figure.start_s:.2f} s to {figure.end_s:.2f} s, {length}"
