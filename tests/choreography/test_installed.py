"""Engines and costs of other packages: the examples of the documentation, installed as packages."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from command_line import assert_one_line, run
from installed_packages import installed_package
from synthetic_repertoire import synthetic_repertoire, write_clicks

import choreograph as cg
from choreograph.studio.dance_json import of_dance, reasons, weight_choices

PAGES = Path(__file__).resolve().parents[2] / "docs" / "contributing"


def example(page: str) -> str:
    """The first Python block of a page, without the call that uses what it defines."""
    (block, *_) = re.findall(r"^```python\n(.*?)^```", (PAGES / page).read_text(), flags=re.S | re.M)
    return re.sub(r"^dance = .*", "", block, flags=re.M)


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("installed") / "rep.h5")


@pytest.fixture(scope="module")
def song(tmp_path_factory):
    return cg.load_song(write_clicks(tmp_path_factory.mktemp("song") / "clicks.wav", duration_s=4.0))


@pytest.fixture
def with_engine(tmp_path):
    points = "[choreograph.engines]\nfirst-take = first_take:FirstTake\n"
    return installed_package(tmp_path, "first_take", example("engine.md"), points)


@pytest.mark.parametrize("page", ["cost.md", "engine.md", "format.md"])
def test_the_examples_have_under_40_lines(page):
    assert 5 < example(page).count("\n") < 40


def test_an_installed_engine_dances_and_its_plan_outlives_it(with_engine, repertoire, song, tmp_path):
    with with_engine:
        made = cg.dance(song, repertoire, engine="first-take", seed=1)
        assert (made.plan.engine, set(made.plan.takes_s())) == ("first-take", {repertoire.takes[0].name})
        with pytest.raises(cg.ParameterError, match="expected no costs with the first-take engine"):
            cg.dance(song, repertoire, engine="first-take", costs=[cg.Cost()])
        with pytest.raises(cg.ParameterError, match="expected no candidates with the first-take engine"):
            cg.dance(song, repertoire, engine="first-take", candidates=3)
        assert cg.DanceConfig(engine="first-take").engine == "first-take"
    made.save(tmp_path / "plan.json")
    plan = cg.Plan.read(tmp_path / "plan.json")
    assert cg.render(plan, repertoire).n_frames == made.motion.n_frames
    with pytest.raises(
        cg.ParameterError, match="expected engine among graph, mixer, rollout, got 'first-take'"
    ):
        cg.dance(song, repertoire, engine="first-take")


def test_an_installed_cost_takes_part_where_a_weight_names_it(repertoire, song, tmp_path):
    points = "[choreograph.costs]\nhighhands = high_hands:HighHands\n"
    with installed_package(tmp_path, "high_hands", example("cost.md"), points):
        used = cg.dance(song, repertoire, candidates=4, weights={"highhands": 2.0})
        unused = cg.dance(song, repertoire, candidates=4)
        assert used.plan.weights["highhands"] == 2.0 and "highhands" not in unused.plan.weights
        assert all(second.costs["highhands"] < 0 for second in used.plan.seconds)
        assert "highhands" in run("settings", "weights").stdout
        (slider,) = (choice for choice in weight_choices() if choice["name"] == "highhands")
        assert (slider["default"], slider["high"]) == (0.0, 1.0)
        explained = reasons({"highhands": 2.0}, of_dance())
        assert explained[0]["sentence"] == slider["sentence"] == "All joints are near to the floor."
    with pytest.raises(cg.ParameterError, match="got 'highhands'"):
        cg.dance(song, repertoire, weights={"highhands": 2.0})


def test_a_cost_of_another_name_than_its_entry_point_is_left_out(repertoire, song, tmp_path, caplog):
    points = "[choreograph.costs]\nlowhands = high_hands:HighHands\n"
    with (
        TemporaryDirectory() as site,
        installed_package(Path(site), "high_hands", example("cost.md"), points),
    ):
        refused = run(
            "dance", "none.wav", "-o", tmp_path / "a.bvh", "--db", repertoire.path, "--weight", "lowhands=1"
        )
        assert_one_line(refused, says="got 'lowhands'")
        with pytest.raises(cg.ParameterError, match="got 'lowhands'"):
            cg.dance(song, repertoire, weights={"lowhands": 2.0})
        assert "lowhands" not in run("settings", "weights").stdout
    assert "package high_hands could not be loaded" in caplog.text
    assert "a subclass of Cost with the name 'lowhands'" in caplog.text
