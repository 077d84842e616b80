"""Maps of bones: what the user says counts, and what cannot be a body is refused in a line."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, MIXAMO, Spec, write_character

from choreograph.characters import read_bone_map, read_character, write_bone_map
from choreograph.errors import ChoreographError, FormatError, ParameterError
from choreograph.gltf import GltfDocument, read_gltf


def test_a_map_is_written_and_read(tmp_path):
    write_character(tmp_path / "a.glb", CHARACTERS["unreal"])
    character = read_character(tmp_path / "a.glb")
    write_bone_map(tmp_path / "map.json", character.rig, character.bones)
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
