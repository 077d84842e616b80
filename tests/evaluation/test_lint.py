"""`lint` finds each planted fault of a repertoire, and nothing in takes without faults."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import stepping
from synthetic_repertoire import synthetic_contents, synthetic_takes, synthetic_vocabulary, with_counts

from choreograph.core.counts import FROM_MOTION, NO_COUNTS, make_counts, numbers_in_bar
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.lint import Finding, lint
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import Motifs, make_vocabulary, motif_arrays
from choreograph.library.writing import write_repertoire
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import motion_beat_times_s


def measured_as(measured, motion: Motion, **changes):
    """The take with another motion."""
    take = replace(measured.take, motion=motion, **changes)
    positions = body_pos_m(motion.resampled(NET_FPS)).astype(np.float32)
    return replace(
        measured, take=take, body_pos_m=positions,
        motion_beats_s=motion_beat_times_s(body_pos_m(motion), motion.fps),
    )  # fmt: skip


def found_in(folder, takes) -> list[Finding]:
    write_repertoire(folder / "rep.h5", synthetic_contents(takes))
    return list(lint(Repertoire.open(folder / "rep.h5")))


@pytest.fixture(scope="module")
def takes():
    return with_counts(synthetic_takes())


def relabelled(measured, **credits):
    return replace(measured, take=replace(measured.take, credits=replace(measured.take.credits, **credits)))


def test_takes_without_faults_have_no_findings(tmp_path, takes):
    assert found_in(tmp_path, takes) == []


@pytest.mark.parametrize("first_frame", [0, 37, 67])
def test_a_copy_of_a_part_of_a_take_is_found_wherever_it_begins(tmp_path, takes, first_frame):
    """At 30 fps, most frames lie between two of the 20 fps that are compared."""
    motion = takes[0].take.motion.sliced(first_frame, first_frame + 12 * 30)
    counts = make_counts(np.arange(0.0, 12.0, 0.5), numbers_in_bar(24, 4), 4)
    copy = measured_as(takes[0], motion, name="copy", counts=counts, figures=())
    [finding] = found_in(tmp_path, [*takes, copy])
    assert (finding.kind, finding.take) == ("duplicate", "copy")
    assert "the same motion as in take0" in finding.text
    assert int(finding.text.split()[0]) >= 9


def test_shifted_and_turned_copies_are_copies(tmp_path, takes):
    motion = takes[1].take.motion
    moved = replace(motion, root_pos_m=motion.root_pos_m + np.array([3.0, 0.0, -1.0]))
    [finding] = found_in(tmp_path, [*takes, measured_as(takes[1], moved, name="moved")])
    assert (finding.kind, finding.take) == ("duplicate", "moved")


def test_feet_that_slide_sink_or_float_are_found(tmp_path, takes):
    motion = takes[0].take.motion
    seconds = np.arange(motion.n_frames) / motion.fps
    drift, up = np.zeros((motion.n_frames, 3)), np.zeros((motion.n_frames, 3))
    drift[:, 0] = 4.0 * seconds
    up[:, 1] = 0.5
    faults = {"slides": drift, "sinks": -up / 4, "floats": up}
    bad = []
    for index, (name, shift_m) in enumerate(faults.items()):
        own = stepping(motion.n_frames, period_s=0.5, seed=20 + index)
        moved = replace(own, root_pos_m=own.root_pos_m + shift_m)
        bad.append(relabelled(measured_as(takes[0], moved, name=name), genre="a"))
    good = [
        measured_as(takes[0], stepping(motion.n_frames, period_s=0.5, seed=30 + index), name=f"good{index}")
        for index in range(3)
    ]
    feet = {
        finding.take: finding.text for finding in found_in(tmp_path, [*good, *bad]) if finding.kind == "feet"
    }
    assert set(feet) == set(faults)
    assert "slide at" in feet["slides"]
    assert "below the floor" in feet["sinks"]
    assert "no foot is near the floor for 100 %" in feet["floats"]


def test_a_genre_that_is_spelled_in_two_ways_is_found(tmp_path, takes):
    spelled = [relabelled(t, genre=g) for t, g in zip(takes, ("hip-hop", "Hip Hop", "hip-hop"), strict=True)]
    [finding] = found_in(tmp_path, spelled)
    assert finding == Finding("genre", "take1", "its genre is spelled 'Hip Hop', that of 2 takes 'hip-hop'")


def test_a_take_with_the_motifs_of_another_genre_is_found(tmp_path):
    """Eight takes, of which one is labelled as the other genre: its words are those of the other genre."""
    labels = ("a", "a", "a", "a", "b", "b", "b", "a")
    many = synthetic_takes(periods_s=(0.5,) * 8, duration_s=20.0, genres=labels)
    vocabulary, net = synthetic_vocabulary(many)
    danced = np.where(vocabulary.word_take < 4, 0, 1)  # one motif by the first four takes, one by the others
    two = Motifs(vocabulary.motifs.embeddings[:2], np.array([0, len(danced) - 1]), np.bincount(danced))
    planted = make_vocabulary(
        two,
        danced,
        vocabulary.word_take,
        vocabulary.word_start_s,
        vocabulary.word_end_s,
        labels,
    )
    contents = synthetic_contents(many)
    arrays = {**contents.arrays, **motif_arrays(planted)}
    write_repertoire(tmp_path / "rep.h5", replace(contents, arrays=arrays, nets={"words": net}))
    found = [f for f in lint(Repertoire.open(tmp_path / "rep.h5")) if f.kind == "genre"]
    assert [finding.take for finding in found] == ["take7"]
    assert "its motifs are nearer to b" in found[0].text


def with_own_counts(measured, counts):
    return replace(measured, take=replace(measured.take, counts=counts, figures=()))


def test_counts_that_are_uncertain_or_uneven_are_found(tmp_path, takes):
    uneven_s = np.cumsum(np.tile([0.45, 0.45, 0.45, 0.75], 12))
    uneven = make_counts(uneven_s, numbers_in_bar(len(uneven_s), 4), 4, source="data set")
    doubtful = replace(takes[1].take.counts, source=FROM_MOTION, confidence=0.4)
    changed = [with_own_counts(takes[0], uneven), with_own_counts(takes[1], doubtful), takes[2]]
    found = {finding.take: finding for finding in found_in(tmp_path, changed)}
    assert set(found) == {"take0", "take1"}
    assert found["take0"].text == "its counts last from 0.45 to 0.75 s"
    assert "confidence of 0.40" in found["take1"].text


def test_takes_that_are_never_danced_are_found(tmp_path, takes):
    short = measured_as(
        takes[0], stepping(150, period_s=0.5, seed=9), name="short", counts=NO_COUNTS, figures=()
    )
    uncounted = with_own_counts(
        measured_as(takes[0], stepping(600, period_s=0.5, seed=10), name="uncounted"), NO_COUNTS
    )
    frozen = stepping(600, period_s=0.5, seed=11)
    still = np.repeat(frozen.local_quat[:1], 600, axis=0)
    stands = replace(frozen, local_quat=still, root_pos_m=np.repeat(frozen.root_pos_m[:1], 600, axis=0))
    counts = make_counts(np.arange(0.0, 20.0, 0.5), numbers_in_bar(40, 4), 4)
    frozen_take = with_own_counts(measured_as(takes[0], stands, name="stands"), counts)
    found = {f.take: f.text for f in found_in(tmp_path, [*takes, short, uncounted, frozen_take])}
    assert "never danced: expected 8 s" in found["short"]
    assert found["uncounted"].startswith("it has no counts, and is not danced")
    assert "standing still" in found["stands"]


def test_a_repertoire_without_any_counts_has_one_finding_for_all_takes(tmp_path):
    [finding] = found_in(tmp_path, synthetic_takes())
    assert (finding.kind, finding.take) == ("counts", "")


def test_findings_come_in_the_order_of_their_kinds_with_progress(tmp_path, takes):
    stages: list[tuple[int, int]] = []
    write_repertoire(tmp_path / "rep.h5", synthetic_contents(takes))
    lint(Repertoire.open(tmp_path / "rep.h5"), report=lambda _, done, total: stages.append((done, total)))
    assert stages[0][0] == 0
    assert stages[-1][0] == stages[-1][1]
