"""A folder of motion files, each a take, optionally with a song of the same name each, and a manifest.csv."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

from choreograph.core.errors import FormatError
from choreograph.formats import motion_suffixes, npz, reader_of
from choreograph.formats.c3d import is_c3d, read_c3d_files
from choreograph.formats.fbx import find_blender
from choreograph.formats.manifest import SONG_SUFFIXES, VIDEO_SUFFIXES, SkippedFile, attempted
from choreograph.motion.motion import Credits, Motion, Take
from choreograph.music.decoding import has_sound

LAYOUT = (
    "a folder of NAME.bvh, .c3d, .glb, .npz or, with Blender, .fbx, with NAME.wav|mp3|flac|ogg|m4a, or a "
    "video of that name, and an optional manifest.csv"
)
READS_BONE_MAP = True
_COPIES = (".npz", ".fbx")  # formats in which a motion is often kept besides another


def detect(path: Path) -> bool:
    """Whether `path` is a folder with a motion file in it."""
    return path.is_dir() and any(map(_is_motion, path.iterdir()))


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take | SkippedFile]:
    """The folder's takes by name, with the songs beside them; those of C3D files on one skeleton.

    Of two files of one name, NPZ and FBX are left to the other; any other is an error.
    """
    files = sorted(path.iterdir())
    songs = SongsByName(files)
    motions, others = _one_of_each_name(filter(_is_motion, files))
    yield from others
    captured = [file for file in motions if is_c3d(file)]
    fitted = dict(zip(captured, read_c3d_files(captured), strict=True))
    for file in motions:
        found = fitted[file] if file in fitted else attempted(partial(_read_motion, bone_map), file)
        if isinstance(found, SkippedFile):
            yield found
            continue
        motion, notes = found
        song = songs.of(file.stem)
        yield Take(
            name=file.stem,
            motion=motion,
            credits=Credits(),
            song_path=song,
            song_name=song.stem if song else "",
            source_paths=(file, song) if song else (file,),
            notes=notes,
        )


class SongsByName:
    """The audio files and videos of a folder by their names, from one listing of it."""

    def __init__(self, files: Iterable[Path]) -> None:
        self._songs: dict[str, Path] = {}
        self._videos: dict[str, list[Path]] = {}
        for file in files:
            suffix = file.suffix.lower()
            if suffix in SONG_SUFFIXES:
                self._songs.setdefault(file.stem, file)
            elif suffix in VIDEO_SUFFIXES:
                self._videos.setdefault(file.stem, []).append(file)

    @classmethod
    def in_folder(cls, folder: Path) -> SongsByName:
        """Those of a folder; none if there is no such folder."""
        return cls(sorted(folder.iterdir()) if folder.is_dir() else ())

    def of(self, name: str) -> Path | None:
        """The file NAME with an audio suffix (in any case), else a video with sound; None without one."""
        song = self._songs.get(name)
        return song or next((video for video in self._videos.get(name, ()) if has_sound(video)), None)


def _is_motion(path: Path) -> bool:
    """Whether the name is that of a motion file; an NPZ of other arrays is none, a damaged one is."""
    # Hidden files come from other programs, such as macOS's "._NAME.bvh".
    suffix = path.suffix.lower()
    if suffix not in motion_suffixes() or path.name.startswith("."):
        return False
    if suffix != ".npz":
        return True
    names = npz.array_names(path)
    return not names or "root_pos_m" in names


def _one_of_each_name(files: Iterable[Path]) -> tuple[list[Path], list[SkippedFile]]:
    """The files to read, by name, and those that have the name of another."""
    chosen: dict[str, Path] = {}
    others: list[SkippedFile] = []
    for file in sorted(files, key=lambda file: (file.suffix.lower() in _COPIES, file)):
        first = chosen.setdefault(file.stem, file)
        if first is file:
            continue
        if file.suffix.lower() in _COPIES:
            others.append(SkippedFile(file, "a motion of the same name is read"))
            continue
        error = FormatError(f"{file}: expected one motion of each name, got {first.name} as well")
        others.append(SkippedFile.damaged(file, error))
    if find_blender() is None:
        why = "FBX is read by way of Blender, and none was found: install it (blender.org), or export .glb"
        others += [SkippedFile(file, why) for file in chosen.values() if file.suffix.lower() == ".fbx"]
        chosen = {name: file for name, file in chosen.items() if file.suffix.lower() != ".fbx"}
    return [chosen[name] for name in sorted(chosen)], others


def _read_motion(bone_map: Mapping[str, str] | None, file: Path) -> tuple[Motion, tuple[str, ...]]:
    """The motion of a file of one, and notes."""
    reader = reader_of(file)
    reads_map = getattr(reader, "READS_BONE_MAP", False)
    takes = list(reader.read(file, bone_map) if reads_map else reader.read(file))
    if len(takes) > 1:
        names = ", ".join(take.name.removeprefix(f"{file.stem}-") for take in takes)
        raise FormatError(
            f"{file}: expected one animation of each file in a folder, got {names}: "
            "give the file by itself, or export them one by one"
        )
    return takes[0].motion, takes[0].notes
