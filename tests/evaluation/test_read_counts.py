"""Counts read from motion: right where the true ones are known, and wrong where the motion is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import choreograph as cg
from choreograph.core.counts import Counts
from choreograph.evaluation.dance_scores import read_count_scores, read_counts
from choreograph.evaluation.songs import SongMusic
from choreograph.music.form import Sections


@pytest.fixture(scope="module", params=["cha-cha", "waltz"])
def known(request):
    """A built-in take and its true counts."""
    starter = cg.starter_repertoire()
    index = starter.take_index(f"{request.param}-04")  # of some takes, the network reads another count 1
    return starter.motion(index)[0], starter.counts(index)


def music_of(counts: Counts, duration_s: float) -> SongMusic:
    sections = Sections(np.array([0.0, duration_s]), np.array([0]))
    return SongMusic((counts,), counts.times_s, sections, np.zeros(1), duration_s)


def scores(motion, counts):
    return read_count_scores(motion, music_of(counts, motion.duration_s), np.random.default_rng(0))


def test_the_counts_of_a_take_are_read(known):
    found = scores(*known)
    assert found.values["counts_read_within"] > 0.9
    assert found.values["downbeat_share_read"] > 0.9
    assert found.chance["counts_read_within"] < 0.45


def test_counts_that_are_not_the_motions_are_not_read(known):
    motion, counts = known
    late = replace(counts, times_s=counts.times_s + 0.5 * np.median(np.diff(counts.times_s)))
    assert scores(motion, late).values["counts_read_within"] < 0.1
    turned = replace(counts, numbers=counts.numbers % counts.metre + 1)  # count 1 is another beat of the bar
    assert scores(motion, turned).values["downbeat_share_read"] < 0.1


def test_a_motion_of_three_seconds_has_no_counts(known):
    motion, counts = known
    short = motion.sliced(0, round(3.0 * motion.fps))
    assert len(read_counts(short)) == 0
    assert scores(short, counts).values == {}
