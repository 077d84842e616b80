"""Commands on the pages of the documentation exist with their options, and the Python compiles."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from command_line import run

import choreograph as cg

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
NAMES = [page.relative_to(DOCS).as_posix() for page in PAGES]


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.S | re.M)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_on_a_page_exist_with_their_options(page):
    for line in "".join(blocks(page, "console")).splitlines():
        prompt, program, command, *words = shlex.split(line)
        assert (prompt, program) == ("$", "choreograph"), line
        shown = run(command, "--help").output
        for word in words:
            if word.startswith("--"):
                assert re.search(rf"{word}\b", shown), line


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_python_on_a_page_compiles_and_names_public_names(page):
    for block in blocks(page, "python"):
        compile(block, page.name, "exec")
        for name in re.findall(r"\bcg\.(\w+)", block):
            assert hasattr(cg, name), name
