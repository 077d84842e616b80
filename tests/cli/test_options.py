"""Options that commands share: given once, times, and which files an option is for."""

from __future__ import annotations

import json
from itertools import combinations, product
from pathlib import Path

import click
import pytest
from command_line import all_commands, assert_one_line, run
from synthetic_characters import CHARACTERS, write_character

from choreograph.formats import output_formats

# What each option of files needs beside it, and the formats that it acts on.
FILE_OPTIONS = {
    "--character": (["hero.glb"], {"html", "glb", "fbx"}),
    "--camera": (["cuts"], {"html", "mp4", "glb", "usda", "usdc"}),
    "--loop": ([], {"bvh", "npz", "glb", "vrma", "vmd", "usda", "usdc", "fbx"}),
    "--click": ([], {"mp4"}),
}


def once_only() -> list[tuple[str, str]]:
    """Every option of every command that is not to be repeated: (command, flag)."""
    return [
        (name, max(option.opts, key=len))
        for name, command in all_commands().items()
        for option in command.params
        if isinstance(option, click.Option) and option.name != "help" and option.opts and not option.multiple
    ]


@pytest.mark.parametrize(("command", "flag"), once_only())
def test_an_option_given_twice_is_refused(tmp_path, monkeypatch, command, flag):
    monkeypatch.chdir(tmp_path)
    option = next(o for o in all_commands()[command].params if flag in o.opts)
    choices = getattr(option.type, "choices", ("1",))
    twice = [flag] * 2 if option.is_flag else [flag, choices[0], flag, choices[-1]]
    if option.secondary_opts:
        twice = [flag, option.secondary_opts[0]]
    arguments = ["x"] * sum(
        isinstance(p, click.Argument) and p.required for p in all_commands()[command].params
    )
    assert_one_line(run(*command.split(), *arguments, *twice), says=f"expected {flag} once, got it 2 times")
    assert not list(tmp_path.iterdir())


def test_the_options_to_repeat_are_few():
    repeated = {
        (name, max(option.opts, key=len))
        for name, command in all_commands().items()
        for option in command.params
        if isinstance(option, click.Option) and option.multiple
    }
    assert repeated == {
        ("build-db", "--add"), ("build-db", "--replace"), ("build-db", "--remove"),
        ("build-db", "--leave-out"), ("build-db", "--set"), ("dance", "--output"), ("dance", "--pin"),
        ("dance", "--ban"), ("dance", "--keep"), ("dance", "--swap"), ("dance", "--vary"),
        ("dance", "--repeat"), ("dance", "--set"), ("dance", "--weight"),
        ("evaluate", "--only"), ("evaluate", "--variants"), ("inspect", "--coverage"),
        ("dance", "--db"), ("evaluate", "--db"),
        ("live", "--db"), ("studio", "--db"), ("scene", "--db"),
        ("scene", "--formation"), ("scene", "--relation"), ("scene", "--genre"), ("scene", "--character"),
        ("scene", "--set"), ("scene", "--output"),
    }  # fmt: skip


