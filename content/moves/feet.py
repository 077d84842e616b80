"""Foot trajectories: a foot is exactly still while planted and moves in smooth arcs in between.

A foot stands on its ball, the joint at the root of the toes: before a step the heel rises about it, and
pivots turn about it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from choreograph.motion.skeleton import canonical_skeleton
from content.moves.curves import Tempo, ease
from content.moves.keyframes import FootPlant

_SKELETON = canonical_skeleton()
BALL_FROM_ANKLE_M = _SKELETON.offsets_m[_SKELETON.index("left_foot")]  # (3,)
BALL_OVER_FLOOR_M = float(_SKELETON.rest_pos_m()[_SKELETON.index("left_foot")][1])
_TOES_M = float(_SKELETON.tips_m[0][2])  # from the ball to the tip
_HEEL_FROM_BALL_M = np.array([0.0, -BALL_OVER_FLOOR_M, -BALL_FROM_ANKLE_M[2] - 0.045])

_SHORTEST_S, _LONGEST_S = 0.14, 1.00  # a step's time in the air, at any tempo
_UP_FIRST, _DOWN_LAST = 0.06, 0.04  # of a swing: vertical at its start and end
_HEEL_OFF_S = 0.24  # the heel starts to rise this long before the ball leaves
_HEEL_OFF_RAD = np.radians(30.0)  # for a step of _FAR_M or more
_POINTS = 0.36  # share of a swing at which its toes point down most
_FAR_M = 0.40
_ROLL_FROM_RAD = np.radians(10.0)  # where the heel rises higher, the foot rolls over its toes
_ROLL_RAD, _ROLL_S = np.radians(24.0), 0.12  # at most by this angle, in this time before the toes leave
_AMPLE_S = 0.45  # in a shorter swing a foot rolls and points less
_ROLL_ENDS = 0.5  # of a swing: by then the ball is where it goes
_DROOP = 0.5  # by this share of the pitch of a foot in the air its toes hang down
_HEEL_DOWN = 0.9  # of a swing: by then the foot is as it lands
_STRIKE_RAD = np.radians(-15.0)  # toes up as the heel lands, after a step forward of _FAR_M or more
_TOES_FIRST_RAD = np.radians(20.0)  # heel up as the toes land, after a step back of _FAR_M or more
_STRIKE_S = 0.2  # until the foot is flat
_PIVOT_RAD = np.radians(5.0)  # the heel is slightly raised while the foot turns on its ball


@dataclass(frozen=True)
class FootPath:
    """One foot over a take."""

    ball_m: Floats  # (T, 3)
    yaw_rad: Floats  # (T,) unwrapped
    pitch_rad: Floats  # (T,) heel up about the ball
    toe_pitch_rad: Floats  # (T,) of the toes in the world
    planted: NDArray[np.bool_]  # (T,) the ball is on the floor and does not move
    flat: NDArray[np.bool_]  # (T,) ball and heel are

    def foot_quat(self) -> Floats:
        """World rotations (T, 4) of the ankle."""
        return _turned(self.yaw_rad, self.pitch_rad)

    def toe_quat(self) -> Floats:
        """World rotations (T, 4) of the toes."""
        return _turned(self.yaw_rad, self.toe_pitch_rad)

    def ankle_m(self) -> Floats:
        """World positions (T, 3) of the ankle."""
        return self.ball_m - rot.rotate(self.foot_quat(), BALL_FROM_ANKLE_M)

    def over_floor_m(self) -> Floats:
        """Height (T,) of the lowest of ball, heel and tip of the toes over the floor."""
        ball = self.ball_m[:, 1]
        toes = ball - BALL_OVER_FLOOR_M - _TOES_M * np.sin(np.maximum(self.toe_pitch_rad, 0.0))
        return np.minimum(toes, ball + _heel_over_ball_m(self.pitch_rad))


def _heel_over_ball_m(pitch: Floats) -> Floats:
    return _HEEL_FROM_BALL_M[1] * np.cos(pitch) - _HEEL_FROM_BALL_M[2] * np.sin(pitch)


def _turned(yaw: Floats, pitch: Floats) -> Floats:
    zero = np.zeros_like(pitch)
    return rot.multiply(rot.about_y(yaw), rot.from_rotvec(np.stack([pitch, zero, zero], axis=-1)))


def foot_path(plants: Sequence[FootPlant], tempo: Tempo, times_s: Floats) -> FootPath:
    """The path of one foot through its plants."""
    n = len(times_s)
    xz = np.tile(plants[0].ball_m, (n, 1)).astype(np.float64)  # (T, 2)
    height, yaw, pitch = np.zeros(n), np.full(n, plants[0].yaw_rad), np.full(n, plants[0].pitch_rad)
    planted, in_air, rolled = np.ones(n, bool), np.zeros(n), np.zeros(n)
    for here, there in itertools.pairwise(plants):
        landed, land = float(tempo.times_s(here.count)), float(tempo.times_s(there.count))
        leave = _leaves_at(here, there, tempo)
        u = (times_s - leave) / (land - leave)
        after, flying = times_s >= land, (u > 0) & (u < 1)
        s = _glide((u - _UP_FIRST) / (1.0 - _UP_FIRST - _DOWN_LAST))[flying]
        over = _arc(u)[flying]
        a, b = np.array(here.ball_m), np.array(there.ball_m)
        heel_off = 0.0 if there.in_place else _heel_off(here, float(np.linalg.norm(b - a)))
        rising = (times_s > landed) & (u <= 0)
        room = max(min(_HEEL_OFF_S, leave - landed), 1e-3)
        ample = min(1.0, (land - leave) / _AMPLE_S) ** 2
        if heel_off:
            pitch[rising] += (heel_off - pitch[rising]) * ease((times_s - leave + room) / room)[rising]
            roll = ample * float(np.clip((leave - landed) / _ROLL_S - 2.0, 0.0, 1.0)) * _roll(heel_off)
            rolled[rising] = roll * ease((times_s - leave + _ROLL_S) / _ROLL_S)[rising]
            rolled[flying] = roll * (1.0 - ease(u / _ROLL_ENDS)[flying])
        start_pitch = heel_off if heel_off else here.pitch_rad
        xz[flying] = a + (b - a) * s[:, None] + (4.0 * s * (1.0 - s))[:, None] * np.array(there.bow_m)
        height[flying] = here.height_m + (there.height_m - here.height_m) * s + there.lift_m * over
        yaw[flying] = here.yaw_rad + (there.yaw_rad - here.yaw_rad) * s
        if not there.in_place:
            yaw[flying] += ample * there.sweep_rad * _bump(u[flying])
        turns = there.in_place and abs(there.yaw_rad - here.yaw_rad) > 1e-6
        strike = _strike(here, there)
        if there.in_place:
            pitch[flying] += (there.pitch_rad - here.pitch_rad) * s
        else:
            down = _glide(u / _HEEL_DOWN)[flying] if heel_off else s
            pitch[flying] = start_pitch + (there.pitch_rad + strike - start_pitch) * down
            pitch[flying] += ample * there.point_rad * heel_off / _HEEL_OFF_RAD * _bump(u[flying])
        pitch[flying] += over * _PIVOT_RAD * turns
        in_air[flying] = over * (not there.in_place)
        planted[flying] = there.in_place
        xz[after], height[after], yaw[after] = b, there.height_m, there.yaw_rad
        pitch[after] = there.pitch_rad + strike * (1.0 - ease((times_s[after] - land) / _STRIKE_S))
        planted[after] = there.height_m == 0.0
    return _settled(xz, height, yaw, pitch, in_air, planted, rolled)


def _roll(heel_off: float) -> float:
    """Angle of the toes from the floor as the ball leaves with the heel at `heel_off`."""
    return _ROLL_RAD * float(ease(np.array((heel_off - _ROLL_FROM_RAD) / (_HEEL_OFF_RAD - _ROLL_FROM_RAD))))


def _bump(u: Floats) -> Floats:
    """From 0 to 1 and back over u in [0, 1] of a swing: what a foot in the air does by itself."""
    return ease(u / _POINTS) * (1.0 - ease((u - _POINTS) / (_HEEL_DOWN - _POINTS)))


def _glide(u: Floats) -> Floats:
    """Progress from 0 to 1 over u in [0, 1]: at rest at both ends, quicker off and down than `ease`."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


