"""How pages that play dances are put together: parts, scripts joined in one, data that cannot break out."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from importlib import resources
from typing import Any


def part(name: str, *, package: str = "choreograph.preview", folder: str = "page") -> str:
    """Text of one of a page's parts, of this package or of another that has some of its own."""
    return (resources.files(package) / folder / name).read_text(encoding="utf-8")


def joined_scripts(modules: Sequence[str]) -> str:
    """ES modules' texts, each after those it imports, as one script: no import, no export, one scope."""
    return "\n".join(re.sub(r"^(import [^;]*;\n|export )", "", text, flags=re.MULTILINE) for text in modules)


def script_safe(data: Any) -> str:
    """JSON that cannot end the script element it stands in, whatever a take is called."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def filled(frame: str, **parts: str) -> str:
    """A frame's text with every `@@name@@` replaced, and nothing replaced in what was put in."""
    pieces = frame.split("@@")
    return "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))
