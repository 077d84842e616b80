"""How motifs are drawn is the mixer's and the rollout's setting: equation 5 both ways."""

from __future__ import annotations

import pytest

import choreograph as cg
from choreograph.core.errors import ParameterError

pytestmark = pytest.mark.slow

SONG = cg.example_songs()["house"]


@pytest.mark.parametrize("engine", ["mixer", "rollout"])
def test_both_ways_draw_another_dance(engine):
    drawn = [
        [word.motif for word in cg.dance(SONG, engine=engine, duration_s=30.0, motif_draw=way).plan.words]
        for way in ("missing", "absolute")
    ]
    assert drawn[0] != drawn[1] and len(drawn[0]) == len(drawn[1])


@pytest.mark.parametrize(
    "setting", [{"motif_draw": "absolute"}, {"style_strength": 3.0}, {"style_window": "hamming"}]
)
def test_the_graph_engine_uses_none_of_it(setting):
    with pytest.raises(ParameterError, match="with the graph engine: it is a setting of the"):
        cg.dance(SONG, duration_s=10.0, **setting)
