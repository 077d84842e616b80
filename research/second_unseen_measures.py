"""The second set of unseen measures: of parts of the body together, of rhythms, of paths, and of space.

No value of them for the built-in takes was known when they were written. See `research.unseen_measures`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import welch
from scipy.spatial import ConvexHull, QhullError

from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.movement import LEG_JOINTS, Window, correlation, from_mean
from choreograph.motion.body import BODY_JOINTS, mirrored
from research.unseen_measure_parts import MeasureSet, between_feet_m, landings, pelvis_aside_m

NAN = float("nan")
UPPER_BODY = [
    i for i, joint in enumerate(BODY_JOINTS) if not joint.endswith(("pelvis", "hip", "knee", "ankle", "foot"))
]
FASTEST_HZ = 4.0  # above it are the errors of captures, and little dancing
LONGEST_SPECTRUM_S = 10.0
SLOWEST_HZ = 0.2  # below it a spectrum of 10 s has no more than two values
NEAR_HZ = 0.15  # around a frequency: a spectrum of 10 s has a value every 0.1 Hz
TRAVELS_M_S, ARM_MOVES_M_S = 0.15, 0.3  # at lower speeds a path has no direction
SHORTEST_PATH_S = 1.0
SWING_S = (0.25, 1.5)  # of a foot between two stands
FEWEST_LANDINGS = 4
MIRRORED_AFTER_S = (0.2, 4.0)


# Rhythms.


def spectrum(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in Hz (F,) and the power of the changes of values (T, ...) at them, of all axes, (F,)."""
    changes = np.diff(values.reshape(len(values), -1), axis=0)
    length = min(round(LONGEST_SPECTRUM_S * NET_FPS), len(changes))
    hz, power = welch(changes, NET_FPS, nperseg=length, axis=0)
    kept = (hz >= SLOWEST_HZ) & (hz <= FASTEST_HZ)
    return hz[kept], power[kept].sum(axis=1)


def share_of(power: np.ndarray, kept: np.ndarray) -> float:
    return float(power[kept].sum() / max(power.sum(), 1e-12))


def entropy(weights: np.ndarray) -> float:
    """How evenly weights (N,) are spread: 0 is one of them alone, 1 is all alike."""
    parts = weights / max(weights.sum(), 1e-12)
    parts = parts[parts > 0]
    return float(-(parts * np.log(parts)).sum() / np.log(len(weights)))


def bounce_at_one_frequency(window: Window) -> float:
    """How much of the up and down of the pelvis is at its strongest frequency."""
    hz, power = spectrum(window.joint("pelvis")[:, 1])
    return share_of(power, np.abs(hz - hz[power.argmax()]) < NEAR_HZ)


def trunk_on_counts(window: Window) -> float:
    """How much of the motion of the trunk is once a count or once in two. nan where no counts are known."""
    if not window.bars:
        return NAN
    hz, power = spectrum(window.facing_joint("neck")[:, [0, 2]])
    counts_hz = np.array([1.0, 0.5]) / window.count_s
    return share_of(power, (np.abs(hz[:, None] - counts_hz) < NEAR_HZ).any(axis=1))


def slow_arms(window: Window) -> float:
    hz, power = spectrum(np.moveaxis(window.wrists_m, 0, 1))
    return share_of(power, hz < 1.0)


def legs_mirrored_later(window: Window) -> float:
    """The highest correlation of the legs with their mirror image of 0.2 to 4 s later."""
    legs = window.facing[:, LEG_JOINTS].reshape(len(window.facing), -1)
    other = mirrored(window.facing)[:, LEG_JOINTS].reshape(len(window.facing), -1)
    middle = 0.5 * (legs.mean(axis=0) + other.mean(axis=0))
    legs, other = legs - middle, other - middle
    first, last = (round(after_s * NET_FPS) for after_s in MIRRORED_AFTER_S)
    alike = [
        np.sum(legs[:-lag] * other[lag:])
        / np.sqrt(np.sum(legs[:-lag] ** 2) * np.sum(other[lag:] ** 2) + 1e-12)
        for lag in range(first, last + 1)
    ]
    return float(max(alike))


# Steps.


