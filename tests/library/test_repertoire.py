"""An opened repertoire against the takes it was made from."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_repertoire, synthetic_takes

from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.library.derived import middle_starts
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import clip_starts, write_repertoire
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, ground_pos_m, heading_rad, to_root_frame
from choreograph.motion.contacts import CONTACT_JOINTS
from choreograph.motion.motion_beats import mean_joint_speed_m_s


@pytest.fixture(scope="module")
def takes():
    return synthetic_takes(duration_s=20.0)


@pytest.fixture(scope="module")
def repertoire(takes, tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("rep") / "rep.h5", takes)


@pytest.mark.parametrize(
    ("n_frames", "expected"), [(159, []), (160, [0]), (179, [0]), (180, [0, 20]), (0, [])]
)
def test_clips_begin_every_second_that_8_s_follow(n_frames, expected):
    assert clip_starts(n_frames).tolist() == expected


def test_the_middle_of_a_clip_is_its_seconds_2_to_6():
    assert middle_starts(np.array([0, 20])).tolist() == [40, 60]


def test_takes_are_read_back(repertoire, takes):
    assert [info.name for info in repertoire.takes] == ["take0", "take1", "take2"]
    for index, (info, measured) in enumerate(zip(repertoire.takes, takes, strict=True)):
        assert info.credits == measured.take.credits
        assert info.song_name == measured.take.song_name
        assert info.notes == "synthetic"
        assert info.duration_s == pytest.approx(20.0)
        assert repertoire.take_index(info.name) == index
        assert np.array_equal(repertoire.body_pos_m(index), measured.body_pos_m)
        assert np.array_equal(repertoire.motion_beats_s(index), measured.motion_beats_s)
    assert repertoire.skeleton.same_as(takes[0].take.motion.skeleton)
    with pytest.raises(RepertoireError, match="'take9'"):
        repertoire.take_index("take9")


def test_clips_are_ranked_by_energy_and_steps_within_their_genre(takes, tmp_path):
    """Takes of one genre: one stands still, one steps once a second, and one less often."""
    made = []
    for measured, steps_hz in zip(takes, (0.0, 2.0, 0.5), strict=True):
        body = np.repeat(measured.body_pos_m[:1], len(measured.body_pos_m), axis=0)
        time_s = np.arange(len(body))[:, None] / 20
        lift_m = 0.15 * np.maximum(0.0, np.sin(np.pi * steps_hz * time_s))
        feet = [BODY_JOINTS.index(name) for name in CONTACT_JOINTS[:2]]
        body[:, feet, 1] += lift_m.astype(np.float32)
        credits = replace(measured.take.credits, genre="waltz")
        made.append(replace(measured, body_pos_m=body, take=replace(measured.take, credits=credits)))
    clips = synthetic_repertoire(tmp_path / "rep.h5", made)
    steps, energy = (
        [ranks[clips.clip_take == take].mean() for take in range(3)]
        for ranks in (clips.clip_motion.step_ranks, clips.clip_motion.liveliness_ranks)
    )
    assert steps[0] < steps[2] < steps[1] and energy[0] < energy[2] < energy[1]
    assert clips.clip_motion.step_ranks.min() > 0 and clips.clip_motion.step_ranks.max() < 1


def test_motion_is_stored_to_a_tenth_of_a_millimetre(repertoire, takes):
    for index, measured in enumerate(takes):
        motion, first_s = repertoire.motion(index)
        assert first_s == 0
        original = measured.take.motion
        assert np.abs(motion.joint_pos_m() - original.joint_pos_m()).max() < 1e-4
        part, first_s = repertoire.motion(index, 3.01, 5.2)
        first = round(first_s * part.fps)
        assert first_s <= 3.01
        assert first_s + (part.n_frames - 1) / part.fps >= 5.2
        assert np.array_equal(part.root_pos_m, motion.root_pos_m[first : first + part.n_frames])


def test_motion_beyond_the_ends_is_that_at_the_ends(repertoire):
    motion, first_s = repertoire.motion(0, -5.0, 1.0)
    assert first_s == 0
    motion, first_s = repertoire.motion(0, 30.0, 40.0)
    assert motion.n_frames >= 1
    assert first_s + motion.n_frames / motion.fps == pytest.approx(20.0)


def test_the_clip_table(repertoire, takes):
    assert repertoire.n_clips == 3 * 13
    assert np.array_equal(np.bincount(repertoire.clip_take), [13, 13, 13])
    assert repertoire.clip_start_s(14) == 1.0
    for clip in (0, 5, 13, 38):
        measured = takes[repertoire.clip_take[clip]]
        start_s = repertoire.clip_start_s(clip)
        middle = measured.motion_beats_s - start_s
        assert repertoire.clip_beat_count[clip] == ((middle >= 2) & (middle < 6)).sum()
        beats = repertoire.clip_motion_beats(clip)
        assert np.allclose(np.diff(beats), 20 * (0.5, 0.6, 0.75)[repertoire.clip_take[clip]], atol=0.1)
        assert beats.min() >= 0
        assert beats.max() < 160
    density = repertoire.clip_motion.density(np.array([3, 20]))
    assert density.shape == (2, 160)
    beat_frames = np.round(repertoire.clip_motion_beats(20)).astype(int)
    assert density[1, beat_frames].min() > 0.8
    assert density[1].min() < 0.1
    speed = repertoire.clip_motion.speed(np.array([20]))
    assert np.allclose(speed[0], mean_joint_speed_m_s(takes[1].body_pos_m, 20)[140:300], atol=1e-5)


def test_poses_are_in_the_root_frame(repertoire, takes):
    clips, frames = np.array([4, 30]), np.array([10.0, 33.0])
    pose, velocity = repertoire.clip_motion.poses_m(clips, frames)
    assert np.abs(heading_rad(pose)).max() < 1e-5
    assert np.abs(ground_pos_m(pose)).max() < 1e-6
    measured = takes[2]
    at = int(repertoire.clip_start_frame[30]) + 33
    assert np.allclose(pose[1], to_root_frame(measured.body_pos_m[at]), atol=1e-5)
    around = (measured.body_pos_m[at + 1] - measured.body_pos_m[at - 1]) * 10
    turn = rot.about_y(-heading_rad(measured.body_pos_m[at]))
    assert np.allclose(velocity[1], rot.rotate(turn, around), atol=1e-4)
    halfway, _ = repertoire.clip_motion.poses_m(np.array([4]), np.array([10.5]))
    after, _ = repertoire.clip_motion.poses_m(np.array([4]), np.array([11.0]))
    assert np.allclose(halfway[0], (pose[0] + after[0]) / 2, atol=1e-5)


def test_the_repr_is_one_line(repertoire):
    assert repr(repertoire) == "<Repertoire rep.h5: 3 takes, 1.0 min, 39 clips, genres: a, b, c>"


def test_the_html_is_a_table_of_takes(repertoire):
    html = repertoire._repr_html_()
    rows = [re.findall("<td>(.*?)</td>", row) for row in re.findall("<tr>(.*?)</tr>", html)]
    assert rows[1:] == [
        [f"take{i}", "abc"[i], "20.0 s", "13", f"dancer {i}, CC0, synthetic"] for i in range(3)
    ]
    assert "rep.h5: 3 takes" in html


def test_the_html_is_escaped_and_has_at_most_50_takes(takes, tmp_path):
    names = [f"<b>{i}</b> & more" for i in range(60)]
    sixty = zip(names, takes * 20, strict=True)
    many = [replace(m, take=replace(m.take, name=name)) for name, m in sixty]
    write_repertoire(tmp_path / "many.h5", synthetic_contents(many))
    html = Repertoire.open(tmp_path / "many.h5")._repr_html_()
    assert html.count("<tr>") == 1 + 50 + 1
    assert "&lt;b&gt;49&lt;/b&gt; &amp; more" in html
    assert "<b>" not in html
    assert "… and 10 more" in html


@pytest.mark.parametrize("path", [3, None, b"rep.h5"])
def test_open_refuses_what_is_not_a_path(path):
    with pytest.raises(ParameterError, match="expected the path of a repertoire file, got") as error:
        Repertoire.open(path)
    assert "\n" not in str(error.value)
