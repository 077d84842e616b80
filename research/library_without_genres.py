"""How often the genre of a song is danced if takes have no genres, by selection and the cost `genre`.

    python research/library_without_genres.py dance-with-melody/ a.h5 b.h5 … --songs a.txt b.txt …

The genres of takes are removed from a copy of each repertoire. It then dances to the songs of its file
(--songs, one for each repertoire), which it was built without. The table shows the share of seconds that are
danced with takes of the genre of the song, by the genres in the repertoire itself. Values are means over
songs ± the spread of repertoires.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.evaluation.songs import find_songs
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import Contents, write_repertoire

WAYS = [(selection, cost) for selection in ("genre", "style") for cost in (1.0, 0.0)]


def without_genres(repertoire: Path, folder: Path) -> Path:
    """A copy of a repertoire whose takes name no genre."""
    copy, file = folder / repertoire.name, RepertoireFile(repertoire)
    arrays = file.arrays()
    arrays["takes/genre"] = np.full(len(arrays["takes/genre"]), "")
    nets = {name: file.read_net(name) for name in file.net_names}
    write_repertoire(copy, Contents(arrays, file.density, file.provenance, nets))
    return copy


def own_genre(plan: cg.Plan, genre_of_take: dict[str, str], genre: str) -> float:
    """Share of the dance's seconds that are danced with takes of a genre."""
    return float(np.mean([genre_of_take[second.take] == genre for second in plan.seconds]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("--songs", type=Path, nargs="+", required=True)
    parser.add_argument("--candidates", type=int, nargs="+", default=[512, 64])
    given = parser.parse_args()
    shares = defaultdict(list)
    for seed, (path, file) in enumerate(zip(given.repertoires, given.songs, strict=True)):
        songs = find_songs(given.data, only=file.read_text(encoding="utf-8").split())
        genre_of_take = {take.name: take.credits.genre for take in cg.Repertoire.open(path).takes}
        with TemporaryDirectory() as folder:
            unlabelled = cg.Repertoire.open(without_genres(path, Path(folder)))
            for candidates in given.candidates:
                for selection, cost in WAYS:
                    config = cg.DanceConfig(
                        selection=selection, candidates=candidates, weights={"genre": cost}, seed=seed
                    )
                    made = [cg.dance(song.path, unlabelled, config=config) for song in songs]
                    genres = [song.take.credits.genre if song.take else "" for song in songs]
                    own = [
                        own_genre(m.plan, genre_of_take, genre) for m, genre in zip(made, genres, strict=True)
                    ]
                    shares[candidates, selection, cost].append(np.mean(own))
    print("| candidates | selection | weight of the cost | own genre |\n| --- | --- | --- | --- |")
    for (candidates, selection, cost), of in shares.items():
        print(f"| {candidates} | {selection} | {cost:g} | {np.mean(of):.2f} ± {np.std(of):.2f} |")


if __name__ == "__main__":
    main()
