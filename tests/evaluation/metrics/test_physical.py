"""Synthetic slides, depths and jumps are measured as made; empty and malformed input is refused."""

from __future__ import annotations

import numpy as np
import pytest
from golden.regenerate import golden, physical_scores, synthetic_dance
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import physical
from choreograph.evaluation.metrics.physical import evaluate_contacts, foot_skating_ratio, pfc, validate
from choreograph.motion.body import BODY_JOINTS, body_pos_at, body_pos_m
from choreograph.motion.contacts import sole_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton

FPS = 60.0
BALLS = [BODY_JOINTS.index("left_foot"), BODY_JOINTS.index("right_foot")]


def _standing(n_frames: int = 120) -> Motion:
    quat = np.zeros((n_frames, 24, 4))
    quat[..., 0] = 1.0
    skeleton = canonical_skeleton()
    root = np.tile(skeleton.offsets_m[0], (n_frames, 1))
    return Motion(skeleton, root, quat, FPS)


def test_standing_still_is_perfect():
    scores = physical.evaluate(body_pos_m(_standing()), FPS, [1.0])
    assert scores["foot_slide_cm_s"] == 0
    assert scores["floor_penetration_cm"] == 0
    assert scores["jerk_p95_m_s3"] < 1e-6


@given(speed_cm_s=st.floats(0.1, 500), heading=st.floats(-3.1, 3.1))
def test_slide_is_the_synthetic_speed(speed_cm_s, heading):
    pos = body_pos_m(_standing(40))
    along = np.arange(40)[:, None] / FPS * speed_cm_s / 100
    pos = pos + along[:, None] * [np.sin(heading), 0.0, np.cos(heading)]
    assert physical.foot_slide_cm_s(pos, FPS) == pytest.approx(speed_cm_s)


def test_a_raised_foot_does_not_slide():
    pos = body_pos_m(_standing(40)).copy()
    pos[:, BALLS[0], 0] += np.arange(40) * 0.01
    assert physical.foot_slide_cm_s(pos, FPS) == pytest.approx(30.0)  # one foot of two at 60 cm/s
    pos[:, BALLS[0], 1] += 0.2
    assert physical.foot_slide_cm_s(pos, FPS) == 0
    pos[:, BALLS[1], 1] += 0.2
    assert physical.foot_slide_cm_s(pos, FPS) == 0  # never low


@given(depth_cm=st.floats(0, 30))
def test_penetration_is_the_synthetic_depth(depth_cm):
    motion = _standing(20)
    stands_m = sole_pos_m(motion)[..., 1].min()
    sunk = motion.moved(shift_m=np.array([0.0, -stands_m - depth_cm / 100, 0.0]))
    depth = physical.floor_penetration_cm(body_pos_m(sunk), FPS, sole_pos_m=sole_pos_m(sunk))
    assert depth == pytest.approx(depth_cm, abs=1e-9)


def test_a_sunk_heel_counts_without_soles():
    pos = body_pos_m(_standing(20)).copy()
    pos[:10, BODY_JOINTS.index("left_ankle"), 1] = physical.ANKLE_OVER_SOLE_M - 0.04
    assert physical.floor_penetration_cm(pos, FPS) == pytest.approx(2.0)  # 4 cm in half of the frames


def test_jerk_of_a_cubic_is_its_third_derivative():
    times = np.arange(120) / FPS
    pos = body_pos_m(_standing()) + (7.0 / 6.0 * times**3)[:, None, None] * [1.0, 0.0, 0.0]
    instants, jerk = physical.joint_jerk_m_s3(pos, FPS)
    assert np.allclose(jerk, 7.0, rtol=1e-6)
    assert (np.diff(instants) > 0).all()
    assert physical.jerk_ratio_at(pos, FPS, [1.0]) == pytest.approx(1.0, rel=1e-6)


