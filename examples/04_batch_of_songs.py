"""Dance to every song of a folder, and list the dances in a table.

Run: python examples/04_batch_of_songs.py [FOLDER [REPERTOIRE]]
"""

import csv
import sys
from pathlib import Path

import choreograph as cg


def main(folder: str = "", db: str = "") -> None:
    songs = sorted(Path(folder).iterdir()) if folder else list(cg.example_songs().values())
    repertoire = cg.Repertoire.open(db) if db else cg.starter_repertoire()  # opened once for all songs
    with open("dances.csv", "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["song", "seconds", "music beats", "motion beats", "takes", "notes"])
        for song in songs:
            try:
                dance = cg.dance(song, repertoire, duration_s=6.0)
            except cg.ChoreographError as error:  # not a song, or a damaged one: go on with the next
                print(f"{song.name}: {error}", file=sys.stderr)
                continue
            dance.save(f"{song.stem}.bvh")
            plan = dance.plan
            beats = len(plan.music_beats_s), len(dance.motion_beats_s)
            table.writerow([song.name, plan.duration_s, *beats, len(plan.takes_s()), "; ".join(dance.notes)])
    print(Path("dances.csv").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main(*sys.argv[1:])
