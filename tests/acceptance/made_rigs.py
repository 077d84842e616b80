"""Rigs as text, and takes in BVH of them, in which the test knows which joint is which."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import canonical_skeleton

_REST = dict(zip(canonical_skeleton().names, canonical_skeleton().rest_pos_m(), strict=True))
_SIDES = (
    {"side": "left", "S": "Left", "s": "left", "L": "L", "l": "l", "j": "左", "h": "hidari"},
    {"side": "right", "S": "Right", "s": "right", "L": "R", "l": "r", "j": "右", "h": "migi"},
)
_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
_TURNS = {"y": rot.IDENTITY, "z": rot.from_rotvec(np.array([np.pi / 2, 0.0, 0.0]))}  # to the axis that is up


@dataclass(frozen=True)
class Rig:
    """How a program names a body, and how its file has it."""

    trunk: str  # the pelvis first
    leg: str  # {S} Left, {s} left, {L} L, {l} l, {j} 左, {h} hidari; and of the right side
    arm: str
    fingers: str = ""  # {F} Thumb, {n} 1 to 3
    above_hips: str = ""  # joint between the pelvis and both legs
    root: str = ""  # joint on the floor above the pelvis
    extra: str = ""  # joints beside a limb, "NAME<joint that it hangs from", for both sides
    prefix: str = ""
    arms_down_rad: float = 0.0  # of an A pose
    heading_rad: float = 0.0
    up: str = "y"
    units_per_m: float = 100.0


def number(rig: Rig, form: str = "joint_{}") -> Rig:
    """The rig with numbers for names: the parts that they are of stay known."""
    count = iter(range(1000))

    def numbered(limb: str, side: str = "") -> str:
        parts = [word.strip().partition(":") for word in limb.split(",")]
        return ", ".join(f"{form.format(next(count))}{side}{colon}{part}" for _, colon, part in parts)

    # Sides are numbered apart by {l}, which then says nothing of the side: 1 and 2.
    return replace(rig, trunk=numbered(rig.trunk), leg=numbered(rig.leg, "{n}"), arm=numbered(rig.arm, "{n}"),
                   fingers="", extra="")  # fmt: skip


@dataclass
class Made:
    """Joints of a made rig, parents first, and which part of the body each is."""

    names: list[str]
    parents: list[int]
    pos_m: list[np.ndarray]
    roles: dict[str, str]  # canonical name -> name

    def add(self, name: str, parent: int, pos_m: np.ndarray) -> int:
        self.names.append(name)
        self.parents.append(parent)
        self.pos_m.append(pos_m)
        return len(self.names) - 1

    def chain(self, rig: Rig, limb: str, side: dict[str, str], parent: int, ends_m: np.ndarray) -> list[int]:
        """Add a limb, joints without a part halfway to the next that has one."""
        words = [word.strip().format(**side).partition(":") for word in limb.split(",")]
        joints = []
        for place, (name, _, part) in enumerate(words):
            role = f"{side['side']}_{part}" if side.get("side") and part else part
            if role:
                pos_m = posed(rig, role)
                self.roles[role] = rig.prefix + name
            else:
                ahead = [part for _, _, part in words[place + 1 :] if part]
                end_m = posed(rig, f"{side['side']}_{ahead[0]}") if ahead else ends_m
                pos_m = (self.pos_m[parent] + end_m) / 2
            parent = self.add(rig.prefix + name, parent, pos_m)
            joints.append(parent)
        return joints


def posed(rig: Rig, role: str) -> np.ndarray:
    """Where a joint is in the rest pose: T or A."""
    pos_m = _REST[role].copy()
    side, _, part = role.partition("_")
    if part in ("elbow", "wrist", "hand"):
        sign = 1.0 if side == "left" else -1.0
        shoulder = _REST[f"{side}_shoulder"]
        turn = rot.from_rotvec(np.array([0.0, 0.0, -sign * rig.arms_down_rad]))
        pos_m = shoulder + rot.rotate(turn, pos_m - shoulder)
    return pos_m


def made_of(rig: Rig) -> Made:
    """The rig's joints in the world, in its rest pose."""
    made = Made([], [], [], {})
    parent = made.add(rig.prefix + rig.root, -1, np.zeros(3)) if rig.root else -1
    trunk = [word.strip().partition(":") for word in rig.trunk.split(",")]
    spine = range(1, min(place for place, (_, _, part) in enumerate(trunk) if part in ("neck", "head")))
    joints = []
    for place, (name, _, part) in enumerate(trunk):
        if place in spine:
            share = (spine.index(place) + 1) / len(spine)
            pos_m = (1 - share) * _REST["pelvis"] + share * _REST["spine3"]
        else:
            pos_m = _REST[part or "neck"]
        parent = made.add(rig.prefix + name, parent, pos_m)
        joints.append(parent)
        if part:
            made.roles[part] = rig.prefix + name
    chest, hips = joints[spine[-1]], joints[0]
    if rig.above_hips:
        hips = made.add(rig.prefix + rig.above_hips, hips, _REST["pelvis"] - [0.0, 0.02, 0.0])
    for place, side in enumerate(_SIDES):
        side = side | {"n": str(place + 1)}
        name = side["side"]
        toes_m = _REST[f"{name}_foot"] + [0.0, 0.0, 0.08]
        made.chain(rig, rig.leg, side, hips, toes_m)
        made.chain(rig, rig.arm, side, chest, posed(rig, f"{name}_hand"))
        hand = made.names.index(made.roles[f"{name}_wrist"])
        ahead_m = posed(rig, f"{name}_hand") - posed(rig, f"{name}_wrist")
        for at, finger in enumerate(_FINGERS if rig.fingers else ()):
            parent = hand
            for n in (1, 2, 3):
                own = rig.fingers.format(**(side | {"F": finger, "n": n}))
                pos_m = made.pos_m[hand] + 0.4 * (n + 1) * ahead_m + [0.0, 0.0, 0.02 * (2 - at)]
                parent = made.add(rig.prefix + own, parent, pos_m)
        for word in filter(None, map(str.strip, rig.extra.split(","))):
            own, _, above = word.format(**side).partition("<")
            joint = made.names.index(rig.prefix + above)
            below = next((i for i, p in enumerate(made.parents) if p == joint), joint)
            made.add(rig.prefix + own, joint, (made.pos_m[joint] + made.pos_m[below]) / 2)
    return made


