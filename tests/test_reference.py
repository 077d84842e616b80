"""The reference names every public name. Every public field says what it holds, its shape and its unit."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import re
import runpy
from pathlib import Path

import pytest

import choreograph as cg

PAGES = Path(__file__).parents[1] / "docs" / "reference"
API = re.findall(r"^   ([\w.]+)$", (PAGES / "api.rst").read_text("utf-8"), flags=re.M)
OF_ARRAYS = re.compile(r"NDArray|Floats|Ints|Indices")
UNITS = {
    "_m": r"metres", "_s": r"seconds?\b", "_rad": r"radians", "_m_s": r"metres per second",
    "_bpm": r"beats per minute", "fps": r"[Ff]rames per second",
}  # fmt: skip


def found(name: str) -> object:
    """The value that the reference names, such as `Motion` or `plan.PlannedSecond`."""
    module, _, attribute = f"choreograph.{name}".rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def field_docstrings(kind: type) -> dict[str, str]:
    """The text below each field of a class, without those that it inherits, and empty without one."""
    (tree,) = ast.parse(inspect.cleandoc(inspect.getsource(kind))).body
    assert isinstance(tree, ast.ClassDef)
    texts = {}
    for node, below in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
            texts[node.target.id] = str(below.value.value) if is_text else ""
    return texts


CLASSES = {name: kind for name in API if dataclasses.is_dataclass(kind := found(name))}


def test_the_reference_names_every_public_name():
    assert set(cg.__all__) - {"__version__", "metrics"} == {name for name in API if "." not in name}
    assert len(set(API)) == len(API)


def test_the_page_of_metrics_has_every_module_in_its_section():
    page = runpy.run_path(str(PAGES.parent / "conf.py"))["page_of_metrics"]()
    shown = re.findall(r"^\.\. automodule:: ([\w.]+)$", page, flags=re.M)
    assert sorted(shown) == [f"{cg.metrics.__name__}.{name}" for name in sorted(cg.metrics.__all__)]
    assert page.startswith("Music and dance\n---------------\n") and "\nPhysics\n-------\n" in page
    assert "metrics.rst" in (PAGES / "metrics.rst").read_text("utf-8")


@pytest.mark.parametrize("name", CLASSES)
def test_every_public_field_says_what_it_holds(name):
    for owner in CLASSES[name].__mro__:
        texts = field_docstrings(owner) if dataclasses.is_dataclass(owner) else {}
        for field, text in texts.items():
            if not field.startswith("_"):
                assert text.rstrip().endswith("."), f"{owner.__name__}.{field} has no docstring"


@pytest.mark.parametrize("name", CLASSES)
def test_fields_that_are_arrays_have_a_shape_and_quantities_a_unit(name):
    kind = CLASSES[name]
    texts = field_docstrings(kind)
    for field in dataclasses.fields(kind):
        text = texts.get(field.name, "")
        if field.name not in texts or field.name.startswith("_"):
            continue
        if OF_ARRAYS.search(str(field.type)):
            assert re.match(r"\([A-Z0-9]", text), f"{name}.{field.name} has no shape"
        suffix = max((end for end in UNITS if field.name.endswith(end)), key=len, default="")
        if suffix:
            assert re.search(UNITS[suffix], text), f"{name}.{field.name} has no unit"
