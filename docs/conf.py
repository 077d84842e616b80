"""Sphinx settings of the documentation: `make docs` builds it into build/docs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import click

import choreograph
from choreograph.cli.main import main

project = "choreograph"
copyright = "the choreograph contributors"
release = version = choreograph.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_click",
    "sphinx_copybutton",
    "sphinx_design",
]
root_doc = "index"
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["README.md", "_figures"]  # pieces of pages, which include them
default_role = "literal"
smartquotes = False

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

templates_path = ["_templates"]
add_module_names = False
autosummary_generate = True
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 72
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

html_theme = "pydata_sphinx_theme"
html_title = "choreograph"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "show_nav_level": 2,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {"index": [], "results": []}

sys.path.insert(0, str(Path(__file__).parent))

ITEM = re.compile(
    r"(?P<name>\*{0,2}\w[\w, ]*?)(?: : | {2,})(?P<text>\S.*)|(?P<error>\w+Error)\b\s*(?P<cause>.*)"
)


def _name_commands() -> None:
    """Give each command its name: the function of several is called `command`."""
    for name in main.list_commands(click.Context(main)):
        command = main.get_command(click.Context(main), name)
        assert command is not None
        command.name = name


def _as_literal(_app, _ctx, lines: list[str]) -> None:
    """Examples below a command keep their lines, and `*` in them is no emphasis."""
    kept = [line.removeprefix("| ") for line in lines if line.strip()]
    lines[:] = [".. code-block:: text", "", *(f"   {line}" for line in kept), ""] if kept else []


def _as_numpydoc(_app, _what, _name, _obj, _options, lines: list[str]) -> None:
    """Write the items of a section as numpydoc has them, and tables as literal text.

    Docstrings here have `name : text`, `name : type   text` or `Error   cause` in a line.
    """
    section, made = "", []
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        if set(following) == {"-"} and len(following) > 2:
            section = line
        if line.startswith("|"):
            if not lines[number - 1].startswith("|"):
                made += [".. list-table::", "   :header-rows: 1", ""]
            if set(line) - set("|- "):
                cells = [cell.strip() for cell in line.strip("|").split("|")]
                made += [f"   {'  -' if column else '* -'} {cell}" for column, cell in enumerate(cells)]
        elif section in ("Parameters", "Raises") and (item := ITEM.fullmatch(line)):
            kind, _, text = (item["text"] or item["cause"]).rpartition("   ")
            made += [
                f"{item['name']} : {kind.strip()}" if kind else item["name"] or item["error"],
                f"    {text}",
            ]
        elif section in ("Parameters", "Raises") and line.startswith(" "):
            made.append(f"    {line.strip()}")
        else:
            made.append(line)
    lines[:] = made


def _draw(app) -> None:
    from figures import draw_all

    folder = Path(app.srcdir) / "_figures"
    draw_all(folder)
    (folder / "costs.md").write_text(table_of_costs(), encoding="utf-8")
    (folder / "metrics.rst").write_text(page_of_metrics(), encoding="utf-8")


def table_of_costs() -> str:
    """A row for each built-in cost, of what its class declares."""
    from choreograph.choreography.graph.costs import BUILTIN_COSTS

    rows = ["| cost | default weight | unit | it is high where |", "| --- | --- | --- | --- |"]
    rows += [
        f"| `{one.name}` | {one.default_weight:g} | {one.unit} | {one.sentence} |" for one in BUILTIN_COSTS
    ]
    return "\n".join(rows) + "\n"


def page_of_metrics() -> str:
    """The sections and modules of metrics, in the order of their stub."""
    from choreograph.evaluation import metrics

    text = ""
    for line in Path(metrics.__file__).with_suffix(".pyi").read_text(encoding="utf-8").splitlines()[1:]:
        if line.startswith("# "):
            heading = line.removeprefix("# ")
            text += f"{heading}\n{'-' * len(heading)}\n\n"
        elif line:
            name = line.rpartition(" ")[2]
            title = f"metrics.{name}"
            text += f"{title}\n{'^' * len(title)}\n\n"
            text += f".. automodule:: {metrics.__name__}.{name}\n   :members:\n\n"
    return text


def setup(app) -> None:
    _name_commands()
    app.connect("sphinx-click-process-epilog", _as_literal)
    app.connect("autodoc-process-docstring", _as_numpydoc, priority=100)  # before numpydoc's
    app.connect("builder-inited", _draw)
