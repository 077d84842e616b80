"""`choreograph convert`, `retarget` and `dance --character` as a user meets them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_characters import CHARACTERS, write_character
from synthetic_motions import stepping, swaying

import choreograph as cg
from choreograph.cli.characters import NAMINGS
from choreograph.formats.bvh import BvhOptions, BvhWriter
from choreograph.formats.gltf_document import read_gltf
from choreograph.formats.register import import_takes, save_motion
from choreograph.formats.writer import NAMES

# `choreograph convert`, `retarget` and `dance --character` as a user meets them.


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_motion("dance.bvh", swaying(60))
    write_character(tmp_path / "hero.glb", CHARACTERS["unreal"])
    return tmp_path


def test_a_motion_is_converted(folder):
    converted = run("convert", "dance.bvh", "dance.glb")
    assert converted.exit_code == 0 and "24 joints" in converted.stdout
    assert read_gltf("dance.glb").json["animations"]
    assert run("convert", "dance.bvh", "dance.npz").exit_code == 0


def test_several_motions_are_clips_of_one_file(folder):
    save_motion("my walk.bvh", swaying(90))
    done = run("convert", "dance.bvh", "my walk.bvh", "all.glb", "--for", "godot", "--fps", 30)
    assert done.exit_code == 0, done.output
    assert done.stdout == "all.glb: dance 2.0 s, my_walk 3.0 s, 24 joints\n"
    document = read_gltf("all.glb")
    assert [each["name"] for each in document.json["animations"]] == ["dance", "my_walk"]
    assert {"Root", "Hips"} <= {node["name"] for node in document.json["nodes"]}
    done = run("retarget", "dance.bvh", "my walk.bvh", "hero.glb", "-o", "hero all.glb")
    assert done.exit_code == 0, done.output
    takes = list(import_takes("hero all.glb"))
    assert [take.name for take in takes] == ["hero all-dance", "hero all-my_walk"]
    for take, name in zip(takes, ("dance.bvh", "my walk.bvh"), strict=True):
        assert run("retarget", name, "hero.glb", "-o", "one.glb").exit_code == 0
        (one,) = import_takes("one.glb")
        assert np.allclose(take.motion.joint_pos_m(), one.motion.joint_pos_m(), atol=1e-5)


def test_a_character_dances_in_place_for_vrchat(folder):
    assert run("retarget", "dance.bvh", "hero.glb", "-o", "a.glb", "--for", "vrchat").exit_code == 0
    (take,) = import_takes("a.glb")
    assert np.ptp(take.motion.root_pos_m[:, [0, 2]], axis=0).max() < 0.02  # feet are locked afterwards


def test_a_motion_is_put_onto_a_character_by_a_map_that_was_saved(folder):
    first = run("retarget", "dance.bvh", "hero.glb", "-o", "a.glb", "--save-map", "map.json")
    assert first.exit_code == 0 and "22 bones of 34 known" in first.stdout
    again = run("retarget", "dance.bvh", "hero.glb", "-o", "b.glb", "--map", "map.json")
    assert again.exit_code == 0
    assert (folder / "a.glb").read_bytes() == (folder / "b.glb").read_bytes()


def test_a_song_is_danced_by_a_character(folder, db, song):
    danced = run(
        "dance", song, "--db", db, "--duration", 8, "--character", "hero.glb", "-o", "a.glb", "-o", "a.bvh"
    )
    assert danced.exit_code == 0, danced.output
    names = {node.get("name") for node in read_gltf("a.glb").json["nodes"]}
    assert "thigh_l" in names and (folder / "a.bvh").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["convert", "dance.bvh", "dance.xyz"], "xyz"),
        (["convert", "nothing.bvh", "a.glb"], "nothing.bvh"),
        (["convert", ".", "a.glb"], "folder"),
        (["retarget", "dance.bvh", "hero.glb", "-o", "a.bvh"], "glb"),
        (["retarget", "dance.bvh", "dance.bvh", "-o", "a.glb"], "dance.bvh"),
        (["retarget", "dance.bvh", "hero.glb", "-o", "a.glb", "--map", "dance.bvh"], "map"),
        (["dance", "song.wav", "--character", "hero.glb", "-o", "a.mp4"], "-o NAME.html"),
        (["dance", "song.wav", "--map", "map.json"], "--character"),
        (["dance", "song.wav", "-o", "a.bvh", "--camera", "cuts"], "-o NAME.html"),
        (["convert", "dance.bvh", "a.glb", "--units", "m"], "-o NAME.bvh"),
        (["convert", "dance.bvh", "hero.glb", "a.bvh"], "a .glb for 2 motions"),
        (["convert", "dance.bvh", "dance.bvh", "a.glb"], "dance.bvh again"),
        (["convert", "dance.bvh", "a.glb", "--for", "mmd"], "a file .vmd for mmd"),
        (["convert", "dance.bvh", "a.bvh", "--for", "unity"], "-o NAME.glb"),
        (["retarget", "dance.bvh", "dance.bvh", "hero.glb", "-o", "a.glb"], "dance.bvh again"),
        (["retarget", "dance.bvh", "hero.glb", "hero.glb", "-o", "a.fbx"], "a .glb for 2 motions"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_said_in_a_line(folder, arguments, says):
    before = set(folder.iterdir())
    assert_one_line(run(*arguments), says=says)
    assert set(folder.iterdir()) == before


def test_a_bvh_has_the_names_units_and_rate_that_are_asked_for(folder):
    converted = run(
        "convert", "dance.bvh", "ue.bvh", "--names", "ue", "--units", "m", "--fps", 24, "--in-place"
    )
    assert converted.exit_code == 0, converted.output
    text = (folder / "ue.bvh").read_text()
    assert "ROOT pelvis" in text and "JOINT thigh_l" in text and f"Frame Time: {1 / 24:.10f}" in text
    rows = np.array([line.split()[:3] for line in text.split("Frame Time:")[1].splitlines()[1:]], float)
    assert np.ptp(rows[:, [0, 2]], axis=0).max() == 0 and 0.5 < rows[:, 1].mean() < 1.2
    assert run("convert", "ue.bvh", "back.glb").exit_code == 0


def test_namings_are_those_that_can_be_written():
    assert tuple(NAMES) == NAMINGS


@pytest.mark.parametrize("command", ["convert", "retarget"])
def test_notes_of_the_import_are_printed(folder, command):
    save_motion("huge.bvh", swaying(60), writer=BvhWriter(BvhOptions(units_per_m=9e6 / 1.7)))
    options = ["hero.glb", "-o"] if command == "retarget" else []
    done = run(command, "huge.bvh", *options, "a.glb")
    assert done.exit_code == 0, done.output
    (notes,) = (take.notes for take in import_takes("huge.bvh"))
    assert notes and done.stderr.splitlines() == [f"note: {note}" for note in notes]
    assert any("scale" in note for note in notes)


# `choreograph count` as a user meets it.


def test_a_song_is_described_and_its_counts_are_written(tmp_path):
    song, labels = cg.example_songs()["waltz"], tmp_path / "waltz.txt"
    result = run("count", song, "-o", labels)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0] == "waltz: 43.8 s, a song at 90.0 BPM, 3 counts in a bar"
    assert lines[1].startswith("counts: 66, 0.26 s to 43.55 s, tracked in the song, confidence ")
    assert lines[2].startswith("count 1: 0.26, 2.25, 4.26")
    assert any(line.startswith("loop of 8 bars: ") for line in lines)
    assert any(line.startswith("phrase A: 0.26 s to 8.26 s, 12 counts") for line in lines)
    assert lines[-1] == f"{labels}: 66 counts"
    assert labels.read_text().count("\n") == 66 + sum(line.startswith("phrase") for line in lines)


def test_a_motion_is_described_as_json(tmp_path):
    save_motion(tmp_path / "steps.bvh", stepping(20 * 30, period_s=0.5))
    (tmp_path / "steps.counts.csv").write_text("time_s,number\n1,1\n1.5,2\n2,1\n2.5,2\n3,1\n")
    result = run("count", tmp_path / "steps.bvh", "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert (facts["kind"], facts["tempo_bpm"], facts["metre"]) == ("motion", 120.0, 2)
    assert [loop["n_counts"] for loop in facts["loops"]] == [2, 4]
    text = run("count", tmp_path / "steps.bvh").stdout
    assert "stated beside the file" in text and "cm apart" in text


def test_errors_are_one_line(tmp_path):
    assert_one_line(run("count", tmp_path / "none.mp3"), says="there is no such file")
    song = cg.example_songs()["waltz"]
    assert_one_line(run("count", song, "-o", tmp_path / "a.mid"), says="expected a name ending in .csv")
    assert not list(tmp_path.iterdir())
