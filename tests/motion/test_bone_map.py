"""Maps of bones: what the user says counts, and what cannot be a body is refused in a line."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_characters import CHARACTERS, MIXAMO, Spec, write_character
from synthetic_motions import swaying
from synthetic_repertoire import synthetic_contents

from choreograph.characters.gltf_character import read_character
from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.formats.gltf_document import GltfDocument
from choreograph.formats.gltf_files import read_gltf
from choreograph.formats.register import import_takes, save_motion
from choreograph.library.building.takes import measure_take
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import write_repertoire
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import read_bone_map, write_bone_map
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles
from choreograph.motion.skeleton import Skeleton, canonical_skeleton


def test_a_map_is_written_and_read(tmp_path):
    write_character(tmp_path / "a.glb", CHARACTERS["unreal"])
    character = read_character(tmp_path / "a.glb")
    write_bone_map(tmp_path / "map.json", character.rig.names, character.bones)
    given = read_bone_map(tmp_path / "map.json")
    assert given["left_hip"] == "thigh_l"
    assert read_character(tmp_path / "a.glb", given).bones == character.bones


def test_a_map_settles_what_names_say_wrongly(tmp_path):
    write_character(tmp_path / "a.glb", CHARACTERS["mixamo"])
    swapped = {"left_wrist": MIXAMO["right_wrist"], "right_wrist": MIXAMO["left_wrist"]}
    character = read_character(tmp_path / "a.glb", swapped)
    assert character.rig.names[character.bones["left_wrist"]] == MIXAMO["right_wrist"]


def test_a_map_alone_is_enough(tmp_path):
    names = {part: f"x{i}" for i, part in enumerate(MIXAMO)}
    spec = Spec(names | {"left_hand": "h0", "right_hand": "h1"})
    write_character(tmp_path / "a.glb", spec)
    character = read_character(tmp_path / "a.glb", names)
    assert character.rig.names[character.bones["pelvis"]] == names["pelvis"]


@pytest.mark.parametrize(
    "text",
    ["", "[1]", '{"pelvis": 3}', '{"tail": "Tail"}', "{" * 10_000],
    ids=["empty", "list", "number", "role", "deep"],
)
def test_a_broken_map_is_refused_in_a_line(tmp_path, text):
    (tmp_path / "map.json").write_text(text)
    with pytest.raises(FormatError) as refused:
        read_bone_map(tmp_path / "map.json")
    assert "\n" not in str(refused.value)


def test_a_map_with_a_bone_that_is_not_there(tmp_path):
    write_character(tmp_path / "a.glb", CHARACTERS["mixamo"])
    with pytest.raises(ParameterError, match="Tail"):
        read_character(tmp_path / "a.glb", {"pelvis": "Tail"})


# Two legs that end in nothing: names and structure say nothing of this body.
SHAPELESS = {name: f"b{i:02d}" for i, name in enumerate(canonical_skeleton().names)}


@pytest.fixture
def shapeless(tmp_path):
    """A take whose bones are numbered and lie on one line at rest and in all frames."""
    body = canonical_skeleton()
    along_x = np.linalg.norm(body.offsets_m, axis=1)[:, None] * [1.0, 0.0, 0.0]
    skeleton = Skeleton(tuple(SHAPELESS.values()), body.parents, along_x)
    still = Motion(skeleton, np.zeros((300, 3)), np.tile(rot.IDENTITY, (300, body.n_joints, 1)), 30.0)
    folder = tmp_path / "takes"
    folder.mkdir()
    save_motion(folder / "take.bvh", still)
    return folder


def test_a_map_says_which_bone_is_which_in_takes(shapeless):
    with pytest.raises(ChoreographError, match="known rig"):
        list(import_takes(shapeless))
    for source in (shapeless, shapeless / "take.bvh"):
        (take,) = import_takes(source, bone_map=SHAPELESS)
        skeleton = take.motion.skeleton
        found = {role: skeleton.names[joint] for role, joint in joint_roles(skeleton).items()}
        assert found == SHAPELESS
        assert any("map" in note for note in take.notes)


def test_a_few_bones_of_a_map_settle_those_alone(tmp_path):
    swapped = {"left_wrist": "right_wrist", "right_wrist": "left_wrist"}
    save_motion(tmp_path / "take.bvh", swaying(60))
    (take,) = import_takes(tmp_path / "take.bvh", bone_map=swapped)
    body = canonical_skeleton()
    skeleton = take.motion.skeleton
    expected = {role: swapped.get(role, role) for role in body.names}
    assert {role: skeleton.names[joint] for role, joint in joint_roles(skeleton).items()} == expected


def test_roles_are_kept_in_npz_and_repertoires(shapeless, tmp_path):
    (take,) = import_takes(shapeless, bone_map=SHAPELESS)
    save_motion(tmp_path / "take.npz", take.motion)
    (back,) = import_takes(tmp_path / "take.npz")
    assert joint_roles(back.motion.skeleton) == joint_roles(take.motion.skeleton)
    contents = synthetic_contents([measure_take(take)])
    write_repertoire(tmp_path / "rep.h5", contents)
    stored = Repertoire.open(tmp_path / "rep.h5").skeleton
    assert joint_roles(stored) == joint_roles(take.motion.skeleton)


def test_a_map_that_fits_no_take_is_refused(tmp_path):
    save_motion(tmp_path / "take.bvh", swaying(60))
    given = tmp_path / "map.json"
    given.write_text(json.dumps({"left_knee": "Tail"}))
    commands = (("build-db", "-o", tmp_path / "made.h5"), ("convert", tmp_path / "made.npz"))
    for command, *output in commands:
        said = run(command, tmp_path / "take.bvh", *output, "--map", given)
        assert_one_line(said, says="'Tail': no joint has this name")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.json", "take.bvh"]


def test_convert_takes_a_map(shapeless, tmp_path):
    given = tmp_path / "map.json"
    given.write_text(json.dumps(SHAPELESS))
    done = run("convert", shapeless / "take.bvh", tmp_path / "made.npz", "--map", given)
    assert done.exit_code == 0, done.output
    (back,) = import_takes(tmp_path / "made.npz")
    names = back.motion.skeleton.names
    assert {role: names[joint] for role, joint in joint_roles(back.motion.skeleton).items()} == SHAPELESS


@pytest.mark.parametrize("bone_map", [{"tail": "Tail"}, {"pelvis": 3}, ["pelvis"]])
def test_what_is_no_map_is_refused(tmp_path, bone_map):
    save_motion(tmp_path / "take.bvh", swaying(60))
    with pytest.raises(ParameterError):
        list(import_takes(tmp_path / "take.bvh", bone_map=bone_map))


def no_skeleton(document: GltfDocument) -> None:
    document.json.pop("skins")


def no_legs(document: GltfDocument) -> None:
    nodes, skin = document.json["nodes"], document.json["skins"][0]
    legs = {i for i, node in enumerate(nodes) if any(w in node["name"] for w in ("Leg", "Foot", "Toe"))}
    for node in nodes:
        if "children" in node:
            node["children"] = [child for child in node["children"] if child not in legs]
    skin["joints"] = [joint for joint in skin["joints"] if joint not in legs]
    skin.pop("inverseBindMatrices")


def two_bodies(document: GltfDocument) -> None:
    nodes, skin = document.json["nodes"], document.json["skins"][0]
    n = len(nodes)
    copies = [
        {**node, "children": [c + n for c in node.get("children", [])]}
        for node in nodes
        if "skin" not in node
    ]
    nodes += copies
    skin["joints"] = [*skin["joints"], *(j + n for j in skin["joints"])]
    skin.pop("inverseBindMatrices")


def a_loop(document: GltfDocument) -> None:
    document.json["nodes"][3]["children"] = [0]


def not_numbers(document: GltfDocument) -> None:
    document.json["nodes"][2]["rotation"] = ["a", None, 3, 4]


def a_joint_of_no_node(document: GltfDocument) -> None:
    document.json["skins"][0]["joints"][0] = 10_000


def too_few_bind_matrices(document: GltfDocument) -> None:
    document.json["skins"][0]["joints"].pop()


@pytest.mark.parametrize(
    "change",
    [no_skeleton, no_legs, two_bodies, a_loop, not_numbers, a_joint_of_no_node, too_few_bind_matrices],
    ids=lambda change: change.__name__,
)  # fmt: skip
def test_what_cannot_dance_is_refused_in_a_line(tmp_path, change):
    write_character(tmp_path / "a.glb", Spec(MIXAMO))
    document = read_gltf(tmp_path / "a.glb")
    change(document)
    (tmp_path / "b.glb").write_bytes(document.to_glb())
    with pytest.raises(ChoreographError) as refused:
        read_character(tmp_path / "b.glb")
    assert "\n" not in str(refused.value) and "b.glb" in str(refused.value)


def test_any_scale_is_read(tmp_path):
    for scale in (1e-3, 1.0, 1e5):
        write_character(tmp_path / "a.glb", Spec(MIXAMO, size=scale))
        rig = read_character(tmp_path / "a.glb").rig
        assert np.ptp(rig.bind_pos_m[:, 1]) / scale == pytest.approx(1.55, abs=0.2)
