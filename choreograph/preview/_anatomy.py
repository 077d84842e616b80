"""The pieces of a mannequin: profiles of trunk, head, limbs, hands and feet, lofted onto a body's joints.

Measures in the tables are metres of a 1.70 m body; `Body.scale` brings them to the one at hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.preview._loft import Floats, Piece, Rings, ellipsoid, frames_along, loft, smooth_rows

UP = np.array([0.0, 1.0, 0.0])

# Half width, depth to the front and to the back; first column: 0 at the hips' height, 1 at the shoulders'.
_TRUNK = np.array([
    (-0.13, 0.070, 0.062, 0.068), (-0.07, 0.118, 0.080, 0.098), (0.02, 0.146, 0.090, 0.112),
    (0.10, 0.154, 0.092, 0.112), (0.22, 0.146, 0.088, 0.096), (0.36, 0.124, 0.083, 0.078),
    (0.47, 0.116, 0.083, 0.073), (0.58, 0.124, 0.092, 0.080), (0.72, 0.142, 0.108, 0.094),
    (0.84, 0.152, 0.108, 0.100), (0.94, 0.142, 0.090, 0.094), (1.02, 0.112, 0.066, 0.080),
    (1.09, 0.072, 0.050, 0.062), (1.14, 0.050, 0.044, 0.050),
])  # fmt: skip
_WAIST = 0.40  # of that height, where the clothes part
# First column: 0 hip, 1 knee, 2 ankle.
_LEG = np.array([
    (0.00, 0.076, 0.080, 0.092), (0.12, 0.082, 0.084, 0.096), (0.30, 0.078, 0.082, 0.084),
    (0.55, 0.065, 0.073, 0.067), (0.80, 0.053, 0.059, 0.053), (0.93, 0.049, 0.053, 0.049),
    (1.00, 0.047, 0.052, 0.047), (1.08, 0.046, 0.047, 0.049), (1.20, 0.050, 0.040, 0.060),
    (1.34, 0.052, 0.038, 0.066), (1.55, 0.043, 0.036, 0.050), (1.75, 0.032, 0.031, 0.037),
    (1.90, 0.028, 0.028, 0.034), (2.00, 0.029, 0.029, 0.036),
])  # fmt: skip
# First column: 0 shoulder, 1 elbow, 2 wrist; the hand's width lies in front and back of the wrist.
_ARM = np.array([
    (0.00, 0.054, 0.054, 0.054), (0.12, 0.056, 0.055, 0.056), (0.30, 0.048, 0.049, 0.047),
    (0.50, 0.043, 0.046, 0.045), (0.70, 0.039, 0.042, 0.040), (0.90, 0.035, 0.036, 0.036),
    (1.00, 0.034, 0.034, 0.036), (1.10, 0.036, 0.038, 0.036), (1.25, 0.038, 0.040, 0.037),
    (1.50, 0.033, 0.034, 0.032), (1.75, 0.025, 0.027, 0.026), (1.95, 0.020, 0.027, 0.026),
    (2.00, 0.019, 0.026, 0.026),
])  # fmt: skip
# From the middle of the body at the shoulders' height out to the shoulder.
_YOKE = np.array([
    (0.0, 0.066, 0.070, 0.078), (0.4, 0.060, 0.064, 0.074), (0.75, 0.050, 0.054, 0.060),
    (1.0, 0.046, 0.047, 0.048),
])  # fmt: skip
# First column: 0 under the chin, 1 the crown.
_HEAD = np.array([
    (0.00, 0.026, 0.072, 0.015), (0.07, 0.042, 0.085, 0.040), (0.20, 0.056, 0.090, 0.064),
    (0.35, 0.065, 0.091, 0.086), (0.50, 0.071, 0.092, 0.100), (0.65, 0.074, 0.091, 0.105),
    (0.80, 0.068, 0.080, 0.096), (0.90, 0.055, 0.062, 0.077), (0.97, 0.032, 0.036, 0.045),
])  # fmt: skip
_HEAD_HEIGHT_M = 0.225
_CHIN_BELOW_HEAD_M = 0.035
# From the wrist to the fingertips: half thickness, width to the thumb's side and to the other.
_HAND = np.array([
    (0.00, 0.018, 0.025, 0.025), (0.15, 0.016, 0.033, 0.031), (0.35, 0.0150, 0.040, 0.038),
    (0.50, 0.0145, 0.041, 0.038), (0.70, 0.0120, 0.037, 0.034), (0.90, 0.0095, 0.028, 0.026),
    (1.00, 0.0070, 0.018, 0.017),
])  # fmt: skip
_HAND_LENGTH_M = 0.165
# Metres ahead of the ankle: half width, height over the sole.
_SHOE = np.array([
    (-0.055, 0.022, 0.044), (-0.040, 0.031, 0.072), (-0.015, 0.035, 0.092), (0.02, 0.036, 0.090),
    (0.05, 0.037, 0.074), (0.09, 0.042, 0.056), (0.13, 0.046, 0.045), (0.17, 0.043, 0.036),
    (0.195, 0.034, 0.028), (0.208, 0.022, 0.021),
])  # fmt: skip
_BALL_AHEAD_M = 0.13  # of the ankle, to which the table above is stretched
_ANKLE_M = 0.07  # over the sole, likewise


@dataclass(frozen=True, eq=False)
class Body:
    """A skeleton standing in its bind pose, as the pieces need it."""

    pos_m: Floats  # (J, 3)
    roles: dict[str, int]  # canonical role -> joint
    spine: tuple[int, ...]  # joints from the pelvis up to where the arms meet
    front: Floats  # (3,) unit, level
    scale: float  # body height over 1.70 m
    sole_m: float  # height of the floor

    def place(self, role: str) -> Floats:
        """Where the joint of a role is, (3,) metres."""
        return self.pos_m[self.roles[role]]

    def middle(self, part: str) -> Floats:
        """Half-way between the left and the right joint of a part, (3,) metres."""
        return (self.place(f"left_{part}") + self.place(f"right_{part}")) / 2

    def half_span(self, part: str) -> float:
        """Half the distance between the left and the right joint of a part, metres."""
        return float(np.linalg.norm(self.place(f"left_{part}") - self.place(f"right_{part}"))) / 2


def trunk(body: Body, torso: int, pelvis: int) -> Piece:
    """From the crotch to the base of the neck, bending with the spine."""
    at = np.unique(np.concatenate([np.linspace(_TRUNK[0, 0], _TRUNK[-1, 0], 26), [_WAIST]]))
    low, high = body.middle("hip"), body.middle("shoulder")
    centres = low + at[:, None] * (high - low)
    radii = smooth_rows(_TRUNK, at) * body.scale
    hips = body.half_span("hip") / (0.085 * body.scale)
    shoulders = body.half_span("shoulder") / (0.17 * body.scale)
    # Wide bodies are wide all over, but less so than their joints.
    radii[:, 0] *= 1 + 0.6 * (np.interp(at, [0.2, 0.8], [hips, shoulders]) - 1)
    across, ahead = frames_along(np.tile(high - low, (len(at), 1)), body.front)
    joints, weights = bending(body.pos_m[list(body.spine)], body.spine, centres)
    parts = np.where(at[:-1] < _WAIST - 1e-9, pelvis, torso)
    rings = Rings(centres, across, ahead, radii, joints, weights)
    return loft(rings, parts, sides=24, start_cap_m=0.025 * body.scale, end_cap_m=0.02 * body.scale)


def yoke(body: Body, side: str, part: int) -> Piece:
    """From inside the chest over the collar bone to the shoulder."""
    shoulder, middle = body.place(f"{side}_shoulder"), body.middle("shoulder")
    at = np.linspace(0.0, 1.0, 7)
    centres = middle + at[:, None] * (shoulder - middle) + 0.012 * body.scale * (1 - at[:, None]) * UP
    radii = smooth_rows(_YOKE, at) * body.scale
    chest, collar = body.spine[-1], body.roles.get(f"{side}_collar", body.spine[-1])
    share = np.clip((at - 0.1) / 0.5, 0.0, 1.0)
    across, ahead = frames_along(np.tile(shoulder - middle, (len(at), 1)), body.front)
    rings = Rings(centres, across, ahead, radii, _pairs(chest, collar, at), _shares(share))
    return loft(rings, part, start_cap_m=0.03 * body.scale, end_cap_m=0.04 * body.scale)


def limb(body: Body, side: str, names: tuple[str, str, str], part: int) -> list[Piece]:
    """A leg or an arm: one tube over its middle joint, and a ball that fills that joint's bend."""
    table = _LEG if names[0] == "hip" else _ARM
    caps = (0.074, 0.03) if names[0] == "hip" else (0.052, 0.018)
    start, middle, end = (body.place(f"{side}_{name}") for name in names)
    joints = [body.roles[f"{side}_{name}"] for name in names]
    near = 1 + np.array([-0.16, -0.10, -0.06, -0.03, 0.0, 0.03, 0.06, 0.10, 0.16])
    at = np.concatenate([np.linspace(0, 0.76, 8), near, np.linspace(1.24, 2.0, 8)])  # (R,)
    centres = np.where(
        (at < 1)[:, None],
        start + at[:, None] * (middle - start),
        middle + (at[:, None] - 1) * (end - middle),
    )
    upper, lower = (middle - start, end - middle)
    upper, lower = upper / np.linalg.norm(upper), lower / np.linalg.norm(lower)
    turn = smoothstep((at - 0.92) / 0.16)[:, None]
    across, ahead = frames_along(upper * (1 - turn) + lower * turn, body.front)
    share = smoothstep((at - 0.88) / 0.24)
    rings = Rings(
        centres,
        across,
        ahead,
        smooth_rows(table, at) * body.scale,
        np.tile(joints[:2], (len(at), 1)),
        _shares(share),
    )
    tube = loft(rings, part, start_cap_m=caps[0] * body.scale, end_cap_m=caps[1] * body.scale)
    knob = 0.95 * smooth_rows(table, np.array([1.0]))[0] * body.scale
    axes = np.stack([upper * knob[0], across[len(at) // 2] * knob[0], ahead[len(at) // 2] * knob[1]])
    return [tube, ellipsoid(middle, axes, joints[1], part)]


def neck(body: Body, part: int) -> Piece:
    """From inside the chest to inside the skull."""
    base, head = neck_base(body), head_place(body)
    chain = [body.spine[-1], body.roles.get("neck", body.spine[-1])]
    chain.append(body.roles.get("head", chain[-1]))
    at = np.linspace(-0.5, 1.4, 10)
    centres = base + at[:, None] * (head - base)
    wide = np.interp(at, [-0.5, 0.0, 0.6, 1.4], [0.066, 0.054, 0.049, 0.049]) * body.scale
    radii = wide[:, None] * [1.0, 0.95, 1.05]
    places = np.stack([base - (head - base), base, head])
    joints, weights = bending(places, chain, centres)
    across, ahead = frames_along(np.tile(head - base, (len(at), 1)), body.front)
    return loft(Rings(centres, across, ahead, radii, joints, weights), part)


def head(body: Body, skin: int, hair: int) -> list[Piece]:
    """Skull with chin, nose and brow, ears, and a cap of hair that leaves the face free."""
    k, joint = body.scale, _head_joint(body)
    chin = head_place(body) - _CHIN_BELOW_HEAD_M * k * UP + 0.012 * k * body.front
    at = np.linspace(0.0, 0.97, 18)
    left = np.cross(UP, body.front)
    radii = smooth_rows(_HEAD, at) * k
    centres = chin + at[:, None] * _HEAD_HEIGHT_M * k * UP
    n = len(at)
    joints, weights = np.full((n, 2), joint), np.tile([1.0, 0.0], (n, 1))
    rings = Rings(centres, np.tile(left, (n, 1)), np.tile(body.front, (n, 1)), radii, joints, weights)
    skull = loft(rings, skin, sides=32, start_cap_m=0.008 * k, end_cap_m=0.03 * k * 0.5)
    _shape_face(skull.vertices_m, chin, left, body.front, k)
    cap = loft(rings, hair, sides=32, start_cap_m=0.008 * k, end_cap_m=0.03 * k * 0.5)
    _shape_hair(cap.vertices_m, chin, left, body.front, k)
    ears = []
    for sign in (1.0, -1.0):
        place = chin + (0.47 * UP * _HEAD_HEIGHT_M + sign * 0.071 * left - 0.012 * body.front) * k
        axes = np.stack([0.030 * UP, 0.010 * left, 0.017 * body.front]) * k
        ears.append(ellipsoid(place, axes, joint, skin, sides=10))
    return [skull, cap, *ears]


def _shape_face(points_m: Floats, chin: Floats, left: Floats, front: Floats, k: float) -> None:
    """Push a nose out of the skull's points (V, 3) and eyes and mouth in, in place."""
    local = (points_m - chin) / k
    x, y, z = local @ left, local[:, 1] / _HEAD_HEIGHT_M, local @ front
    facing = z > 0.03
    nose = 0.024 * np.exp(-((x / 0.011) ** 2)) * np.exp(-(((y - 0.36) / 0.055) ** 2))
    bridge = 0.010 * np.exp(-((x / 0.010) ** 2)) * np.exp(-(((y - 0.47) / 0.07) ** 2))
    eyes = -0.012 * np.exp(-(((np.abs(x) - 0.032) / 0.016) ** 2)) * np.exp(-(((y - 0.49) / 0.045) ** 2))
    mouth = -0.005 * np.exp(-((x / 0.03) ** 2)) * np.exp(-(((y - 0.20) / 0.03) ** 2))
    points_m += np.where(facing, nose + bridge + eyes + mouth, 0.0)[:, None] * front * k


def _shape_hair(points_m: Floats, chin: Floats, left: Floats, front: Floats, k: float) -> None:
    """Swell a copy of the skull's points (V, 3) above the hairline and sink the rest inside it, in place."""
    local = (points_m - chin) / k
    x, y, z = local @ left, local[:, 1] / _HEAD_HEIGHT_M, local @ front
    centre = np.array([0.0, 0.55 * _HEAD_HEIGHT_M, -0.01])
    # The hairline falls from the forehead past the temples to the nape.
    line = np.interp(z, [-0.10, -0.06, -0.01, 0.02, 0.06, 0.10], [0.16, 0.20, 0.42, 0.58, 0.76, 0.80])
    swell = np.interp((y - line) / 0.05, [-1.0, 1.0], [-0.10, 0.055])
    outward = np.stack([x, local[:, 1], z], axis=1) - centre
    world = outward[:, :1] * left + outward[:, 1:2] * UP + outward[:, 2:] * front
    points_m += world * swell[:, None] * k


def hand(body: Body, side: str, part: int) -> list[Piece]:
    """A mitten, a little curled, with its thumb to the front."""
    k, wrist, elbow = body.scale, body.place(f"{side}_wrist"), body.place(f"{side}_elbow")
    along = body.place(f"{side}_hand") - wrist if f"{side}_hand" in body.roles else wrist - elbow
    along = along / np.linalg.norm(along)
    across, ahead = (axes[0] for axes in frames_along(along[None], body.front))
    palm = -across if across[1] > 0 else across
    if abs(along[1]) > 0.7:  # arms at the sides: the palms lie on the thighs
        palm = across * np.sign(across @ (body.middle("hip") - wrist))
    at = np.linspace(0.0, 1.0, 11)
    curl = 0.022 * np.clip(at - 0.35, 0.0, None) ** 1.5 / 0.52
    centres = wrist + (at[:, None] * _HAND_LENGTH_M * along + curl[:, None] * palm) * k
    joints = (body.roles[f"{side}_wrist"], body.roles.get(f"{side}_hand", body.roles[f"{side}_wrist"]))
    share = smoothstep((at - 0.35) / 0.3)
    n = len(at)
    rings = Rings(
        centres,
        np.tile(across, (n, 1)),
        np.tile(ahead, (n, 1)),
        smooth_rows(_HAND, at) * k,
        np.tile(joints, (n, 1)),
        _shares(share),
    )
    mitten = loft(rings, part, sides=14, start_cap_m=0.015 * k, end_cap_m=0.008 * k, squareness=2.4)
    root = wrist + (0.028 * along + 0.020 * ahead) * k
    direction = 0.72 * along + 0.62 * ahead + 0.25 * palm
    thumb = taper(root, root + direction * 0.068 * k, 0.0145 * k, 0.0085 * k, joints[0], part)
    return [mitten, thumb]


def shoe(body: Body, side: str, part: int) -> Piece:
    """A shoe whose sole lies on the floor, bending at the ball of the foot."""
    ankle, ball = body.place(f"{side}_ankle"), body.roles.get(f"{side}_foot")
    reach = (body.pos_m[ball] - ankle) * [1.0, 0.0, 1.0] if ball is not None else np.zeros(3)
    long = float(np.linalg.norm(reach))
    k = body.scale
    pointed = long > 0.04 * k
    ahead = reach / long if pointed else body.front
    stretch = np.clip(long / (_BALL_AHEAD_M * k), 0.8, 1.3) if pointed else 1.0
    at = np.concatenate([np.linspace(-0.055, 0.10, 10), np.linspace(0.115, 0.208, 9)])
    table = smooth_rows(_SHOE, at) * k
    rise = max(ankle[1] - body.sole_m, 0.03 * k)
    top = table[:, 1] * np.interp(at, [0.0, 0.12], [np.clip(rise / (_ANKLE_M * k), 0.7, 1.6), 1.0])
    centres = ankle + at[:, None] * ahead * k * stretch
    centres[:, 1] = body.sole_m + 0.42 * top
    n = len(at)
    share = smoothstep((at - 0.115) / 0.035)
    joint = body.roles[f"{side}_ankle"]
    rings = Rings(
        centres,
        np.tile(np.cross(UP, ahead), (n, 1)),
        np.tile(UP, (n, 1)),
        np.stack([table[:, 0], 0.58 * top, 0.42 * top], axis=1),
        np.tile([joint, ball if ball is not None else joint], (n, 1)),
        _shares(share),
    )
    piece = loft(rings, part, sides=18, start_cap_m=0.010 * k, end_cap_m=0.010 * k, squareness=2.5)
    piece.vertices_m[:, 1] = np.maximum(piece.vertices_m[:, 1], body.sole_m)
    return piece


def taper(
    start: Floats,
    end: Floats,
    wide_m: float,
    thin_m: float,
    joint: int,
    part: int,
    *,
    sides: int = 10,
    rings: int = 4,
) -> Piece:
    """A bone from `start` to `end` (3,), rounded at both, moving with one joint."""
    at = np.linspace(0.0, 1.0, rings)[:, None]
    radii = (wide_m + (thin_m - wide_m) * at) * np.ones(3)
    axis = end - start
    helper = UP if abs(axis[1]) < 0.8 * np.linalg.norm(axis) else np.array([0.0, 0.0, 1.0])
    across, ahead = frames_along(np.tile(axis, (rings, 1)), helper)
    shares = _shares(np.zeros(rings))
    line = Rings(start + at * axis, across, ahead, radii, np.full((rings, 2), joint), shares)
    return loft(line, part, sides=sides, start_cap_m=wide_m, end_cap_m=thin_m)


def knob(centre_m: Floats, radius_m: float, joint: int, part: int) -> Piece:
    """A ball at a joint."""
    return ellipsoid(centre_m, radius_m * np.eye(3), joint, part, sides=10)


def neck_base(body: Body) -> Floats:
    """Where the neck starts, (3,) metres: its joint, or over the middle of the shoulders."""
    if "neck" in body.roles:
        return body.place("neck")
    return body.middle("shoulder") + 0.05 * body.scale * UP


def head_place(body: Body) -> Floats:
    """Where the skull sits on the neck, (3,) metres: its joint, or a neck's length over the neck."""
    if "head" in body.roles:
        return body.place("head")
    return neck_base(body) + 0.09 * body.scale * UP


def _head_joint(body: Body) -> int:
    return body.roles.get("head", body.roles.get("neck", body.spine[-1]))


def bending(places_m: Floats, joints, points_m: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Joints (R, 2) and weights (R, 2) of points (R, 3) along a chain of joints at `places_m` (C, 3).

    A bone's middle is its own joint's; from there to the next bone's middle the two share smoothly.
    """
    chain = np.asarray(joints)
    if len(chain) == 1:
        return np.full((len(points_m), 2), chain[0]), np.tile([1.0, 0.0], (len(points_m), 1))
    axis = places_m[-1] - places_m[0]
    heights = (places_m - places_m[0]) @ axis / (axis @ axis)  # (C,)
    at = (points_m - places_m[0]) @ axis / (axis @ axis)  # (R,)
    middles = np.append((heights[1:] + heights[:-1]) / 2, heights[-1] + (heights[-1] - heights[-2]) / 2)
    middles = np.maximum.accumulate(middles + 1e-6 * np.arange(len(middles)))
    place = np.clip(np.interp(at, middles, np.arange(len(middles))), 0.0, len(middles) - 1)
    lower = np.minimum(place.astype(np.int64), len(middles) - 2)
    return np.stack([chain[lower], chain[lower + 1]], axis=1), _shares(smoothstep(place - lower))


def smoothstep(x: Floats) -> Floats:
    """0 below 0, 1 above 1, smooth between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def _pairs(first: int, second: int, like: Floats) -> NDArray[np.int64]:
    return np.tile([first, second], (len(like), 1))


def _shares(second: Floats) -> Floats:
    return np.stack([1 - second, second], axis=1)
