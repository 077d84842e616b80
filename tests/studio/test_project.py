"""The project: undo and redo are inverse, what nothing leads to is left out, and JSON keeps everything."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.plan.plan import PlannedEdit
from choreograph.studio.project import (
    MOST_SIZE,
    Project,
    ProjectFile,
    Settings,
    checked_name,
    joined,
    opened,
    placed,
    project_from_json,
    project_path,
)
from choreograph.studio.refusals import UnknownTypeError

# The project: undo and redo are inverse, what nothing leads to is left out, and JSON keeps everything.


@pytest.fixture(scope="module")
def plans(made):
    """A plan, and the same with one and two edits."""
    word = replace(made.plan.words[0], start_s=2.0, end_s=4.0) if made.plan.words else None
    if word is None:
        from choreograph.plan.plan import PlannedWord

        second = made.plan.seconds[2]
        word = PlannedWord(2.0, 4.0, 0, second.take, 1.0, 3.0, second.credits)
    edits = [PlannedEdit(2.0, 4.0, f"edit {i}", (word,)) for i in range(2)]
    return [replace(made.plan, edits=tuple(edits[:n])) for n in range(3)]


def with_steps(plans):
    project = Project("song.wav")
    project = project.with_dance("first", plans[0], Settings(), [], edited=False)
    for plan in plans[1:]:
        project = project.with_dance(plan.edits[-1].request, plan, Settings(), [(2.0, 4.0)], edited=True)
    return project


def test_undo_and_redo_are_inverse_and_plans_come_back(plans):
    project = with_steps(plans)
    assert project.current.plan() == plans[2] and not project.can_redo
    back = project.undone().undone()
    assert back.current.plan() == plans[0] and not back.can_undo
    assert back.redone().redone().current.plan() == plans[2]
    with pytest.raises(ParameterError, match="undo"):
        back.undone()
    with pytest.raises(ParameterError, match="undone"):
        project.redone()


def test_each_change_has_a_greater_revision(plans):
    project = with_steps(plans)
    later = [project.undone(), project.with_locks([(1.0, 2.0)], 12.0), project.with_version("A")]
    assert all(one.revision == project.revision + 1 for one in later)


def test_a_change_after_undo_leaves_out_what_was_undone_but_not_a_version(plans):
    project = with_steps(plans)
    last = project.current.number
    for kept, one in ((False, project), (True, project.with_version("B"))):
        other = one.undone().undone().with_dance("again", plans[0], Settings(seed=1), [], edited=False)
        assert not other.can_redo and other.can_undo
        assert (last in other.steps) == kept
        read = project_from_json(other.to_json(), "p")
        assert read.path == other.path and (not kept or read.steps[last].plan() == plans[2])


def test_json_keeps_everything(plans):
    project = with_steps(plans).with_locks([(0.0, 1.0), (1.0, 2.5)], 12.0).with_version("A").undone()
    project = project.with_character("hero.glb", {"head": "Head"})
    project = project.with_settings(Settings(genre="salsa", weights={"pace": 2.0}, bans=("take:a",)))
    read = project_from_json(project.to_json(), "p")
    assert read == project and read.to_json() == project.to_json()
    assert read.locks == ((0.0, 2.5),)
    assert [step.plan() for step in read.steps.values()] == plans


def test_the_file_has_the_layout_that_is_described(plans):
    schema = json.loads((Path(__file__).parents[2] / "data_schema" / "studio.schema.json").read_text())
    for project in (Project("a.wav"), with_steps(plans).with_version("A").with_locks([(1.0, 2.0)], 9.0)):
        jsonschema.validate(json.loads(project.to_json()), schema)


def test_a_step_with_edits_is_short(plans):
    project = with_steps(plans)
    texts = [step.to_json() for step in project.steps.values()]
    assert "plan" in json.loads(texts[0]) and "plan" not in json.loads(texts[1])
    assert len(json.loads(texts[2])["edits"]) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(format="other"), "choreograph-studio"),
        (lambda d: d.update(version=2), "version 1"),
        (lambda d: d.pop("locks"), "locks"),
        (lambda d: d.update(path=[77]), "steps that it contains"),
        (lambda d: d.update(at=9), "place in its path"),
        (lambda d: d.update(at="0"), "place in its path"),
        (lambda d: d.update(locks=[[3, "x"]]), "two times"),
        (lambda d: d.update(settings={"engine": "none"}), "engine"),
        (lambda d: d["steps"][0].update(plan="not base64!"), "base64"),
        (lambda d: d["steps"][0].update(plan="AAAA"), "compressed plan"),
        (lambda d: d["steps"][1].update(parent=99), "99"),
        (lambda d: d["steps"][1].update(number=1), "number of its own"),
        (lambda d: d["steps"][1]["edits"][0].update(start_s=-5.0), "edit"),
        (lambda d: d["steps"][1]["edits"][0].pop("words"), "words"),
        (lambda d: d.update(steps=7), "fault"),
    ],
)
def test_a_damaged_project_is_refused_in_one_line(plans, change, message):
    data = json.loads(with_steps(plans).to_json())
    change(data)
    with pytest.raises(FormatError, match=message) as found:
        project_from_json(json.dumps(data), "p.json")
    assert "\n" not in str(found.value) and "p.json" in str(found.value)


@pytest.mark.parametrize("text", ["", "[]", "{", "null", '{"format": "choreograph-plan", "version": 1}'])
def test_another_file_is_refused(text):
    with pytest.raises(FormatError):
        project_from_json(text, "p.json")


@pytest.mark.parametrize(
    "changes",
    [
        {"colour": 1}, {"engine": "none"}, {"seed": -1}, {"seed": "x"}, {"weights": {"pace": "much"}},
        {"weights": {"pace": -1.0}}, {"weights": {"pace": float("inf")}}, {"weights": 3}, {"genre": 7},
        {"bans": "take:a"}, {"dynamics": 2.0}, {"stage": "large"}, {"front": []}, {"repertoire": 3},
    ],
)  # fmt: skip
def test_settings_that_are_not_valid_are_refused(changes):
    with pytest.raises(ParameterError):
        Settings().changed(changes)


def test_weights_are_added_and_none_is_the_default_again():
    first = Settings().changed({"weights": {"pace": 2.0, "energy": 1.0}})
    assert first.changed({"weights": {"pace": None}}).weights == {"energy": 1.0}


# Files that take far more memory than bytes.


def ten_minutes(plan):
    """A plan of ten minutes, with the seconds of another one."""
    second = plan.seconds[2]
    seconds = tuple(
        replace(second, second=i, start_s=float(i), costs={n: c + i / 997 for n, c in second.costs.items()},
                source_times_s=tuple(t + i / 331 for t in second.source_times_s))
        for i in range(600)
    )  # fmt: skip
    beats_s = tuple(i / 2 for i in range(1200))
    return replace(
        plan, seconds=seconds, words=(), duration_s=600.0, closing_s=None, amplitudes=(), stops_s=(),
        music_beats_s=beats_s, music_beat_numbers=(),
    )  # fmt: skip


def bomb_of_plans(plans):
    """The project, with many steps that have a plan of three million beats each."""
    data = json.loads(with_steps(plans).to_json())
    plan = json.loads(plans[0].to_json()) | {"music_beats_s": [], "music_beat_numbers": []}
    text = json.dumps(plan).replace(
        '"music_beats_s": []', f'"music_beats_s": [{",".join(["0"] * 3_000_000)}]'
    )
    first = data["steps"][0] | {"plan": base64.b64encode(zlib.compress(text.encode(), 9)).decode()}
    return json.dumps(data | {"steps": [first | {"number": i} for i in range(1, 20)]})


def bomb_of_values(plans):
    """The project, with a list of millions of small objects."""
    return with_steps(plans).to_json()[:-3] + ',"x":[' + ",".join(['{"a":0}'] * 3_000_000) + "]}"


def bomb_of_edits(plans):
    """The project, with steps that each add an edit to the step before."""
    data = json.loads(with_steps(plans).to_json())
    first, second = data["steps"][:2]
    second["edits"] *= 40
    more = [second | {"number": i, "parent": i - 1} for i in range(2, 2000)]
    return json.dumps(data | {"steps": [first, *more], "path": [1], "at": 0})


@pytest.mark.parametrize("bomb", [bomb_of_plans, bomb_of_values, bomb_of_edits])
def test_a_project_that_takes_far_too_much_memory_is_refused(plans, bomb, tmp_path):
    path = tmp_path / "p.studio.json"
    path.write_text(bomb(plans))
    said, grown_bytes = read_elsewhere(path)
    assert said.startswith(("p.studio.json: expected a project that takes", "p.studio.json: step 1: "))
    assert "\n" not in said and grown_bytes < 300e6


def test_a_plan_is_limited_when_it_is_used_as_well(plans):
    first = with_steps(plans).steps[1]
    text = b"[" + b"0," * 40_000_000 + b"0]"
    bomb = replace(first, base=base64.b64encode(zlib.compress(text, 9)).decode())
    with pytest.raises(FormatError, match="too long"):
        bomb.plan()


def test_a_large_project_is_read_with_little_memory(plans, tmp_path):
    plan, project = ten_minutes(plans[0]), Project("song.wav")
    for seed in range(8):
        project = project.with_dance("again", plan, Settings(seed=seed), [], edited=False)
    assert len(project.steps) == 8 and 200 * project.steps[1].size < MOST_SIZE
    path = tmp_path / "p.studio.json"
    path.write_text(project.to_json())
    said, grown_bytes = read_elsewhere(path)
    assert said == "8 steps" and grown_bytes < 30e6


def read_elsewhere(path):
    """What a process says that reads a project, and by how many bytes its memory grows."""
    code = """
