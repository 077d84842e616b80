"""Retargeting of synthetic motions on other rigs, and of a real one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import on_other_axes, swaying

from choreograph.core.errors import ParameterError
from choreograph.formats.bvh import read_bvh
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles, rest_pose_is_upright
from choreograph.motion.contacts import estimate_floor_m, sole_pos_m
from choreograph.motion.kinematics import forward, to_local
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import Skeleton, canonical_skeleton


@pytest.mark.parametrize("seed", range(3))
def test_another_rest_pose_gives_the_same_positions(seed):
    motion = swaying(seed=seed)
    other = on_other_axes(motion, seed)
    assert np.allclose(other.joint_pos_m(), motion.joint_pos_m())  # the synthetic rig itself
    back = retarget(other, canonical_skeleton())
    assert np.linalg.norm(back.joint_pos_m() - motion.joint_pos_m(), axis=-1).max() < 0.01


def test_retargeting_onto_an_unusual_rig():
    motion = swaying()
    unusual = on_other_axes(motion, 5).skeleton
    retargeted = retarget(motion, unusual)
    assert np.abs(retargeted.joint_pos_m() - motion.joint_pos_m()).max() < 0.01


def test_the_twist_of_limbs_is_recovered():
    motion = swaying(240)
    back = retarget(on_other_axes(motion, 1), canonical_skeleton())
    for role in ("left_hip", "right_knee", "left_shoulder", "right_elbow", "pelvis", "spine3"):
        joint = motion.skeleton.index(role)
        dots = np.abs((back.local_quat[:, joint] * motion.local_quat[:, joint]).sum(-1))
        assert np.degrees(2 * np.arccos(np.clip(dots, 0, 1))).mean() < 12, role


def test_a_larger_body_keeps_directions_and_floor_and_scales_the_path():
    motion = swaying()
    body = motion.skeleton
    large = Skeleton(body.names, body.parents, body.offsets_m * 2, body.tip_parents, body.tips_m * 2)
    scaled = replace(motion, skeleton=large, root_pos_m=motion.root_pos_m * 2)
    assert np.allclose(retarget(scaled, body).joint_pos_m(), motion.joint_pos_m(), atol=0.01)


def test_rate_and_length_stay_and_signs_are_continuous():
    moved = retarget(on_other_axes(swaying(50, fps=24.0), 2), canonical_skeleton())
    assert (moved.n_frames, moved.fps) == (50, 24.0)
    assert ((moved.local_quat[1:] * moved.local_quat[:-1]).sum(-1) > 0).all()


def test_unknown_names_are_refused():
    body = canonical_skeleton()
    unnamed = Skeleton(tuple(f"b{i}" for i in range(24)), body.parents, body.offsets_m)
    with pytest.raises(ParameterError, match="known rig"):
        retarget(replace(swaying(), skeleton=unnamed), body)


def test_bandai_namco_keeps_every_limb_direction(shared_data):
    motion, _ = read_bvh(shared_data / "bvh" / "dance-short_normal_001.bvh")
    moved = retarget(motion, canonical_skeleton())
    before, after = motion.joint_pos_m(), moved.joint_pos_m()
    a, b = joint_roles(motion.skeleton), joint_roles(moved.skeleton)
    limbs = ("hip knee", "knee ankle", "ankle foot", "shoulder elbow", "elbow wrist")
    for start, end in (pair.split() for pair in limbs):
        for side in ("left", "right"):
            x = before[:, a[f"{side}_{end}"]] - before[:, a[f"{side}_{start}"]]
            y = after[:, b[f"{side}_{end}"]] - after[:, b[f"{side}_{start}"]]
            cos = (x * y).sum(-1) / np.linalg.norm(x, axis=-1) / np.linalg.norm(y, axis=-1)
            assert np.degrees(np.arccos(np.clip(cos, -1, 1))).max() < 0.1
    ankles = [f"{side}_ankle" for side in ("left", "right")]
    apart = before[:, [a[j] for j in ankles]] - after[:, [b[j] for j in ankles]]
    assert np.linalg.norm(apart, axis=-1).mean() < 0.05
    assert abs(estimate_floor_m(sole_pos_m(moved))) < 1e-6
    assert -0.05 < after[:, [b["left_foot"], b["right_foot"]], 1].min() < 0.05


def test_without_an_upright_rest_pose_soles_are_found_from_the_motion():
    motion = swaying(120)
    body = motion.skeleton
    rotation = rot.from_rotvec(np.array([0.0, 0.0, 1.3]))  # of all joints' axes: the rest pose lies down
    world = rot.multiply(forward(body, motion.root_pos_m, motion.local_quat)[1], rotation)
    back = rot.invert(rotation)
    lying = Skeleton(
        body.names,
        body.parents,
        rot.rotate(back, body.offsets_m),
        body.tip_parents,
        rot.rotate(back, body.tips_m),
    )
    moved = replace(motion, skeleton=lying, local_quat=to_local(lying, world))
    assert not rest_pose_is_upright(lying)
    assert estimate_floor_m(sole_pos_m(moved)) == pytest.approx(
        estimate_floor_m(sole_pos_m(motion)), abs=0.06
    )


def apart_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(np.sum(a * b, axis=-1), -1.0, 1.0)))


def forward_of(motion, role: str, front: np.ndarray) -> np.ndarray:
    """Where a joint looks, (T, 3); `front` (3,) in its rest pose."""
    _, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    return rot.rotate(quat[:, joint_roles(motion.skeleton)[role]], front)


def test_bandai_namco_keeps_gaze_and_spine(shared_data):
    """In this rig's rest pose the spine lies along +X and looks along +Y."""
    motion, _ = read_bvh(shared_data / "bvh" / "dance-short_normal_001.bvh")
    moved = retarget(motion, canonical_skeleton())
    for role in ("spine1", "spine3", "neck", "head"):
        before, after = forward_of(motion, role, np.eye(3)[1]), forward_of(moved, role, np.eye(3)[2])
        assert apart_deg(before, after).max() < 5.0, role


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("lean", [0.0, 0.4])
def test_gaze_and_spine_are_kept_however_the_neck_leans(seed, lean):
    """A rig like ours but for a neck that leans; and one whose joints have axes of their own."""
    motion = swaying(seed=seed)
    body = motion.skeleton
    offsets_m = np.array(body.offsets_m)
    offsets_m[body.index("head")] = 0.1 * np.array([0.0, np.cos(lean), np.sin(lean)])
    leaning = replace(motion, skeleton=replace(body, offsets_m=offsets_m))
    for source in (leaning, on_other_axes(motion, seed)):
        moved = retarget(source, canonical_skeleton())
        for role in ("spine3", "head"):
            before, after = (forward_of(one, role, np.eye(3)[2]) for one in (motion, moved))
            assert apart_deg(before, after).max() < 5.0, role


