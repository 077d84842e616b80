"""The recipe of the shipped networks runs from end to end, made small, and what it writes can be used."""

from __future__ import annotations

import sys
from itertools import islice

import numpy as np
import pytest

from choreograph.library.store import read_networks
from choreograph.nets.motion_counts import MotionCounts
from choreograph.nets.style import StyleNets
from content import networks as recipe
from content import style_networks as style_recipe

GENRES = ("house", "waltz")


@pytest.mark.slow
def test_a_small_run_of_the_whole_recipe(tmp_path, monkeypatch):
    output = tmp_path / "clean.h5"
    whole, specs, config = recipe.built_in_takes, style_recipe.take_specs, recipe.motion_counts_config
    monkeypatch.setattr(recipe, "built_in_takes", lambda: whole(2, genres=GENRES))
    monkeypatch.setattr(recipe, "motion_counts_config", lambda preset: config("tiny", steps=2))
    monkeypatch.setattr(recipe, "pretrained_path", lambda name: output)
    monkeypatch.setattr(recipe, "_GENRES_LEFT_OUT", 1)
    monkeypatch.setattr(style_recipe, "take_specs", lambda: islice(specs(), 0, None, 40))  # of nine genres
    monkeypatch.setattr(style_recipe, "STYLES", {g: style_recipe.STYLES[g] for g in GENRES})
    songs = style_recipe.style_songs
    monkeypatch.setattr(style_recipe, "style_songs", lambda: songs(1))
    monkeypatch.setattr(style_recipe, "STEPS", 2)
    monkeypatch.setattr(sys, "argv", ["recipe", "clean", "--work", str(tmp_path / "work")])
    recipe.main()
    nets, provenance = read_networks(output)
    assert set(nets) == {"motion_counts", "style"}
    assert len(provenance["trained_on"]) == 9
    counting = MotionCounts.from_arrays(nets["motion_counts"].weights, nets["motion_counts"].config)
    take = whole(1, genres=GENRES[:1])[0]
    assert len(counting.curves(take.body_pos_m).beat) == len(take.body_pos_m)
    style = StyleNets.from_arrays(nets["style"].weights, nets["style"].config)
    vectors = style.embed_motion(take.body_pos_m, np.array([0, 20]))
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, atol=1e-3)
    first = output.read_bytes()
    recipe.main()  # complete checkpoints: nothing is trained again
    again, _ = read_networks(output)
    for name, net in again.items():
        for key, value in net.weights.items():
            np.testing.assert_array_equal(value, nets[name].weights[key])
    assert len(output.read_bytes()) == len(first)


@pytest.mark.slow
def test_a_checkpoint_of_other_takes_under_the_same_name_is_not_continued(tmp_path):
    config = recipe.motion_counts_config("tiny", steps=2)
    one, other = (recipe.Trial("a", recipe.built_in_takes(1, genres=(genre,)), []) for genre in GENRES)
    recipe.trained(one, config, 0, tmp_path)
    resumed, anew = recipe.trained(other, config, 0, tmp_path), recipe.trained(other, config, 0, None)
    for name, weight in anew.state_dict().items():
        np.testing.assert_array_equal(resumed.state_dict()[name], weight)


def test_research_needs_sources_and_clean_takes_none(monkeypatch, capsys):
    for given in (["research"], ["clean", "dance-with-melody/"]):
        monkeypatch.setattr(sys, "argv", ["recipe", *given, "--work", "never made"])
        with pytest.raises(SystemExit) as refused:
            recipe.main()
        assert refused.value.code == 2 and "sources" in capsys.readouterr().err
