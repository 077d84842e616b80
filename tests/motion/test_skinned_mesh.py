"""The mannequin on known and unknown rigs: closed surfaces, proportions, skinning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import on_other_axes, swaying

from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import rest_pose_is_upright
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton
from choreograph.motion.skinned_mesh import PARTS, SkinnedMesh, build_mannequin, skin_matrices
from choreograph.view.renderer import skinned

_MIXAMO = {
    "pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck",
    "head": "Head", "hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot": "ToeBase",
    "collar": "Shoulder", "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand",
}  # fmt: skip


def mixamo() -> Skeleton:
    """The canonical body without its hands, with Mixamo's names, with three fingers of two joints each."""
    body = canonical_skeleton()
    names, parents, offsets = [], [], []
    for name, parent, offset in zip(CANONICAL_JOINTS, body.parents, body.offsets_m, strict=True):
        if name.endswith("hand"):
            continue
        side, _, part = name.rpartition("_")
        names.append("mixamorig:" + side.title() + _MIXAMO[part])
        parents.append(parent)
        offsets.append(offset)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        for finger, across in (("Index", 0.03), ("Middle", 0.0), ("Pinky", -0.03)):
            wrist = names.index(f"mixamorig:{side}Hand")
            names += [f"mixamorig:{side}Hand{finger}1", f"mixamorig:{side}Hand{finger}2"]
            parents += [wrist, len(names) - 2]
            offsets += [[sign * 0.09, 0.0, across], [sign * 0.04, 0.0, 0.0]]
    return Skeleton(tuple(names), np.array(parents), np.array(offsets))


def with_tail() -> Skeleton:
    """The canonical body with two extra joints and a bone tip on the last."""
    body = canonical_skeleton()
    return Skeleton(
        (*body.names, "tail1", "tail2"),
        np.append(body.parents, [0, 24]),
        np.vstack([body.offsets_m, [0.0, 0.0, -0.2], [0.0, 0.0, -0.3]]),
        np.append(body.tip_parents, 25),
        np.vstack([body.tips_m, [0.0, 0.1, -0.2]]),
    )


def unknown() -> Skeleton:
    """A chain of joints without known names."""
    return Skeleton(("a", "b", "c"), np.array([-1, 0, 1]), np.array([[0, 0, 0], [0.5, 0, 0], [0, 0.4, 0.0]]))


SKELETONS = {"canonical": canonical_skeleton, "mixamo": mixamo, "tail": with_tail, "unknown": unknown}


