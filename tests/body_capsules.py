"""Self-intersection of a motion on the canonical body: capsules for limbs, a cylinder for the trunk."""

from __future__ import annotations

import numpy as np

from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.motion import Motion

TORSO_HALF_WIDTH_M, TORSO_HALF_DEPTH_M = 0.135, 0.085
FOREARM_M, HAND_M, THIGH_M, SHIN_M, HEAD_M = 0.032, 0.02, 0.065, 0.042, 0.085


def depths_m(motion: Motion) -> dict[str, np.ndarray]:
    """Penetration depth (T,) in metres, negative when apart, for each pair of parts."""
    sk = motion.skeleton
    pos, quat = forward(sk, motion.root_pos_m, motion.local_quat)
    at = {name: pos[:, sk.index(name)] for name in sk.names}
    for parent, tip in zip(sk.tip_parents, sk.tips_m, strict=True):
        at[sk.names[parent] + "_tip"] = pos[:, parent] + rot.rotate(quat[:, parent], tip)
    chest, hips = quat[:, sk.index("spine2")], quat[:, 0]
    found = {}
    for side, across in (("left", "right"), ("right", "left")):
        arm = [*_along(at[f"{side}_elbow"], at[f"{side}_wrist"], FOREARM_M, (0.3, 0.6, 0.9)),
               *_along(at[f"{side}_wrist"], at[f"{side}_hand"], HAND_M, (0.5, 1.0))]  # fmt: skip
        torso = [
            _depth_in_cylinder(p, at["spine2"], at["spine3"] + 0.6 * (at["neck"] - at["spine3"]), chest, r)
            for p, r in arm
        ]
        belly = [_depth_in_cylinder(p, at["pelvis"], at["spine2"], hips, r) for p, r in arm]
        found[f"{side} arm in torso"] = np.max(torso + belly, axis=0)
        head = 0.5 * (at["head"] + at["head_tip"])
        found[f"{side} arm in head"] = np.max([r + HEAD_M - _length(p - head) for p, r in arm], axis=0)
        for leg in ("left", "right"):
            hip, knee = at[f"{leg}_hip"], at[f"{leg}_knee"]
            thigh = [THIGH_M + r - _to_segment(p, hip + 0.3 * (knee - hip), knee) for p, r in arm]
            found[f"{side} arm in {leg} thigh"] = np.max(thigh, axis=0)
        shin = _along(at[f"{side}_knee"], at[f"{side}_ankle"], SHIN_M, (0.0, 0.25, 0.5, 0.75, 1.0))
        foot = _along(at[f"{side}_ankle"], at[f"{side}_foot_tip"], 0.03, (0.5, 1.0))
        other = at[f"{across}_knee"], at[f"{across}_ankle"]
        found[f"{side} leg in {across}"] = np.max(
            [r + SHIN_M - _to_segment(p, *other) for p, r in [*shin, *foot]], axis=0
        )
    found["hands"] = np.max(
        [ra + rb - _length(a - b)
         for a, ra in _along(at["left_elbow"], at["left_hand"], FOREARM_M, (0.4, 0.7))
         for b, rb in _along(at["right_elbow"], at["right_hand"], FOREARM_M, (0.4, 0.7))], axis=0
    )  # fmt: skip
    return found


def _along(a, b, radius, shares):
    return [(a + s * (b - a), radius) for s in shares]


def _length(v):
    return np.linalg.norm(v, axis=-1)


def _to_segment(p, a, b):
    d = b - a
    s = np.clip(np.sum((p - a) * d, axis=-1) / np.sum(d * d, axis=-1), 0.0, 1.0)[:, None]
    return _length(p - a - s * d)


def _depth_in_cylinder(p, low, high, quat, radius):
    """Depth in an upright elliptic cylinder between two joints."""
    d = high - low
    s = np.sum((p - low) * d, axis=-1) / np.sum(d * d, axis=-1)
    local = rot.rotate(rot.invert(quat), p - low - np.clip(s, 0.0, 1.0)[:, None] * d)
    size = np.hypot(local[:, 0] / (TORSO_HALF_WIDTH_M + radius), local[:, 2] / (TORSO_HALF_DEPTH_M + radius))
    return np.where((s > -0.1) & (s < 1.1), (1.0 - size) * TORSO_HALF_DEPTH_M, -1.0)
