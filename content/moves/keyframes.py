"""A sequence of placed moves as keyframes on counts: foot plants, weight shifts and channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from choreograph.core.numerics import Floats
from choreograph.motion import rotations as rot
from content.moves.arm_poses import ARMS
from content.moves.carriage import Carriage, Toes
from content.moves.curves import Keyframe
from content.moves.notation import ARM_CHANNELS, CHANNELS, SIDES, Move, Side, Step

Arrival = tuple[float, tuple[float, ...]]  # a count, and the value from then on

HOME_SIDE_M = 0.10  # a foot's ball at home: to the side of the middle
HOME_FWD_M = 0.09  # and in front of it
TOE_OUT_DEG = 10.0
_BEHIND_BALL_M = -0.065  # the body is this far behind it, over the arch
_INSIDE_FOOT_M = 0.045  # standing on one foot, the pelvis is this far inside its ball
_ARRIVES = 0.9  # at most these counts after a foot's landing the body is over it
_SLOW = 1.9  # counts: a body with that much time arrives over its foot on the count after it
_HELD, _HELD_TO_GO = 2.9, 0.4  # with that much time, this share of its way is left there for one count more
_COMES_BACK = 0.45  # share of its way that a body leaves out of a held step that it comes back from
_QUICK = (
    0.49  # counts: a foot that carries the body for less does not get it over itself, as on a swung "and"
)
_TURNS_THROUGH = 0.4  # a turn on the counts, at this share of its mean speed
_WIDEST_M = 0.80  # from one ball to the other
_WAITS = 0.5  # counts that a free foot stays behind before it follows
_CLEAR_M, _WIDEST_BOW_M = 0.17, 0.30  # from one ball to the other as a foot passes
_LOAD_TO_GO = 0.3  # share of the weight that moves to a foot after it lands
_TURN_TO_GO = 0.08  # share of a turn left on landing, per count of late arrival


@dataclass(frozen=True)
class PlacedMove:
    """A move in a take: when, where and how it is danced."""

    move: Move
    mirrored: bool  # whether `move` is the mirror image of the genre's move
    start: int  # the take's count (beat index) on which the move has its count 1
    origin_m: tuple[float, float]  # (x, z) of its home
    yaw_rad: float
    size: float = 1.0
    sharpness: float = 0.4
    bounce: float = 1.0
    looseness: float = 0.05  # random variation of a pose: relative to its size, and in radians for arms

    def end(self) -> tuple[tuple[float, float], float]:
        """Origin and heading of the home at its end."""
        left, fwd, turn = self.move.travel
        return self.to_world((left, fwd)), self.yaw_rad + np.radians(turn)

    def to_world(self, at: tuple[float, float]) -> tuple[float, float]:
        """World (x, z) of a position in its home frame, scaled by its size."""
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        x, z = self.size * at[0], self.size * at[1]
        return self.origin_m[0] + cos * x + sin * z, self.origin_m[1] - sin * x + cos * z


@dataclass(frozen=True)
class FootPlant:
    """A foot plant: where and when a foot lands, in the world."""

    count: float
    ball_m: tuple[float, float]  # (x, z)
    yaw_rad: float
    pitch_rad: float
    height_m: float
    swing: float
    lift_m: float
    bow_m: tuple[float, float]
    in_place: bool  # it turns about its ball or takes weight, without lifting
    sweep_rad: float = 0.0  # the toes turn to the left by this on the way, and back
    point_rad: float = 0.0  # how far they point down on a long way


@dataclass(frozen=True)
class WeightShift:
    """From this count on, the left foot carries `on_left` of the weight, the right foot the rest."""

    count: float
    on_left: float
    spot_m: tuple[float, float]  # (x, z) of the body over that support


@dataclass(frozen=True)
class MoveKeyframes:
    """All keyframes of a take, in order of count."""

    plants: dict[Side, list[FootPlant]]
    ground: list[Keyframe]  # (x, z) under the body, m
    load: list[Keyframe]  # share of the weight on the left foot
    facing: list[Keyframe]  # rad, unwrapped
    channels: dict[str, list[Keyframe]]  # CHANNELS in degrees and metres, ARM_CHANNELS as `Arm.coordinates`
    bob: list[Keyframe]  # m below standing


def home_plant(side: Side, count: float, origin_m: tuple[float, float], yaw_rad: float) -> FootPlant:
    """A foot standing at home."""
    x, z, yaw = _foot_place(side, origin_m, yaw_rad, TOE_OUT_DEG)
    return FootPlant(count, (x, z), yaw, 0.0, 0.0, 0.5, 0.0, (0.0, 0.0), True)


def _foot_place(
    side: Side, origin_m: tuple[float, float], yaw_rad: float, toe_out_deg: float
) -> tuple[float, float, float]:
    sign = 1.0 if side == "left" else -1.0
    spot = rot.rotate(rot.about_y(yaw_rad), np.array([sign * HOME_SIDE_M, 0.0, HOME_FWD_M]))
    return origin_m[0] + spot[0], origin_m[1] + spot[2], yaw_rad + sign * np.radians(toe_out_deg)


def build_keyframes(
    placed: Sequence[PlacedMove], rng: np.random.Generator | None, carriage: Carriage
) -> MoveKeyframes:
    """The keyframes of moves in order, each starting where and when the previous one ended.

    With `rng`, poses vary randomly. Without, they are exactly as written.
    """
    first = placed[0]
    begin = first.start - 1.0
    plants = {side: [home_plant(side, begin, first.origin_m, first.yaw_rad)] for side in SIDES}
    free = first.move.first_foot
    facing: list[Arrival] = [(begin, (first.yaw_rad,))]
    loads = [_weight_shift(begin, {None: 0.5, "left": 0.0, "right": 1.0}[free], plants, first.yaw_rad)]
    channels: dict[str, list[Keyframe]] = {name: [Keyframe(begin, (0.0,))] for name in CHANNELS}
    for name in ARM_CHANNELS:
        channels[name] = []
    bob = [Keyframe(begin, (0.0,))]
    for p in placed:
        for s in sorted(p.move.steps, key=lambda s: s.count):
            _add_step(p, s, plants, loads, facing, carriage.toes(rng))
        _add_poses(p, channels, rng)
        bob += _bounces(p)
    for name in ARM_CHANNELS:  # from the first pose on
        channels[name].insert(0, Keyframe(begin, channels[name][0].value))
    return MoveKeyframes(
        plants,
        _arrival_keys(_ground_arrivals(loads), carriage.to_go, carriage.through),
        _arrival_keys([(load.count, (load.on_left,)) for load in loads], _LOAD_TO_GO, _TURNS_THROUGH),
        _arrival_keys(facing, _TURN_TO_GO, _TURNS_THROUGH),
        channels,
        sorted(bob, key=lambda key: key.count),
    )


def _add_step(
    p: PlacedMove,
    s: Step,
    plants: dict[Side, list[FootPlant]],
    loads: list[WeightShift],
    facing: list[Arrival],
    toes: Toes,
) -> None:
    count = p.start + s.count - 1.0
    standing = plants[s.foot][-1]
    yaw = facing[-1][1][0] if s.face is None else p.yaw_rad + np.radians(s.face)
    x, z, foot_yaw = _foot_place(s.foot, p.to_world(s.at), yaw, s.toe_out)
    across = plants["right" if s.foot == "left" else "left"][-1]
    ball = standing.ball_m if s.in_place else _within_reach((x, z), across.ball_m)
    foot_yaw = standing.yaw_rad if s.face is None else foot_yaw + np.radians(toes.turn_deg)
    turn = rot.rotate(rot.about_y(p.yaw_rad), np.array([s.bow[0], 0.0, s.bow[1]]))
    bow = (turn[0], turn[2])
    if s.bow == (0.0, 0.0) and not s.in_place:
        bow = _around(standing.ball_m, ball, across, s.foot, yaw)
    lift = s.lift * (0.6 + 0.4 * p.size)
    # It does not leave before the other foot has landed and taken the weight.
    since = count - loads[-1].count
    swing = min(s.swing if s.in_place else max(s.swing, since - _WAITS), since)
    on_other = 1.0 if s.foot == "right" else 0.0
    if (
        not s.in_place and abs(loads[-1].on_left - on_other) > 1e-9
    ):  # from both feet: shift the weight off this one first
        swing = min(swing, 0.6 * (count - loads[-1].count))
        loads.append(_weight_shift(count - swing, on_other, plants, facing[-1][1][0]))
    plants[s.foot].append(
        FootPlant(
            count, ball, foot_yaw, np.radians(s.pitch), s.height * p.size, swing, lift,
            bow, s.in_place, np.radians(toes.sweep_deg), np.radians(toes.point_deg),
        )
    )  # fmt: skip
    if s.weight is None:
        return
    facing.append((count, (yaw,)))
    on_left = s.weight if s.foot == "left" else 1.0 - s.weight
    loads.append(_weight_shift(count, on_left, plants, facing[-1][1][0]))


def _within_reach(ball_m: tuple[float, float], other_m: tuple[float, float]) -> tuple[float, float]:
    """A place on the way to `ball_m` that legs reach from the other foot."""
    way = np.array(ball_m) - other_m
    x, z = other_m + way * min(1.0, _WIDEST_M / max(float(np.hypot(*way)), 1e-9))
    return float(x), float(z)


def _around(
    start_m: tuple[float, float], stop_m: tuple[float, float], other: FootPlant, foot: Side, facing_rad: float
) -> tuple[float, float]:
    """The bulge of a foot's path that takes it past the other foot, on its own side."""
    way, gap = np.array(stop_m) - start_m, np.array(other.ball_m) - start_m
    length = float(np.hypot(*way))
    along = float(gap @ way) / max(length, 1e-6) ** 2
    if length < 0.05 or not 0.1 < along < 0.9:
        return 0.0, 0.0
    sign = 1.0 if foot == "left" else -1.0
    own_side = rot.rotate(rot.about_y(facing_rad), np.array([sign, 0.0, 0.0]))[[0, 2]]
    across = own_side - way * (own_side @ way) / length**2
    size = float(np.hypot(*across))
    if size < 0.3:  # it goes to the side: past the toes of the other foot, or past its heel
        ahead = rot.rotate(rot.about_y(facing_rad), np.array([0.0, 0.0, 1.0]))[[0, 2]]
        across = ahead if float((start_m - np.array(other.ball_m)) @ ahead) >= -0.02 else -ahead
        across = across - way * (across @ way) / length**2
        size = float(np.hypot(*across))
    across /= size
    apart = float((along * way - gap) @ across)
    missing = max(0.0, _CLEAR_M - apart) / (4.0 * along * (1.0 - along))
    push = min(missing, _WIDEST_BOW_M) * across
    return float(push[0]), float(push[1])


