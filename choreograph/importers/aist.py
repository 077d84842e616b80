"""AIST++: SMPL poses in `motions/*.pkl`; file names state genre, performer and music.

Also one of these files alone, and the same arrays as NPZ.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from choreograph.errors import FormatError
from choreograph.files import read_text
from choreograph.importers._axes_and_units import rotation_to_y_up
from choreograph.importers._pickles import load_arrays
from choreograph.importers._smpl import rotated_world, smpl_motion
from choreograph.importers._unread import Unread, attempted
from choreograph.importers.folder import SongsByName
from choreograph.importers.npz import array_names
from choreograph.importers.npz import load_arrays as npz_arrays
from choreograph.motion.motion import Motion
from choreograph.takes import Credits, Take

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


def detect(path: Path) -> bool:
    """Whether `path` holds pickles in `motions/`, or is one such file."""
    if path.is_file():
        suffix = path.suffix.lower()
        return suffix == ".pkl" or (suffix == ".npz" and array_names(path).issuperset(_KEYS))
    return any((path / "motions").glob("[!.]*.pkl"))


def read(path: Path) -> Iterator[Take | Unread]:
    """The takes by name, without those in `ignore_list.txt` (badly reconstructed according to AIST++)."""
    if path.is_file():
        yield attempted(partial(_take, _songs_in(path.parent)), path)
        return
    ignored = set()
    if (path / "ignore_list.txt").is_file():
        ignored = set(read_text(path / "ignore_list.txt", "a list of takes", fallback="latin-1").split())
    songs = _songs_in(path)
    for file in sorted((path / "motions").glob("[!.]*.pkl")):
        if file.stem in ignored:
            yield Unread(file, "in ignore_list.txt")
        else:
            yield attempted(partial(_take, songs), file)


def _songs_in(path: Path) -> list[SongsByName]:
    return [SongsByName.in_folder(path / folder) for folder in ("music", "wav", "audio")]


def _take(songs: Sequence[SongsByName], file: Path) -> Take:
    motion, notes = _motion(file)
    named = _NAME.fullmatch(file.stem)
    if named is None:
        notes += ("the file name does not state genre, performer and music",)
    parts = named.groupdict() if named else {"genre": "", "performer": "", "song": ""}
    song = next(filter(None, (folder.of(parts["song"]) for folder in songs)), None)
    return Take(
        name=file.stem,
        motion=motion,
        credits=Credits(_GENRES.get(parts["genre"], parts["genre"]), parts["performer"], source="AIST++"),
        song_path=song,
        song_name=parts["song"],
        source_paths=(file, song) if song else (file,),
        notes=notes,
    )


def _motion(file: Path) -> tuple[Motion, tuple[str, ...]]:
    content = npz_arrays(file, _KEYS) if file.suffix.lower() == ".npz" else load_arrays(file)
    missing = [key for key in _KEYS if key not in content]
    if missing:
        raise FormatError(f"{file}: expected {', '.join(_KEYS)}, got no {', '.join(missing)}")
    try:
        scaling = np.asarray(content["smpl_scaling"], np.float64)
        if scaling.size != 1 or not (np.isfinite(scaling).all() and scaling.item() > 0):
            raise FormatError(f"expected one positive smpl_scaling, got {scaling.tolist()}")
        trans = np.asarray(content["smpl_trans"], np.float64) / scaling.item()
        motion = smpl_motion(content["smpl_poses"], trans, FPS)
    except (FormatError, TypeError, ValueError) as error:
        raise FormatError(f"{file}: {error}") from None
    rotation, note = rotation_to_y_up(motion.skeleton, motion.joint_pos_m())
    return (rotated_world(motion, rotation), (note,)) if note else (motion, ())