def pelvis_at_landings(window: Window) -> float:
    """The height of the pelvis as a foot lands, from its mean over 2 s, by the standard deviation of that."""
    height = from_mean(window.joint("pelvis")[:, 1])
    lands = np.concatenate([landings(side) + 1 for side in window.contacts.T])
    if len(lands) < FEWEST_LANDINGS or height.std() < 1e-3:
        return NAN
    return float(height[lands].mean() / height.std())


def fastest_in_swing(window: Window) -> float:
    """When a foot is fastest between two stands: 0 is as it leaves the floor, 1 as it lands."""
    found = []
    for stands, foot_m in zip(window.contacts.T, window.sides("foot"), strict=True):
        speed = np.linalg.norm(np.diff(foot_m, axis=0), axis=-1)
        for leaves in landings(~stands):
            lands = leaves + np.flatnonzero(stands[leaves + 1 :])[:1] + 1
            n_frames = int(lands[0] - leaves) if len(lands) else 0
            if SWING_S[0] * NET_FPS <= n_frames <= SWING_S[1] * NET_FPS:
                found.append((speed[leaves : leaves + n_frames].argmax() + 0.5) / n_frames)
    return float(np.mean(found)) if len(found) >= FEWEST_LANDINGS else NAN


def legs_shorten_together(window: Window) -> float:
    left, right = np.linalg.norm(window.sides("hip") - window.sides("ankle"), axis=-1)
    return correlation(left, right)


def ankles_together(window: Window) -> float:
    return correlation(window.facing_joint("left_ankle")[:, 2], window.facing_joint("right_ankle")[:, 2])


# Paths and turns.


def curvature_1_m(path_m: np.ndarray, slowest_m_s: float) -> np.ndarray:
    """Curvature of a path (T, 3), one over the radius, in the frames in which it is not slow."""
    velocity = np.gradient(path_m, axis=0) * NET_FPS
    acceleration = np.gradient(velocity, axis=0) * NET_FPS
    speed = np.linalg.norm(velocity, axis=1)
    kept = speed > slowest_m_s
    return np.linalg.norm(np.cross(velocity[kept], acceleration[kept]), axis=1) / speed[kept] ** 3


def median_of_path(curvatures_1_m: np.ndarray) -> float:
    return float(np.median(curvatures_1_m)) if len(curvatures_1_m) >= SHORTEST_PATH_S * NET_FPS else NAN


def wrist_curvature_1_m(window: Window) -> float:
    smooth = gaussian_filter1d(window.wrists_m, 0.1 * NET_FPS, axis=1)
    return median_of_path(np.concatenate([curvature_1_m(path, ARM_MOVES_M_S) for path in smooth]))


def travel_to_the_side(window: Window) -> float:
    """How much of the travel is to the left and right of the dancer."""
    steps = np.diff(window.ground_m, axis=0)
    heading = np.radians(window.headings_deg[:-1])
    aside = np.abs(steps[:, 0] * np.cos(heading) - steps[:, 2] * np.sin(heading)).sum()
    ahead = np.abs(steps[:, 0] * np.sin(heading) + steps[:, 2] * np.cos(heading)).sum()
    return float(aside / max(aside + ahead, 1e-6))


def turns_one_way(window: Window) -> float:
    """How far the dancer has turned at the end, by all turning: 1 is always to the same side."""
    heading = gaussian_filter1d(window.headings_deg, 0.25 * NET_FPS)
    return float(abs(heading[-1] - heading[0]) / max(np.abs(np.diff(heading)).sum(), 1e-6))


def faces_one_way(window: Window) -> float:
    """The length of the mean of all headings: 1 is always the same one, 0 is all directions alike."""
    return float(abs(np.exp(1j * np.radians(window.headings_deg)).mean()))


# Space.


def hull_m2(points_m: np.ndarray) -> float:
    """The area of the convex hull of points (N, 2), 0 where they are on a line."""
    try:
        return float(ConvexHull(points_m).volume)  # the volume of a hull in a plane is its area
    except QhullError:
        return 0.0


