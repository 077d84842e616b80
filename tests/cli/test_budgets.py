"""A file that is larger than what is read of its kind is refused by every command, without being read."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from command_line import all_commands, assert_one_line, run
from synthetic_characters import CHARACTERS, write_character

from choreograph.cli.declared import Changed, Input, Output
from choreograph.core.files import BUDGETS

MOTIONS = {"bvh": "bvh", "c3d": "c3d", "vmd": "vmd", "npy": "npy", "pkl": "pkl", "glb": "gltf"}
# By the kind of an input, the suffixes of its files and their budgets. Songs and repertoires have none.
KINDS: dict[str, dict[str, str]] = {
    "motion": MOTIONS, "takes": MOTIONS, "character": {"glb": "gltf"}, "plan": {"json": "text"},
    "map": {"json": "text"}, "list": {"json": "text"}, "config": {"toml": "text"}, "beats": {"txt": "table"},
    "project": {"json": "project"}, "song": {}, "repertoire": {}, "setting": {},
}  # fmt: skip
COMMANDS = {
    "motion": ["convert {} out.bvh", "count {}", "retarget {} hero.glb -o out.glb", "live SONG --dance {}"],
    "takes": ["build-db {} -o out.h5", "evaluate {} SONG"],
    "character": ["retarget walk.bvh {} -o out.glb", "dance SONG --character {} -o out.glb"],
    "plan": ["dance --plan {} -o out.bvh", "scene --plan {} -o out.bvh", 
             "dance SONG --existing {} --keep 0-1"],
    "map": ["convert walk.bvh out.bvh --map {}", "build-db walk.bvh -o out.h5 --map {}"],
    "list": ["dance SONG --signature {}", "get --table {}", "build-db x -o out.h5 --leave-out @{}",
             "scene SONG --formation {} -o out.bvh"],
    "config": ["dance SONG --config {}"],
    "beats": ["dance SONG --beats {}", "scene SONG --beats {}", "count SONG --beats {}"],
    "project": ["studio SONG --project {} --no-browser"],
}  # fmt: skip


def test_every_input_has_a_budget():
    kinds = {
        param.type.kind
        for command in all_commands().values()
        for param in command.params
        if isinstance(param.type, Input)
    }
    assert kinds == set(KINDS)
    assert all(set(budgets.values()) <= set(BUDGETS) for budgets in KINDS.values())
    assert issubclass(Changed, Input) and issubclass(Output, click.Path)


def cases() -> Iterator[object]:
    for kind, lines in COMMANDS.items():
        for line in lines:
            for suffix, budget in list(KINDS[kind].items())[: None if line == lines[0] else 1]:
                yield pytest.param(line, suffix, budget, id=f"{line.split()[0]} {kind} {suffix}")


@pytest.mark.parametrize(("line", "suffix", "budget"), list(cases()))
def test_a_larger_file_is_refused_unread(tmp_path, monkeypatch, song, line, suffix, budget):
    monkeypatch.chdir(tmp_path)
    with open(f"large.{suffix}", "wb") as file:  # sparse: it takes no disk
        file.truncate(BUDGETS[budget].file_bytes + 1)
    words = [str(song) if word == "SONG" else word for word in line.format(f"large.{suffix}").split()]
    if "hero.glb" in words:
        write_character(Path("hero.glb"), CHARACTERS["unreal"])
    tracemalloc.start()
    try:
        result = run(*words)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert_one_line(result, says="large")
    assert peak < 100e6, f"{peak / 1e6:.0f} MB"
    assert not list(tmp_path.glob("out*"))
