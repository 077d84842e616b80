"""Joint centres from plug-in-gait markers on the skin.

Markers are placed by hand, often centimetres away from the place that the manual states. So each centre is
first estimated from anatomy and then corrected by the motion. The hip is the centre of the sphere on which
the markers of the thigh move about the pelvis. Knee, ankle and elbow are the points that stay in place in
both adjacent segments.

References
----------
Harrington et al., Prediction of the hip joint centre in adults, J. Biomechanics 40 (2007).
Ehrig et al., A survey of formal methods for determining the centre of rotation, J. Biomechanics 39 (2006):
the symmetrical centre of rotation (SCoRE).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats

Markers = Mapping[str, Floats]  # name -> (T, 3) in metres, Y up
Segment = tuple[Floats, Floats]  # origin (T, 3) and axes (T, 3, 3) in columns

_SIDED = (
    "FHD",
    "BHD",
    "SHO",
    "UPA",
    "ELB",
    "FRM",
    "WRA",
    "WRB",
    "FWT",
    "BWT",
    "THI",
    "KNE",
    "SHN",
    "ANK",
    "HEE",
    "TOE",
)
REQUIRED_MARKERS = ("C7", "T10", "CLAV", "STRN", *(side + name for name in _SIDED for side in "LR"))

# From the marker's centre to the joint's: half the joint's width and the marker's radius.
_KNEE_M, _ANKLE_M, _ELBOW_M = 0.055, 0.042, 0.042
_SHOULDER_DROP_M = 0.055  # from the marker on the acromion, along the trunk
_HEAD_DROP_M = 0.09  # from the head band to the joint at the base of the skull
_HAND_M = 0.085  # from wrist to hand, where fingers have no marker
_TOE_MARKER_M = 0.03  # above the sole
_BALL = 0.8  # of the way from heel to toe marker
_HIP_PRIOR = 0.3  # weight of anatomy, relative to the distance of one sample to the sphere
_CENTRE_PRIOR, _AXIS_PRIOR = 0.1, 2.0  # the same across a hinge's axis, and more along it
_HINGE_PASSES = 4
_STRETCHED_PERCENT = 5.0  # of the frames: in these a knee is straight, if ever
_CALIBRATION_FRAMES = 600
_FLAT_SHARE = 0.1  # of the frames, with the lowest heel: there the foot is flat


def joint_centres(markers: Markers) -> tuple[Floats, tuple[str, ...]]:
    """Positions (T, R, 3) in metres of joints and landmarks, and their R names, for `fit_positions`.

    `markers` are those of one take, since markers are attached again for each take. They are
    `REQUIRED_MARKERS`, and optionally "LMT5", "LFIN", "RMT5" and "RFIN". Raises `ParameterError` if a
    required marker is missing.
    """
    missing = [name for name in REQUIRED_MARKERS if name not in markers]
    if missing:
        raise ParameterError(f"expected plug-in-gait markers, missing {', '.join(missing)}")
    points: dict[str, Floats] = {}
    head = np.mean([markers[name] for name in ("LFHD", "RFHD", "LBHD", "RBHD")], axis=0)
    chest, back = 0.5 * (markers["CLAV"] + markers["C7"]), 0.5 * (markers["STRN"] + markers["T10"])
    down = _unit(back - chest)  # (T, 3)
    points["head"] = head + _HEAD_DROP_M * _unit(chest - head)
    points["spine1"] = np.mean([markers[name] for name in ("LFWT", "RFWT", "LBWT", "RBWT")], axis=0)
    for side, word in (("L", "left"), ("R", "right")):
        points[f"{word}_temple"] = 0.5 * (markers[f"{side}FHD"] + markers[f"{side}BHD"])
        points |= {f"{word}_{part}": pos for part, pos in _leg(markers, side).items()}
        shoulder = markers[f"{side}SHO"] + _SHOULDER_DROP_M * down
        points |= {f"{word}_{part}": pos for part, pos in _arm(markers, side, shoulder).items()}
    return np.stack(list(points.values()), axis=1), tuple(points)


def _leg(markers: Markers, side: str) -> dict[str, Floats]:
    named = {name: markers[side + name] for name in ("THI", "KNE", "SHN", "ANK", "HEE", "TOE")}
    medial = 1.0 if side == "R" else -1.0  # of the normal of thigh and shank: knees bend backwards
    hip = _hip(markers, side)
    thigh = _segment(hip, named["KNE"], named["THI"])
    shank = _segment(named["KNE"], named["ANK"], named["SHN"])
    foot = _segment(named["HEE"], named["TOE"], markers.get(f"{side}MT5", named["ANK"]))
    foot_middle = 0.5 * (named["HEE"] + named["TOE"])
    ankle = _hinge(named["ANK"], -medial * _ANKLE_M, (named["KNE"], foot_middle), (shank, foot))
    shank = _segment(
        ankle, named["SHN"], named["ANK"]
    )  # without the knee's marker, which moves with the skin
    knee = _hinge(named["KNE"], medial * _KNEE_M, (hip, ankle), (thigh, shank))
    knee = _unstretched(knee, (hip, ankle), thigh)
    heel, toe = _sole(named["HEE"], named["TOE"], foot)
    return {"hip": hip, "knee": knee, "ankle": ankle, "heel": heel, "foot": heel + _BALL * (toe - heel)}


def _arm(markers: Markers, side: str, shoulder: Floats) -> dict[str, Floats]:
    elbow, upper, lower = (markers[side + name] for name in ("ELB", "UPA", "FRM"))
    wrist = 0.5 * (markers[f"{side}WRA"] + markers[f"{side}WRB"])
    medial = 1.0 if side == "L" else -1.0  # elbows bend forwards
    upper_arm = _segment(shoulder, elbow, upper)
    forearm = _segment(wrist, markers[f"{side}WRA"], lower)
    centre = _hinge(elbow, medial * _ELBOW_M, (shoulder, wrist), (upper_arm, forearm))
    centre = _unstretched(centre, (shoulder, wrist), upper_arm)
    hand = markers.get(f"{side}FIN", wrist + _HAND_M * _unit(wrist - centre))
    return {"shoulder": shoulder, "elbow": centre, "wrist": wrist, "hand": hand}


def _hip(markers: Markers, side: str) -> Floats:
    """The centre of the hip (T, 3), from the size of the pelvis and the spheres of the thigh's markers."""
    front = 0.5 * (markers["LFWT"] + markers["RFWT"])
    back = 0.5 * (markers["LBWT"] + markers["RBWT"])
    pelvis = _segment(front, markers["LFWT"], back)
    width = float(np.mean(np.linalg.norm(markers["LFWT"] - markers["RFWT"], axis=-1)))
    depth = float(np.mean(np.linalg.norm(front - back, axis=-1)))
    axes = pelvis[1]  # (T, 3, 3), columns: left, backwards
    # Waist markers may be higher in front than at the back. The mean vertical is used as up.
    up = _unit(np.einsum("tij,i->tj", axes, [0.0, 1.0, 0.0]).mean(axis=0) * [0.0, 1.0, 1.0])
    left = np.array([1.0, 0.0, 0.0])
    forward = np.cross(left, up)
    sign = 1.0 if side == "L" else -1.0
    guess = (
        sign * (0.33 * width + 0.0073) * left
        - (0.24 * depth + 0.0099) * forward
        - (0.30 * width + 0.0109) * up
    )
    kept = _sample(len(front))
    local = [_into(pelvis, markers[side + name])[kept] for name in ("KNE", "THI")]  # (K, 3) each
    prior = _HIP_PRIOR * np.sqrt(len(kept))

    def residuals(centre: Floats) -> Floats:
        radii = [np.linalg.norm(pos - centre, axis=-1) for pos in local]
        return np.concatenate([*(radius - radius.mean() for radius in radii), prior * (centre - guess)])

    return _out_of(pelvis, scipy.optimize.least_squares(residuals, guess).x)


