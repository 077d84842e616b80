"""The bones of a rig whose names say nothing, by how they hang together and where they lie in one pose.

A body stands upright and is nearly the same on both sides: legs are the chains that end lowest beside its
middle, arms those that begin above the hips and reach farthest from it. Limbs begin and bend where their
halves are the longest and most equal.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.motion.rigs import trunk_roles

Floats = NDArray[np.float64]

_LOW = 0.18  # of the height: where feet are
_BESIDE = 0.015  # of the height: a bone that far from the middle belongs to a side
_FEWEST = 3  # bones of a leg or an arm
_FINGERS = 3  # children from which on a bone is a hand
_ARM = 0.2  # of the height: the least length of an arm
_UNEQUAL = 2.0  # weight of a difference of the halves of an arm against its length
_TURN_RAD = 0.5  # of a foot against its leg, at least
_UPRIGHT = 0.5  # the least height of a standing body against its greatest extent


@dataclass(frozen=True, eq=False)
class PosedBones:
    """The bones of a rig and where they are in one pose, Y up, in any unit; there may be several roots."""

    names: tuple[str, ...]  # (B,)
    parents: NDArray[np.int64]  # (B,) -1 for a root; every parent before its children
    pos: Floats  # (B, 3) in the world
    # Ends of bones that are no bones themselves: their bone (E,) and place (E, 3).
    tip_parents: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    tip_pos: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def turned(self, matrix: Floats) -> PosedBones:
        """The bones in other axes: places times a matrix (3, 3)."""
        return replace(self, pos=self.pos @ matrix, tip_pos=self.tip_pos @ matrix)

    @property
    def n_bones(self) -> int:
        """Number of bones B."""
        return len(self.names)

    def children(self, bone: int) -> list[int]:
        """The bones whose parent is `bone`."""
        return np.flatnonzero(self.parents == bone).tolist()

    def path_from_root(self, bone: int) -> list[int]:
        """The bones from a root to `bone`, both included."""
        path = [bone]
        while self.parents[path[-1]] >= 0:
            path.append(int(self.parents[path[-1]]))
        return path[::-1]


def bones_by_structure(rig: PosedBones) -> dict[str, int]:
    """The bones of a rig by canonical name; `ParameterError` if it has no two legs and two arms."""
    pos = rig.pos - np.median(rig.pos, axis=0)  # the middle is on the spine, whatever one arm does
    extents = np.ptp(rig.pos, axis=0)
    height = float(extents[1])
    if height <= 0 or height < _UPRIGHT * extents.max():
        raise _not_a_body()
    best: dict[str, int] = {}
    across = None
    for axis in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        found = _limbs(rig, pos @ axis / height, height)
        if len(found) > len(best):
            best, across = found, axis
    if across is None or len(best) < 2 * (_FEWEST + _FEWEST):
        raise _not_a_body()
    bones = _sided(rig, best)
    bones |= trunk_roles(tuple(rig.parents.tolist()), bones)
    return bones | head_by_structure(rig, bones)


def head_by_structure(rig: PosedBones, bones: dict[str, int]) -> dict[str, int]:
    """Neck and head: the chain from where the arms meet to the bone highest above it."""
    chest = max(
        set(rig.path_from_root(bones["left_shoulder"])) & set(rig.path_from_root(bones["right_shoulder"]))
    )
    arms = {*rig.path_from_root(bones["left_wrist"]), *rig.path_from_root(bones["right_wrist"])}
    above = [
        path[path.index(chest) + 1 :]
        for bone in range(rig.n_bones)
        if chest in (path := rig.path_from_root(bone))
        and bone != chest
        and path[path.index(chest) + 1] not in arms
    ]
    if not above:
        return {}
    longest = max(above, key=lambda path: rig.pos[path[-1], 1])
    # Eyes, jaw and hair hang from the head: it is the first bone without a single child.
    top = next((i for i, bone in enumerate(longest) if len(rig.children(bone)) != 1), len(longest) - 1)
    top = max(top, min(1, len(longest) - 1))
    return {"head": longest[top]} | ({"neck": longest[0]} if top else {})


def _limbs(rig: PosedBones, beside: Floats, height: float) -> dict[str, int]:
    """Legs and arms with sides "+" and "-" of the axis that `beside` (B,) is measured along."""
    limbs: dict[str, int] = {}
    ends = sorted(set(range(rig.n_bones)) - set(rig.parents.tolist()))
    floor = rig.pos[:, 1].min()
    for side, sign in (("+", 1.0), ("-", -1.0)):
        chains = [_side_chain(rig, end, sign * beside) for end in ends]
        chains = [chain for chain in chains if len(chain) >= _FEWEST]
        low = [c for c in chains if rig.pos[c[-1], 1] < floor + _LOW * height]
        if not low:
            continue
        leg = max(low, key=lambda c: (rig.pos[c[0], 1], len(c)))
        hip_height = rig.pos[leg[0], 1]
        high = [c for c in chains if rig.pos[c[0], 1] > hip_height + 0.1 * height]
        if not high:
            continue
        arm = max(high, key=lambda c: np.linalg.norm(rig.pos[c[-1]] - rig.pos[c[0]]))
        limbs |= {f"{side}{part}": bone for part, bone in _leg_parts(rig, leg, floor, height).items()}
        limbs |= {f"{side}{part}": bone for part, bone in _arm_parts(rig, arm, height).items()}
    return limbs


def _side_chain(rig: PosedBones, end: int, beside: Floats) -> list[int]:
    """The bones from the last one in the middle, not included, to an end on one side."""
    chain, bone = [], end
    while bone >= 0 and beside[bone] >= _BESIDE:
        chain.append(bone)
        bone = int(rig.parents[bone])
    return chain[::-1]


def _leg_parts(rig: PosedBones, chain: list[int], floor: float, height: float) -> dict[str, int]:
    """Hip, knee, ankle and ball of the foot along a leg, which turns to the front at the ankle."""
    heights = rig.pos[chain, 1] - floor
    low = [i for i in range(2, len(chain)) if heights[i] < _LOW * height] or [len(chain) - 1]
    ankle = max(low, key=lambda i: _turn_rad(rig, chain, i))
    if _turn_rad(rig, chain, ankle) < _TURN_RAD:
        ankle = low[-1]
    halves = _halved(rig, chain, ankle, least=0.0)
    if halves is None:
        return {}
    parts = {"hip": chain[halves[0]], "knee": chain[halves[1]], "ankle": chain[ankle]}
    return parts | ({"foot": chain[ankle + 1]} if ankle + 1 < len(chain) else {})


def _arm_parts(rig: PosedBones, chain: list[int], height: float) -> dict[str, int]:
    """Collar, shoulder, elbow and wrist along an arm."""
    hand = next((i for i, bone in enumerate(chain) if len(rig.children(bone)) >= _FINGERS), len(chain) - 1)
    halves = _halved(rig, chain, hand, least=_ARM * height)
    if halves is None:
        return {}
    first, second = halves
    parts = {"shoulder": chain[first], "elbow": chain[second], "wrist": chain[hand]}
    return parts | ({"collar": chain[first - 1]} if first else {})


def _turn_rad(rig: PosedBones, chain: list[int], at: int) -> float:
    """The angle between the bones that meet at a place of a chain; 0 at its end."""
    if at + 1 >= len(chain):
        return 0.0
    before, after = np.diff(rig.pos[chain[at - 1 : at + 2]], axis=0)
    lengths = np.linalg.norm(before) * np.linalg.norm(after)
    return float(np.arccos(np.clip(before @ after / lengths, -1.0, 1.0))) if lengths > 0 else 0.0


def _halved(rig: PosedBones, chain: list[int], end: int, *, least: float) -> tuple[int, int] | None:
    """Where a limb that ends at a place of a chain begins and bends: long, and with equal halves.

    None if no way is longer than `least`.
    """
    best, found = -np.inf, None
    for first, second in combinations(range(end), 2):
        upper, lower = np.linalg.norm(
            np.diff(rig.pos[[chain[at] for at in (first, second, end)]], axis=0), axis=1
        )
        score = float(upper + lower - _UNEQUAL * abs(upper - lower))
        if score > best and upper + lower > least:
            best, found = score, (first, second)
    return found


def _sided(rig: PosedBones, limbs: dict[str, int]) -> dict[str, int]:
    """The limbs with sides "left" and "right": feet point to the front."""
    pos = rig.pos
    ahead = np.zeros(3)
    for side in "+-":
        ankle, toe = limbs[f"{side}ankle"], limbs.get(f"{side}foot")
        ends = rig.tip_pos[rig.tip_parents == ankle] if toe is None else pos[[toe]]
        ahead += (ends - pos[ankle]).sum(axis=0) * [1.0, 0.0, 1.0]
    if np.linalg.norm(ahead) < 1e-6:
        raise ParameterError(
            "expected feet that point to the front, to tell left from right: name the bones with --map"
        )
    left = np.cross([0.0, 1.0, 0.0], ahead)
    plus_is_left = left @ (pos[limbs["+hip"]] - pos[limbs["-hip"]]) > 0
    names = {"+": "left", "-": "right"} if plus_is_left else {"+": "right", "-": "left"}
    return {f"{names[key[0]]}_{key[1:]}": bone for key, bone in limbs.items()}


def _not_a_body() -> ParameterError:
    return ParameterError(
        "expected a body with two legs and two arms, found none by the names of its bones or by its "
        "structure: say which bone is which with --map"
    )
