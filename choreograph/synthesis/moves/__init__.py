"""A language of parametric dance moves on the canonical body, and the takes danced in it.

language    steps, poses, bounce, moves: the words, and how to write with them
poses       arms by name
score       moves in a row as keys of feet, weight, and every channel
tracks      splines on counts, follow-through, tempo
feet, body  from a score to a motion
sequencer   genres danced to the beats of a song
genres      the moves themselves
"""

from choreograph.synthesis.moves.language import (
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
from choreograph.synthesis.moves.poses import ARMS, Arm
from choreograph.synthesis.moves.sequencer import Genre, Rendered, in_a_row, render, render_take

__all__ = [
    "ARMS", "Arm", "Bounce", "Genre", "Move", "Pose", "Rendered", "Step", "ball", "both_sides", "heel",
    "in_a_row", "kick", "pivot", "pose", "press", "render", "render_take", "step", "touch",
]  # fmt: skip
