"""Readers take time in proportion to a file: below n^1.2 from 10 kB to 10 MB, sane files and hostile ones."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from growing_files import (
    BVH,
    C3D,
    FEW,
    GLTF,
    JSON,
    OF_CHARACTERS,
    SONGS,
    TABLE,
    Bytes,
    aist,
    amass,
    character,
    npz,
    npz_of_names,
    numbered,
    points,
    repeated,
    text_of_pickle,
    vmd,
    vrma,
)
from synthetic_motions import swaying

from choreograph.choreography.constraints import read_motifs, read_signature
from choreograph.core.errors import ChoreographError
from choreograph.formats.c3d import read_markers
from choreograph.formats.choreonet import read_choreographies, read_recorded_figures
from choreograph.formats.dance_with_melody import read_points_m
from choreograph.formats.manifest import read_counts
from choreograph.formats.register import import_takes, save_motion
from choreograph.motion.bone_map import read_bone_map
from choreograph.music.beats import read_beats
from choreograph.music.song import load_song
from choreograph.plan.plan import Plan
from choreograph.settings import load_config

SIZES = (10_000, 100_000, 1_000_000, 10_000_000)  # bytes
LARGEST_SLOPE = 1.2  # over all sizes
LARGEST_STEP = 10**LARGEST_SLOPE  # from a size to ten times as much
# Their arrays leave the processor's cache: up to 10^1.4 from 1 to 10 MB, and below 10^0.9 before.
LONG_MOTIONS = {(reader, "sane"): 25.0 for reader in ("AMASS", "AIST++", "glTF", "VRMA")}
LEAST_S = 0.08  # below it, what each file takes and the clock count for more than its size
LONGEST_S = 0.3  # hostile files that would take longer are left out, to keep the tests short


@dataclass(frozen=True)
class Reader:
    """What reads a file, and files of it of any size."""

    file_name: str
    read: Callable[[Path], object]
    files: dict[str, Bytes]
    prepare: Callable[[Path], object] | None = None  # writes what belongs beside the file into its folder


def takes(path: Path) -> None:
    list(import_takes(path))


def takes_beside(path: Path) -> None:
    takes(path.parent)


def with_a_take(folder: Path) -> None:
    save_motion(folder / "take.bvh", swaying(20))


READERS = {
    "BVH": Reader("take.bvh", takes, BVH),
    "NPZ": Reader("take.npz", takes, {"sane": npz, "names": npz_of_names, "zeros": repeated(b"\0")}),
    "AMASS": Reader("take.npz", takes, {"sane": amass}),
    "AIST++": Reader(
        "motions/a.pkl",
        lambda path: takes(path.parents[1]),
        {
            "sane": aist, "a text": text_of_pickle, "marks": repeated("("), "zeros": repeated(b"\0"),
            "lists": repeated("]"), "memos": repeated("]q\0", b"\x80\2"), "pops": repeated("]0", b"\x80\2"),
        },
    ),
    "glTF": Reader("take.glb", takes, GLTF),
    "VRMA": Reader("take.vrma", takes, {"sane": vrma}),
    "VMD": Reader("take.vmd", takes, {"sane": vmd}),
    "character": Reader("a.glb", character, {shape: GLTF[shape] for shape in OF_CHARACTERS}),
    "C3D": Reader("take.c3d", read_markers, C3D),
    "counts": Reader("a.counts.csv", read_counts, {
        "sane": numbered("%d.5,1,\n", "time_s,number,figure\n"), **TABLE}),
    "beats": Reader("a.beats", read_beats, {
        "sane": numbered("%d.5 1\n"), "comments": repeated("#\n"), **TABLE}),
    "manifest": Reader("manifest.csv", takes_beside, {
        "sane": repeated(" ", "name,genre\ntake,", "waltz\n"),
        "rows": repeated("take,waltz\n", "name,genre\n"), "names": numbered("%d,waltz\n", "name,genre\n"),
        "columns": numbered("a%d,", "name,"), **TABLE}, with_a_take),
    "figures": Reader("figures.csv", read_recorded_figures, {
        "sane": numbered("rec,C-1,%d,9999999,4\n", "c3d_file,movement_tag,start_frame,end_frame,beats\n"),
        "quotes": TABLE["quotes"]}),
    "plan": Reader("plan.json", Plan.read, JSON),
    "bone map": Reader("map.json", read_bone_map, FEW),
    "signature": Reader("signature.json", read_signature, FEW),
    "motifs": Reader("motifs.json", read_motifs, FEW),
    "choreographies": Reader("choreographies.json", read_choreographies, FEW),
    "config": Reader("config.toml", load_config, {
        "keys": numbered("a%d = 1\n"), "tables": numbered("[a%d]\n")}),
    "dance-with-melody": Reader("skeletons.json", read_points_m, {"sane": points, **FEW}),
    "songs": Reader("song.mp3", load_song, SONGS),
}  # fmt: skip
CASES = [(reader, shape) for reader, of in READERS.items() for shape in of.files]


def cpu_s(reader: Reader, path: Path) -> float:
    """The least CPU time of two runs, of one where it takes long.

    The garbage collector, whose passes look at all that the tests hold as well, does not run.
    """
    least_s = np.inf
    gc.disable()
    try:
        for _ in range(2):
            began_s = time.process_time()
            with suppress(ChoreographError):
                reader.read(path)
            least_s = min(least_s, time.process_time() - began_s)
            if least_s > 0.2:
                break
    finally:
        gc.enable()
    return least_s


def times_s(reader: Reader, make: Bytes, folder: Path, longest_s: float, largest_step: float) -> list[float]:
    """CPU times of files of the sizes in turn, up to where one took too long or the next would."""
    path = folder / reader.file_name
    path.parent.mkdir(exist_ok=True)
    if reader.prepare is not None:
        reader.prepare(folder)
    cpu_s(reader, _written(path, make(SIZES[0])))  # compiles and loads
    found: list[float] = []
    for size in SIZES:
        found.append(max(LEAST_S, cpu_s(reader, _written(path, make(size)))))
        if len(found) > 1 and (10 * found[-1] > longest_s or found[-1] > largest_step * found[-2]):
            break
    return found


def _written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("reader", "shape"), CASES)
def test_time_grows_with_the_size(tmp_path, reader, shape):
    of, step = READERS[reader], LONG_MOTIONS.get((reader, shape), LARGEST_STEP)
    found = times_s(of, of.files[shape], tmp_path, np.inf if shape == "sane" else LONGEST_S, step)
    told = ", ".join(f"{time_s:.2f} s" for time_s in found)
    assert all(later < step * time_s for time_s, later in pairwise(found)), told
    assert found[-1] < found[0] * 10 ** (LARGEST_SLOPE * (len(found) - 1)), told
