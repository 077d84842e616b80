"""USD files: valid, reproducible, joints and skin where they belong, by USD's own library."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from synthetic_motions import on_other_axes, swaying

from choreograph.core.errors import ParameterError
from choreograph.core.files import sha256_of
from choreograph.formats.register import save_motion
from choreograph.formats.usd import UsdcWriter
from choreograph.motion.cameras import CameraPath, plan_cameras
from choreograph.motion.motion import Motion
from choreograph.motion.skinned_mesh import build_mannequin

pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
from pxr import Usd, UsdGeom, UsdSkel, UsdValidation, Vt  # noqa: E402

MOTIONS = {"upright": swaying(60, fps=24.0), "lying rest pose": on_other_axes(swaying(60, fps=60.0), 3)}
FRAMES = np.linspace(0, 59, 20).astype(int)


@pytest.fixture(params=MOTIONS)
def danced(request, tmp_path) -> tuple[Motion, Usd.Stage]:
    motion = MOTIONS[request.param]
    save_motion(tmp_path / "a.usdc", motion)
    return motion, Usd.Stage.Open(str(tmp_path / "a.usdc"))


def skeleton_query(stage: Usd.Stage) -> UsdSkel.SkeletonQuery:
    cache = UsdSkel.Cache()
    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache.Populate(root, Usd.PrimDefaultPredicate)
    return cache.GetSkelQuery(UsdSkel.Skeleton.Get(stage, root.GetPath().AppendChild("Skeleton")))


def test_no_validator_has_anything_to_say(danced):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    found = UsdValidation.ValidationContext(validators).Validate(danced[1])
    assert [error.GetMessage() for error in found] == []


def test_units_axis_and_time(danced):
    motion, stage = danced
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0 and UsdGeom.GetStageUpAxis(stage) == "Y"
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == motion.fps
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, motion.n_frames - 1)


def test_joints_are_where_ours_are(danced):
    motion, stage = danced
    query, pos_m = skeleton_query(stage), motion.joint_pos_m()
    assert list(UsdSkel.Skeleton(query.GetPrim()).GetJointNamesAttr().Get()) == list(motion.skeleton.names)
    for frame in FRAMES:
        moved = np.array(query.ComputeJointSkelTransforms(Usd.TimeCode(float(frame))))
        np.testing.assert_allclose(moved[:, 3, :3], pos_m[frame], atol=1e-4)


def test_the_skeleton_stands_as_the_mesh_is_bound(danced):
    """Validators miss empty and wrong bind transforms."""
    motion, stage = danced
    skeleton = UsdSkel.Skeleton(skeleton_query(stage).GetPrim())
    bind = np.array(skeleton.GetBindTransformsAttr().Get())
    rest = np.array(skeleton.GetRestTransformsAttr().Get())
    assert bind.shape == rest.shape == (motion.skeleton.n_joints, 4, 4)
    for joint, parent in enumerate(motion.skeleton.parents):
        above = np.eye(4) if parent < 0 else bind[parent]
        np.testing.assert_allclose(rest[joint] @ above, bind[joint], atol=1e-6)
    points = np.array(UsdGeom.Mesh.Get(stage, "/Dance/Body").GetPointsAttr().Get())
    assert points[:, 1].min() == pytest.approx(0.0, abs=1e-6)
    head = motion.skeleton.names.index("head")
    assert points[:, 1].max() > bind[head, 3, 1] > 1.3


def test_the_skin_moves_as_the_page_shows_it(danced):
    motion, stage = danced
    mesh = build_mannequin(motion.skeleton, motion)
    query = skeleton_query(stage)
    binding = UsdSkel.BindingAPI.Get(stage, "/Dance/Body")
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetDefaultPrim()), Usd.PrimDefaultPredicate)
    skinning = cache.GetSkinningQuery(binding.GetPrim())
    for frame in FRAMES[::5]:
        moved = query.ComputeSkinningTransforms(Usd.TimeCode(float(frame)))
        points = Vt.Vec3fArray(UsdGeom.Mesh(binding).GetPointsAttr().Get())
        assert skinning.ComputeSkinnedPoints(moved, points)
        # A vertex of one joint alone keeps its distance from the joint.
        alone = np.flatnonzero(mesh.weights[:, 0] == 1.0)
        joint = mesh.joints[alone, 0]
        own = np.linalg.norm(mesh.vertices_m[alone] - mesh.bind_pos_m[joint], axis=1)
        far = np.linalg.norm(np.array(points)[alone] - motion.joint_pos_m()[frame, joint], axis=1)
        np.testing.assert_allclose(far, own, atol=1e-3)


def test_every_triangle_has_a_material(danced):
    mesh = UsdGeom.Mesh.Get(danced[1], "/Dance/Body")
    subsets = UsdGeom.Subset.GetAllGeomSubsets(mesh)
    faces = np.concatenate([np.array(subset.GetIndicesAttr().Get()) for subset in subsets])
    assert sorted(faces) == list(range(len(mesh.GetFaceVertexCountsAttr().Get())))


@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_the_same_motion_gives_the_same_bytes(tmp_path, suffix):
    for name in ("a", "b"):
        save_motion(tmp_path / f"{name}.{suffix}", swaying(10))
    assert len({sha256_of(tmp_path / f"{name}.{suffix}") for name in ("a", "b")}) == 1
    assert (tmp_path / f"a.{suffix}").read_bytes()[:5] == (b"#usda" if suffix == "usda" else b"PXR-U")


def test_joints_of_any_name_are_written(tmp_path):
    motion = swaying(4)
    names = tuple(f"mixamorig:{name} 2" for name in motion.skeleton.names)
    save_motion(tmp_path / "a.usda", replace(motion, skeleton=replace(motion.skeleton, names=names)))
    query = skeleton_query(Usd.Stage.Open(str(tmp_path / "a.usda")))
    joints = list(query.GetJointOrder())
    assert all(joint.startswith("mixamorig_") for joint in joints) and len(set(joints)) == 24
    assert all(len(a) > 0 for a, _ in pairwise(joints))


def test_without_the_package_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ParameterError, match=r"pip install 'choreograph\[usd\]'"):
        save_motion(tmp_path / "a.usdc", swaying(4))
    assert not list(tmp_path.iterdir())


_WRITE_WITHOUT_ROOM = """
import resource, sys
from synthetic_motions import swaying
from choreograph.core.errors import ChoreographError
from choreograph.formats.register import save_motion
from choreograph.formats.usd import UsdcWriter
from choreograph.motion.cameras import CameraPath, plan_cameras
motion = swaying(60)
save_motion(sys.argv[1], motion)  # the first one loads the library
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))
try:
    save_motion(sys.argv[2], motion)
