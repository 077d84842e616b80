"""Bodies as messages of the Virtual Motion Capture protocol."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_motions import stepping, swaying

from choreograph.core.counts import Figure
from choreograph.core.errors import FormatError
from choreograph.live.vmc import Message, VmcBody, bundle, messages_of
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)
NUMBERS = st.integers(-(2**31), 2**31 - 1) | st.floats(width=32, allow_nan=False)
MESSAGES = st.builds(
    Message, TEXTS.map(lambda text: f"/{text}"), st.lists(NUMBERS | TEXTS, max_size=5).map(tuple)
)


def test_the_examples_of_the_specification():
    """OSC 1.0, "OSC Message Examples"."""
    first = Message("/oscillator/4/frequency", (440.0,)).to_bytes()
    assert first == b"/oscillator/4/frequency\0,f\0\0\x43\xdc\0\0"
    second = Message("/foo", (1000, -1, "hello", 1.234, 5.678)).to_bytes()
    numbers = bytes.fromhex("000003e8ffffffff68656c6c6f0000003f9df3b640b5b22d")
    assert second == b"/foo\0\0\0\0,iisff\0\0" + numbers


@given(st.lists(MESSAGES, max_size=4))
def test_what_is_written_is_read(messages):
    packet = bundle(messages)
    assert len(packet) % 4 == 0
    assert messages_of(packet) == messages
    assert messages_of(bundle([])) == []
    for message in messages:
        assert messages_of(message.to_bytes()) == [message]


@given(st.binary(max_size=60))
def test_other_packets_are_refused_or_read(packet):
    for data in (packet, b"#bundle\0" + packet, b"/a\0\0" + packet):
        try:
            messages_of(data)
        except FormatError:
            continue


def test_bundles_in_bundles_end():
    packet = Message("/a").to_bytes()
    for _ in range(20):
        packet = b"#bundle\0" + struct.pack(">Qi", 1, len(packet)) + packet
    with pytest.raises(FormatError, match="bundles in bundles"):
        messages_of(packet)


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

FINGERS = {
    f"{side}{finger}{segment}": f"{side}{finger}{before}" if before else f"{side}Hand"
    for side in ("Left", "Right")
    for finger in ("Thumb", "Index", "Middle", "Ring", "Little")
    for segment, before in (("Proximal", ""), ("Intermediate", "Proximal"), ("Distal", "Intermediate"))
}


def received(packet: bytes) -> tuple[dict[str, np.ndarray], list[str]]:
    """World positions of bones in Unity's axes, and the addresses."""
    messages = messages_of(packet)
    local = {m.arguments[0]: np.array(m.arguments[1:]) for m in messages if m.address == "/VMC/Ext/Bone/Pos"}
    pos_m, turned = {}, {}
    for name in ["Hips", *PARENTS, *FINGERS]:
        position, quat = local[name][:3], local[name][[6, 3, 4, 5]]
        if name == "Hips":
            pos_m[name], turned[name] = position, quat
        else:
            parent = (PARENTS | FINGERS)[name]
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
    assert {m.arguments[0] for m in messages[3:]} == {"Hips", *PARENTS, *FINGERS}
    assert len(messages) == 3 + 22 + 30
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


def test_a_receiver_sees_hands_open_and_closed_in_figures_and_relaxed_elsewhere():
    skeleton = canonical_skeleton()
    still = Motion(
        skeleton, np.tile(skeleton.offsets_m[0], (240, 1)), np.tile(rot.IDENTITY, (240, 24, 1)), 60.0
    )
    body = VmcBody.of(still, [Figure("jack", 1.0, 2.0, 4), Figure("fan", 2.0, 3.0, 4)])
    reach_m, below_m = {}, {}
    for shape, frame in (("relaxed", 10), ("fist", 90), ("open", 150)):
        pos_m, _ = received(body.packet(frame, 0.0))
        for side, out in (("Left", -1.0), ("Right", 1.0)):
            first, last = pos_m[f"{side}IndexProximal"], pos_m[f"{side}IndexDistal"]
            assert (
                out * (first - pos_m[f"{side}Hand"])[0] > 0.08 and pos_m[f"{side}ThumbProximal"][2] > first[2]
            )
            reach_m[shape], below_m[shape] = np.linalg.norm(last - first), first[1] - last[1]
        tips = [pos_m[f"{side}RingDistal"] for side in ("Left", "Right")]
        np.testing.assert_allclose(tips[0] * [-1.0, 1.0, 1.0], tips[1], atol=1e-6)
    assert reach_m["open"] > reach_m["relaxed"] > reach_m["fist"] + 0.01
    assert below_m["fist"] > 0.03 and below_m["relaxed"] > 0.01 and abs(below_m["open"]) < 1e-6


def test_fingers_change_smoothly_where_another_body_goes_on():
    motion = swaying(120, fps=60.0)
    fists = VmcBody.of(motion, [Figure("jack", 0.0, 9.0, 4)])
    joined = fists.joined(VmcBody.of(motion), 60)
    finger = joined.names.index("RightMiddleProximal")
    steps = np.abs(np.diff(joined.bone_quat[:, finger], axis=0)).max(axis=1)
    assert (steps[:59] == 0.0).all() and 0.0 < steps.max() < 0.05
    np.testing.assert_array_equal(joined.bone_quat[95, finger], VmcBody.of(motion).bone_quat[95, finger])
    np.testing.assert_array_equal(joined.bone_quat[60:, :22], VmcBody.of(motion).bone_quat[60:, :22])


def test_left_is_at_minus_x_and_front_at_plus_z():
    skeleton = canonical_skeleton()
    rest = Motion(skeleton, skeleton.offsets_m[:1], np.tile(rot.IDENTITY, (1, 24, 1)), 60.0)
    pos_m, _ = received(VmcBody.of(rest).packet(0, 0.0))
    assert pos_m["LeftHand"][0] < -0.4 and pos_m["RightHand"][0] > 0.4
    assert pos_m["LeftToes"][2] > pos_m["LeftFoot"][2] and pos_m["Head"][1] > 1.4
