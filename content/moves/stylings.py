"""Ways to dance a genre: men's and women's styling, and takes that begin, end or pause."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from content.moves.figures import Manner
from content.moves.notation import Bounce, Move, pose, step, touch
from content.moves.sequencer import Genre

Styling = Literal["his", "hers"]
Part = Literal["whole", "beginning", "ending", "break"]


@dataclass(frozen=True)
class Way:
    """One way to dance a genre."""

    styling: Styling = "his"
    size: float = 1.0  # of all steps, relative
    energy: float = 0.0  # added to that of the song, 1 is from the softest to the liveliest


def styled(genre: Genre, way: Way) -> Genre:
    """The genre in a way. Hers has more of the hips and the head, and the other side of a frame."""
    carriage, manner = genre.carriage, genre.manner
    if way.styling == "hers":
        carriage = replace(
            carriage, hip_up=1.25 * carriage.hip_up, hip_out_m=1.3 * carriage.hip_out_m,
            hip_with_feet=1.15 * carriage.hip_with_feet, looks=1.15 * carriage.looks,
        )  # fmt: skip
        manner = replace(manner, toe_out_deg=0.8 * manner.toe_out_deg, arms=_exchanged(manner))
    else:
        carriage = replace(carriage, hip_up=0.85 * carriage.hip_up, hip_out_m=0.8 * carriage.hip_out_m)
    return replace(genre, carriage=carriage, manner=manner, size=genre.size * way.size)


def _exchanged(manner: Manner) -> tuple[tuple[str, str], ...]:
    if manner.swaps_arms:
        return manner.arms
    return tuple((right, left) for left, right in manner.arms)


def ready(genre: Genre) -> Move:
    """A bar of waiting: the arms come up from rest, and the weight goes to one foot."""
    left, right = genre.manner.arms[0]
    n = genre.bar
    return Move(
        "ready", n, (touch("left", n, (0.04, 0.02), swing=0.6),),
        {
            1: pose(nod=6, look=-8, arms="relaxed"),
            n - 1: pose(arch=3, nod=-2, look=6, side=-2, arms="relaxed", flow=0.4),
            n: pose(arch=2, nod=0, look=0, left=left, right=right, flow=0.3),
        },
        Bounce(0.0),
        end=(0.0, 0.0, 0.0),
    )  # fmt: skip


def finish(genre: Genre) -> Move:
    """Two bars: a step, the other foot to it, and a line that is held to the end."""
    n = 2 * genre.bar
    side = 0.26
    return Move(
        "finish", n,
        (step("left", 1, (side, 0.06)), touch("right", 2, (side - 0.10, 0.16), swing=0.9)),
        {
            1: pose(twist=-8, side=3, look=12, left="chest", right="low_out", flow=0.4),
            2: pose(twist=10, side=5, hip_side=0.02, look=24, nod=-6, arch=6, left="wide_up", right="hip"),
            genre.bar + 1: pose(
                twist=12, side=6, hip_side=0.025, look=22, nod=-8, arch=8, left="wide_up", right="hip"
            ),
            n: pose(twist=11, side=5, hip_side=0.02, look=20, nod=-5, arch=6, left="wide_up", right="hip"),
        },
        Bounce(0.0),
        end=(side, 0.06, 0.0),
    )  # fmt: skip


def pause(genre: Genre) -> Move:
    """A bar in which the dancer stops, looks, and goes on."""
    n = genre.bar
    return Move(
        "break", n, (touch("left", 1, (0.14, 0.10), swing=0.8), touch("left", n, (0.05, 0.02), swing=0.7)),
        {
            1: pose(twist=8, side=-4, drop=0.02, look=25, nod=-4, left="hip", right="loose"),
            n - 1: pose(twist=9, side=-4, drop=0.02, look=22, nod=-3, left="hip", right="loose"),
            n: pose(twist=0, side=0, drop=0.0, look=0, nod=0, left="loose", right="loose"),
        },
        Bounce(0.0),
        end=(0.0, 0.0, 0.0),
    )  # fmt: skip
