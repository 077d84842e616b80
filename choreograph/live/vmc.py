"""The Virtual Motion Capture protocol: a body as messages that avatar programs and engines receive.

Positions are in metres. The axes are those of Unity: X right, Y up, Z forward, left-handed. Here, a dancer
faces +Z with the left side at +X, so that X changes its sign. Rotations of bones are relative to a T pose, as
those of Unity's humanoid are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from choreograph.core.numerics import Floats
from choreograph.formats.glb import VRM_BONES
from choreograph.live.osc import Message, bundle
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import CANONICAL_JOINTS, canonical_skeleton

_POSITION = np.array([-1.0, 1.0, 1.0])  # to Unity's axes
_QUAT_XYZW = np.array([1.0, -1.0, -1.0, 1.0])  # the same of a rotation
# Unity's names of humanoid bones begin with a capital letter, those of VRM do not.
BONES = {name: bone[0].upper() + bone[1:] for name, bone in VRM_BONES.items()}


@dataclass(frozen=True, eq=False)
class VmcBody:
    """The frames of a dance in Unity's axes, from which packets are made."""

    bone_pos_m: Floats  # (T, B, 3) from the parent bone
    bone_quat: Floats  # (T, B, 4) xyzw, relative to the parent bone
    names: tuple[str, ...]  # (B,) of Unity's humanoid

    @classmethod
    def of(cls, motion: Motion) -> VmcBody:
        """A motion on any skeleton with known names, which is retargeted to one in a T pose.

        Raises `ParameterError` if the names are unknown.
        """
        body = canonical_skeleton()
        dancer = motion if motion.skeleton.same_as(body) else retarget(motion, body)
        joints = [CANONICAL_JOINTS.index(name) for name in BONES]
        pos_m = np.tile(body.offsets_m[joints], (dancer.n_frames, 1, 1))
        pos_m[:, joints.index(0)] = dancer.root_pos_m
        quat = dancer.local_quat[:, joints][..., [1, 2, 3, 0]]
        return cls(pos_m * _POSITION, quat * _QUAT_XYZW, tuple(BONES.values()))

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
        names = [name[0].lower() + name[1:] for name in self.names]
        hips_m = self.bone_pos_m[frame, names.index("hips")] * _POSITION
        return {
            "time_s": round(time_s, 4),
            "frame": frame,
            "hips_pos_m": [round(value, 5) for value in hips_m.tolist()],
            "bones": {name: [round(v, 5) for v in value] for name, value in zip(names, quat, strict=True)},
        }

    def joined(self, other: VmcBody, first: int) -> VmcBody:
        """This body until the frame `first`, and from it on another one of the same length."""
        pairs = (self.bone_pos_m, other.bone_pos_m), (self.bone_quat, other.bone_quat)
        pos_m, quat = (np.concatenate([mine[:first], its[first : len(mine)]]) for mine, its in pairs)
        return VmcBody(pos_m, quat, self.names)

    def between(self, frame: float) -> VmcBody:
        """One frame between two of this body, at a fractional frame from 0 to the last one."""
        first = min(int(frame), len(self) - 1)
        second, share = min(first + 1, len(self) - 1), frame - first
        near, far = self.bone_quat[first], self.bone_quat[second]
        far = np.where((near * far).sum(axis=-1, keepdims=True) < 0, -far, far)
        quat = near + share * (far - near)
        quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
        pos_m = self.bone_pos_m[first] + share * (self.bone_pos_m[second] - self.bone_pos_m[first])
        return VmcBody(pos_m[None], quat[None], self.names)

    def __len__(self) -> int:
        return len(self.bone_pos_m)
