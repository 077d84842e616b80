"""Docstrings of the public API: every name has an example that runs, every public method has a docstring."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

import choreograph as cg

EXAMPLES = re.compile(r"^Examples\n-{8}\n(.+?)(?=^\S[^\n]*\n-{3,}\n|\Z)", flags=re.S | re.M)


def functions_of_metrics() -> dict[str, object]:
    """Each public function of each module of `cg.metrics` by its name, `metrics.MODULE.FUNCTION`."""
    found: dict[str, object] = {}
    for name in cg.metrics.__all__:
        module = getattr(cg.metrics, name)
        for function, value in vars(module).items():
            if inspect.isfunction(value) and value.__module__ == module.__name__ and function[0] != "_":
                found[f"metrics.{name}.{function}"] = value
    return found


# A text has no docstring of its own: the package's stands for `__version__`.
PUBLIC = {name: getattr(cg, name) for name in cg.__all__} | {"__version__": cg} | functions_of_metrics()
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}


def examples(value: object) -> str | None:
    """The text of the section `Examples` of a docstring, where there is one."""
    found = EXAMPLES.search(inspect.cleandoc(value.__doc__ or ""))
    return found and found[1]


@pytest.mark.parametrize("name", PUBLIC)
def test_the_example_of_a_public_name_runs(name, tmp_path, monkeypatch):
    value = PUBLIC[name]
    # A dataclass without a docstring is given its signature as one.
    assert (value.__doc__ or "").strip() and not value.__doc__.startswith(f"{name}("), (
        f"{name} has no docstring"
    )
    text = examples(value)
    assert text is not None, f"expected a section Examples in the docstring of {name}"

    home = value if inspect.ismodule(value) else importlib.import_module(value.__module__)
    test = doctest.DocTestParser().get_doctest(text, {"cg": cg, "np": np}, name, home.__file__, 0)
    assert test.examples, f"expected >>> in the section Examples of {name}"
    monkeypatch.chdir(tmp_path)
    report: list[str] = []
    with threadpool_limits(1):
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
        runner.run(test, out=report.append)
    assert not report, "".join(report)


@pytest.mark.parametrize("name", CLASSES)
def test_every_public_method_has_a_docstring(name):
    kinds = (property, classmethod, staticmethod)
    silent = {
        f"{owner.__name__}.{member}"
        for owner in CLASSES[name].__mro__
        if owner.__module__.startswith("choreograph")
        for member, value in vars(owner).items()
        if not member.startswith("_") and (callable(value) or isinstance(value, kinds))
        if not (value.__doc__ or "").strip()
    }
    assert not silent, f"public methods of {name} without docstring: {silent}"


def test_every_public_function_of_the_package_has_a_docstring():
    """An override has the docstring of the method that it overrides, a setter that of its property."""
    trees = {path: ast.parse(path.read_text("utf-8")) for path in Path(cg.__file__).parent.rglob("*.py")}
    classes = {n.name: n for tree in trees.values() for n in ast.walk(tree) if isinstance(n, ast.ClassDef)}

    def is_documented(name: str, owner: ast.ClassDef) -> bool:
        own = [m for m in owner.body if isinstance(m, ast.FunctionDef) and m.name == name]
        bases = [classes[ast.unparse(b)] for b in owner.bases if ast.unparse(b) in classes]
        return any(map(ast.get_docstring, own)) or any(is_documented(name, base) for base in bases)

    silent = []
    for path, tree in trees.items():
        for owner in (tree, *(n for n in tree.body if isinstance(n, ast.ClassDef) and n.name[0] != "_")):
            for n in owner.body:
                if not isinstance(n, ast.FunctionDef | ast.ClassDef) or n.name.startswith("_"):
                    continue
                inherits = isinstance(owner, ast.ClassDef) and is_documented(n.name, owner)
                if not (ast.get_docstring(n) or inherits):
                    silent.append(f"{path}:{n.lineno} {n.name}")
    assert not silent, silent
