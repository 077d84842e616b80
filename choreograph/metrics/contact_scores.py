"""The field's scores of feet on the floor, by the names they are published under: PFC and FSR.

Conventions: body positions (T, 21, 3) in metres at any rate, brought to the 30 fps that both scores count
frames at; Y up, the floor at y = 0. Lower is better. Positions of another shape, not finite, or without a
rate are refused with a `ParameterError`.

**PFC**, physical foot contact score (Tseng et al., EDGE, CVPR 2023; as in its public code): a
body can only be pushed if a foot stands, so acceleration while both feet slide is penalised. Known
weaknesses, which `variant="published"` keeps:

- Acceleration is divided by its largest value *in the sequence*. One glitch makes everything else look
  clean, and longer dances score better than their own pieces. `variant="pieces"` is the mean over
  pieces of 5 s, by which dances of unlike length compare.
- The product of the slower points of both feet is 0 as soon as one stands: a dance that slides on one
  foot at a time is perfect. So is standing still in the air, where nothing accelerates.
- Height plays no part: leaping, with both feet fast and no floor to slide on, is penalised.
- The pelvis stands for the centre of mass, and falling is free (downward acceleration is cut off).
- Displacements are those of a frame, not of a second: at 60 fps the score is a quarter of that at 30.
  Hence the fixed rate. The last factor of 10,000 is the code's.

**FSR**, foot skating ratio (Li et al., LODGE, CVPR 2024; as in its public code): share of the
frames a foot is in contact in which it slides. In contact is an ankle at most 8 cm and a toe joint at most
5 cm over the ground; sliding is more than 1 cm from frame to frame, for ankle or toe. Known bugs, which
`variant="published"` keeps and `"corrected"` does not:

- What is compared with 1 cm is the mean of the displacement's two horizontal components *with their
  signs*: a foot that slides along x = -z stands still, and the ratio depends on where the dancer faces.
  Corrected: the length of the displacement.
- The ground is the lower toe joint (or both toes' mean, if within 2 cm) of the *first frame*, in the air
  as it may be. Corrected: the height the toes keep on most frames, `motion.floor.estimate_floor_m`.
- The last frame has no successor, and counts as still. Corrected: it is left out.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.motion.body import BODY_JOINTS, body_pos_at
from choreograph.motion.floor import estimate_floor_m

Floats = NDArray[np.float64]

SCORE_FPS = 30.0
PFC_SCALE = 10_000.0
PIECE_S = 5.0
ANKLE_LOW_M, TOE_LOW_M = 0.08, 0.05
SLIDE_M = 0.01  # in 1/30 s
_SAME_GROUND_M = 0.02
_ROUNDING_M_S2 = 1e-6  # less is no acceleration, and must not be blown up to 1
_ANKLES = [BODY_JOINTS.index("left_ankle"), BODY_JOINTS.index("right_ankle")]
_TOES = [BODY_JOINTS.index("left_foot"), BODY_JOINTS.index("right_foot")]


def pfc(body_pos_m: Floats, fps: float, *, variant: Literal["published", "pieces"] = "published") -> float:
    """EDGE's physical foot contact score, 0 if nothing moves; see the module for what it misses.

    A dance without three frames at 30 fps has no acceleration, and scores 0.
    """
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

    A foot without contact is left out (the published code has nan for the whole data set then).
    """
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


def _pfc(pos: Floats) -> float:
    """The score of positions (T, 21, 3) at 30 fps."""
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
    """The ground as LODGE's code has it: under the toes (T, 2, 3) of the first frame."""
    left, right = toes[0, :, 1]
    return float((left + right) / 2 if abs(left - right) < _SAME_GROUND_M else min(left, right))


def _check_variant(variant: str, known: tuple[str, ...]) -> None:
    if variant not in known:
        raise ParameterError(f"expected variant {' or '.join(known)}, got {variant!r}")
