"""Takes and songs that are not in the built-in repertoire, one for each genre, with their true beats.

    python research/unseen_starter_takes.py FOLDER
    python research/paper_tables.py FOLDER R R R -o results.md --only FOLDER/names.txt --beats FOLDER

R is `choreograph/library/shipped/starter.h5`, once for each seed. The dances are made as the built-in takes
are, from seeds beyond theirs. "real" in the tables are dances of the generator itself.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from content.moves.genres import GENRES
from content.songs.danced_styles import DANCED
from content.songs.known_songs import FIRST_SEED
from content.starter_takes import TakeSpec, write_takes

_SEEDS_FROM = FIRST_SEED + 500  # beyond the test bed's songs
_DURATION_S = 60.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    plans = []
    for i, genre in enumerate(sorted(GENRES)):
        name, bpm = f"unseen-{genre.replace(' ', '-').lower()}", round(sum(DANCED[genre].bpm) / 2)
        plans.append(TakeSpec(name, genre, bpm, _SEEDS_FROM + i, _DURATION_S))
    write_takes(folder, plans)
    for plan in plans:
        beats_s = json.loads((folder / f"{plan.name}.truth.json").read_text(encoding="utf-8"))["beat_times_s"]
        lines = [f"{instant_s:.4f}" for instant_s in beats_s]
        (folder / f"{plan.name}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "names.txt").write_text("\n".join(plan.name for plan in plans) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