def _weight_shift(
    count: float, on_left: float, plants: dict[Side, list[FootPlant]], facing_rad: float
) -> WeightShift:
    """The weight shift, with the body over the feet as planted last."""
    spot = np.zeros(2)
    for side, sign, share in zip(SIDES, (1.0, -1.0), (on_left, 1.0 - on_left), strict=True):
        foot = plants[side][-1]
        behind = rot.rotate(rot.about_y(foot.yaw_rad), np.array([0.0, 0.0, _BEHIND_BALL_M]))
        inside = rot.rotate(rot.about_y(facing_rad), np.array([-sign * _INSIDE_FOOT_M, 0.0, 0.0]))
        spot += share * (np.array(foot.ball_m) + (behind + inside)[[0, 2]])
    return WeightShift(count, on_left, (spot[0], spot[1]))


def _ground_arrivals(loads: Sequence[WeightShift]) -> list[Arrival]:
    """Where the body is over each support: between the feet on a held step that it comes back from."""
    arrivals: list[Arrival] = [(load.count, load.spot_m) for load in loads]
    for i, (before, here, after) in enumerate(zip(loads, loads[1:], loads[2:], strict=False), start=1):
        way, back = np.subtract(here.spot_m, before.spot_m), np.subtract(after.spot_m, before.spot_m)
        if after.count >= here.count + _SLOW and np.hypot(*back) < 0.5 * np.hypot(*way):
            arrivals[i] = (here.count, tuple(here.spot_m - _COMES_BACK * way))
    return arrivals


