"""Plans of scenes: what is malformed is reported in one line."""

from __future__ import annotations

import json
from typing import Any

import pytest
from test_plan import PLAN

from choreograph.core.errors import FormatError
from choreograph.scene_plan import DancerPart, PlannedDancer, ScenePlan

DANCER = PlannedDancer("a", 1.0, (DancerPart(0.0, 2.5, 0),), (0.0, 2.0), (0.0, 1.0), (0.0, 0.5))
SCENE = ScenePlan((PLAN,), (DANCER,))


def test_nothing_is_lost():
    assert ScenePlan.from_json(SCENE.to_json()) == SCENE


def changed(*path: Any, to: Any) -> str:
    data = json.loads(SCENE.to_json())
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = to
    return json.dumps(data)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "could not parse"),
        ("[]", "expected a choreograph-scene"),
        (changed("version", to=2), "of version 1"),
        (changed("more", to=2), "expected the keys dancers and dances"),
        (changed("dancers", to=[]), "expected 1 to 32 dancers"),
        (changed("dancers", 0, "name", to=3), "expected name as str"),
        (changed("dancers", 0, "height", to=9.0), "expected a height from 0.5 to 2"),
        (changed("dancers", 0, "times_s", to=[2.0, 1.0]), "expected increasing times_s"),
        (changed("dancers", 0, "x_m", to=[1.0]), "expected a time, an x and a z"),
        (changed("dancers", 0, "parts", to=[]), "expected a list of parts"),
        (changed("dancers", 0, "parts", 0, "dance", to=1), "expected one of 1 dance, got dance 1"),
        (changed("dancers", 0, "parts", 0, "end_s", to=2.0), "expected parts until 2.5 s"),
        (changed("dancers", 0, "parts", 0, "size", to=3.0), "expected a size from 0 to 1.5"),
        (changed("dances", 0, "fps", to="x"), "dance 0"),
    ],
)
def test_what_is_malformed_is_refused(text, says):
    with pytest.raises(FormatError, match=says) as error:
        ScenePlan.from_json(text)
    assert "\n" not in str(error.value)
