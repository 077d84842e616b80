"""The documentation holds: its commands and its Python run, its links work, its table of rooms is the code's.

The commands of a page run in a folder that holds the files which the pages name. They cost less here and mean
the same: songs last a few seconds and videos one, and a library of five takes stands for the built-in one. A
browser closes what it is shown, and no song is played. Lines of other programs are not run.
"""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import signal
import tomllib
import webbrowser
from dataclasses import asdict, fields, replace
from itertools import pairwise
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
import soundfile
from command_line import run
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks
from test_rooms import MAY_IMPORT

import choreograph as cg
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.formats.register import save_motion
from choreograph.library import repertoire as repertoire_module
from choreograph.nets import configs
from choreograph.pipeline.published import WEIGHTS, published_build, published_dance

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
GUIDES = {name: ROOT / name for name in ("README.md", "blender_extension/README.md")}
PAGES = GUIDES | {page.relative_to(DOCS).as_posix(): page for page in sorted(DOCS.rglob("*.md"))}
BESIDE = sorted({*ROOT.glob("*.md"), *ROOT.glob("data_schema/*.md")} - {*GUIDES.values()})
SONG_S = {"how-to/keep.md": 10.5, "how-to/edit.md": 10.5}  # they name parts that end at 10 s
SONG_S |= {"how-to/live.md": 1.5}  # it is sent as fast as it sounds
OF_BUILT_IN = ("how-to/stream.md",)  # pages that need the networks of the built-in library
SHORTER = {".mp4": ["--duration", "1"]}  # by the suffix of the output
QUIETER = {"live": ["--silent"]}  # by the command
WRITES = ("-o", "--plots", "--save-map", "--report", "--json")
TAKES = ("walk", "house-01", "house-07", "salsa-01", "swing-01")
BUILD = "choreograph build-db takes/ -o library.h5 --preset tiny"
# `% not run: it needs Blender` above a block says why it is not run here.
BLOCK = re.compile(r"(?:^% not run: (\S[^\n]*)\n)?^```([^\n]*)\n(.*?)^```$", flags=re.S | re.M)
COMMANDS = ("console", "sh", "")  # languages of blocks of commands
OTHERS = ("pip install ", "make ", "blender ", "dask ", "arecord ")  # lines of other programs
NOT_RUN = {"how-to/library.md": 2, "how-to/live.md": 1, "how-it-works/papers.md": 4}  # commands
LINK = re.compile(r"\]\(([^)\s#:]*)(?:#([^)\s]+))?\)")


