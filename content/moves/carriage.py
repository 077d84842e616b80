"""How a body carries its weight: what hips, trunk, head and arms do that no step says.

The steps give where the feet are and which of them stands. From these follow, in this order, the hips, the
trunk over them, the head, and the arms. What hangs on a part follows it with delay and swings through, as a
damped spring. All amounts are of a `Carriage`, which is fitted to real dancing by genre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from choreograph.core.numerics import Floats
from content.moves.curves import ease, spring_follow, spring_lag_s
from content.moves.notation import SIDES

_SMOOTH_S = 0.10  # of the path of the weight, before its speed and acceleration are taken
_STRIDE_M = 0.5  # feet this far apart swing hips and arms fully
_HEAD_HZ, _HEAD_DAMPING = 1.6, 0.65
_ARM_HZ, _ARM_DAMPING = 1.8, 0.45
_TRUNK_HZ, _TRUNK_DAMPING = 2.2, 0.6
_SWAY_HZ = 1.3  # of the shoulders after the hips
_POINT_VARIES = 0.4  # how far toes point down in the air, relative
_CHEST_TURNS = 1.2  # by this share of a turn of the hips
_LOOK_S, _LEAN_S = 0.55, 0.9  # time in which a look and a lean of the trunk go to their next place


@dataclass(frozen=True)
class Toes:
    """What the toes of a foot do in one step besides what is written."""

    turn_deg: float  # they point further to the left as it lands
    sweep_deg: float  # and on the way there
    point_deg: float  # how far they point down on a long way


@dataclass(frozen=True)
class Carriage:
    """Amounts of what a body does by itself. Zero is none. Angles are in degrees."""

    reach: float = 0.99  # of a leg's length: how straight a leg gets
    to_go: float = 0.25  # share of its way that the body has left as a foot lands, per count it may take
    through: float = 0.4  # share of its mean speed at which it passes through the counts
    stoop_m: float = 0.015  # the pelvis below its height on straight legs
    sinks_m: float = 0.012  # it sinks by this here and there in the course of a phrase, spread
    give_m: float = 0.02  # it sinks by this as a foot takes the weight, and comes up again
    toes_vary: float = 12.0  # where the toes of a foot point as it lands, spread
    toes_sweep: float = 25.0  # and on the way there
    toes_point: float = 43.0  # how far they point down on a long way
    hip_up: float = 3.0  # the hip over the standing leg, degrees
    hip_out_m: float = 0.01  # to the side of the standing leg
    hip_with_feet: float = 14.0  # the hips turn with a stride of half a metre
    turned: float = 5.0  # hips and chest turn to one side or the other in the course of a phrase, spread
    chest_against: float = 0.5  # share of that turn that the chest makes the other way
    shoulders_against: float = 0.2  # share of the tilt of the hips that the shoulders make the other way
    lean: float = 0.0  # the trunk leans forward
    lean_into: float = 2.0  # into the way it goes, degrees per m/s
    left_behind: float = 1.2  # by the trunk as the pelvis speeds up, degrees per m/s²
    posture: float = 3.8  # the trunk leans here and there in the course of a phrase, spread
    sway: float = 1.2  # of the trunk away from the standing leg
    head_still: float = 0.5  # share of the trunk's lean that the head takes back
    head_back: float = 0.0  # the head is held back, degrees
    head_drag: float = 1.5  # of the head against the speeding up of the trunk, degrees per m/s²
    looks: float = 6.0  # up, down and to the sides, spread
    arms_back: float = 0.0  # upper arms are farther back than written, degrees
    arms_open: float = 0.0  # arms are turned outwards about the vertical through the shoulder
    arm_swing: float = 14.0  # arms against the legs in a stride of half a metre
    arm_drag_s: float = 0.05  # arms stay behind as the chest turns, seconds of its turning
    arm_throw: float = 2.0  # arms stay behind as the body speeds up, degrees per m/s²
    arm_play: float = 5.0  # small movements that never repeat, spread

    def toes(self, rng: np.random.Generator | None) -> Toes:
        """The toes in the next step. Without `rng`, as written."""
        if rng is None:
            return Toes(0.0, 0.0, self.toes_point)
        turn, sweep, point = rng.standard_normal(3).clip(-2.0, 2.0)
        return Toes(
            self.toes_vary * turn, self.toes_sweep * sweep, self.toes_point * (1.0 + _POINT_VARIES * point)
        )


@dataclass(frozen=True)
class Support:
    """What carries the body, in the frame of its facing. Metres, m/s and m/s²."""

    load: Floats  # (T,) from -1, the right foot carries all, to 1, the left foot
    stride_m: Floats  # (T,) the left foot in front of the right one
    velocity: Floats  # (T, 2) to the left and forward
    acceleration: Floats  # (T, 2)
    turning: Floats  # (T,) rad/s of the facing


def support_of(load: Floats, feet_m: Floats, spot_m: Floats, facing: Floats, fps: float) -> Support:
    """The support of a load (T,), balls (2, T, 3), a path on the floor (T, 2) and a facing (T,)."""
    smooth = gaussian_filter1d(spot_m, _SMOOTH_S * fps, axis=0, mode="nearest")
    velocity = np.gradient(smooth, axis=0) * fps
    cos, sin = np.cos(facing), np.sin(facing)

    def facing_frame(vector: Floats) -> Floats:
        return np.stack(
            [cos * vector[:, 0] - sin * vector[:, 1], sin * vector[:, 0] + cos * vector[:, 1]], -1
        )

    apart = (feet_m[0] - feet_m[1])[:, [0, 2]]
    turning = np.gradient(gaussian_filter1d(facing, _SMOOTH_S * fps, mode="nearest")) * fps
    return Support(
        2.0 * load - 1.0,
        gaussian_filter1d(facing_frame(apart)[:, 1], 0.05 * fps, mode="nearest"),
        facing_frame(velocity),
        facing_frame(np.gradient(velocity, axis=0) * fps),
        turning,
    )


def carry(
    ch: dict[str, Floats],
    support: Support,
    carriage: Carriage,
    counts: Floats,
    fps: float,
    rng: np.random.Generator | None,
) -> None:
    """Add to the channels of `body` what follows from the support, with the count (T,) of each frame.

    Without `rng`, nothing is random.
    """
    stride = np.tanh(support.stride_m / _STRIDE_M)
    deg = np.pi / 180.0
    up = carriage.hip_up * deg * support.load
    hips = -carriage.hip_with_feet * deg * stride
    ch["hip_roll"] = ch["hip_roll"] + up
    ch["hip_side"] = ch["hip_side"] + carriage.hip_out_m * support.load
    ch["hip_turn"] = ch["hip_turn"] + hips
    ch["drop"] = ch["drop"] + carriage.give_m * _arrivals(support.load, fps)
    ch["twist"] = ch["twist"] - carriage.chest_against * hips
    pitch = carriage.lean_into * support.velocity[:, 1] - carriage.left_behind * support.acceleration[:, 1]
    roll = carriage.lean_into * support.velocity[:, 0] - carriage.left_behind * support.acceleration[:, 0]
    pitch, roll = (_followed(deg * values, fps, _TRUNK_HZ, _TRUNK_DAMPING) for values in (pitch, roll))
    over_foot = carriage.sway * deg * support.load + carriage.shoulders_against * up
    roll = roll + _late(over_foot, fps, _SWAY_HZ, _TRUNK_DAMPING)
    ch["sinks"] = np.zeros(len(counts))
    if rng is not None:
        pitch = pitch + carriage.posture * deg * _looks(counts, fps, rng, _LEAN_S)
        roll = roll + 1.2 * carriage.posture * deg * _looks(counts, fps, rng, _LEAN_S)
        turned = carriage.turned * deg * _looks(counts, fps, rng, _LEAN_S)
        ch["hip_turn"] = ch["hip_turn"] + turned
        ch["twist"] = ch["twist"] + _CHEST_TURNS * turned
        ch["sinks"] = carriage.sinks_m * np.abs(_looks(counts, fps, rng, _LEAN_S))
    ch["bend"] = ch["bend"] + carriage.lean * deg + pitch
    ch["side"] = ch["side"] + roll
    _carry_head(ch, support, carriage, counts, fps, rng)
    _carry_arms(ch, support, stride, carriage, fps, rng)


def _carry_head(
    ch: dict[str, Floats], support: Support, carriage: Carriage, counts: Floats, fps: float,
    rng: np.random.Generator | None,
) -> None:  # fmt: skip
    """The head takes back a part of the trunk's lean, later than the trunk, and looks about."""
    deg = np.pi / 180.0
    nod = -carriage.head_still * ch["bend"] - carriage.head_drag * deg * support.acceleration[:, 1]
    tilt = -carriage.head_still * ch["side"] - carriage.head_drag * deg * support.acceleration[:, 0]
    ch["nod"] = ch["nod"] - carriage.head_back * deg + _late(nod, fps, _HEAD_HZ, _HEAD_DAMPING)
    ch["tilt"] = ch["tilt"] + _late(tilt, fps, _HEAD_HZ, _HEAD_DAMPING)
    if rng is not None and carriage.looks:
        for name, share in (("look", 1.6), ("nod", 1.0), ("tilt", 0.8)):
            ch[name] = ch[name] + share * carriage.looks * deg * _looks(counts, fps, rng, _LOOK_S)


