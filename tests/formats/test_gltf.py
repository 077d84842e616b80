"""glTF animations as takes: what was written comes back, on any rig; by every interpolation of the format."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import on_other_axes, stepping, swaying

from choreograph.characters.character import perform, read_character
from choreograph.core.errors import ChoreographError, FormatError
from choreograph.formats.gltf import _frame_times, _sampled, read_gltf_motions
from choreograph.formats.gltf_document import GltfDocument, read_gltf
from choreograph.formats.register import import_takes, save_motion
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton


@pytest.mark.parametrize("fps", [23.976, 24.0, 25.0, 30.0, 60.0])
def test_the_rate_of_a_long_motion_is_not_lost_in_the_rounding_of_its_times(fps):
    """Times have 32 bits: after an hour, steps are rounded to a quarter of a millisecond."""
    n_frames = round(3590 * fps)
    keys_s = (np.arange(n_frames) / fps).astype(np.float32)
    times_s, found = _frame_times({(0, "rotation"): (keys_s, keys_s, "LINEAR")})
    assert (found, len(times_s)) == (fps, n_frames)


@pytest.mark.parametrize("suffix", [".glb", ".vrma"])
def test_a_motion_comes_back(tmp_path, suffix):
    motion = swaying(100, fps=50.0)
    save_motion(tmp_path / f"a{suffix}", motion)
    ((back, notes),) = read_gltf_motions(tmp_path / f"a{suffix}").values()
    assert (back.fps, back.n_frames, notes) == (50.0, 100, ())
    index = [back.skeleton.names.index(name) for name in back.skeleton.names]
    np.testing.assert_allclose(back.joint_pos_m()[:, index], motion.joint_pos_m()[:, index], atol=1e-5)


def test_a_rig_whose_rest_pose_does_not_stand_comes_back(tmp_path):
    motion = on_other_axes(swaying(60), 3)
    save_motion(tmp_path / "a.glb", motion)
    ((back, _),) = read_gltf_motions(tmp_path / "a.glb").values()
    where = [back.skeleton.names.index(name) for name in motion.skeleton.names]
    np.testing.assert_allclose(back.joint_pos_m()[:, where], motion.joint_pos_m(), atol=1e-4)


@pytest.mark.parametrize("name", CHARACTERS)
def test_a_dance_comes_back_from_every_character(tmp_path, name):
    motion = stepping(90, fps=60.0)
    write_character(tmp_path / "a.glb", CHARACTERS[name])
    character = read_character(tmp_path / "a.glb")
    (tmp_path / "b.glb").write_bytes(character.dancing(motion).to_glb())
    ((back, notes),) = read_gltf_motions(tmp_path / "b.glb").values()
    assert any("found by structure" in note for note in notes) == name.startswith("nameless")
    figure = perform(motion, character.rig, character.bones).motion
    limbs = [("left_shoulder", "left_elbow"), ("right_knee", "right_ankle")]
    own = {role: character.rig.names[bone] for role, bone in character.bones.items()}
    for start, end in limbs:
        found = [back.joint_pos_m()[:, back.skeleton.names.index(own[part])] for part in (start, end)]
        expected = [figure.joint_pos_m()[:, figure.skeleton.index(part)] for part in (start, end)]
        size = np.linalg.norm(found[1] - found[0], axis=1) / np.linalg.norm(expected[1] - expected[0], axis=1)
        np.testing.assert_allclose(size, size[0], rtol=1e-4)
        np.testing.assert_allclose(
            (found[1] - found[0]) / size[:, None], expected[1] - expected[0], atol=1e-4
        )


@pytest.mark.parametrize("name", [name for name in CHARACTERS if not name.startswith("nameless")])
def test_ours_onto_a_character_and_back_is_ours(tmp_path, name):
    """At our size joints are where they were within a centimetre, head and chest look where they looked."""
    motion = stepping(240, fps=60.0)
    write_character(tmp_path / "a.glb", CHARACTERS[name])
    (tmp_path / "b.glb").write_bytes(read_character(tmp_path / "a.glb").dancing(motion).to_glb())
    ((back, _),) = read_gltf_motions(tmp_path / "b.glb").values()
    ours = retarget(back, canonical_skeleton())
    apart_m = ours.joint_pos_m() - motion.joint_pos_m()
    apart_m[..., 1] -= apart_m[..., 1].mean()  # onto the floor, through which the made motion steps
    assert np.linalg.norm(apart_m, axis=-1).mean() < 0.01
    for role in ("spine3", "head"):
        looks = [
            rot.rotate(forward(one.skeleton, one.root_pos_m, one.local_quat)[1], np.eye(3)[2])[
                :, one.skeleton.index(role)
            ]
            for one in (motion, ours)
        ]
        assert np.min(np.sum(looks[0] * looks[1], axis=-1)) > np.cos(np.radians(5.0))


def test_several_animations_are_several_takes(tmp_path):
    save_motion(tmp_path / "a.glb", swaying(60))
    document = read_gltf(tmp_path / "a.glb")
    document.json["animations"] += [{**document.json["animations"][0], "name": "other"}] * 2
    (tmp_path / "a.glb").write_bytes(document.to_glb())
    assert [take.name for take in import_takes(tmp_path / "a.glb")] == ["a-dance", "a-other", "a-other 3"]
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "a.glb").rename(folder / "a.glb")
    with pytest.raises(FormatError, match="one animation"):
        list(import_takes(folder))


def test_a_folder_of_glb_files(tmp_path):
    for name in ("a", "b"):
        save_motion(tmp_path / f"{name}.glb", swaying(60))
    (tmp_path / "manifest.csv").write_text("name,genre\na.glb,house\nb,waltz\n")
    assert [(t.name, t.credits.genre) for t in import_takes(tmp_path)] == [("a", "house"), ("b", "waltz")]


def test_bones_and_animations_of_one_name_are_told_apart(tmp_path):
    save_motion(tmp_path / "a.glb", swaying(20))
    document = read_gltf(tmp_path / "a.glb")
    document.json["animations"] += [
        {**document.json["animations"][0], "name": name} for name in ("a 3", "a", "a")
    ]
    for node in document.json["nodes"]:
        if node.get("name") in ("left_hand", "right_hand"):
            node["name"] = "head #23"
    (tmp_path / "b.glb").write_bytes(document.to_glb())
    motions = read_gltf_motions(tmp_path / "b.glb")
    assert list(motions) == ["dance", "a 3", "a", "a 4"]
    assert len(set(motions["a"][0].skeleton.names)) == 24


@pytest.mark.parametrize("size", [1e5, 1e-5])
def test_a_body_of_any_size_is_scaled_to_a_dancers(tmp_path, size):
    save_motion(tmp_path / "a.glb", swaying(20))
    document = read_gltf(tmp_path / "a.glb")
    roots = document.json["scenes"][0]["nodes"]
    document.json["scenes"][0]["nodes"] = [document.add("nodes", {"children": roots, "scale": [size] * 3})]
    for skin in document.json["skins"]:
        inverse = document.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
        inverse[:, :3] /= size
        skin["inverseBindMatrices"] = document.accessor(inverse.reshape(-1, 16).astype(np.float32))
    (tmp_path / "b.glb").write_bytes(document.to_glb())
    ((motion, notes),) = read_gltf_motions(tmp_path / "b.glb").values()
    assert 1.0 < np.ptp(motion.joint_pos_m()[0, :, 1]) < 2.3 and len(notes) == 1


def test_interpolations_are_the_formats():
    keys, times = np.array([0.0, 1.0, 3.0]), np.array([-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 9.0])
    values = np.array([[0.0, 0, 0], [1.0, 2, 0], [3.0, 2, 0]])
    linear = _sampled(keys, values, "LINEAR", "translation", times)
    np.testing.assert_allclose(linear[:, 0], [0, 0, 0.5, 1, 2, 3, 3])
    step = _sampled(keys, values, "STEP", "translation", times)
    np.testing.assert_allclose(step[:, 0], [0, 0, 0, 1, 1, 3, 3])
    # A parabola is its own cubic spline, if the tangents are its own.
    curve, slope = keys[:, None] ** 2 * [1.0, 1, 1], 2 * keys[:, None] * [1.0, 1, 1]
    triplets = np.stack([slope, curve, slope], axis=1).reshape(-1, 3)
    cubic = _sampled(keys, triplets, "CUBICSPLINE", "translation", times)
    np.testing.assert_allclose(cubic[:, 0], np.clip(times, 0, 3) ** 2, atol=1e-9)
    turn = rot.from_rotvec(np.array([[0.0, 0, 0], [0, 1.0, 0], [0, 2.0, 0]]))
    turned = _sampled(keys, turn, "LINEAR", "rotation", np.array([0.5, 2.0]))
    np.testing.assert_allclose(rot.to_rotvec(turned)[:, 1], [0.5, 1.5], atol=1e-9)


def test_pictures_are_not_needed_for_motion(tmp_path):
    save_motion(tmp_path / "a.glb", swaying(20))
    document = read_gltf(tmp_path / "a.glb")
    document.json["images"] = [{"uri": "../textures/lost.png"}]
    (tmp_path / "b.glb").write_bytes(document.to_glb())
    assert len(read_gltf_motions(tmp_path / "b.glb")) == 1


def with_accessors(document: GltfDocument, *, shared: bool) -> None:
    """100 tracks whose keys are the same 10 MB: of one accessor, or of an accessor each."""
    n_keys = 600_000
    rows = np.tile(np.array([0, 0, 0, 1], np.float32), (n_keys, 1))
    values = document.accessor(rows)
    times = document.accessor(np.linspace(0.0, 1.0, n_keys, dtype=np.float32), bounds=True)
    animation = document.json["animations"][0]
    animation["samplers"], animation["channels"] = [], []
    entries = document.json["accessors"]
    n_nodes = len(document.json["nodes"])
    for track in range(100):
        if not shared:
            values = document.add("accessors", dict(entries[values]))
        animation["samplers"].append({"input": times, "output": values})
        target = {"node": track % n_nodes, "path": "rotation"}
        animation["channels"].append({"sampler": track, "target": target})


@pytest.mark.parametrize("shared", [True, False])
def test_100_tracks_of_the_same_bytes_take_little_memory(tmp_path, shared):
    save_motion(tmp_path / "a.glb", swaying(20))
    document = read_gltf(tmp_path / "a.glb")
    with_accessors(document, shared=shared)
    (tmp_path / "b.glb").write_bytes(document.to_glb())
    tracemalloc.start()
    try:
        if shared:
            assert len(read_gltf_motions(tmp_path / "b.glb")) == 1
        else:
            with pytest.raises(FormatError, match="too often"):
                read_gltf_motions(tmp_path / "b.glb")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 25 * document.n_bytes


def shortened(document: GltfDocument) -> None:
    document.json["animations"][0]["samplers"][0]["output"] = document.accessor(np.zeros((2, 3), np.float32))


def backwards(document: GltfDocument) -> None:
    times = document.accessor(np.array([1.0, 0.0], np.float32), bounds=True)
    values = document.accessor(np.zeros((2, 3), np.float32))
    document.json["animations"][0]["samplers"][0] = {"input": times, "output": values}


def endless(document: GltfDocument) -> None:
    times = document.accessor(np.array([0.0, 1e9], np.float32), bounds=True)
    values = document.accessor(np.zeros((2, 3), np.float32))
    document.json["animations"][0]["samplers"][0] = {"input": times, "output": values}


def not_finite(document: GltfDocument) -> None:
    n = document.json["accessors"][document.json["animations"][0]["samplers"][0]["input"]]["count"]
    values = document.accessor(np.full((n, 3), np.nan, np.float32))
    document.json["animations"][0]["samplers"][0]["output"] = values


def without_animation(document: GltfDocument) -> None:
    document.json["animations"] = []


def of_nothing(document: GltfDocument) -> None:
    document.json["animations"][0]["channels"] = []


def of_no_sampler(document: GltfDocument) -> None:
    document.json["animations"][0]["channels"][0]["sampler"] = 999


def of_no_accessor(document: GltfDocument) -> None:
    del document.json["animations"][0]["samplers"][0]["input"]


def endlessly_far(document: GltfDocument) -> None:
    for node in document.json["nodes"]:
        node |= {"translation": [1e11] * 3, "scale": [1e11] * 3}


def with_an_hour_of_4000_bones(document: GltfDocument) -> None:
    first = len(document.json["nodes"])
    document.json["nodes"] += [{} for _ in range(4000)]
    document.json["skins"].append({"joints": list(range(first, first + 4000))})
    times = document.accessor(np.array([0.0, 3599.0], np.float32), bounds=True)
    values = document.accessor(np.zeros((2, 3), np.float32))
    document.json["animations"][0]["samplers"][0] = {"input": times, "output": values}


def with_5000_animations(document: GltfDocument) -> None:
    document.json["animations"] *= 5000


def without_legs(document: GltfDocument) -> None:
    for node in document.json["nodes"]:
        if "hip" in node.get("name", ""):
            node["name"] = node["name"].replace("hip", "x")
            node.pop("children")


def with_two_bodies(document: GltfDocument) -> None:
    """Limbs under other roots than the trunk: two armatures."""
    for node in document.json["nodes"]:
        node.pop("children", None)


@pytest.mark.parametrize(
    "change",
    [
        shortened, backwards, endless, not_finite, without_animation, of_nothing, of_no_sampler,
        of_no_accessor, endlessly_far, with_an_hour_of_4000_bones, with_5000_animations,
        without_legs, with_two_bodies,
    ],
    ids=lambda change: change.__name__,
)  # fmt: skip
def test_a_damaged_animation_is_refused_in_a_line(tmp_path, change):
    save_motion(tmp_path / "a.glb", swaying(20))
    document = read_gltf(tmp_path / "a.glb")
    change(document)
    (tmp_path / "b.glb").write_bytes(document.to_glb())
    with pytest.raises(ChoreographError) as refused:
        list(import_takes(tmp_path / "b.glb"))
    assert "\n" not in str(refused.value) and "b.glb" in str(refused.value)
