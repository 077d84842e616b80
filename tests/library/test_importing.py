"""What a build does to its takes before anything is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from synthetic_motions import stepping

from choreograph.formats.register import save_motion
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes
from choreograph.library.notes import Note
from choreograph.motion import rotations as rot
from choreograph.motion.rigs import joint_roles


def test_one_frame_jumps_are_smoothed_and_noted(tmp_path):
    motion = stepping(120, period_s=0.6, seed=1)
    elbow = joint_roles(motion.skeleton)["left_elbow"]
    quat = np.array(motion.local_quat)
    quat[[40, 80], elbow] = rot.multiply(quat[[40, 80], elbow], rot.from_rotvec(np.array([0.0, 2.0, 0.0])))
    save_motion(tmp_path / "jumping.bvh", replace(motion, local_quat=quat))
    save_motion(tmp_path / "smooth.bvh", motion)
    takes, notes = measured_takes([tmp_path], BuildOptions(lock_feet=False), None)
    jumping, smooth = (measured.take for measured in takes)
    jumps = [note for note in notes if note.kind == "jumps"]
    assert jumps == [Note("jumps", "jumping", {"jumps": 2, "limbs": "arms"})]
    assert jumping.notes[-1] == "one-frame jumps of markers were smoothed (2 in arms)"
    difference_m = np.abs(jumping.motion.joint_pos_m() - smooth.motion.joint_pos_m()).max(axis=(1, 2))
    assert set(np.flatnonzero(difference_m > 1e-4)) <= {40, 80}
    assert difference_m.max() < 0.01