def _arrival_keys(arrivals: Sequence[Arrival], to_go: float, through: float) -> list[Keyframe]:
    """Keyframes of a body that starts a count before a foot lands and is nearly there on the count.

    Through consecutive steps it keeps moving, slowest on the counts, and very quick steps hardly displace
    it. The share `to_go` of the distance is left on a count, per count that it may take afterwards. It passes
    through a count at the share `through` of its mean speed.
    """
    keys = [Keyframe(*arrivals[0])]
    for i, (count, value) in enumerate(arrivals[1:], start=1):
        following = arrivals[i + 1][0] if i + 1 < len(arrivals) else np.inf
        before, here = np.array(arrivals[i - 1][1]), np.array(value)
        if following < count + _QUICK:
            here = before + ((following - count) / _QUICK) ** 2 * (here - before)
        if keys[-1].count < count - 1.1:
            keys.append(Keyframe(count - 1.0, arrivals[i - 1][1]))
        late = 1.0 if following >= count + _SLOW else min(_ARRIVES, 0.45 * (following - count))
        mostly = tuple(here - to_go * late * (here - before))
        if following <= count + 1.1:
            keys.append(Keyframe(count, mostly, flow=through))
        else:  # on the count at half its arrival speed
            keys.append(Keyframe(count, mostly, flow=0.5 * to_go * (1.0 + late)))
            if following >= count + _HELD:
                keys.append(Keyframe(count + late, tuple(here - _HELD_TO_GO * (here - before))))
                late += 1.0
            keys.append(Keyframe(count + late, value))
    return keys


