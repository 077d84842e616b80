"""Other rest poses for the same motion: joints stay where they were, the skeleton stands."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import on_other_axes, swaying

from choreograph.core.errors import ParameterError
from choreograph.formats.bvh import BvhOptions, BvhWriter, read_bvh
from choreograph.formats.register import save_motion
from choreograph.formats.writer import with_rest_pose
from choreograph.motion.rigs import joint_roles

DOWN = {"t": 0.0, "a": np.sin(np.pi / 4)}


@pytest.mark.parametrize("rest", ["t", "a"])
@pytest.mark.parametrize(
    "motion", [swaying(40), on_other_axes(swaying(40), 3)], ids=["upright", "other axes"]
)
def test_joints_stay_and_the_rest_pose_stands_on_the_floor(motion, rest):
    posed = with_rest_pose(motion, rest)
    assert np.allclose(posed.joint_pos_m(), motion.joint_pos_m(), atol=1e-9)
    pos_m, roles = posed.skeleton.rest_pos_m(), joint_roles(posed.skeleton)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for start, end in (("shoulder", "elbow"), ("elbow", "wrist")):
            bone = pos_m[roles[f"{side}_{end}"]] - pos_m[roles[f"{side}_{start}"]]
            assert bone[1] / np.linalg.norm(bone) == pytest.approx(-DOWN[rest], abs=1e-6)
            assert sign * bone[0] > 0
    feet = [roles[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "foot")]
    assert 0.0 <= pos_m[feet, 1].min() < 0.05


def test_a_bvh_in_an_a_pose_is_read_back_as_the_same_motion(tmp_path):
    motion = swaying(40)
    save_motion(tmp_path / "a.bvh", motion, writer=BvhWriter(BvhOptions(rest="a")))
    back, _ = read_bvh(tmp_path / "a.bvh")
    order = [back.skeleton.names.index(name) for name in motion.skeleton.names]
    assert np.allclose(back.joint_pos_m()[:, order], motion.joint_pos_m(), atol=1e-4)
    assert back.skeleton.rest_pos_m()[:, 1].min() > -0.01  # above the floor


@pytest.mark.parametrize("make", [lambda: with_rest_pose(swaying(4), "i"), lambda: BvhOptions(rest="i")])
def test_other_rest_poses_are_refused(make):
    with pytest.raises(ParameterError, match="t, a"):
        make()
