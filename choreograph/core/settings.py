"""Settings classes: frozen dataclasses whose fields document and check themselves.

A field has a type, a default and, below it, a docstring that says what it does and when to change it:

    @settings
    class DanceConfig:
        "Settings of a dance."

        candidates: Annotated[int, Range(1)] = 512
        "Clips that are warped for each second. More candidates take longer."

Editors and Sphinx show the docstring of the field. `settings` adds it to the docstring of the class, where
`help` shows it, and `described` returns it for command lines. Choices are `Literal` types, and ranges are
`Range`s. Both are checked when an instance is made.
"""

from __future__ import annotations

import ast
import inspect
import math
import os
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, fields, replace
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    Protocol,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

from choreograph.core.arguments import as_texts, check_choice, is_number, is_whole, unexpected
from choreograph.core.errors import ParameterError


class DataclassInstance(Protocol):
    """An instance of a dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]


Class = TypeVar("Class", bound=type)
Instance = TypeVar("Instance", bound=DataclassInstance)
_WIDTH = 96  # of the text of a field in `help`
_ENGINE = {"mixer": ""}  # what follows the names of engines that are not adjectives
_WORDS = {bool: "True or False", int: "whole number", float: "number", str: "text", Path: "path"}


@dataclass(frozen=True)
class Range:
    """The numbers that a setting may have, both ends included."""

    least: float
    greatest: float = math.inf

    def holds(self, value: Any) -> bool:
        """Whether a number is within the range."""
        return bool(self.least <= value <= self.greatest)

    def __str__(self) -> str:
        if math.isinf(self.greatest):
            return f"of {self.least:g} or more"
        return f"from {self.least:g} to {self.greatest:g}"


class UsedBy:
    """Which engines use a setting, by name, or "" for all of them, those of other packages included."""

    def __init__(self, *engines: str) -> None:
        self.engines = engines

    def __str__(self) -> str:
        """What is said in the text of the setting."""
        if "" in self.engines:
            return "Used by all engines."
        *most, last = (f"the {name}{_ENGINE.get(name, ' engine')}" for name in self.engines)
        return f"Used by {' and '.join(filter(None, (', '.join(most), last)))}."


@dataclass(frozen=True)
class Setting:
    """One field of a settings class."""

    name: str  # of the field
    kind: str  # the type in words, with the range or the choices
    default: Any  # its value if it is not given
    text: str  # what it does, and when to change it
    choices: tuple[str, ...] = ()  # for a setting of fixed texts
    engines: tuple[str, ...] = ()  # that use it, as in `UsedBy`


@dataclass_transform(frozen_default=True)
def settings(cls: Class) -> Class:
    """Make a class a frozen dataclass that checks its fields, and document them in its docstring.

    An instance with a value of another type, an unknown choice or a number out of range raises
    `ParameterError`. A `__post_init__` of the class is called after that check. The section `Parameters`
    comes before `Examples`, if the docstring has such a section.
    """
    own_check = cls.__dict__.get("__post_init__")

    hints = cache(lambda: _hints(cls))

    def check(self: Any) -> None:
        """Check every field by its type. Whole numbers and paths of other types become `int` and `Path`."""
        for name, hint in hints().items():
            object.__setattr__(self, name, _checked(name, getattr(self, name), hint))
        if own_check is not None:
            own_check(self)

    cls.__post_init__ = check  # type: ignore[attr-defined]
    made: Class = dataclass(frozen=True)(cls)  # type: ignore[assignment]
    described_fields = "\n".join(_as_numpydoc(setting) for setting in described(made))
    summary, heading, examples = inspect.cleandoc(cls.__doc__ or "").partition("Examples\n--------\n")
    parts = (summary.strip(), f"Parameters\n----------\n{described_fields}", heading + examples)
    made.__doc__ = "\n\n".join(filter(None, parts)) + "\n"
    return made


def described(cls: type) -> tuple[Setting, ...]:
    """The fields of a settings class, in order."""
    texts, hints, users = dict(_field_docstrings(cls)), _hints(cls), _users(cls)
    return tuple(
        Setting(
            field.name,
            _in_words(hints[field.name]),
            field.default if field.default_factory is MISSING else field.default_factory(),
            " ".join(filter(None, (texts.get(field.name, ""), str(users.get(field.name, ""))))),
            _choices(hints[field.name]),
            users[field.name].engines if field.name in users else (),
        )
        for field in fields(cls)
    )


def unknown_setting(name: object, names: Iterable[str]) -> ParameterError:
    """The error to raise for a name that is not among the `names`, with the most similar one."""
    near = get_close_matches(str(name), list(names), 1, 0.0)
    return unexpected("the name of a setting", name, f"the most similar one is {near[0]!r}")


def changed(base: Instance, given: Mapping[str, Any], *, other_names: Iterable[str] = ()) -> Instance:
    """An instance of a settings class with other values of the fields that are given.

    Raises `ParameterError` for a name that is no field, with the most similar one of all fields and
    `other_names`, and for a value that a field cannot have.
    """
    names = [field.name for field in fields(base)]
    for name in given:
        if name not in names:
            raise unknown_setting(name, (*names, *other_names))
    return replace(base, **given)


def from_texts(cls: type, texts: Sequence[str]) -> dict[str, Any]:
    """Values of fields of a settings class from texts such as "candidates=64" or "time-maps=raw".

    Raises `ParameterError` for an unknown or repeated name, and for a text that is no value of the setting.
    """
    hints, values = _hints(cls), {}
    for text in texts:
        written, equals, value = text.partition("=")
        name = written.strip().replace("-", "_")
        if not equals:
            raise unexpected("NAME=VALUE", text)
        if name not in hints:
            raise unknown_setting(written, hints)
        if name in values:
            raise ParameterError(f"expected a value of {name} once, got several")
        values[name] = _parsed(name, value.strip(), hints[name])
    return values


def _parsed(name: str, text: str, hint: Any) -> Any:
    """The first value that the text can stand for and that the setting may have."""
    words: dict[str, bool | None] = {"true": True, "false": False, "none": None}
    readings: list[Any] = [words[text.lower()]] if text.lower() in words else []
    for kind in (int, float):
        with suppress(ValueError):
            readings.append(kind(text))
    for value in readings:
        with suppress(ParameterError):
            return _checked(name, value, hint)
    return _checked(name, text, hint)


def _as_numpydoc(setting: Setting) -> str:
    text = textwrap.indent(textwrap.fill(setting.text, _WIDTH, break_on_hyphens=False), "    ")
    return f"{setting.name} : {setting.kind}, default {setting.default!r}\n{text}"


def _hints(cls: type) -> dict[str, Any]:
    """The types of the fields, without the engines that use them."""
    hints = get_type_hints(cls, include_extras=True)
    return {name: _without_users(hint) if _used_by(hint) else hint for name, hint in hints.items()}


def _without_users(hint: Any) -> Any:
    others = tuple(one for one in hint.__metadata__ if not isinstance(one, UsedBy))
    return Annotated[hint.__origin__, *others] if others else hint.__origin__


def _users(cls: type) -> dict[str, UsedBy]:
    """Who uses the fields that say it."""
    hints = get_type_hints(cls, include_extras=True)
    return {name: used for name, hint in hints.items() if (used := _used_by(hint)) is not None}


def _used_by(hint: Any) -> UsedBy | None:
    return next((one for one in getattr(hint, "__metadata__", ()) if isinstance(one, UsedBy)), None)


def _field_docstrings(cls: type) -> Iterator[tuple[str, str]]:
    """The names of fields and the texts below them, none where the source is not available."""
    try:
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    except (OSError, TypeError):
        return
    assert isinstance(body, ast.ClassDef)
    for field, below in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        ):
            yield field.target.id, " ".join(below.value.value.split())


def _members(hint: Any) -> tuple[Any, ...]:
    """The alternatives of a type."""
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _choices(hint: Any) -> tuple[str, ...]:
    return tuple(c for member in _members(hint) if get_origin(member) is Literal for c in get_args(member))


def _in_words(hint: Any) -> str:
    words = []
    for member in _members(hint):
        if get_origin(member) is Literal:
            words.append(", ".join(map(repr, get_args(member))))
        elif get_origin(member) is Annotated:
            kind, *limits = get_args(member)
            words.append(" ".join([_WORDS[kind], *map(str, limits)]))
        elif member is NoneType:
            words.append("None")
        elif get_origin(member) is Mapping:
            words.append("table of name and value")
        elif get_origin(member) is tuple:
            words.append("list of texts")
        else:
            words.append(_WORDS.get(member, getattr(member, "__name__", str(member))))
    return " or ".join(words)


def _checked(name: str, value: Any, hint: Any) -> Any:
    """The value as one of the alternatives of a type. Raises `ParameterError` if it is none of them."""
    members = _members(hint)
    if value is None and NoneType in members:
        return None
    choices = _choices(hint)
    if choices and str not in members:
        check_choice(name, value, choices)
        return value
    for member in members:
        if get_origin(member) is Literal:
            continue
        kind, limits = _kind_of(member)
        if kind is bool and isinstance(value, bool):
            return value
        if kind is int and is_whole(value) and all(limit.holds(value) for limit in limits):
            return int(value)
        if kind is float and is_number(value) and all(limit.holds(value) for limit in limits):
            return value
        if kind is tuple and isinstance(value, Iterable) and not isinstance(value, str | Mapping):
            return as_texts(name, value)
        if kind is Path and isinstance(value, str | os.PathLike):
            return Path(value)
        if kind not in (bool, int, float, Path) and isinstance(value, kind):
            return value
    raise unexpected(f"{name} as {_in_words(hint)}", value)


def _kind_of(member: Any) -> tuple[type, tuple[Range, ...]]:
    """The class of an alternative, and its limits."""
    if get_origin(member) is Annotated:
        kind, *limits = get_args(member)
        return kind, tuple(limits)
    return get_origin(member) or member, ()
