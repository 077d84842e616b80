"""Writers of USD: the mannequin as a skinned mesh of UsdSkel, with its skeleton and animation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.formats.glb import camera_quat, linear_light
from choreograph.formats.gltf_document import KEY, SPANS, of_counts
from choreograph.formats.writer import DANCE_GENERATOR, GENERATOR, Writer, identifiers, text_names
from choreograph.motion import rotations as rot
from choreograph.motion.cameras import ASPECT, FOV_RAD, CameraPath
from choreograph.motion.kinematics import to_local
from choreograph.motion.motion import Motion
from choreograph.motion.skinned_mesh import PARTS, SkinnedMesh, build_mannequin, palette_of

if TYPE_CHECKING:
    from pxr import Usd


_ROOT = "/Dance"
ANIMATION_PATH = f"{_ROOT}/Skeleton/Animation"
_ROUGHNESS = 0.85
_FILM_MM = 36.0  # width of the camera's film
_REACH_M = 0.25  # of the mesh around its joints, for the bounds


class UsdaWriter(Writer):
    """Writes text, in metres with Y up, for usdview, Blender, Houdini, Maya and Unreal.

    It needs the extra `choreograph[usd]`.
    """

    format = "usda"

    @classmethod
    def check(cls, path: str | Path) -> None:
        """Raise `ParameterError` without the package."""
        require_usd(path)

    def write(self, motion: Motion, path: Path) -> None:
        """Write `motion`. Raises `ParameterError` without the package, `OSError` if writing fails."""
        require_usd(path)
        stage = dance_stage(motion)
        if self.camera is not None:
            _add_camera(stage, self.camera, motion.fps)
        export_stage(stage, path, DANCE_GENERATOR if self.is_dance else GENERATOR)


class UsdcWriter(UsdaWriter):
    """Writes the binary form, which has a sixth of the size."""

    format = "usdc"


def require_usd(path: str | Path) -> None:
    """Raise `ParameterError` if the package that writes `path` is not installed."""
    try:
        import pxr  # noqa: F401
    except ImportError:
        raise ParameterError(
            f"{path}: expected the package usd-core for USD, found none: pip install 'choreograph[usd]'"
        ) from None


def _empty_stage(motion: Motion) -> Usd.Stage:
    """A stage in memory, in metres with Y up, for the frames of a motion."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory(".usda")
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(motion.fps)
    stage.SetFramesPerSecond(motion.fps)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(float(motion.n_frames - 1))
    return stage


def dance_stage(motion: Motion) -> Usd.Stage:
    """The dance on a stage in memory. Time codes are frames, from 0."""
    from pxr import Sdf, UsdSkel

    mesh = build_mannequin(motion.skeleton, motion)
    floor_m = np.array([0.0, mesh.vertices_m[:, 1].min(), 0.0])
    stage = _empty_stage(motion)
    root = UsdSkel.Root.Define(stage, _ROOT)
    stage.SetDefaultPrim(root.GetPrim())
    root.CreateExtentAttr(_extent(motion.joint_pos_m().reshape(-1, 3)))
    joints = _joint_paths(motion)
    skeleton = _add_skeleton(stage, motion, mesh, floor_m, joints)
    animation = _add_animation(stage, motion, joints)
    body = _add_mesh(stage, mesh, floor_m)
    for prim in (skeleton.GetPrim(), body.GetPrim()):
        UsdSkel.BindingAPI.Apply(prim)
    UsdSkel.BindingAPI(skeleton).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    binding = UsdSkel.BindingAPI(body)
    binding.CreateSkeletonRel().SetTargets([Sdf.Path(f"{_ROOT}/Skeleton")])
    binding.CreateGeomBindTransformAttr(_matrix(np.zeros(3), rot.IDENTITY))
    binding.CreateJointIndicesPrimvar(False, 2).Set(mesh.joints.astype(np.int32).ravel())
    weights = np.stack([mesh.weights[:, 0], 1.0 - mesh.weights[:, 0]], axis=1)  # a sum of exactly 1
    binding.CreateJointWeightsPrimvar(False, 2).Set(weights.astype(np.float32).ravel())
    return stage


