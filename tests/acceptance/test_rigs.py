"""The acceptance corpus of rigs: each as a BVH in which the test knows which joint is which.

Joints are named as the programs and data sets name them. A limb is written "NAME:part, NAME" from the trunk
out; joints without a part lie between those that have one.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from acceptance.corpus import SaneFile, assert_read
from acceptance.made_rigs import Rig, made_of, number, write_bvh

from choreograph.core.errors import FormatError
from choreograph.formats.register import import_takes
from choreograph.motion.bone_map import joint_roles

_SPINE3 = "Hips:pelvis, Spine:spine1, Spine1:spine2, Spine2:spine3, Neck:neck, Head:head"
MIXAMO = Rig(
    _SPINE3,
    "{S}UpLeg:hip, {S}Leg:knee, {S}Foot:ankle, {S}ToeBase:foot, {S}Toe_End",
    "{S}Shoulder:collar, {S}Arm:shoulder, {S}ForeArm:elbow, {S}Hand:wrist",
    fingers="{S}Hand{F}{n}",
)
UNREAL = Rig(
    "pelvis:pelvis, spine_01:spine1, spine_02:spine2, spine_03:spine3, neck_01:neck, head:head",
    "thigh_{l}:hip, calf_{l}:knee, foot_{l}:ankle, ball_{l}:foot",
    "clavicle_{l}:collar, upperarm_{l}:shoulder, lowerarm_{l}:elbow, hand_{l}:wrist",
    root="root", fingers="{F}_0{n}_{l}", arms_down_rad=0.8, up="z",
    extra="thigh_twist_01_{l}<thigh_{l}, upperarm_twist_01_{l}<upperarm_{l}, "
    "lowerarm_twist_01_{l}<lowerarm_{l}",
)  # fmt: skip
POSER = Rig(
    "hip:pelvis, abdomen:spine1, chest:spine3, neck:neck, head:head",
    "{l}Buttock, {l}Thigh:hip, {l}Shin:knee, {l}Foot:ankle",
    "{l}Collar:collar, {l}Shldr:shoulder, {l}ForeArm:elbow, {l}Hand:wrist",
    fingers="{l}{F}{n}", units_per_m=39.37,
)  # fmt: skip
DAZ_G8 = Rig(
    "hip:pelvis, abdomenLower:spine1, abdomenUpper, chestLower:spine2, chestUpper:spine3, neckLower:neck, "
    "neckUpper, head:head",
    "{l}ThighBend:hip, {l}ThighTwist, {l}Shin:knee, {l}Foot:ankle, {l}Metatarsals, {l}Toe:foot",
    "{l}Collar:collar, {l}ShldrBend:shoulder, {l}ShldrTwist, {l}ForearmBend:elbow, {l}ForearmTwist, "
    "{l}Hand:wrist",
    fingers="{l}{F}{n}", above_hips="pelvis", arms_down_rad=0.7,
)  # fmt: skip
DAZ_G9 = Rig(
    "hip:pelvis, spine1:spine1, spine2, spine3:spine2, spine4:spine3, neck1:neck, neck2, head:head",
    "{l}_thigh:hip, {l}_shin:knee, {l}_foot:ankle, {l}_metatarsals, {l}_toes:foot",
    "{l}_shoulder:collar, {l}_upperarm:shoulder, {l}_forearm:elbow, {l}_hand:wrist",
    above_hips="pelvis", fingers="{l}_{F}{n}", arms_down_rad=0.7,
    extra="{l}_thightwist1<{l}_thigh, {l}_upperarmtwist1<{l}_upperarm, {l}_forearmtwist1<{l}_forearm",
)  # fmt: skip
MMD = Rig(
    "センター:pelvis, 上半身:spine1, 上半身2:spine3, 首:neck, 頭:head",
    "{j}足:hip, {j}ひざ:knee, {j}足首:ankle, {j}つま先:foot",
    "{j}肩:collar, {j}腕:shoulder, {j}ひじ:elbow, {j}手首:wrist",
    above_hips="下半身", root="全ての親", arms_down_rad=0.6, units_per_m=12.5,
    extra="{j}足ＩＫ<{j}足, {j}腕捩<{j}腕, {j}手捩<{j}ひじ, {j}肩P<{j}肩, {j}足D<{j}足, {j}中指１<{j}手首",
)  # fmt: skip
RIGIFY = Rig(
    "spine:pelvis, spine.001:spine1, spine.002:spine2, spine.003:spine3, spine.004:neck, spine.005, "
    "spine.006:head",
    "thigh.{L}:hip, shin.{L}:knee, foot.{L}:ankle, toe.{L}:foot",
    "shoulder.{L}:collar, upper_arm.{L}:shoulder, forearm.{L}:elbow, hand.{L}:wrist",
    fingers="f_{F}.0{n}.{L}", up="z", units_per_m=1.0, arms_down_rad=0.3,
)  # fmt: skip
RIGIFY_DEF = replace(
    RIGIFY,
    leg="thigh.{L}:hip, thigh.{L}.001, shin.{L}:knee, shin.{L}.001, foot.{L}:ankle, toe.{L}:foot",
    arm="shoulder.{L}:collar, upper_arm.{L}:shoulder, upper_arm.{L}.001, forearm.{L}:elbow, forearm.{L}.001, "
    "hand.{L}:wrist",
    prefix="DEF-",
)
CHARACTER_CREATOR = Rig(
    "Hip:pelvis, Waist:spine1, Spine01:spine2, Spine02:spine3, NeckTwist01:neck, NeckTwist02, Head:head",
    "{L}_Thigh:hip, {L}_Calf:knee, {L}_Foot:ankle, {L}_ToeBase:foot",
    "{L}_Clavicle:collar, {L}_Upperarm:shoulder, {L}_Forearm:elbow, {L}_Hand:wrist",
    above_hips="Pelvis", root="BoneRoot", prefix="CC_Base_", fingers="{L}_{F}{n}",
    extra="{L}_ThighTwist01<{L}_Thigh, {L}_CalfTwist01<{L}_Calf, {L}_KneeShareBone<{L}_Calf, "
    "{L}_UpperarmTwist01<{L}_Upperarm, {L}_ForearmTwist01<{L}_Forearm, {L}_ElbowShareBone<{L}_Forearm",
)  # fmt: skip
VRM = Rig(
    "hips:pelvis, spine:spine1, chest:spine2, upperChest:spine3, neck:neck, head:head",
    "{s}UpperLeg:hip, {s}LowerLeg:knee, {s}Foot:ankle, {s}Toes:foot",
    "{s}Shoulder:collar, {s}UpperArm:shoulder, {s}LowerArm:elbow, {s}Hand:wrist",
    fingers="{s}{F}{n}", units_per_m=1.0,
)  # fmt: skip
XSENS = Rig(
    "Hips:pelvis, Chest:spine1, Chest2, Chest3:spine2, Chest4:spine3, Neck:neck, Head:head",
    "{S}Hip:hip, {S}Knee:knee, {S}Ankle:ankle, {S}Toe:foot",
    "{S}Collar:collar, {S}Shoulder:shoulder, {S}Elbow:elbow, {S}Wrist:wrist",
)
OPTITRACK = Rig(
    "Hip:pelvis, Ab:spine1, Chest:spine3, Neck:neck, Head:head",
    "{L}Thigh:hip, {L}Shin:knee, {L}Foot:ankle, {L}Toe:foot",
    "{L}Shoulder:collar, {L}UArm:shoulder, {L}FArm:elbow, {L}Hand:wrist",
    prefix="Skeleton 001:", fingers="{L}{F}{n}", units_per_m=1000.0,
)  # fmt: skip
VICON = Rig(
    "pelvis:pelvis, thorax:spine1, head:head",
    "{l}femur:hip, {l}tibia:knee, {l}foot:ankle, {l}toes:foot",
    "{l}clavicle:collar, {l}humerus:shoulder, {l}radius:elbow, {l}hand:wrist",
    units_per_m=1000.0, up="z",
)  # fmt: skip
CMU = replace(
    MIXAMO,
    trunk="Hips:pelvis, LowerBack:spine1, Spine:spine2, Spine1:spine3, Neck:neck, Neck1, Head:head",
    leg="{S}HipJoint, {S}UpLeg:hip, {S}Leg:knee, {S}Foot:ankle, {S}ToeBase:foot",
    fingers="", units_per_m=100 / 5.6444,
)  # fmt: skip
BIPED = Rig(
    "Pelvis:pelvis, Spine:spine1, Spine1:spine2, Spine2:spine3, Neck:neck, Head:head",
    "{L} Thigh:hip, {L} Calf:knee, {L} Foot:ankle, {L} Toe0:foot",
    "{L} Clavicle:collar, {L} UpperArm:shoulder, {L} Forearm:elbow, {L} Hand:wrist",
    prefix="Bip01 ", up="z", units_per_m=39.37,
)  # fmt: skip
KINECT = Rig(
    "SpineBase:pelvis, SpineMid:spine1, SpineShoulder:spine3, Neck:neck, Head:head",
    "Hip{S}:hip, Knee{S}:knee, Ankle{S}:ankle, Foot{S}:foot",
    "Shoulder{S}:shoulder, Elbow{S}:elbow, Wrist{S}:wrist, Hand{S}:hand, HandTip{S}",
    units_per_m=1.0,
)  # fmt: skip
SMPL = Rig(
    "Pelvis:pelvis, Spine1:spine1, Spine2:spine2, Spine3:spine3, Neck:neck, Head:head",
    "{L}_Hip:hip, {L}_Knee:knee, {L}_Ankle:ankle, {L}_Foot:foot",
    "{L}_Collar:collar, {L}_Shoulder:shoulder, {L}_Elbow:elbow, {L}_Wrist:wrist, {L}_Hand:hand",
    units_per_m=1.0,
)  # fmt: skip
SMPLX = Rig(
    "pelvis:pelvis, spine1:spine1, spine2:spine2, spine3:spine3, neck:neck, head:head",
    "{s}_hip:hip, {s}_knee:knee, {s}_ankle:ankle, {s}_foot:foot",
    "{s}_collar:collar, {s}_shoulder:shoulder, {s}_elbow:elbow, {s}_wrist:wrist",
    fingers="{s}_{F}{n}", units_per_m=1.0,
)  # fmt: skip
BANDAI_NAMCO = Rig(
    "Hips:pelvis, Spine:spine1, Chest:spine3, Neck:neck, Head:head",
    "UpperLeg_{L}:hip, LowerLeg_{L}:knee, Foot_{L}:ankle, Toes_{L}:foot",
    "Shoulder_{L}:collar, UpperArm_{L}:shoulder, LowerArm_{L}:elbow, Hand_{L}:wrist",
    root="joint_Root",
)  # fmt: skip
_NO_TOES = "{S}UpLeg:hip, {S}Leg:knee, {S}Foot:ankle"
_ONE_SPINE = "Hips:pelvis, Spine:spine1, Neck:neck, Head:head"
RIGS = {
    "Mixamo": replace(MIXAMO, prefix="mixamorig:"),
    "Mixamo, another prefix": replace(MIXAMO, prefix="mixamorig5_"),
    "Mixamo, no prefix": MIXAMO,
    "Xsens": XSENS,
    "Rokoko": replace(
        MIXAMO, root="Root", trunk=_SPINE3.replace("Spine2", "Spine4").replace("Spine1:", "Spine2:")
    ),
    "OptiTrack": OPTITRACK,
    "Vicon": VICON,
    "Vicon Shogun": replace(MIXAMO, prefix="Dancer:", root="Root"),
    "CMU": CMU,
    "CMU for DAZ and Poser": POSER,
    "DAZ Genesis 8": DAZ_G8,
    "DAZ Genesis 9": DAZ_G9,
    "MMD, Japanese": MMD,
    "MMD, English": replace(
        MMD, trunk="center:pelvis, upper body:spine1, upper body2:spine3, neck:neck, head:head",
        leg="leg_{L}:hip, knee_{L}:knee, ankle_{L}:ankle, toe_{L}:foot",
        arm="shoulder_{L}:collar, arm_{L}:shoulder, elbow_{L}:elbow, wrist_{L}:wrist",
        above_hips="lower body", root="mother",
        extra="leg IK_{L}<leg_{L}, arm twist_{L}<arm_{L}, wrist twist_{L}<elbow_{L}, middle1_{L}<wrist_{L}",
    ),
    "MMD, Roman letters": replace(
        MMD, trunk="sentaa:pelvis, jouhanshin:spine1, jouhanshin2:spine3, kubi:neck, atama:head",
        leg="{h}_ashi:hip, {h}_hiza:knee, {h}_ashikubi:ankle, {h}_tsumasaki:foot",
        arm="{h}_kata:collar, {h}_ude:shoulder, {h}_hiji:elbow, {h}_tekubi:wrist",
        above_hips="kahanshin", root="", extra="",
    ),
    "MMD in Blender": replace(
        MMD, leg="足.{L}:hip, ひざ.{L}:knee, 足首.{L}:ankle, つま先.{L}:foot",
        arm="肩.{L}:collar, 腕.{L}:shoulder, ひじ.{L}:elbow, 手首.{L}:wrist", extra="", up="z",
        units_per_m=1.0,
    ),
    "Unreal": UNREAL,
    "Unreal, five spine bones": replace(
        UNREAL, trunk="pelvis:pelvis, spine_01:spine1, spine_02, spine_03:spine2, spine_04, spine_05:spine3, "
        "neck_01:neck, neck_02, head:head",
    ),
    "Unity": replace(VRM, trunk="Hips:pelvis, Spine:spine1, Chest:spine3, Neck:neck, Head:head",
                     leg="{S}UpperLeg:hip, {S}LowerLeg:knee, {S}Foot:ankle, {S}Toes:foot",
                     arm="{S}Shoulder:collar, {S}UpperArm:shoulder, {S}LowerArm:elbow, {S}Hand:wrist",
                     fingers="{S}{F}{n}"),
    "VRM": VRM,
    "VRoid": replace(
        VRM, trunk="J_Bip_C_Hips:pelvis, J_Bip_C_Spine:spine1, J_Bip_C_Chest:spine2, "
        "J_Bip_C_UpperChest:spine3, J_Bip_C_Neck:neck, J_Bip_C_Head:head",
        leg="J_Bip_{L}_UpperLeg:hip, J_Bip_{L}_LowerLeg:knee, J_Bip_{L}_Foot:ankle, J_Bip_{L}_ToeBase:foot",
        arm="J_Bip_{L}_Shoulder:collar, J_Bip_{L}_UpperArm:shoulder, J_Bip_{L}_LowerArm:elbow, "
        "J_Bip_{L}_Hand:wrist", fingers="J_Bip_{L}_{F}{n}", root="Root",
    ),
    "Rigify, metarig": RIGIFY,
    "Rigify, DEF": RIGIFY_DEF,
    "Rigify, ORG": replace(RIGIFY, prefix="ORG-"),
    "Character Creator": CHARACTER_CREATOR,
    "AccuRIG": replace(CHARACTER_CREATOR, root="RL_BoneRoot", arms_down_rad=0.7, units_per_m=1.0),
    "3ds Max Biped": BIPED,
    "3ds Max Biped, underscores": replace(
        BIPED, leg=BIPED.leg.replace(" T", "_T").replace("} ", "}_"), arm=BIPED.arm.replace("} ", "}_"),
        prefix="Bip001_",
    ),
    "Maya HumanIK": replace(MIXAMO, prefix="Character1_", root="Reference"),
    "MotionBuilder": replace(MIXAMO, prefix="BVH:", root="reference", heading_rad=np.pi),
    "Perception Neuron": replace(
        MIXAMO, trunk="Hips:pelvis, Spine:spine1, Spine1, Spine2:spine2, Spine3:spine3, Neck:neck, Head:head",
        prefix="Robot_", leg=_NO_TOES,
    ),
    "Kinect": KINECT,
    "SMPL": SMPL,
    "SMPL-X": SMPLX,
    "LAFAN1": replace(MIXAMO, leg=_NO_TOES + ", {S}Toe:foot", fingers=""),
    "Bandai-Namco": BANDAI_NAMCO,
    "Ready Player Me": replace(MIXAMO, root="Armature", units_per_m=1.0, arms_down_rad=0.7),
    "a namespace in a namespace": replace(MIXAMO, prefix="scene:hero:"),
    "no toes, no fingers": replace(MIXAMO, leg=_NO_TOES, fingers=""),
    "a single spine bone": replace(MIXAMO, trunk=_ONE_SPINE),
    "four spine bones": replace(UNREAL, trunk="pelvis:pelvis, spine_01:spine1, spine_02, spine_03:spine2, "
                                "spine_04:spine3, neck_01:neck, head:head"),
    "numbered": number(MIXAMO),
    "numbered, an A pose that looks aside, Z up": number(
        replace(UNREAL, root="joint_root", heading_rad=np.pi / 2), "Bone.{:03d}"
    ),
    "numbered, no toes but the ends of feet": number(replace(MIXAMO, leg=_NO_TOES)),
    "numbered, with hip joints": number(CMU),
    "numbered, twist bones in line": number(replace(RIGIFY_DEF, prefix=""), "b{}_"),
}  # fmt: skip


FILES = [SaneFile(name, partial(write_bvh, rig)) for name, rig in RIGS.items()]


def test_rigs_are_read_with_every_joint_where_it_is(tmp_path):
    assert_read(FILES, _check, tmp_path, n_files=40)


def _check(path: Path) -> None:
    """Every joint that the rig has is found as what it is, and the body stands."""
    (take,) = import_takes(path)
    truth = made_of(RIGS[path.parent.name]).roles
    skeleton = take.motion.skeleton
    found = {role: skeleton.names[joint] for role, joint in joint_roles(skeleton).items()}
    wrong = {role: found.get(role) for role in truth if found.get(role) != truth[role]}
    invented = {role: found[role] for role in found.keys() - truth.keys()}
    # A refusal, so that all rigs that are read wrongly are listed.
    if wrong or invented:
        raise FormatError(
            f"wrong: {wrong}, expected { ({r: truth[r] for r in wrong}) }; invented: {invented}"
        )
    pos_m = take.motion.joint_pos_m()[0]
    height_m = pos_m[skeleton.index(found["head"]), 1] - pos_m[skeleton.index(found["left_ankle"]), 1]
    if not 1.1 < height_m < 1.9:  # a unit of 8 cm, as MMD's, is read as a decimetre
        raise FormatError(f"expected a body that stands, got a head {height_m:.2f} m above the ankles")
