"""Plans of scenes: what is malformed is reported in one line."""

from __future__ import annotations

import json
from typing import Any

import pytest
from synthetic_plans import PLAN

from choreograph.core.errors import FormatError
from choreograph.plan.scenes import DancerPart, PlannedDancer, PlannedRequest, ScenePlan
from choreograph.settings import DanceConfig

DANCER = PlannedDancer("a", 1.0, (DancerPart(0.0, 2.5, 0),), (0.0, 2.0), (0.0, 1.0), (0.0, 0.5))
SCENE = ScenePlan((PLAN,), (DANCER,))


def test_nothing_is_lost():
    assert ScenePlan.from_json(SCENE.to_json()) == SCENE


def test_requests_keep_what_is_not_the_default():
    """A plan without requests has no key for them, as before there were any."""
    assert "requests" not in json.loads(SCENE.to_json())
    config = DanceConfig(engine="rollout", seed=3, weights={"form": 2.0}, cache=False, beats="librosa")
    request = PlannedRequest.of(0, "house", ("motif:3",), config)
    assert request.settings == {
        "engine": "rollout", "seed": 3, "weights": {"form": 2.0}, "beats": "librosa",
    }  # fmt: skip
    assert request.config() == DanceConfig(**request.settings)
    scene = ScenePlan((PLAN,), (DANCER,), (request,))
    assert ScenePlan.from_json(scene.to_json()) == scene


REQUEST = {"dance": 0, "genre": None, "bans": [], "settings": {}}


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
        (changed("requests", to={}), "expected a list of requests"),
        (changed("requests", to=[{"dance": 0}]), "request 0: expected a genre|request 0: expected a list"),
        (changed("requests", to=[REQUEST | {"genre": 3}]), "request 0: expected a genre by name or null"),
        (changed("requests", to=[REQUEST | {"bans": "x"}]), "request 0: expected a list of bans"),
        (changed("requests", to=[REQUEST | {"settings": []}]), "request 0: expected settings by name"),
        (changed("requests", to=[REQUEST | {"settings": {"seed": "x"}}]), "request 0: expected seed"),
        (changed("requests", to=[REQUEST | {"settings": {"sed": 1}}]), "request 0: .*seed"),
        (changed("requests", to=[REQUEST | {"dance": 1}]), "expected a request for one of 1 dance each"),
        (changed("requests", to=[REQUEST, REQUEST]), "expected a request for one of 1 dance each"),
        (changed("requests", to=[REQUEST | {"more": 1}]), "request 0: expected keys among"),
    ],
)
def test_what_is_malformed_is_refused(text, says):
    with pytest.raises(FormatError, match=says) as error:
        ScenePlan.from_json(text)
    assert "\n" not in str(error.value)