def test_a_jump_raises_jerk_only_where_it_is():
    pos = body_pos_m(_standing(240)).copy()
    pos += np.random.default_rng(0).normal(0, 1e-4, pos.shape)
    pos[120:, :, 0] += 0.2
    assert physical.jerk_ratio_at(pos, FPS, [2.0]) > 5
    assert physical.jerk_ratio_at(pos, FPS, [3.0]) < 1.5
    assert np.isnan(physical.jerk_ratio_at(pos, FPS, []))


def test_feet_that_slide_at_joins_and_elsewhere():
    steady = body_pos_m(_standing(240)).copy()
    steady[:, :, 0] += 0.1 * np.arange(240)[:, None] / FPS  # 10 cm/s
    assert physical.foot_slide_ratio_at(steady, FPS, [1.0, 3.0]) == pytest.approx(1.0)
    slip = steady.copy()
    slip[:, :, 0] += np.interp(np.arange(240) / FPS, [1.75, 2.25], [0.0, 0.1])[:, None]  # 20 cm/s more
    assert physical.foot_slide_ratio_at(slip, FPS, [2.0]) == pytest.approx(3.0, rel=0.05)
    assert physical.foot_slide_ratio_at(slip, FPS, [3.0]) < 1
    scores = physical.evaluate(slip, FPS, [2.0])
    assert scores["foot_slide_ratio_at_joins"] == pytest.approx(3.0, rel=0.05)
    assert scores["jerk_ratio_at_joins"] > 5


def test_sliding_at_joins_of_nothing():
    pos = body_pos_m(_standing(240))
    assert np.isnan(physical.foot_slide_ratio_at(pos, FPS, []))
    assert np.isnan(physical.foot_slide_ratio_at(pos, FPS, [2.0]))  # no foot slides at all
    assert np.isnan(
        physical.foot_slide_ratio_at(pos + np.array([0.0, 1.0, 0.0]), FPS, [2.0])
    )  # no foot is low
    with pytest.raises(ParameterError, match="boundaries"):
        physical.foot_slide_ratio_at(pos, FPS, [np.nan])


@pytest.mark.parametrize("n_frames", [1, 2, 3])
def test_too_short_for_jerk(n_frames):
    scores = physical.evaluate(body_pos_m(_standing(n_frames)), 20.0, [0.1])
    assert scores["jerk_p95_m_s3"] == 0
    assert np.isnan(scores["jerk_ratio_at_boundaries"])


@pytest.mark.parametrize("broken", [np.zeros((0, 21, 3)), np.zeros((5, 20, 3)), np.full((5, 21, 3), np.nan)])
def test_broken_positions_are_refused(broken):
    with pytest.raises(ParameterError, match="body positions"):
        physical.evaluate(broken, FPS)


@pytest.mark.parametrize("fps", [0.0, -1.0, np.nan, np.inf])
def test_broken_rates_are_refused(fps):
    with pytest.raises(ParameterError, match="frame rate"):
        physical.evaluate(np.zeros((5, 21, 3)), fps)


@pytest.mark.parametrize("soles", [np.zeros((4, 2, 3)), np.zeros((5, 0, 3)), np.full((5, 2, 3), np.nan)])
def test_broken_soles_are_refused(soles):
    with pytest.raises(ParameterError, match="soles"):
        physical.floor_penetration_cm(np.zeros((5, 21, 3)), FPS, sole_pos_m=soles)


def test_a_leap_is_not_floating_and_dancing_on_a_box_is():
    pos = body_pos_m(_standing(600)).copy()
    pos[100:130, :, 1] += 0.3  # half a second
    assert physical.floating_share(pos, FPS) == 0
    pos[200:260, :, 1] += 0.3
    assert physical.floating_share(pos, FPS) == pytest.approx(60 / 600)
    assert physical.floating_share(pos + np.array([0.0, 0.5, 0.0]), FPS) == 1
    motion = _standing(60).moved(shift_m=np.array([0.0, 0.5, 0.0]))
    assert physical.floating_share(body_pos_m(motion), FPS, sole_pos_m=sole_pos_m(motion)) == 1


