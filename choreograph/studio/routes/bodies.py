"""The bodies of requests as models, whose fields are checked before anything is done, and uploaded files."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree
from typing import Annotated, Any, Literal
from urllib.parse import unquote

from fastapi import Request
from pydantic import BaseModel, ConfigDict, Field

from choreograph.core.errors import ChoreographError
from choreograph.core.files import writing
from choreograph.studio.project import EditKind
from choreograph.studio.project_file import checked_name
from choreograph.studio.refusals import TooLargeError
from choreograph.studio.safety import too_large

Seconds = Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)]
Span = tuple[Seconds, Seconds]
Slot = Literal["A", "B"]
Text = Annotated[str, Field(max_length=300)]


class Body(BaseModel):
    """A body without unknown fields."""

    model_config = ConfigDict(extra="forbid")


class Revised(Body):
    """A change of the newest state."""

    revision: Annotated[int, Field(ge=0, le=1 << 53)]


class SettingsBody(Revised):
    """Changes of settings, for the whole dance or a span. The motion from `at` on is sent first."""

    changes: dict[str, Any]
    keep_locked: bool = True
    at: Seconds | None = None
    from_s: Seconds | None = Field(default=None, alias="from")
    to_s: Seconds | None = Field(default=None, alias="to")


class LocksBody(Revised):
    """All parts that are locked."""

    locks: Annotated[list[Span], Field(max_length=500)]


class AlternativesBody(Revised):
    """The span to dance otherwise, and how many ways to show."""

    from_s: Seconds = Field(alias="from")
    to_s: Seconds = Field(alias="to")
    n: Annotated[int, Field(ge=1, le=24)] = 8


class ChooseBody(Revised):
    """The alternative to dance."""

    id: Text


class EditBody(Revised):
    """One edit of the dance."""

    kind: EditKind
    from_s: Seconds | None = Field(default=None, alias="from")
    to_s: Seconds | None = Field(default=None, alias="to")
    at: Seconds | None = None
    mirrored: bool = False
    take: Text | None = None
    source_s: Seconds | None = None
    motif: Annotated[int, Field(ge=0, le=100_000)] | None = None
    section: Annotated[int, Field(ge=0, le=10_000)] | None = None  # of the song, that a part is cut to
    ban: Text | None = None  # such as genre:tango
    seed: Annotated[int, Field(ge=0, le=1 << 32)] = 0


class SeamBody(Revised):
    """The join of two takes that is nearest to a time, and by how many counts it is moved."""

    at: Seconds
    counts: Annotated[int, Field(ge=-256, le=256)]


# Uploaded files. Each has a folder of its own, so that messages show its own name.


async def uploaded(request: Request, folder: Path, suffixes: Iterable[str], most_bytes: int) -> Path:
    """A file that a page sends, its name in the header X-Filename, in a new folder below `folder`.

    Raises `ParameterError` for a name that is none, `UnknownTypeError` for another suffix, `TooLargeError`
    for more bytes, and `ChoreographError` if the disk is full. Nothing is then left.
    """
    name = checked_name(unquote(request.headers.get("x-filename", "")), suffixes)
    sent = folder / f"sent-{secrets.token_hex(8)}" / name
    n_bytes, done = 0, False
    try:
        with writing(Path(name)):
            sent.parent.mkdir()
            with open(sent, "xb") as file:
                async for chunk in request.stream():
                    n_bytes += len(chunk)
                    if n_bytes > most_bytes:
                        raise TooLargeError(too_large(most_bytes))
                    file.write(chunk)
        done = True
        return sent
    finally:
        if not done:
            rmtree(sent.parent, ignore_errors=True)


@contextmanager
def received(sent: Path) -> Iterator[None]:
    """Use an uploaded file in the block. Its folder is removed at the end, and errors name it without it."""
    try:
        yield
    except ChoreographError as error:
        raise type(error)(str(error).replace(f"{sent.parent}{os.sep}", "")) from None
    finally:
        rmtree(sent.parent, ignore_errors=True)
