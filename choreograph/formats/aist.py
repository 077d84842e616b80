"""AIST++: SMPL poses in `motions/*.pkl`, read by `core.pickles`, which runs no code.

The names of the files state genre, performer and music, and so the tempo. A single file, and the same arrays
as NPZ, are read as well.
"""

from __future__ import annotations

import pickle
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.counts import DATA_SET, NO_COUNTS, Counts, make_counts, numbers_in_bar
from choreograph.core.errors import FormatError
from choreograph.core.files import BUDGETS, read_bytes, read_text
from choreograph.core.pickles import unpickled
from choreograph.formats.amass import numbers_of, rotated_world, smpl_motion
from choreograph.formats.axes_and_units import rotation_to_y_up
from choreograph.formats.folder import SongsByName
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.formats.npz import array_names
from choreograph.formats.npz import load_arrays as npz_arrays
from choreograph.motion.motion import Credits, Motion, Take

# Pickles of arrays.


_MAX_BYTES = BUDGETS["pkl"].file_bytes


def load_arrays(path: Path) -> dict[str, Any]:
    """The dictionary of arrays and numbers in a pickle. Raises as `arrays_of`."""
    data = read_bytes(path, "a pickle of arrays", max_bytes=_MAX_BYTES)
    try:
        return arrays_of(data)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from None


def has_scaling(path: Path) -> bool:
    """Whether a pickle has the scaling that those of AIST++ have."""
    try:
        return b"smpl_scaling" in read_bytes(path, "a pickle of arrays", max_bytes=_MAX_BYTES)
    except FormatError:
        return False


def arrays_of(data: bytes) -> dict[str, Any]:
    """The dictionary of arrays and numbers that is pickled in `data`, perhaps as an array of one object.

    Raises `FormatError` if it contains anything else, or if its arrays would be larger than the data.
    """
    try:
        content = unpickled(data)
    except pickle.UnpicklingError as error:
        raise FormatError(f"expected a pickle of arrays, got another: {error}") from None
    if not isinstance(content, dict):
        raise FormatError(f"expected a pickled dictionary of arrays, got {type(content).__name__}")
    for name, value in content.items():
        if not isinstance(name, str) or not isinstance(value, np.ndarray | np.generic | int | float | str):
            raise FormatError(
                f"expected arrays and numbers by name, got {type(value).__name__}: another pickle?"
            )
    return content


# Takes.


LAYOUT = (
    "AIST++: a folder with motions/*.pkl, songs in music/, wav/ or audio/, and ignore_list.txt, or one of "
    "the pickles"
)
FPS = 60.0
_NAME = re.compile(r"g(?P<genre>[A-Z]{2})_s[^_]+_c[^_]+_(?P<performer>d\d+)_(?P<song>m[A-Z]{2}\d+)_ch\d+")
_GENRES = {
    "BR": "break", "PO": "pop", "LO": "lock", "MH": "middle hip-hop", "LH": "LA hip-hop", "HO": "house",
    "WA": "waack", "KR": "krump", "JS": "street jazz", "JB": "ballet jazz",
}  # fmt: skip
_KEYS = ("smpl_poses", "smpl_trans", "smpl_scaling")
# The music of a genre has six pieces, numbered by tempo, and a dance begins on count 1 of its piece.
_BPM = (80.0, 90.0, 100.0, 110.0, 120.0, 130.0)
_HOUSE_BPM = (110.0, 115.0, 120.0, 125.0, 130.0, 135.0)
_METRE = 4
_WHOLE_BAR_COUNTS = 0.25  # dances last whole bars: a length farther from that shows another tempo or begin
_CONFIDENCE = 0.9  # of counts by the name. The tempo is sure, the begin of each recording was not verified


def detect(path: Path) -> bool:
    """Whether `path` is a folder with pickles in `motions/`, or one such file."""
    if path.is_file():
        suffix = path.suffix.lower()
        return (suffix == ".pkl" and has_scaling(path)) or (
            suffix == ".npz" and array_names(path).issuperset(_KEYS)
        )
    return any((path / "motions").glob("[!.]*.pkl"))