except ChoreographError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on the size of files")
@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_a_full_disk_is_one_line(tmp_path, suffix):
    """As a process of its own meets it: no file may grow beyond 3000 bytes."""
    target = tmp_path / f"b.{suffix}"
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-c", _WRITE_WITHOUT_ROOM, str(tmp_path / f"a.{suffix}"), str(target)],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert f"cannot write {target}: USD could not write it" in done.stdout
    assert [path.name for path in tmp_path.iterdir()] == [f"a.{suffix}"]


def test_the_camera_is_where_the_path_has_it(tmp_path):
    motion = MOTIONS["upright"]
    path = plan_cameras([motion], "cuts")
    path = CameraPath((*path.shots, replace(path.shots[0], start_s=2.5, times_s=np.array([2.5, 2.6]))))
    writer = UsdcWriter()
    writer.camera = path
    save_motion(tmp_path / "a.usdc", motion, writer=writer)
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    camera = UsdGeom.Camera.Get(stage, "/Dance/Camera")
    for time_s in (0.0, 1.0, 2.5):
        lens = camera.GetCamera(Usd.TimeCode(time_s * motion.fps))
        (eye,), (target,) = path.at([time_s])
        assert np.allclose(lens.transform.ExtractTranslation(), eye, atol=1e-6)
        sight = lens.transform.TransformDir((0, 0, -1))
        assert np.allclose(sight, (target - eye) / np.linalg.norm(target - eye), atol=1e-6)
        assert lens.GetFieldOfView(lens.FOVVertical) == pytest.approx(28.0, abs=1e-3)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetMessage() for error in found] == []