import resource, sys
from pathlib import Path
from choreograph.core.errors import ChoreographError
from choreograph.studio.project import ProjectFile
file, before = ProjectFile(Path(sys.argv[1])), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
try:
    print(len(file.read().steps), "steps")
except ChoreographError as error:
    print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
    ended = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True)
    said, kib = ended.stdout.strip().splitlines()
    return said, 1024 * int(kib)


def test_the_oldest_steps_leave_a_project_that_grows_too_large(plans, monkeypatch):
    project = with_steps(plans[:1]).with_version("A")
    first = project.current.number
    monkeypatch.setattr("choreograph.studio.project.MOST_SIZE", 12 * project.current.size)
    for seed in range(30):
        project = project.with_dance("again", plans[0], Settings(seed=seed), [], edited=False)
        project = project.with_dance("edit", plans[1], Settings(seed=seed), [(2.0, 4.0)], edited=True)
        assert project.at == len(project.path) - 1 and project.can_undo
        assert project.current.plan() == plans[1] and project.undone().current.plan() == plans[0]
        assert project_from_json(project.to_json(), "p") == project
    assert 8 < len(project.steps) < 30 and first in project.steps and first not in project.path
    while project.can_undo:
        project = project.undone()
    assert project.with_dance("last", plans[0], Settings(), [], edited=False).can_undo


