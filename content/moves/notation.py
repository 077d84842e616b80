"""Dance notation: steps, poses and bounce on a teacher's counts, and the moves made of them.

How to write a move
-------------------
A dancer stands at home: feet 0.2 m apart, body over them, facing forward. Counts are the teacher's. The
first beat is 1, and "3 and" is 3.5. A move of N counts begins where the last one ended (its count N is
the next one's count 0), usually lands its first step on 1, and **is home again on N**: by then both
feet stand at the same place with the same facing, which is the home of the next move. Write it for
one side. `mirrored()` gives the other. ::

    STEP_TOUCH = Move(
        "step touch", counts=4,
        steps=(
            step("left", 1, (0.40, 0.0)),    # the left foot to 0.40 m left of its home, weight on it
            touch("right", 2, (0.36, 0.0)),  # the right one beside it, no weight: it is free for count 3
            step("right", 3),                # back to its own home (0, 0)
            touch("left", 4),                # beside it: both feet home, left free, as at the start
        ),
        poses={
            1: pose(twist=8, side=4, left="swing_back", right="swing_fwd"),
            2: pose(hip_side=0.03, nod=4, left="clap", right="clap"),
            3: pose(twist=-8, side=-4, left="swing_fwd", right="swing_back"),
            4: pose(hip_side=-0.03, nod=4, left="clap", right="clap"),
        },
        bounce=Bounce(0.04, "down"),
    )

Steps. `at` is (left, forward) in metres *from that foot's own home place*, so (0.4, 0) for both feet moves
the whole body 0.4 m to the left. `face` in degrees (left is positive) turns the home the foot stands in.
A travelling or turning move ends with both feet `at` the same place and `face`. Every swing
leaves the floor `swing` counts before it lands. `step` takes the weight, `touch`, `heel`, `kick` do not,
`press` shifts weight without lifting (weight 0.5: on both feet), `pivot` turns a planted foot about its
ball. The body faces where weighted steps `face`. In a turn, pivot the standing foot along on the same
count. The standing foot may not lift: `Move` raises an error. Pelvis, knees and heels follow from the
steps: the body moves over the standing foot and is lowered until both legs reach, and heels rise before
a foot leaves.

Poses define the rest of the body on a count. A channel that a pose leaves out is interpolated between its
neighbours. One that the move never sets is neutral. A pose *arrives* on its count, at rest, so accents lie on
counts. Give a pose on (nearly) every count for the main channels of the move. `flow=0.5`
makes the body pass through instead (slow dances). The channels are listed in `CHANNELS`. Arms are names in
`arm_poses.ARMS` or an `Arm(upper, fore)`. Left is positive. Units are degrees and metres.

Turns, quick steps, kicks, rises. ::

    step("left", 1, (0.20, 0.10), face=90.0),        # a three step turn to the left: a quarter,
    pivot("left", 2, face=200.0),                    # the planted foot turns along,
    step("right", 2, (0.62, 0.12), face=250.0, bow=(0.0, 0.24)),   # past it, in an arc, ...
    kick("left", 1, (0.0, 0.62), 0.27),              # kick ball change: straight out on 1,
    ball("left", 1.5, (0.0, -0.14)), step("right", 2),             # and back, change: swings shorten
    press("right", 3, pitch=25.0, weight=1.0),       # a rise onto the ball in place (and drop=-0.02)

A genre is a module in `genres/` with its moves and a `Genre`, listed in `genres/__init__.py`. A waltz has
counts=3 or 6 and `Genre(bar=3)`. The tests then check floor, beat, limbs and mirror of each move.

Experience: bounce 0.02-0.05 m, "down" (hip-hop, house: lowest on the count)
or "up" (disco, swing: highest on it). Hips lead, the chest turns against the legs (left foot steps:
twist -6 … -15). Arms that travel 0.3 m and more between counts make the accents. A pose between counts
("and") is another stop. Give it `flow=1.0` unless the stop is wanted. `hip_side` against the weight just
taken moves the accent off the count. Home's 0.2 m between the feet does not scale with `size`: a foot that
crosses or passes needs 0.15 m clear at 0.7 too, or a `bow`. Check strips from the front and the side
(`choreograph.view.strip.write_strip`). A move that ends with the other foot free alternates sides
automatically. One that ends with the same foot free is repeated to the same side, so write both in 4 counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from choreograph.core.errors import ParameterError
from content.moves.arm_poses import Arm, arm

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
_HOME_M = 0.06  # largest distance from home of a foot that touches at the end

# One number each, 0 is neutral. True: the sign denotes a side and flips when mirrored.
CHANNELS: dict[str, bool] = {
    "hip_side": True,  # pelvis to the left of the supported position, m
    "hip_fwd": False,  # pelvis forward of that position, m
    "drop": False,  # pelvis down: a plié, m
    "hip_roll": True,  # left hip up, degrees
    "hip_turn": True,  # pelvis turned to the left, the chest stays, degrees
    "hip_tilt": False,  # tail back (arched), degrees, negative: tail under (contracted)
    "bend": False,  # spine bent forward, degrees in total
    "arch": False,  # chest lifted and pushed forward against the lower spine, degrees
    "side": True,  # spine bent to the left, degrees
    "twist": True,  # chest turned to the left of the facing, degrees
    "nod": False,  # head down, degrees
    "look": True,  # head turned to the left, degrees
    "tilt": True,  # head's top to the left, degrees
    "left_shrug": False,  # shoulder up, degrees
    "right_shrug": False,
    "left_reach": False,  # shoulder forward, degrees
    "right_reach": False,
}
ARM_CHANNELS = ("left_arm", "right_arm")


@dataclass(frozen=True)
class Step:
    """What one foot does on one count. Write them with `step`, `touch`, `heel`, `kick`, `press`, `pivot`."""

    foot: Side
    count: float  # when it lands (or, a kick, is furthest out)
    at: tuple[float, float] = (0.0, 0.0)  # (left, forward) of its home place, m
    face: float | None = 0.0  # turn of its home to the left in degrees, None: unchanged
    weight: float | None = None  # share of the body's weight it carries afterwards, None: unchanged
    toe_out: float = 10.0  # outwards from the facing, degrees
    pitch: float = 0.0  # heel up (positive) or toes up (negative) while on the floor, degrees
    height: float = 0.0  # of a kick, m
    swing: float = 0.8  # counts in the air
    lift: float = 0.07  # height above the straight path, m
    bow: tuple[float, float] = (0.0, 0.0)  # (left, forward) bulge of its path, around the other foot, m

    @property
    def in_place(self) -> bool:
        """Whether it stays on the floor in its place."""
        return self.lift == 0.0 and self.height == 0.0

    def mirrored(self) -> Step:
        """The mirror image: the other foot, to the other side."""
        return replace(
            self, foot=other(self.foot), at=(-self.at[0], self.at[1]),
            face=None if self.face is None else -self.face, bow=(-self.bow[0], self.bow[1]),
        )  # fmt: skip


def other(foot: Side) -> Side:
    """The other side."""
    return "right" if foot == "left" else "left"


def step(foot: Side, count: float, at: tuple[float, float] = (0.0, 0.0), **more: Any) -> Step:
    """A flat step that takes the whole weight (`weight=0.5`: half of it)."""
    return Step(foot, count, at, **{"weight": 1.0, **more})


def ball(foot: Side, count: float, at: tuple[float, float] = (0.0, 0.0), **more: Any) -> Step:
    """A step onto the ball of the foot, heel up: quick 'and' steps, rises."""
    return Step(foot, count, at, **{"weight": 1.0, "pitch": 22.0, "lift": 0.05, **more})


def touch(foot: Side, count: float, at: tuple[float, float] = (0.0, 0.0), **more: Any) -> Step:
    """The ball touches the floor without weight, heel up."""
    return Step(foot, count, at, **{"pitch": 28.0, **more})


def heel(foot: Side, count: float, at: tuple[float, float] = (0.0, 0.0), **more: Any) -> Step:
    """The heel touches the floor without weight, toes up."""
    return Step(foot, count, at, **{"pitch": -24.0, **more})


def kick(foot: Side, count: float, at: tuple[float, float], height: float, **more: Any) -> Step:
    """The foot is in the air on the count, `height` m up, toes pointed. It lands with its next step."""
    return Step(foot, count, at, **{"height": height, "pitch": 10.0, "lift": 0.02, **more})


def press(foot: Side, count: float, **more: Any) -> Step:
    """Shift the weight onto a foot that stays in place. `weight=0.5` is onto both."""
    return Step(foot, count, **{"face": None, "weight": 1.0, "lift": 0.0, "swing": 0.5, **more})


def pivot(foot: Side, count: float, **more: Any) -> Step:
    """The planted foot turns about its ball to a new `face`. The weight stays."""
    return Step(foot, count, **{"lift": 0.0, "swing": 0.7, **more})


@dataclass(frozen=True)
class Pose:
    """Hips and upper body on a count, only the channels it names."""

    values: Mapping[str, float]  # of CHANNELS
    arms: Mapping[Side, Arm] = field(default_factory=dict)
    flow: float = 0.0  # 0: at rest on the count, 1: passing through

    def mirrored(self) -> Pose:
        """The mirror image."""
        values = {_swapped(name): -v if CHANNELS[name] else v for name, v in self.values.items()}
        return replace(self, values=values, arms={other(side): a for side, a in self.arms.items()})


def _swapped(name: str) -> str:
    side, _, rest = name.partition("_")
    return f"{other(side)}_{rest}" if side in SIDES else name


def pose(
    *,
    left: str | Arm | None = None,
    right: str | Arm | None = None,
    arms: str | Arm | None = None,
    flow: float = 0.0,
    **values: float,
) -> Pose:
    """A pose from channels (`CHANNELS`) and arms (names or `Arm`). `arms` sets both.

    Raises `ParameterError` for a channel or an arm pose that does not exist.
    """
    unknown = sorted(set(values) - set(CHANNELS))
    if unknown:
        raise ParameterError(f"no channel {', '.join(unknown)}: there are {', '.join(CHANNELS)}")
    named: dict[Side, str | Arm | None] = {"left": left or arms, "right": right or arms}
    return Pose(values, {side: arm(which) for side, which in named.items() if which is not None}, flow)


@dataclass(frozen=True)
class Bounce:
    """The pulse of the knees: `depth_m` down and up every `every` counts, lowest or highest on them."""

    depth_m: float
    on: Literal["down", "up"] = "down"
    every: float = 1.0
    start: float = 1.0  # the first count


@dataclass(frozen=True)
class Move:
    """A dance move on counts, for one side. The module's docstring explains it.

    Raises `ParameterError` if a count is out of range, a standing foot lifts, or it does not end at home.
    """

    name: str
    counts: int
    steps: tuple[Step, ...]
    poses: Mapping[float, Pose] = field(default_factory=dict)
    bounce: Bounce = Bounce(0.025)
    fastest_bpm: float = 400.0  # counts per minute, at higher tempi its quick steps are not feasible
    # (left m, forward m, degrees) of the home at its end, where the free foot may be elsewhere.
    end: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        counts = [s.count for s in self.steps] + list(self.poses)
        if any(not 0 < c <= self.counts for c in counts):
            raise ParameterError(f"{self.name}: expected counts above 0, up to {self.counts}, got {counts}")
        self._stands_on()
        if self.end is not None:
            return
        apart = [abs(a - b) for a, b in zip(self._place("left"), self._place("right"), strict=True)]
        if max(apart[:2]) > _HOME_M or apart[2] > 0.0:
            raise ParameterError(
                f"{self.name}: the feet end at {self._place('left')} and {self._place('right')}, "
                f"expected the same place (within {_HOME_M} m) and facing: the home at its end"
            )

    def _stands_on(self) -> Side | None:
        """The foot that carries the weight at the end. None is both, or the same as at the start."""
        standing: Side | None = None
        for s in sorted(self.steps, key=lambda s: s.count):
            if s.foot == standing and not s.in_place:
                raise ParameterError(
                    f"{self.name}: on {s.count} the {s.foot} foot lifts but carries the weight"
                )
            if s.weight is not None:
                standing = None if s.weight < 1.0 else s.foot
            elif not s.in_place:
                standing = other(s.foot)
        return standing

    def _place(self, foot: Side) -> tuple[float, float, float]:
        at, face = (0.0, 0.0), 0.0
        for s in sorted(self.steps, key=lambda s: s.count):
            if s.foot == foot:
                at, face = at if s.in_place else s.at, face if s.face is None else s.face
        return *at, face

    @property
    def travel(self) -> tuple[float, float, float]:
        """(left m, forward m, degrees to the left) from the home it starts at to the one it ends at."""
        return self.end or self._place(self._stands_on() or "left")

    @property
    def first_foot(self) -> Side | None:
        """The foot that must be free at the start. None is either."""
        moving = [s for s in sorted(self.steps, key=lambda s: s.count) if not s.in_place]
        return moving[0].foot if moving else None

    @property
    def free_foot(self) -> Side | None:
        """The foot without weight at the end. None is either, if the weight is on both or never shifted."""
        standing = self._stands_on()
        return None if standing is None else other(standing)

    def mirrored(self) -> Move:
        """The move to the other side. Applied twice, it gives the move itself."""
        return replace(
            self,
            steps=tuple(s.mirrored() for s in self.steps),
            poses={count: p.mirrored() for count, p in self.poses.items()},
            end=None if self.end is None else (-self.end[0], self.end[1], -self.end[2]),
        )


def both_sides(move: Move) -> Move:
    """`move`, then its mirror image, as one move of twice the counts. The move must not travel."""
    if move.travel != (0.0, 0.0, 0.0):
        raise ParameterError(f"{move.name}: travels, so its mirror image cannot start from the same home")
    n, back = move.counts, move.mirrored()
    steps = move.steps + tuple(replace(s, count=s.count + n) for s in back.steps)
    return replace(
        move, counts=2 * n, steps=steps, poses={**move.poses, **{c + n: p for c, p in back.poses.items()}}
    )


def varied(move: Move, rng: np.random.Generator, *, length: float, turn_deg: float) -> Move:
    """`move` as it is danced once: other lengths and places of steps, lifts, turned a little on its way.

    `length` is the relative spread of lengths, `turn_deg` that of the turn at the end. The way of a move
    that stays in its place is bent as well: it drifts.
    """
    scale = 1.0 + length * rng.standard_normal(2).clip(-1.5, 1.5)
    drift = 0.18 * rng.standard_normal(2).clip(-1.5, 1.5)
    turn = float(turn_deg * rng.standard_normal(1)[0].clip(-1.5, 1.5))

    def place(at: tuple[float, float], face: float, share: float) -> tuple[tuple[float, float], float]:
        angle = np.radians(turn * share)
        x, z = scale * at + drift * share
        cos, sin = np.cos(angle), np.sin(angle)
        return (float(cos * x + sin * z), float(cos * z - sin * x)), face + turn * share

    steps = []
    for s in sorted(move.steps, key=lambda s: s.count):
        at, face = place(s.at, s.face or 0.0, s.count / move.counts)
        near = 0.02 * rng.standard_normal(2).clip(-1.5, 1.5)
        lift = s.lift * float(rng.uniform(0.8, 1.3))
        if s.in_place:
            steps.append(replace(s, face=None if s.face is None else face))
        else:
            steps.append(replace(s, at=(at[0] + near[0], at[1] + near[1]), face=face, lift=lift))
    end, facing = place(move.travel[:2], move.travel[2], 1.0)
    return replace(move, steps=tuple(steps), end=(*end, facing))
