"""The figures of a dance are those of the takes that it is made of, at their times in the dance."""

from __future__ import annotations

import pytest

import choreograph as cg
from choreograph.core.counts import Figure
from choreograph.pipeline.figures import danced_figures, figures_from


@pytest.fixture(scope="module", params=["graph", "mixer"])
def made(request):
    return cg.dance(cg.example_songs()["waltz"], duration_s=15, engine=request.param, seed=1)


def test_figures_are_in_order_and_of_the_takes_that_are_danced(made):
    repertoire = cg.starter_repertoire()
    assert made.figures and made.figures == danced_figures(made.plan, repertoire)
    named = {
        figure.name
        for take in made.plan.takes_s()
        for figure in repertoire.figures(repertoire.take_index(take))
    }
    assert {figure.name for figure in made.figures} <= named
    for figure in made.figures:
        assert 0.0 <= figure.start_s < figure.end_s <= made.plan.duration_s + 1e-6
    starts_s = [figure.start_s for figure in made.figures]
    assert starts_s == sorted(starts_s)


def test_in_the_middle_of_a_figure_its_take_is_in_the_middle_of_it(made):
    repertoire = cg.starter_repertoire()
    for figure in made.figures:
        at_s = (figure.start_s + figure.end_s) / 2
        block = next(each for each in made.plan.blocks if each.start_s <= at_s <= each.end_s)
        danced = repertoire.figures(repertoire.take_index(block.source))
        inside = [f for f in danced if f.start_s - 0.3 <= block.source_s(at_s) <= f.end_s + 0.3]
        assert figure.name in {each.name for each in inside}


def test_figures_of_a_part_begin_with_it():
    figures = (Figure("a", 0.0, 1.0, 2), Figure("b", 1.0, 3.0, 4), Figure("c", 3.0, 4.0, 2))
    assert figures_from(figures, 0.0) == figures
    assert figures_from(figures, 2.0) == (Figure("b", 0.0, 1.0, 4), Figure("c", 1.0, 2.0, 2))
