"""Plans as JSON: nothing lost, the published schema holds, and what is not a plan is said in one line."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.config import PLANNERS
from choreograph.errors import FormatError
from choreograph.plan import Plan, PlannedSecond
from choreograph.takes import Credits

SCHEMA = json.loads(
    (Path(__file__).resolve().parents[1] / "data_schema" / "plan.schema.json").read_text(encoding="utf-8")
)


def planned(second: int) -> PlannedSecond:
    times = tuple(3.0 + second + 0.05 * i for i in range(21))
    return PlannedSecond(
        second,
        "täke",
        5,
        3.0,
        second,
        0,
        times,
        {"style": 0.5, "mine": -1.0},
        Credits("waltz", "A", "CC0", "x"),
    )


PLAN = Plan(
    song="song", duration_s=2.5, start_s=0.0, repertoire="rep.h5", planner="exact", blending="inertial",
    seed=0, fps=60.0, weights={"style": 1.0}, music_beats_s=(0.5, 1.0),
    seconds=tuple(planned(s) for s in range(3)),
)  # fmt: skip


def test_a_plan_survives_its_json(tmp_path):
    assert Plan.from_json(PLAN.to_json()) == PLAN
    (tmp_path / "plan.json").write_text(PLAN.to_json(), encoding="utf-8")
    assert Plan.read(tmp_path / "plan.json") == PLAN
    assert PLAN.total_cost == pytest.approx(-1.5)


def test_the_schema_is_the_plans():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(json.loads(PLAN.to_json()), SCHEMA)
    assert set(SCHEMA["required"]) == {f.name for f in fields(Plan)} | {"format", "version"}
    assert set(SCHEMA["properties"]) == set(SCHEMA["required"])
    second = SCHEMA["$defs"]["second"]
    assert set(second["properties"]) == set(second["required"]) == {f.name for f in fields(PlannedSecond)}
    credit_keys = {f.name for f in fields(Credits)}
    assert set(second["properties"]["credits"]["properties"]) == credit_keys
    assert tuple(SCHEMA["properties"]["planner"]["enum"]) == PLANNERS


def edited(**changes) -> str:
    return json.dumps({**json.loads(PLAN.to_json()), **changes})


def edited_second(**changes) -> str:
    data = json.loads(PLAN.to_json())
    data["seconds"][1].update(changes)
    return json.dumps(data)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        edited(format="something else"),
        edited(version=2),
        edited(seconds=[]),
        edited(seconds=None),
        edited(seconds={"0": {}}),
        edited(seconds=json.loads(PLAN.to_json())["seconds"][1:]),
        edited(duration_s=9.0),
        edited(duration_s=0),
        edited(duration_s="long"),
        edited(duration_s=float("nan")),
        edited(fps=0),
        edited(fps="60"),
        edited(fps=1e9),
        edited(unknown=1),
        edited(blending="glue"),
        edited(planner="best"),
        edited(song=5),
        edited(seed="x"),
        edited(music_beats_s=["a"]),
        edited(music_beats_s=3),
        edited(weights=[1.0]),
        edited_second(source_times_s=[0.0] * 21),
        edited_second(source_times_s=[float("nan")] * 21),
        edited_second(source_times_s=list(range(20))),
        edited_second(source_times_s=5),
        edited_second(second=7),
        edited_second(unknown=1),
        edited_second(take=7),
        edited_second(take=None),
        edited_second(costs=[]),
        edited_second(costs={"style": "dear"}),
        edited_second(credits=None),
        edited_second(credits={"who": "x"}),
        edited_second(offset="first"),
    ],
)
def test_what_is_not_a_plan_is_said_in_one_line(text):
    with pytest.raises(FormatError) as said:
        Plan.from_json(text, name="p.json")
    assert str(said.value).startswith("p.json: ")
    assert "\n" not in str(said.value)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_damage_ends_in_a_plan_or_a_format_error(data):
    plan = json.loads(PLAN.to_json())
    holder = data.draw(st.sampled_from([plan, plan["seconds"][0], plan["seconds"][2]["credits"]]))
    key = data.draw(st.sampled_from(sorted(holder)))
    if data.draw(st.booleans()):
        del holder[key]
    else:
        holder[key] = data.draw(json_values)
    text = json.dumps(plan)
    try:
        read = Plan.from_json(text)
    except FormatError as error:
        assert "\n" not in str(error)  # noqa: PT017 - either outcome is right
    else:
        jsonschema.validate(json.loads(read.to_json()), SCHEMA)  # what is let in is what the schema allows
        assert Plan.from_json(read.to_json()) == read


@settings(max_examples=100, deadline=None)
@given(st.integers(0, len(PLAN.to_json()) - 2))
def test_a_plan_cut_off_anywhere_is_refused(length):
    with pytest.raises(FormatError):
        Plan.from_json(PLAN.to_json()[:length])


def test_a_file_that_cannot_be_read(tmp_path):
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "none.json", tmp_path, tmp_path / "binary.json"):
        with pytest.raises(FormatError) as said:
            Plan.read(path)
        assert "\n" not in str(said.value)


def test_a_plan_with_other_numbers_is_another_plan():
    assert replace(PLAN, seed=1) != PLAN