def test_a_dance_that_no_project_can_contain_is_refused(plans, monkeypatch):
    beats_s = tuple(i / 1e5 for i in range(1_000_000))
    long = replace(plans[0], music_beats_s=beats_s, music_beat_numbers=())
    with pytest.raises(ParameterError, match="hours"):
        Project("song.wav").with_dance("first", long, Settings(), [], edited=False)
    project = with_steps(plans)
    monkeypatch.setattr("choreograph.studio.project.MOST_SIZE", project.current.size)
    with pytest.raises(ParameterError, match="roll again"):
        project.with_dance("edit", plans[2], Settings(), [], edited=True)


spans = st.lists(st.tuples(st.floats(0, 60), st.floats(0, 60)).map(sorted).filter(lambda s: s[0] < s[1]))


@given(spans)
@settings(max_examples=50)
def test_joined_spans_are_apart_in_order_and_cover_the_same(spans):
    made = joined(spans, 60.0)
    times = [time for span in made for time in span]
    assert times == sorted(times) and joined(made, 60.0) == made
    for start_s, end_s in spans:
        assert any(a <= start_s and min(end_s, 60.0) <= b for a, b in made)


@pytest.mark.parametrize("span", [(-1.0, 2.0), (3.0, 3.0), (5.0, 4.0), (10.0, 70.0), (float("nan"), 2.0)])
def test_spans_outside_of_the_dance_are_refused(span):
    with pytest.raises(ParameterError):
        joined([span], 60.0)


# The file of a project: whole or not at all, used by one process, and names that are no paths.


def test_what_is_written_is_read(tmp_path):
    file = ProjectFile(tmp_path / "a.studio.json")
    assert file.read() is None
    file.write(Project("a.wav", revision=3))
    assert file.read() == Project("a.wav", revision=3)
    file.close()
    assert os.listdir(tmp_path) == ["a.studio.json"]


def test_a_second_studio_is_refused_until_the_first_is_closed(tmp_path):
    path = tmp_path / "a.studio.json"
    file = ProjectFile(path)
    with pytest.raises(ChoreographError, match="studio"):
        ProjectFile(path)
    file.close()
    ProjectFile(path).close()


def test_a_full_disk_leaves_the_file_before_it(tmp_path, monkeypatch):
    file = ProjectFile(tmp_path / "a.studio.json")
    file.write(Project("a.wav", revision=3))

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ChoreographError, match="No space"):
        file.write(Project("a.wav", revision=4))
    assert file.read().revision == 3
    file.close()
    assert os.listdir(tmp_path) == ["a.studio.json"]


def test_a_damaged_file_is_refused(tmp_path):
    (tmp_path / "a.studio.json").write_text("{}")
    file = ProjectFile(tmp_path / "a.studio.json")
    with pytest.raises(FormatError):
        file.read()
    file.close()


def test_a_link_leads_to_one_project_with_one_lock_and_stays_a_link(tmp_path):
    for name in ("real", "other"):
        (tmp_path / name).mkdir()
    real, link = tmp_path / "real" / "a.studio.json", tmp_path / "other" / "b.studio.json"
    link.symlink_to(real)
    file = ProjectFile(link)
    file.write(Project("a.wav", revision=3))  # before there is a file, and over it
    file.write(Project("a.wav", revision=4))
    assert link.is_symlink() and os.listdir(link.parent) == ["b.studio.json"]
    with pytest.raises(ChoreographError, match="studio"):
        ProjectFile(real)
    assert opened(real, "a.wav", file) == (file, Project("a.wav", revision=4))
    file.close()
    assert ProjectFile(real).read().revision == 4


