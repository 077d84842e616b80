"""The Virtual Motion Capture protocol: a body as messages that avatar programs and engines receive.

The messages are those of Open Sound Control 1.0 (OSC): numbers and texts, and bundles of them, as bytes.
Texts are padded with zeros to a multiple of four bytes, and numbers are big-endian (specification, "OSC
Packets"). python-osc is not used, because it takes seven times as long for a frame of a body, 1 to 2 ms.

Positions are in metres. The axes are those of Unity: X right, Y up, Z forward, left-handed. Here, a dancer
faces +Z with the left side at +X, so that X changes its sign. Rotations of bones are relative to a T pose, as
those of Unity's humanoid are. Fingers are relaxed, open or a fist, by the figures that are danced.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from choreograph.core.counts import Figure
from choreograph.core.errors import FormatError
from choreograph.core.numerics import Floats
from choreograph.formats.glb import VRM_BONES
from choreograph.motion.hands import ALONG, FINGERS, THUMB_ALONG, finger_quats, hand_spans, shape_shares
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

# Messages of OSC.


Argument = int | float | str
_BUNDLE = b"#bundle\0"
_AT_ONCE = 1  # the time tag of a bundle that is handled when it arrives
_MAX_DEPTH = 8  # of bundles in bundles


@dataclass(frozen=True)
class Message:
    """An address, such as /VMC/Ext/T, and its arguments."""

    address: str
    arguments: tuple[Argument, ...] = ()

    def to_bytes(self) -> bytes:
        """The message. Floats have 32 bits."""
        tags, data = ",", b""
        for argument in self.arguments:
            if isinstance(argument, str):
                tags, data = tags + "s", data + _text(argument)
            elif isinstance(argument, int):
                tags, data = tags + "i", data + struct.pack(">i", argument)
            else:
                tags, data = tags + "f", data + struct.pack(">f", argument)
        return _text(self.address) + _text(tags) + data


def bundle(messages: Sequence[Message]) -> bytes:
    """Messages in one packet, to be handled at once."""
    parts = [message.to_bytes() for message in messages]
    return _BUNDLE + struct.pack(">Q", _AT_ONCE) + b"".join(struct.pack(">i", len(p)) + p for p in parts)


def messages_of(packet: bytes) -> list[Message]:
    """The messages of a packet. Raises `FormatError` if it is not of OSC."""
    try:
        return list(_messages(packet, _MAX_DEPTH))
    except (struct.error, UnicodeDecodeError, ValueError) as error:
        raise FormatError(f"expected a packet of OSC, got another: {error}") from None


def _messages(packet: bytes, depth: int) -> Iterator[Message]:
    if not packet.startswith(_BUNDLE):
        yield _message(packet)
        return
    if depth == 0:
        raise ValueError("bundles in bundles")
    at = len(_BUNDLE) + 8
    while at < len(packet):
        (size,) = struct.unpack_from(">i", packet, at)
        if not 0 < size <= len(packet) - at - 4:
            raise ValueError(f"a part of {size} bytes")
        yield from _messages(packet[at + 4 : at + 4 + size], depth - 1)
        at += 4 + size


def _message(packet: bytes) -> Message:
    address, at = _read_text(packet, 0)
    tags, at = _read_text(packet, at) if at < len(packet) else (",", at)
    if not address.startswith("/") or not tags.startswith(","):
        raise ValueError("no address and types")
    arguments: list[Argument] = []
    for tag in tags[1:]:
        if tag == "s":
            text, at = _read_text(packet, at)
            arguments.append(text)
        elif tag in "if":
            arguments.append(struct.unpack_from(f">{tag}", packet, at)[0])
            at += 4
        else:
            raise ValueError(f"an argument of type {tag!r}")
    return Message(address, tuple(arguments))


def _text(text: str) -> bytes:
    data = text.encode() + b"\0"
    return data + b"\0" * (-len(data) % 4)


def _read_text(packet: bytes, at: int) -> tuple[str, int]:
    end = packet.index(b"\0", at)
    return packet[at:end].decode(), at + (end - at) // 4 * 4 + 4


# The body.


_POSITION = np.array([-1.0, 1.0, 1.0])  # to Unity's axes
_QUAT_XYZW = np.array([1.0, -1.0, -1.0, 1.0])  # the same of a rotation
# Unity's names of humanoid bones begin with a capital letter, those of VRM do not.
BONES = {name: bone[0].upper() + bone[1:] for name, bone in VRM_BONES.items()}
_UNITYS_FINGERS = {finger: "Little" if finger == "pinky" else finger.capitalize() for finger in FINGERS}
_UNITYS_SEGMENTS = ("Proximal", "Intermediate", "Distal")
FINGER_BONES = tuple(
    f"{side}{_UNITYS_FINGERS[finger]}{segment}"
    for side in ("Left", "Right")
    for finger in FINGERS
    for segment in _UNITYS_SEGMENTS
)
# The segments of a thumb have other names in VRM 1.0.
_VRMS_THUMB = {"ThumbProximal": "ThumbMetacarpal", "ThumbIntermediate": "ThumbProximal"}
# Of a left hand: the first joint of each finger from the wrist, and the lengths of two segments, in metres.
_KNUCKLES_M = {
    "thumb": (0.030, -0.010, 0.030), "index": (0.090, 0.0, 0.026), "middle": (0.092, 0.0, 0.004),
    "ring": (0.087, 0.0, -0.016), "pinky": (0.080, 0.0, -0.034),
}  # fmt: skip
_LENGTHS_M = {
    "thumb": (0.042, 0.032), "index": (0.040, 0.024), "middle": (0.044, 0.027), "ring": (0.041, 0.026),
    "pinky": (0.032, 0.019),
}  # fmt: skip
_JOIN_FRAMES = 30  # in which fingers change from one body to another


@dataclass(frozen=True, eq=False)
class VmcBody:
    """The frames of a dance in Unity's axes, from which packets are made."""

    bone_pos_m: Floats  # (T, B, 3) from the parent bone
    bone_quat: Floats  # (T, B, 4) xyzw, relative to the parent bone
    names: tuple[str, ...]  # (B,) of Unity's humanoid

    @classmethod
    def of(cls, motion: Motion, figures: Sequence[Figure] = ()) -> VmcBody:
        """A motion on any skeleton with known names, which is retargeted to one in a T pose.

        Fingers are relaxed, or open or a fist in `figures`, whose times are from the first frame.

        Raises `ParameterError` if the names are unknown.
        """
        body = canonical_skeleton()
        dancer = motion if motion.skeleton.same_as(body) else retarget(motion, body)
        joints = [CANONICAL_JOINTS.index(name) for name in BONES]
        pos_m = np.tile(body.offsets_m[joints], (dancer.n_frames, 1, 1))
        pos_m[:, joints.index(0)] = dancer.root_pos_m
        fingers_m, fingers = _fingers(dancer.n_frames, dancer.fps, figures)
        pos_m = np.concatenate([pos_m, np.tile(fingers_m, (dancer.n_frames, 1, 1))], axis=1)
        quat = np.concatenate([dancer.local_quat[:, joints], fingers], axis=1)[..., [1, 2, 3, 0]]
        return cls(pos_m * _POSITION, quat * _QUAT_XYZW, (*BONES.values(), *FINGER_BONES))

    def packet(self, frame: int, time_s: float) -> bytes:
        """One bundle: that the body is available, the time, the root, and all bones."""
        messages = [
            Message("/VMC/Ext/OK", (1,)),
            Message("/VMC/Ext/T", (float(time_s),)),
            Message("/VMC/Ext/Root/Pos", ("root", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
        ]
        for name, pos_m, quat in zip(self.names, self.bone_pos_m[frame], self.bone_quat[frame], strict=True):
            messages.append(Message("/VMC/Ext/Bone/Pos", (name, *pos_m.tolist(), *quat.tolist())))
        return bundle(messages)

    def pose(self, frame: int, time_s: float) -> dict[str, Any]:
        """A frame as JSON values, in the axes of glTF and VRM: right-handed, Y up, the dancer faces +Z.

        `hips_pos_m` is in metres from the origin of the stage. `bones` are rotations xyzw by VRM's names,
        relative to the parent bone and to a T pose.
        """
        quat = (self.bone_quat[frame] * _QUAT_XYZW).tolist()
        names = [_vrm_name(name) for name in self.names]
        hips_m = self.bone_pos_m[frame, names.index("hips")] * _POSITION
        return {
            "time_s": round(time_s, 4),
            "frame": frame,
            "hips_pos_m": [round(value, 5) for value in hips_m.tolist()],
            "bones": {name: [round(v, 5) for v in value] for name, value in zip(names, quat, strict=True)},
        }

    def joined(self, other: VmcBody, first: int) -> VmcBody:
        """This body until the frame `first`, and from it on another one of the same length.

        Fingers change within some frames, since a hand may have another shape from there on.
        """
        pairs = (self.bone_pos_m, other.bone_pos_m), (self.bone_quat, other.bone_quat)
        pos_m, quat = (np.concatenate([mine[:first], its[first : len(mine)]]) for mine, its in pairs)
        span = slice(first, min(first + _JOIN_FRAMES, len(self)))
        fingers = [self.names.index(name) for name in FINGER_BONES]
        share = ((np.arange(span.start, span.stop) - first + 1) / (_JOIN_FRAMES + 1))[:, None, None]
        mine, its = self.bone_quat[span][:, fingers], quat[span][:, fingers]
        quat[span, fingers] = np.where(mine == its, its, _between(mine, its, share))
        return VmcBody(pos_m, quat, self.names)

    def between(self, frame: float) -> VmcBody:
        """One frame between two of this body, at a fractional frame from 0 to the last one."""
        first = min(int(frame), len(self) - 1)
        second, share = min(first + 1, len(self) - 1), frame - first
        quat = _between(self.bone_quat[first], self.bone_quat[second], share)
        pos_m = self.bone_pos_m[first] + share * (self.bone_pos_m[second] - self.bone_pos_m[first])
        return VmcBody(pos_m[None], quat[None], self.names)

    def __len__(self) -> int:
        return len(self.bone_pos_m)


def _vrm_name(name: str) -> str:
    """The name that VRM 1.0 has for one of Unity's bones."""
    side, bone = (name[:5], name[5:]) if name.startswith("Right") else (name[:4], name[4:])
    name = f"{side}{_VRMS_THUMB.get(bone, bone)}"
    return name[0].lower() + name[1:]


def _fingers(n_frames: int, fps: float, figures: Sequence[Figure]) -> tuple[Floats, Floats]:
    """Positions (30, 3) of the bones of fingers from their parents, and local rotations (T, 30, 4)."""
    shares = shape_shares(n_frames, fps, hand_spans(figures))
    places, turns = [], []
    for side in ("left", "right"):
        quats = finger_quats(side, shares)
        for finger in FINGERS:
            along = THUMB_ALONG if finger == "thumb" else ALONG
            own = [np.array(_KNUCKLES_M[finger]), *(length_m * along for length_m in _LENGTHS_M[finger])]
            places += [place * (1.0 if side == "left" else -1.0, 1.0, 1.0) for place in own]
            turns.append(quats[finger])
    return np.array(places), np.concatenate(turns, axis=1)


def _between(near: Floats, far: Floats, share: float | Floats) -> Floats:
    """Rotations between two (..., 4), which are near each other."""
    far = np.where((near * far).sum(axis=-1, keepdims=True) < 0, -far, far)
    quat: Floats = near + share * (far - near)
    quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
    return quat
