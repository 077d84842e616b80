"""The VMC protocol: names, axes and rotations, as a receiver puts the body together."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping, swaying

from choreograph.live.osc import messages_of
from choreograph.live.vmc import VmcBody
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

PARENTS = {
    "Spine": "Hips", "Chest": "Spine", "UpperChest": "Chest", "Neck": "UpperChest", "Head": "Neck",
    **{
        f"{side}{bone}": parent if parent in ("Hips", "UpperChest") else f"{side}{parent}"
        for side in ("Left", "Right")
        for bone, parent in (
            ("UpperLeg", "Hips"), ("LowerLeg", "UpperLeg"), ("Foot", "LowerLeg"), ("Toes", "Foot"),
            ("Shoulder", "UpperChest"), ("UpperArm", "Shoulder"), ("LowerArm", "UpperArm"),
            ("Hand", "LowerArm"),
        )
    },
}  # fmt: skip


def received(packet: bytes) -> tuple[dict[str, np.ndarray], list[str]]:
    """World positions of bones in Unity's axes, and the addresses."""
    messages = messages_of(packet)
    local = {m.arguments[0]: np.array(m.arguments[1:]) for m in messages if m.address == "/VMC/Ext/Bone/Pos"}
    pos_m, turned = {}, {}
    for name in ["Hips", *PARENTS]:
        position, quat = local[name][:3], local[name][[6, 3, 4, 5]]
        if name == "Hips":
            pos_m[name], turned[name] = position, quat
        else:
            parent = PARENTS[name]
            pos_m[name] = pos_m[parent] + rot.rotate(turned[parent], position)
            turned[name] = rot.multiply(turned[parent], quat)
    return pos_m, [m.address for m in messages]


def test_a_packet_has_all_that_a_receiver_needs():
    body = VmcBody.of(swaying(30))
    messages = messages_of(body.packet(3, 0.05))
    assert messages[0].arguments == (1,)
    assert messages[1].arguments == (pytest.approx(0.05),)
    assert messages[2].arguments == ("root", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    assert [m.address for m in messages[:3]] == ["/VMC/Ext/OK", "/VMC/Ext/T", "/VMC/Ext/Root/Pos"]
    assert {m.arguments[0] for m in messages[3:]} == {"Hips", *PARENTS}
    assert body.packet(3, 0.05).startswith(b"#bundle\0")


@pytest.mark.parametrize("motion", [swaying(20), stepping(20)], ids=["swaying", "stepping"])
def test_a_receiver_sees_the_body_mirrored_into_unitys_axes(motion):
    body = VmcBody.of(motion)
    joints = motion.joint_pos_m()
    for frame in (0, 7, 19):
        pos_m, _ = received(body.packet(frame, 0.0))
        for name, joint in (("Head", "head"), ("LeftHand", "left_wrist"), ("RightToes", "right_foot")):
            there = joints[frame, CANONICAL_JOINTS.index(joint)] * [-1.0, 1.0, 1.0]
            np.testing.assert_allclose(pos_m[name], there, atol=1e-4)


def test_left_is_at_minus_x_and_front_at_plus_z():
    skeleton = canonical_skeleton()
    rest = Motion(skeleton, skeleton.offsets_m[:1], np.tile(rot.IDENTITY, (1, 24, 1)), 60.0)
    pos_m, _ = received(VmcBody.of(rest).packet(0, 0.0))
    assert pos_m["LeftHand"][0] < -0.4 and pos_m["RightHand"][0] > 0.4
    assert pos_m["LeftToes"][2] > pos_m["LeftFoot"][2] and pos_m["Head"][1] > 1.4
