"""Skeletons and motions: kinematics, contacts, cleaning, retargeting, and the mannequin."""
