"""Joint roles by name, on common rigs."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import ParameterError
from choreograph.motion.rigs import joint_roles, rest_pose_is_upright
from choreograph.motion.skeleton import CANONICAL_JOINTS, Skeleton, canonical_skeleton

# Each rig as "joint<parent" in order; {s} stands for both sides.
MIXAMO = (
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
ROKOKO = MIXAMO.replace("mixamorig:Hips", "Root Hips<Root")


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
        pytest.param(MIXAMO, MIXAMO_ROLES, id="mixamo, motionbuilder"),
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
    assert joint_roles(rig(MIXAMO, decorate)) == joint_roles(rig(MIXAMO))


def test_the_canonical_body_maps_to_itself():
    assert joint_roles(canonical_skeleton()) == {name: i for i, name in enumerate(CANONICAL_JOINTS)}


def test_smpl_names():
    short = {"left": "L", "right": "R"}
    names = tuple("_".join(short.get(w, w.title()) for w in name.split("_")) for name in CANONICAL_JOINTS)
    skeleton = canonical_skeleton()
    assert joint_roles(Skeleton(names, skeleton.parents, skeleton.offsets_m)) == joint_roles(skeleton)


def test_missing_joints_are_named():
    skeleton = rig(MIXAMO.replace("{S}ForeArm", "{S}Bla").replace("{S}Leg", "{S}Blub"))
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