def test_speeding_up_at_transitions():
    times = np.arange(240) / FPS
    speed = np.where(np.abs(times - 2.0) < 0.3, 2.0, 1.0)
    pos = body_pos_m(_standing(240)) + (np.cumsum(speed) / FPS)[:, None, None] * [1.0, 0.0, 0.0]
    assert physical.speed_ratio_at(pos, FPS, [2.0]) == pytest.approx(2.0, rel=0.2)
    assert physical.speed_ratio_at(pos, FPS, [3.5]) == pytest.approx(1.0, rel=0.2)
    assert np.isnan(physical.speed_ratio_at(pos, FPS, []))
    assert np.isnan(physical.speed_ratio_at(body_pos_m(_standing()), FPS, [1.0]))


@given(spread_mm=st.floats(0.1, 30))
def test_the_spread_of_a_bone(spread_mm):
    pos = body_pos_m(_standing(40)).copy()
    elbow, wrist = BODY_JOINTS.index("left_elbow"), BODY_JOINTS.index("left_wrist")
    along = pos[0, wrist] - pos[0, elbow]
    sign = np.where(np.arange(40) % 2, 1.0, -1.0)[:, None]
    pos[:, wrist] += sign * along / np.linalg.norm(along) * spread_mm / 1000
    assert physical.limb_length_spread_mm(pos, FPS) == pytest.approx(spread_mm)


def test_golden():
    assert physical_scores() == pytest.approx(golden("physical"), abs=1e-6, nan_ok=True)


@pytest.mark.parametrize("fps", [30.0, 90.0])
def test_rate_heading_and_position_hardly_matter(fps):
    dance = synthetic_dance()
    c, s = np.cos(1.1), np.sin(1.1)
    other = body_pos_at(dance, 60.0, fps) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + np.array(
        [2.0, 0.0, 5.0]
    )
    wanted, got = physical.evaluate(dance, 60.0, [4.0, 8.0]), physical.evaluate(other, fps, [4.0, 8.0])
    for scores in (wanted, got):
        del scores["foot_skating_ratio_published"]  # which depends on the heading
    assert got == pytest.approx(wanted, rel=0.03, abs=0.03, nan_ok=True)


@pytest.mark.parametrize("boundaries", [[np.nan], [[1.0]], 1.0])
def test_broken_boundaries_are_refused(boundaries):
    with pytest.raises(ParameterError, match="boundaries"):
        physical.evaluate(body_pos_m(_standing()), FPS, boundaries)


@given(first=st.integers(5, 250), size_m=st.floats(0.06, 1.0))
def test_a_jump_of_any_joints_counts_once(first, size_m):
    pos = body_pos_m(_standing(300)).copy()
    pos[first, BALLS[0], 1] += size_m
    pos[first + 1 : first + 3, 0, 2] += size_m
    assert physical.jump_times_s(pos, FPS) == pytest.approx([(first - 1) / FPS], abs=1.01 / FPS)
    assert physical.jumps_per_minute(pos, FPS) == pytest.approx(12.0)


def test_jumps_apart_are_counted_and_smooth_motion_has_none():
    pos = body_pos_m(_standing(600)).copy()
    assert physical.jumps_per_minute(pos, FPS) == 0
    pos[:, :, 0] += np.sin(np.arange(600) / FPS * 2 * np.pi)[:, None]
    assert physical.jumps_per_minute(pos, FPS) == 0
    pos[[100, 200, 212], BALLS[0], 1] += 0.1
    assert len(physical.jump_times_s(pos, FPS)) == 3
    assert physical.jumps_per_minute(body_pos_at(pos, FPS, 50), 50) > 0
    pos[300:] += 0.2  # a jump that does not come back
    assert len(physical.jump_times_s(pos, FPS)) == 4