def write_bvh(rig: Rig, folder: Path) -> Path:
    """Write the rig with two seconds of a body that sways and bends knees and elbows."""
    made = made_of(rig)
    turn = rot.multiply(_TURNS[rig.up], rot.about_y(rig.heading_rad))
    pos = rig.units_per_m * rot.rotate(turn, np.array(made.pos_m))
    children = {joint: [i for i, p in enumerate(made.parents) if p == joint] for joint in range(-1, len(pos))}
    lines, order = ["HIERARCHY"], []

    def nest(joint: int, indent: str) -> None:
        order.append(joint)
        offset = pos[joint] - (pos[made.parents[joint]] if made.parents[joint] >= 0 else 0.0)
        lines.append(f"{indent}{'JOINT' if made.parents[joint] >= 0 else 'ROOT'} {made.names[joint]}")
        lines.append(f"{indent}{{")
        lines.append(f"{indent}\tOFFSET " + " ".join(f"{value:.5f}" for value in offset))
        position = "" if made.parents[joint] >= 0 else "Xposition Yposition Zposition "
        lines.append(f"{indent}\tCHANNELS {6 if position else 3} {position}Zrotation Xrotation Yrotation")
        for child in children[joint]:
            nest(child, indent + "\t")
        if not children[joint]:
            ahead = rig.units_per_m * rot.rotate(turn, np.array([0.0, 0.0, 0.05]))
            site = "\tOFFSET " + " ".join(f"{value:.5f}" for value in ahead)
            lines.extend(f"{indent}\t{line}" for line in ("End Site", "{", site, "}"))
        lines.append(f"{indent}}}")

    nest(0, "")
    bent = {made.roles[f"{side}_{part}"] for side in ("left", "right") for part in ("knee", "elbow")}
    lines += ["MOTION", "Frames: 60", "Frame Time: 0.0333333"]
    for frame in range(60):
        sway = np.sin(frame / 6.0)
        numbers = [*(pos[0] + rig.units_per_m * np.array([0.05 * sway, 0.0, 0.0]))]
        for joint in order:
            numbers += [5.0 * sway, 20.0 + 10.0 * sway if made.names[joint] in bent else 0.0, 0.0]
        lines.append(" ".join(f"{value:.4f}" for value in numbers))
    path = folder / "take.bvh"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
