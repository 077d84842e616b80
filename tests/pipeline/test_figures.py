"""The figures of a dance are those of the takes that it is made of, at their times in the dance."""

from __future__ import annotations

import pytest
from synthetic_motions import swaying
from synthetic_pages import plan_for

import choreograph as cg
from choreograph.core.counts import Figure
from choreograph.formats.vmd import parse_vmd
from choreograph.pipeline.dancing import danced_figures, figures_from
from choreograph.pipeline.scenes import figures_of_parts
from choreograph.plan.scenes import DancerPart


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


def test_dancers_of_a_scene_have_the_figures_of_their_parts_later_and_held():
    """Counts of half a second. A part of another dance, a pose that is held, and a part two counts behind."""
    plan = plan_for(swaying(600, fps=60.0))
    of_dances = [[Figure("a", 0.0, 4.0, 8), Figure("b", 4.0, 8.0, 8)], [Figure("jack", 1.0, 9.0, 16)]]
    parts = (
        DancerPart(0.0, 2.0, 1), DancerPart(2.0, 3.0, 1, held=True), DancerPart(3.0, 9.0, 0, delay_counts=2),
    )  # fmt: skip
    assert figures_of_parts(parts, of_dances, plan) == (
        Figure("jack", 1.0, 3.0, 16), Figure("a", 3.0, 5.0, 8), Figure("b", 5.0, 9.0, 8),
    )  # fmt: skip
    (whole,) = (DancerPart(0.0, 8.0, 0, mirrored=True),)
    assert figures_of_parts([whole], of_dances, plan) == tuple(of_dances[0])


def test_figures_of_a_part_begin_with_it():
    figures = (Figure("a", 0.0, 1.0, 2), Figure("b", 1.0, 3.0, 4), Figure("c", 3.0, 4.0, 2))
    assert figures_from(figures, 0.0) == figures
    assert figures_from(figures, 2.0) == (Figure("b", 0.0, 1.0, 4), Figure("c", 1.0, 2.0, 2))


def test_dancers_of_a_scene_have_fingers_by_what_each_of_them_dances(tmp_path):
    """The second pair is three counts behind. Its files have shapes of hands at other times."""
    repertoire = cg.starter_repertoire()
    scene = cg.scene(
        cg.example_songs()["cha-cha"], repertoire, dancers=3, relation="canon:3", duration_s=15, seed=2
    )
    first, other, second = (dancer.dance.figures for dancer in scene.dancers)
    assert first == danced_figures(scene.plan.dances[0], repertoire)
    behind = [figure for figure in second if figure.start_s > 4.0]
    assert behind and {figure.name for figure in second} <= {figure.name for figure in first}
    assert [figure.start_s for figure in behind] != [f.start_s for f in first][-len(behind) :]
    scene.save(tmp_path / "a.vmd")
    keyed = [parse_vmd((tmp_path / f"a-{n}.vmd").read_bytes()).bones["左人指1"].frames for n in (1, 3)]
    assert len(keyed[0]) > 10 and len(keyed[1]) > 10 and keyed[0].tolist() != keyed[1].tolist()
    again = cg.render_scene_plan(scene.plan, repertoire)
    assert [dancer.dance.figures for dancer in again.dancers] == [first, other, second]
