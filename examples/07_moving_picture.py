"""Make a moving picture of a dance. examples/dance.webp was made with this script.

Run: python examples/07_moving_picture.py [SONG [OUT.webp]]      (.gif and .png are written as well)
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import av
from PIL import Image

import choreograph as cg

SIZE, FPS, DURATION_S = (640, 360), 15, 4.0


def frames_of(video: Path) -> list[Image.Image]:
    """Every other picture of a video at 30 fps, smaller."""
    with av.open(str(video)) as container:
        pictures = [frame.to_image() for frame in container.decode(video=0)]
    return [picture.resize(SIZE, Image.Resampling.LANCZOS) for picture in pictures[:: 30 // FPS]]


def main(song: str = "", out: str = "dance.webp") -> None:
    dance = cg.dance(song or cg.example_songs()["house"], genre="house", start_s=8.0, duration_s=DURATION_S)
    with TemporaryDirectory() as folder:
        video = Path(folder, "dance.mp4")
        dance.save(video)
        first, *others = frames_of(video)
    first.save(out, save_all=True, append_images=others, duration=round(1000 / FPS), loop=0, quality=75)
    print(f"{out}: {1 + len(others)} pictures, {Path(out).stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
