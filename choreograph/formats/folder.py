"""A folder of motion files, each a take, with optional songs of the same names and a manifest.csv."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

from choreograph.core.errors import FormatError
from choreograph.formats import c3d, motion_suffixes, npz, reader_of
from choreograph.formats.fbx import find_blender
from choreograph.formats.manifest import SONG_SUFFIXES, VIDEO_SUFFIXES, SkippedFile, each_attempted
from choreograph.motion.motion import Credits, Motion, Take
from choreograph.music.decoding import has_sound

LAYOUT = (
    "a folder of such files, each with an optional NAME.wav|mp3|flac|ogg|m4a or a video of its name, and an "
    "optional manifest.csv"
)
READS_BONE_MAP = True
_COPIES = (".npz", ".fbx")  # formats in which a motion is often kept beside another file of it


def detect(path: Path) -> bool:
    """Whether `path` is a folder with a motion file in it."""
    return path.is_dir() and any(map(_is_motion, path.iterdir()))


def read(path: Path, bone_map: Mapping[str, str] | None = None) -> Iterator[Take | SkippedFile]:
    """The takes of the folder by name, with the songs beside them. C3D files share one skeleton.

    Of two files of one name, an NPZ or FBX is skipped. Other pairs are an error.
    """
    files = sorted(path.iterdir())
    songs = SongsByName(files)
    motions, others = _one_of_each_name(filter(_is_motion, files))
    yield from others
    captured = [file for file in motions if file.suffix.lower() in c3d.SUFFIXES]
    fitted = dict(zip(captured, c3d.read_c3d_files(captured), strict=True))
    others_read = each_attempted((partial(_read_motion, bone_map), f) for f in motions if f not in fitted)
    for file in motions:
        found = fitted[file] if file in fitted else next(others_read)
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
    """The audio files and videos of a folder by name, from one listing of it."""

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
        """The songs of a folder, none if the folder does not exist."""
        return cls(sorted(folder.iterdir()) if folder.is_dir() else ())

    def of(self, name: str) -> Path | None:
        """The audio file of a name (suffix in any case), else a video with sound, else None."""
        song = self._songs.get(name)
        return song or next((video for video in self._videos.get(name, ()) if has_sound(video)), None)


def _is_motion(path: Path) -> bool:
    """Whether a file is a motion by its name. A damaged NPZ is one, an NPZ with other arrays is not."""
    # Hidden files come from other programs, such as "._NAME.bvh" of macOS.
    suffix = path.suffix.lower()
    if suffix not in motion_suffixes() or path.name.startswith("."):
        return False
    if suffix != ".npz":
        return True
    names = npz.array_names(path)
    return not names or "root_pos_m" in names


def _one_of_each_name(files: Iterable[Path]) -> tuple[list[Path], list[SkippedFile]]:
    """The files to read, by name, and those with the name of another file."""
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
        why = "FBX is read with Blender, which was not found: install it (blender.org), or export .glb"
        others += [SkippedFile(file, why) for file in chosen.values() if file.suffix.lower() == ".fbx"]
        chosen = {name: file for name, file in chosen.items() if file.suffix.lower() != ".fbx"}
    return [chosen[name] for name in sorted(chosen)], others


def _read_motion(bone_map: Mapping[str, str] | None, file: Path) -> tuple[Motion, tuple[str, ...]]:
    """The motion of a file that holds one, and notes."""
    reader = reader_of(file)
    reads_map = getattr(reader, "READS_BONE_MAP", False)
    takes = list(reader.read(file, bone_map) if reads_map else reader.read(file))
    if len(takes) > 1:
        names = ", ".join(take.name.removeprefix(f"{file.stem}-") for take in takes)
        raise FormatError(
            f"{file}: expected one animation in each file of a folder, got {names}: "
            "pass the file by itself, or export them one by one"
        )
    return takes[0].motion, takes[0].notes