def scene_stage(
    motions: Sequence[Motion], names: Sequence[str], camera: CameraPath | None = None
) -> Usd.Stage:
    """Several dancers on one stage in memory, each as by `dance_stage` under a prim of its name.

    `motions` have one length and rate. The `camera` films them.
    """
    from pxr import Gf, Sdf, UsdGeom

    stage = _empty_stage(motions[0])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, _ROOT).GetPrim())
    for dancer, (motion, name) in enumerate(zip(motions, identifiers(tuple(names)), strict=True)):
        own = dance_stage(motion)
        path = f"{_ROOT}/{name}"
        Sdf.CopySpec(own.GetRootLayer(), Sdf.Path(_ROOT), stage.GetRootLayer(), Sdf.Path(path))
        for part, colour in zip(PARTS, linear_light(palette_of(dancer)), strict=True):
            shader = stage.GetPrimAtPath(f"{path}/Materials/{part}/Surface")
            if shader:
                shader.GetAttribute("inputs:diffuseColor").Set(Gf.Vec3f(*colour.tolist()))
    if camera is not None:
        _add_camera(stage, camera, motions[0].fps)
    return stage


def export_stage(stage: Usd.Stage, path: Path, comment: str = DANCE_GENERATOR) -> None:
    """Write a stage in the format of the suffix. Raises `OSError` if writing fails."""
    from pxr import Tf

    stage.GetRootLayer().comment = comment
    try:
        written = stage.GetRootLayer().Export(str(path))
    except Tf.ErrorException as error:
        raise OSError("USD could not write it: the disk is full, or writing is not allowed") from error
    if not written:
        raise OSError("USD could not write it")


def _joint_paths(motion: Motion) -> list[str]:
    """Paths of the joints in the form of UsdSkel, such as "pelvis/left_hip/left_knee"."""
    paths: list[str] = []
    for own, parent in zip(identifiers(motion.skeleton.names), motion.skeleton.parents, strict=True):
        paths.append(own if parent < 0 else f"{paths[parent]}/{own}")
    return paths


def _add_skeleton(
    stage: Usd.Stage, motion: Motion, mesh: SkinnedMesh, floor_m: Floats, joints: list[str]
) -> Any:
    """The skeleton. Its rest pose is the bind pose, standing on the floor."""
    from pxr import UsdSkel

    bind_pos_m = mesh.bind_pos_m - floor_m
    local = to_local(motion.skeleton, mesh.bind_quat)  # (J, 4)
    offsets_m = np.array(motion.skeleton.offsets_m)
    offsets_m[0] = bind_pos_m[0]
    skeleton = UsdSkel.Skeleton.Define(stage, f"{_ROOT}/Skeleton")
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateJointNamesAttr(list(text_names(motion.skeleton.names)))
    skeleton.CreateBindTransformsAttr(
        [_matrix(*both) for both in zip(bind_pos_m, mesh.bind_quat, strict=True)]
    )
    skeleton.CreateRestTransformsAttr([_matrix(*both) for both in zip(offsets_m, local, strict=True)])
    skeleton.CreateExtentAttr(_extent(bind_pos_m))
    return skeleton


def _add_animation(stage: Usd.Stage, motion: Motion, joints: list[str]) -> Any:
    """Translations and rotations of all joints at every frame, and constant scales."""
    from pxr import Gf, Usd, UsdSkel, Vt

    animation = UsdSkel.Animation.Define(stage, ANIMATION_PATH)
    animation.CreateJointsAttr(joints)
    n_joints = motion.skeleton.n_joints
    animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1.0)] * n_joints))
    translations, rotations = animation.CreateTranslationsAttr(), animation.CreateRotationsAttr()
    quat = rot.make_continuous(motion.local_quat).astype(np.float32)  # (T, J, 4)
    offsets_m = motion.skeleton.offsets_m.astype(np.float32)
    for frame in range(motion.n_frames):
        offsets_m[0] = motion.root_pos_m[frame]
        time = Usd.TimeCode(float(frame))
        translations.Set(Vt.Vec3fArray.FromNumpy(offsets_m), time)
        rotations.Set(Vt.QuatfArray([Gf.Quatf(*row) for row in quat[frame].tolist()]), time)
    return animation


