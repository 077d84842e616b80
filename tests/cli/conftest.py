"""A repertoire, with and without motifs, and a song: made once for all commands, never written to."""

from pathlib import Path

import pytest
from synthetic_repertoire import synthetic_repertoire, write_clicks


@pytest.fixture(scope="session")
def db(tmp_path_factory) -> Path:
    return synthetic_repertoire(tmp_path_factory.mktemp("db") / "rep.h5").path


@pytest.fixture(scope="session")
def db_with_motifs(tmp_path_factory) -> Path:
    return synthetic_repertoire(tmp_path_factory.mktemp("motifs") / "rep.h5", vocabulary=True).path


@pytest.fixture(scope="session")
def song(tmp_path_factory) -> Path:
    return write_clicks(tmp_path_factory.mktemp("songs") / "song.wav", duration_s=6.0)
