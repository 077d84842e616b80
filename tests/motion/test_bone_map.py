"""Roles of joints by their names, and bones with unknown names."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_characters import CHARACTERS, MIXAMO, Spec, write_character
from synthetic_motions import swaying
from synthetic_repertoire import synthetic_contents

from choreograph.characters.character import read_character
from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.formats.gltf_document import GltfDocument, read_gltf
from choreograph.formats.register import import_takes, save_motion
from choreograph.library.building.takes import measure_take
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import write_repertoire
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import joint_roles, read_bone_map, rest_pose_is_upright, write_bone_map
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton

# Each rig as "joint<parent" in order; {s} stands for both sides.
MIXAMO_RIG = (
    "mixamorig:Hips Spine<Hips Spine1<Spine Spine2<Spine1 Neck<Spine2 Head<Neck HeadTop_End<Head "
    "{S}Shoulder<Spine2 {S}Arm<{S}Shoulder {S}ForeArm<{S}Arm {S}Hand<{S}ForeArm {S}HandThumb1<{S}Hand "
    "{S}HandIndex1<{S}Hand {S}UpLeg<Hips {S}Leg<{S}UpLeg {S}Foot<{S}Leg {S}ToeBase<{S}Foot "
    "{S}Toe_End<{S}ToeBase"
)
MIXAMO_ROLES = {
    "pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck",
    "head": "Head",
    "left_collar": "LeftShoulder", "left_shoulder": "LeftArm", "left_elbow": "LeftForeArm",
    "right_wrist": "RightHand", "right_hip": "RightUpLeg", "right_knee": "RightLeg",
    "right_ankle": "RightFoot",
    "left_foot": "LeftToeBase",
}  # fmt: skip
CMU = (
    "Hips {S}HipJoint<Hips {S}UpLeg<{S}HipJoint {S}Leg<{S}UpLeg {S}Foot<{S}Leg {S}ToeBase<{S}Foot "
    "LowerBack<Hips "
    "Spine<LowerBack Spine1<Spine Neck<Spine1 Neck1<Neck Head<Neck1 {S}Shoulder<Spine1 {S}Arm<{S}Shoulder "
    "{S}ForeArm<{S}Arm {S}Hand<{S}ForeArm {S}FingerBase<{S}Hand {S}HandIndex1<{S}FingerBase"
)
BANDAI = (
    "joint_Root Hips<joint_Root Spine<Hips Chest<Spine Neck<Chest Head<Neck Shoulder_{l}<Chest "
    "UpperArm_{l}<Shoulder_{l} LowerArm_{l}<UpperArm_{l} Hand_{l}<LowerArm_{l} UpperLeg_{l}<Hips "
    "LowerLeg_{l}<UpperLeg_{l} Foot_{l}<LowerLeg_{l} Toes_{l}<Foot_{l}"
)
BANDAI_ROLES = {
    "pelvis": "Hips", "spine1": "Spine", "spine3": "Chest", "left_collar": "Shoulder_L",
    "left_shoulder": "UpperArm_L", "right_elbow": "LowerArm_R", "right_wrist": "Hand_R",
    "left_hip": "UpperLeg_L",
    "left_knee": "LowerLeg_L", "left_ankle": "Foot_L", "right_foot": "Toes_R",
}  # fmt: skip
BIOVISION = (
    "Hips Chest<Hips Neck<Chest Head<Neck {S}Collar<Chest {S}Shoulder<{S}Collar {S}Elbow<{S}Shoulder "
    "{S}Wrist<{S}Elbow {S}Hip<Hips {S}Knee<{S}Hip {S}Ankle<{S}Knee {S}Toe<{S}Ankle"
)
BIOVISION_ROLES = {
    "pelvis": "Hips", "spine1": "Chest", "left_collar": "LeftCollar", "left_shoulder": "LeftShoulder",
    "left_hip": "LeftHip", "right_ankle": "RightAnkle", "right_wrist": "RightWrist", "right_foot": "RightToe",
}  # fmt: skip
XSENS = (
    "Pelvis L5<Pelvis L3<L5 T12<L3 T8<T12 Neck<T8 Head<Neck {S}Shoulder<T8 {S}UpperArm<{S}Shoulder "
    "{S}ForeArm<{S}UpperArm {S}Hand<{S}ForeArm {S}UpperLeg<Pelvis {S}LowerLeg<{S}UpperLeg "
    "{S}Foot<{S}LowerLeg "
    "{S}Toe<{S}Foot"
)
XSENS_ROLES = {
    "pelvis": "Pelvis", "spine1": "L5", "spine2": "T12", "spine3": "T8", "left_collar": "LeftShoulder",
    "left_shoulder": "LeftUpperArm", "left_knee": "LeftLowerLeg", "left_ankle": "LeftFoot",
    "left_foot": "LeftToe",
}  # fmt: skip
ASF = (
    "root {l}hipjoint<root {l}femur<{l}hipjoint {l}tibia<{l}femur {l}foot<{l}tibia {l}toes<{l}foot "
    "lowerback<root "
    "upperback<lowerback thorax<upperback lowerneck<thorax upperneck<lowerneck head<upperneck "
    "{l}clavicle<thorax "
    "{l}humerus<{l}clavicle {l}radius<{l}humerus {l}wrist<{l}radius {l}hand<{l}wrist {l}thumb<{l}hand"
)
ASF_ROLES = {
    "pelvis": "root", "spine1": "lowerback", "spine2": "upperback", "spine3": "thorax", "neck": "lowerneck",
    "left_hip": "lfemur", "left_knee": "ltibia", "left_ankle": "lfoot", "left_foot": "ltoes",
    "left_shoulder": "lhumerus", "left_wrist": "lwrist", "left_hand": "lhand",
}  # fmt: skip
UNREAL = (
    "root pelvis<root spine_01<pelvis spine_02<spine_01 spine_03<spine_02 neck_01<spine_03 head<neck_01 "
    "clavicle_{l}<spine_03 upperarm_{l}<clavicle_{l} upperarm_twist_01_{l}<upperarm_{l} "
    "lowerarm_{l}<upperarm_{l} hand_{l}<lowerarm_{l} thigh_{l}<pelvis thigh_twist_01_{l}<thigh_{l} "
    "calf_{l}<thigh_{l} foot_{l}<calf_{l} ball_{l}<foot_{l} ik_foot_root<root ik_foot_{l}<ik_foot_root"
)
UNREAL_ROLES = {
    "pelvis": "pelvis", "left_hip": "thigh_l", "left_knee": "calf_l", "left_ankle": "foot_l",
    "left_foot": "ball_l",
    "left_shoulder": "upperarm_l", "left_elbow": "lowerarm_l", "spine2": "spine_02",
    "left_collar": "clavicle_l",
}  # fmt: skip
ROKOKO = MIXAMO_RIG.replace("mixamorig:Hips", "Root Hips<Root")


def rig(text: str, decorate=lambda name: name) -> Skeleton:
    names, parents = [], []
    for word in text.split():
        for side in (("Left", "l"), ("Right", "r")) if "{" in word else (("", ""),):
            upper = side[1].upper() if "_{l}" in text and "_L" not in text and "Hips" in text else side[1]
            name, _, parent = word.replace("{S}", side[0]).replace("{l}", upper).partition("<")
            names.append(name.removeprefix("mixamorig:"))
            parents.append(names.index(parent) if parent else -1)
    return Skeleton(tuple(map(decorate, names)), np.array(parents), np.ones((len(names), 3)))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param(MIXAMO_RIG, MIXAMO_ROLES, id="mixamo, motionbuilder"),
        pytest.param(ROKOKO, MIXAMO_ROLES, id="rokoko"),
        pytest.param(
            CMU, {"pelvis": "Hips", "left_hip": "LeftUpLeg", "neck": "Neck", "spine1": "LowerBack"}, id="cmu"
        ),
        pytest.param(BANDAI, BANDAI_ROLES, id="bandai-namco"),
        pytest.param(BIOVISION, BIOVISION_ROLES, id="biovision"),
        pytest.param(XSENS, XSENS_ROLES, id="xsens"),
        pytest.param(ASF, ASF_ROLES, id="cmu asf"),
        pytest.param(UNREAL, UNREAL_ROLES, id="unreal"),
    ],
)
def test_usual_rigs(text, expected):
    skeleton = rig(text)
    found = {role: skeleton.names[joint] for role, joint in joint_roles(skeleton).items()}
    assert {role: found.get(role) for role in expected} == expected
    assert len(set(found.values())) == len(found)  # no joint has two roles


@pytest.mark.parametrize(
    "decorate",
    [
        lambda n: f"mixamorig:{n}",
        lambda n: f"Character1_{n}",
        str.upper,
        lambda n: f"{n}_JNT",
        lambda n: f"a|b:{n}",
    ],
    ids=["mixamo", "hik", "upper", "suffix", "namespace"],
)
def test_prefixes_case_and_suffixes_do_not_matter(decorate):
    assert joint_roles(rig(MIXAMO_RIG, decorate)) == joint_roles(rig(MIXAMO_RIG))


def test_the_canonical_body_maps_to_itself():
    assert joint_roles(canonical_skeleton()) == {name: i for i, name in enumerate(CANONICAL_JOINTS)}


def test_smpl_names():
    short = {"left": "L", "right": "R"}
    names = tuple("_".join(short.get(w, w.title()) for w in name.split("_")) for name in CANONICAL_JOINTS)
    skeleton = canonical_skeleton()
    assert joint_roles(Skeleton(names, skeleton.parents, skeleton.offsets_m)) == joint_roles(skeleton)


def test_missing_joints_are_named():
    skeleton = rig(MIXAMO_RIG.replace("{S}ForeArm", "{S}Bla").replace("{S}Leg", "{S}Blub"))
    with pytest.raises(ParameterError, match="left_knee, right_knee, left_elbow, right_elbow"):
        joint_roles(skeleton)


def test_changing_the_result_does_not_change_the_cache():
    skeleton = canonical_skeleton()
    joint_roles(skeleton).clear()
    assert joint_roles(skeleton)


def test_whether_the_rest_pose_is_upright():
    body = canonical_skeleton()
    along_x = np.linalg.norm(body.offsets_m, axis=1)[:, None] * [1.0, 0.0, 0.0]
    assert rest_pose_is_upright(body)
    assert not rest_pose_is_upright(Skeleton(body.names, body.parents, along_x))


def test_a_face_is_no_head():
    """Rigify's head is the last of its spine; the longest chain above the arms goes on through the face."""
    body = canonical_skeleton()
    called = {
        "spine1": "spine.001",
        "spine2": "spine.002",
        "spine3": "spine.003",
        "neck": "spine.004",
        "head": "spine.006",
    }
    names = [called.get(name, name) for name in body.names]
    head = body.names.index("head")
    face = ["face", "brow.T.L", "brow.T.L.001"]
    parents = [*body.parents, head, len(names), len(names) + 1]
    rig = Skeleton((*names, *face), np.array(parents), np.zeros((len(names) + 3, 3)))
    assert joint_roles(rig)["head"] == head and joint_roles(rig)["neck"] == body.names.index("neck")


@pytest.mark.parametrize("palms", [1, 4])
def test_of_several_palms_none_is_the_hand(palms):
    """Rigify has one below each finger, beside the bone of the hand, where the wrist is."""
    body = canonical_skeleton()
    ends = [body.names.index(f"{side}_hand") for side in ("left", "right")]
    called = {f"{side}_wrist": f"hand.{side[0].upper()}" for side in ("left", "right")}
    names = [called.get(name, name) for name in body.names]
    names[ends[0]], names[ends[1]] = "palm.01.L", "palm.01.R"
    more = [f"palm.0{number}.{side}" for side in "LR" for number in range(2, palms + 1)]
    wrists = [body.names.index(f"{side}_wrist") for side in ("left", "right")]
    parents = [*body.parents, *(wrists["LR".index(name[-1])] for name in more)]
    roles = joint_roles(Skeleton((*names, *more), np.array(parents), np.zeros((len(parents), 3))))
    assert [roles["left_wrist"], roles["right_wrist"]] == wrists
    assert [roles.get("left_hand"), roles.get("right_hand")] == (ends if palms == 1 else [None, None])


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
