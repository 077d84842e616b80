"""Poses that are held, and joins that are moved: where they are, what they change, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import choreograph as cg
from choreograph.choreography.edits import slot_bounds_s
from choreograph.motion.body import body_pos_m
from choreograph.pipeline.editing import hold, joins_s, moved_join


@pytest.fixture(scope="module")
def made(song, repertoire):
    return cg.dance(song, repertoire)


@pytest.fixture(scope="module")
def joined(made, repertoire):
    """A dance with a join in the middle, between takes that are long enough on both sides."""
    first, other = (take.name for take in repertoire.takes[:2])
    bounds_s = slot_bounds_s(made.plan)
    middle = len(bounds_s) // 2
    pins = [
        cg.TakePin(float(bounds_s[a]), float(bounds_s[b]), take)
        for a, b, take in ((middle - 6, middle, first), (middle, middle + 6, other))
    ]
    dance = cg.edit(made, pins, repertoire)
    [at_s] = [join_s for join_s in joins_s(dance.plan) if abs(join_s - bounds_s[middle]) < 1.1]
    return dance, at_s


def frames_that_differ(one, other):
    differs = np.any(one.local_quat != other.local_quat, axis=(1, 2))
    return np.flatnonzero(differs | np.any(one.root_pos_m != other.root_pos_m, axis=1))


def speed_m_s(motion, from_s, to_s):
    body_m = body_pos_m(motion)[round(from_s * 60) : round(to_s * 60)]
    return float(np.linalg.norm(np.diff(body_m, axis=0), axis=-1).mean() * 60)


def test_a_held_pose_is_nearly_still_and_the_rest_stays(made, repertoire):
    held = cg.edit(made, [cg.Hold(4.0, 7.0)], repertoire)
    bounds_s = slot_bounds_s(made.plan)
    count_s = float(np.median(np.diff(bounds_s)))
    frames = frames_that_differ(made.motion, held.motion)
    assert frames[0] / 60 >= 4.0 - 2.6 * count_s and frames[-1] / 60 <= 7.0 + 2.6 * count_s
    assert speed_m_s(held.motion, 4.3, 6.3) < 0.4 * speed_m_s(made.motion, 4.3, 6.3)
    [word] = [word for word in held.plan.edits[0].words if word.is_held]
    assert abs(word.start_s - 4.0) <= count_s / 2 and abs(word.end_s - 7.0) <= count_s / 2
    assert cg.render(held.plan, repertoire).local_quat.tobytes() == held.motion.local_quat.tobytes()


def test_the_pose_that_is_held_is_that_of_its_start(made, repertoire):
    plan = made.plan
    words = hold(cg.Hold(4.0, 6.0), plan, slot_bounds_s(plan)).words
    index = next(i for i, word in enumerate(words) if word.is_held)
    assert words[index].source_start_s == words[index - 1].source_end_s
    assert words[index].take == words[index - 1].take
    block = next(b for b in plan.blocks if b.start_s <= words[-1].start_s < b.end_s)
    assert words[-1].source_start_s == pytest.approx(block.source_s(words[-1].start_s), abs=1e-3)


@pytest.mark.parametrize("span", [(0.0, 2.0), (4.0, 4.1)])
def test_a_hold_at_the_start_and_one_of_a_count(made, repertoire, span, tmp_path):
    held = cg.edit(made, [cg.Hold(*span)], repertoire)
    held.save(tmp_path / "held.json")
    plan = cg.Plan.read(tmp_path / "held.json")
    assert plan.edits == held.plan.edits
    assert cg.render(plan, repertoire).local_quat.tobytes() == held.motion.local_quat.tobytes()


def test_what_is_held_can_be_repeated_and_changed(made, repertoire):
    chain = [cg.Hold(4.0, 6.0), cg.Repeat(4.5, 7.0, 8.5), cg.Swap(5.0, 5.6)]
    edited = cg.edit(made, chain, repertoire)
    assert any(word.is_held for word in edited.plan.edits[1].words)
    assert cg.render(edited.plan, repertoire).local_quat.tobytes() == edited.motion.local_quat.tobytes()


@pytest.mark.parametrize("counts", [-3, -1, 1, 3])
def test_a_join_moves_by_counts(joined, repertoire, counts):
    dance, at_s = joined
    bounds_s = slot_bounds_s(dance.plan)
    slot = int(np.abs(bounds_s - at_s).argmin())
    moved = cg.edit(dance, [cg.MoveJoin(at_s, counts)], repertoire)
    expected = sorted([*(s for s in joins_s(dance.plan) if s != at_s), bounds_s[slot + counts]])
    assert joins_s(moved.plan) == pytest.approx(expected, abs=1e-3)
    frames = frames_that_differ(dance.motion, moved.motion)
    count_s = float(np.median(np.diff(bounds_s)))
    first_s, last_s = sorted((at_s, float(bounds_s[slot + counts])))
    assert frames[0] / 60 >= first_s - 2.1 * count_s and frames[-1] / 60 <= last_s + 2.1 * count_s
    assert cg.render(moved.plan, repertoire).local_quat.tobytes() == moved.motion.local_quat.tobytes()


def test_a_join_that_is_moved_back_is_where_it_was(joined, repertoire):
    dance, at_s = joined
    bounds_s = slot_bounds_s(dance.plan)
    there = int(np.abs(bounds_s - at_s).argmin()) + 2
    moved = cg.edit(dance, [cg.MoveJoin(at_s, 2), cg.MoveJoin(float(bounds_s[there]), -2)], repertoire)
    assert joins_s(moved.plan) == pytest.approx(joins_s(dance.plan), abs=1e-3)
    for time_s in (at_s - 1.0, at_s - 0.1, at_s + 0.1, at_s + 1.0):
        now, then = (
            next(b for b in plan.blocks if b.start_s <= time_s < b.end_s) for plan in (moved.plan, dance.plan)
        )
        assert now.source == then.source and now.source_s(time_s) == pytest.approx(
            then.source_s(time_s), abs=0.1
        )


def test_joins_that_cannot_be_moved(joined, repertoire):
    dance, at_s = joined
    far_s = at_s + 2.5 * float(np.median(np.diff(slot_bounds_s(dance.plan))))
    with pytest.raises(cg.ParameterError, match="a join of takes within a count"):
        cg.edit(dance, [cg.MoveJoin(far_s, 1)], repertoire)
    for counts in (-200, 200):
        with pytest.raises(cg.ParameterError, match="expected the join at"):
            cg.edit(dance, [cg.MoveJoin(at_s, counts)], repertoire)
    for counts in (0, 1.5, True, "1"):
        with pytest.raises(cg.ParameterError, match="counts of a MoveJoin"):
            cg.MoveJoin(1.0, counts)


def test_a_take_that_ends_cannot_be_danced_on(joined, repertoire):
    """The join is moved to where the take before it would be beyond its end."""
    dance, at_s = joined
    plan, bounds_s = dance.plan, slot_bounds_s(dance.plan)
    edits = list(plan.edits)
    late_s = repertoire.takes[0].duration_s - edits[0].words[-1].source_end_s - 0.2
    words = tuple(
        replace(w, source_start_s=w.source_start_s + late_s, source_end_s=w.source_end_s + late_s)
        for w in edits[0].words
    )
    edits[0] = replace(edits[0], words=words)
    with pytest.raises(cg.ParameterError, match="since take0 ends there"):
        moved_join(cg.MoveJoin(at_s, 3), replace(plan, edits=tuple(edits)), bounds_s, repertoire)