def _strike(here: FootPlant, there: FootPlant) -> float:
    """Angle of the foot as it lands on a flat step: toes up after one forward, heel up after others."""
    if there.in_place or there.height_m > 0.0 or there.pitch_rad != 0.0:
        return 0.0
    way = np.array(there.ball_m) - here.ball_m
    forward = float(way @ (np.sin(there.yaw_rad), np.cos(there.yaw_rad)))
    if forward > 0.0:
        return _STRIKE_RAD * float(np.clip((forward - 0.15) / _FAR_M, 0.0, 1.0))
    return _TOES_FIRST_RAD * float(np.clip((-forward - 0.1) / _FAR_M, 0.0, 1.0))


def _arc(u: Floats) -> Floats:
    """Height profile of a swing: 0 at its start and end, 1 in the middle, with quick flanks."""
    return ease(u / 0.45) * ease((1.0 - u) / 0.45)


def _leaves_at(here: FootPlant, there: FootPlant, tempo: Tempo) -> float:
    """When the foot leaves one plant for the next, in seconds."""
    landed, land = float(tempo.times_s(here.count)), float(tempo.times_s(there.count))
    if here.height_m > 0.0:  # from a kick it comes down at once
        return max(landed, land - 1.2 * _LONGEST_S)
    swing = land - float(tempo.times_s(there.count - there.swing))
    return max(land - float(np.clip(swing, _SHORTEST_S, _LONGEST_S)), landed + 0.02)


def _heel_off(here: FootPlant, distance_m: float) -> float:
    """Angle of the heel as the ball leaves, growing with the distance. 0 after a kick or a heel touch."""
    if here.height_m > 0.0 or here.pitch_rad < 0.0:
        return 0.0
    return max(here.pitch_rad, _HEEL_OFF_RAD * min(1.0, 0.3 + distance_m / _FAR_M))


def _settled(
    xz: Floats, height: Floats, yaw: Floats, pitch: Floats, in_air: Floats, planted: NDArray[np.bool_],
    rolled: Floats,
) -> FootPath:  # fmt: skip
    """The path with heel and toes kept above the floor: toes up rests on the heel, heel up on the toes.

    Toes that are `rolled` (T,) from the floor carry the ball up and forward about their tips.
    """
    toes_up = np.minimum(pitch, 0.0)
    over_floor = np.maximum(BALL_OVER_FLOOR_M, -_heel_over_ball_m(toes_up) * (toes_up < 0))
    ahead = _TOES_M * (1.0 - np.cos(rolled))
    up = over_floor + height + _TOES_M * np.sin(rolled)
    ball = np.stack([xz[:, 0] + ahead * np.sin(yaw), up, xz[:, 1] + ahead * np.cos(yaw)], axis=-1)  # (T, 3)
    droop = rolled + _DROOP * np.maximum(pitch, 0.0) * _glide((height - 0.02) / 0.10)
    still = planted & (pitch >= 0.0) & (rolled < 1e-9)
    return FootPath(ball, yaw, pitch, toes_up + droop, still, still & (np.abs(pitch) < 1e-9) & (in_air == 0))
