"""Plans as JSON: nothing lost, the published schema holds, and malformed plans are reported in one line."""

from __future__ import annotations

import json
import re
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path
from typing import get_args

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_plans import MIXED, PINNED, PLAN, ROLLED, planned, word

from choreograph.core.errors import FormatError
from choreograph.motion.motion import Credits
from choreograph.plan.plan import Plan, PlannedEdit, PlannedSecond, PlannedWord, word_block, words_between
from choreograph.settings import EngineName, Planner

SCHEMA = json.loads(
    (Path(__file__).resolve().parents[2] / "data_schema" / "plan.schema.json").read_text(encoding="utf-8")
)


EDIT = PlannedEdit(0.6, 1.6, "swap 0.6-1.6", (word(0.6, 1.0), replace(word(1.0, 1.6), mirrored=True)))


@pytest.mark.parametrize("plan", [PINNED, MIXED, ROLLED], ids=lambda plan: plan.engine)
def test_edits_round_trip_and_replace_what_was_planned(plan):
    edited = replace(plan, edits=(EDIT, replace(EDIT, start_s=1.0, words=EDIT.words[1:])))
    assert Plan.from_json(edited.to_json()) == edited
    jsonschema.validate(json.loads(edited.to_json()), SCHEMA)
    blocks = edited.blocks
    assert blocks[0].start_s == 0.0 and blocks[-1].end_s == 2.5
    for before, after in pairwise(blocks):
        assert before.end_s == pytest.approx(after.start_s)
    inside = [block for block in blocks if 0.6 <= block.start_s < 1.6]
    assert [block.planned for block in inside] == list(EDIT.words)
    for block in (b for b in blocks if not 0.5 < b.start_s < 1.6):  # what is left of a part keeps its times
        (whole,) = [b for b in plan.blocks if b.start_s <= block.start_s and b.end_s >= block.end_s]
        assert block.source_end_s == pytest.approx(whole.source_s(block.end_s))


def test_parts_of_a_dance_as_words_read_no_take_beyond_what_is_danced():
    blocks = [word_block(word(*span)) for span in ((0.0, 0.1), (0.1, 1.0), (1.0, 2.0), (2.0, 2.1))]
    words = words_between(blocks, 0.0, 2.1, cuts_s=(0.5, 1.97, 2.05))
    assert [(w.start_s, w.end_s) for w in words] == [(0.0, 0.5), (0.5, 1.0), (1.0, 2.1)]
    assert (words[0].source_start_s, words[1].source_end_s) == (4.0, 5.125)  # those of the second block
    assert (words[2].source_start_s, words[2].source_end_s) == (4.0, 5.25)
    assert all(w.source_start_s < w.source_end_s for w in words)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"start_s": 1.6}, "edit 0: expected a start before its end"),
        ({"end_s": 3.0}, "within the dance of 2.5 s"),
        ({"words": ()}, "expected words until 1.6 s, got words until 0.6 s"),
        ({"words": EDIT.words[1:]}, "expected a word from 0.6 s on, got one from 1 s on"),
        ({"words": (replace(EDIT.words[0], kept="a.npz", take=""), EDIT.words[1])}, "got a part of a.npz"),
    ],
)
def test_edits_that_cannot_be_danced_are_refused(change, said):
    with pytest.raises(FormatError, match=re.escape(said)):
        Plan.from_json(replace(PLAN, edits=(replace(EDIT, **change),)).to_json())


@pytest.mark.parametrize("plan", [PINNED, MIXED, ROLLED], ids=lambda plan: plan.engine)
def test_plans_of_words_round_trip(plan):
    assert Plan.from_json(plan.to_json()) == plan
    jsonschema.validate(json.loads(plan.to_json()), SCHEMA)