def test_a_link_to_nowhere_makes_no_folders(tmp_path):
    link = tmp_path / "a.studio.json"
    link.symlink_to(tmp_path / "none" / "a.studio.json")
    with pytest.raises(ChoreographError, match="there is no folder"):
        ProjectFile(link)
    link.unlink()
    link.symlink_to(link)
    with pytest.raises(ChoreographError):
        ProjectFile(link).read()
    assert not (tmp_path / "none").exists()


def test_the_project_is_beside_its_song(tmp_path):
    assert project_path(tmp_path / "my song.mp3") == tmp_path / "my song.studio.json"


@pytest.mark.parametrize(
    "name",
    [
        "", ".", "..", "../a.wav", "a/b.wav", "a\\b.wav", "/etc/a.wav", "C:a.wav", ".hidden.wav", "a.wav.",
        "a\x00.wav", "a\n.wav", " a.wav", "a.wav ", "a*.wav", "a" * 200 + ".wav", "con?.wav",
        "con.wav", "NUL.wav", "com1.x.wav", "a\x85.wav", "a\u2028.wav",
    ],
)  # fmt: skip
def test_names_are_never_paths(name):
    with pytest.raises(ParameterError):
        checked_name(name, [".wav"])


@pytest.mark.parametrize("name", ["a.wav", "Ä song, 2.WAV", "歌.wav", "a.b.wav", "console.wav"])
def test_plain_names_are_taken(name):
    assert checked_name(name, [".wav"]) == name


def test_another_suffix_is_refused():
    with pytest.raises(UnknownTypeError):
        checked_name("a.exe", [".wav"])


def test_a_file_never_replaces_another(tmp_path):
    (tmp_path / "in").mkdir()
    for content, expected in (
        (b"1", "a.wav"), (b"1", "a.wav"), (b"2", "a-new.wav"), (b"3", "a-new-2.wav"), (b"2", "a-new.wav"),
    ):  # fmt: skip
        sent = tmp_path / "in" / "a.wav"
        sent.write_bytes(content)
        path = placed(sent, tmp_path)
        assert path.name == expected and path.read_bytes() == content and not sent.exists()


# Settings of the studio: those of several dancers are checked, and left out of files if they are usual.


def test_one_dancer_has_the_data_of_a_project_without_dancers():
    assert list(Settings().to_data()) == [
        "engine", "seed", "genre", "dynamics", "front", "stage", "weights", "repertoire", "bans",
    ]  # fmt: skip


def test_data_of_dancers_come_back():
    changes = {"dancers": 4, "formation": ["line", "8-16=circle"], "relation": ["canon:2"]}
    made = Settings().changed(changes)
    data = json.loads(json.dumps(made.to_data()))
    assert Settings().changed(data) == made and {name: data[name] for name in changes} == changes
    assert made.changed({"dancers": 1}).to_data()["formation"] == ("line", "8-16=circle")  # for another time


def test_a_dancer_has_a_seed_of_its_own():
    made = Settings().changed({"dancers": 3, "relation": ["free"], "seed": 5, "genre": "house"})
    assert made.of_dancer(2) == Settings(seed=7, genre="house")
    assert made.scene_request().n_dances == 3


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"dancers": 0}, "expected 1 to 32 dancers"),
        ({"dancers": 33}, "expected 1 to 32 dancers"),
        ({"dancers": 2.0}, "expected 1 to 32 dancers"),
        ({"dancers": True}, "expected 1 to 32 dancers"),
        ({"formation": "v"}, "expected formation as a list of texts"),
        ({"formation": ["star"]}, "expected a formation"),
        ({"formation": ["places.json"]}, "expected a formation"),
        ({"formation": ["8-16=/etc/passwd.json"]}, "expected a formation"),
        ({"formation": ["v", "line"]}, "expected one formation for the whole song"),
        ({"formation": ["=v"]}, "WHEN=VALUE"),
        ({"formation": [f"{i}-{i + 1}=v" for i in range(500)]}, "at most 200 texts"),
        ({"relation": ["canon:99"]}, "expected a relation among"),
        ({"relation": [3]}, "expected relation as a list of texts"),
        ({"relation": ["x" * 200]}, "at most 200 texts of 100 characters"),
    ],
)
def test_other_dancers_are_refused_in_one_line(changes, says):
    with pytest.raises(ParameterError, match=says) as refused:
        Settings().changed(changes)
    assert "\n" not in str(refused.value)
