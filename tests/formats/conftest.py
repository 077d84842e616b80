"""A character as a glTF file."""

import pytest
from synthetic_characters import CHARACTERS, write_character


@pytest.fixture
def glb(tmp_path):
    write_character(tmp_path / "a.glb", CHARACTERS["mixamo"])
    return tmp_path / "a.glb"
