"""Dances of an evaluation, kept until it is complete: one that was stopped goes on where it was.

What takes long is dancing. Of each dance its motion, its plan and its notes are kept in a folder; it is
measured again when the evaluation goes on, so that the results are those of an evaluation without a stop. A
dance is found by what it was made of: the bytes of song and repertoire, the part of the song, the variant's
settings, the seed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from choreograph.errors import ChoreographError
from choreograph.evaluation.songs import EvaluatedSong
from choreograph.evaluation.variants import Variant
from choreograph.exporters import save_motion
from choreograph.files import atomic_path, sha256_of
from choreograph.importers.npz import read_npz
from choreograph.locked_folder import locked_folder
from choreograph.pipeline import Dance
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire

_DIGITS = 32  # of the checksum that a dance's files are named by
_NAME = "?" * _DIGITS


class KeptDances:
    """The dances in a folder; open it with `kept_dances`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._checksums: dict[Path, str] = {}  # of songs and repertoires

    def __len__(self) -> int:
        return len(list(self._folder.glob(f"{_NAME}.json"))) if self._folder.exists() else 0

    def find(self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire) -> Dance | None:
        """The dance, if it was kept; a damaged one is not found."""
        path = self._path(song, variant, seed, repertoire)
        if not path.exists():
            return None
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
            motion = read_npz(path.with_suffix(".npz"))
            plan = Plan.from_json(json.dumps(stored["plan"]), name=str(path))
            return Dance(motion, plan, tuple(map(str, stored["notes"])), song.path)
        except (OSError, ValueError, KeyError, TypeError, ChoreographError):
            return None

    def keep(
        self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire, dance: Dance
    ) -> None:
        """Keep a dance; `ChoreographError` if it cannot be written."""
        path = self._path(song, variant, seed, repertoire)
        save_motion(path.with_suffix(".npz"), dance.motion)
        text = json.dumps({"plan": json.loads(dance.plan.to_json()), "notes": dance.notes})
        with atomic_path(path) as temporary:  # last: with it, the dance is complete
            temporary.write_text(text, encoding="utf-8")

    def clear(self) -> None:
        """Remove all dances, and what killed processes left of them."""
        for pattern in (f"{_NAME}.json", f"{_NAME}.npz", f".{_NAME}.*"):
            for path in self._folder.glob(pattern):
                path.unlink(missing_ok=True)

    def _path(self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire) -> Path:
        made_of = {
            "choreograph": version("choreograph"),
            "song": self._checksum(song.path),
            "part_s": [song.start_s, song.duration_s],
            "repertoire": self._checksum(repertoire.path),
            "variant": asdict(variant),
            "seed": seed,
        }
        digest = hashlib.sha256(json.dumps(made_of, sort_keys=True, default=str).encode()).hexdigest()
        return self._folder / f"{digest[:_DIGITS]}.json"

    def _checksum(self, path: Path) -> str:
        if path not in self._checksums:
            self._checksums[path] = sha256_of(path)
        return self._checksums[path]


@contextmanager
def kept_dances(folder: Path, *, resume: bool, doing: str) -> Iterator[KeptDances]:
    """The dances kept in `folder` while the block runs, removed when it ends without an error.

    Without `resume` those of an evaluation that was stopped are removed first. Raises `ChoreographError` if
    another process evaluates there; `doing` tells it what this one does.
    """
    with locked_folder(folder, doing=doing):
        kept = KeptDances(folder)
        if not resume:
            kept.clear()
        yield kept
        kept.clear()
