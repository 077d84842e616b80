"""The palette: every part is in one third of each measure, and what is searched has what was asked for."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.studio.palette import THIRDS, Palette, _measured, _thirds, part_motion

NAN = float("nan")
ANY = {"text": "", "genre": "", "energy": "", "level": "", "travel": "", "offset": 0, "limit": 1000}


@pytest.fixture(scope="module")
def palette(repertoire):
    return Palette(repertoire)


def test_parts_are_within_their_takes_and_do_not_overlap(palette, repertoire):
    ends_s = {}
    for part in palette.parts:
        assert part.from_s >= ends_s.get(part.take, 0.0) - 1e-3 and part.to_s - part.from_s >= 1.0
        ends_s[part.take] = part.to_s
    durations_s = {info.name: info.duration_s for info in repertoire.takes}
    assert all(ends_s[take] <= durations_s[take] + 1e-3 for take in ends_s) and ends_s


@pytest.mark.parametrize("name", ["energy", "level", "travel"])
def test_the_thirds_are_all_parts(palette, name):
    found = [palette.found(**ANY | {name: third}) for third in THIRDS]
    assert all(part[name] == third for third, one in zip(THIRDS, found, strict=True) for part in one["takes"])
    assert sum(one["total"] for one in found) == len(palette.parts)
    assert all(one["total"] < len(palette.parts) for one in found)


def test_those_that_travel_farther_are_in_higher_thirds(palette):
    for third in (1, 2):
        less_m = max((part.travel_m for part in palette.parts if part.travel < third), default=0.0)
        assert less_m <= min(part.travel_m for part in palette.parts if part.travel >= third) + 0.01


def test_pages_of_parts_are_those_of_all(palette):
    all_takes = palette.found(**ANY)["takes"]
    pages = [palette.found(**ANY | {"offset": i, "limit": 2}) for i in range(0, len(all_takes) + 2, 2)]
    assert [part for page in pages for part in page["takes"]] == all_takes
    assert all(page["total"] == len(all_takes) for page in pages)


def test_a_search_finds_all_its_words_in_any_case(palette):
    part = palette.parts[0]
    found = palette.found(**ANY | {"text": f"  {part.take.upper()} {part.credits.genre} "})
    assert found["total"] == sum(part.take.lower() in one.text for one in palette.parts) > 0
    assert palette.found(**ANY | {"text": f"{part.take} no-such-word"})["total"] == 0
    for genre in {one.credits.genre for one in palette.parts} - {""}:
        n_parts = sum(one.credits.genre == genre for one in palette.parts)
        assert palette.found(**ANY | {"genre": genre})["total"] == n_parts
    assert palette.found(**ANY | {"genre": "no such"})["total"] == 0


def test_motifs_are_on_the_first_page_alone(palette, repertoire):
    motifs = palette.found(**ANY)["motifs"]
    assert len(motifs) == (repertoire.vocabulary.n_motifs if repertoire.has_vocabulary else 0)
    assert all(motif["words"] > 0 and motif["from_s"] < motif["to_s"] for motif in motifs)
    for later in ({"offset": 1}, {"text": "a"}):
        assert palette.found(**ANY | later)["motifs"] == []


@pytest.mark.parametrize("name", ["energy", "level", "travel"])
@pytest.mark.parametrize("third", ["much", "LOW", "2", "x" * 1000])
def test_an_unknown_third_is_refused_in_one_line(palette, name, third):
    with pytest.raises(ParameterError, match=f"expected {name} among low, middle, high") as refused:
        palette.found(**ANY | {name: third})
    assert len(str(refused.value)) < 100


def test_a_planted_walk_is_measured():
    pose_m = np.random.default_rng(0).uniform(0.0, 1.0, (21, 3))
    pose_m[:, 1] += 1.0 - pose_m[0, 1]  # the hips are at 1 m
    pose_m[1] = [0.0, 0.1, 0.0]
    pose_m[2:, 1] = np.maximum(pose_m[2:, 1], 0.1)
    walk_m = pose_m + np.linspace(0.0, 2.0, 41)[:, None, None] * [0.6, 0.0, 0.8]  # 2 m in 2 s
    assert _measured(walk_m) == pytest.approx((1.0, 0.9, 2.0), abs=1e-6)
    assert _measured(walk_m[:1]) == (0.0, 0.0, 0.0)


def test_thirds_are_by_size():
    assert _thirds(np.array([5.0, 1.0, 3.0, 2.0, 6.0, 4.0])).tolist() == [2, 0, 1, 0, 2, 1]
    assert _thirds(np.arange(12.0)).tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert _thirds(np.zeros(0)).tolist() == []


def test_the_motion_of_a_part_is_that_of_the_take(repertoire):
    take = repertoire.takes[0]
    shown = part_motion(repertoire, take.name, 1.0, 3.0)
    assert shown["from_s"] == pytest.approx(1.0, abs=0.1) and shown["facts"]["fps"] == 20
    assert shown["facts"]["frames"] == pytest.approx(40, abs=2)
    long = part_motion(repertoire, take.name, 0.0, take.duration_s)
    assert long["facts"]["frames"] <= 20 * 12 + 2  # no more than is shown


@pytest.mark.parametrize(
    ("from_s", "to_s"),
    [(3.0, 2.0), (2.0, 2.0), (-1.0, 2.0), (0.0, 1e4), (float("nan"), 2.0), (0.0, float("nan"))],
)
def test_a_part_that_a_take_does_not_have_is_refused(repertoire, from_s, to_s):
    with pytest.raises(ParameterError, match="expected a part of"):
        part_motion(repertoire, repertoire.takes[0].name, from_s, to_s)


@pytest.mark.parametrize("name", ["", "none", "../a"])
def test_an_unknown_take_is_refused(repertoire, name):
    with pytest.raises(RepertoireError):
        part_motion(repertoire, name, 0.0, 1.0)
