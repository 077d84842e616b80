"""Formats, engines and costs of other packages that cannot be used: a note for each, and commands go on."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from command_line import assert_one_line, run
from installed_packages import installed_package
from synthetic_motions import stepping

import choreograph as cg
from choreograph.choreography.engine import engine_named, engines
from choreograph.choreography.graph.costs import COST_GROUP, installed_costs
from choreograph.core.plugins import installed_names
from choreograph.formats import added_formats
from choreograph.formats.register import import_takes, save_motion
from choreograph.settings import DanceConfig, engine_names

ALL = "[choreograph.formats]\na = bad\n[choreograph.engines]\nbad = bad:E\n[choreograph.costs]\nbad = bad:C\n"
FORMAT = "[choreograph.formats]\na = bad\n"
ENGINE = "[choreograph.engines]\nbad = bad:E\n"
COST = "[choreograph.costs]\nbad = bad:C\n"
MODULE = "LAYOUT = 'a single NAME.bad'\ndef read(path):\n    return []\n"
CLASS = "import choreograph as cg\nclass C(cg.Cost):\n    name = 'bad'\n"
DANCES = "    settings = frozenset()\n    def check(self, *_): pass\n    def plan(self, request): pass\n"


@pytest.fixture
def site():
    """A folder of packages, which is none of the files of tests that a command should declare."""
    with TemporaryDirectory() as folder:
        yield Path(folder)


@contextmanager
def notes_with(folder, caplog, source, entry_points):
    """The notes of what is done in the block with the package `bad` installed."""
    notes: list[str] = []
    caplog.clear()
    with caplog.at_level(logging.WARNING), installed_package(folder, "bad", source, entry_points):
        yield notes
        notes += [record.getMessage() for record in caplog.records if record.name == "choreograph"]


def use_all():
    """What commands use of other packages."""
    names = installed_names(COST_GROUP)
    return added_formats(), engines(), installed_costs(names), engine_names(), names


@pytest.mark.parametrize(
    ("source", "entry_points", "says"),
    [
        ("import no_such_module_at_all", ALL, "ModuleNotFoundError: No module named 'no_such_module_at_all'"),
        ("raise SystemExit(3)", ALL, "SystemExit: 3"),
        ("def (", ALL, "SyntaxError: "),
        ("1 / 0", ALL, "ZeroDivisionError"),
        ("x = 1", ENGINE, "AttributeError: module 'bad' has no attribute 'E'"),
        ("x = 1", "[choreograph.engines]\nbad = no value !\n", "Error: "),
        ("x = 1", "[choreograph.engines]\nneither name nor value\n", "its entry points are damaged"),
        ("def __getattr__(name):\n    raise RuntimeError('a\\nb')", FORMAT, "RuntimeError: a b"),
        (MODULE, FORMAT, "expected SUFFIXES or a function detect"),
        (MODULE + "SUFFIXES = '.bad'", FORMAT, "expected SUFFIXES as a list of texts, got '.bad'"),
        (MODULE + "SUFFIXES = ('bad',)", FORMAT, "expected SUFFIXES such as .bvh, got ('bad',)"),
        (MODULE + "SUFFIXES = ('.bad',)\nLAYOUT = 3", FORMAT, "expected LAYOUT as text, got 3"),
        ("x = 1", FORMAT, "expected a function read or WRITERS"),
        ("WRITERS = (3,)", FORMAT, "expected WRITERS as subclasses of Writer, got 3"),
        ("class E:\n    def __init__(self): raise OSError('no')\n", ENGINE, "OSError: no"),
        ("class E:\n    name = 'other'\n" + DANCES, ENGINE, "expected an engine with the name 'bad'"),
        ("class E:\n    name = 'bad'\n    settings = (3,)\n", ENGINE, "expected the settings of the engine"),
        ("class E:\n    name = 'bad'\n    settings = check = plan = ()\n", ENGINE, "methods check and plan"),
        ("class C:\n    name = 'bad'\n", COST, "expected a subclass of Cost with the name 'bad'"),
        (CLASS.replace("'bad'", "'other'"), COST, "expected a subclass of Cost with the name 'bad'"),
        (CLASS + "    def __init__(self, x): pass\n", COST, "TypeError"),
    ],
)  # fmt: skip
def test_what_cannot_be_loaded_is_left_out_with_one_note(tmp_path, caplog, source, entry_points, says):
    with notes_with(tmp_path, caplog, source, entry_points) as notes:
        use_all()
        formats, known, costs, names, _ = use_all()
        assert not formats and not costs and tuple(known) == names == ("graph", "mixer", "rollout")
        assert "bad" not in installed_names(COST_GROUP)
    (note,) = notes
    assert note.startswith("the package bad could not be loaded and is left out: ") and says in note
    assert "\n" not in note


def test_built_in_names_stay_those_of_the_program(tmp_path, caplog):
    source = (
        "import choreograph as cg\nfrom choreograph.formats.writer import Writer\n"
        "class E:\n    name = 'graph'\n" + DANCES + "class C(cg.Cost):\n    name = 'genre'\n"
        "class W(Writer):\n    format = 'html'\n    def write(self, motion, path): pass\n"
        "class F:\n    WRITERS = (W,)\n"
    )
    points = (
        "[choreograph.engines]\ngraph = bad:E\n[choreograph.costs]\ngenre = bad:C\n"
        "[choreograph.formats]\nbvh = bad:F\nmine = bad:F\n"
    )
    with notes_with(tmp_path, caplog, source, points) as notes:
        formats, known, costs, names, _ = use_all()
        assert not formats and not costs and names == ("graph", "mixer", "rollout")
        assert type(known["graph"]).__module__ == type(engine_named("graph")).__module__ != "bad"
    assert len(notes) == 4
    for name in ("graph", "genre", "bvh", "html"):
        assert sum(f"'{name}'" in note and "built" in note for note in notes) == 1, name


def test_of_two_packages_with_one_name_the_second_is_left_out(tmp_path, caplog):
    source = "class E:\n    name = 'bad'\n" + DANCES
    with (
        installed_package(tmp_path / "other", "other", source, "[choreograph.engines]\nbad = other:E\n"),
        notes_with(tmp_path, caplog, source, ENGINE) as notes,
    ):
        assert type(engine_named("bad")).__module__ == "bad"
    (note,) = notes
    assert "package other could not" in note and "is also a name of the package bad" in note


def test_a_format_that_fails_at_a_file_is_left_out(tmp_path, caplog):
    save_motion(tmp_path / "a.bvh", stepping(30))
    source = MODULE + "def detect(path):\n    raise KeyError('boo')\n"
    with notes_with(tmp_path, caplog, source, FORMAT) as notes:
        for _ in range(2):
            assert [take.name for take in import_takes(tmp_path / "a.bvh")] == ["a"]
        assert not added_formats()
    assert notes == ["the package bad could not be loaded and is left out: KeyError: 'boo'"]


def test_commands_go_on_without_a_broken_package(tmp_path, site, caplog):
    save_motion(tmp_path / "a.bvh", stepping(30))
    for command in (
        ["--help"], ["dance", "--help"], ["studio", "--help"], ["settings"], ["settings", "weights"],
        ["convert", tmp_path / "a.bvh", tmp_path / "b.npz"],
    ):  # fmt: skip
        with notes_with(site, caplog, "1 / 0", ALL) as notes:
            done = run(*command)
            assert done.exit_code == 0, done.output
        assert len(notes) <= 1, notes


def test_what_a_broken_package_adds_is_refused_by_name(tmp_path, site, caplog):
    song = tmp_path / "none.wav"
    for entry_points, asked in ((ENGINE, ["--engine", "bad"]), (COST, ["--weight", "bad=1"])):
        with notes_with(site, caplog, "1 / 0", entry_points) as notes:
            refused = run("dance", song, "-o", tmp_path / "a.npz", *asked)
            assert_one_line(refused, says="got 'bad'")
            assert not list(tmp_path.glob("a.*"))
        assert len(notes) == 1
    with notes_with(site, caplog, "1 / 0", ENGINE):
        config = DanceConfig(engine="bad")  # it is not loaded before a dance
        with pytest.raises(cg.ParameterError, match="expected engine among graph, mixer, rollout, got 'bad'"):
            engine_named(config.engine)
