"""Physical plausibility: foot sliding, floor, jerk, transitions, one-frame jumps, bone lengths.

Conventions: body positions (T, 21, 3) are in metres at `fps`. Y is up and the floor is at y = 0. A foot is
low when its ball is at most `LOW_M` above the floor. Speed (m/s) and jerk (m/s³) are first and third
differences of the joint positions at 20 fps, for any rate of the source, so that dances and takes can be
compared. `validate` raises `ParameterError` for positions that are not finite or have another shape, and for
an invalid rate.

Two published scores of foot contacts are resampled to the 30 fps at which they count frames. Lower is better.

**PFC** is the physical foot contact score of EDGE (Tseng et al., CVPR 2023), as in its public code. A body
can only accelerate if a foot stands on the floor, so acceleration while both feet slide is penalised. The
score is the mean product of the acceleration and of the speeds of both feet. `variant="published"` keeps its
weaknesses:

- Acceleration is divided by its maximum *in the sequence*. One glitch makes everything else look clean, and a
  long dance scores better than its own pieces. `variant="pieces"` is the mean over pieces of 5 s and compares
  dances of different lengths.
- The product of the slower points of both feet is 0 as soon as one foot stands: sliding on one foot at a time
  is perfect. So is standing still in mid-air, where nothing accelerates.
- Height is ignored: a leap, with both feet fast and no floor contact, is penalised.
- The pelvis stands in for the centre of mass, and falling costs nothing (downward acceleration is clipped).
- Displacements are per frame, not per second: at 60 fps the score is a quarter of the one at 30. Hence the
  fixed rate. The final factor of 10,000 is from the public code.

**FSR** is the foot skating ratio of LODGE (Li et al., CVPR 2024), as in its public code. It is the share of
the frames with contact in which the foot slides. A foot is in contact if the ankle is at most 8 cm and the
toe joint at most 5 cm above the ground. It slides if the ankle or the toe moves more than 1 cm from frame to
frame. `variant="published"` keeps these errors of the code, and `"corrected"` fixes them:

- The value compared with 1 cm is the *signed* mean of the displacement's two horizontal components: a foot
  that slides along x = -z counts as still, and the ratio depends on the dancer's heading. Corrected: the
  length of the displacement.
- The ground is the lower toe joint (or the mean of both if within 2 cm) of the *first frame*, even if that is
  in mid-air. Corrected: the height of the toes on most frames, `motion.contacts.estimate_floor_m`.
- The last frame has no successor and counts as still. Corrected: it is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import NET_FPS, STORE_FPS, frame_times_s
from choreograph.motion.body import BODY_JOINTS, BODY_PARENTS, body_pos_at, checked_body_pos_m
from choreograph.motion.contacts import estimate_floor_m

Times = Sequence[float] | Floats

LOW_M = 0.05
JERK_FPS = NET_FPS
ANKLE_OVER_SOLE_M = 0.07  # of the canonical body. On real bodies it is 7 to 10 cm
NEAR_M = 0.08  # a standing ball joint is 2 cm above its sole, and captures are off by several cm either way
JUMP_S = 0.7  # flight time of a jump of 60 cm, which few dancers reach
BOUNDARY_HALF_WIDTH_S = 0.12
JOIN_HALF_WIDTH_S = 0.25  # a transition is longer than the instant at which takes change
JUMP_M_PER_FRAME2 = 0.05  # at 60 fps, 18 times gravity, which no joint of a dancer reaches
SAME_JUMP_S = 0.1
_FEET = [BODY_JOINTS.index("left_foot"), BODY_JOINTS.index("right_foot")]
_ANKLES = [BODY_JOINTS.index("left_ankle"), BODY_JOINTS.index("right_ankle")]
# Bones that are a single rigid bone on every rig. The number of trunk joints differs between rigs.
_LIMB_BONES = [
    BODY_JOINTS.index(f"{side}_{end}")
    for side in ("left", "right")
    for end in ("knee", "ankle", "foot", "elbow", "wrist")
]


def validate(body_pos_m: Floats, fps: float, boundary_times_s: Times = ()) -> None:
    """Raise `ParameterError` unless positions (T, 21, 3), rate and boundaries (B,) are finite and valid.

    Examples
    --------
    >>> cg.metrics.physical.validate(np.zeros((60, 21, 3)), 60.0, boundary_times_s=[0.5])
    >>> cg.metrics.physical.validate(np.zeros((60, 21, 3)), 60.0, boundary_times_s=[np.nan])
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected finite boundaries (B,) in seconds, got an array of (1,)
    """
    checked_body_pos_m(body_pos_m, fps)
    _checked_boundaries(boundary_times_s)


def foot_slide_cm_s(body_pos_m: Floats, fps: float, *, low_m: float = LOW_M) -> float:
    """Mean horizontal speed of the balls of the feet while low, in cm/s. Lower is better.

    A speed is measured over 1/60 s at any rate, if the foot is low at both ends of it. The result is 0 if the
    feet are never low.

    Examples
    --------
    >>> pos_m = np.zeros((120, 21, 3))
    >>> pos_m[:, :, 0] = 0.1 * np.arange(120)[:, None] / 60  # a glide of 10 cm/s on the floor
    >>> round(cg.metrics.physical.foot_slide_cm_s(pos_m, 60.0), 3)
    10.0
    """
    speed, low = _sliding(body_pos_m, fps, low_m)
    return float(speed[low].mean()) if low.any() else 0.0


def foot_slide_ratio_at(
    body_pos_m: Floats,
    fps: float,
    boundary_times_s: Times,
    *,
    half_width_s: float = JOIN_HALF_WIDTH_S,
    low_m: float = LOW_M,
) -> float:
    """`foot_slide_cm_s` within `half_width_s` of any boundary, divided by that elsewhere. Lower is better.

    1 means that feet slide no more at transitions than elsewhere. The result is nan if no foot is low near a
    boundary or elsewhere, or no foot slides elsewhere.

    Examples
    --------
    >>> pos_m = np.zeros((120, 21, 3))
    >>> pos_m[:, :, 0] = 0.1 * np.arange(120)[:, None] / 60  # a glide of 10 cm/s on the floor
    >>> pos_m[60:, :, 0] += 0.05  # and a slip at 1 s
    >>> round(cg.metrics.physical.foot_slide_ratio_at(pos_m, 60.0, boundary_times_s=[1.0]), 1)
    2.0
    """
    speed, low = _sliding(body_pos_m, fps, low_m)
    times_s = frame_times_s(len(speed), STORE_FPS) + 0.5 / STORE_FPS
    at, elsewhere = _at_and_elsewhere((times_s, np.where(low, speed, np.nan)), boundary_times_s, half_width_s)
    if np.isnan(at).all() or np.isnan(elsewhere).all() or np.nanmean(elsewhere) == 0:
        return float("nan")
    return float(np.nanmean(at) / np.nanmean(elsewhere))


def floor_penetration_cm(body_pos_m: Floats, fps: float, *, sole_pos_m: Floats | None = None) -> float:
    """Mean depth in cm, over all frames, of the lowest point of the feet below the floor. Lower is better.

    With `sole_pos_m` (T, F, 3), from `motion.contacts.sole_pos_m`, the points are those of the rig's soles.
    Otherwise they are the balls of the feet, and heels `ANKLE_OVER_SOLE_M` below the ankles.

    Raises `ParameterError` as `validate` does, and if the soles have another number of frames than the body.

    Examples
    --------
    >>> body_m, soles_m = np.ones((60, 21, 3)), np.full((60, 4, 3), -0.02)
    >>> round(cg.metrics.physical.floor_penetration_cm(body_m, 60.0, sole_pos_m=soles_m), 3)
    2.0
    >>> cg.metrics.physical.floor_penetration_cm(body_m, 60.0)
    0.0
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
    """Share of the frames, 0 to 1, in which no foot is near the floor for longer than a jump lasts.

    Lower is better. Near means that the lowest point of the feet (see `floor_penetration_cm`) is at most
    `near_m` above the floor. A span without contact counts in full if it is longer than `jump_s`, and not at
    all otherwise. A leap is not floating. Dancing on a box is.

    Examples
    --------
    >>> pos_m = np.full((120, 21, 3), 0.05)
    >>> pos_m[60:] += 0.5  # in the air for the second of two seconds
    >>> cg.metrics.physical.floating_share(pos_m, 60.0)
    0.5
    """
    up = _lowest_foot_m(checked_body_pos_m(body_pos_m, fps), sole_pos_m) > near_m  # (T,)
    edges = np.flatnonzero(np.diff(up.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    lengths = edges[:, 1] - edges[:, 0]
    return float(lengths[lengths > jump_s * fps].sum() / len(up))


def joint_speed_m_s(body_pos_m: Floats, fps: float) -> tuple[Floats, Floats]:
    """Times in seconds and mean joint speed in m/s, both (T' - 1,) at `JERK_FPS`.

    Examples
    --------
    >>> pos_m = np.zeros((120, 21, 3))
    >>> pos_m[:, :, 0] = 0.1 * np.arange(120)[:, None] / 60  # a glide of 10 cm/s on the floor
    >>> times_s, speed_m_s = cg.metrics.physical.joint_speed_m_s(pos_m, 60.0)
    >>> round(speed_m_s.mean(), 3)
    np.float64(0.1)
    """
    return _derivative(body_pos_m, fps, order=1)


def joint_jerk_m_s3(body_pos_m: Floats, fps: float) -> tuple[Floats, Floats]:
    """Times in seconds and mean joint jerk in m/s³, both (T' - 3,) at `JERK_FPS`.

    Examples
    --------
    >>> pos_m = np.zeros((60, 21, 3))
    >>> pos_m[:, :, 0] = np.arange(60)[:, None] ** 3 / 20**3  # x = t³, whose third derivative is 6
    >>> cg.metrics.physical.joint_jerk_m_s3(pos_m, 20.0)[1].mean().round(3)
    np.float64(6.0)
    """
    return _derivative(body_pos_m, fps, order=3)


def speed_ratio_at(
    body_pos_m: Floats, fps: float, boundary_times_s: Times, *, half_width_s: float = BOUNDARY_HALF_WIDTH_S
) -> float:
    """Mean joint speed within `half_width_s` of any boundary, divided by the mean joint speed elsewhere.

    Above 1 the dance speeds up at transitions, and below 1 it slows down. 1 is best. The result is nan if no
    frame is near a boundary, all are, or nothing moves elsewhere.

    Examples
    --------
    >>> pos_m = np.zeros((120, 21, 3))
    >>> pos_m[:, :, 0] = 0.1 * np.arange(120)[:, None] / 60  # a glide of 10 cm/s on the floor
    >>> round(cg.metrics.physical.speed_ratio_at(pos_m, 60.0, boundary_times_s=[1.0]), 3)
    1.0
    """
    near, elsewhere = _at_and_elsewhere(joint_speed_m_s(body_pos_m, fps), boundary_times_s, half_width_s)
    if len(near) == 0 or len(elsewhere) == 0 or elsewhere.mean() == 0:
        return float("nan")
    return float(near.mean() / elsewhere.mean())


def jerk_ratio_at(
    body_pos_m: Floats, fps: float, boundary_times_s: Times, *, half_width_s: float = BOUNDARY_HALF_WIDTH_S
) -> float:
    """95th percentile of the jerk within `half_width_s` of any boundary, divided by that elsewhere.

    1 means that transitions are as smooth as the rest. Lower is better. The result is nan if no frame is near
    a boundary, or all are.

    Examples
    --------
    >>> noise_m = np.random.default_rng(0).normal(0.0, 0.01, (80, 21, 3))
    >>> pop_m = noise_m.copy()
    >>> pop_m[40:] += 1.0  # the body jumps at 2 s
    >>> ratios = [cg.metrics.physical.jerk_ratio_at(pos_m, 20.0, [2.0]) for pos_m in (noise_m, pop_m)]
    >>> ratios[0] < 1.5 < 10 < ratios[1]
    True
    """
    near, elsewhere = _at_and_elsewhere(joint_jerk_m_s3(body_pos_m, fps), boundary_times_s, half_width_s)
    if len(near) == 0 or len(elsewhere) == 0:
        return float("nan")
    return float(np.percentile(near, 95) / max(np.percentile(elsewhere, 95), 1e-9))


def jump_times_s(body_pos_m: Floats, fps: float, *, above_m: float = JUMP_M_PER_FRAME2) -> Floats:
    """Instants (N,) in seconds at which a joint leaves its path for a frame or two.

    There the second difference of the position of any joint at 60 fps is longer than `above_m` (metres per
    frame²). Frames and joints within `SAME_JUMP_S` of each other are one jump, at its first frame.

    Examples
    --------
    >>> pos_m = np.zeros((120, 21, 3))
    >>> pos_m[60, 5] = 0.2  # one joint, for one frame
    >>> cg.metrics.physical.jump_times_s(pos_m, 60.0).round(2)
    array([0.98])
    """
    pos = body_pos_at(body_pos_m, fps, STORE_FPS)
    bend_m = np.linalg.norm(np.diff(pos, n=2, axis=0), axis=-1).max(axis=1, initial=0.0)  # (T' - 2,)
    times_s = frame_times_s(len(pos), STORE_FPS)[1:-1][bend_m > above_m]
    result: Floats = times_s[np.diff(times_s, prepend=-np.inf) > SAME_JUMP_S]
    return result


def jumps_per_minute(body_pos_m: Floats, fps: float) -> float:
    """One-frame jumps (see `jump_times_s`) per minute. Lower is better. 0 for fewer than three frames.

    Examples
    --------
    >>> pos_m = np.zeros((120, 21, 3))
    >>> pos_m[60, 5] = 0.2  # one joint, for one frame of 2 s
    >>> cg.metrics.physical.jumps_per_minute(pos_m, 60.0)
    30.0
    """
    return len(jump_times_s(body_pos_m, fps)) * 60.0 * fps / len(body_pos_m)


def limb_length_spread_mm(body_pos_m: Floats, fps: float) -> float:
    """Standard deviation over time of the length of a bone in mm, the largest of ten bones of arms and legs.

    0 up to rounding for the motion of a skeleton. Some millimetres for markers, or for positions that a
    network predicts. Lower is better.

    Examples
    --------
    >>> pose_m = np.random.default_rng(0).normal(size=(1, 21, 3))
    >>> steady_m, growing_m = np.repeat(pose_m, 60, axis=0), pose_m * np.linspace(1.0, 1.1, 60)[:, None, None]
    >>> spread = [cg.metrics.physical.limb_length_spread_mm(pos_m, 60.0) for pos_m in (steady_m, growing_m)]
    >>> spread[0] < 1e-9, spread[1] > 50
    (True, True)
    """
    pos = checked_body_pos_m(body_pos_m, fps)
    parents = [BODY_PARENTS[joint] for joint in _LIMB_BONES]
    lengths_m = np.linalg.norm(pos[:, _LIMB_BONES] - pos[:, parents], axis=-1)  # (T, 10)
    return float(lengths_m.std(axis=0).max() * 1000.0)


@default_numerics()
def evaluate(
    body_pos_m: Floats, fps: float, boundary_times_s: Times = (), *, sole_pos_m: Floats | None = None
) -> dict[str, float]:
    """All metrics of this module by name.

    Examples
    --------
    >>> scores = cg.metrics.physical.evaluate(np.zeros((120, 21, 3)), 60.0)  # a body that stands still
    >>> scores["foot_slide_cm_s"], scores["jumps_per_minute"], scores["foot_skating_ratio"]
    (0.0, 0.0, 0.0)
    """
    validate(body_pos_m, fps, boundary_times_s)
    _, jerk = joint_jerk_m_s3(body_pos_m, fps)
    return {
        "foot_slide_cm_s": foot_slide_cm_s(body_pos_m, fps),
        "foot_slide_ratio_at_joins": foot_slide_ratio_at(body_pos_m, fps, boundary_times_s),
        **evaluate_contacts(body_pos_m, fps),
        "floor_penetration_cm": floor_penetration_cm(body_pos_m, fps, sole_pos_m=sole_pos_m),
        "floating_share": floating_share(body_pos_m, fps, sole_pos_m=sole_pos_m),
        "jerk_p95_m_s3": float(np.percentile(jerk, 95)) if len(jerk) else 0.0,
        "jerk_ratio_at_boundaries": jerk_ratio_at(body_pos_m, fps, boundary_times_s),
        "jerk_ratio_at_joins": jerk_ratio_at(
            body_pos_m, fps, boundary_times_s, half_width_s=JOIN_HALF_WIDTH_S
        ),
        "speed_ratio_at_boundaries": speed_ratio_at(body_pos_m, fps, boundary_times_s),
        "jumps_per_minute": jumps_per_minute(body_pos_m, fps),
        "limb_length_spread_mm": limb_length_spread_mm(body_pos_m, fps),
    }


def _sliding(body_pos_m: Floats, fps: float, low_m: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Ground speed in cm/s of the balls of the feet at 60 fps, and whether they are low, (T' - 1, 2) each."""
    feet = body_pos_at(body_pos_m, fps, STORE_FPS)[:, _FEET]  # (T', 2, 3)
    low = feet[..., 1] <= low_m
    speed = np.linalg.norm(np.diff(feet[..., [0, 2]], axis=0), axis=-1) * STORE_FPS * 100.0
    return speed, low[1:] & low[:-1]


def _lowest_foot_m(pos: Floats, sole_pos_m: Floats | None) -> Floats:
    """Height of the lowest point of the feet above the floor, (T,)."""
    lowest_m: Floats
    if sole_pos_m is None:
        heels_y_m = pos[:, _ANKLES, 1] - ANKLE_OVER_SOLE_M
        lowest_m = np.concatenate([pos[:, _FEET, 1], heels_y_m], axis=1).min(axis=1)
        return lowest_m
    soles = np.asarray(sole_pos_m, np.float64)
    if soles.ndim != 3 or soles.shape[0] != len(pos) or soles.shape[2] != 3 or soles.shape[1] == 0:
        raise ParameterError(f"expected points on the soles ({len(pos)}, F, 3), got {soles.shape}")
    if not np.isfinite(soles).all():
        raise ParameterError("expected finite points on the soles, got nan or infinity")
    lowest_m = soles[..., 1].min(axis=1)
    return lowest_m


def _derivative(body_pos_m: Floats, fps: float, *, order: int) -> tuple[Floats, Floats]:
    """Times and mean length over the joints of the difference of that order, both (T' - order,)."""
    pos = body_pos_at(body_pos_m, fps, JERK_FPS)
    if len(pos) <= order:
        return np.zeros(0), np.zeros(0)
    size = np.linalg.norm(np.diff(pos, n=order, axis=0), axis=-1).mean(axis=1) * JERK_FPS**order
    return frame_times_s(len(size), JERK_FPS) + order / 2 / JERK_FPS, size


def _at_and_elsewhere(
    curve: tuple[Floats, Floats], boundary_times_s: Times, half_width_s: float
) -> tuple[Floats, Floats]:
    """The values of a curve near any boundary, and the others."""
    times_s, values = curve
    boundaries = _checked_boundaries(boundary_times_s)
    near = (np.abs(times_s[:, None] - boundaries) <= half_width_s).any(axis=1)
    return values[near], values[~near]


def _checked_boundaries(times_s: Times) -> Floats:
    boundaries = np.asarray(times_s, np.float64)
    if boundaries.ndim != 1 or not np.isfinite(boundaries).all():
        raise ParameterError(
            f"expected finite boundaries (B,) in seconds, got an array of {boundaries.shape}"
        )
    return boundaries


# Published foot contact scores: PFC, the physical foot contact score, and FSR, the foot skating ratio.


SCORE_FPS = 30.0
PFC_SCALE = 10_000.0
PIECE_S = 5.0
ANKLE_LOW_M, TOE_LOW_M = 0.08, 0.05
SLIDE_M = 0.01  # in 1/30 s
_SAME_GROUND_M = 0.02
_ROUNDING_M_S2 = 1e-6  # rounding noise below this must not be normalised to 1


def pfc(body_pos_m: Floats, fps: float, *, variant: Literal["published", "pieces"] = "published") -> float:
    """Physical foot contact score of EDGE, 0 or more. Lower is better, and 0 means that nothing moves.

    The module's docstring gives the formula and its weaknesses. A dance of fewer than three frames at 30 fps
    has no acceleration and scores 0. Raises `ParameterError` as `validate` does, and for an unknown variant.

    Examples
    --------
    >>> still_m = np.zeros((60, 21, 3))
    >>> slide_m = still_m + (np.arange(60) / 30)[:, None, None] ** 2  # both feet slide faster and faster
    >>> cg.metrics.physical.pfc(still_m, 30.0), cg.metrics.physical.pfc(slide_m, 30.0) > 10
    (0.0, True)
    """
    validate(body_pos_m, fps)
    _check_variant(variant, ("published", "pieces"))
    pos = body_pos_at(body_pos_m, fps, SCORE_FPS)
    if variant == "published":
        return _pfc(pos)
    n_pieces = max(1, round(len(pos) / SCORE_FPS / PIECE_S))
    return float(np.mean([_pfc(piece) for piece in np.array_split(pos, n_pieces)]))


def foot_skating_ratio(
    body_pos_m: Floats, fps: float, *, variant: Literal["published", "corrected"] = "corrected"
) -> float:
    """Foot skating ratio of LODGE, 0 to 1, the mean over both feet. Lower is better.

    It is the share of the frames with contact in which the foot moves more than 1 cm per 1/30 s. A foot
    without contact is left out, and the result is nan if neither foot is ever in contact. Raises
    `ParameterError` as `validate` does, and for an unknown variant.

    Examples
    --------
    >>> still_m = np.zeros((60, 21, 3))
    >>> slide_m = still_m.copy()
    >>> slide_m[:, :, 0] = np.arange(60)[:, None] / 30  # 1 m/s, on the floor
    >>> [cg.metrics.physical.foot_skating_ratio(pos_m, 30.0) for pos_m in (still_m, slide_m)]
    [0.0, 1.0]
    """
    validate(body_pos_m, fps)
    _check_variant(variant, ("published", "corrected"))
    pos = body_pos_at(body_pos_m, fps, SCORE_FPS)
    toes = pos[:, _FEET]  # (T, 2, 3)
    ground_m = _first_ground_m(toes) if variant == "published" else estimate_floor_m(toes)
    feet = np.stack([pos[:, _ANKLES], toes], axis=2)  # (T, foot, point, 3)
    low = feet[..., 1] <= ground_m + np.array([ANKLE_LOW_M, TOE_LOW_M])  # (T, foot, point)
    contact = low[..., 0] & low[..., 1]  # (T, foot)
    step = np.diff(feet[..., [0, 2]], axis=0)  # (T-1, foot, point, 2)
    if variant == "published":
        slides = (np.abs(step.mean(axis=-1)) > SLIDE_M).any(axis=-1)
        slides = np.concatenate([slides, np.zeros((1, 2), bool)])
    else:
        slides = (np.linalg.norm(step, axis=-1) > SLIDE_M).any(axis=-1)
        contact = contact[:-1]
    frames = contact.sum(axis=0)  # (foot,)
    if not frames.any():
        return float("nan")
    return float(np.mean((slides & contact).sum(axis=0)[frames > 0] / frames[frames > 0]))


@default_numerics()
def evaluate_contacts(body_pos_m: Floats, fps: float) -> dict[str, float]:
    """The published scores of foot contacts by name. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> cg.metrics.physical.evaluate_contacts(np.zeros((60, 21, 3)), 30.0)["pfc"]
    0.0
    """
    return {
        "foot_skating_ratio": foot_skating_ratio(body_pos_m, fps),
        "foot_skating_ratio_published": foot_skating_ratio(body_pos_m, fps, variant="published"),
        "pfc": pfc(body_pos_m, fps),
        "pfc_pieces": pfc(body_pos_m, fps, variant="pieces"),
    }


def _pfc(pos: Floats) -> float:
    """PFC of positions (T, 21, 3) at 30 fps."""
    if len(pos) < 3:
        return 0.0
    acceleration = np.diff(pos[:, 0], n=2, axis=0) * SCORE_FPS**2  # (T-2, 3) of the pelvis
    acceleration[:, 1] = np.maximum(acceleration[:, 1], 0.0)
    push = np.linalg.norm(acceleration, axis=-1)  # (T-2,)
    feet = np.stack([pos[:, _ANKLES], pos[:, _FEET]], axis=2)[..., [0, 2]]  # (T, foot, point, 2)
    step_m = np.linalg.norm(np.diff(feet[1:], axis=0), axis=-1).min(axis=-1)  # (T-2, foot)
    largest = push.max()
    if largest < _ROUNDING_M_S2:
        return 0.0
    return float((step_m.prod(axis=1) * push).mean() / largest * PFC_SCALE)


def _first_ground_m(toes: Floats) -> float:
    """Ground height as in LODGE's code: under the toes (T, 2, 3) of the first frame."""
    left, right = toes[0, :, 1]
    return float((left + right) / 2 if abs(left - right) < _SAME_GROUND_M else min(left, right))


def _check_variant(variant: str, known: tuple[str, ...]) -> None:
    if variant not in known:
        raise ParameterError(f"expected variant {' or '.join(known)}, got {variant!r}")
