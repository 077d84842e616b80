"""No regular expression of the program takes more than linear time, whatever text it is given.

Each pattern becomes an automaton. Within one attempt, time is more than linear if a word can be read in two
ways again and again (ambiguity). Over the attempts at all places of a text, it is if a word can be read from
the beginning of the pattern again and again without a match: blank lines by `^\\s*WORD`, for one.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from re import _compiler, _constants, _parser  # the only parser of Python's own patterns

import pytest

ROOT = Path(__file__).resolve().parents[1]
_METHODS = ("match", "fullmatch", "search", "split", "sub", "subn", "findall", "finditer")
_LETTERS = [
    *map(chr, range(128)),
    "\x85",
    "\xa0",
    "é",
    "İ",
    "٣",
    "体",
]  # of every class that patterns tell apart
_ANCHORS = {_constants.AT_BEGINNING: "line", _constants.AT_BEGINNING_STRING: "start"}
_TEXT_END = frozenset({"the end of the text"})  # read like a letter, which no other edge reads
_MOST_COPIES = 20  # of a part that is repeated a number of times: a larger number is as many


@dataclass
class Automaton:
    """States with edges that read a letter, and edges that read nothing."""

    flags: int
    n_states: int = 1
    letters: list[frozenset[str]] = field(default_factory=list)  # by reading edge
    sources: list[int] = field(default_factory=list)
    targets: list[int] = field(default_factory=list)
    silent: list[tuple[int, int]] = field(default_factory=list)
    has_circles: bool = False

    def state(self) -> int:
        self.n_states += 1
        return self.n_states - 1

    def add(self, items: list, at: int) -> int:
        """Add parsed items from a state on; the state after them."""
        for item in items:
            at = self._add_item(item, at)
        return at

    def _add_item(self, item: tuple, at: int) -> int:
        kind, value = item
        end = self.state()
        is_text_end = kind is _constants.AT and value in (_constants.AT_END, _constants.AT_END_STRING)
        if is_text_end or kind in (_constants.LITERAL, _constants.NOT_LITERAL, _constants.IN, _constants.ANY):
            self.letters.append(_TEXT_END if is_text_end else _letters_of(item, self.flags))
            self.sources.append(at)
            self.targets.append(end)
            return end
        if kind is _constants.SUBPATTERN:
            return self.add(value[3], at)
        if kind is _constants.ATOMIC_GROUP:
            return self.add(value, at)
        if kind is _constants.BRANCH:
            for way in value[1]:
                self.silent.append((self.add(way, at), end))
            return end
        if kind in (_constants.MAX_REPEAT, _constants.MIN_REPEAT, _constants.POSSESSIVE_REPEAT):
            return self._add_repeat(*value, at)
        if kind is _constants.ASSERT and value[0] > 0:
            return self.add(value[1], at)  # what must follow: without it there is no match yet
        assert kind in (_constants.AT, _constants.ASSERT, _constants.ASSERT_NOT), f"{kind} is not looked into"
        self.silent.append((at, end))
        return end

    def _add_repeat(self, least: int, most: int, part: list, at: int) -> int:
        for _ in range(min(least, _MOST_COPIES)):
            at = self.add(part, at)
        if most is _constants.MAXREPEAT:
            self.has_circles = True
            start, end = self.state(), self.state()
            self.silent += [(at, start), (start, end), (self.add(part, start), start)]
            return end
        end = self.state()
        for _ in range(min(most - least, _MOST_COPIES)):
            self.silent.append((at, end))
            at = self.add(part, at)
        self.silent.append((at, end))
        return end

    def silent_ways(self, state: int) -> list[int]:
        """The states that are reached without a letter, one entry for each way; a circle is a way, too."""
        found, ways = [], [[state]]
        while ways:
            way = ways.pop()
            found.append(way[-1])
            assert len(found) < 10_000
            for source, target in self.silent:
                if source == way[-1]:
                    if target in way:  # a part that may be empty is repeated without end
                        found += [target, target]
                    else:
                        ways.append([*way, target])
        return found


def _letters_of(item: tuple, flags: int) -> frozenset[str]:
    """The letters that a parsed item reads."""
    state = _parser.State()
    state.flags = flags | re.UNICODE
    pattern = _compiler.compile(_parser.SubPattern(state, [item]), flags | re.UNICODE)
    return frozenset(letter for letter in _LETTERS if pattern.fullmatch(letter))


def fault(pattern: str, flags: int, method: str) -> str:
    """Why a pattern may take more than linear time by that method; "" if it does not."""
    parsed = _parser.parse(pattern, flags)
    automaton = Automaton(parsed.state.flags)
    end = automaton.add(list(parsed), 0)
    if not automaton.has_circles:
        return ""
    ways = [automaton.silent_ways(target) for target in automaton.targets]
    edges = range(len(automaton.letters))
    follow = [[f for f in edges if automaton.sources[f] in ways[e]] for e in edges]
    doubled = {(e, f) for e in edges for f in edges if ways[e].count(automaton.sources[f]) > 1}
    is_end = [method != "fullmatch" and end in ways[e] for e in edges]
    tried = [e for e in edges if not is_end[e]]  # from others on, there is a match
    if _is_ambiguous(automaton.letters, follow, doubled, tried):
        return "a text can be read in several ways, which are all tried"
    if method in ("match", "fullmatch"):
        return ""
    anchor = _anchor(list(parsed), parsed.state.flags)
    firsts = frozenset(e for e in edges if automaton.sources[e] in automaton.silent_ways(0))
    if anchor != "start" and _begins_again(automaton.letters, follow, is_end, firsts, anchor):
        return "a text without a match is read to its end from each place in it"
    return ""


def _anchor(items: list, flags: int) -> str:
    """Where a pattern may begin: "line", "start", or "" for anywhere."""
    if not items or items[0][0] is not _constants.AT:
        return ""
    anchor = _ANCHORS.get(items[0][1], "")
    return "start" if anchor == "line" and not flags & re.MULTILINE else anchor


def _is_ambiguous(
    letters: list[frozenset[str]], follow: list[list[int]], doubled: set[tuple[int, int]], tried: list[int]
) -> bool:
    """Whether edges p and q read a word from p to p, from p to q and from q to q."""

    def after(threads: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        for heads in product(*([f for f in follow[e] if f in tried] for e in threads)):
            if frozenset.intersection(*(letters[f] for f in heads)):
                yield heads

    def reaches(start: tuple[int, ...], goal: tuple[int, ...]) -> bool:
        return goal in _reached(start, after)

    circling = [e for e in tried if reaches((e,), (e,))]
    if any(e in circling and f in circling and reaches((f,), (e,)) for e, f in doubled):
        return True
    pairs = [(p, q) for p, q in product(circling, repeat=2) if p != q and reaches((p, q), (p, q))]
    return any(reaches((p, p, q), (p, q, q)) for p, q in pairs)


def _begins_again(
    letters: list[frozenset[str]],
    follow: list[list[int]],
    is_end: list[bool],
    firsts: frozenset[int],
    anchor: str,
) -> bool:
    """Whether some word can be read from the beginning of the pattern again and again, without a match."""
    start = frozenset({-1})

    def read(edges: frozenset[int], letter: str) -> frozenset[int] | None:
        heads = {f for e in edges for f in (firsts if e == -1 else follow[e]) if letter in letters[f]}
        return frozenset(heads) if heads and not any(is_end[f] for f in heads) else None

    def after(threads: tuple) -> Iterator[tuple]:
        for letter in _LETTERS:
            heads = tuple(read(edges, letter) for edges in threads[:2])
            if None not in heads:
                yield (*heads, letter == "\n")

    places = {state[0] for state in _reached((start, start, False), after)}
    return any(
        (place, place, ends_line) in _reached((start, place, False), after)
        for place in places
        for ends_line in ((True,) if anchor == "line" else (True, False))
    )


def _reached(start: tuple, after: Callable[[tuple], Iterator[tuple]]) -> set[tuple]:
    """What is reached from a state by a step or more."""
    found: set[tuple] = set()
    left = [start]
    while left:
        for state in after(left.pop()):
            if state not in found:
                found.add(state)
                left.append(state)
    return found


def patterns() -> Iterator[tuple[str, str, int, str]]:
    """Where the program has a pattern, the pattern, its flags, and each method that it is used by."""
    for path in sorted([*(ROOT / "choreograph").rglob("*.py"), *(ROOT / "blender_extension").rglob("*.py")]):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        used: dict[str, set[str]] = {}  # name of a compiled pattern -> methods
        for node in nodes:
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.attr in _METHODS:
                used.setdefault(node.value.id, set()).add(node.attr)
        names = {
            id(node.value): node.targets[0].id
            for node in nodes
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
        }
        texts = {  # of patterns, and parts of them, by name
            node.targets[0].id: node.value.value
            for node in nodes
            if isinstance(node, ast.Assign)
            and isinstance(node.targets[0], ast.Name)
            and isinstance(node.value, ast.Constant)
        }
        for call in nodes:
            if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute)):
                continue
            if call.func.attr not in ("compile", *_METHODS) or ast.unparse(call.func.value) != "re":
                continue
            name, called = names.get(id(call), ""), call.func.attr
            texts[name] = text = _text_of(call.args[0], texts)
            for method in sorted(used.get(name, {"search"})) if called == "compile" else [called]:
                yield f"{path.relative_to(ROOT)}:{call.lineno}", text, _flags_of(call), method


def _text_of(node: ast.expr, texts: dict[str, str]) -> str:
    """The text of a pattern; what is put into it, unless it is a part of a pattern, stands for letters."""
    if isinstance(node, ast.JoinedStr):
        return "".join(
            part.value if isinstance(part, ast.Constant) else str(texts.get(ast.unparse(part.value), "x"))
            for part in node.values
        )
    if isinstance(node, ast.BinOp):
        return _text_of(node.left, texts) + _text_of(node.right, texts)
    if isinstance(node, ast.Attribute) and node.attr == "pattern":
        return texts[ast.unparse(node.value)]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "encode":
        return "x"  # a text in bytes
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "'|'.join":
        return "x|y"  # words of a table
    assert isinstance(node, ast.Constant), f"expected a pattern that is written there: {ast.unparse(node)}"
    return node.value if isinstance(node.value, str) else node.value.decode("latin-1")


def _flags_of(call: ast.Call) -> int:
    n_before = {"compile": 1, "sub": 3, "subn": 3}.get(call.func.attr, 2)
    given = [*call.args[n_before:][:1], *(k.value for k in call.keywords if k.arg == "flags")]
    text = " ".join(ast.unparse(node) for node in given)
    return sum(getattr(re, name) for name in re.findall(r"re\.([A-Z]+)", text))


def test_every_pattern_takes_linear_time():
    found = list(patterns())
    faults = [
        f"{where}: {pattern!r} by {method}: {reason}"
        for where, pattern, flags, method in found
        if (reason := fault(pattern, flags, method))
    ]
    assert len(found) > 20
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(
    ("pattern", "flags", "method"),
    [
        (r"^\s*HIERARCHY\b", re.MULTILINE, "search"), (r"\s*x", 0, "search"), (r"\s+$", 0, "sub"),
        (r"(a+)+b", 0, "match"), (r"(a*)*b", 0, "match"), (r"(a|a)*b", 0, "match"), (r"a*a*b", 0, "match"),
        (r"(?:a|ab|b)*c", 0, "match"), (r"\d+\d+x", 0, "match"), (r"\w+\s*\w+;", 0, "match"),
        (r"(\w+ ?)+;", 0, "match"), (r".*=.*;", 0, "fullmatch"), (r"a*a*", 0, "fullmatch"),
        (r"[a-z]*\d", 0, "findall"), (r"(?:ab)*c", 0, "finditer"), (r"<.*>", 0, "search"),
    ],
)  # fmt: skip
def test_patterns_that_take_more_than_linear_time_are_found(pattern, flags, method):
    assert fault(pattern, flags, method)


@pytest.mark.parametrize(
    ("pattern", "flags", "method"),
    [
        (r"^[ \t]*MOTION\b", re.MULTILINE, "split"), (r"\s+", 0, "split"), (r"#[^\n]*", 0, "sub"),
        (r"a*a*", 0, "match"), (r"\s*x", 0, "match"), (r"^\s*x", 0, "search"), (r'"[^"]*"', 0, "findall"),
        (r"\d+\.\d+", 0, "fullmatch"), (r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+", 0, "findall"),
        (r"[0-9a-f]{16}", 0, "fullmatch"),
    ],
)  # fmt: skip
def test_patterns_that_take_linear_time_are_not(pattern, flags, method):
    assert not fault(pattern, flags, method)