def test_a_motion_file_is_kept_as_one_word():
    whole = replace(word(0.0, 2.5, take=""), kept="old.npz", source_start_s=0.0, source_end_s=2.5)
    kept = replace(MIXED, words=(whole,), edits=(EDIT,))
    assert Plan.from_json(kept.to_json()) == kept and kept.kept_of == "old.npz"
    assert [block.source for block in kept.blocks] == ["old.npz", "täke", "täke", "old.npz"]
    jsonschema.validate(json.loads(kept.to_json()), SCHEMA)
    part = replace(whole, end_s=0.75, source_end_s=0.75)
    with pytest.raises(FormatError, match=r"expected old\.npz kept as one word"):
        Plan.from_json(replace(MIXED, words=(part, word(0.75, 2.5))).to_json())
    laid_over = replace(ROLLED, words=(word(0, 1, take=""), word(1, 2.5)))
    assert Plan.from_json(laid_over.to_json()) == laid_over
    with pytest.raises(FormatError, match=r"expected no take where old\.npz is kept"):
        Plan.from_json(replace(MIXED, words=(replace(word(0.0, 2.5), kept="old.npz"),)).to_json())


def test_bars_and_held_poses_round_trip():
    plan = replace(PLAN, opening_s=0.5, closing_s=2.0, music_beat_numbers=(4, 1), metre=4)
    assert Plan.from_json(plan.to_json()) == plan
    jsonschema.validate(json.loads(plan.to_json()), SCHEMA)


LONGER = replace(PLAN, duration_s=4.0, seconds=tuple(planned(s) for s in range(4)))


def test_amplitudes_and_stops_round_trip():
    plan = replace(LONGER, amplitudes=(0.5, 1.0, 1.1, 1.5), stops_s=((1.0, 2.5),))
    assert Plan.from_json(plan.to_json()) == plan
    jsonschema.validate(json.loads(plan.to_json()), SCHEMA)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"amplitudes": [0.4, 1.0, 1.0, 1.0]}, r"expected amplitudes from 0\.5 to 1\.5, got \(0\.4, "),
        ({"amplitudes": [1.0, 1.0, 1.0]}, r"expected amplitudes for 4\.0 s, or none, got 3"),
        ({"amplitudes": ["loud"] * 4}, r"expected amplitudes as tuple\[float, \.\.\.\], got \['loud'"),
        ({"stops_s": [[0.5, 2.0]]}, r"expected stops_s in order, within the dance, and 1 s or more between"),
        ({"stops_s": [[1.0, 1.5]]}, "expected stops_s in order"),
        ({"stops_s": [[1.0, 3.5]]}, "expected stops_s in order"),
        (
            {"stops_s": [1.0, 2.5]},
            r"expected stops_s as tuple\[tuple\[float, float\], \.\.\.\], got \[1\.0, ",
        ),
        ({"stops_s": [[1.0, 2.0, 3.0]]}, "expected stops_s as tuple"),
    ],
)
def test_amplitudes_and_stops_that_cannot_be_danced_are_refused(changes, expected):
    text = json.dumps({**json.loads(LONGER.to_json()), **changes})
    with pytest.raises(FormatError, match=expected):
        Plan.from_json(text)


def test_a_plan_without_amplitudes_is_refused_with_the_command_that_makes_it_anew():
    older = json.loads(PLAN.to_json())
    del older["amplitudes"]
    expected = (
        r"expected a key amplitudes, got none: make it again with `choreograph dance SONG -o plan\.json`"
    )
    with pytest.raises(FormatError, match=expected):
        Plan.from_json(json.dumps(older))


@pytest.mark.parametrize("version", [0, 2, 7, True, None])
def test_other_versions_are_refused_with_the_command_that_makes_a_plan_anew(version):
    text = json.dumps({**json.loads(PLAN.to_json()), "version": version})
    expected = (
        rf"of version 1, got version {version}: make it again with `choreograph dance SONG -o plan\.json`"
    )
    with pytest.raises(FormatError, match=expected):
        Plan.from_json(text)