def hull_from_above(window: Window) -> float:
    """The area of the body as seen from above, over that from the front, median."""
    poses = window.facing[:: NET_FPS // 4]
    return float(np.median([hull_m2(pose[:, [0, 2]]) / max(hull_m2(pose[:, :2]), 1e-6) for pose in poses]))


def wrist_levels(window: Window) -> float:
    """How evenly the wrists use five levels: to the pelvis, half the trunk, the neck, the head, and above."""
    pelvis, neck, head = (window.joint(joint)[:, 1] for joint in ("pelvis", "neck", "head"))
    bounds = np.array([pelvis, 0.5 * (pelvis + neck), neck, head])  # (4, T)
    levels = (window.sides("wrist")[..., 1] > bounds[:, None]).sum(axis=0)  # (2, T)
    return entropy(np.bincount(levels.ravel(), minlength=len(bounds) + 1))


def from_mirror_image_m(window: Window) -> float:
    """How far the joints above the pelvis are from where they would be in the mirror image, median."""
    apart = np.linalg.norm(window.facing - mirrored(window.facing), axis=-1)[:, UPPER_BODY]
    return float(np.median(apart.mean(axis=1)))


# Parts of the body together.


def arms_move_together(window: Window) -> float:
    left, right = gaussian_filter1d(window.wrist_speed_m_s, 0.1 * NET_FPS, axis=1)
    return correlation(left, right)


def arms_with_other_legs(window: Window) -> float:
    """How far the left wrist goes to the front with the right ankle, and the right one with the left."""
    left, right = window.wrists_m[..., 2]
    left_leg, right_leg = (window.facing_joint(f"{side}_ankle")[:, 2] for side in ("left", "right"))
    return 0.5 * (correlation(left, right_leg) + correlation(right, left_leg))


def head_over_neck_sway(window: Window) -> float:
    """How much further the head sways from over the pelvis than the neck does."""
    head, neck = (window.facing_joint(joint)[:, [0, 2]].std(axis=0) for joint in ("head", "neck"))
    return float(np.linalg.norm(head) / max(np.linalg.norm(neck), 1e-3))


def heel_lift_m(window: Window) -> float:
    """How far the ankles rise over the balls of the feet: the 95th percentile from the median."""
    over = window.sides("ankle")[..., 1] - window.sides("foot")[..., 1]
    return float((np.percentile(over, 95, axis=1) - np.median(over, axis=1)).mean())


# Of legs and pelvis, also of a robot.
OF_LEGS: dict[str, Callable[[Window], float]] = {
    "ankles to the front together, r": ankles_together,
    "legs shorten together, r": legs_shorten_together,
    "pelvis up and down at its strongest frequency, share": bounce_at_one_frequency,
    "pelvis height as a foot lands, sd": pelvis_at_landings,
    "foot is fastest, share of its swing": fastest_in_swing,
    "legs mirrored later, r": legs_mirrored_later,
    "feet to the side of each other, 5th percentile, m": lambda w: float(
        np.percentile(between_feet_m(w)[:, 0], 5)
    ),
    "path on the floor, curvature, median, 1/m": lambda w: median_of_path(
        curvature_1_m(w.ground_m, TRAVELS_M_S)
    ),
    "travel to the side, share": travel_to_the_side,
    "floor covered, m²": lambda w: hull_m2(w.ground_m[:, [0, 2]]),
    "turning to one side, share": turns_one_way,
    "facing one way": faces_one_way,
}
# Of a body with trunk, head, arms and feet.
OF_BODIES: dict[str, Callable[[Window], float]] = {
    "arms move at the same time, r": arms_move_together,
    "arms to the front with the other legs, r": arms_with_other_legs,
    "trunk to the side with the pelvis, r": lambda w: correlation(
        pelvis_aside_m(w), w.facing_joint("neck")[:, 0]
    ),
    "head sways over neck sways": head_over_neck_sway,
    "arms below 1 Hz, share of power": slow_arms,
    "trunk at the counts, share of power": trunk_on_counts,
    "speed of the body, entropy of its spectrum": lambda w: entropy(spectrum(w.speed_m_s)[1]),
    "hull from above over that from the front, median": hull_from_above,
    "levels of the wrists, entropy": wrist_levels,
    "paths of the wrists, curvature, median, 1/m": wrist_curvature_1_m,
    "heel over its usual height, 95th percentile, m": heel_lift_m,
    "upper body from its mirror image, median, m": from_mirror_image_m,
}
SECOND = MeasureSet("second set, which is still unseen", OF_LEGS, OF_BODIES)
