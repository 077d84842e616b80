"""Published foot contact scores: PFC, the physical foot contact score, and FSR, the foot skating ratio.

Conventions: body positions (T, 21, 3) are in metres at any rate. They are resampled to the 30 fps at which
both scores count frames. Y is up and the floor is at y = 0. Lower is better. `validate` raises
`ParameterError` for positions that are not finite or have another shape, and for an invalid rate.

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

from typing import Literal

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.motion.body import BODY_JOINTS, body_pos_at, checked_body_pos_m
from choreograph.motion.contacts import estimate_floor_m

SCORE_FPS = 30.0
PFC_SCALE = 10_000.0
PIECE_S = 5.0
ANKLE_LOW_M, TOE_LOW_M = 0.08, 0.05
SLIDE_M = 0.01  # in 1/30 s
_SAME_GROUND_M = 0.02
_ROUNDING_M_S2 = 1e-6  # rounding noise below this must not be normalised to 1
_ANKLES = [BODY_JOINTS.index("left_ankle"), BODY_JOINTS.index("right_ankle")]
_TOES = [BODY_JOINTS.index("left_foot"), BODY_JOINTS.index("right_foot")]


def validate(body_pos_m: Floats, fps: float) -> None:
    """Raise `ParameterError` unless positions are finite, (T, 21, 3) and not empty, and `fps` is positive.

    Examples
    --------
    >>> cg.metrics.contact_scores.validate(np.zeros((60, 21, 3)), 30.0)
    >>> cg.metrics.contact_scores.validate(np.zeros((60, 3)), 30.0)
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected body positions ... (60, 3)
    """
    checked_body_pos_m(body_pos_m, fps)


def pfc(body_pos_m: Floats, fps: float, *, variant: Literal["published", "pieces"] = "published") -> float:
    """Physical foot contact score of EDGE, 0 or more. Lower is better, and 0 means that nothing moves.

    The module's docstring gives the formula and its weaknesses. A dance of fewer than three frames at 30 fps
    has no acceleration and scores 0. Raises `ParameterError` as `validate` does, and for an unknown variant.

    Examples
    --------
    >>> still_m = np.zeros((60, 21, 3))
    >>> slide_m = still_m + (np.arange(60) / 30)[:, None, None] ** 2  # both feet slide faster and faster
    >>> cg.metrics.contact_scores.pfc(still_m, 30.0), cg.metrics.contact_scores.pfc(slide_m, 30.0) > 10
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
    >>> [cg.metrics.contact_scores.foot_skating_ratio(pos_m, 30.0) for pos_m in (still_m, slide_m)]
    [0.0, 1.0]
    """
    validate(body_pos_m, fps)
    _check_variant(variant, ("published", "corrected"))
    pos = body_pos_at(body_pos_m, fps, SCORE_FPS)
    toes = pos[:, _TOES]  # (T, 2, 3)
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
def evaluate(body_pos_m: Floats, fps: float) -> dict[str, float]:
    """All metrics of this module by name. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> cg.metrics.contact_scores.evaluate(np.zeros((60, 21, 3)), 30.0)["pfc"]
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
    feet = np.stack([pos[:, _ANKLES], pos[:, _TOES]], axis=2)[..., [0, 2]]  # (T, foot, point, 2)
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
