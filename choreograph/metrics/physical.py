"""Does a dance obey its floor and its body: slide, depth and height of the feet, joins, jerk, bones.

Conventions: body positions (T, 21, 3) in metres at `fps`, Y up, the floor at y = 0. A foot is low
when its ball is at most `LOW_M` over the floor. Speed and jerk are the first and third difference of all
joints' places at one rate, 20 fps whatever the source's, so that dances and takes compare; m/s and m/s³.
Positions of another shape, not finite, or without a rate are refused with a `ParameterError`. The field's
own scores of feet, with their thresholds and their bugs, are in `metrics.contact_scores`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.metrics.contact_scores import foot_skating_ratio, pfc
from choreograph.motion.body import BODY_JOINTS, BODY_PARENTS, body_pos_at, checked_body_pos_m
from choreograph.timebase import NET_FPS, STORE_FPS, frame_times_s

Floats = NDArray[np.float64]
Instants = Sequence[float] | Floats

LOW_M = 0.05
JERK_FPS = NET_FPS
ANKLE_OVER_SOLE_M = 0.07  # of the canonical body; real ones have 7 to 10 cm
NEAR_M = 0.08  # the joint of a standing ball is 2 cm over its sole, and captures lift and drop by as much
JUMP_S = 0.7  # in the air for a rise of 60 cm, which few dancers reach
JOIN_HALF_WIDTH_S = 0.12
_FEET = [BODY_JOINTS.index("left_foot"), BODY_JOINTS.index("right_foot")]
_ANKLES = [BODY_JOINTS.index("left_ankle"), BODY_JOINTS.index("right_ankle")]
# The bones that one rigid bone is on every rig: trunks have as many joints as their makers liked.
_LIMB_BONES = [
    BODY_JOINTS.index(f"{side}_{end}")
    for side in ("left", "right")
    for end in ("knee", "ankle", "foot", "elbow", "wrist")
]


def validate(body_pos_m: Floats, fps: float, boundary_times_s: Instants = ()) -> None:
    """Raise `ParameterError` unless these are body positions at a rate and finite instants (B,)."""
    checked_body_pos_m(body_pos_m, fps)
    _checked_instants(boundary_times_s)


def foot_slide_cm_s(body_pos_m: Floats, fps: float, *, low_m: float = LOW_M) -> float:
    """Mean horizontal speed of the balls of the feet while low, cm/s; 0 if they never are.

    A step, of 1/60 s at any rate, counts as low if the foot is low at both its ends.
    """
    feet = body_pos_at(body_pos_m, fps, STORE_FPS)[:, _FEET]  # (T', 2, 3)
    low = feet[..., 1] <= low_m
    low = low[1:] & low[:-1]
    speed = np.linalg.norm(np.diff(feet[..., [0, 2]], axis=0), axis=-1) * STORE_FPS * 100.0  # (T'-1, 2)
    return float(speed[low].mean()) if low.any() else 0.0


def floor_penetration_cm(body_pos_m: Floats, fps: float, *, sole_pos_m: Floats | None = None) -> float:
    """Mean depth in cm, over all frames, of the lowest point of the feet under the floor.

    The points are those of the soles (T, F, 3) if given, as `motion.floor.sole_pos_m` knows them of a
    motion's rig; else the balls, and heels `ANKLE_OVER_SOLE_M` under the ankles.

    Raises `ParameterError`, too, if the soles' frames are not the body's.
    """
    lowest_m = _lowest_foot_m(checked_body_pos_m(body_pos_m, fps), sole_pos_m)
    return float(np.maximum(-lowest_m, 0.0).mean() * 100.0)


def floating_share(
    body_pos_m: Floats,
    fps: float,
    *,
    sole_pos_m: Floats | None = None,
    near_m: float = NEAR_M,
    jump_s: float = JUMP_S,
) -> float:
    """Share of the frames, 0 … 1, in which no foot is near the floor for longer than a jump lasts.

    Near is `near_m` or less from the lowest point of the feet to the floor, points as in
    `floor_penetration_cm`. A stretch of more than `jump_s` without counts whole, a shorter one not at
    all; so who dances on a box floats, and who leaps does not.
    """
    up = _lowest_foot_m(checked_body_pos_m(body_pos_m, fps), sole_pos_m) > near_m  # (T,)
    edges = np.flatnonzero(np.diff(up.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    lengths = edges[:, 1] - edges[:, 0]
    return float(lengths[lengths > jump_s * fps].sum() / len(up))


def joint_speed_m_s(body_pos_m: Floats, fps: float) -> tuple[Floats, Floats]:
    """Instants in seconds and mean speed of the joints in m/s, both (T' - 1,) at `JERK_FPS`."""
    return _derivative(body_pos_m, fps, order=1)


def joint_jerk_m_s3(body_pos_m: Floats, fps: float) -> tuple[Floats, Floats]:
    """Instants in seconds and mean jerk over the joints in m/s³, both (T' - 3,) at `JERK_FPS`."""
    return _derivative(body_pos_m, fps, order=3)


def speed_ratio_at(
    body_pos_m: Floats, fps: float, boundary_times_s: Instants, *, half_width_s: float = JOIN_HALF_WIDTH_S
) -> float:
    """Mean speed of the joints within `half_width_s` of any boundary, over their mean speed elsewhere.

    Above 1 the dance hurries to get from one piece to the next, below it stalls. `nan` if no frame is
    near a boundary, none is elsewhere, or nothing moves there.
    """
    near, elsewhere = _at_and_elsewhere(joint_speed_m_s(body_pos_m, fps), boundary_times_s, half_width_s)
    if len(near) == 0 or len(elsewhere) == 0 or elsewhere.mean() == 0:
        return float("nan")
    return float(near.mean() / elsewhere.mean())


def jerk_ratio_at(
    body_pos_m: Floats, fps: float, boundary_times_s: Instants, *, half_width_s: float = JOIN_HALF_WIDTH_S
) -> float:
    """95th percentile of jerk within `half_width_s` of any boundary, over the 95th percentile elsewhere.

    `nan` if no frame is near a boundary or none is elsewhere.
    """
    near, elsewhere = _at_and_elsewhere(joint_jerk_m_s3(body_pos_m, fps), boundary_times_s, half_width_s)
    if len(near) == 0 or len(elsewhere) == 0:
        return float("nan")
    return float(np.percentile(near, 95) / max(np.percentile(elsewhere, 95), 1e-9))


def limb_length_spread_mm(body_pos_m: Floats, fps: float) -> float:
    """Standard deviation over time of the length of a bone in mm: of arms and legs, the worst of ten.

    0 but for rounding where a skeleton moves the joints; some millimetres where they are markers, or
    what a network of positions made up.
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    parents = [BODY_PARENTS[joint] for joint in _LIMB_BONES]
    lengths_m = np.linalg.norm(pos[:, _LIMB_BONES] - pos[:, parents], axis=-1)  # (T, 10)
    return float(lengths_m.std(axis=0).max() * 1000.0)


def evaluate(
    body_pos_m: Floats, fps: float, boundary_times_s: Instants = (), *, sole_pos_m: Floats | None = None
) -> dict[str, float]:
    """All metrics of this module, and those of `metrics.contact_scores`, by name."""
    validate(body_pos_m, fps, boundary_times_s)
    _, jerk = joint_jerk_m_s3(body_pos_m, fps)
    return {
        "foot_slide_cm_s": foot_slide_cm_s(body_pos_m, fps),
        "foot_skating_ratio": foot_skating_ratio(body_pos_m, fps),
        "foot_skating_ratio_published": foot_skating_ratio(body_pos_m, fps, variant="published"),
        "pfc": pfc(body_pos_m, fps),
        "pfc_pieces": pfc(body_pos_m, fps, variant="pieces"),
        "floor_penetration_cm": floor_penetration_cm(body_pos_m, fps, sole_pos_m=sole_pos_m),
        "floating_share": floating_share(body_pos_m, fps, sole_pos_m=sole_pos_m),
        "jerk_p95_m_s3": float(np.percentile(jerk, 95)) if len(jerk) else 0.0,
        "jerk_ratio_at_boundaries": jerk_ratio_at(body_pos_m, fps, boundary_times_s),
        "speed_ratio_at_boundaries": speed_ratio_at(body_pos_m, fps, boundary_times_s),
        "limb_length_spread_mm": limb_length_spread_mm(body_pos_m, fps),
    }


def _lowest_foot_m(pos: Floats, sole_pos_m: Floats | None) -> Floats:
    """Height of the lowest point of the feet over the floor, (T,)."""
    if sole_pos_m is None:
        heels_y_m = pos[:, _ANKLES, 1] - ANKLE_OVER_SOLE_M
        return np.concatenate([pos[:, _FEET, 1], heels_y_m], axis=1).min(axis=1)
    soles = np.asarray(sole_pos_m, np.float64)
    if soles.ndim != 3 or soles.shape[0] != len(pos) or soles.shape[2] != 3 or soles.shape[1] == 0:
        raise ParameterError(f"expected points of the soles ({len(pos)}, F, 3), got {soles.shape}")
    if not np.isfinite(soles).all():
        raise ParameterError("expected finite points of the soles, got nan or infinity")
    return soles[..., 1].min(axis=1)


def _derivative(body_pos_m: Floats, fps: float, *, order: int) -> tuple[Floats, Floats]:
    """Instants and mean size over the joints of the difference of that order, (T' - order,)."""
    pos = body_pos_at(body_pos_m, fps, JERK_FPS)
    if len(pos) <= order:
        return np.zeros(0), np.zeros(0)
    size = np.linalg.norm(np.diff(pos, n=order, axis=0), axis=-1).mean(axis=1) * JERK_FPS**order
    return frame_times_s(len(size), JERK_FPS) + order / 2 / JERK_FPS, size


def _at_and_elsewhere(
    curve: tuple[Floats, Floats], boundary_times_s: Instants, half_width_s: float
) -> tuple[Floats, Floats]:
    """The values of a curve near any boundary, and the others."""
    times_s, values = curve
    boundaries = _checked_instants(boundary_times_s)
    near = (np.abs(times_s[:, None] - boundaries) <= half_width_s).any(axis=1)
    return values[near], values[~near]


def _checked_instants(times_s: Instants) -> Floats:
    instants = np.asarray(times_s, np.float64)
    if instants.ndim != 1 or not np.isfinite(instants).all():
        raise ParameterError(f"expected finite boundaries (B,) in seconds, got an array of {instants.shape}")
    return instants
