"""Moves placed one after another become one score: what each foot and each channel does, on counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.motion import rotations as rot
from choreograph.synthesis.moves.language import ARM_CHANNELS, CHANNELS, SIDES, Move, Side, Step
from choreograph.synthesis.moves.poses import ARMS
from choreograph.synthesis.moves.tracks import Key

Floats = NDArray[np.float64]
Arrival = tuple[float, tuple[float, ...]]  # a count, and where something is from then on

HOME_SIDE_M = 0.10  # a foot's ball at home: to the side of the middle
HOME_FWD_M = 0.09  # and in front of it
TOE_OUT_DEG = 10.0
_BEHIND_BALL_M = -0.065  # and so far behind it, over the arch
_INSIDE_FOOT_M = 0.045  # standing on one foot the pelvis is so far inside its ball's line
_ARRIVES = 0.9  # counts after a foot's landing, at most, the body has arrived over it
_QUICK = 0.49  # counts: a foot that carries it for less does not get it over itself, as a swung "and"
_THROUGH = 0.4  # of its mean speed it has on the counts
_BODY_TO_GO, _TURN_TO_GO = 0.25, 0.08  # of its way, for each of those counts, is left as the foot lands


@dataclass(frozen=True)
class Placed:
    """A move at its place in a take: where, when, how big."""

    move: Move
    mirrored: bool  # whether `move` is the mirror image of the genre's
    start: int  # take's count (beat index) that is the move's count 1
    origin_m: tuple[float, float]  # (x, z) of its home
    yaw_rad: float
    size: float = 1.0
    sharpness: float = 0.4
    bounce: float = 1.0
    looseness: float = 0.05  # how much a pose differs each time: of its size, and radians of the arms

    def end(self) -> tuple[tuple[float, float], float]:
        """Origin and heading of the home it ends at."""
        left, fwd, turn = self.move.travel
        return self.to_world((left, fwd)), self.yaw_rad + np.radians(turn)

    def to_world(self, at: tuple[float, float]) -> tuple[float, float]:
        """World (x, z) of a place in its home frame, steps as big as its size makes them."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, z = self.size * at[0], self.size * at[1]
        return self.origin_m[0] + cos * x + sin * z, self.origin_m[1] - sin * x + cos * z


@dataclass(frozen=True)
class Plant:
    """Where a foot comes down, in the world."""

    count: float
    ball_m: tuple[float, float]  # (x, z)
    yaw_rad: float
    pitch_rad: float
    height_m: float
    swing: float
    lift_m: float
    bow_m: tuple[float, float]
    in_place: bool  # it turns about its ball or takes weight; it does not lift


@dataclass(frozen=True)
class Load:
    """From this count on the left foot carries `on_left` of the weight, the right one the rest."""

    count: float
    on_left: float
    spot_m: tuple[float, float]  # (x, z) where the body is over that


@dataclass(frozen=True)
class Score:
    """Everything a take does, on its counts; all keys in order of count."""

    plants: dict[Side, list[Plant]]
    ground: list[Key]  # (x, z) the body is over, m
    facing: list[Key]  # rad, unwrapped
    channels: dict[str, list[Key]]  # CHANNELS in degrees and metres, ARM_CHANNELS as `Arm.coordinates`
    bob: list[Key]  # m below standing


def home_plant(side: Side, count: float, origin_m: tuple[float, float], yaw_rad: float) -> Plant:
    """A foot standing at home."""
    x, z, yaw = _foot_place(side, origin_m, yaw_rad, TOE_OUT_DEG)
    return Plant(count, (x, z), yaw, 0.0, 0.0, 0.5, 0.0, (0.0, 0.0), True)


def _foot_place(
    side: Side, origin_m: tuple[float, float], yaw_rad: float, toe_out_deg: float
) -> tuple[float, float, float]:
    sign = 1.0 if side == "left" else -1.0
    spot = rot.rotate(rot.about_y(yaw_rad), np.array([sign * HOME_SIDE_M, 0.0, HOME_FWD_M]))
    return origin_m[0] + spot[0], origin_m[1] + spot[2], yaw_rad + sign * np.radians(toe_out_deg)


def compose(placed: Sequence[Placed], rng: np.random.Generator | None) -> Score:
    """The score of moves in order, each starting where and when the one before ended.

    With `rng` no pose is ever quite the same twice; without, all are as written.
    """
    first = placed[0]
    begin = first.start - 1.0
    plants = {side: [home_plant(side, begin, first.origin_m, first.yaw_rad)] for side in SIDES}
    free = first.move.first_foot
    facing: list[Arrival] = [(begin, (first.yaw_rad,))]
    loads = [_load(begin, {None: 0.5, "left": 0.0, "right": 1.0}[free], plants, first.yaw_rad)]
    channels: dict[str, list[Key]] = {name: [Key(begin, (0.0,))] for name in CHANNELS}
    for name in ARM_CHANNELS:
        channels[name] = [Key(begin, ARMS["relaxed"].coordinates())]
    bob = [Key(begin, (0.0,))]
    for p in placed:
        for s in sorted(p.move.steps, key=lambda s: s.count):
            _add_step(p, s, plants, loads, facing)
        _add_poses(p, channels, rng)
        bob += _bounces(p)
    return Score(
        plants,
        _arriving([(load.count, load.spot_m) for load in loads], to_go=_BODY_TO_GO),
        _arriving(facing, to_go=_TURN_TO_GO),
        channels,
        sorted(bob, key=lambda key: key.count),
    )


