"""Published foot contact scores: PFC, the physical foot contact score, and FSR, the foot skating ratio.

Conventions: body positions (T, 21, 3) in metres at any rate, resampled to the 30 fps at which both scores
count frames; Y up, the floor at y = 0. Lower is better. `validate` raises `ParameterError` for positions that
are not finite or have another shape, and for an invalid rate.

**PFC**, physical foot contact score (Tseng et al., EDGE, CVPR 2023; as in its public code): a body can only
accelerate if a foot stands on the floor, so acceleration while both feet slide is penalised. Known
weaknesses, which `variant="published"` keeps:

- Acceleration is divided by its maximum *in the sequence*. One glitch makes everything else look clean, and a
  long dance scores better than its own pieces. `variant="pieces"` is the mean over pieces of 5 s and compares
  dances of different lengths.
- The product of the slower points of both feet is 0 as soon as one foot stands: sliding on one foot at a time
  is perfect. So is standing still in mid-air, where nothing accelerates.
- Height is ignored: a leap, with both feet fast and no floor contact, is penalised.
- The pelvis stands in for the centre of mass, and falling costs nothing (downward acceleration is clipped).
- Displacements are per frame, not per second: at 60 fps the score is a quarter of the one at 30. Hence the
  fixed rate. The final factor of 10,000 is from the public code.

**FSR**, foot skating ratio (Li et al., LODGE, CVPR 2024; as in its public code): of the frames in which a
foot is in contact, the share in which it slides. In contact means an ankle at most 8 cm and a toe joint at
most 5 cm above the ground; sliding means more than 1 cm from frame to frame, for ankle or toe. Known bugs,
which `variant="published"` keeps and `"corrected"` fixes:

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
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import default_numerics
from choreograph.motion.body import BODY_JOINTS, body_pos_at, checked_body_pos_m
from choreograph.motion.contacts import estimate_floor_m

Floats = NDArray[np.float64]

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
    """Raise `ParameterError` unless positions are finite, (T, 21, 3) and not empty, and `fps` is positive."""
    checked_body_pos_m(body_pos_m, fps)


def pfc(body_pos_m: Floats, fps: float, *, variant: Literal["published", "pieces"] = "published") -> float:
    """EDGE's physical foot contact score, 0 if nothing moves; its weaknesses are listed in the module.

    A dance of fewer than three frames at 30 fps has no acceleration and scores 0. Raises `ParameterError` as
    `validate` does, and for an unknown variant.
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
    """LODGE's foot skating ratio, 0 … 1, the mean over both feet; `nan` if neither is ever in contact.

    A foot without contact is left out (the published code then returns nan for the whole data set). Raises
    `ParameterError` as `validate` does, and for an unknown variant.
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
    """All metrics of this module by name. Raises `ParameterError` as `validate` does."""
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
