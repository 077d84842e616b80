"""Edits of bodies: each kind is the edit that it names, and says which value it lacks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from choreograph.choreography.constraints import MotifPin, TakePin, parse_ban
from choreograph.choreography.edits import Hold, Repeat, Swap, Vary
from choreograph.core.errors import ParameterError
from choreograph.studio.routes.bodies import EditBody
from choreograph.studio.routes.edits import edit_request

SONG = SimpleNamespace(sections=SimpleNamespace(bounds_s=np.array([0.0, 8.0, 12.0])))
SPAN = {"from": 2.0, "to": 4.0}


def edit(kind, features=None, **values):
    return edit_request(EditBody.model_validate({"revision": 1, "kind": kind, **values}), features)


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("swap", SPAN, Swap(2.0, 4.0)), ("vary", SPAN, Vary(2.0, 4.0)), ("hold", SPAN, Hold(2.0, 4.0)),
        ("repeat", SPAN | {"at": 6.0, "mirrored": True}, Repeat(2.0, 4.0, 6.0, True)),
        ("pin_take", SPAN | {"take": "a"}, TakePin(2.0, 4.0, "a")),
        ("pin_motif", {"from": 2.0, "motif": 3}, MotifPin(2.0, 3)),
        ("pin_motif", {"from": 2.0, "at": 5.0, "motif": 3}, MotifPin(5.0, 3)),
        ("ban", {"ban": "genre:tango"}, parse_ban("genre:tango")),
        ("ban", {"take": "a"}, parse_ban("take:a")),
        ("ban", {"motif": 0}, parse_ban("motif:0")),
    ],
)  # fmt: skip
def test_a_kind_is_the_edit_that_it_names(kind, values, expected):
    assert edit(kind, **values) == expected


@pytest.mark.parametrize(
    ("kind", "values", "lacking"),
    [
        ("swap", {"from": 2.0}, "to"), ("vary", {"to": 2.0}, "from"), ("repeat", SPAN, "at"),
        ("pin_take", SPAN, "take"), ("pin_motif", {"motif": 1}, "at"), ("pin_motif", {"at": 1.0}, "motif"),
        ("cut", SPAN, "section"),
    ],
)  # fmt: skip
def test_a_value_that_is_lacking_is_named(kind, values, lacking):
    with pytest.raises(ParameterError, match=f"expected {lacking} beside the kind {kind}"):
        edit(kind, **values)


def test_a_part_is_cut_to_a_section_and_not_beyond_it():
    assert edit("cut", SONG, section=0, **SPAN) == Repeat(0.0, 2.0, 2.0)
    assert edit("cut", SONG, section=1, **{"from": 0.0, "to": 7.0}) == Repeat(8.0, 12.0, 0.0)


@pytest.mark.parametrize(("features", "section", "from_s"), [(None, 0, 2.0), (SONG, 2, 2.0), (SONG, 1, 8.05)])
def test_a_section_that_is_none_or_the_same_is_refused(features, section, from_s):
    with pytest.raises(ParameterError, match="section"):
        edit("cut", features, section=section, **{"from": from_s, "to": 10.0})
