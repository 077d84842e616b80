"""Alternatives for a part of a dance: what else could be danced there, what it costs, and how it differs."""

from __future__ import annotations

from dataclasses import dataclass, replace

from choreograph.choreography.edits import edit_slots
from choreograph.choreography.pieces import APART_M, Piece, PieceRequest, pose_distance_m
from choreograph.core.arguments import is_whole, unexpected
from choreograph.core.numerics import Floats, default_numerics, one_thread
from choreograph.library.repertoire import Repertoire
from choreograph.motion.body import body_pos_m, clips_to_root_frame
from choreograph.motion.motion import Motion
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.editing import Editor, planned_edit
from choreograph.pipeline.figures import danced_figures
from choreograph.render.assembly import off_stage

_COMPARED_FPS = 20.0  # of the rendered alternatives


@dataclass(frozen=True, eq=False)
class Alternative:
    """A dance in which one part is danced otherwise, what that costs, and how it differs.

    Examples
    --------
    >>> session = cg.Session(cg.example_songs()["house"], duration_s=8)
    >>> first, second = session.alternatives((3.0, 5.0), n=2)
    >>> first
    <Alternative from 2.67 to 5.57 s, cost ...: ...>
    >>> first.dance.plan.edits[-1].words[0].take != ""
    True
    """

    dance: Dance
    """The whole dance, with this part in it."""

    start_s: float
    """When the part that differs begins, in seconds."""

    end_s: float
    """When it ends, in seconds."""

    costs: dict[str, float]
    """Its costs by name, in metres of joint distance."""

    why: str
    """How it differs, such as "same motifs, quieter, from another dancer"."""

    @property
    def cost(self) -> float:
        """The sum of its costs."""
        return sum(self.costs.values())

    def __repr__(self) -> str:
        return (
            f"<Alternative from {self.start_s:.2f} to {self.end_s:.2f} s, cost {self.cost:.2f}: {self.why}>"
        )


@default_numerics()
@one_thread()
def alternatives(
    dance: Dance, repertoire: Repertoire, span_s: tuple[float, float], n: int
) -> tuple[Alternative, ...]:
    """As `Session.alternatives`, for a dance of takes of a repertoire."""
    if not is_whole(n) or n < 1:
        raise unexpected("a number of alternatives of 1 or more", n)
    editor = Editor(dance, repertoire, (), 0)
    asked = edit_slots(*span_s, editor.bounds_s)
    slots, found = editor.pieces(asked, PieceRequest(editor.allowed))
    times_s = editor.bounds_s[[slots.first, slots.stop]]
    shown_m = [_poses_m(dance.motion, times_s)]
    made: list[Alternative] = []
    looked: list[Piece] = []
    for piece in found:
        if len(made) == n:
            break
        if any(pose_distance_m(piece.poses_m, other.poses_m) < APART_M for other in looked):
            continue
        planned = planned_edit(piece, f"swap {times_s[0]:g}-{times_s[1]:g}")
        motion = editor.rendered(planned)
        poses_m = _poses_m(motion, times_s)
        if any(pose_distance_m(poses_m, other_m) < APART_M for other_m in shown_m):
            continue
        shown_m.append(poses_m)
        looked.append(piece)
        plan = replace(dance.plan, edits=(*dance.plan.edits, planned))
        figures = danced_figures(plan, repertoire)
        other = Dance(motion, plan, off_stage(motion, plan.stage), dance.song_path, figures=figures)
        made.append(Alternative(other, planned.start_s, planned.end_s, piece.costs, piece.why))
    return tuple(made)


def _poses_m(motion: Motion, span_s: Floats) -> Floats:
    """Poses (S, 21, 3) of a part of a motion, moved rigidly to one place and heading."""
    first, stop = (span_s * motion.fps).round().astype(int)
    step = max(1, round(motion.fps / _COMPARED_FPS))
    poses_m: Floats = clips_to_root_frame(body_pos_m(motion.sliced(first, max(stop, first + 1)))[::step])
    return poses_m
