"""The service of the studio: the session, its jobs, its news for pages, and files for as long as it runs."""

from __future__ import annotations

import asyncio
import json
import os
import tempfile
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any, get_args

from choreograph.characters.character import GltfCharacter, read_character
from choreograph.choreography.scenes import FORMATIONS
from choreograph.core.errors import ChoreographError
from choreograph.core.files import locked_folder
from choreograph.library.repertoire import Repertoire
from choreograph.plan.scenes import MOST_DANCERS
from choreograph.studio.dance_json import Palette, character_facts, weight_choices
from choreograph.studio.exports import EXPORTED, exports_of_each
from choreograph.studio.jobs import Job, Jobs
from choreograph.studio.project import ENGINES, RELATIONS, EditKind
from choreograph.studio.refusals import NotFoundError
from choreograph.studio.studio_session import StudioSession
from choreograph.view.page import deflate_base64
from choreograph.view.sound import Levels, encode_mp4, song_part

_LEVELS_PER_S = 50
_SCRATCH, _LOCK = "choreograph-studio-", "lock"  # names of temporary folders, and of the lock in each
_BEGINS_S = 60.0  # in which a studio that has made its lock surely holds it


class News:
    """Sends news to all pages that listen, and a sign of life every `beat_s` seconds without news."""

    def __init__(self, beat_s: float = 15.0) -> None:
        self._beat_s = beat_s
        self._lock = threading.Lock()
        self._listeners: list[tuple[asyncio.AbstractEventLoop, asyncio.Queue[dict[str, Any]]]] = []

    def tell(self, news: dict[str, Any]) -> None:
        """Send news from any thread."""
        with self._lock:
            for loop, waiting in self._listeners:
                if not loop.is_closed():
                    loop.call_soon_threadsafe(waiting.put_nowait, news)

    async def stream(self) -> AsyncIterator[str]:
        """Server-sent events, until the page no longer listens."""
        listener = asyncio.get_running_loop(), asyncio.Queue[dict[str, Any]]()
        with self._lock:
            self._listeners.append(listener)
        try:
            yield ": welcome\n\n"
            while True:
                try:
                    news = await asyncio.wait_for(listener[1].get(), self._beat_s)
                except TimeoutError:
                    yield ": alive\n\n"
                    continue
                yield f"data: {json.dumps(news)}\n\n"
        finally:
            with self._lock:
                self._listeners.remove(listener)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A temporary folder that is removed at the end. Those that killed studios left are removed first.

    A running studio holds the lock in its folder.
    """
    for lock in Path(tempfile.gettempdir()).glob(f"{_SCRATCH}*/{_LOCK}"):
        with suppress(ChoreographError, OSError):
            if time.time() - lock.stat().st_mtime > _BEGINS_S:
                with locked_folder(lock, doing="removes what a studio left"):
                    rmtree(lock.parent, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix=_SCRATCH))
    try:
        with locked_folder(folder / _LOCK, doing="is a studio"):
            yield folder
    finally:
        rmtree(folder, ignore_errors=True)


@dataclass(frozen=True)
class Sound:
    """The song as pages play and draw it."""

    path: Path  # AAC in MP4
    levels: str  # as in the page of `choreograph dance`
    levels_per_s: float


class Service:
    """One studio, which serves any number of pages."""

    def __init__(self, folder: Path, repertoire: Repertoire) -> None:
        self.studio = StudioSession(folder, repertoire)
        self.news = News()
        self.jobs = Jobs(
            lambda job: self.news.tell({"job": job.facts | {"result": None, "log": job.log[-1:]}}), self.said
        )
        self._open = ExitStack()
        self.scratch = self._open.enter_context(scratch_folder())
        self._sound: tuple[Path, Sound] | None = None
        self._palette: tuple[Repertoire, Palette] | None = None
        self.character: GltfCharacter | None = None
        self.exports: dict[str, Path] = {}
        self._lock = threading.Lock()

    def close(self) -> None:
        """End all jobs, and release the project."""
        self.jobs.close()
        self.studio.close()
        self._open.close()

    def said(self, error: BaseException) -> str:
        """What pages show of an error, which names files without the folder of the project."""
        return str(error).replace(f"{self.studio.folder}{os.sep}", "")

    def change(self, kind: str, work: Callable[[Job], object]) -> Job:
        """Begin a job that changes the dance. Its result is the new revision."""
        return self.jobs.start(kind, lambda job: self._told(work, job))

    def change_now(self, kind: str, work: Callable[[Job], object]) -> dict[str, Any]:
        """Change something in the order of the jobs, and return the new state."""
        self.jobs.do(kind, lambda job: self._told(work, job))
        return self.state()

    async def soon(self, kind: str, work: Callable[[Job], object]) -> dict[str, Any]:
        """As `change_now`, for functions that must not wait."""
        return await asyncio.to_thread(self.change_now, kind, work)

    def _told(self, work: Callable[[Job], object], job: Job) -> dict[str, Any]:
        work(job)
        revision = self.studio.project.revision
        self.news.tell({"state": revision})
        return {"revision": revision}

    def sound(self) -> Sound:
        """The song of the project, encoded once. Raises `NotFoundError` without one, else `FormatError`."""
        song = self.studio.song()
        assert song.path is not None  # it was read from a file
        with self._lock:
            if self._sound is None or self._sound[0] != song.path:
                levels = Levels(_LEVELS_PER_S)
                part = song_part(song.path, start_s=song.start_s, duration_s=song.duration_s)
                path = self.scratch / "song.mp4"
                path.write_bytes(encode_mp4(levels.through(part)))
                planes = deflate_base64(levels.to_bytes().T.tobytes())
                self._sound = song.path, Sound(path, planes, levels.bins_per_s)
            return self._sound[1]

    def palette(self) -> Palette:
        """The palette of the repertoire, measured once."""
        repertoire = self.studio.state.repertoire
        with self._lock:
            if self._palette is None or self._palette[0] is not repertoire:
                self._palette = repertoire, Palette(repertoire)
            return self._palette[1]

    def use_character(self, character: GltfCharacter) -> None:
        """Show a character from now on, and note it in the project."""
        path = Path(character.document.name)
        beside = path.parent.resolve() == self.studio.folder.resolve()
        bones = {joint: character.rig.names[bone] for joint, bone in character.bones.items()}
        self.studio.keep_character(path.name if beside else "", bones)
        self.character = character

    def shown_character(self) -> GltfCharacter:
        """The character that is shown. Raises `NotFoundError` if there is none."""
        if self.character is None:
            raise NotFoundError("expected a character, got none yet: send one first")
        return self.character

    def restore_character(self) -> None:
        """Show the character of the project, unless another is shown or its file is missing."""
        project = self.studio.project
        name = Path(project.character).name
        path = self.studio.folder / name
        if self.character is None and name and name == project.character and path.is_file():
            self.character = read_character(path, dict(project.bones) or None)

    def state(self) -> dict[str, Any]:
        """What pages show, as JSON."""
        studio, state = self.studio, self.studio.state
        project, song = state.project, state.song
        takes = state.repertoire.takes
        genres = sorted({take.credits.genre for take in takes} - {""})
        settings = project.settings
        return {
            "revision": project.revision,
            "project": {"name": project.song, "file": None if studio.file is None else studio.file.name},
            "song": None if song is None else {"name": song.name, "duration_s": round(song.duration_s, 6)},
            "repertoire": {
                "name": state.repertoire.path.name, "takes": len(takes), "clips": state.repertoire.n_clips,
                "genres": genres, "names": studio.repertoires.names(studio.folder),
            },
            "settings": {
                "engine": settings.engine, "seed": settings.seed, "genre": settings.genre,
                "dynamics": settings.dynamics, "front": settings.front, "stage": settings.stage,
                "weights": dict(settings.weights), "bans": list(settings.bans), "dancers": settings.dancers,
                "formation": list(settings.formation), "relation": list(settings.relation),
            },
            "scene": None if state.scene is None else {"notes": list(state.scene.planned.notes)},
            "choices": {
                "engines": list(ENGINES), "genres": genres, "fronts": ["audience", "free"],
                "weights": weight_choices(),
                "edits": list(get_args(EditKind)), "most_dancers": MOST_DANCERS,
                "formations": list(FORMATIONS), "relations": list(RELATIONS),
                "exports": list(EXPORTED), "exports_of_each": exports_of_each(),
                "exports_of_each_character": exports_of_each(characters=True),
            },
            "locks": [list(span) for span in project.locks],
            "can_undo": project.can_undo, "can_redo": project.can_redo,
            "changed": [list(span) for span in state.changed],
            "request": "" if project.current is None else project.current.request,
            "dance": None if state.dance is None or state.features is None else studio.facts(),
            "character": None if self.character is None else character_facts(self.character),
            "versions": {slot: project.versions.get(slot) for slot in ("A", "B")},
        }  # fmt: skip
