"""Dances of several systems to several songs, in one table."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping, swaying
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.core.errors import ParameterError
from choreograph.evaluation.results import tables
from choreograph.formats.register import save_motion


@pytest.fixture
def songs(tmp_path):
    (tmp_path / "songs").mkdir()
    return [
        write_clicks(tmp_path / "songs" / f"{name}.wav", duration_s=6.0, bpm=bpm)
        for name, bpm in (("one", 100), ("two", 130))
    ]


def cells(evaluation, metric):
    [row] = [row for table in tables(evaluation) for row in table.rows if row.metric.name == metric]
    return row.cells


def test_tables_have_the_mean_and_spread_over_the_songs(songs):
    a, b = stepping(150), swaying(150)
    together = cg.evaluate({"ours": [a, b], "theirs": [b, b]}, songs)
    alone = [cg.evaluate(one, song) for one, song in zip((a, b), songs, strict=True)]
    values = [found.dances[0].scores.values["f_score"] for found in alone]
    cell, _ = cells(together, "f_score")
    assert (cell.n, cell.mean) == (2, pytest.approx(np.mean(values)))
    assert cell.spread == pytest.approx(np.std(values))
    assert together.facts["songs"] == ["one", "two"]


@pytest.mark.parametrize(
    ("motion", "says"),
    [
        (stepping(60), "lists of dances by name"),
        ({"a": [stepping(60)]}, "a dance of a to each of 2 songs, got 1"),
        ({"a": stepping(60)}, "dances of a"),
        ({}, "got none"),
    ],
)
def test_dances_that_do_not_match_the_songs_are_refused(songs, motion, says):
    with pytest.raises(ParameterError, match=says):
        cg.evaluate(motion, songs)


def test_no_songs_are_refused():
    with pytest.raises(ParameterError):
        cg.evaluate({"a": []}, [])


def test_folders_are_matched_by_the_names_of_songs(tmp_path, songs):
    for system, names in (("ours", ("one", "two")), ("theirs", ("two",))):
        (tmp_path / system).mkdir()
        for name in names:
            save_motion(tmp_path / system / f"{name}.bvh", stepping(150))
    folders = tmp_path / "ours", tmp_path / "theirs", tmp_path / "songs"
    result = run("evaluate", *folders, "--json", "-")
    assert result.exit_code == 0, result.output
    dances = json.loads(result.stdout)["dances"]
    assert [(dance["variant"][-5:], dance["song"]) for dance in dances] == [
        ("/ours", "one"), ("/ours", "two"), ("heirs", "two"),
    ]  # fmt: skip
    (tmp_path / "others").mkdir()
    save_motion(tmp_path / "others" / "three.bvh", stepping(60))
    assert_one_line(run("evaluate", tmp_path / "others", folders[2]), says="named as the songs")
    assert_one_line(run("evaluate", tmp_path / "ours" / "one.bvh", folders[2]), says="folders of dances")
    assert_one_line(run("evaluate", *folders, "--page", tmp_path / "p.html"), says="one song beside --page")
