"""Skeletons, motions, and everything that computes with them.

Representation
skeleton              joint hierarchy and rest pose; the canonical 24-joint body
motion                `Motion`: root positions and local rotations at one rate
body                  the 21 joints that features, networks and costs use
rigs                  joint names of common rigs mapped to canonical joints
rig_structure         bones of a rig with unknown names, by how they hang together
bone_map              which bone is which: by a user's map, names, or structure

Computation
rotations             quaternions
interpolation         linear interpolation at fractional frames
kinematics            forward kinematics; global to local rotations
pose                  heading, ground position, poses in the root frame
floor                 floor height under a take

Solvers
inverse_kinematics    two-bone IK
retargeting           a motion on another skeleton
marker_fitting        markers or joint positions to joint rotations
rotation_smoothing    flips bridged, twist angles smoothed
bridging              frames on a smooth path between those before and after
despiking             one-frame jumps of markers smoothed
fit_refinement        Gauss-Newton refinement of fitted rotations
skeleton_calibration  bone lengths of one or several dancers from markers
"""
