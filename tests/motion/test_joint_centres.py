"""Joint centres from markers on a body whose joints are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_markers import markers_on
from synthetic_motions import swaying

from choreograph.core.errors import ParameterError
from choreograph.motion.joint_centres import REQUIRED_MARKERS, joint_centres
from choreograph.motion.kinematics import forward

MOTION = swaying(400, fps=80.0)
MARKERS = markers_on(MOTION)
# The hand, from a marker, and the landmarks are where they are defined to be.
FOUND = tuple(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
)


def error_m(markers) -> dict[str, float]:
    pos_m, roles = joint_centres(markers)
    true_m = MOTION.joint_pos_m()
    moved = (pos_m[:, roles.index(role)] - true_m[:, MOTION.skeleton.index(role)] for role in FOUND)
    return {role: float(np.linalg.norm(d, axis=-1).mean()) for role, d in zip(FOUND, moved, strict=True)}


def test_joints_are_found_inside_the_body():
    errors = error_m(MARKERS)
    assert max(errors.values()) < 0.02
    on_skin = MARKERS["LKNE"] - MOTION.joint_pos_m()[:, MOTION.skeleton.index("left_knee")]
    assert errors["left_knee"] < 0.25 * np.linalg.norm(on_skin, axis=-1).mean()


def test_bones_keep_their_length():
    pos_m, roles = joint_centres(MARKERS)
    for side in ("left", "right"):
        for a, b in (("hip", "knee"), ("knee", "ankle"), ("elbow", "wrist")):
            bone = pos_m[:, roles.index(f"{side}_{a}")] - pos_m[:, roles.index(f"{side}_{b}")]
            assert np.linalg.norm(bone, axis=-1).std() < 0.006


def test_markers_placed_too_high_are_corrected_by_the_motion():
    """Some performers of ChoreoNet have their ankle markers 5 cm above the ankle."""
    up = 0.125 * (MARKERS["LKNE"] - MARKERS["LANK"])
    assert np.linalg.norm(up, axis=-1).mean() > 0.045
    errors = error_m(MARKERS | {"LANK": MARKERS["LANK"] + up})
    assert errors["left_ankle"] < 0.025


def test_the_directions_of_left_and_right_are_kept():
    mirror = np.array([-1.0, 1.0, 1.0])
    mirrored = {
        name.translate({ord("L"): "R", ord("R"): "L"})[0] + name[1:]: pos * mirror
        for name, pos in MARKERS.items()
        if name in REQUIRED_MARKERS and name[1:] in {m[1:] for m in REQUIRED_MARKERS if m[0] == "R"}
    } | {name: MARKERS[name] * mirror for name in ("C7", "T10", "CLAV", "STRN")}
    without_extras = {name: MARKERS[name] for name in REQUIRED_MARKERS}
    there, roles = joint_centres(without_extras)
    back, _ = joint_centres(mirrored)
    for role in FOUND:
        other = role.replace("left", "*").replace("right", "left").replace("*", "right")
        np.testing.assert_allclose(
            back[:, roles.index(other)] * mirror, there[:, roles.index(role)], atol=2e-3
        )


def test_stretched_knees_are_straight_not_bent_back():
    """The shank's markers 3 cm too far in front: every knee seems bent back by some degrees."""
    names = MOTION.skeleton.names
    quat = MOTION.local_quat.copy()
    for side in ("left", "right"):  # half of the frames with straight legs
        quat[::2, names.index(f"{side}_knee")] = [1.0, 0.0, 0.0, 0.0]
    motion = replace(MOTION, local_quat=quat)
    markers = markers_on(motion)
    pos_m, _ = forward(motion.skeleton, motion.root_pos_m, quat)
    hip, ankle = (pos_m[:, names.index(f"left_{part}")] for part in ("hip", "ankle"))
    backwards = np.cross(markers["LKNE"] - hip, ankle - hip)
    backwards = backwards / np.linalg.norm(backwards, axis=-1, keepdims=True)
    for shift_m in (-0.03, 0.0):
        moved = {name: markers[name] + shift_m * backwards for name in ("LKNE", "LTHI")}
        centres, roles = joint_centres(markers | moved)
        hip, knee, ankle = (centres[:, roles.index(f"left_{part}")] for part in ("hip", "knee", "ankle"))
        bend = np.sum(np.cross(knee - hip, ankle - knee) * (markers["LKNE"] - knee), axis=-1)
        assert np.percentile(bend, 5) > -1e-4


def test_a_missing_marker_is_named():
    with pytest.raises(ParameterError, match=r"missing LTHI$"):
        joint_centres({name: pos for name, pos in MARKERS.items() if name != "LTHI"})
