"""Scenes of several dancers: how near bodies come to each other, and how long one is hidden by others.

Conventions: positions (N, T, 21, 3) in metres of N dancers at `fps`, Y up, the audience at +Z. A body is a
set of capsules around its bones. The gap of two bodies is the least distance on the ground, in metres,
between the surfaces of any capsule of one and any of the other, at whatever height they are: 0 where they
overlap. So an arm over the head of another dancer has a gap of 0. A dancer is hidden in a frame in which
nearer dancers cover at least 80 % of the width of the shoulders, for an eye in front of the middle of the
stage.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.motion.body import BODY_JOINTS, BODY_PARENTS, checked_body_pos_m

_TORSO_M, _HEAD_M, _LEG_M, _ARM_M, _HAND_M = 0.13, 0.10, 0.07, 0.045, 0.10  # radii of capsules
_HIDDEN_SHARE = 0.8  # of the width of the shoulders
_AWAY_M, _AWAY_OF_WIDTH = 8.0, 1.2  # the eye from the nearest body, and the same of the width of the scene
_SHOULDERS = [BODY_JOINTS.index("left_shoulder"), BODY_JOINTS.index("right_shoulder")]
_SHOULDER_M = 0.06  # of flesh beside the joint
_NARROWEST_M = 0.1  # half a body that is seen from the side
_PELVIS = BODY_JOINTS.index("pelvis")


def validate(body_pos_m: Floats, fps: float) -> None:
    """Raise `ParameterError` unless positions (N, T, 21, 3) of two dancers or more, and the rate, are valid.

    Examples
    --------
    >>> cg.metrics.scene.validate(np.zeros((2, 60, 21, 3)), 60.0)
    >>> cg.metrics.scene.validate(np.zeros((60, 21, 3)), 60.0)
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected positions (N, T, 21, 3) of two dancers or more, got ...
    """
    shape = np.shape(body_pos_m)
    if len(shape) != 4 or shape[0] < 2:
        raise ParameterError(f"expected positions (N, T, 21, 3) of two dancers or more, got {shape}")
    for one in body_pos_m:
        checked_body_pos_m(one, fps)


def gaps_m(body_pos_m: Floats, *, most_m: float = np.inf) -> Floats:
    """The least gap (T,) between any two bodies in each frame, up to `most_m`, beyond which it is not exact.

    Examples
    --------
    >>> pos_m = np.zeros((2, 1, 21, 3))
    >>> pos_m[1, ..., 0] = 1.0  # all joints of a body at one place, as a torso of 0.13 m
    >>> cg.metrics.scene.gaps_m(pos_m)
    array([0.74])
    """
    ground_m = np.asarray(body_pos_m, np.float64)[..., [0, 2]]  # (N, T, 21, 2)
    starts, ends, radii = _capsules()
    reach = np.linalg.norm(ground_m - ground_m[:, :, [_PELVIS]], axis=-1).max(axis=2) + max(radii)  # (N, T)
    gaps = np.full(ground_m.shape[1], np.inf)
    for one, other in combinations(range(len(ground_m)), 2):
        between = np.linalg.norm(ground_m[one, :, _PELVIS] - ground_m[other, :, _PELVIS], axis=-1)
        bound = between - reach[one] - reach[other]
        rows = np.flatnonzero(bound < np.minimum(gaps, most_m))
        gaps = np.minimum(gaps, np.where(bound < most_m, gaps, bound))
        if len(rows) == 0:
            continue
        a, b = ground_m[one, rows], ground_m[other, rows]
        away = _segment_gaps_m(a[:, starts], a[:, ends], b[:, starts], b[:, ends])  # (R, S, S)
        away -= np.add.outer(radii, radii)
        gaps[rows] = np.minimum(gaps[rows], np.maximum(away.min(axis=(1, 2)), 0.0))
    return gaps


def _capsules() -> tuple[list[int], list[int], Floats]:
    """Joints at both ends of each capsule (S,), and its radius."""
    joints = [index for index, parent in enumerate(BODY_PARENTS) if parent >= 0]
    radii = []
    for name in (BODY_JOINTS[index] for index in joints):
        of_arm = name.endswith(("elbow", "wrist"))
        of_leg = name.endswith(("knee", "ankle", "foot"))
        radius = _ARM_M if of_arm else _LEG_M if of_leg else _HEAD_M if name == "head" else _TORSO_M
        radii.append(_HAND_M if name.endswith("wrist") else radius)
    return [BODY_PARENTS[index] for index in joints], joints, np.array(radii)


def _segment_gaps_m(a0: Floats, a1: Floats, b0: Floats, b1: Floats) -> Floats:
    """Distances (R, A, B) of segments (R, A, 2) from segments (R, B, 2) on the plane."""
    a0, a1, b0, b1 = a0[:, :, None], a1[:, :, None], b0[:, None], b1[:, None]
    least = np.minimum(
        np.minimum(_point_gaps_m(a0, b0, b1), _point_gaps_m(a1, b0, b1)),
        np.minimum(_point_gaps_m(b0, a0, a1), _point_gaps_m(b1, a0, a1)),
    )
    crosses = (_side(a0, a1, b0) * _side(a0, a1, b1) < 0) & (_side(b0, b1, a0) * _side(b0, b1, a1) < 0)
    return np.where(crosses, 0.0, least)


def _point_gaps_m(point: Floats, start: Floats, end: Floats) -> Floats:
    along, to = end - start, point - start
    share = (to * along).sum(axis=-1) / np.maximum((along * along).sum(axis=-1), 1e-12)
    gaps: Floats = np.linalg.norm(to - np.clip(share, 0.0, 1.0)[..., None] * along, axis=-1)
    return gaps


def _side(start: Floats, end: Floats, point: Floats) -> Floats:
    along, to = end - start, point - start
    side: Floats = along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]
    return side


def hidden(body_pos_m: Floats) -> np.ndarray:
    """Whether each dancer is hidden in each frame, bool (N, T).

    Examples
    --------
    >>> pos_m = np.zeros((2, 1, 21, 3))
    >>> pos_m[1, ..., 2] = -1.0  # the second body is 1 m behind the first one
    >>> cg.metrics.scene.hidden(pos_m)[:, 0].tolist()
    [False, True]
    """
    pos = np.asarray(body_pos_m, np.float64)
    width_m = float(np.ptp(pos[..., _PELVIS, 0]))
    eye_z_m = float(pos[..., _PELVIS, 2].max()) + max(_AWAY_M, _AWAY_OF_WIDTH * width_m)
    away_m = eye_z_m - pos[..., _PELVIS, 2]  # (N, T)
    middle = pos[..., _SHOULDERS, 0].mean(axis=-1)
    half = 0.5 * np.abs(np.diff(pos[..., _SHOULDERS, 0], axis=-1)[..., 0]) + _SHOULDER_M
    half = np.maximum(half, _NARROWEST_M)
    low, high = (middle - half) / away_m, (middle + half) / away_m  # (N, T) as seen at distance 1
    found = np.zeros(away_m.shape, bool)
    for dancer in range(len(pos)):
        nearer = away_m < away_m[dancer]
        nearer[dancer] = False
        samples = np.linspace(0.0, 1.0, 41)[:, None]
        seen = low[dancer] + samples * (high[dancer] - low[dancer])  # (S, T)
        covered = ((seen >= low[:, None]) & (seen <= high[:, None]) & nearer[:, None]).any(axis=0)
        found[dancer] = covered.mean(axis=0) >= _HIDDEN_SHARE
    return found


def longest_hidden_s(body_pos_m: Floats, fps: float) -> float:
    """The longest time in seconds for which a dancer is hidden. Shorter is better.

    Examples
    --------
    >>> pos_m = np.zeros((2, 120, 21, 3))
    >>> pos_m[1, ..., 2] = -1.0
    >>> cg.metrics.scene.longest_hidden_s(pos_m, 60.0)
    2.0
    """
    longest = 0
    for one in hidden(body_pos_m):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], one, [False]]).astype(np.int8)))
        longest = max(longest, *(np.diff(edges.reshape(-1, 2), axis=1).ravel().tolist() or [0]))
    return longest / fps


@default_numerics()
def evaluate(body_pos_m: Floats, fps: float) -> dict[str, float]:
    """Both metrics by name. Raises `ParameterError` as `validate`.

    Examples
    --------
    >>> pos_m = np.zeros((2, 60, 21, 3))
    >>> pos_m[1, ..., 0] = 1.0
    >>> cg.metrics.scene.evaluate(pos_m, 60.0)
    {'least gap of two bodies (m)': 0.74, 'longest time hidden (s)': 0.0}
    """
    validate(body_pos_m, fps)
    return {
        "least gap of two bodies (m)": round(float(gaps_m(body_pos_m).min()), 9),
        "longest time hidden (s)": longest_hidden_s(body_pos_m, fps),
    }
