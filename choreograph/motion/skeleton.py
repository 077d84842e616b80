"""Skeletons: joint names, parents, rest offsets and end sites, and the canonical 24-joint body."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import (
    as_floats,
    as_number,
    as_texts,
    as_whole_numbers,
    check_kind,
    unexpected,
)
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.progress import counted

CANONICAL_JOINTS = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle",
    "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar",
    "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist",
    "right_wrist", "left_hand", "right_hand",
)  # fmt: skip
CANONICAL_PARENTS = (
    -1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21,
)  # fmt: skip

# Average adult offsets from the parent joint in metres, in a T-pose that faces +Z, with left at +X. They
# follow anthropometric proportions of a 1.70 m body, and no licensed body model.
_CANONICAL_OFFSETS_M = (
    (0.0, 0.93, 0.0), (0.085, -0.075, 0.0), (-0.085, -0.075, 0.0), (0.0, 0.11, -0.02),
    (0.0, -0.39, 0.0), (0.0, -0.39, 0.0), (0.0, 0.13, 0.0), (0.0, -0.395, -0.02),
    (0.0, -0.395, -0.02), (0.0, 0.06, 0.02), (0.0, -0.055, 0.13), (0.0, -0.055, 0.13),
    (0.0, 0.21, -0.02), (0.07, 0.12, -0.01), (-0.07, 0.12, -0.01), (0.0, 0.09, 0.04),
    (0.10, 0.03, -0.01), (-0.10, 0.03, -0.01), (0.26, 0.0, 0.0), (-0.26, 0.0, 0.0),
    (0.25, 0.0, 0.0), (-0.25, 0.0, 0.0), (0.085, 0.0, 0.0), (-0.085, 0.0, 0.0),
)  # fmt: skip

_SAME_M = 1e-3  # largest difference of equal bone offsets
MAX_JOINTS = 4096  # bodies with detailed faces and hands have some hundreds


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A joint hierarchy with its rest pose (all rest rotations are the identity).

    Raises `ParameterError` if a field is of another type, shapes disagree, a parent does not come before its
    child, names repeat, an offset is not finite, or there are over 4096 joints.

    Examples
    --------
    >>> skeleton = cg.Skeleton(("hips", "spine", "head"), [-1, 0, 1], [[0, 1, 0], [0, 0.3, 0], [0, 0.3, 0]])
    >>> skeleton.index("head")
    2
    >>> skeleton.rest_pos_m()[2]
    array([0. , 1.6, 0. ])
    """

    names: tuple[str, ...]
    """(J,) names of the joints, all different. The root is the first one."""

    parents: NDArray[np.int64]
    """(J,) index of each joint's parent, -1 for the root. Parents come before their children."""

    offsets_m: Floats
    """(J, 3) offset of each joint from its parent in the rest pose, in metres. The root's is its rest
    position."""

    tip_parents: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """(E,) joint of each end site. End sites are ends of bones without channels, as in BVH."""

    tips_m: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """(E, 3) offset of each end site from its joint, in metres."""

    roles: Mapping[str, int] | None = field(default=None, kw_only=True)
    """Canonical name to index of a joint, for a rig whose names of joints are not known, or None."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", as_texts("names of joints", self.names))
        object.__setattr__(self, "parents", as_whole_numbers("parents of joints", self.parents))
        object.__setattr__(self, "offsets_m", as_floats("offsets of joints", self.offsets_m))
        object.__setattr__(self, "tip_parents", as_whole_numbers("joints of end sites", self.tip_parents))
        tips_m = as_floats("offsets of end sites", self.tips_m)
        object.__setattr__(self, "tips_m", tips_m if tips_m.size % 3 else tips_m.reshape(-1, 3))
        n = len(self.names)
        if n == 0 or self.parents.shape != (n,) or self.offsets_m.shape != (n, 3):
            raise ParameterError(
                f"expected parents ({n},) and offsets ({n}, 3) for {n} joints, got "
                f"{self.parents.shape} and {self.offsets_m.shape}"
            )
        if n > MAX_JOINTS:
            raise ParameterError(f"expected a skeleton of at most {MAX_JOINTS} joints, got {n}")
        n_tips = self.tip_parents.size
        if (self.tip_parents.shape, self.tips_m.shape) != ((n_tips,), (n_tips, 3)) or (
            (self.tip_parents < 0) | (self.tip_parents >= n)
        ).any():
            raise ParameterError(
                f"expected end sites with an offset and a joint of {n}, got joints "
                f"{reprlib.repr(self.tip_parents.ravel()[:6].tolist())} and offsets {self.tips_m.shape}"
            )
        if self.roles is not None:
            self._check_roles(self.roles)
        if len(set(self.names)) != n:
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise unexpected("joints with a name each", twice, "more than one has it")
        misplaced = [i for i, p in enumerate(self.parents) if (not 0 <= p < i if i else p != -1)]
        if misplaced:
            joint = misplaced[0]
            raise ParameterError(
                f"expected the root first, with parent -1, and every parent before its children, got parent "
                f"{self.parents[joint]} of joint {joint}"
            )
        for what, offsets_m in (("joints", self.offsets_m), ("end sites", self.tips_m)):
            if not np.isfinite(offsets_m).all():
                got = offsets_m[~np.isfinite(offsets_m).all(axis=1)][0].tolist()
                raise unexpected(f"finite offsets of {what} in metres", got)

    def _check_roles(self, roles: Mapping[str, int]) -> None:
        if not isinstance(roles, Mapping) or not set(roles) <= set(CANONICAL_JOINTS):
            raise unexpected("roles of joints by canonical name", roles)
        if len(set(roles.values())) != len(roles) or not set(roles.values()) <= set(range(len(self.names))):
            raise unexpected(f"roles of different joints among {len(self.names)}", dict(roles))

    def __repr__(self) -> str:
        return f"<Skeleton: {counted(self.n_joints, 'joint')} from {reprlib.repr(self.names[0])}>"

    @property
    def n_joints(self) -> int:
        """Number of joints J, without end sites."""
        return len(self.names)

    def index(self, name: str) -> int:
        """Index of a joint. Raises `ParameterError` if the name is unknown."""
        if not isinstance(name, str) or name not in self.names:
            raise unexpected(f"a joint among {', '.join(self.names)}", name)
        return self.names.index(name)

    def same_as(self, other: Skeleton, *, tolerance_m: float = _SAME_M) -> bool:
        """Whether joints, hierarchy and bone offsets agree. The rest position of the root may differ.

        Raises `ParameterError` for anything but a skeleton, and for a tolerance that is not a number.
        """
        check_kind("the other skeleton", other, Skeleton)
        as_number("tolerance_m as a number", tolerance_m)
        return (
            self.names == other.names
            and np.array_equal(self.parents, other.parents)
            and np.allclose(self.offsets_m[1:], other.offsets_m[1:], atol=tolerance_m)
        )

    def order_of(self, other: Skeleton) -> NDArray[np.int64] | None:
        """For each joint of `other`, the joint of this skeleton with its name, (J,).

        None if the two differ in more than the order of joints. The rest position of the root may differ.
        Raises `ParameterError` for anything but a skeleton.
        """
        check_kind("the other skeleton", other, Skeleton)
        if set(self.names) != set(other.names):
            return None
        order = np.array([self.names.index(name) for name in other.names])
        above = [-1, *(self.names.index(other.names[parent]) for parent in other.parents[1:])]
        same = np.array_equal(self.parents[order], above) and np.allclose(
            self.offsets_m[order[1:]], other.offsets_m[1:], atol=_SAME_M
        )
        return order if same else None

    def role_numbers(self) -> NDArray[np.int64]:
        """The roles of the joints as indices of the canonical ones, (J,), or -1 for joints without one."""
        numbers = np.full(self.n_joints, -1)
        for role, joint in (self.roles or {}).items():
            numbers[joint] = CANONICAL_JOINTS.index(role)
        return numbers

    def rest_pos_m(self) -> Floats:
        """Joint positions of the rest pose with the root at its rest position, (J, 3)."""
        pos = np.array(self.offsets_m)
        for joint in range(1, self.n_joints):
            pos[joint] += pos[self.parents[joint]]
        return pos


def roles_of(numbers: NDArray[np.int64]) -> dict[str, int]:
    """The roles of the numbers (J,) of `Skeleton.role_numbers`. Raises `ParameterError` for other numbers."""
    numbers = as_whole_numbers("roles of joints", numbers)
    given = numbers[numbers >= 0]
    if (numbers >= len(CANONICAL_JOINTS)).any() or len(set(given.tolist())) != len(given):
        raise ParameterError(f"expected different roles below {len(CANONICAL_JOINTS)}, got others: damaged")
    return {CANONICAL_JOINTS[role]: joint for joint, role in enumerate(numbers.tolist()) if role >= 0}


@lru_cache(maxsize=1)
def canonical_skeleton() -> Skeleton:
    """The 24-joint body to which takes on other rigs are retargeted. Toes and fingertips are end sites."""
    index = {name: i for i, name in enumerate(CANONICAL_JOINTS)}
    tips = {
        "left_foot": (0.0, 0.0, 0.07), "right_foot": (0.0, 0.0, 0.07), "head": (0.0, 0.18, 0.0),
        "left_hand": (0.09, 0.0, 0.0), "right_hand": (-0.09, 0.0, 0.0),
    }  # fmt: skip
    return Skeleton(
        names=CANONICAL_JOINTS,
        parents=np.array(CANONICAL_PARENTS),
        offsets_m=np.array(_CANONICAL_OFFSETS_M),
        tip_parents=np.array([index[name] for name in tips]),
        tips_m=np.array(list(tips.values())),
    )


def descendants(parents: NDArray[np.int64], top: int) -> list[int]:
    """A joint and all joints below it, in order, of a hierarchy with parents (J,), -1 for a root."""
    found = {top}
    for joint in range(top + 1, len(parents)):
        if int(parents[joint]) in found:
            found.add(joint)
    return sorted(found)
