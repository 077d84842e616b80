"""The extension as Blender has it: built, installed, and danced with.

Set CHOREOGRAPH_BLENDER, or have `blender` on the path; otherwise these tests skip.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from gltf_worlds import node_worlds, skinned_vertices_m
from scipy.spatial import cKDTree
from synthetic_characters import CHARACTERS, write_character

import choreograph as cg
from choreograph.characters.character import perform, read_character
from choreograph.formats.fbx import find_blender

ROOT = Path(__file__).resolve().parents[2]
SONG = cg.example_songs()["house"]
FPS, N_FRAMES, FIRST_FRAME, START_S = 30.0, 240, 11, 1.5
RIGS = ("mixamo", "unreal", "metarig", "generated")
WHOLE = "mixamo"  # with which what no rig changes is tried as well: errors, pins, the interface

with_one_rig = pytest.mark.parametrize("seen", [WHOLE], indirect=True)
with_bones_of_the_file = pytest.mark.parametrize("seen", RIGS[:3], indirect=True)
with_a_generated_rig = pytest.mark.parametrize("seen", ["generated"], indirect=True)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_blender() is None, reason="no Blender on this machine"),
]


def in_blender(script: Path, *arguments: object, user: Path, path: Path = ROOT) -> None:
    """Let Blender run a script, with the user's folder in `user` and programs first looked for in `path`."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment |= {"BLENDER_USER_RESOURCES": str(user), "PATH": f"{path}{os.pathsep}{environment['PATH']}"}
    blender = [*find_blender()]
    if "--python" in blender:
        blender[1:1] = ["--python-exit-code", "1"]
    done = subprocess.run(
        [*blender, str(script), "--", *map(str, arguments)], capture_output=True, text=True, check=False,
        env=environment, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """The extension, validated and built by Blender's own command."""
    folder = tmp_path_factory.mktemp("package")
    script = folder / "build.py"
    script.write_text(
        "import subprocess, sys, bpy\n"
        "from pathlib import Path\n"
        "command = Path(bpy.utils.system_resource('SCRIPTS'), 'addons_core/bl_pkg/cli/blender_ext.py')\n"
        "source, folder = sys.argv[sys.argv.index('--') + 1 :]\n"
        "for words in (('validate', source), ('build', '--source-dir', source, '--output-dir', folder)):\n"
        "    subprocess.run([sys.executable, str(command), *words], check=True)\n"
    )
    in_blender(script, ROOT / "blender_extension", folder, user=folder / "user")
    (made,) = folder.glob("*.zip")
    return made


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The program of this checkout, to be called as an installed one is."""
    path = tmp_path_factory.mktemp("program") / "choreograph"
    path.write_text(
        f"#!{sys.executable}\nimport sys\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from choreograph.cli.main import main\nmain()\n"
    )
    path.chmod(0o755)
    return path


@pytest.fixture(scope="module")
def dances():
    """The dances that the program makes with seed 0 and 1."""
    return [cg.dance(SONG, seed=seed, fps=FPS, start_s=START_S, duration_s=N_FRAMES / FPS) for seed in (0, 1)]


@pytest.fixture(scope="module", params=RIGS)
def seen(request, package, program, tmp_path_factory):
    """What Blender saw, and the character's file."""
    folder = tmp_path_factory.mktemp(request.param)
    character, job = folder / "hero.glb", folder / "job.json"
    if request.param in CHARACTERS:
        write_character(character, CHARACTERS[request.param])
    wrong = folder / "wrong.wav"
    wrong.write_bytes(b"no sound")
    written = {
        "package": package, "program": program, "character": character, "song": SONG, "wrong_song": wrong,
        "seen": folder / "seen.json",
    }  # fmt: skip
    kinds = {"rig": request.param, "is_whole": request.param == WHOLE}
    job.write_text(json.dumps({key: str(path) for key, path in written.items()} | kinds))
    in_blender(Path(__file__).with_name("in_blender.py"), job, user=folder / "user")
    return json.loads((folder / "seen.json").read_text()), character


@pytest.mark.parametrize(("which", "seed"), [("danced", 0), ("again", 1)])
def test_the_armature_dances_what_the_program_makes_for_the_character(seen, dances, which, seed):
    states, path = seen
    character = read_character(path)
    figure = perform(dances[seed].motion, character.rig, character.bones).motion
    shown = states[which]["joints_m"]
    expected_m = figure.joint_pos_m()[shown["frames"]]
    errors_m = {
        role: np.linalg.norm(
            np.array(shown["heads"][character.rig.names[bone]]) - expected_m[:, figure.skeleton.index(role)],
            axis=-1,
        ).max()
        for role, bone in character.bones.items()
    }
    print(f"{1000 * max(errors_m.values()):.4f} mm at most")
    assert len(errors_m) >= 20 and max(errors_m.values()) < 1e-3


@with_a_generated_rig
@pytest.mark.parametrize(("which", "seed"), [("danced", 0), ("again", 1)])
def test_deforming_bones_of_a_generated_rig_follow_the_whole_dance_to_the_fingers(seen, dances, which, seed):
    """Also bent, turned and away from the start, in other modes of rotation, and without Rigify's mark."""
    states, path = seen
    character, dance = read_character(path), dances[seed]
    shown = states[which]["joints_m"]
    assert shown["frames"] == [*range(N_FRAMES)]
    document = character.dancing(dance.motion, figures=dance.figures)
    expected_m = node_worlds(document, np.arange(N_FRAMES))[:, list(character.nodes)][..., :3, 3]
    errors_m = {
        name: np.linalg.norm(np.array(shown["heads"][name]) - expected_m[:, bone], axis=-1).max()
        for bone, name in enumerate(character.rig.names)
        if name in shown["heads"]
    }
    print(f"{1000 * max(errors_m.values()):.4f} mm at most, {max(errors_m, key=errors_m.get)}")
    assert {"hand.L", "toe.R", "spine.006", "f_pinky.03.L", "thumb.03.R"} <= set(errors_m)
    assert max(errors_m.values()) < 1e-3


@with_a_generated_rig
def test_a_generated_rig_is_switched_to_fk_by_the_action_and_moved_whole_by_its_root(seen):
    found = seen[0]["root"]
    assert found["ik_fk"] == [[0.0] * 4, [1.0] * 4]
    assert {
        "torso",
        "spine_fk",
        "spine_fk.003",
        "neck",
        "head",
        "shoulder.L",
        "hand_fk.R",
        "toe_fk.L",
    } <= set(found["keyed"])
    assert not {"root", "hips", "chest", "hand_ik.L", "foot_ik.R", "brow.B.L", "jaw"} & set(found["keyed"])
    assert not found["held"] and 50 < len(found["keyed"]) < 70
    np.testing.assert_allclose(found["found"], found["expected"], atol=1e-4)


@with_a_generated_rig
def test_a_dance_on_a_generated_rig_is_undone_in_one_step(seen):
    before, danced, after = seen[0]["undone"]
    assert after == before and before["action"] == "mine" and before["ik_fk"] == [0.0] * 4
    assert danced["action"] == "house" and danced["ik_fk"] == [1.0] * 4 and danced["torso"] != before["torso"]


@with_bones_of_the_file
@pytest.mark.parametrize(("which", "seed"), [("danced", 0), ("again", 1)])
def test_the_skin_moves_as_in_the_programs_own_file(seen, dances, which, seed):
    states, path = seen
    document = read_character(path).dancing(dances[seed].motion, figures=dances[seed].figures)
    shown = states[which]["joints_m"]
    worlds = node_worlds(document, np.array(shown["frames"][:3]))
    for points_m, expected_m in zip(shown["skin"], skinned_vertices_m(document, worlds), strict=True):
        nearest_m, _ = cKDTree(expected_m).query(np.array(points_m))  # vertices may be in another order
        assert nearest_m.max() < 1e-3


def test_song_markers_credits_and_frame_range_are_there(seen, dances):
    danced, plan = seen[0]["danced"], dances[0].plan
    assert danced["frames"] == [FIRST_FRAME, FIRST_FRAME + N_FRAMES - 1]
    strips = {name: span for name, *span in danced["strips"]}
    assert strips["house"] == [FIRST_FRAME, FIRST_FRAME + N_FRAMES, FIRST_FRAME - START_S * FPS]
    beats = zip(plan.music_beats_s, plan.music_beat_numbers, strict=True)
    bars = [FIRST_FRAME + round(at_s * FPS) for at_s, number in beats if number == 1]
    assert len(bars) >= 2
    assert [frame for frame, name in danced["markers"] if "bar " in name] == bars
    takes = list(plan.takes_s())
    assert {name.split(", ")[-1] for _, name in danced["markers"] if "bar" not in name} >= {takes[0], "mine"}
    credits = danced["texts"]["house credits"]
    assert all(take in credits for take in takes) and "CC0-1.0" in credits
    assert danced["action"] == "house"


def test_again_leaves_one_of_each_and_the_users_own(seen):
    states, _ = seen
    danced, again = states["danced"], states["again"]
    assert (danced["seed"], again["seed"]) == (0, 1)
    for state in (danced, again):
        assert state["actions"] == ["house", "mine"]
        assert [name for name, *_ in state["strips"]] == ["house", "mine"] and state["sounds"] == 2
        assert set(state["texts"]) - {"rig_ui.py"} == {"house credits", "mine"}  # Rigify makes that one
        assert [20, "mine"] in state["markers"]
    assert bars(again) == bars(danced) and len(bars(danced)) == 4


def bars(state):
    """The markers of bars. One on which a take begins names the take as well."""
    return [(frame, name.split(",")[0]) for frame, name in state["markers"] if name.startswith("bar")]


@with_one_rig
def test_a_song_that_cannot_be_read_is_said_and_nothing_changes(seen):
    states, _ = seen
    assert "wrong.wav" in states["error"] and len(states["error"].strip().splitlines()) == 1
    assert states["after_error"] == states["before"]


def test_a_generated_rig_without_fk_controls_of_its_spine_is_refused_and_nothing_changes(
    package, program, tmp_path
):
    script, seen = tmp_path / "generate.py", tmp_path / "seen.json"
    script.write_text(
        "import json, sys\n"
        "from pathlib import Path\n"
        "import bpy\n"
        "package, program, song, seen = sys.argv[sys.argv.index('--') + 1 :]\n"
        "bpy.ops.wm.read_factory_settings(use_empty=True)\n"
        "bpy.ops.extensions.package_install_files(\n"
        "    filepath=package, repo='user_default', enable_on_install=True)\n"
        "bpy.context.preferences.addons['bl_ext.user_default.choreograph'].preferences.program = program\n"
        "bpy.ops.preferences.addon_enable(module='rigify')\n"
        "bpy.ops.object.armature_human_metarig_add()\n"
        "bpy.context.object.pose.bones['spine'].rigify_parameters.make_fk_controls = False\n"
        "bpy.ops.pose.rigify_generate()\n"
        "rig = next(each for each in bpy.data.objects if each.type == 'ARMATURE' and 'rig_id' in each.data)\n"
        "settings = bpy.context.scene.choreograph\n"
        "settings.armature, settings.song, settings.duration_s = rig, song, 2.0\n"
        "said = ''\n"
        "try:\n"
        "    bpy.ops.choreograph.dance()\n"
        "except RuntimeError as error:\n"
        "    said = str(error)\n"
        "actions = len(bpy.data.actions)\n"
        "Path(seen).write_text(json.dumps({'said': said, 'actions': actions}))\n"
    )
    in_blender(script, package, program, SONG, seen, user=tmp_path / "user")
    found = json.loads(seen.read_text())
    assert "expected an FK control for ORG-spine" in found["said"] and found["actions"] == 0
    assert len(found["said"].strip().splitlines()) == 1


@with_one_rig
def test_a_pin_takes_the_previews_range(seen):
    states, _ = seen
    assert states["pin"].startswith("1.000-4.000=take:house-")


@with_one_rig
def test_in_the_interface_work_goes_on_and_escape_stops(seen):
    shown = seen[0]["interface"]
    assert shown["answers"] == [
        ["RUNNING_MODAL"],
        ["PASS_THROUGH"],
        ["CANCELLED"],
        ["RUNNING_MODAL"],
        ["FINISHED"],
    ]
    assert shown["busy"] and {"starting", "planning"} & set(shown["stages"])
    assert shown["frame_end"] == FIRST_FRAME + 2 * FPS - 1


@with_one_rig
def test_panels_draw_what_there_is(seen):
    shown = seen[0]["interface"]
    assert shown["unknown"] == [] and {"song", "armature", "genre", "pin", "repertoire"} <= set(
        shown["drawn"]
    )


def test_the_picture_can_be_made_again(package, program, tmp_path):
    body, made = tmp_path / "body.glb", tmp_path / "made.webp"
    write_character(body, CHARACTERS["mixamo"])
    install = tmp_path / "install.py"
    install.write_text(
        "import sys, bpy\n"
        "bpy.ops.extensions.package_install_files(filepath=sys.argv[-1], repo='user_default')\n"
    )
    in_blender(install, package, user=tmp_path / "user")
    script = ROOT / "examples" / "blender_picture.py"
    in_blender(script, body, SONG, made, 1, user=tmp_path / "user", path=program.parent)
    assert made.stat().st_size > 1000


def test_the_extension_leaves_nothing_when_it_is_disabled(seen):
    assert seen[0]["left_registered"] is False
