"""`choreograph convert` and `choreograph retarget`, which write motions to other formats and characters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from choreograph.cli.present import (
    Command,
    check_output_options,
    check_outputs_apart,
    examples,
    say,
    show_notes,
)
from choreograph.core.arguments import unexpected
from choreograph.core.files import check_target

if TYPE_CHECKING:
    from choreograph.characters.gltf_character import GltfCharacter
    from choreograph.formats.bvh import BvhOptions, Naming, RestPose
    from choreograph.motion.motion import Motion

AnyCommand = TypeVar("AnyCommand", bound=Callable[..., Any])
_FILE = click.Path(path_type=Path)
NAMINGS: tuple[Naming, ...] = ("smpl", "mixamo", "ue", "vrm", "humanoid", "rigify")
RESTS: tuple[RestPose, ...] = ("t", "a")
UNITS = {"cm": 100.0, "m": 1.0}  # units of a .bvh, with their number per metre


def bvh_options(command: AnyCommand) -> AnyCommand:
    """Add the options of BVH files. The function gets them by the names of `bvh_of`'s arguments."""
    options = (
        click.option("--names", "naming", type=click.Choice(NAMINGS), help="Joint names of a .bvh (smpl)."),
        click.option("--units", type=click.Choice(tuple(UNITS)), help="Units of a .bvh (cm)."),
        click.option("--rest", type=click.Choice(RESTS), help="A standing rest pose in a .bvh: T or A."),
        click.option("--in-place", is_flag=True, help="The hips stay in one place, in a .bvh."),
    )
    for option in reversed(options):
        command = option(command)
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
    ),
)
@click.argument("motion", type=_FILE)
@click.argument("output", type=_FILE)
@click.option("--fps", type=click.FloatRange(1, 1000), help="Frames per second. Default: MOTION's.")
@click.option("--map", "map_path", type=_FILE, help="Map of the bones of MOTION (.json).")
@bvh_options
def convert(
    motion: Path,
    output: Path,
    fps: float | None,
    map_path: Path | None,
    naming: Naming | None,
    units: str | None,
    rest: RestPose | None,
    in_place: bool,
) -> None:
    """Write MOTION, a file of any format that build-db reads, to OUTPUT.

    The suffix selects the format: .bvh, .npz, .glb, .vrma, .vmd, .usda, .usdc or .fbx.
    """
    from choreograph.formats import writers
    from choreograph.formats.bvh import BvhWriter
    from choreograph.formats.register import save_motion
    from choreograph.motion.bone_map import read_bone_map
    from choreograph.pipeline.saving import check_outputs

    if output.suffix.lower().removeprefix(".") not in writers():
        raise unexpected(f"a file of {', '.join(f'.{name}' for name in writers())}", str(output))
    check_outputs([output])
    check_outputs_apart([output], named_by=("output",))
    check_output_options([output])
    bvh = bvh_of(naming, units, rest, in_place)
    moving = motion_of(motion, read_bone_map(map_path) if map_path else None)
    if fps is not None:
        moving = moving.resampled(fps)
    save_motion(output, moving, writer=BvhWriter(bvh) if output.suffix.lower() == ".bvh" else None)
    say(f"{output}: {moving.duration_s:.1f} s, {moving.skeleton.n_joints} joints")


@click.command(
    cls=Command,
    short_help="Retarget a motion to a character.",
    epilog=examples(
        "choreograph retarget dance.bvh hero.glb -o out.glb",
        "choreograph retarget dance.bvh hero.glb -o out.glb --save-map map.json   which bones were found",
        "choreograph retarget dance.bvh hero.glb -o out.glb --map map.json        uses the edited map",
    ),
)
@click.argument("motion", type=_FILE)
@click.argument("character", type=_FILE)
@click.option(
    "-o", "--output", required=True, type=_FILE, help="The character with the motion (.glb or .fbx)."
)
@click.option("--map", "map_path", type=_FILE, help="Map of the bones, as written by --save-map (.json).")
@click.option("--save-map", type=_FILE, help="Write the map of bones that were found (.json), to be edited.")
def retarget(
    motion: Path, character: Path, output: Path, map_path: Path | None, save_map: Path | None
) -> None:
    """Retarget MOTION, a file of any format that build-db reads, to CHARACTER (.glb, .gltf, .vrm or .fbx)."""
    from choreograph.pipeline.saving import check_outputs, save_on_character

    if output.suffix.lower() not in (".glb", ".fbx"):
        raise unexpected("a .glb or .fbx for the animated character", str(output))
    check_outputs([output])
    check_map_target(save_map)
    check_outputs_apart([output, save_map], named_by=("output", "save_map"))
    figure = character_of(character, map_path)
    moving = motion_of(motion)
    write_map(save_map, figure)
    save_on_character(output, moving, figure)
    say(f"{output}: {moving.duration_s:.1f} s, {len(figure.bones)} bones of {figure.rig.n_bones} known")


def character_of(path: Path, map_path: Path | None) -> GltfCharacter:
    """The character of a file, with the user's map."""
    from choreograph.characters.gltf_character import read_character
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