def test_another_order_of_joints_changes_nothing():
    """Dances are read back from BVH depth first: their hands and feet must not be guessed anew."""
    motion = swaying(30)
    skeleton = motion.skeleton
    order = [0]
    for joint in order:  # a stack in disguise: children right after their parent
        order[order.index(joint) + 1 : order.index(joint) + 1] = np.flatnonzero(
            skeleton.parents == joint
        ).tolist()
    place = {joint: at for at, joint in enumerate(order)}
    parents = [-1, *(place[int(skeleton.parents[joint])] for joint in order[1:])]
    names = tuple(skeleton.names[joint] for joint in order)
    tips = np.array([place[int(joint)] for joint in skeleton.tip_parents])
    deep = Skeleton(names, np.array(parents), skeleton.offsets_m[order], tips, skeleton.tips_m)
    assert names != skeleton.names
    back = retarget(replace(motion, skeleton=deep, local_quat=motion.local_quat[:, order]), skeleton)
    assert np.array_equal(back.local_quat, motion.local_quat)
    assert np.array_equal(back.root_pos_m, motion.root_pos_m)
    longer = replace(deep, offsets_m=deep.offsets_m * 1.1)
    assert longer.order_of(skeleton) is None and deep.order_of(on_other_axes(motion, 1).skeleton) is None


def test_pelvis_collars_and_feet_turn_as_the_sources_whatever_their_bones_point_to():
    motion = swaying(60)
    offsets_m = motion.skeleton.offsets_m.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        offsets_m[motion.skeleton.index(f"{side}_shoulder")] = sign * 0.1, -0.02, 0.04
        offsets_m[motion.skeleton.index(f"{side}_hip")] += 0.0, 0.03, -0.03
        offsets_m[motion.skeleton.index(f"{side}_foot")] += 0.0, -0.03, 0.0
    other = replace(motion, skeleton=replace(motion.skeleton, offsets_m=offsets_m))
    back = retarget(other, canonical_skeleton())
    for role in ("pelvis", "left_collar", "right_collar", "left_ankle", "right_foot"):
        turned = [
            forward(each.skeleton, each.root_pos_m, each.local_quat)[1][:, motion.skeleton.index(role)]
            for each in (motion, back)
        ]
        assert np.abs(np.sum(turned[0] * turned[1], axis=-1)).min() > np.cos(np.radians(1.0) / 2), role
