"""Settings of the studio: those of several dancers are checked, and left out of files if they are usual."""

from __future__ import annotations

import json

import pytest

from choreograph.core.errors import ParameterError
from choreograph.studio.settings import Settings


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
