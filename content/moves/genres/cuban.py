"""Cuban motion, what cha-cha and salsa share: the hip settles over the leg that has just taken the weight."""

from __future__ import annotations

from content.moves.arm_poses import Arm
from content.moves.notation import Pose, Side, pose


def over(
    leg: Side,
    amount: float = 1.0,
    *,
    left: str | Arm | None = None,
    right: str | Arm | None = None,
    arms: str | Arm | None = None,
    flow: float = 0.0,
    **values: float,
) -> Pose:
    """The body on a straight leg: its hip out, up and back, the ribs over it, the chest turned against.

    `values` are channels as in `pose`. They replace those of Cuban motion.
    """
    sign = amount if leg == "left" else -amount
    settled = {
        "hip_side": 0.030 * sign, "hip_roll": 9.0 * sign, "hip_turn": 9.0 * sign, "side": 2.0 * sign,
        "twist": -7.0 * sign, "drop": -0.006 * amount,
    }  # fmt: skip
    return pose(left=left, right=right, arms=arms, flow=flow, **{**settled, **values})