def read(path: Path) -> Iterator[Take | SkippedFile]:
    """The takes by name. Those in `ignore_list.txt`, which are badly reconstructed, are skipped."""
    if path.is_file():
        yield from each_attempted([(partial(_take, _song_of(path, _songs_in(path.parent))), path)])
        return
    ignored = set()
    if (path / "ignore_list.txt").is_file():
        ignored = set(read_text(path / "ignore_list.txt", "a list of takes", fallback="latin-1").split())
    files = sorted((path / "motions").glob("[!.]*.pkl"))
    songs = _songs_in(path)
    read = each_attempted(
        (partial(_take, _song_of(file, songs)), file) for file in files if file.stem not in ignored
    )
    for file in files:
        yield SkippedFile(file, "in ignore_list.txt") if file.stem in ignored else next(read)


def _songs_in(path: Path) -> list[SongsByName]:
    return [SongsByName.in_folder(path / folder) for folder in ("music", "wav", "audio")]


def _song_of(file: Path, songs: Sequence[SongsByName]) -> Path | None:
    """The song that the name of a file states, if it is in one of the folders."""
    named = _NAME.fullmatch(file.stem)
    name = named["song"] if named else ""
    return next(filter(None, (folder.of(name) for folder in songs)), None)


def _take(song: Path | None, file: Path) -> Take:
    motion, notes = _motion(file)
    named = _NAME.fullmatch(file.stem)
    if named is None:
        notes += ("the file name does not state genre, performer and music",)
    parts = named.groupdict() if named else {"genre": "", "performer": "", "song": ""}
    counts = counts_by_name(parts["song"], motion.n_frames / motion.fps)
    if parts["song"] and not len(counts):
        notes += (f"not counted by its name: it does not last whole bars at the tempo of {parts['song']}",)
    return Take(
        name=file.stem,
        motion=motion,
        credits=Credits(_GENRES.get(parts["genre"], parts["genre"]), parts["performer"], source="AIST++"),
        song_path=song,
        song_name=parts["song"],
        source_paths=(file, song) if song else (file,),
        notes=notes,
        counts=counts,
    )


def counts_by_name(song: str, duration_s: float) -> Counts:
    """The counts of a take of `duration_s` to a piece of music such as mBR0, from its first frame.

    None if the piece is not known, or the take does not last a whole number of bars at its tempo.
    """
    number = int(song[3:]) if song else len(_BPM)
    if number >= len(_BPM):
        return NO_COUNTS
    bpm = (_HOUSE_BPM if song[1:3] == "HO" else _BPM)[number]
    n_counts = duration_s * bpm / 60.0
    bars = round(n_counts / _METRE)
    if not bars or abs(n_counts - bars * _METRE) > _WHOLE_BAR_COUNTS:
        return NO_COUNTS
    times_s = np.arange(bars * _METRE + 1) * 60.0 / bpm  # the end of the last bar is a count as well
    n_within = int(np.searchsorted(times_s, duration_s, side="right"))
    return make_counts(
        times_s[:n_within], numbers_in_bar(n_within, _METRE), _METRE, source=DATA_SET, confidence=_CONFIDENCE
    )


def _motion(file: Path) -> tuple[Motion, tuple[str, ...]]:
    content = npz_arrays(file, _KEYS) if file.suffix.lower() == ".npz" else load_arrays(file)
    missing = [key for key in _KEYS if key not in content]
    if missing:
        raise FormatError(f"{file}: expected {', '.join(_KEYS)}, got no {', '.join(missing)}")
    try:
        scaling = numbers_of(content["smpl_scaling"])
        if scaling.size != 1 or not (np.isfinite(scaling).all() and scaling.item() > 0):
            got = scaling.item() if scaling.size == 1 else f"an array of shape {scaling.shape}"
            raise FormatError(f"expected one positive smpl_scaling, got {got}")
        with np.errstate(over="ignore"):  # such positions are refused
            trans = numbers_of(content["smpl_trans"]) / scaling.item()
        motion = smpl_motion(content["smpl_poses"], trans, FPS)
    except (FormatError, TypeError, ValueError) as error:
        raise FormatError(f"{file}: {error}") from None
    rotation, note = rotation_to_y_up(motion.skeleton, motion.joint_pos_m())
    return (rotated_world(motion, rotation), (note,)) if note else (motion, ())