def posed(mesh: SkinnedMesh, motion: Motion, frame: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """World vertices and normals in a frame of a motion."""
    pos, quat = forward(motion.skeleton, motion.root_pos_m, motion.local_quat)
    matrices = skin_matrices(mesh, pos[frame], quat[frame])
    return skinned(mesh, matrices)


@pytest.mark.parametrize("name", SKELETONS)
def test_arrays_fit_together(name):
    skeleton = SKELETONS[name]()
    mesh = build_mannequin(skeleton)
    n = len(mesh.vertices_m)
    assert mesh.vertices_m.shape == mesh.normals.shape == (n, 3)
    assert mesh.joints.shape == mesh.weights.shape == (n, 2) and mesh.parts.shape == (n,)
    assert mesh.triangles.min() >= 0 and mesh.triangles.max() < n
    assert mesh.joints.min() >= 0 and mesh.joints.max() < skeleton.n_joints
    assert np.allclose(mesh.weights.sum(axis=1), 1.0) and mesh.weights.min() >= 0
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
    assert mesh.palette.shape == (len(PARTS), 3) and set(mesh.parts) <= set(range(len(PARTS)))
    corners = mesh.parts[mesh.triangles]
    assert (corners == corners[:, :1]).all()  # a triangle belongs to one part


@pytest.mark.parametrize("name", SKELETONS)
def test_pieces_are_closed_and_face_outward(name):
    mesh = build_mannequin(SKELETONS[name]())
    # Merge vertices that differ only by part: every edge then has two triangles, one in each direction.
    _, same = np.unique(np.round(mesh.vertices_m, 6), axis=0, return_inverse=True)
    triangles = same.reshape(-1)[mesh.triangles]  # numpy 2.0.0 gives a column
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    edges = np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    forward_edges, counts = np.unique(edges, axis=0, return_counts=True)
    backward_edges, back_counts = np.unique(edges[:, ::-1], axis=0, return_counts=True)
    assert np.array_equal(forward_edges, backward_edges) and np.array_equal(counts, back_counts)
    a, b, c = (mesh.vertices_m[mesh.triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    agree = np.einsum("ij,ij->i", faces, mesh.normals[mesh.triangles].sum(axis=1))
    assert (agree > 0).mean() > 0.98
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0  # six times the volume


def test_size_of_the_mesh_and_of_the_body():
    mesh = build_mannequin(canonical_skeleton())
    assert 2000 <= len(mesh.triangles) <= 8000
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    assert 1.65 < high[1] - low[1] < 1.80
    assert 1.60 < high[0] - low[0] < 1.85  # the arms' span
    joints = mesh.bind_pos_m
    assert (low > joints.min(axis=0) - 0.25).all() and (high < joints.max(axis=0) + 0.25).all()


def test_left_and_right_mirror_each_other():
    mesh = build_mannequin(canonical_skeleton())
    for left, right in (("left_arm", "right_arm"), ("left_shoe", "right_shoe"), ("left_leg", "right_leg")):
        mine = mesh.vertices_m[mesh.parts == PARTS.index(left)]
        other = mesh.vertices_m[mesh.parts == PARTS.index(right)] * [-1.0, 1.0, 1.0]
        assert np.allclose(mine.min(axis=0), other.min(axis=0), atol=1e-4)
        assert np.allclose(mine.max(axis=0), other.max(axis=0), atol=1e-4)
        assert not np.allclose(mesh.palette[PARTS.index(left)], mesh.palette[PARTS.index(right)])


@pytest.mark.parametrize("name", ["canonical", "mixamo", "tail"])
def test_soles_lie_on_the_floor_of_the_rest_pose(name):
    skeleton = SKELETONS[name]()
    mesh = build_mannequin(skeleton)
    floor = skeleton.rest_pos_m()[
        [skeleton.parents.tolist().index(7), skeleton.parents.tolist().index(8)], 1
    ].min()
    for shoe in ("left_shoe", "right_shoe"):
        heights = mesh.vertices_m[mesh.parts == PARTS.index(shoe), 1]
        assert heights.min() == pytest.approx(floor, abs=1e-3)
        assert (heights < floor + 0.004).sum() >= 10  # flat, not a point
    assert mesh.vertices_m[:, 1].min() == pytest.approx(floor, abs=1e-3)


def test_face_and_toes_point_forward():
    mesh = build_mannequin(canonical_skeleton())
    skull = mesh.vertices_m[mesh.parts == PARTS.index("head")]
    nose = skull[skull[:, 2].argmax()]
    assert abs(nose[0]) < 0.01 and nose[2] > mesh.bind_pos_m[15, 2] + 0.08
    hair = mesh.vertices_m[mesh.parts == PARTS.index("hair")]
    brow = np.abs(hair[:, 1] - (nose[1] + 0.02)) < 0.03
    assert hair[brow, 2].max() < nose[2] - 0.02 and hair[brow, 2].min() < skull[:, 2].min()
    shoe = mesh.vertices_m[mesh.parts == PARTS.index("left_shoe")]
    ankle = mesh.bind_pos_m[7]
    assert shoe[:, 2].max() - ankle[2] > 2.5 * (ankle[2] - shoe[:, 2].min())


@pytest.mark.parametrize("name", SKELETONS)
def test_bind_pose_reproduces_the_mesh(name):
    skeleton = SKELETONS[name]()
    mesh = build_mannequin(skeleton)
    still = rot.IDENTITY * np.ones((1, skeleton.n_joints, 1))
    vertices, normals = posed(mesh, Motion(skeleton, skeleton.rest_pos_m()[:1], still, 30.0))
    assert np.allclose(vertices, mesh.vertices_m, atol=1e-5)
    assert np.allclose(normals, mesh.normals, atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(yaw=st.floats(-3.1, 3.1), x=st.floats(-5, 5), y=st.floats(-1, 1))
def test_the_mesh_moves_with_the_body(yaw, x, y):
    motion = swaying(3)
    mesh = build_mannequin(motion.skeleton)
    shift = np.array([x, y, 0.5])
    before, _ = posed(mesh, motion)
    after, _ = posed(mesh, motion.moved(yaw_rad=yaw, shift_m=shift))
    assert np.allclose(rot.rotate(rot.about_y(yaw), before.astype(np.float64)) + shift, after, atol=1e-4)


def test_a_bent_knee_keeps_its_girth():
    skeleton = canonical_skeleton()
    mesh = build_mannequin(skeleton)
    quat = np.tile(rot.IDENTITY, (1, 24, 1))
    quat[0, skeleton.index("left_knee")] = rot.from_rotvec(np.array([np.radians(100.0), 0.0, 0.0]))
    motion = Motion(skeleton, skeleton.rest_pos_m()[:1], quat, 30.0)
    leg = mesh.parts == PARTS.index("left_leg")
    pos = motion.joint_pos_m()[0]
    hip, knee, ankle = (pos[skeleton.index(f"left_{part}")] for part in ("hip", "knee", "ankle"))
    outward = -((hip - knee) / np.linalg.norm(hip - knee) + (ankle - knee) / np.linalg.norm(ankle - knee))
    outward /= np.linalg.norm(outward)
    reach = ((posed(mesh, motion)[0][leg] - knee) @ outward).max()
    assert reach > 0.04  # the knee cap is there, though the tube is folded


def test_extra_joints_get_bones_and_fingers_of_the_rig_replace_the_default_ones():
    tail = build_mannequin(with_tail())
    extra = tail.vertices_m[tail.parts == PARTS.index("extra")]
    assert extra[:, 2].min() < -0.6  # the end of the tail
    plain = build_mannequin(canonical_skeleton())
    assert not (plain.parts == PARTS.index("extra")).any()
    fingered = build_mannequin(mixamo())
    hand = fingered.vertices_m[fingered.parts == PARTS.index("left_hand")]
    assert hand[:, 0].max() < plain.vertices_m[plain.parts == PARTS.index("left_hand"), 0].max() - 0.04
    assert (fingered.parts == PARTS.index("extra")).any()


@pytest.mark.parametrize("scale", [0.4, 2.5])
def test_a_dwarf_and_a_giant_have_the_same_shape(scale):
    body = canonical_skeleton()
    scaled = Skeleton(body.names, body.parents, body.offsets_m * scale, body.tip_parents, body.tips_m * scale)
    assert np.allclose(
        build_mannequin(scaled).vertices_m, build_mannequin(body).vertices_m * scale, atol=1e-3 * scale
    )


@settings(max_examples=25, deadline=None)
@given(flat=st.sets(st.integers(1, 23)), scale=st.sampled_from([1.0, 1e-5, 0.0]))
@pytest.mark.filterwarnings("error")
def test_zero_length_bones_give_a_finite_mesh(flat, scale):
    body = canonical_skeleton()
    offsets = body.offsets_m * scale
    offsets[list(flat)] = 0.0
    mesh = build_mannequin(replace(body, offsets_m=offsets))
    assert np.isfinite(mesh.vertices_m).all() and np.isfinite(mesh.normals).all()
    bones = mesh.bind_pos_m[1:] - mesh.bind_pos_m[body.parents[1:]]
    assert np.allclose(np.linalg.norm(bones, axis=1), np.linalg.norm(offsets[1:], axis=1))


def test_rig_without_a_standing_rest_pose_looks_the_same():
    motion = swaying(120)
    lying = on_other_axes(motion, 0)
    assert not rest_pose_is_upright(lying.skeleton)
    mesh = build_mannequin(lying.skeleton, lying)
    wanted, _ = posed(build_mannequin(motion.skeleton), motion, 60)
    got, _ = posed(mesh, lying, 60)
    away = np.linalg.norm(got - wanted, axis=1)
    assert np.median(away) < 0.01 and away.max() < 0.12
    assert mesh.vertices_m[:, 1].argmax() == build_mannequin(motion.skeleton).vertices_m[:, 1].argmax()


def test_soles_of_such_a_rig_are_level_when_it_stands():
    body = canonical_skeleton()
    offsets = np.array(body.offsets_m)
    offsets[[10, 11]] = [0.0, -0.09, 0.09]  # lower than on the canonical body
    steep = Skeleton(body.names, body.parents, offsets, body.tip_parents, body.tips_m)
    sway = swaying(120)
    quat = np.array(sway.local_quat)
    quat[:, [0, 1, 2, 4, 5, 7, 8, 10, 11]] = rot.IDENTITY  # the trunk dances, the legs stand
    lying = on_other_axes(Motion(steep, sway.root_pos_m * 0 + [0.0, 1.0, 0.0], quat, sway.fps), 3)
    assert not rest_pose_is_upright(lying.skeleton)
    mesh = build_mannequin(lying.skeleton, lying)
    world, _ = posed(mesh, lying, 50)
    for shoe in ("left_shoe", "right_shoe"):
        sole = (mesh.parts == PARTS.index(shoe)) & (
            mesh.vertices_m[:, 1] < mesh.vertices_m[:, 1].min() + 1e-3
        )
        assert sole.sum() >= 10 and np.ptp(world[sole, 1]) < 0.012


def test_such_a_rig_stands_even_without_a_motion():
    body = canonical_skeleton()
    along_x = np.linalg.norm(body.offsets_m, axis=1)[:, None] * [1.0, 0.0, 0.0]
    mesh = build_mannequin(replace(body, offsets_m=along_x))
    roles = {name: mesh.bind_pos_m[i] for i, name in enumerate(body.names)}
    assert roles["head"][1] > roles["pelvis"][1] + 0.3 and roles["pelvis"][1] > roles["left_ankle"][1] + 0.5
    assert np.isfinite(mesh.vertices_m).all()
