"""The first set of unseen measures: of speeds, distances, and spreads of single parts of the body.

Its values for the built-in takes are known. See `research.unseen_measures`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.ndimage import gaussian_filter1d

from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.movement import Window, from_mean
from research.unseen_measure_parts import MeasureSet, between_feet_m, landings, pelvis_aside_m

SLOW_M_S = 0.15


def speed_m_s(window: Window, joint: str, of: str = "") -> np.ndarray:
    """Speed of both sides of a joint, or relative to another one, (2, T - 1)."""
    pos = window.sides(joint) - (window.sides(of) if of else 0.0)
    return np.linalg.norm(np.diff(pos, axis=1), axis=-1) * NET_FPS


def pelvis_m(window: Window) -> np.ndarray:
    return gaussian_filter1d(window.joint("pelvis"), 0.05 * NET_FPS, axis=0)


def turned_out_deg(window: Window) -> np.ndarray:
    """How far the feet point outwards from the heading, (2, T)."""
    found = []
    for side, sign in (("left", 1.0), ("right", -1.0)):
        way = window.facing_joint(f"{side}_foot") - window.facing_joint(f"{side}_ankle")
        found.append(sign * np.degrees(np.arctan2(way[:, 0], way[:, 2])))
    return np.array(found)


def intervals_spread(window: Window) -> float:
    """Spread of the times between landings of feet, by their mean."""
    between = np.diff(np.sort(np.concatenate([landings(side) for side in window.contacts.T])))
    between = between[between > 1]
    return float(between.std() / between.mean()) if len(between) > 2 else float("nan")


def shoulders_yaw_deg(window: Window) -> np.ndarray:
    across = window.joint("left_shoulder") - window.joint("right_shoulder")
    yaw = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    return from_mean(yaw)


def wrists_apart_m(window: Window) -> np.ndarray:
    return np.linalg.norm(window.joint("left_wrist") - window.joint("right_wrist"), axis=-1)


def sides_differ(values: np.ndarray) -> float:
    """How far the mean of the left side (2, T) is from that of the right one, as a logarithm of the ratio."""
    left, right = values.mean(axis=1)
    return float(abs(np.log(max(left, 1e-3) / max(right, 1e-3))))


def spread_95(values: np.ndarray) -> float:
    return float(np.percentile(values, 95) / max(float(np.median(values)), 1e-3))


# Of legs and pelvis, also of a robot.
OF_LEGS: dict[str, Callable[[Window], float]] = {
    "pelvis below its highest, median, m": lambda w: float(
        np.percentile(w.joint("pelvis")[:, 1], 95) - np.median(w.joint("pelvis")[:, 1])
    ),
    "acceleration of the pelvis, 95th percentile, m/s²": lambda w: float(
        np.percentile(np.linalg.norm(np.diff(pelvis_m(w), 2, axis=0), axis=-1), 95) * NET_FPS**2
    ),
    "speed of the feet, median, m/s": lambda w: float(np.median(speed_m_s(w, "foot"))),
    "speed of the feet, 95th percentile, m/s": lambda w: float(np.percentile(speed_m_s(w, "foot"), 95)),
    "no foot stands, share": lambda w: float((~w.contacts).all(axis=1).mean()),
    "times between landings, spread": intervals_spread,
    "a foot before the other, sd, m": lambda w: float(between_feet_m(w)[:, 2].std()),
    "a foot beside the other, sd, m": lambda w: float(between_feet_m(w)[:, 0].std()),
    "pelvis aside of the feet, sd, m": lambda w: float(pelvis_aside_m(w).std()),
    "one leg faster than the other": lambda w: sides_differ(speed_m_s(w, "foot")),
    "speed of the knees from the hips, median, m/s": lambda w: float(np.median(speed_m_s(w, "knee", "hip"))),
    "body is slow, share": lambda w: float((w.speed_m_s < SLOW_M_S).mean()),
}
# Of a body with trunk, head, arms and feet.
OF_BODIES: dict[str, Callable[[Window], float]] = {
    "feet turned out, median, °": lambda w: float(np.median(turned_out_deg(w))),
    "feet turned out, sd, °": lambda w: float(turned_out_deg(w).std(axis=1).mean()),
    "shoulder yaw, sd, °": lambda w: float(shoulders_yaw_deg(w).std()),
    "head beside the pelvis, median, m": lambda w: float(
        np.median(np.linalg.norm((w.joint("head") - w.joint("pelvis"))[:, [0, 2]], axis=-1))
    ),
    "head speed over pelvis speed, median": lambda w: float(
        np.median(np.linalg.norm(np.diff(w.joint("head"), axis=0), axis=-1))
        / max(float(np.median(np.linalg.norm(np.diff(w.joint("pelvis"), axis=0), axis=-1))), 1e-4)
    ),
    "wrists apart, median, m": lambda w: float(np.median(wrists_apart_m(w))),
    "wrists apart, sd, m": lambda w: float(wrists_apart_m(w).std()),
    "wrist before the shoulder, median, m": lambda w: float(np.median(w.wrists_m[..., 2])),
    "wrist before the shoulder, sd, m": lambda w: float(w.wrists_m[..., 2].std(axis=1).mean()),
    "speed of the elbows from the shoulders, 95th percentile over median": lambda w: spread_95(
        speed_m_s(w, "elbow", "shoulder")
    ),
    "one arm faster than the other": lambda w: sides_differ(w.wrist_speed_m_s),
    "elbow below the shoulder, median, m": lambda w: float(
        np.median(w.sides("shoulder")[..., 1] - w.sides("elbow")[..., 1])
    ),
}
FIRST = MeasureSet("first set, whose values are known", OF_LEGS, OF_BODIES)
