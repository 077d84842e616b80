"""Measures dances on characters, for research/results/characters.md.

A dance of 60 s is put on each character that the tests make. The script measures the bones found without a
map, the slide of its feet minus that of the dance, the distance of the lowest point of its skin from the
floor, the frames with a wrist inside the body, and the error of the round trip to the character and back,
with the turn of head and chest. Then it measures the files of all formats in Blender (with
CHOREOGRAPH_BLENDER) at 20 random frames, and the time to write them.

    PYTHONPATH=tests python research/characters.py song.mp3 [METARIG.glb …]

Further files are more characters, such as the metarig of Rigify with a skin.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
from gltf_worlds import inside_body, node_worlds, skinned_vertices_m
from heads_in_blender import bone_heads_m
from synthetic_characters import CHARACTERS, write_character

import choreograph as cg
from choreograph.characters.character import GltfCharacter, perform, read_character
from choreograph.core.errors import ChoreographError
from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.formats.fbx import find_blender
from choreograph.formats.gltf import read_gltf_motions
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import Skeleton, canonical_skeleton

FORMATS = ("bvh", "glb", "fbx", "usda", "usdc")


def leg_m(skeleton: Skeleton) -> float:
    rest = skeleton.rest_pos_m()
    chain = rest[[skeleton.index(f"left_{part}") for part in ("hip", "knee", "ankle")]]
    return float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum())


def gaze(motion: Motion, joint: str) -> np.ndarray:
    """Where a joint looks, (T, 3)."""
    _, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    return rot.rotate(quat[:, motion.skeleton.index(joint)], np.array([0.0, 0.0, 1.0]))


def row(character: GltfCharacter, dancer: Motion, folder: Path) -> list[str]:
    """A character's numbers, as cells."""
    performance = perform(dancer, character.rig, character.bones, character.skin)
    document, figure = character.with_animation(performance, "dance"), performance.motion
    size = leg_m(figure.skeleton) / leg_m(dancer.skeleton)
    slide = foot_slide_cm_s(body_pos_m(figure) / size, figure.fps)
    frames = np.arange(0, figure.n_frames, 20)
    lowest_mm = 1000 * skinned_vertices_m(document, node_worlds(document, frames))[..., 1].min(axis=1)
    wrists = [figure.joint_pos_m()[frames, figure.skeleton.index(f"{s}_wrist")] for s in ("left", "right")]
    inside = np.mean([inside_body(document, character, frames, wrist) for wrist in wrists])
    cells = [
        f"{len(character.bones)} of {character.rig.n_bones}",
        f"{slide / foot_slide_cm_s(body_pos_m(dancer), dancer.fps):.2f}" if slide else "",
        f"{np.percentile(lowest_mm, 5):.1f} … {np.percentile(lowest_mm, 95):.1f}",
        f"{inside:.3f}",
    ]
    (folder / "dancing.glb").write_bytes(document.to_glb())
    try:
        ((back, _),) = read_gltf_motions(folder / "dancing.glb").values()
    except ChoreographError:  # names that say nothing
        return [*cells, "", ""]
    ours = retarget(back, dancer.skeleton)
    apart_cm = 100 * np.linalg.norm(ours.joint_pos_m() - dancer.joint_pos_m(), axis=-1)
    turned = [np.sum(gaze(ours, joint) * gaze(dancer, joint), axis=-1) for joint in ("spine3", "head")]
    return [*cells, f"{apart_cm.mean():.2f}", f"{np.degrees(np.arccos(np.clip(turned, -1, 1))).max():.1f}"]


def in_blender(dance: cg.Dance, folder: Path) -> list[str]:
    """A line for each format: the largest distance of a joint from the dance's own, in millimetres."""
    frames = np.sort(np.random.default_rng(0).choice(dance.motion.n_frames, 20, replace=False))
    paths = [folder / f"dance.{suffix}" for suffix in FORMATS]
    for path in paths:
        dance.save(path)
    expected = dance.motion.joint_pos_m()[frames]
    lines = []
    for path, heads in zip(
        paths, bone_heads_m(paths, frames, dance.motion.fps, folder).values(), strict=True
    ):
        found = np.stack([heads[name] for name in dance.motion.skeleton.names], axis=1)
        off_mm = 1000 * np.linalg.norm(found - expected, axis=-1)
        lines.append(f"{path.suffix}: {off_mm.max():.3f} mm, {path.stat().st_size / 1e6:.2f} MB")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("song", type=Path)
    parser.add_argument("characters", type=Path, nargs="*")
    arguments = parser.parse_args()
    dance = cg.dance(arguments.song)
    dancer = retarget(dance.motion, canonical_skeleton())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind, spec in CHARACTERS.items():
            write_character(folder / f"{kind}.glb", spec)
        paths = [*(folder / f"{kind}.glb" for kind in CHARACTERS), *arguments.characters]
        print("| character | bones | slide | lowest, mm | wrist inside | round trip, cm | turned, degrees |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        for path in paths:
            print("|", " | ".join([path.stem, *row(read_character(path), dancer, folder)]), "|", flush=True)
        taken_s = []
        for _ in range(7):
            started_s = time.process_time()
            dance.save(folder / "out.glb", character=folder / "unreal.glb")
            taken_s.append(time.process_time() - started_s)
        print(
            f"\na dance of {dance.motion.duration_s:.0f} s on a character: {statistics.median(taken_s):.2f} s"
        )
        if find_blender() is not None:
            print("\n".join(in_blender(dance, folder)))


if __name__ == "__main__":
    main()
