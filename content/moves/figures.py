"""Figures: steps written as a teacher says them, one after another, danced a little differently each time.

A figure is written from the standing foot of each step, so that it travels, turns and follows any other ::

    Figure("whisk", 3, "1 L 0 38, 2 R 30 14 b, 3 L -24 -8 b")

Each step has its count, its foot, how far it goes outwards and forward in cm from the place beside the
standing foot, then in any order: `@-45` turns the body 45 degrees to the right on the way, and a letter says
how the foot lands: `b` on its ball, `t` a touch, `h` a heel without weight, `k20` a kick 20 cm high, `f` in
front, flat, without weight, `p` weight back onto a foot that stays, `s` short in the air. Negative numbers
outwards cross the standing foot. A line `1 L 0 0 t` touches beside it.

A `Manner` is how a genre dances all of them: its arms, its levels in a bar, and how much varies.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from content.moves.notation import CHANNELS, SIDES, Bounce, Move, Pose, Side, Step, other, pose

# A foot's ball from the middle of its home, as in `keyframes`.
HOME_SIDE_M, HOME_FWD_M = 0.10, 0.09
_FARTHEST_M = 0.54  # of one step
_PIVOTS_DEG = 12.0  # from this turn on the standing foot turns along
_STEP = re.compile(r"([\d.]+) ([LR]) (-?\d+) (-?\d+)((?: (?:@-?\d+|k\d+|[bthfps]))*)")
LEVEL = Bounce(0.0)
ArmPair = tuple[str, str]  # names of the poses of the left and the right arm


@dataclass(frozen=True)
class RelativeStep:
    """A step from the standing foot."""

    count: float
    foot: Side
    out_m: float
    fwd_m: float
    turn_deg: float
    kind: str  # a letter of the module's docstring, or "" for a flat step
    height_m: float = 0.0


@dataclass(frozen=True)
class Manner:
    """How a genre dances its figures."""

    arms: tuple[ArmPair, ...] = (("loose", "loose"),)  # with the weight on the left foot
    changes: tuple[float, ...] = (1.0, 1.0, 2.0)  # counts between two poses of the arms, one is drawn
    swaps_arms: bool = True  # with the weight on the right foot, arms are the mirror image
    flow: float = 0.5  # of arms through their poses
    levels_m: tuple[float, ...] = (0.0,)  # the pelvis is lower by this on each count of a bar
    ball_deg: float = 22.0  # how high heels rise
    bounce: Bounce = LEVEL
    twist_deg: float = 6.0  # the chest turns to the foot that goes, the other way
    side_deg: float = 3.0  # and leans over the foot that stands
    settles: Mapping[str, float] = field(
        default_factory=dict
    )  # added on a count without a step, left standing
    groove_deg: float = 0.0  # chest and head go down on each count and up between two
    look_deg: float = 14.0  # the head turns to where the step goes
    toe_out_deg: float = 12.0
    swing: float = 0.85  # counts in the air
    glides: bool = False  # a foot leaves as soon as the other one carries the weight
    lift_m: float = 0.05
    varies: float = 0.16  # of each length, relative
    turns_vary_deg: float = 7.0


@dataclass(frozen=True)
class Figure:
    """A figure of a whole number of counts, for one side.

    Raises `ParameterError` if a line of `steps` cannot be read, or a foot that stands is to lift.
    """

    name: str
    counts: int
    steps: str
    arms: tuple[ArmPair, ...] = ()  # by default those of the manner
    poses: dict[float, Pose] = field(default_factory=dict)  # what else the body does on a count
    fastest_bpm: float = 400.0

    def __post_init__(self) -> None:
        _ = self.relative

    @cached_property
    def relative(self) -> tuple[RelativeStep, ...]:
        """The steps in order of count."""
        return tuple(sorted((self._read(line) for line in self.steps.split(",")), key=lambda s: s.count))

    def _read(self, line: str) -> RelativeStep:
        found = _STEP.fullmatch(line.strip())
        if found is None:
            raise ParameterError(f"{self.name}: expected a step such as '2 R 34 0 @-45 b', got '{line}'")
        count, foot, out, fwd, more = found.groups()
        turn, kind, height = 0.0, "", 0.0
        for word in more.split():
            if word[0] == "@":
                turn = float(word[1:])
            else:
                kind, height = word[0], float(word[1:] or 0) / 100
        side: Side = "left" if foot == "L" else "right"
        return RelativeStep(float(count), side, int(out) / 100, int(fwd) / 100, turn, kind, height)

    @property
    def first_foot(self) -> Side:
        """The foot that must be free at the start."""
        return self.relative[0].foot

    def move(
        self,
        manner: Manner = Manner(),
        rng: np.random.Generator | None = None,
        *,
        steer_deg: float = 0.0,
        mirrored: bool = False,
    ) -> Move:
        """The figure as a move, or its mirror image, whose arms are not exchanged if the manner keeps them.

        With `rng`, it is a little different each time. `steer_deg` turns it as a whole.
        """
        steps, end, stands = _walk(self.relative, manner, rng, steer_deg)
        poses = _poses(self, manner, stands, rng, exchanged=mirrored and not manner.swaps_arms)
        move = Move(
            self.name, self.counts, steps, poses, manner.bounce, fastest_bpm=self.fastest_bpm, end=end
        )
        return move.mirrored() if mirrored else move


def _walk(
    relative: tuple[RelativeStep, ...], manner: Manner, rng: np.random.Generator | None, steer_deg: float
) -> tuple[tuple[Step, ...], tuple[float, float, float], list[tuple[float, Side, float, float]]]:
    """The steps from the home at the start, the home at the end, and who stands from each count on.

    A row of the last is the count, the foot, how far the step went outwards, and its turn in degrees.
    """
    first = relative[0]
    support: Side = first.foot if first.kind == "p" else other(first.foot)
    home, face = np.zeros(2), 0.0
    balls = {side: _offset(side) for side in SIDES}  # where each foot stands
    steps: list[Step] = []
    stands = [(0.0, support, 0.0, 0.0)]
    whole = 1.0 if rng is None else float(np.exp(manner.varies * rng.standard_normal(1)[0].clip(-1.6, 0.9)))
    share = steer_deg / max(1, sum(r.kind != "p" for r in relative))
    for r in relative:
        vary, sway = (0.0, 0.0) if rng is None else rng.standard_normal(2).clip(-1.8, 1.8)
        turn = r.turn_deg + share + (manner.turns_vary_deg * sway if r.kind != "p" else 0.0)
        if r.kind == "p":
            steps.append(Step(r.foot, r.count, face=None, weight=1.0, lift=0.0, swing=0.5))
            home, support = balls[r.foot] - _turned(_offset(r.foot), face), r.foot
            stands.append((r.count, support, 0.0, 0.0))
            continue
        new_face = face + turn
        # The standing foot turns about its ball, so that the home beside it moves.
        home = balls[support] - _turned(_offset(support), new_face)
        if abs(turn) > _PIVOTS_DEG:
            steps.append(_pivot(support, r.count, new_face, manner))
        sign = 1.0 if r.foot == "left" else -1.0
        length = whole * (1.0 + manner.varies * vary)
        way = np.array([sign * r.out_m, r.fwd_m]) * length
        way *= min(1.0, _FARTHEST_M / max(float(np.hypot(*way)), 1e-6))
        at = home + _turned(way, face + 0.5 * turn)
        steps.append(_step(r, (float(at[0]), float(at[1])), new_face, manner))
        face = new_face
        balls[r.foot] = at + _turned(_offset(r.foot), face)
        if r.kind not in "thfk" or not r.kind:
            home, support = at, r.foot
            stands.append((r.count, support, sign * r.out_m, turn))
    return tuple(steps), (float(home[0]), float(home[1]), face), stands


def _step(r: RelativeStep, at: tuple[float, float], face: float, manner: Manner) -> Step:
    far = float(np.hypot(r.out_m, r.fwd_m))
    swing = 0.45 if r.kind == "s" else 2.0 if manner.glides else min(manner.swing, 0.55 + far)
    more = {"toe_out": manner.toe_out_deg, "swing": swing, "lift": manner.lift_m}
    if r.kind == "k":
        return Step(r.foot, r.count, at, face, height=r.height_m, pitch=14.0, lift=0.02, swing=0.7)
    weight = None if r.kind in ("t", "h", "f") else 1.0
    pitch = {"b": manner.ball_deg, "t": 28.0, "h": -22.0}.get(r.kind, 0.0)
    return Step(r.foot, r.count, at, face, weight, pitch=pitch, **more)


def _pivot(foot: Side, count: float, face: float, manner: Manner) -> Step:
    return Step(foot, count, face=face, lift=0.0, swing=0.8, toe_out=manner.toe_out_deg)


def _offset(foot: Side) -> Floats:
    return np.array([HOME_SIDE_M if foot == "left" else -HOME_SIDE_M, HOME_FWD_M])


def _turned(vector: Floats, degrees: float) -> Floats:
    """(left, forward) turned to the left."""
    angle = np.radians(degrees)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([cos * vector[0] + sin * vector[1], -sin * vector[0] + cos * vector[1]])


def _poses(
    figure: Figure,
    manner: Manner,
    stands: list[tuple[float, Side, float, float]],
    rng: np.random.Generator | None,
    *,
    exchanged: bool,
) -> dict[float, Pose]:
    """Arms, head and chest on the counts, from who stands and where the steps go."""
    pairs = figure.arms or manner.arms
    poses: dict[float, Pose] = {}
    landed = {row[0] for row in stands}
    next_arms, index = 0.0, 0
    for count in range(1, figure.counts + 1):
        _, foot, out, turn = [row for row in stands if row[0] <= count][-1]
        sign = 1.0 if foot == "left" else -1.0
        values = {
            "drop": manner.levels_m[(count - 1) % len(manner.levels_m)],
            "twist": -manner.twist_deg * sign,
            "side": manner.side_deg * sign,
            "bend": manner.groove_deg,
            "nod": 0.7 * manner.groove_deg,
            "arch": -0.5 * manner.groove_deg,
            "look": float(np.clip(manner.look_deg * (out / 0.3 + turn / 60.0), -45.0, 45.0)),
        }
        if count not in landed:
            for name, value in manner.settles.items():
                values[name] = values.get(name, 0.0) + (sign * value if CHANNELS[name] else value)
        arms: dict[str, str] = {}
        if count > next_arms:
            pair = pairs[index % len(pairs) if rng is None else int(rng.integers(len(pairs)))]
            if exchanged or (manner.swaps_arms and foot == "right"):
                pair = (pair[1], pair[0])
            arms = {"left": pair[0], "right": pair[1]}
            next_arms = count - 1 + (1.0 if rng is None else float(rng.choice(manner.changes)))
            index += 1
        poses[count] = pose(flow=manner.flow if count in landed else 0.0, **arms, **values)
        if manner.groove_deg:
            up = -0.4 * manner.groove_deg
            poses[count - 0.5] = pose(bend=up, nod=0.7 * up, arch=-1.2 * up, flow=0.3)
    for count, more in figure.poses.items():
        base = poses.get(count, more)
        poses[count] = replace(base, values={**base.values, **more.values}, arms={**base.arms, **more.arms})
    return poses
