"""Mirror images of motions: left and right exchanged, as a dancer shows who faces another one."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from choreograph.core.numerics import Indices
from choreograph.motion.motion import Motion
from choreograph.motion.rigs import joint_roles
from choreograph.motion.skeleton import Skeleton

_ROOT = np.array([-1.0, 1.0, 1.0])
_QUAT = np.array([1.0, 1.0, -1.0, -1.0])  # a rotation seen in a mirror across X


def mirrored_motion(motion: Motion) -> Motion:
    """The mirror image of a motion: X is negated, and left and right joints exchange their rotations.

    It is exact for a skeleton whose left and right have equal lengths. The heading 0 remains. Raises
    `ParameterError` if the joints of arms and legs cannot be found.
    """
    order = mirrored_joints(motion.skeleton)
    return replace(
        motion, root_pos_m=motion.root_pos_m * _ROOT, local_quat=motion.local_quat[:, order] * _QUAT
    )


@lru_cache(maxsize=16)
def mirrored_joints(skeleton: Skeleton) -> Indices:
    """The joint (J,) on the other side of each joint, or the joint itself in the middle."""
    order = np.arange(skeleton.n_joints)
    roles = joint_roles(skeleton)
    pairs = [(name, name.replace("left_", "right_", 1)) for name in (*skeleton.names, *roles)]
    for one, other in pairs:
        if one == other:
            continue
        for known in (roles, dict(zip(skeleton.names, range(skeleton.n_joints), strict=True))):
            if one in known and other in known:
                order[[known[one], known[other]]] = known[other], known[one]
    return order
