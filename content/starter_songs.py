"""Recipe of the shipped songs: `python -m content.starter_songs` renders them again."""

from __future__ import annotations

from pathlib import Path

from choreograph.library.builtin import SONGS_PATH
from content.songs.synthesis.song import SyntheticSong, render_song, write_song

_DURATION_S = 39.0
_COMPRESSION = 0.85  # about 85 kbit/s
_SONGS = {  # file: genre, BPM, seed. The seeds differ from those of takes and benchmark songs
    "house": ("house", 124.0, 2001),
    "cha-cha": ("cha-cha", 120.0, 2002),
    "waltz": ("waltz", 90.0, 2003),
}


def render_example_songs() -> dict[str, SyntheticSong]:
    """Render the example songs, by name."""
    return {
        name: render_song(genre, bpm=bpm, duration_s=_DURATION_S, seed=seed)
        for name, (genre, bpm, seed) in _SONGS.items()
    }


def write_example_songs(folder: Path = SONGS_PATH) -> list[Path]:
    """Render the example songs into a folder as Ogg Vorbis. Returns the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, song in render_example_songs().items():
        paths.append(folder / f"{name}.ogg")
        write_song(paths[-1], song, compression_level=_COMPRESSION)
    return paths


if __name__ == "__main__":
    for path in write_example_songs():
        print(f"{path}  {path.stat().st_size / 1024:.0f} KB")