def _add_mesh(stage: Usd.Stage, mesh: SkinnedMesh, floor_m: Floats) -> Any:
    """The body as a mesh with a subset for each material."""
    from pxr import Gf, Sdf, UsdGeom, UsdShade, Vt

    body = UsdGeom.Mesh.Define(stage, f"{_ROOT}/Body")
    points_m = (mesh.vertices_m - floor_m).astype(np.float32)
    body.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points_m))
    body.CreateFaceVertexCountsAttr(np.full(len(mesh.triangles), 3, np.int32))
    body.CreateFaceVertexIndicesAttr(mesh.triangles.astype(np.int32).ravel())
    body.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(mesh.normals.astype(np.float32)))
    body.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    body.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    body.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points_m.min(axis=0), points_m.max(axis=0)])))
    part_of_triangle = mesh.parts[mesh.triangles[:, 0]]
    subsets = UsdShade.MaterialBindingAPI(body)
    for part in np.unique(part_of_triangle):
        material = UsdShade.Material.Define(stage, f"{_ROOT}/Materials/{PARTS[part]}")
        shader = UsdShade.Shader.Define(stage, f"{_ROOT}/Materials/{PARTS[part]}/Surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        colour = Gf.Vec3f(*linear_light(mesh.palette[part]).tolist())
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(colour)
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(_ROUGHNESS)
        surface = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput().ConnectToSource(surface)
        faces = np.flatnonzero(part_of_triangle == part).astype(np.int32)
        subset = subsets.CreateMaterialBindSubset(PARTS[part], Vt.IntArray.FromNumpy(faces))
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(material)
    subsets.SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.partition)
    return body


def _add_camera(stage: Usd.Stage, path: CameraPath, fps: float) -> None:
    """The cameras as one prim, with a key on both sides of each cut."""
    from pxr import Gf, Usd, UsdGeom

    camera = UsdGeom.Camera.Define(stage, f"{_ROOT}/Camera")
    high_mm = _FILM_MM / ASPECT
    camera.CreateHorizontalApertureAttr(_FILM_MM)
    camera.CreateVerticalApertureAttr(high_mm)
    camera.CreateFocalLengthAttr(high_mm / (2 * float(np.tan(FOV_RAD / 2))))
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.05, 1000.0))
    times_s, eyes_m, targets_m = path.keys
    transform = camera.AddTransformOp()
    for time_s, eye_m, quat in zip(times_s, eyes_m, camera_quat(eyes_m, targets_m), strict=True):
        transform.Set(_matrix(eye_m, quat), Usd.TimeCode(float(time_s * fps)))


def _extent(points_m: Floats) -> Any:
    """Bounds (2, 3) of joints (N, 3) and of the mesh around them."""
    from pxr import Vt

    bounds = np.stack([points_m.min(axis=0) - _REACH_M, points_m.max(axis=0) + _REACH_M])
    return Vt.Vec3fArray.FromNumpy(bounds.astype(np.float32))


def _matrix(pos_m: Floats, quat: Floats) -> Any:
    """A transform as USD stores it, for row vectors."""
    from pxr import Gf

    return Gf.Matrix4d(Gf.Rotation(Gf.Quatd(*np.asarray(quat, float).tolist())), Gf.Vec3d(*pos_m.tolist()))


def mark_stage(stage: Usd.Stage, prim_path: str, facts: Mapping[str, Any]) -> None:
    """Add the `facts` of `CountedFile.facts` to a stage, with time samples on the prim of the animation."""
    from pxr import Sdf

    stage.GetRootLayer().customLayerData = {KEY: _in_usd(of_counts(facts))}
    fps = stage.GetTimeCodesPerSecond()
    count = stage.GetPrimAtPath(prim_path).CreateAttribute("count", Sdf.ValueTypeNames.Int, custom=True)
    for time_s, number in zip(facts["times_s"], facts["numbers"], strict=True):
        count.Set(int(number), time_s * fps)


def _in_usd(facts: Mapping[str, Any]) -> dict[str, Any]:
    """The facts as values that USD stores: arrays of numbers, and a dictionary for each loop and figure."""
    from pxr import Vt

    stored: dict[str, Any] = {}
    for name, value in facts.items():
        if name in SPANS:
            stored[name] = {f"{name[:-1]}_{number + 1}": dict(each) for number, each in enumerate(value)}
        elif isinstance(value, Sequence) and not isinstance(value, str):
            kind = Vt.IntArray if name == "numbers" else Vt.DoubleArray
            stored[name] = kind.FromNumpy(np.array(value, np.int32 if name == "numbers" else np.float64))
        elif value is not None:
            stored[name] = value
    return stored


WRITERS = (UsdaWriter, UsdcWriter)
