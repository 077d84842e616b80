"""Settings: what is unknown or cannot be used is named."""

from __future__ import annotations

import pytest

from choreograph.core.errors import FormatError, ParameterError
from choreograph.settings import DEFAULT_WEIGHTS, DanceConfig, load_config, resolve_weights


def written(path, text: str):
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_replaces_defaults(tmp_path):
    path = written(tmp_path / "c.toml", 'planner = "greedy"\nfps = 30\n[weights]\nstyle = 2\n')
    config = load_config(path, DanceConfig(candidates=7))
    assert config == DanceConfig(planner="greedy", fps=30, candidates=7, weights={"style": 2})


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
        ("keep_on_stage = 0", "keep_on_stage"),
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


def test_weights_are_given_or_default_or_one():
    weights = resolve_weights({"style": 3}, ["style", "transition", "mine"])
    assert weights == {"style": 3.0, "transition": DEFAULT_WEIGHTS["transition"], "mine": 1.0}
    with pytest.raises(ParameterError, match="'stile'"):
        resolve_weights({"stile": 1}, ["style"])
