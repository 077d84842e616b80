"""Settings: what is unknown or cannot be used is named."""

from __future__ import annotations

import inspect
from typing import get_type_hints

import numpy as np
import pytest

import choreograph as cg
from choreograph.core.errors import FormatError, ParameterError
from choreograph.library.building.options import BuildOptions, BuildSettings
from choreograph.pipeline.dancing import DanceArguments
from choreograph.settings import DanceConfig, DanceSettings, load_config


def test_the_keywords_are_the_fields_with_their_types():
    """A new setting is one field of `DanceConfig`, and its line in `DanceSettings`."""
    assert get_type_hints(DanceSettings) == get_type_hints(DanceConfig)


def test_the_keywords_of_a_build_are_the_fields():
    keywords, of_fields = get_type_hints(BuildSettings), get_type_hints(BuildOptions)
    wider = {"init_from", "leave_out"}  # other paths and sequences become a `Path` and a tuple
    assert set(keywords) == set(of_fields)
    assert {name for name in keywords if keywords[name] != of_fields[name]} == wider
    assert len(inspect.signature(cg.build).parameters) <= 15
    with pytest.raises(ParameterError, match="got 'word': the most similar one is 'words'"):
        cg.build("takes", "rep.h5", word=False)


def test_dance_has_few_parameters_and_refuses_unknown_names():
    parameters = inspect.signature(cg.dance).parameters
    assert len(parameters) <= 15
    assert set(DanceArguments.__annotations__) == (
        set(DanceSettings.__annotations__) | set(parameters) - {"song", "repertoire", "settings"}
    )
    for call in (cg.dance, cg.vary):
        for wrong, meant in (("planer", "planner"), ("genres", "genre"), ("lock_foot", "lock_feet")):
            with pytest.raises(ParameterError, match=f"got '{wrong}': the most similar one is '{meant}'"):
                call(cg.Song(np.ones(22050, np.float32) / 2, "one"), **{wrong: "greedy"})


def written(path, text: str):
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_replaces_defaults(tmp_path):
    path = written(tmp_path / "c.toml", 'planner = "greedy"\nfps = 30\n[weights]\ngenre = 2\n')
    config = load_config(path, DanceConfig(candidates=7))
    assert config == DanceConfig(planner="greedy", fps=30, candidates=7, weights={"genre": 2})


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("planer = 'exact'", "planer"),
        ("planner = 'best'", "planner"),
        ("planner = ['exact']", "planner"),
        ("candidates = 0", "candidates"),
        ("candidates = true", "candidates"),
        ("candidates = 1.5", "candidates"),
        ("blending = 3", "blending"),
        ('transitions = "words"', "transitions"),
        ('selection = "best"', "selection"),
        ('warping = "linear"', "warping"),
        ('density = "analytic"', "density"),
        ('time_maps = "stairs"', "time_maps"),
        ("lock_feet = 1", "lock_feet"),
        ("hold_ends = 'no'", "hold_ends"),
        ("stage = 0", "stage"),
        ("stage = 'round'", "stage"),
        ("stage = '4'", "stage"),
        ("stage = '4x3x2'", "stage"),
        ("stage = '4x0.5'", "stage"),
        ("stage = 'nanx3'", "stage"),
        ("stage = '4x101'", "stage"),
        ("motif_draw = 'signed'", "motif_draw"),
        ("style_window = 'hann'", "style_window"),
        ("style_strength = -1", "style_strength"),
        ("style_strength = true", "style_strength"),
        ("fps = '60'", "fps"),
        ("fps = nan", "fps"),
        ("fps = 0", "fps"),
        ("seed = -1", "seed"),
        ("beats = 'ears'", "beats"),
        ("beats = 5", "beats"),
        ("weights = 3", "weights"),
        ("weights = {style = 'much'}", "style"),
        ("weights = {style = inf}", "style"),
        ("weights = {style = -0.5}", "style"),
        ("weights = {style = 1" + 400 * "0" + "}", "style"),
    ],
)
def test_unusable_settings_are_named(tmp_path, text, named):
    with pytest.raises(ParameterError, match=named) as raised:
        load_config(written(tmp_path / "c.toml", text))
    assert "\n" not in str(raised.value)


def test_malformed_toml(tmp_path):
    binary = tmp_path / "b.toml"
    binary.write_bytes(b"\xff\x00")
    for path in (written(tmp_path / "c.toml", "a = = 1"), tmp_path / "none.toml", tmp_path, binary):
        with pytest.raises(FormatError, match=r"config \(TOML\)"):
            load_config(path)