@pytest.fixture
def notes_of(monkeypatch, tmp_path, db, song):
    """Runs `dance` with options, without dancing or writing: its result, and the notes on all dances."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("choreograph.pipeline.saving.check_outputs", lambda paths: None)
    write_character(tmp_path / "hero.glb", CHARACTERS["mixamo"])
    monkeypatch.setattr("choreograph.cli.dance.run_jobs", lambda *_, **__: [])
    shown = []
    monkeypatch.setattr("choreograph.cli.dance.present", lambda results, notes, **_: shown.append(notes))

    def notes_of(*options):
        shown.clear()
        result = run("dance", song, "--db", db, *options)
        return result, list(shown[0]) if shown else []

    return notes_of


@pytest.mark.parametrize("option", FILE_OPTIONS)
def test_an_option_of_files_is_used_refused_or_noted(notes_of, option):
    values, used = FILE_OPTIONS[option]
    for suffixes in [*product(output_formats()), *combinations(output_formats(), 2)]:
        result, notes = notes_of(option, *values, *(f"-oa.{suffix}" for suffix in suffixes))
        unused = [suffix for suffix in suffixes if suffix not in used]
        if len(unused) == len(suffixes):
            assert_one_line(result, says=f" for {option}, got ")
        elif option == "--character" and {"usda", "usdc"} & set(unused):
            assert_one_line(result, says="expected no USD file with --character")
        else:
            assert result.exit_code == 0, result.output
            assert notes == [f"{option} has no effect on .{suffix}" for suffix in unused]


def test_all_that_is_said_of_files_is_one_note(notes_of):
    result, notes = notes_of(
        "-oa.bvh", "-oa.glb", "-oa.mp4", "-oa.json", "--camera", "front", "--loop", "--click"
    )
    assert result.exit_code == 0, result.output
    assert notes == [
        "--camera has no effect on .bvh and .json; --loop has no effect on .mp4 and .json; --click has no "
        "effect on .bvh, .glb and .json"
    ]
    assert notes_of("-oa.bvh", "-oa.mp4", "--camera", "cuts")[1] == ["--camera has no effect on .bvh"]


def test_a_program_gets_the_file_that_it_reads(notes_of):
    assert notes_of("-oa.glb", "-oa.mp4", "--for", "unreal")[1] == ["--for has no effect on .mp4"]
    result, notes = notes_of("-oa.vmd", "--for", "mmd")
    assert result.exit_code == 0 and notes == ["the danced part of the song is written to a.wav"]
    Path("b.wav").write_bytes(b"mine")
    assert_one_line(notes_of("-ob.vmd", "--for", "mmd")[0], says="expected no file b.wav")
    assert_one_line(notes_of("-oa.glb", "--for", "mmd")[0], says="expected a file .vmd for mmd, got a.glb")
    assert_one_line(notes_of("-oa.bvh", "--for", "godot")[0], says=" for --for, got ")


@pytest.mark.parametrize("option", [["--names", "ue"], ["--units=m"], ["--rest", "t"], ["--in-place"]])
def test_an_option_that_was_moved_says_what_to_write(tmp_path, monkeypatch, option):
    monkeypatch.chdir(tmp_path)
    flag = option[0].partition("=")[0]
    moved = f"expected no {flag}, which `convert` has: write `choreograph convert dance.bvh other.bvh {flag}`"
    assert_one_line(run("dance", "a.wav", *option), says=moved)
    assert "No such option" in run("dance", "a.wav", "--nothing").stderr


def test_options_that_another_makes_useless_are_refused(tmp_path, monkeypatch, db):
    monkeypatch.chdir(tmp_path)
    for arguments, says in (
        (("songs", "--path", "house", "--copy", "x"), "expected no --copy beside --path: leave it out"),
        (("songs", "--path", "house", "--json"), "expected no --json beside --path"),
        (("inspect", db, "--counts", "take0", "-o", "x.csv", "--json"), "expected no --json beside --counts"),
        (("inspect", db, "--counts", "take0"), "expected --output beside --counts, got none"),
        (("inspect", db, "--signature", "a", "-o", "x.json", "--plots", "x"), "got --plots and --signature"),
        (("inspect", db, "--lint", "--notes"), "got --notes and --lint"),
        (("inspect", db, "--lint", "--check"), "got --check and --lint"),
        (("inspect", db, "--take", "x"), "expected no --take without --notes"),
        (
            ("build-db", "--add", "x", db, "--preset", "tiny"),
            "expected no --preset beside --add, ",
        ),
        (("build-db", "--remove", "x", db, "--set", "seed=1"), "expected no --set beside --add"),
        (("build-db", "--remove", "x", db, "--check"), "got --check and --remove"),
        (("build-db", "--remove", "x", db, "x.h5"), "expected one repertoire to change, got 2"),
        (("inspect", db, "--lint", "-o", "x.png"), "expected no --output beside --lint"),
        (("inspect", db, "--coverage", "x.wav", "-o", "x.svg"), "expected a .png for --coverage"),
        (("evaluate", "x.bvh", "x.wav", "--seeds", "5"), "expected no --seeds beside DANCE... SONG"),
        (("evaluate", "x.bvh", "x.wav", "--songs", "x"), "expected one of DANCE... SONG, --songs, got"),
        (("evaluate", "--songs", "x", "--page", "x.html"), "expected no --page beside --songs"),
        (("dance", "x.wav", "--existing", "x.json"), "expected --keep, --swap, --vary, --repeat, --pin or"),
        (("dance", "x.wav", "--swap", "1-2"), "expected --existing beside --swap, got none"),
        (("dance", "x.wav", "--keep", "1-2"), "expected --existing beside --keep, got none"),
        (("dance", "x.wav", "--map", "x.json"), "expected --character beside --map, got none"),
        (("dance", "x.wav", "--existing", "x.json", "--swap", "1-2", "--keep", "3-4"), "expected no --keep"),
        (("live", "--input", "-", "--dance", "x.bvh"), "expected one of --input, --dance, got"),
        (("live", "x.wav", "--input", "-"), "expected no SONG beside --input"),
        (("live", "x.wav", "--dance", "x.bvh", "--seed", "3"), "expected no --seed beside --dance"),
        (("get", "--agree"), "expected no --agree without NAME"),
        (("settings", "--toml", "--build"), "expected one of --build, --toml"),
        (("build-db", "x", "-o", "x.h5", "--set", "rollout_teacher=false"), "expected --rollout beside"),
        (
            ("build-db", "x", "-o", "x.h5", "--published", "--set", "augment_mirror=true"),
            "decides augment_mirror",
        ),
    ):
        assert_one_line(run(*arguments), says=says)
        assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_times_may_be_minutes_and_seconds(tmp_path, monkeypatch, db, song):
    monkeypatch.chdir(tmp_path)
    asked = ("dance", song, "--db", db, "--set", "candidates=4", "-o", "a.json")
    for start, duration in (("1.5", "4"), ("0:01.5", "0:04"), ("0:00:01.5", "0:4")):
        made = run(*asked, "--start", start, "--duration", duration, "--pin", "0:01-0:02=take:take1")
        assert made.exit_code == 0, made.output
        plan = json.loads((tmp_path / "a.json").read_text())
        assert (plan["start_s"], plan["duration_s"]) == (1.5, 4.0)
        assert plan["seconds"][1]["take"] == "take1"
    for text in ("soon", "1:75", "1:", ":5", "1:2:3", "1:02:03:04"):
        refused = run(*asked, "--start", text)
        assert refused.exit_code == 2 and "expected a time in seconds" in refused.output


@pytest.mark.slow
def test_notes_on_files_are_shown_and_in_the_json(tmp_path, monkeypatch, db, song):
    monkeypatch.chdir(tmp_path)
    asked = ("dance", song, "--db", db, "--set", "candidates=4", "-oa.bvh", "-oa.json", "--loop")
    said = "--loop has no effect on .json"
    assert f"note: {said}" in run(*asked).stderr
    assert said in json.loads(run(*asked, "--json").stdout)["notes"]
    assert said not in run(*asked, "-q").output