def test_too_short_to_jump():
    for n_frames in (1, 2):
        assert physical.jumps_per_minute(body_pos_m(_standing(n_frames)), FPS) == 0
    with pytest.raises(ParameterError, match="finite"):
        physical.jumps_per_minute(np.full((5, 21, 3), np.nan), FPS)
    with pytest.raises(ParameterError, match="frame rate"):
        physical.jump_times_s(np.zeros((5, 21, 3)), 0)


# PFC and the foot skating ratio: values computed by hand, invariances, and the published bugs one by one.


SCORE_FPS = 30.0
PELVIS = BODY_JOINTS.index("pelvis")
LEFT = [BODY_JOINTS.index("left_ankle"), BODY_JOINTS.index("left_foot")]
RIGHT = [BODY_JOINTS.index("right_ankle"), BODY_JOINTS.index("right_foot")]


def standing(n_frames: int = 90) -> np.ndarray:
    """Positions (T, 21, 3) with ankles 6 cm and toes 2 cm over the floor, the rest a metre up."""
    pos = np.zeros((n_frames, len(BODY_JOINTS), 3))
    pos[..., 1] = 1.0
    for ankle, toe in (LEFT, RIGHT):
        pos[:, ankle, 1], pos[:, toe, 1] = 0.06, 0.02
    return pos


def sliding(step_m: float, heading: float, n_frames: int = 90) -> np.ndarray:
    along = np.arange(n_frames)[:, None] * step_m * np.array([np.sin(heading), 0.0, np.cos(heading)])
    return standing(n_frames) + along[:, None]


def rotated(pos: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return pos @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])


def test_perfect():
    assert evaluate_contacts(standing(), SCORE_FPS) == {
        "foot_skating_ratio": 0.0,
        "foot_skating_ratio_published": 0.0,
        "pfc": 0.0,
        "pfc_pieces": 0.0,
    }


def test_pfc_by_hand():
    pos = standing(4)
    pos[2:, PELVIS, 0] = 0.1  # pushed in the first of two accelerations, stopped as hard in the second
    pos[:, LEFT, 0] = np.array([0.0, 0.0, 0.01, 0.04])[:, None]
    pos[:, RIGHT, 2] = np.array([0.0, 0.0, 0.02, 0.06])[:, None]
    assert pfc(pos, SCORE_FPS) == pytest.approx(1e4 * (0.01 * 0.02 + 0.03 * 0.04) / 2)
    pos[:, LEFT[0], 0] = 0.0  # the ankle stands: so does the foot
    assert pfc(pos, SCORE_FPS) == 0


def test_falling_costs_nothing_and_rising_does():
    pos = sliding(0.02, 0.3)
    times = np.arange(len(pos)) / SCORE_FPS
    pos[:, PELVIS, 1] -= times**2
    assert pfc(pos, SCORE_FPS) == pytest.approx(0, abs=1e-6)
    pos[:, PELVIS, 1] += 2 * times**2
    assert pfc(pos, SCORE_FPS) == pytest.approx(1e4 * 0.02**2)


def test_a_glitch_hides_slides_from_pfc_and_less_so_in_pieces():
    dance = np.concatenate([synthetic_dance()[::2]] * 3)[: 30 * 30]
    glitch = dance.copy()
    glitch[100, PELVIS] += 1.0
    assert pfc(glitch, SCORE_FPS) < 0.3 * pfc(dance, SCORE_FPS)
    assert pfc(glitch, SCORE_FPS, variant="pieces") > 0.7 * pfc(dance, SCORE_FPS, variant="pieces")


@settings(max_examples=30)
@given(step_m=st.floats(0.011, 0.1), heading=st.floats(-3.1, 3.1))
def test_all_frames_of_a_slide_count_whatever_its_heading(step_m, heading):
    assert foot_skating_ratio(sliding(step_m, heading), SCORE_FPS) == 1.0
    assert foot_skating_ratio(sliding(step_m * 0.009 / 0.1, heading), SCORE_FPS) == 0.0