def _carry_arms(
    ch: dict[str, Floats],
    support: Support,
    stride: Floats,
    carriage: Carriage,
    fps: float,
    rng: np.random.Generator | None,
) -> None:
    """Arms swing against the legs, stay behind the chest and the body, and are never quite still."""
    deg = np.pi / 180.0
    chest = np.gradient(gaussian_filter1d(ch["twist"], 0.05 * fps, mode="nearest")) * fps + support.turning
    drag = _late(-carriage.arm_drag_s * chest, fps, _ARM_HZ, _ARM_DAMPING)
    back = _late(carriage.arm_throw * deg * support.acceleration[:, 1], fps, _ARM_HZ, _ARM_DAMPING)
    aside = _late(-carriage.arm_throw * deg * support.acceleration[:, 0], fps, _ARM_HZ, _ARM_DAMPING)
    swing = carriage.arm_swing * deg * stride
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        arm = ch[f"{side}_arm"].copy()
        arm[:, 0] += back + sign * swing + carriage.arms_back * deg
        arm[:, 1] += sign * drag
        arm[:, 2] += sign * aside
        arm[:, 3] += 0.8 * np.maximum(-back - sign * swing, -0.3)  # an arm that goes forward bends
        if rng is not None:
            play = np.stack([_play(len(stride), fps, rng) for _ in range(arm.shape[1])], axis=-1)
            arm += carriage.arm_play * deg * play * np.array([1.0, 1.0, 0.6, 1.2, 2.0, 1.5])
        ch[f"{side}_arm"] = arm