def test_words_are_danced_instead_of_the_seconds_there():
    spans = [(b.start_s, b.end_s, isinstance(b.planned, PlannedWord)) for b in PINNED.blocks]
    assert spans == [(0, 0.5, False), (0.5, 1.25, True), (1.25, 2, False), (2, 2.5, True)]
    after = PINNED.blocks[2]  # of second 1, which begins at 4 s of its take
    assert (after.source_start_s, after.source_end_s) == pytest.approx((4.25, 5.0))
    assert sum(PINNED.takes_s().values()) == pytest.approx(2.5)
    assert [(b.start_s, b.end_s) for b in PLAN.blocks] == [(0, 1), (1, 2), (2, 2.5)]
    first, second, third = PLAN.seconds  # of which the second takes over late and the third early
    moved = replace(PLAN, seconds=(first, replace(second, start_s=1.4), replace(third, start_s=1.9)))
    assert [(b.start_s, b.end_s) for b in moved.blocks] == [(0, 1.4), (1.4, 1.9), (1.9, 2.5)]
    on_time, late = PLAN.blocks[0], moved.blocks[0]
    at_the_end = (first.source_times_s[-1] - first.source_times_s[-2]) * 20  # it plays on as fast as it ended
    assert late.source_start_s == on_time.source_start_s
    assert late.source_end_s == pytest.approx(on_time.source_end_s + 0.4 * at_the_end)
    assert [b.planned for b in MIXED.blocks] == list(MIXED.words)


def test_held_poses_belong_to_the_first_and_last_block_that_is_danced():
    def spans(plan):
        return [(block.start_s, block.end_s) for block in plan.blocks]

    assert spans(replace(PLAN, opening_s=0.5)) == [(0, 1), (1, 2), (2, 2.5)]
    assert spans(replace(PLAN, opening_s=1.25)) == [(0, 2), (2, 2.5)]
    assert spans(replace(PLAN, opening_s=1.0)) == [(0, 2), (2, 2.5)]  # the first is over by then
    assert spans(replace(PLAN, closing_s=1.5)) == [(0, 1), (1, 2.5)]
    assert spans(replace(PLAN, opening_s=1.25, closing_s=1.75)) == [(0, 2.5)]
    assert spans(replace(MIXED, opening_s=0.8, closing_s=1.5)) == [(0, 2.5)]
    (held,) = replace(PLAN, opening_s=1.25, closing_s=1.75).blocks
    assert held.planned == PLAN.seconds[1] and held.source_start_s == PLAN.blocks[1].source_start_s
    assert sum(replace(PLAN, opening_s=1.25).takes_s().values()) == pytest.approx(2.5)


@pytest.mark.parametrize("plan", [PLAN, PINNED, MIXED, ROLLED], ids=("plan", "pinned", "mixed", "rolled"))
@given(st.floats(0, 2.4), st.floats(0, 1) | st.none())
def test_blocks_fill_the_dance_whatever_is_held(plan, opening_s, share):
    closing_s = None if share is None else opening_s + 0.01 + share * (2.49 - opening_s)
    spans = [(b.start_s, b.end_s) for b in replace(plan, opening_s=opening_s, closing_s=closing_s).blocks]
    assert spans[0][0] == 0.0 and spans[-1][1] == 2.5
    assert all(end_s == start_s for (_, end_s), (start_s, _) in pairwise(spans))


@pytest.mark.parametrize(
    "plan",
    [
        replace(MIXED, words=MIXED.words[1:]),
        replace(MIXED, words=MIXED.words[:-1]),
        replace(MIXED, words=(MIXED.words[0], MIXED.words[2])),
        replace(MIXED, words=MIXED.words[::-1]),
        replace(MIXED, words=()),
        replace(MIXED, seconds=PLAN.seconds),
        replace(ROLLED, engine="mixer"),
        replace(PINNED, words=(word(0.5, 1.25), word(1.0, 1.5))),
        replace(PINNED, words=(word(2.0, 3.0),)),
        replace(PINNED, words=(word(1.0, 1.0),)),
        replace(PINNED, words=(replace(word(1.0, 2.0), source_start_s=9.0),)),
        replace(PLAN, engine="mixer"),
    ],
)
def test_words_that_do_not_make_a_dance(plan):
    with pytest.raises(FormatError) as raised:
        Plan.from_json(plan.to_json(), name="p.json")
    assert str(raised.value).startswith("p.json: ") and "\n" not in str(raised.value)


