"""Assembly of self-contained pages: parts, bundled scripts, JSON that cannot break out of its element."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from importlib import resources
from typing import Any

_OF_MODULES = re.compile(r"^(?:import \{[^{}]*\} from [^;\n]*;\n|export )", re.MULTILINE)


def page_part(name: str, *, package: str = "choreograph.preview", folder: str = "page") -> str:
    """Text of a page part, from this package or from another one."""
    return (resources.files(package) / folder / name).read_text(encoding="utf-8")


def bundle_scripts(modules: Sequence[str]) -> str:
    """ES modules (texts, each after those it imports) as one script: no imports, no exports, one scope."""
    return "\n".join(_OF_MODULES.sub("", text) for text in modules)


def to_script_json(data: Any) -> str:
    """JSON that cannot end the script element it stands in, whatever the names of takes contain."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def fill_template(template: str, **parts: str) -> str:
    """The template with every `@@name@@` replaced; the inserted texts are not scanned again."""
    pieces = template.split("@@")
    return "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))