def _hinge(
    marker: Floats, reach_m: float, ends: tuple[Floats, Floats], segments: tuple[Segment, Segment]
) -> Floats:
    """The centre (T, 3) of a joint `reach_m` beside its marker, along the axis about which it bends.

    `ends` are the joints before and after it, and `segments` the two segments that it joins. The axis is the
    mean normal of the limb in the frames where it is bent most. The first centre, on the skin, tilts the
    axis, so the axis is computed again from the next centre.
    """
    centre = marker
    for _ in range(_HINGE_PASSES):
        normal = np.cross(centre - ends[0], ends[1] - centre)  # (T, 3), longer where the limb is bent more
        normal = normal * np.linalg.norm(normal, axis=-1, keepdims=True)
        axes = [_unit(np.einsum("tij,ti->j", axes, normal)) for _, axes in segments]
        beside = marker + reach_m * np.einsum("tij,j->ti", segments[0][1], axes[0])
        centre = _centre(segments, beside, axes)
    return centre


def _unstretched(centre: Floats, ends: tuple[Floats, Floats], segment: Segment) -> Floats:
    """A knee or elbow (T, 3), moved forwards so that a stretched limb is straight and not bent backwards.

    Skin slides over a bending joint, so that its estimated centre lies too far back and straight legs seem to
    be bent backwards.
    """
    normal = np.cross(centre - ends[0], ends[1] - centre)
    normal = normal * np.linalg.norm(normal, axis=-1, keepdims=True)
    axis = np.einsum("tij,j->ti", segment[1], _unit(np.einsum("tij,ti->j", segment[1], normal)))
    for _ in range(_HINGE_PASSES):
        upper, lower = centre - ends[0], ends[1] - centre
        lengths = [np.linalg.norm(bone, axis=-1) for bone in (upper, lower)]  # (T,) each
        sine = np.sum(np.cross(upper, lower) * axis, axis=-1) / (lengths[0] * lengths[1])
        bent_back = -float(np.percentile(sine, _STRETCHED_PERCENT))  # radians, since small
        if bent_back <= 0.0:
            break
        forward = _unit(np.cross(ends[1] - ends[0], axis))
        centre = centre + bent_back / np.mean(1.0 / lengths[0] + 1.0 / lengths[1]) * forward
    return centre


