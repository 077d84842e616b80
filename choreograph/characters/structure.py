"""The bones of a rig whose names say nothing, by how they hang together and where they lie in the bind pose.

A body stands upright and is nearly the same on both sides: legs are the chains that end lowest beside its
middle, arms those that begin above the hips and reach farthest from it. Knees and elbows are the bones that
divide a limb into the most equal halves.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.gltf.rig import Rig
from choreograph.motion.rigs import trunk_roles

Floats = NDArray[np.float64]

_LOW = 0.18  # of the height: where feet are
_BESIDE = 0.015  # of the height: a bone that far from the middle belongs to a side
_FEWEST = 3  # bones of a leg or an arm
_FINGERS = 3  # children from which on a bone is a hand
_ARM = 0.2  # of the height: the least length of an arm
_UNEQUAL = 2.0  # weight of a difference of the halves of an arm against its length


def bones_by_structure(rig: Rig) -> dict[str, int]:
    """The bones of a rig by canonical name; `ParameterError` if it has no two legs and two arms."""
    pos = rig.bind_pos_m - rig.bind_pos_m.mean(axis=0)
    height = float(np.ptp(rig.bind_pos_m[:, 1]))
    if height <= 0:
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


def head_by_structure(rig: Rig, bones: dict[str, int]) -> dict[str, int]:
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
    longest = max(above, key=lambda path: rig.bind_pos_m[path[-1], 1])
    # Eyes, jaw and hair hang from the head: it is the first bone without a single child.
    top = next((i for i, bone in enumerate(longest) if len(rig.children(bone)) != 1), len(longest) - 1)
    top = max(top, min(1, len(longest) - 1))
    return {"head": longest[top]} | ({"neck": longest[0]} if top else {})


def _limbs(rig: Rig, beside: Floats, height: float) -> dict[str, int]:
    """Legs and arms with sides "+" and "-" of the axis that `beside` (B,) is measured along."""
    limbs: dict[str, int] = {}
    ends = [bone for bone in range(rig.n_bones) if not rig.children(bone)]
    floor = rig.bind_pos_m[:, 1].min()
    for side, sign in (("+", 1.0), ("-", -1.0)):
        chains = [_side_chain(rig, end, sign * beside) for end in ends]
        chains = [chain for chain in chains if len(chain) >= _FEWEST]
        low = [c for c in chains if rig.bind_pos_m[c[-1], 1] < floor + _LOW * height]
        if not low:
            continue
        leg = max(low, key=lambda c: (rig.bind_pos_m[c[0], 1], len(c)))
        hip_height = rig.bind_pos_m[leg[0], 1]
        high = [c for c in chains if rig.bind_pos_m[c[0], 1] > hip_height + 0.1 * height]
        if not high:
            continue
        arm = max(high, key=lambda c: np.linalg.norm(rig.bind_pos_m[c[-1]] - rig.bind_pos_m[c[0]]))
        limbs |= {f"{side}{part}": bone for part, bone in _leg_parts(rig, leg, floor, height).items()}
        limbs |= {f"{side}{part}": bone for part, bone in _arm_parts(rig, arm, height).items()}
    return limbs


def _side_chain(rig: Rig, end: int, beside: Floats) -> list[int]:
    """The bones from the last one in the middle, not included, to an end on one side."""
    path = rig.path_from_root(end)
    last = max((i for i, bone in enumerate(path) if beside[bone] < _BESIDE), default=-1)
    return path[last + 1 :]


def _leg_parts(rig: Rig, chain: list[int], floor: float, height: float) -> dict[str, int]:
    """Hip, knee, ankle and ball of the foot along a leg."""
    heights = rig.bind_pos_m[chain, 1] - floor
    ankle = next((i for i, h in enumerate(heights) if h < _LOW * height and i >= 2), len(chain) - 1)
    middle = _middle(rig, chain[0], chain[1:ankle], chain[ankle])
    if middle is None:
        return {}
    parts = {"hip": chain[0], "knee": middle, "ankle": chain[ankle]}
    return parts | ({"foot": chain[ankle + 1]} if ankle + 1 < len(chain) else {})


def _arm_parts(rig: Rig, chain: list[int], height: float) -> dict[str, int]:
    """Collar, shoulder, elbow and wrist along an arm: of all ways, the longest with the most equal halves."""
    hand = next((i for i, bone in enumerate(chain) if len(rig.children(bone)) >= _FINGERS), len(chain) - 1)
    best: tuple[float, dict[str, int]] = (-np.inf, {})
    for first, second in combinations(range(hand), 2):
        upper, lower = (
            np.linalg.norm(rig.bind_pos_m[chain[b]] - rig.bind_pos_m[chain[a]])
            for a, b in ((first, second), (second, hand))
        )
        score = float(upper + lower - _UNEQUAL * abs(upper - lower))
        if score > best[0] and upper + lower > _ARM * height:
            parts = {"shoulder": chain[first], "elbow": chain[second], "wrist": chain[hand]}
            best = score, parts | ({"collar": chain[first - 1]} if first else {})
    return best[1]


def _middle(rig: Rig, start: int, between: list[int], end: int) -> int | None:
    """The bone that divides a limb into the most equal halves."""
    if not between:
        return None
    pos = rig.bind_pos_m
    return max(
        between,
        key=lambda b: min(np.linalg.norm(pos[b] - pos[start]), np.linalg.norm(pos[end] - pos[b])),
    )


def _sided(rig: Rig, limbs: dict[str, int]) -> dict[str, int]:
    """The limbs with sides "left" and "right": feet point to the front."""
    pos = rig.bind_pos_m
    ahead = np.zeros(3)
    for side in "+-":
        toe = limbs.get(f"{side}foot")
        if toe is not None:
            ahead += (pos[toe] - pos[limbs[f"{side}ankle"]]) * [1.0, 0.0, 1.0]
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
        "expected a character with two legs and two arms, found none by the names of its bones or by its "
        "structure: say which bone is which with --map"
    )