def _add_poses(p: PlacedMove, channels: dict[str, list[Keyframe]], rng: np.random.Generator | None) -> None:
    """Add keyframes of the move's poses. Channels that it never sets are neutral."""
    hold = 0.4 * p.sharpness
    written = set()

    def loose(n: int) -> Floats:
        return np.zeros(n) if rng is None else p.looseness * rng.standard_normal(n)

    for count, pose in sorted(p.move.poses.items()):
        at = p.start + count - 1.0
        for name, value in pose.values.items():
            scale = p.size * (1.0 + loose(1)[0])
            channels[name].append(Keyframe(at, (scale * value,), pose.flow, hold))
            written.add(name)
        for side, arm in pose.arms.items():
            relaxed = np.array(ARMS["relaxed"].coordinates)
            reach = float(np.clip(0.75 + 0.25 * p.size, 0.85, 1.1))
            value = relaxed + reach * (np.array(arm.coordinates) - relaxed)
            value = value + loose(6)
            channels[f"{side}_arm"].append(Keyframe(at, tuple(value), pose.flow, hold))
            written.add(f"{side}_arm")
    for name, keys in channels.items():
        if name not in written:
            neutral = ARMS["relaxed"].coordinates if name in ARM_CHANNELS else (0.0,)
            keys += [Keyframe(p.start + c - 1.0, neutral) for c in (min(2, p.move.counts), p.move.counts)]


def _bounces(p: PlacedMove) -> list[Keyframe]:
    bounce = p.move.bounce
    depth = bounce.depth_m * p.bounce * (0.5 + 0.5 * p.size)
    on, off = (depth, 0.0) if bounce.on == "down" else (0.0, depth)
    keys = []
    for count in np.arange(bounce.start, p.move.counts + 1e-6, bounce.every):
        at = p.start + count - 1.0
        keys += [Keyframe(at - 0.5 * bounce.every, (off,)), Keyframe(at, (on,))]
    return keys
