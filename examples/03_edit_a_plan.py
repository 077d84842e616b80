"""Edit a plan and render it: dance seconds 0 and 1 again in place of seconds 4 and 5.

Run: python examples/03_edit_a_plan.py [SONG [REPERTOIRE]]

A plan is JSON (`choreograph dance SONG -o plan.json`), so any editor can change it. This example uses Python.
"""

import sys
from dataclasses import replace
from pathlib import Path

import choreograph as cg


def main(song: str = "", db: str = "") -> None:
    repertoire = cg.Repertoire.open(db) if db else cg.starter_repertoire()
    dance = cg.dance(song or cg.example_songs()["house"], repertoire, duration_s=8.0)
    dance.save("plan.json")

    plan = cg.Plan.read("plan.json")
    seconds = list(plan.seconds)
    for second in (4, 5):
        # The motion is the same, only its time changes. A transition of 0.25 s leads into it.
        when = {"second": second, "segment_second": second, "start_s": float(second)}
        seconds[second] = replace(plan.seconds[second - 4], **when, transition_s=0.25)
    edited = replace(plan, seconds=tuple(seconds))
    Path("edited.json").write_text(edited.to_json())  # or: choreograph dance SONG --plan edited.json

    cg.Dance(cg.render(edited, repertoire), edited).save("edited.bvh")
    for block in edited.blocks:
        print(f"{block.start_s:5.2f} s: {block.planned.take} from {block.source_start_s:.2f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
