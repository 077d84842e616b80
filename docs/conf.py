"""Sphinx settings of the documentation: `make docs` builds it into build/docs."""

from __future__ import annotations

import sys
from pathlib import Path

import choreograph

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
exclude_patterns = ["README.md"]

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"  # signatures show them; numpydoc describes the parameters
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

html_theme = "pydata_sphinx_theme"
html_title = "choreograph"
html_show_sourcelink = False
html_theme_options = {
    "show_nav_level": 2,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {"index": []}

sys.path.insert(0, str(Path(__file__).parent))


def _as_literal(_app, _ctx, lines: list[str]) -> None:
    """Examples below a command keep their lines, and `*` in them is no emphasis."""
    lines[:] = ["::", "", *(f"   {line}" for line in lines if line.strip()), ""] if any(lines) else []


def _draw(app) -> None:
    from figures import draw_all

    draw_all(Path(app.srcdir) / "_figures")


def setup(app) -> None:
    app.connect("sphinx-click-process-epilog", _as_literal)
    app.connect("builder-inited", _draw)
