"""No output is an input, of any command, however it is spelled; default names replace no file of others."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path

import click
import pytest
from command_line import all_commands, assert_one_line, run
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping

import choreograph as cg
from choreograph.cli.dance import DanceJob, jobs_of, with_free_names
from choreograph.cli.declared import Changed, Input, Output
from choreograph.formats.register import save_motion
from choreograph.pipeline.saving import is_saved_dance

MINE = b"mine, and of no format: nothing may be read before the outputs are checked"

COMMANDS = all_commands()


def cases() -> Iterator[object]:
    """Each input of each command beside each of its outputs, as the command declares them."""
    for name, command in COMMANDS.items():
        for read, written in product(command.params, command.params):
            if read is not written and isinstance(read.type, Input) and _is_output(written):
                yield pytest.param(name, read, written, id=f"{name} {read.name} {written.name}")


def _is_output(param: click.Parameter) -> bool:
    return isinstance(param.type, Output | Changed)


def words_of(command: click.Command, values: Mapping[click.Parameter, str]) -> list[str]:
    """A command line with these values. Other arguments and options that are required name other files."""
    options, arguments = [], []
    for param in command.params:
        value = values.get(param, "other/s.wav" if param.required else None)
        if isinstance(param, click.Argument):
            arguments += [] if value is None else [value]
        elif value is not None:
            options += [max(param.opts, key=len), value]
    return [*options, "--", *arguments]


def spelled_inside(kind: Input, name: str) -> str:
    """A text that names a file as an input of this kind does."""
    return next(text for text in (name, f"@{name}", f"x={name}") if list(kind.files(text)))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Files that are beside what the cases are about: none is read."""
    monkeypatch.chdir(tmp_path)
    for name in ("s.wav", "d.bvh", "hero.glb", "other/s.wav"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_bytes(b"other")
    return tmp_path


def spelled(mine: Path, folder: Path) -> dict[str, Path]:
    """The file by other names: as the system has it, one file."""
    links = folder / "links"
    links.mkdir()
    (links / f"soft{mine.suffix}").symlink_to(mine)
    os.link(mine, links / f"hard{mine.suffix}")
    (links / "parent").symlink_to(mine.parent)
    return {
        "relative": mine.relative_to(folder), "absolute": mine, "soft link": links / f"soft{mine.suffix}",
        "hard link": links / f"hard{mine.suffix}", "linked folder": links / "parent" / mine.name,
    }  # fmt: skip


# Outputs whose value is a folder: what is written in it is no file of the user's.
FOLDERS = {("get", "output"), ("inspect", "plots"), ("songs", "folder")}
# Changed files that are read alone: the folder of a library, and the repertoire that takes are added to.
ALONE = {("library create", "directory"), ("library add", "directory"), ("library remove", "directory")}


@pytest.mark.parametrize(("name", "read", "written"), list(cases()))
def test_no_output_is_an_input(folder, name, read, written):
    command = COMMANDS[name]
    mine = (folder / "mine.bvh").resolve()
    mine.write_bytes(MINE)
    given = spelled_inside(read.type, mine.name)
    before, names = contents(folder), spelled(mine, folder)
    if (name, written.name) in FOLDERS:
        names = {}
    for how, output in names.items():
        words = words_of(command, {read: given, written: str(output)})
        if (name, written.name) == ("build-db", "sources"):
            words = ["--remove", "x", *words]
        result = run(*name.split(), *words)
        assert_one_line(result, says="input")
        assert {path: data for path, data in contents(folder).items() if path in before} == before, how
    if read.type.inside is None and read.type.kind in ("takes", "repertoire") and names:
        (folder / "inside").mkdir()
        inside = mine.rename(folder / "inside" / mine.name)
        words = words_of(command, {read: "inside", written: str(inside)})
        if (name, written.name) != ("build-db", "sources"):
            assert_one_line(run(*name.split(), *words), says="input")
            assert inside.read_bytes() == MINE


def test_every_file_of_a_command_is_declared():
    """What the help calls a file, a folder, a song or a motion is declared. No other type names a path."""
    for name, command in COMMANDS.items():
        for param in command.params:
            declares = isinstance(param.type, Input | Output)
            named = re.search(r"\b(FILE|DIR|FOLDER|SONG|MOTION|SOURCE)\b", str(param.metavar))
            assert declares or not isinstance(param.type, click.Path), (name, param.name)
            assert declares or not named, (name, param.name)
    assert len(list(cases())) >= 80


@pytest.mark.parametrize("suffix", [".wav", ".counts.csv"])
def test_what_is_read_beside_an_input_is_an_input(folder, suffix):
    Path("walk.bvh").write_bytes(MINE)
    beside = Path(f"walk{suffix}")
    beside.write_bytes(MINE)
    outputs = {".wav": "link.json", ".counts.csv": "link.csv"}[suffix]
    Path(outputs).symlink_to(beside)
    command = {".wav": ("inspect", "--signature", "walk.bvh"), ".counts.csv": ("count", "walk.bvh")}[suffix]
    result = run(*command, "-o", outputs)
    assert_one_line(result, says="input")
    assert beside.read_bytes() == MINE


def test_files_that_a_gltf_refers_to_are_inputs(folder):
    Path("hero.json").write_bytes(MINE)
    asset = {"asset": {"version": "2.0"}, "buffers": [{"uri": "hero.json", "byteLength": len(MINE)}]}
    Path("hero.gltf").write_text(json.dumps(asset))
    result = run("retarget", "d.bvh", "hero.gltf", "-o", "a.glb", "--save-map", "hero.json")
    assert_one_line(result, says="input")
    assert Path("hero.json").read_bytes() == MINE


def test_songs_are_copied_beside_files_of_their_names(folder):
    Path("house.ogg").write_bytes(MINE)
    result = run("songs", "--copy", ".")
    assert result.exit_code == 0 and "note: house.ogg is another file" in result.stderr
    assert Path("house.ogg").read_bytes() == MINE and Path("house-new.ogg").stat().st_size > 1000
    first = contents(folder)
    assert run("songs", "--copy", ".").exit_code == 0 and contents(folder) == first


def test_a_map_is_not_written_before_the_motion_is_read(folder):
    write_character(folder / "hero.glb", CHARACTERS["unreal"])
    assert_one_line(
        run("retarget", "d.bvh", "hero.glb", "-o", "a.glb", "--save-map", "map.json"), says="d.bvh"
    )
    assert not Path("map.json").exists()
    assert_one_line(run("retarget", "d.bvh", "hero.glb", "-o", "a.glb", "--save-map", "d.bvh"), says="input")


@pytest.mark.parametrize("second", ["{folder}/d.bvh", "./d.bvh", "soft.bvh", "hard.bvh", "linked/d.bvh"])
def test_two_spellings_of_an_output_are_one_file(folder, second):
    Path("soft.bvh").symlink_to("d.bvh")
    os.link("d.bvh", "hard.bvh")
    Path("linked").symlink_to(".")
    before = contents(folder)
    result = run("dance", "s.wav", "-o", "d.bvh", "-o", second.format(folder=folder))
    assert_one_line(result, says="one file" if second != "./d.bvh" else "twice")
    assert contents(folder) == before


def test_a_song_named_by_dots_stays_in_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for song in ("...mp3", "..mp3", "....", ".mp3", "a..mp3"):
        for given in ("out/{song}/x.bvh", "out/{song}.bvh"):
            [job] = jobs_of([Path(song)], (Path(given),), False, None)
            [[path]] = job.outputs
            inside = Path(os.path.realpath(path)).relative_to(tmp_path / "out")
            assert len(inside.parts) == given.count("/") and ".." not in path.parts


# Names that are chosen by default


def named(jobs: tuple[DanceJob, ...]) -> list[str]:
    return [str(path) for job in jobs for outputs in job.outputs for path in outputs]


@pytest.mark.parametrize(
    ("songs", "given", "there", "expected"),
    [
        (["walk.wav"], [], ["walk.bvh"], ["walk-new.bvh", "walk-new.html"]),
        (["walk.wav"], [], ["walk.html", "walk-new.bvh"], ["walk-new-2.bvh", "walk-new-2.html"]),
        (["walk.wav"], ["walk.bvh"], ["walk.bvh"], ["walk.bvh"]),
        (["walk.wav"], ["{song}.bvh", "b.npz"], ["walk.bvh", "b.npz"], ["walk-new.bvh", "b.npz"]),
        (["a.wav", "a-new.wav"], [], ["a.bvh"], ["a-new-2.bvh", "a-new-2.html", "a-new.bvh", "a-new.html"]),
        (["clip.mp4"], ["{song}.mp4"], ["clip.mp4"], ["clip-new.mp4"]),
    ],
)  # fmt: skip
def test_default_names_are_of_no_file_of_others(folder, songs, given, there, expected):
    for name in there:
        Path(name).write_bytes(MINE)
    outputs, inputs = tuple(map(Path, given)), [Path(song) for song in songs]
    jobs, notes = with_free_names(jobs_of(inputs, outputs, False, None), outputs, inputs, force=False)
    assert named(jobs) == expected
    assert len(notes) == (expected[0] not in given)
    assert all(name in notes[0] for name in expected if "new" in name and name[0] in "cw")
    forced, _ = with_free_names(jobs_of(inputs, outputs, False, None), outputs, inputs, force=True)
    assert ("clip-new.mp4" in named(forced)) == ("clip.mp4" in there)  # never over an input
    assert [Path(name).read_bytes() for name in there] == [MINE] * len(there)


def test_a_recording_beside_its_song_stays(tmp_path, monkeypatch, db, song):
    monkeypatch.chdir(tmp_path)
    shutil.copy(song, "walk.wav")
    save_motion("walk.bvh", stepping(60))
    recording = Path("walk.bvh").read_bytes()
    dance = ("dance", "walk.wav", "--db", db, "--duration", 5)
    for _ in range(2):  # the second replaces the dance of the first
        danced = run(*dance)
        assert danced.exit_code == 0, danced.output
        assert (
            "note: walk.bvh is not a dance" in danced.stderr
            and "walk-new.bvh and walk-new.html" in danced.stderr
        )
        assert sorted(path.name for path in tmp_path.iterdir()) == [
            "walk-new.bvh", "walk-new.html", "walk.bvh", "walk.wav",
        ]  # fmt: skip
        assert Path("walk.bvh").read_bytes() == recording
    assert is_saved_dance("walk-new.bvh") and is_saved_dance("walk-new.html")


# Names near the system's limit, which is 255 bytes


def test_a_repertoire_with_a_long_name_is_built(tmp_path):
    folder = tmp_path / "takes"
    folder.mkdir()
    save_motion(folder / f"{'t' * 251}.bvh", stepping(300))
    for name in ("r" * 252 + ".h5", "r" * 255):
        built = cg.build(
            folder, tmp_path / name, preset="tiny", words=False, pretrained="nothing", lock_feet=False
        )
        assert built.repertoire.path.name == name
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize(
    "arguments",
    [
        ["dance", "s.wav", "-o", "x" * 252 + ".bvh"],
        ["dance", "x" * 252 + ".wav"],
        ["dance", "s.wav", "-o", "x" * 250 + ".bvh", "--variations", 12],
        ["convert", "d.bvh", "x" * 252 + ".bvh"],
        ["build-db", "other", "-o", "x" * 256],
        ["evaluate", "--songs", "other", "--json", "x" * 256],
        ["dance", "s.wav", "-o", "/".join(["f" * 250] * 20) + "/a.bvh"],
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_longer_names_are_refused_before_any_work(folder, arguments):
    before = contents(folder)
    result = run(*arguments)
    assert_one_line(result, says="cannot write")
    assert contents(folder) == before
