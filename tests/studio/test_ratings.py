"""Ratings of versions, in the files of a study."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest

from choreograph.core.errors import FormatError
from choreograph.studio.ratings import rate
from research.study.results import read_study

SCHEMA = json.loads((Path(__file__).parents[2] / "data_schema" / "rating.schema.json").read_text())


def test_a_study_of_two_versions_grows(tmp_path):
    folder = tmp_path / "a.study"
    for better in (0, 0, 1, None):
        path = rate(folder, "a.wav", ("graph, seed 0", "graph, seed 1"), better)
    jsonschema.validate(json.loads(path.read_text()), SCHEMA)
    [preference] = read_study(folder).preferences
    assert (preference.question, preference.n_answers) == ("better", 3)
    share = preference.share if preference.variant == "graph, seed 0" else 1 - preference.share
    assert share == pytest.approx(2 / 3)


def test_versions_of_one_name_are_told_apart(tmp_path):
    rate(tmp_path / "a.study", "a.wav", ("graph", "graph"), 1)
    assert read_study(tmp_path / "a.study").preferences[0].variant in ("graph (A)", "graph (B)")


def test_another_study_is_refused(tmp_path):
    folder = tmp_path / "a.study"
    rate(folder, "a.wav", ("x", "y"), 1)
    key = json.loads((folder / "key.json").read_text())
    for other in ({}, [], {**key, "version": 2}, {**key, "pairs": None}, {**key, "study": 1}):
        (folder / "key.json").write_text(json.dumps(other))
        with pytest.raises(FormatError):
            rate(folder, "a.wav", ("x", "y"), 1)
