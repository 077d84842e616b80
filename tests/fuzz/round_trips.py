"""What was read is written by our writers and read again: it must be the same, within rounding."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from choreograph.choreography.constraints import read_signature, write_signature
from choreograph.core.counts import Counts, Figure
from choreograph.formats.axes_and_units import rotation_to_y_up, unit_m
from choreograph.formats.bvh import read_bvh
from choreograph.formats.gltf import read_gltf_motions
from choreograph.formats.manifest import read_counts, write_counts
from choreograph.formats.npz import read_npz
from choreograph.formats.register import save_motion
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion, Take
from choreograph.motion.skeleton import Skeleton
from choreograph.plan.plan import Plan

TOLERANCE = 1e-4  # of the largest distance from the origin and the longest bone, at least of a metre
_MAX_TAKES = 3  # of one file


def takes_again(takes: Iterable[Take], folder: Path) -> None:
    """Write and read the motions of some takes as NPZ, BVH and GLB."""
    for take in list(takes)[:_MAX_TAKES]:
        motion = take.motion
        save_motion(folder / "again.npz", motion)
        _assert_same_motion(read_npz(folder / "again.npz"), motion, "npz")
        pos_m = motion.joint_pos_m()
        # BVH states neither its unit nor what is up, and glTF is not always in metres: both are inferred.
        if unit_m(motion.skeleton, pos_m)[0] != 1.0 or rotation_to_y_up(motion.skeleton, pos_m)[1]:
            continue
        bone_map = _map_of(motion.skeleton)
        save_motion(folder / "again.bvh", motion)
        _assert_same_motion(read_bvh(folder / "again.bvh", bone_map=bone_map)[0], motion, "bvh")
        if motion.fps < 1.0:
            continue  # glTF states no rate: there are frames between keys over a second apart
        save_motion(folder / "again.glb", motion)
        ((again, _),) = read_gltf_motions(folder / "again.glb", bone_map=bone_map).values()
        _assert_same_motion(again, motion, "glb")


def _map_of(skeleton: Skeleton) -> dict[str, str] | None:
    """The map of a rig whose names do not say which joint is which, as a user gives it with --map."""
    if skeleton.roles is None:
        return None
    return {role: skeleton.names[joint] for role, joint in skeleton.roles.items()}


def _assert_same_motion(again: Motion, motion: Motion, where: str) -> None:
    assert again.n_frames == motion.n_frames, f"{where}: {again.n_frames} frames, not {motion.n_frames}"
    # One frame has no rate in glTF.
    same_fps = motion.n_frames == 1 or np.isclose(again.fps, motion.fps, rtol=1e-4)
    assert same_fps, f"{where}: {again.fps} fps, not {motion.fps}"
    pos_m, again_m = body_pos_m(motion), body_pos_m(again)
    apart_m, bone_m = np.abs(again_m - pos_m).max(), np.abs(motion.skeleton.offsets_m).max()
    largest_m = max(1.0, np.abs(pos_m).max(), bone_m)
    assert apart_m <= TOLERANCE * largest_m, f"{where}: joints are {apart_m:.2g} m apart"


def counts_again(read: tuple[Counts, tuple[Figure, ...]], folder: Path) -> None:
    """Write and read counts and figures."""
    counts, figures = read
    write_counts(folder / "again.counts.csv", counts, figures)
    again, again_figures = read_counts(folder / "again.counts.csv")
    np.testing.assert_allclose(again.times_s, counts.times_s, atol=1e-5)
    assert (again.numbers.tolist(), again.metre) == (counts.numbers.tolist(), counts.metre)
    assert [figure.name for figure in again_figures] == [figure.name for figure in figures]


def plan_again(plan: Plan, folder: Path) -> None:
    """Write and read a plan."""
    assert Plan.from_json(plan.to_json()) == plan


def signature_again(shares: tuple[float, ...], folder: Path) -> None:
    """Write and read a signature."""
    write_signature(folder / "again.json", np.array(shares), name="a", repertoire="a.h5")
    np.testing.assert_allclose(read_signature(folder / "again.json"), shares, atol=1e-9)
