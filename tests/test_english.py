"""The texts of the package keep to `docs/contributing/style.md`, as far as a program can tell."""

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for room in ("choreograph", "content", "research", "examples")
    for path in (ROOT / room).rglob("*.py")
)
_FOR_PEOPLE = re.compile(
    r"\b(hears?|heard|doubts|doubted|knows|knew|strangers?|looks? at|looked at)\b", flags=re.IGNORECASE
)
_JOINED = re.compile(r"[\w%)\]`][\"']*;(\s|$)")
_ELLIPSIS = re.compile(r"[a-z](…|\.\.\.(\s|$))")
_TEXTS = {tokenize.COMMENT, tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}


def faults_of(source: str) -> list[str]:
    """The lines of comments and strings that join sentences, end in an ellipsis or use words for people."""
    faults = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _TEXTS:
            continue
        for line in token.string.splitlines():
            if "</" in line:  # HTML joins the values of an attribute with semicolons
                continue
            if _JOINED.search(line) or _FOR_PEOPLE.search(line) or _ELLIPSIS.search(line):
                faults.append(line.strip())
    return faults


@pytest.mark.parametrize(
    "source",
    [
        '"""Reads a song; none if it ends."""',
        "# the network hears beats",
        'raise ValueError("it doubts them")',
    ],
)
def test_faults_are_found(source):
    assert len(faults_of(source)) == 1


@pytest.mark.parametrize(
    "source",
    ['"""Reads a song. None if it ends."""', "# (K, …) of what is known", "x = 1; y = 2", '">>> dance(...)"'],
)
def test_plain_text_has_no_fault(source):
    assert faults_of(source) == []


@pytest.mark.parametrize("path", FILES)
def test_texts_are_plain(path):
    assert faults_of((ROOT / path).read_text("utf-8")) == []
