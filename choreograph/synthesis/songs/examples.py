"""The example songs that come along: `python -m choreograph.synthesis.songs.examples` renders them anew."""

from __future__ import annotations

from pathlib import Path

from choreograph.starter import SONGS_PATH
from choreograph.synthesis.songs.song import SynthSong, render_song, write_song

_DURATION_S = 39.0
_COMPRESSION = 0.85  # about 85 kbit/s
_EXAMPLES = {  # file: genre, BPM, seed; apart from the takes' and the test bed's
    "house": ("house", 124.0, 2001),
    "cha-cha": ("cha-cha", 120.0, 2002),
    "waltz": ("waltz", 90.0, 2003),
}


def rendered_examples() -> dict[str, SynthSong]:
    """The examples by name, rendered."""
    return {
        name: render_song(genre, bpm=bpm, duration_s=_DURATION_S, seed=seed)
        for name, (genre, bpm, seed) in _EXAMPLES.items()
    }


def write_examples(folder: Path = SONGS_PATH) -> list[Path]:
    """Render all examples into a folder as Ogg Vorbis; the paths written."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, song in rendered_examples().items():
        paths.append(folder / f"{name}.ogg")
        write_song(paths[-1], song, compression_level=_COMPRESSION)
    return paths


if __name__ == "__main__":
    for path in write_examples():
        print(f"{path}  {path.stat().st_size / 1024:.0f} KB")