def blocks(page: Path, language: str, *, run: bool = True) -> list[str]:
    """The text of the blocks of a language that are run, or of those that are not."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [text for reason, of, text in found if of == language and bool(reason) != run]


def lines_of(page: Path, *, run: bool = True) -> list[str]:
    """The lines of commands, without comments and prompts."""
    texts = [text for language in COMMANDS for text in blocks(page, language, run=run)]
    lines = [line.partition(" #")[0].strip() for text in texts for line in text.splitlines()]
    return [line.removeprefix("$ ") for line in lines]


def commands(page: Path, *, run: bool = True) -> list[str]:
    return [line for line in lines_of(page, run=run) if line.startswith("choreograph ")]


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """What the pages name: a character, takes with their songs, a library of them, a motion and its beats."""
    folder = tmp_path_factory.mktemp("files")
    write_character(folder / "hero.glb", CHARACTERS["mixamo"])
    save_motion(folder / "take.bvh", stepping(6 * 30, seed=2))
    np.save(folder / "other.npy", stepping(6 * 30, seed=3).joint_pos_m())
    (first_beats,) = blocks(PAGES["how-to/beats.md"], "text")
    beats = "".join(f"{beat / 2:.2f} {(beat - 1) % 4 + 1}\n" for beat in range(1, 12))
    assert beats.startswith(first_beats)
    (folder / "beats.txt").write_text(beats)
    (places,) = blocks(PAGES["how-to/scene.md"], "json")
    (folder / "places.json").write_text(places)
    (folder / "takes").mkdir()
    (manifest,) = blocks(PAGES["how-to/library.md"], "text")
    rows = [f"{name},{name.split('-')[0]},Ada,CC0-1.0,our studio,0.0\n" for name in TAKES[1:]]
    (folder / "takes" / "manifest.csv").write_text(manifest + "".join(rows))
    for seed, name in enumerate(TAKES):
        save_motion(folder / "takes" / f"{name}.bvh", stepping(16 * 30, seed=seed))
        write_clicks(folder / "takes" / f"{name}.wav", duration_s=16.0)
    for source, name in (("new", "turn"), ("again", "house-01"), ("ours", "a"), ("edge", "a")):
        (folder / source).mkdir()
        save_motion(folder / source / f"{name}.bvh", stepping(12 * 30, seed=9))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for presets in (configs._DENSITY_PRESETS, configs._STYLE_PRESETS, configs._WORD_PRESETS):
            fewer = {name: 20 for name in ("steps", "music_steps") if hasattr(presets["tiny"], name)}
            patch.setitem(presets, "tiny", replace(presets["tiny"], **fewer))
        run_command(BUILD)
    return folder


SERVED = ("choreograph studio song.mp3",)  # until Ctrl-C stops it
STOPPED = 130  # the exit status then, unless the server ends before


def look_and_close(address: str) -> bool:
    """What a browser shows is there. If the program serves it, it is stopped as by Ctrl-C."""
    with urlopen(address, timeout=10) as page:
        assert b"<html" in page.read().lower()
    if address.startswith("http"):
        signal.raise_signal(signal.SIGINT)
    return True


def run_command(line: str) -> None:
    """Run a command of a page, which succeeds and writes all that it names."""
    _, *words = shlex.split(line)
    outputs = [after for word, after in pairwise(words) if word in WRITES]
    shorter = next((more for suffix, more in SHORTER.items() if any(o.endswith(suffix) for o in outputs)), [])
    result = run(*words, *shorter, *QUIETER.get(words[0], []))
    expected = (0, STOPPED) if line in SERVED else (0,)
    assert result.exit_code in expected, f"{line}: {result.output}"
    for output in map(Path, outputs):
        name = output.stem.replace("{song}", "") + "*" + output.suffix  # of several dances, each has a number
        assert any(output.parent.glob(name)), f"{line} did not write {output}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name for name, page in PAGES.items() if commands(page) or blocks(page, "python")]
)
def test_the_commands_and_the_python_of_a_page_run(name, files, tmp_path, monkeypatch):
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(webbrowser, "open", look_and_close)
    if name not in OF_BUILT_IN:
        monkeypatch.setattr(repertoire_module, "STARTER_PATH", tmp_path / "library.h5")
    house = cg.load_song(cg.example_songs()["house"], duration_s=SONG_S.get(name, 5.5))
    soundfile.write("song.mp3", house.samples, SAMPLE_RATE_HZ)
    for path in map(Path, ("other.mp3", "heldout/a.wav", "songs/a.wav")):
        path.parent.mkdir(exist_ok=True)
        soundfile.write(path, house.samples[: 3 * SAMPLE_RATE_HZ], SAMPLE_RATE_HZ)
    for line in commands(PAGES[name]):
        if not BUILD.startswith(line):  # the library that lies here was made so, with the shortest trainings
            run_command(line)
    for block in blocks(PAGES[name], "python"):
        exec(compile(block, name, "exec", dont_inherit=True), {})


@pytest.mark.parametrize("name", PAGES)
def test_the_python_of_a_page_names_public_names(name):
    for block in blocks(PAGES[name], "python") + blocks(PAGES[name], "python", run=False):
        compile(block, name, "exec")
        for public in re.findall(r"\bcg\.(\w+)", block):
            assert hasattr(cg, public), public


@pytest.mark.parametrize("name", PAGES)
def test_blocks_that_are_not_run_are_few_and_their_options_exist(name):
    lines = commands(PAGES[name], run=False)
    assert len(blocks(PAGES[name], "python", run=False)) + len(lines) == NOT_RUN.get(name, 0)
    for line in lines:
        _, *words = shlex.split(line)
        result = run(*words, "--help")
        assert result.exit_code == 0, result.output


@pytest.mark.parametrize("name", PAGES)
def test_lines_of_other_programs_name_extras_and_targets_that_exist(name):
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for line in lines_of(PAGES[name]) + lines_of(PAGES[name], run=False):
        assert line.startswith(("choreograph ", *OTHERS)), line
        assert set(re.findall(r"choreograph\[(\w+)\]", line)) <= set(extras), line
        if line.startswith("make "):
            assert re.search(rf"^{line.split()[1]}:", (ROOT / "Makefile").read_text(), flags=re.M), line


def headings(page: Path) -> set[str]:
    """The anchors of a page, as GitHub and MyST make them."""
    found = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in found}


@pytest.mark.parametrize(
    "page", [*PAGES.values(), *BESIDE], ids=lambda page: page.relative_to(ROOT).as_posix()
)
def test_links_lead_to_a_file_and_to_a_heading_of_it(page):
    for target, heading in LINK.findall(page.read_text(encoding="utf-8")):
        there = page.parent / target if target else page
        assert there.exists(), target
        assert not heading or heading in headings(there), f"{target}#{heading}"


def test_the_table_of_rooms_is_what_the_contracts_say():
    rows = re.findall(
        r"^\| `([\w.]+)/?` \|.*\| (.+) \|$", PAGES["contributing/rooms.md"].read_text(), flags=re.M
    )
    above: list[str] = []
    for room, cell in rows:
        room = room.removesuffix(".py")
        stated = above if cell == "all above" else [] if cell == "nothing" else re.findall(r"`(\w+)`", cell)
        # The root of the package, which has no row, is open to the commands only.
        assert set(stated) == set(MAY_IMPORT[room]) - {""}, room
        above.append(room)
    assert set(above) == set(MAY_IMPORT) - {"", "__main__"}


def test_the_page_of_the_papers_names_the_published_value_of_every_setting():
    """The last column of its tables. Widths are those of the preset paper."""
    rows = re.findall(r"^\|.*\| ([^|]*) \|$", PAGES["how-it-works/papers.md"].read_text("utf-8"), flags=re.M)
    named = {pair for row in rows for pair in re.findall(r"(\w+)=([^`]+)`", row)}
    engines = (published_dance(engine) for engine in ("graph", "mixer", "rollout"))
    dance = {(f.name, str(getattr(config, f.name))) for config in engines for f in fields(config)}
    build = published_build("paper")
    built = asdict(configs.rollout_config("paper", **build["rollout_changes"]))
    built |= build["style_changes"] | build["density_changes"] | build["rollout_changes"]
    published = dance | {(name, str(value)) for name, value in (built | WEIGHTS).items()}
    assert len(named) > 15
    plain = {(name, value.strip('"').capitalize().removesuffix(".0")) for name, value in named}
    assert plain <= {(name, value.capitalize().removesuffix(".0")) for name, value in published}


def test_figures_are_drawn_again_when_the_program_has_changed(tmp_path, monkeypatch):
    figures = runpy.run_path(str(DOCS / "figures.py"))
    monkeypatch.setattr(cg, "starter_repertoire", lambda: pytest.fail("drawn"))
    (tmp_path / "drawn-from.txt").write_text(figures["sources"]())
    figures["draw_all"](tmp_path)
    (tmp_path / "drawn-from.txt").write_text("an earlier program")
    with pytest.raises(pytest.fail.Exception, match="drawn"):
        figures["draw_all"](tmp_path)