def test_plans_round_trip(tmp_path):
    assert Plan.from_json(PLAN.to_json()) == PLAN
    (tmp_path / "plan.json").write_text(PLAN.to_json(), encoding="utf-8")
    assert Plan.read(tmp_path / "plan.json") == PLAN
    assert PLAN.total_cost == pytest.approx(-1.5)


def test_the_schema_matches_the_plan():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(json.loads(PLAN.to_json()), SCHEMA)
    assert set(SCHEMA["required"]) == {f.name for f in fields(Plan)} | {"format", "version"}
    assert set(SCHEMA["properties"]) == set(SCHEMA["required"])
    second = SCHEMA["$defs"]["second"]
    assert set(second["properties"]) == set(second["required"]) == {f.name for f in fields(PlannedSecond)}
    of_word = SCHEMA["$defs"]["word"]
    assert set(of_word["properties"]) == set(of_word["required"]) == {f.name for f in fields(PlannedWord)}
    credit_keys = {f.name for f in fields(Credits)}
    assert set(SCHEMA["$defs"]["credits"]["properties"]) == credit_keys
    builtin, added = SCHEMA["properties"]["engine"]["anyOf"]
    assert tuple(builtin["enum"]) == get_args(EngineName)
    for name in ("mixer", "first-take", "Steam", "", "a b", "9"):
        fits = re.search(added["pattern"], name) is not None
        assert fits == (not list(replace(MIXED, engine=name)._faults())), name
    assert tuple(SCHEMA["properties"]["planner"]["enum"]) == get_args(Planner)


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
        edited(engine="Steam engine"),
        edited(words=None),
        edited(words=[{}]),
        edited(words=[{**json.loads(PINNED.to_json())["words"][0], "pinned": 1}]),
        edited(words=[{**json.loads(PINNED.to_json())["words"][0], "motif": -1}]),
        edited(song=5),
        edited(seed="x"),
        edited(opening_s=-0.5),
        edited(opening_s=2.5),
        edited(opening_s=1.5, closing_s=1.5),
        edited(closing_s=3.0),
        edited(closing_s="end"),
        edited(music_beat_numbers=[1]),
        edited(music_beat_numbers=[1.5, 2.5]),
        edited(metre=-1),
        edited(music_beats_s=["a"]),
        edited(music_beats_s=3),
        edited(weights=[1.0]),
        edited_second(source_times_s=[0.0] * 21),
        edited_second(source_times_s=[float("nan")] * 21),
        edited_second(source_times_s=list(range(20))),
        edited_second(source_times_s=5),
        edited_second(start_s=7.5),
        edited_second(transition_s=0.0),
        edited_second(transition_s=3.0),
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
def test_malformed_plans_are_reported_in_one_line(text):
    with pytest.raises(FormatError) as raised:
        Plan.from_json(text, name="p.json")
    assert str(raised.value).startswith("p.json: ")
    assert "\n" not in str(raised.value)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_any_damage_gives_a_plan_or_a_format_error(data):
    plan = json.loads(PINNED.to_json())
    holders = [plan, plan["seconds"][0], plan["seconds"][2]["credits"], plan["words"][0]]
    holder = data.draw(st.sampled_from(holders))
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
        with pytest.raises(FormatError) as raised:
            Plan.read(path)
        assert "\n" not in str(raised.value)


def test_a_plan_with_other_numbers_is_another_plan():
    assert replace(PLAN, seed=1) != PLAN
