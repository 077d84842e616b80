"""Edits of dances: local to the bit, whole plans after any chain, and alternatives, judged by the motion."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from command_line import assert_one_line, run

import choreograph as cg
from choreograph.choreography.edits import edit_slots, slot_bounds_s
from choreograph.choreography.pieces import pose_distance_m
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.formats.npz import read_npz
from choreograph.motion.body import body_pos_m, clips_to_root_frame

MOST_BEATS, FRAME_S = 2, 1 / 60


def changed_s(before, after):
    """The first and the last time at which two dances differ, or None."""
    pairs = zip((before.root_pos_m, before.local_quat), (after.root_pos_m, after.local_quat), strict=True)
    differs = [np.any((a != b).reshape(len(a), -1), axis=1) for a, b in pairs]
    frames = np.flatnonzero(np.logical_or(*differs))
    return (frames[0] / before.fps, frames[-1] / before.fps) if len(frames) else None


def sources(plan, times_s):
    return [
        [
            (b.source, round(b.source_s(at_s), 3), b.mirrored)
            for b in plan.blocks
            if b.start_s <= at_s < b.end_s
        ]
        for at_s in times_s
    ]


def random_edit(plan, rng, takes):
    """An edit at random times, and the span that it names."""
    duration_s = plan.duration_s
    length_s = rng.uniform(0.6, 3.0)
    start_s = rng.uniform(0.0, duration_s - length_s)
    end_s = start_s + length_s
    kind = int(rng.integers(4))
    if kind == 0:
        return cg.Swap(start_s, end_s), (start_s, end_s)
    if kind == 1:
        return cg.Vary(start_s, end_s), (start_s, end_s)
    if kind == 2:
        return cg.TakePin(start_s, end_s, str(rng.choice(takes))), (start_s, end_s)
    at_s = rng.uniform(0.0, duration_s - length_s - 1.5)
    bounds_s = slot_bounds_s(plan)
    n = max(1, int(np.abs(bounds_s - end_s).argmin() - np.abs(bounds_s - start_s).argmin()))
    first = int(np.abs(bounds_s - at_s).argmin())
    mirrored = bool(rng.integers(2))
    return cg.Repeat(start_s, end_s, at_s, mirrored=mirrored), (at_s, float(bounds_s[first + n]))


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_chain_of_twenty_edits_is_local_whole_and_rendered_to_the_same_bytes(
    made, repertoire, seed, tmp_path
):
    rng = np.random.default_rng(seed)
    takes = [take.name for take in repertoire.takes]
    bounds_s = slot_bounds_s(made.plan)
    beat_s = float(np.diff(bounds_s).max())
    dance = cg.Dance(cg.render(made.plan, repertoire), made.plan)
    for number in range(20):
        one, (start_s, end_s) = random_edit(dance.plan, rng, takes)
        edited = cg.edit(dance, [one], repertoire)
        first_s, last_s = changed_s(dance.motion, edited.motion)
        assert first_s >= start_s - (1 + MOST_BEATS) * beat_s and last_s <= end_s + (1 + MOST_BEATS) * beat_s
        n_before = len(dance.plan.edits)
        planned = edited.plan.edits[n_before:]
        assert edited.plan.edits[:n_before] == dance.plan.edits
        assert all(new.request.endswith(str(one)) for new in planned)
        assert planned[0].start_s <= first_s + FRAME_S and last_s <= planned[-1].end_s + FRAME_S
        spans_s = [(new.start_s - FRAME_S, new.end_s + FRAME_S) for new in planned]
        times_s = np.arange(dance.plan.opening_s, dance.plan.danced_until_s, 0.37)
        outside = [at_s for at_s in times_s if not any(a < at_s < b for a, b in spans_s)]
        assert sources(edited.plan, outside) == sources(dance.plan, outside)
        assert all(
            len(found) == 1 and found[0][0] for found in sources(edited.plan, np.arange(0.0, 12.0, 0.5))
        )
        if number % 7 == 6:  # saved and opened again between edits
            edited.save(tmp_path / "a.json")
            edited = cg.edit(tmp_path / "a.json", [cg.Swap(2.0, 3.0)], repertoire)
        dance = edited
    again = cg.render(cg.Plan.from_json(dance.plan.to_json()), repertoire)
    assert again.root_pos_m.tobytes() == dance.motion.root_pos_m.tobytes()
    assert again.local_quat.tobytes() == dance.motion.local_quat.tobytes()
    steps_m = np.linalg.norm(np.diff(dance.motion.root_pos_m, axis=0), axis=1)
    assert steps_m.max() < 0.1  # a frame: no jump where edits begin and end


def test_a_swap_dances_something_else_and_another_seed_something_else_again(made, repertoire):
    one, two = (cg.edit(made, [cg.Swap(4.0, 6.0)], repertoire, seed=seed) for seed in (0, 1))
    at_s = [4.5, 5.5]
    kinds = [sources(dance.plan, at_s) for dance in (made, one, two)]
    assert all(a != b for a, b in combinations(kinds, 2))
    assert one.plan == cg.edit(made, [cg.Swap(4.0, 6.0)], repertoire).plan


def test_a_variation_is_nearer_than_a_swap(made, repertoire):
    span = slice(round(4.0 * 60), round(6.0 * 60))
    there = clips_to_root_frame(body_pos_m(made.motion)[span])
    away = [
        pose_distance_m(there, clips_to_root_frame(body_pos_m(cg.edit(made, [one], repertoire).motion)[span]))
        for one in (cg.Vary(4.0, 6.0), cg.Swap(4.0, 6.0))
    ]
    assert 0 < away[0] <= away[1]


def test_a_repetition_has_the_takes_of_what_it_repeats_count_by_count(made, repertoire):
    bounds_s = slot_bounds_s(made.plan)
    for mirrored in (False, True):
        again = cg.edit(made, [cg.Repeat(2.0, 4.0, 7.0, mirrored=mirrored)], repertoire)
        first, at = (int(np.abs(bounds_s - s).argmin()) for s in (2.0, 7.0))
        wanted = [
            (name, s, mirrored) for ((name, s, _),) in sources(made.plan, bounds_s[first : first + 4] + 0.01)
        ]
        found = [one for (one,) in sources(again.plan, bounds_s[at : at + 4] + 0.01)]
        assert [(name, m) for name, _, m in found] == [(name, m) for name, _, m in wanted]
        np.testing.assert_allclose([s for _, s, _ in found], [s for _, s, _ in wanted], atol=0.03)


def test_a_pinned_take_is_danced_where_it_is_pinned_and_a_banned_one_nowhere(made, repertoire):
    take = max(made.plan.takes_s(), key=made.plan.takes_s().get)
    banned = cg.edit(made, [cg.Ban(take=take)], repertoire)
    assert take not in banned.plan.takes_s()
    pinned = cg.edit(banned, [cg.TakePin(5.0, 7.0, take)], repertoire)
    assert {name for ((name, _, _),) in sources(pinned.plan, [5.3, 6.0, 6.7])} == {take}
    with pytest.raises(ParameterError, match="expected pins of takes that are not banned"):
        cg.edit(made, [cg.Ban(take=take), cg.TakePin(5.0, 7.0, take)], repertoire)


def test_the_ends_of_a_dance_are_edited_and_still_held(made, repertoire):
    edited = cg.edit(made, [cg.Swap(0.0, 2.0), cg.Swap(10.0, made.plan.duration_s)], repertoire)
    first_s, last_s = changed_s(made.motion, edited.motion)
    assert first_s < 0.5 and last_s > made.plan.duration_s - 0.5
    span_s = made.plan.opening_s, made.plan.closing_s
    assert (edited.plan.opening_s, edited.plan.closing_s) == span_s


def test_a_pin_of_a_new_dance_says_for_how_long_its_take_is_danced(repertoire, song):
    dance = cg.dance(song, repertoire, pins=[cg.TakePin(4.3, 6.2, "take1")], candidates=4)
    (note,) = [note for note in dance.notes if note.startswith("4.3-6.2=take:take1 is danced from ")]
    from_s, to_s = (float(number) for number in re.findall(r"\d+\.\d", note)[2:4])
    assert from_s <= 4.3 and to_s >= 6.2 and to_s - from_s > 2.0
    inside = sources(dance.plan, np.arange(from_s + 0.1, to_s - 0.1, 0.2))
    assert {name for ((name, _, _),) in inside} == {"take1"}
    pinned = cg.edit(cg.dance(song, repertoire, candidates=4), [cg.TakePin(4.3, 6.2, "take1")], repertoire)
    assert not any("is danced from" in note for note in pinned.notes)


def test_a_motion_file_is_edited_with_its_song(made, repertoire, song, tmp_path):
    made.save(tmp_path / "old.npz")
    edited = cg.edit(tmp_path / "old.npz", [cg.Swap(4.0, 6.0)], repertoire, song=song)
    assert edited.plan.kept_of == "old.npz" and edited.plan.blocks[0].source == "old.npz"
    again = cg.render(edited.plan, repertoire, existing=read_npz(tmp_path / "old.npz"))
    assert np.array_equal(again.local_quat, edited.motion.local_quat)
    with pytest.raises(ParameterError, match=r"expected the song of old\.npz for its counts"):
        cg.edit(tmp_path / "old.npz", [cg.Swap(4.0, 6.0)], repertoire)
    with pytest.raises(ParameterError, match="a part whose takes are not known"):
        cg.edit(edited, [cg.Repeat(1.0, 2.0, 8.0)], repertoire)


@pytest.mark.parametrize(
    ("edits", "said"),
    [
        ([], "expected an edit, got none"),
        ([cg.Keep(0.0, 2.0)], "edits"),
        ([cg.Swap(3.0, 2.0)], "expected an edit with a start before its end"),
        ([cg.Repeat(1.0, 3.0, 11.5)], "to end within the dance"),
        ([cg.Repeat(1.0, 3.0, -1.0)], "to end within the dance"),
    ],
)
def test_edits_that_cannot_be_made_are_said_in_one_line(made, repertoire, edits, said):
    with pytest.raises(ParameterError, match=said):
        cg.edit(made, edits, repertoire)


def test_an_unknown_take_is_said(made, repertoire):
    with pytest.raises(RepertoireError, match="takes, got 'nobody'"):
        cg.edit(made, [cg.TakePin(1.0, 2.0, "nobody")], repertoire)
    seconds = (replace(made.plan.seconds[0], take="lost"), *made.plan.seconds[1:])
    with pytest.raises(RepertoireError, match="takes, got 'lost'"):
        cg.edit(replace(made, plan=replace(made.plan, seconds=seconds)), [cg.Swap(1.0, 2.0)], repertoire)


@pytest.mark.slow
def test_alternatives_are_ranked_apart_and_explained():
    session = cg.Session(cg.example_songs()["house"], duration_s=14.0)
    dance = session.dance(candidates=16)
    found = session.alternatives((5.0, 8.0), n=5)
    assert len(found) == 5
    costs = [one.cost for one in found]
    assert costs == sorted(costs) and all(one.why for one in found)
    slots, bounds_s = edit_slots(5.0, 8.0, slot_bounds_s(dance.plan)), slot_bounds_s(dance.plan)
    first, stop = (bounds_s[[slots.first, slots.stop]] * 60).round().astype(int)
    motions = [dance.motion, *(one.dance.motion for one in found)]
    shown = [clips_to_root_frame(body_pos_m(motion.sliced(first, stop))[::3]) for motion in motions]
    assert min(pose_distance_m(a, b) for a, b in combinations(shown, 2)) >= 0.2
    for one in found:
        first_s, last_s = changed_s(dance.motion, one.dance.motion)
        assert one.start_s <= first_s + FRAME_S and last_s <= one.end_s + FRAME_S
        assert one.cost == pytest.approx(sum(one.costs.values())) and min(one.costs.values()) >= 0
    again = cg.render(cg.Plan.from_json(found[0].dance.plan.to_json()), session.repertoire)
    assert np.array_equal(again.local_quat, found[0].dance.motion.local_quat)


def test_alternatives_are_of_a_number_and_a_span(made, repertoire, song):
    session = cg.Session(song, repertoire)
    with pytest.raises(ParameterError, match="alternatives of 1 or more"):
        session.alternatives((4.0, 7.0), n=0, existing=made)
    with pytest.raises(ParameterError, match="a span as two times"):
        session.alternatives((4.0, 7.0, 8.0), existing=made)


def test_from_the_command_line_with_named_times(made, repertoire, song, tmp_path):
    made.save(tmp_path / "old.json")
    asked = ("dance", song, "--db", repertoire.path, "--existing", tmp_path / "old.json", "-q")
    edited = run(*asked, "--swap", "0:04-bar 4", "--repeat", "bar 1@8=mirror", "-o", tmp_path / "new.json")
    assert edited.exit_code == 0, edited.output
    plan = cg.Plan.read(tmp_path / "new.json")
    assert len(plan.edits) == 2 and plan.edits[1].words[0].mirrored
    assert replace(plan, edits=()) == made.plan
    rendered = run(
        "dance", "--plan", tmp_path / "new.json", "--db", repertoire.path, "-o", tmp_path / "a.npz", "-q"
    )
    assert rendered.exit_code == 0, rendered.output
    for options, said in (
        (("--swap", "1-2", "--keep", "4-6"), "expected no --keep beside"),
        (("--swap", "1-2", "--engine", "mixer"), "expected no --engine beside --swap"),
        (("--vary", "1"), "expected --vary FROM-TO"),
        (("--swap", "bar 99-bar 100"), "got bar 99"),
    ):
        assert_one_line(run(*asked, *options, "-o", tmp_path / "x.json"), says=said)
    alone = run("dance", song, "--db", repertoire.path, "--swap", "1-2", "-o", tmp_path / "x.json")
    assert_one_line(alone, says="expected --existing beside --swap")
