"""The project: undo and redo are inverse, what nothing leads to is left out, and JSON keeps everything."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import FormatError, ParameterError
from choreograph.plan_parts import PlannedEdit
from choreograph.studio.project import Project, joined, project_from_json
from choreograph.studio.settings import Settings


@pytest.fixture(scope="module")
def plans(made):
    """A plan, and the same with one and two edits."""
    word = replace(made.plan.words[0], start_s=2.0, end_s=4.0) if made.plan.words else None
    if word is None:
        from choreograph.plan_parts import PlannedWord

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
    texts = [step.text for step in project.steps.values()]
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
        {"weights": 3}, {"genre": 7}, {"bans": "take:a"}, {"dynamics": 2.0}, {"stage": "large"},
        {"front": []}, {"repertoire": 3},
    ],
)  # fmt: skip
def test_settings_that_are_not_valid_are_refused(changes):
    with pytest.raises(ParameterError):
        Settings().changed(changes)


def test_weights_are_added_and_none_is_the_default_again():
    first = Settings().changed({"weights": {"pace": 2.0, "energy": 1.0}})
    assert first.changed({"weights": {"pace": None}}).weights == {"energy": 1.0}


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
