"""A planted repertoire and a song of clicks, made once."""

from __future__ import annotations

import pytest
from synthetic_repertoire import synthetic_repertoire, write_clicks


@pytest.fixture(scope="session")
def repertoire(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("planted") / "rep.h5")


@pytest.fixture(scope="session")
def song(tmp_path_factory):
    return write_clicks(tmp_path_factory.mktemp("songs") / "clicks.wav", duration_s=12.4)


@pytest.fixture(scope="session")
def made(repertoire, song):
    import choreograph as cg

    return cg.dance(song, repertoire)
