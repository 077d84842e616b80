"""Build a repertoire from your own takes, and dance with it.

Run: python examples/01_own_library.py [TAKES [SONG]]

TAKES is a folder of NAME.bvh with NAME.wav (or mp3, flac, ogg, m4a). Default: two takes made here.
"""

import shutil
import sys
from pathlib import Path

import choreograph as cg


def example_takes(folder: Path) -> Path:
    """Two short takes and their songs, made with the built-in repertoire."""
    folder.mkdir(exist_ok=True)
    for name in ("house", "waltz"):
        song = cg.example_songs()[name]
        cg.dance(song, genre=name, duration_s=15.0).save(folder / f"{name}.bvh")
        shutil.copy(song, folder)
    return folder


def main(takes: str = "", song: str = "") -> None:
    folder = Path(takes) if takes else example_takes(Path("takes"))
    # The built-in networks as they are: ready in seconds. Leave both options out to train on your takes.
    networks = cg.starter_repertoire().path
    built = cg.build(folder, "rep.h5", init_from=networks, keep_networks=True)
    print(f"{built.path}: {len(built.repertoire.takes)} takes", *built.notes, sep="\n  ")
    dance = cg.dance(song or cg.example_songs()["cha-cha"], "rep.h5", duration_s=10.0)
    dance.save("own.bvh")
    print("seconds of each take:", {name: round(s, 1) for name, s in dance.plan.takes_s().items()})


if __name__ == "__main__":
    main(*sys.argv[1:])
