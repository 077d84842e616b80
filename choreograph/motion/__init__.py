"""Skeletons and motions: kinematics, contacts, cleaning, retargeting; the mannequin."""
