"""What pages show: planted changes are found, and the waveform has the peaks of the song."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS
from choreograph.choreography.pieces import PieceRequest
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.music.song import Song
from choreograph.plan.plan import PlannedSecond, goes_on
from choreograph.studio import dance_json
from choreograph.studio.dance_json import (
    OF_PIECE,
    THIRDS,
    Palette,
    _measured,
    _thirds,
    changed_spans,
    explained,
    motion_data,
    next_best,
    of_dance,
    part_motion,
    reasons,
    run_at,
    waveform,
    weight_choices,
)

# What pages show: planted changes are found, and the waveform has the peaks of the song.


def test_planted_changes_are_found_and_near_ones_joined(made):
    motion = made.motion.sliced(0, 600)
    quat = motion.local_quat.copy()
    for first, stop in ((100, 130), (136, 150), (400, 401)):
        quat[first:stop, 5] = [0.0, 1.0, 0.0, 0.0]
    root = motion.root_pos_m + np.array([0.1, 0.0, 0.0])  # the place on the floor is no other pose
    spans = changed_spans(motion, replace(motion, local_quat=quat, root_pos_m=root))
    assert spans == [pytest.approx((100 / 60, 150 / 60)), pytest.approx((400 / 60, 401 / 60))]
    assert changed_spans(motion, motion) == []


def test_dances_of_other_lengths_are_compared_as_far_as_both_go(made):
    assert changed_spans(made.motion, made.motion.sliced(0, 300)) == []


@pytest.mark.parametrize("points", [1, 7, 100, 5000])
def test_the_waveform_has_the_peak_of_each_part(points):
    samples = np.zeros(1000, np.float32)
    samples[[100, 900]] = [0.5, -0.25]
    shown = waveform(Song(samples, "a"), points)
    assert len(shown) == points and max(shown) == 1.0
    assert points == 1 or 0.5 in shown


def test_small_figures_have_few_frames(made):
    part = made.motion.sliced(0, 120)
    assert motion_data(part)["facts"]["frames"] == 120
    assert motion_data(part, small=True)["facts"] | {"fps": 20.0} == motion_data(part, small=True)["facts"]


# Explanations: parts, costs and sentences of what is danced, and the next best of it.


def test_costs_are_in_order_with_their_shares_and_sentences():
    found = reasons({"genre": 1.0, "rhythm": 3.0, "front": 0.0, "mine": 4.0}, of_dance())
    assert [(one["name"], one["share"]) for one in found] == [
        ("mine", 0.5),
        ("rhythm", 0.375),
        ("genre", 0.125),
    ]
    assert [one["sentence"] for one in found] == [
        "A cost of your own.",
        of_dance()["rhythm"],
        of_dance()["genre"],
    ]
    assert reasons({}, of_dance()) == reasons({"genre": 0.0}, of_dance()) == []


def test_every_weight_has_a_slider_and_a_sentence():
    assert [choice["name"] for choice in weight_choices()] == list(DEFAULT_WEIGHTS)
    for choice in weight_choices():
        assert choice["low"] <= choice["default"] < choice["high"]
        assert choice["sentence"] == of_dance()[choice["name"]] and choice["sentence"].endswith(".")


def test_the_blocks_of_a_time_are_one_run(made):
    plan = made.plan
    times = [0.5 * (block.start_s + block.end_s) for block in plan.blocks]
    for at_s in times:
        run = run_at(plan, at_s)
        assert run[0].start_s <= at_s < run[-1].end_s
        assert all(goes_on(a, b) for a, b in pairwise(run))
    runs = {run_at(plan, at_s)[0].start_s: run_at(plan, at_s) for at_s in times}
    assert sum(len(run) for run in runs.values()) == len(plan.blocks)
    assert run_at(plan, plan.duration_s)[-1] == plan.blocks[-1]  # the end belongs to the last


def test_a_planted_jump_ends_the_run(made):
    plan = made.plan
    run = next(run for run in (run_at(plan, block.start_s) for block in plan.blocks) if len(run) > 2)
    middle = plan.blocks.index(run[1])
    jumped = replace(run[1], source_start_s=run[1].source_start_s + 3, source_end_s=run[1].source_end_s + 3)
    blocks = (*plan.blocks[:middle], jumped, *plan.blocks[middle + 1 :])
    planted = SimpleNamespace(blocks=blocks)
    assert list(run_at(planted, jumped.start_s)) == [jumped]
    assert run_at(planted, run[0].start_s)[-1] == run[0]


def test_an_explanation_is_of_the_run_and_its_costs(made, repertoire):
    run = run_at(made.plan, 5.0)
    found = explained(made, repertoire, 5.0)
    assert (found["take"], found["start_s"]) == (run[0].source, pytest.approx(run[0].start_s, abs=1e-4))
    assert found["end_s"] == pytest.approx(run[-1].end_s, abs=1e-4)
    source_s = run[-1].source_end_s - run[0].source_start_s
    assert found["stretched"] == pytest.approx((run[-1].end_s - run[0].start_s) / source_s, abs=1e-3)
    total = sum(sum(b.planned.costs.values()) for b in run if isinstance(b.planned, PlannedSecond))
    assert sum(one["cost"] for one in found["reasons"]) == pytest.approx(total, abs=1e-2)
    assert {field.name for field in fields(run[0].planned.credits)} <= set(found)
    assert found["edits"] == [] and found["bars"] == sorted(found["bars"])


@pytest.mark.parametrize("at_s", [-0.1, 1e3, float("nan"), float("inf")])
def test_a_time_outside_of_the_dance_is_refused(made, repertoire, at_s):
    with pytest.raises(ParameterError, match="expected a time within the dance"):
        explained(made, repertoire, at_s)


def test_the_next_best_is_the_cheapest_piece(made, repertoire, monkeypatch):
    asked = []
    pieces = dance_json.Editor.pieces

    def noted(self, slots, request):
        asked.append((slots, request, pieces(self, slots, request)))
        return asked[-1][2]

    monkeypatch.setattr(dance_json.Editor, "pieces", noted)
    best = next_best(made, repertoire, (0.0, made.plan.duration_s), 5.0)
    [(_, request, (_, found))] = asked
    assert isinstance(request, PieceRequest) and best is not None
    assert best["cost"] == pytest.approx(min(piece.cost for piece in found), abs=1e-3)
    assert best["start_s"] < 5.0 < best["end_s"] and best["end_s"] - best["start_s"] < 7.5
    assert {one["name"] for one in best["reasons"]} <= set(OF_PIECE)


def test_without_pieces_there_is_no_next_best(made, repertoire, monkeypatch):
    monkeypatch.setattr(dance_json.Editor, "pieces", lambda self, slots, request: (None, []))
    assert next_best(made, repertoire, (2.0, 6.0), 4.0) is None


# The palette: every part is in one third of each measure, and what is searched has what was asked for.


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