def test_the_published_ratio_misses_slides_along_the_diagonal_and_the_last_frame():
    diagonal = sliding(0.05, np.pi * 3 / 4)  # x = -z
    assert foot_skating_ratio(diagonal, SCORE_FPS, variant="published") == 0
    assert foot_skating_ratio(diagonal, SCORE_FPS) == 1
    assert foot_skating_ratio(sliding(0.05, 0.0), SCORE_FPS, variant="published") == pytest.approx(89 / 90)


def test_the_published_ground_is_the_first_frame():
    pos = sliding(0.05, 0.0)
    pos[0, LEFT + RIGHT, 1] -= 0.3
    assert np.isnan(foot_skating_ratio(pos[:1], SCORE_FPS))  # one frame has no step
    published = foot_skating_ratio(pos, SCORE_FPS, variant="published")
    assert published == 1.0  # only the first frame is in contact, and slides
    assert foot_skating_ratio(pos, SCORE_FPS) == 1.0
    still = standing()
    still[0, LEFT + RIGHT, 1] += 0.3
    assert foot_skating_ratio(still, SCORE_FPS) == 0.0


def test_one_foot_of_two_and_never_in_contact():
    pos = standing()
    pos[:, LEFT, 0] += np.arange(90)[:, None] * 0.02
    assert foot_skating_ratio(pos, SCORE_FPS) == 0.5
    pos[:, LEFT, 1] += 0.2
    assert foot_skating_ratio(pos, SCORE_FPS) == 0.0  # the left foot is left out
    pos[:, LEFT[0], 1] += 0.2
    pos[:, RIGHT[0], 1] += 0.2
    assert np.isnan(foot_skating_ratio(pos, SCORE_FPS))


def test_position_and_heading_do_not_matter():
    dance = synthetic_dance()
    moved = rotated(dance, 0.7) + np.array([3.0, 0.0, -2.0])
    assert pfc(moved, 60.0) == pytest.approx(pfc(dance, 60.0))
    assert foot_skating_ratio(moved, 60.0) == foot_skating_ratio(dance, 60.0)
    heights = foot_skating_ratio(dance + np.array([0.0, 0.4, 0.0]), 60.0)
    assert heights == pytest.approx(foot_skating_ratio(dance, 60.0))


@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_the_rate_hardly_matters(fps):
    dance = synthetic_dance()
    other = body_pos_at(dance, 60.0, fps)
    assert pfc(other, fps) == pytest.approx(pfc(dance, 60.0), rel=0.02)
    assert foot_skating_ratio(other, fps) == pytest.approx(foot_skating_ratio(dance, 60.0), abs=0.02)


@pytest.mark.parametrize("n_frames", [1, 2])
def test_too_short_to_accelerate(n_frames):
    assert pfc(standing(n_frames), SCORE_FPS) == 0


@pytest.mark.parametrize("check", [validate, evaluate_contacts, pfc, foot_skating_ratio])
def test_empty_and_malformed(check):
    for broken in (
        np.zeros((0, 21, 3)), np.zeros((5, 20, 3)), np.zeros((5, 21)), np.full((5, 21, 3), np.nan),
        np.full((5, 21, 3), np.inf),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match="body positions") as raised:
            check(broken, SCORE_FPS)
        assert "\n" not in str(raised.value)
    for fps in (0.0, -30.0, np.nan, np.inf):
        with pytest.raises(ParameterError, match="frame rate"):
            check(standing(), fps)


@pytest.mark.parametrize("score", [pfc, foot_skating_ratio])
def test_unknown_variants_are_refused(score):
    with pytest.raises(ParameterError, match="variant"):
        score(standing(), SCORE_FPS, variant="fixed")
