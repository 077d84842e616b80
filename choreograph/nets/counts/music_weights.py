"""Weights of `MusicCounts` in a file: `.npz` in half precision, with the configuration and what it heard.

`SHIPPED` is the program's own, which heard the synthesiser alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

import choreograph
from choreograph.errors import FormatError, ParameterError
from choreograph.files import atomic_path
from choreograph.nets.counts.music_model import MusicCounts

SHIPPED = Path(choreograph.__file__).parent / "pretrained" / "music_counts_clean.npz"
_ABOUT, _CONFIG = "about", "config"


def write_music_counts(path: str | Path, net: MusicCounts, about: Mapping[str, Any]) -> None:
    """Write a network; `about` is JSON: what it was trained on."""
    arrays, config = net.to_arrays()
    stored: dict[str, Any] = {name: np.asarray(values, np.float16) for name, values in arrays.items()}
    stored |= {_ABOUT: np.array(json.dumps(dict(about))), _CONFIG: np.array(json.dumps(config))}
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **stored)


def read_music_counts(path: str | Path) -> tuple[MusicCounts, dict[str, Any]]:
    """The network of a file, and what it was trained on; `FormatError` for a file of anything else."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        about, config = (json.loads(str(arrays.pop(name))) for name in (_ABOUT, _CONFIG))
        weights = {name: np.asarray(values, np.float32) for name, values in arrays.items()}
        return MusicCounts.from_arrays(weights, config), about
    except (OSError, BadZipFile, KeyError, ValueError, TypeError, ParameterError) as error:
        raise FormatError(
            f"{path}: expected weights of the network that hears counts, got: {error}: "
            "it is damaged, or another file"
        ) from error


@lru_cache(maxsize=1)
def shipped_music_counts() -> MusicCounts:
    """The program's own network."""
    return read_music_counts(SHIPPED)[0]
