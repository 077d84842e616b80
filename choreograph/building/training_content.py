"""What a build's networks learn from: checksums of its takes, and the options that matter.

A checkpoint that was made of anything else is not continued (`nets.training`), though its takes may have the
same names.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from choreograph.building.options import BuildOptions
from choreograph.files import sha256_of
from choreograph.pretrained import shipped_checksums
from choreograph.repertoire.contents import MeasuredTake

if TYPE_CHECKING:
    from choreograph.nets.training import TrainingContext

_DIGITS = 16  # of a checksum: enough to tell files apart


def training_context(
    work: Path,
    options: BuildOptions,
    content: Mapping[str, Any],
    report: Callable[[Any], None] | None,
    note: Callable[[str], None],
) -> TrainingContext:
    """Checkpoints NAME.pt and logs NAME.jsonl in `work`; `options.resume` continues those of `content`."""
    from choreograph.nets.training import TrainingContext

    return TrainingContext(
        work, options.resume, options.device, report or (lambda progress: None), content, note
    )


def source_checksums(
    measured: Sequence[MeasuredTake], sources: Iterable[str | Path]
) -> list[tuple[str, str, int]]:
    """Path in its source, SHA-256 and number of the take, of every file that a take was read from.

    The paths say nothing of this machine, nor of how the sources were typed: those of files outside of all
    sources, such as songs that a manifest names, are their names alone.
    """
    folders = [Path(os.path.realpath(source)) for source in sources]
    known: dict[Path, tuple[str, str]] = {}
    rows = []
    for index, m in enumerate(measured):
        for path in m.take.source_paths:
            if path not in known:
                known[path] = _path_within(path, folders), sha256_of(path)
            rows.append((*known[path], index))
    return rows


def _path_within(path: Path, folders: Sequence[Path]) -> str:
    """The path from the first of the folders that holds it, else the file's name."""
    real = Path(os.path.realpath(path.parent)) / path.name  # a link to a file is known by its own name
    inside = (real.relative_to(folder) for folder in folders if folder in real.parents)
    return next(inside, Path(path.name)).as_posix()


def training_content(
    measured: Sequence[MeasuredTake], checksums: Sequence[tuple[str, str, int]], options: BuildOptions
) -> dict[str, str]:
    """Name -> checksum of each take and of the networks to begin with, and settings, of a build.

    What each network's own configuration says (sizes, steps, seed) is not repeated.
    """
    content = {
        "choreograph": version("choreograph"),
        "beats": options.beats,
        "lock_feet": str(options.lock_feet),
        "pretrained": _digest([options.pretrained, *shipped_checksums(options.pretrained)]),
        "keep_networks": str(options.keep_networks),
        "init_from": "" if options.init_from is None else sha256_of(options.init_from)[:_DIGITS],
    }
    for index, m in enumerate(measured):
        take = m.take
        files = [checksum for _, checksum, of_take in checksums if of_take == index]
        said = [asdict(take.credits), take.song_name, take.song_start_s, take.counts.source]
        content[f"take {take.name}"] = _digest([*files, *said])
    return content


def checksum_of(examples: Iterable[Any]) -> str:
    """One checksum of dataclasses of arrays, texts and numbers, such as the takes of a training."""
    digest = hashlib.sha256()
    for example in examples:
        for field in fields(example):
            value = getattr(example, field.name)
            digest.update(f"{field.name} {type(value).__name__} ".encode())
            if isinstance(value, np.ndarray):
                digest.update(f"{value.dtype} {value.shape} ".encode() + value.tobytes())
            elif is_dataclass(value):
                digest.update(checksum_of([value]).encode())
            else:
                digest.update(repr(value).encode())
    return digest.hexdigest()[:_DIGITS]


def _digest(values: Sequence[Any]) -> str:
    return hashlib.sha256(json.dumps(values).encode()).hexdigest()[:_DIGITS]
