"""A notation for parametric dance moves on the canonical body, and takes rendered from it.

notation    steps, poses, bounce, moves, and how to write them
arm_poses   named arm poses
keyframes   a sequence of moves as keyframes of feet, weight and every channel
curves      animation curves through keyframes, follow-through, counts against seconds
feet, body  from keyframes to a motion
sequencer   a genre's moves sequenced and rendered to the beats of a song
genres      the moves of each genre
"""

from choreograph.synthesis.moves.arm_poses import ARMS, Arm
from choreograph.synthesis.moves.notation import (
    Bounce,
    Move,
    Pose,
    Step,
    ball,
    both_sides,
    heel,
    kick,
    pivot,
    pose,
    press,
    step,
    touch,
)
from choreograph.synthesis.moves.sequencer import Genre, RenderedTake, render, render_take, sequence_moves

__all__ = [
    "ARMS", "Arm", "Bounce", "Genre", "Move", "Pose", "RenderedTake", "Step", "ball", "both_sides", "heel",
    "kick", "pivot", "pose", "press", "render", "render_take", "sequence_moves", "step", "touch",
]  # fmt: skip