def _arrivals(load: Floats, fps: float) -> Floats:
    """From 0 to 1: how fast the weight moves from one foot to the other, a little late."""
    speed = np.abs(np.gradient(load)) * fps
    return _late(np.minimum(speed / 4.0, 1.0), fps, 2.5, 0.7)


def _followed(values: Floats, fps: float, hz: float, damping: float) -> Floats:
    """`values` (T,) followed by a spring, without its delay."""
    ahead = round(spring_lag_s(hz, damping) * fps)
    early = np.append(values[ahead:], np.full(ahead, values[-1]))
    return spring_follow(early[:, None], fps, frequency_hz=hz, damping=damping)[:, 0]


def _late(values: Floats, fps: float, hz: float, damping: float) -> Floats:
    """`values` (T,) followed by a spring, with its delay."""
    return spring_follow(values[:, None], fps, frequency_hz=hz, damping=damping)[:, 0]


def _looks(counts: Floats, fps: float, rng: np.random.Generator, way_s: float) -> Floats:
    """Places that a look or a lean rests at, and ways between them, of spread 1, (T,).

    A way takes about `way_s` and goes from count to count, so that the body is quiet on each of them.
    """
    per_s = float(counts[-1] - counts[0]) / (len(counts) - 1) * fps
    steps = max(1, round(way_s * per_s))
    rests_s = rng.uniform(0.8, 3.2, int((len(counts) / fps) / 0.8) + 2)
    starts = np.floor(counts[0]) + np.cumsum(np.maximum(np.round(rests_s * per_s), steps)) - steps
    places = np.append(0.0, rng.standard_normal(len(starts)).clip(-2.0, 2.0))
    after = counts[:, None] - starts
    way = sum(ease(after - step) for step in range(steps)) / steps
    return places[0] + way @ np.diff(places)


def _play(n: int, fps: float, rng: np.random.Generator) -> Floats:
    """Noise of spread 1 and periods about 0.7 to 3 s, (n,)."""
    noise = gaussian_filter1d(rng.standard_normal(n + round(6 * fps)), 0.22 * fps)[round(3 * fps) :][:n]
    return noise / (0.5 / np.sqrt(0.22 * fps * np.sqrt(np.pi)) * np.sqrt(2.0))
