"""AIST++: SMPL poses in `motions/*.pkl`, loaded by an unpickler that runs no code.

The names of the files state genre, performer and music, and so the tempo. A single file, and the same arrays
as NPZ, are read as well.
"""

from __future__ import annotations

import io
import pickle
import pickletools
import re
import struct
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.counts import DATA_SET, NO_COUNTS, Counts, make_counts, numbers_in_bar
from choreograph.core.errors import FormatError
from choreograph.core.files import read_bytes, read_text
from choreograph.formats.amass import rotated_world, smpl_motion
from choreograph.formats.axes_and_units import rotation_to_y_up
from choreograph.formats.folder import SongsByName
from choreograph.formats.manifest import SkippedFile, each_attempted
from choreograph.formats.npz import array_names
from choreograph.formats.npz import load_arrays as npz_arrays
from choreograph.motion.motion import Credits, Motion, Take

# A restricted unpickler.


_MAX_BYTES = 1 << 26
_MAX_OPCODES = 20_000  # an array takes about thirty
_MAX_MADE_BYTES = 1 << 31  # a call in a pickle makes at most as many bytes as the pickle has
_CALLS = ("REDUCE", "NEWOBJ", "NEWOBJ_EX", "INST", "OBJ", "BUILD")
_RECONSTRUCT = np.zeros(1).__reduce__()[0]
_SCALAR = np.float64(0).__reduce__()[0]
_FROM_BUFFER = np.zeros(1).__reduce_ex__(5)[0]


def _encode(text: str, encoding: str = "latin1") -> bytes:
    """Encode text as older pickles do. The full registry of codecs has more than text codecs."""
    if encoding not in ("latin1", "latin-1", "utf-8"):
        raise pickle.UnpicklingError(f"codec {encoding}")
    return text.encode(encoding)


# Before NumPy 2 the module was numpy.core. Both kinds of files exist.
_ALLOWED: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("_codecs", "encode"): _encode,
}
for _core in ("numpy.core", "numpy._core"):
    _ALLOWED[f"{_core}.multiarray", "_reconstruct"] = _RECONSTRUCT
    _ALLOWED[f"{_core}.multiarray", "scalar"] = _SCALAR
    _ALLOWED[f"{_core}.numeric", "_frombuffer"] = _FROM_BUFFER


class _ArraysOnly(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        try:
            return _ALLOWED[module, name]
        except KeyError:
            raise pickle.UnpicklingError(
                f"it refers to {module}.{name}, which is not an array and may run code"
            ) from None


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
        _check_opcodes(data)
        content = _ArraysOnly(io.BytesIO(data), encoding="latin1").load()
    except (
        pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, IndexError, AttributeError,
        MemoryError, OverflowError, struct.error, SystemError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(f"expected a pickle of arrays, got another: {reason}") from None
    if isinstance(content, np.ndarray) and content.dtype == object and content.size == 1:
        content = content.item()
    if not isinstance(content, dict):
        raise FormatError(f"expected a pickled dictionary of arrays, got {type(content).__name__}")
    for name, value in content.items():
        if not isinstance(name, str) or not isinstance(value, np.ndarray | np.generic | int | float | str):
            raise FormatError(
                f"expected arrays and numbers by name, got {type(value).__name__}: another pickle?"
            )
    arrays = [value for value in content.values() if isinstance(value, np.ndarray)]
    if sum(array.nbytes for array in arrays) > 2 * len(data):  # half of latin-1 text may be escaped
        raise FormatError("expected the numbers of the arrays in the pickle, got shapes without them")
    return content


def _check_opcodes(data: bytes) -> None:
    """Raise `UnpicklingError` if a pickle would need far more time or memory than its size suggests."""
    n_calls = 0
    for i, (opcode, argument, _) in enumerate(pickletools.genops(data)):
        n_calls += opcode.name in _CALLS
        is_far = "PUT" in opcode.name and (argument or 0) > _MAX_OPCODES
        if i > _MAX_OPCODES or n_calls * len(data) > _MAX_MADE_BYTES or is_far:
            raise pickle.UnpicklingError("it is larger or more complicated than a pickle of arrays")


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
        scaling = np.asarray(content["smpl_scaling"], np.float64)
        if scaling.size != 1 or not (np.isfinite(scaling).all() and scaling.item() > 0):
            raise FormatError(f"expected one positive smpl_scaling, got {scaling.tolist()}")
        trans = np.asarray(content["smpl_trans"], np.float64) / scaling.item()
        motion = smpl_motion(content["smpl_poses"], trans, FPS)
    except (FormatError, TypeError, ValueError) as error:
        raise FormatError(f"{file}: {error}") from None
    rotation, note = rotation_to_y_up(motion.skeleton, motion.joint_pos_m())
    return (rotated_world(motion, rotation), (note,)) if note else (motion, ())
