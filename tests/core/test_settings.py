"""Settings classes: every field is documented, checked by its type, and shown by `help`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pytest

import choreograph as cg
from choreograph.core.errors import ParameterError
from choreograph.core.settings import Range, described, settings


@settings
class Sizes:
    """Sizes of a box."""

    width: Annotated[int, Range(1, 9)] = 3
    """How wide it is."""

    height: Annotated[float, Range(0)] | None = None
    """How high it is.
    None leaves it open."""

    colour: Literal["red", "blue"] | None = "red"
    """Its colour."""

    lid: bool = False
    """Whether it has a lid."""

    place: Path | None = None
    """Where it stands."""

    names: tuple[str, ...] = ()
    """What is written on it."""

    weights: Mapping[str, float] = field(default_factory=dict)
    """What is in it."""

    def __post_init__(self) -> None:
        if self.lid and self.height is None:
            raise ParameterError("expected a height of a box with a lid")


def test_fields_are_described_by_their_docstrings():
    by_name = {setting.name: setting for setting in described(Sizes)}
    assert by_name["width"].kind == "whole number from 1 to 9" and by_name["width"].default == 3
    assert by_name["height"].text == "How high it is. None leaves it open."
    assert by_name["height"].kind == "number of 0 or more or None"
    assert by_name["colour"].choices == ("red", "blue")
    assert by_name["weights"].default == {}


def test_help_shows_all_fields():
    assert Sizes.__doc__.startswith("Sizes of a box.\n\nParameters\n----------\nwidth : whole number")
    assert "    Whether it has a lid." in Sizes.__doc__


@pytest.mark.parametrize(
    "given",
    [
        {"width": 0}, {"width": 10}, {"width": 2.0}, {"width": True}, {"width": "3"}, {"width": None},
        {"height": -1}, {"height": float("nan")}, {"height": "high"}, {"height": 10**400},
        {"colour": "green"}, {"colour": 3}, {"colour": ["red"]}, {"lid": 1}, {"lid": None}, {"place": 5},
        {"names": "abc"}, {"names": [1]}, {"names": 1}, {"weights": 3}, {"weights": [("a", 1)]},
        {"lid": True},
    ],
)  # fmt: skip
def test_a_value_that_does_not_fit_is_refused(given):
    with pytest.raises(ParameterError, match="expected") as raised:
        Sizes(**given)
    assert next(iter(given)) in str(raised.value) and "\n" not in str(raised.value)


def test_values_that_fit_are_kept():
    made = Sizes(
        width=np.int64(4), height=2, colour=None, lid=True, place="a/b", names=["x"], weights={"y": 1.0}
    )
    assert (made.width, type(made.width)) == (4, int)
    assert (made.height, made.colour, made.lid, made.place) == (2, None, True, Path("a/b"))
    assert (made.names, made.weights) == (("x",), {"y": 1.0})


@pytest.mark.parametrize("public", [cg.DanceConfig, cg.BuildOptions, cg.BvhOptions])
def test_every_public_setting_says_what_it_does(public):
    for setting in described(public):
        assert len(setting.text) > 30 and setting.text.endswith("."), setting.name
        assert setting.text in " ".join(public.__doc__.split()), setting.name
