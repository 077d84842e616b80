"""Skeletons, motions and what moves them: rotations, kinematics, fitting, retargeting."""