def _add_step(
    p: Placed, s: Step, plants: dict[Side, list[Plant]], loads: list[Load], facing: list[Arrival]
) -> None:
    count = p.start + s.count - 1.0
    standing = plants[s.foot][-1]
    yaw = facing[-1][1][0] if s.face is None else p.yaw_rad + np.radians(s.face)
    x, z, foot_yaw = _foot_place(s.foot, p.to_world(s.at), yaw, s.toe_out)
    ball = standing.ball_m if s.in_place else (x, z)
    foot_yaw = standing.yaw_rad if s.face is None else foot_yaw
    turn = rot.rotate(rot.about_y(p.yaw_rad), np.array([s.bow[0], 0.0, s.bow[1]]))
    lift = s.lift * (0.6 + 0.4 * p.size)
    # It leaves no earlier than the other foot has landed to take the weight over.
    swing = min(s.swing, count - loads[-1].count)
    on_other = 1.0 if s.foot == "right" else 0.0
    if not s.in_place and abs(loads[-1].on_left - on_other) > 1e-9:  # from both feet: first off this one
        swing = min(swing, 0.6 * (count - loads[-1].count))
        loads.append(_load(count - swing, on_other, plants, facing[-1][1][0]))
    plants[s.foot].append(
        Plant(
            count, ball, foot_yaw, np.radians(s.pitch), s.height * p.size, swing, lift,
            (turn[0], turn[2]), s.in_place,
        )
    )  # fmt: skip
    if s.weight is None:
        return
    facing.append((count, (yaw,)))
    on_left = s.weight if s.foot == "left" else 1.0 - s.weight
    loads.append(_load(count, on_left, plants, facing[-1][1][0]))


def _load(count: float, on_left: float, plants: dict[Side, list[Plant]], facing_rad: float) -> Load:
    """The load with the body where it stands over the feet as they are planted last."""
    spot = np.zeros(2)
    for side, sign, share in zip(SIDES, (1.0, -1.0), (on_left, 1.0 - on_left), strict=True):
        foot = plants[side][-1]
        behind = rot.rotate(rot.about_y(foot.yaw_rad), np.array([0.0, 0.0, _BEHIND_BALL_M]))
        inside = rot.rotate(rot.about_y(facing_rad), np.array([-sign * _INSIDE_FOOT_M, 0.0, 0.0]))
        spot += share * (np.array(foot.ball_m) + (behind + inside)[[0, 2]])
    return Load(count, on_left, (spot[0], spot[1]))


def _arriving(arrivals: Sequence[Arrival], *, to_go: float) -> list[Key]:
    """The body sets off a count before a foot lands, is nearly there on the count, then arrives.

    Through steps that follow one another it flows on, slowest on the counts, and is not taken to and fro
    by the quickest. `to_go` of its way is left on a count, for each count it may take afterwards.
    """
    keys = [Key(*arrivals[0])]
    for i, (count, value) in enumerate(arrivals[1:], start=1):
        following = arrivals[i + 1][0] if i + 1 < len(arrivals) else np.inf
        before, here = np.array(arrivals[i - 1][1]), np.array(value)
        if following < count + _QUICK:
            here = before + ((following - count) / _QUICK) ** 2 * (here - before)
        if keys[-1].count < count - 1.1:
            keys.append(Key(count - 1.0, arrivals[i - 1][1]))
        late = min(_ARRIVES, 0.45 * (following - count))
        mostly = tuple(here - to_go * late * (here - before))
        if following <= count + 1.1:
            keys.append(Key(count, mostly, flow=_THROUGH))
        else:  # at half the speed, on the count, that it arrives with
            keys += [Key(count, mostly, flow=0.5 * to_go * (1.0 + late)), Key(count + late, value)]
    return keys


def _add_poses(p: Placed, channels: dict[str, list[Key]], rng: np.random.Generator | None) -> None:
    """Keys of the move's poses; channels it never names are neutral over its length."""
    hold = 0.4 * p.sharpness
    written = set()

    def loose(n: int) -> Floats:
        return np.zeros(n) if rng is None else p.looseness * rng.standard_normal(n)

    for count, pose in sorted(p.move.poses.items()):
        at = p.start + count - 1.0
        for name, value in pose.values.items():
            scale = p.size * (1.0 + loose(1)[0])
            channels[name].append(Key(at, (scale * value,), pose.flow, hold))
            written.add(name)
        for side, arm in pose.arms.items():
            relaxed = np.array(ARMS["relaxed"].coordinates())
            reach = min(0.55 + 0.45 * p.size, 1.1)
            value = relaxed + reach * (np.array(arm.coordinates()) - relaxed)
            value = value + loose(6)
            channels[f"{side}_arm"].append(Key(at, tuple(value), pose.flow, hold))
            written.add(f"{side}_arm")
    for name, keys in channels.items():
        if name not in written:
            neutral = ARMS["relaxed"].coordinates() if name in ARM_CHANNELS else (0.0,)
            keys += [Key(p.start + c - 1.0, neutral) for c in (min(2, p.move.counts), p.move.counts)]


def _bounces(p: Placed) -> list[Key]:
    bounce = p.move.bounce
    depth = bounce.depth_m * p.bounce * (0.5 + 0.5 * p.size)
    on, off = (depth, 0.0) if bounce.on == "down" else (0.0, depth)
    keys = []
    for count in np.arange(bounce.start, p.move.counts + 1e-6, bounce.every):
        at = p.start + count - 1.0
        keys += [Key(at - 0.5 * bounce.every, (off,)), Key(at, (on,))]
    return keys