def _centre(segments: tuple[Segment, Segment], guess: Floats, axes: Sequence[Floats]) -> Floats:
    """The point (T, 3) that moves least in both segments.

    Its place along the axis does not follow from motion, so it is that of `guess`.
    """
    kept = _sample(len(guess))
    guesses = np.concatenate([_into(segment, guess)[kept].mean(axis=0) for segment in segments])  # (6,)
    (origin, basis), (other_origin, other_basis) = segments
    apart = np.concatenate([basis[kept], -other_basis[kept]], axis=2).reshape(-1, 6)  # (3K, 6)
    offset = (other_origin - origin)[kept].ravel()  # (3K,)
    prior = np.sqrt(len(kept)) * scipy.linalg.block_diag(
        *(_CENTRE_PRIOR * np.eye(3) + _AXIS_PRIOR * np.outer(axis, axis) for axis in axes)
    )
    solved, *_ = np.linalg.lstsq(np.concatenate([apart, prior]), np.concatenate([offset, prior @ guesses]))
    return 0.5 * (_out_of(segments[0], solved[:3]) + _out_of(segments[1], solved[3:]))


def _sole(heel: Floats, toe: Floats, foot: Segment) -> tuple[Floats, Floats]:
    """Heel and toe (T, 3) on the sole, below their markers in the frames where the foot stands flat."""
    rise = heel[:, 1] - toe[:, 1]  # (T,)
    flat = np.argsort(rise)[: max(1, round(_FLAT_SHARE * len(rise)))]
    down = _unit(-foot[1][flat, 1].mean(axis=0))  # world's down in the foot's axes
    down = np.einsum("tij,j->ti", foot[1], down)
    heel_m = _TOE_MARKER_M + float(np.median(rise[flat]))
    return heel + max(heel_m, 0.0) * down, toe + _TOE_MARKER_M * down


def _segment(origin: Floats, along: Floats, towards: Floats) -> Segment:
    """A rigid segment from three points (T, 3): its origin (T, 3), and axes (T, 3, 3) in columns."""
    first = _unit(along - origin)
    second = towards - origin
    second = _unit(second - first * np.sum(first * second, axis=-1, keepdims=True))
    return origin, np.stack([first, second, np.cross(first, second)], axis=-1)


def _into(segment: Segment, pos: Floats) -> Floats:
    local: Floats = np.einsum("tij,ti->tj", segment[1], pos - segment[0])
    return local


def _out_of(segment: Segment, local: Floats) -> Floats:
    pos: Floats = segment[0] + np.einsum("tij,j->ti", segment[1], local)
    return pos


def _sample(n_frames: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, n_frames - 1, _CALIBRATION_FRAMES).round().astype(np.int64))


def _unit(vector: Floats) -> Floats:
    unit: Floats = vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-9)
    return unit
