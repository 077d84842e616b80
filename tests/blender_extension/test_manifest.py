"""What the extension says of itself, and what it needs: nothing that Blender does not have."""

from __future__ import annotations

import ast
import sys
import tomllib
from pathlib import Path

import pytest

import choreograph as cg

FOLDER = Path(__file__).resolve().parents[2] / "blender_extension"
MODULES = sorted(FOLDER.glob("*.py"))
MANIFEST = tomllib.loads((FOLDER / "blender_manifest.toml").read_text(encoding="utf-8"))


def test_the_manifest_has_the_programs_version_a_free_licence_and_few_permissions():
    assert MANIFEST["version"] == cg.__version__
    assert MANIFEST["license"] == ["SPDX:GPL-3.0-or-later"]
    assert list(MANIFEST["permissions"]) == ["files"]
    assert "wheels" not in MANIFEST


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_a_module_imports_nothing_that_blender_lacks(path):
    text = path.read_text(encoding="utf-8")
    assert text.startswith(f"# SPDX-License-Identifier: {MANIFEST['license'][0].removeprefix('SPDX:')}\n")
    names = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add(node.module)
    assert {name.split(".")[0] for name in names} <= {"bpy", "mathutils", "numpy"} | set(
        sys.stdlib_module_names
    )


def test_the_genres_that_it_suggests_are_those_of_the_built_in_repertoire():
    tree = ast.parse((FOLDER / "settings.py").read_text(encoding="utf-8"))
    (suggested,) = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "BUILT_IN_GENRES"
    ]
    genres = {take.credits.genre for take in cg.starter_repertoire().takes}
    assert list(suggested) == sorted(genres)
