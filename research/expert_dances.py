"""Dances of experts to songs as BVH with counts, which `choreograph evaluate --experts FOLDER` reads.

For dance-with-melody, every take is placed on the beats of its own song count by count. For songs of
ChoreoNet's lists without a take, the listed figures are placed, as far as they are recorded.

    python research/expert_dances.py dance-with-melody/ choreonet/ -o experts/ --only held_out.txt
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from choreograph.formats import choreonet
from choreograph.formats.manifest import write_counts
from choreograph.formats.register import import_takes, save_motion
from choreograph.music.song import load_song
from research.pieces_on_beats import ExpertDance, expert_from_figures, expert_from_take


def main() -> None:
    """Lay takes on their songs' beats, and listed figures on those of songs without a take."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dances", type=Path, help="dance-with-melody")
    parser.add_argument("lists", type=Path, help="choreonet")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--only", default="", help="a file of names")
    parser.add_argument("--seed", type=int, default=0, help="of figures in place of those not recorded")
    arguments = parser.parse_args()
    names = set(Path(arguments.only).read_text().split()) if arguments.only else None
    arguments.output.mkdir(parents=True, exist_ok=True)
    takes = choreonet.annotate(list(import_takes(arguments.dances)), arguments.lists)
    for take in takes:
        if (names is None or take.name in names) and take.counts.has_bars and take.song_path is not None:
            song = load_song(take.song_path, start_s=take.song_start_s, duration_s=take.motion.duration_s)
            save(arguments.output, take.name, take.credits.genre, expert_from_take(take, song))
    recordings = list(import_takes(arguments.lists))
    for dance in choreonet.read_choreographies(arguments.lists / "choreographies.json"):
        audio = arguments.dances / dance.name / "audio.mp3"
        recorded = any(take.figures and take.credits.genre == dance.genre for take in recordings)
        taken = dance.name in {take.name for take in takes} or (names is not None and dance.name not in names)
        if audio.is_file() and recorded and not taken:
            song = load_song(audio, start_s=dance.start_s, duration_s=dance.end_s - dance.start_s)
            listed, rng = choreonet.figure_counts(dance), np.random.default_rng(arguments.seed)
            expert = expert_from_figures(listed, recordings, song, rng=rng)
            save(arguments.output, dance.name, dance.genre, expert)


def save(folder: Path, name: str, genre: str, expert: ExpertDance) -> None:
    """Write one dance and its counts, and its genre in the manifest."""
    save_motion(folder / f"{name}.bvh", expert.motion)
    write_counts(folder / f"{name}.counts.csv", expert.counts)
    manifest = folder / "manifest.csv"
    rows = manifest.read_text(encoding="utf-8") if manifest.is_file() else "name,genre\n"
    if f"\n{name}," not in rows:
        manifest.write_text(f"{rows}{name},{genre}\n", encoding="utf-8")
    print(f"{name}: {expert.motion.duration_s:.0f} s, {expert.listed_share:.0%} of the counts as listed")


if __name__ == "__main__":
    main()
