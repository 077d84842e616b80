"""Variants of the papers' tables: groups, ablations, and counts of real takes from other sources."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest
from synthetic_repertoire import synthetic_takes, with_counts

from choreograph.core.errors import ParameterError
from choreograph.evaluation import run as shipped
from choreograph.evaluation.songs import EvaluatedSong
from research import variants
from research.variants import GROUPS, VARIANTS, variants_named


def test_every_group_names_variants_and_the_shipped_ones_are_among_them():
    assert {name for group in GROUPS.values() for name in group} <= set(VARIANTS)
    assert VARIANTS.items() >= shipped.VARIANTS.items() and GROUPS.items() >= shipped.GROUPS.items()
    assert [v.name for v in variants_named(["paper", "ours"])] == list(GROUPS["paper"])
    with pytest.raises(ParameterError, match="grace"):
        variants_named(["grace"])


def test_an_ablation_changes_one_part_of_ours():
    ours = VARIANTS["ours"].config
    for variant in variants_named(["ablations"])[1:]:
        changed = [f.name for f in fields(ours) if getattr(variant.config, f.name) != getattr(ours, f.name)]
        assert 1 <= len(changed) <= (2 if variant.name == "no-selection" else 1), variant.name


def test_counts_of_real_takes_come_from_another_source(monkeypatch):
    take = synthetic_takes()[0].take
    counted = with_counts(synthetic_takes())[0].take
    monkeypatch.setattr(variants, "annotate_takes", lambda takes, source: [counted for _ in takes])
    path = Path("song.wav")
    songs = [EvaluatedSong(take.name, path, take=take), EvaluatedSong("alone", path)]
    one, alone = variants.with_counts(songs, [Path("lists")])
    assert one.take is counted and alone is songs[1]
