"""PFC and the foot skating ratio: values computed by hand, invariances, and the published bugs one by one."""

from __future__ import annotations

import numpy as np
import pytest
from golden.regenerate import synthetic_dance
from hypothesis import given, settings
from hypothesis import strategies as st

from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics.contact_scores import evaluate, foot_skating_ratio, pfc, validate
from choreograph.motion.body import BODY_JOINTS, body_pos_at

FPS = 30.0
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
    assert evaluate(standing(), FPS) == {
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
    assert pfc(pos, FPS) == pytest.approx(1e4 * (0.01 * 0.02 + 0.03 * 0.04) / 2)
    pos[:, LEFT[0], 0] = 0.0  # the ankle stands: so does the foot
    assert pfc(pos, FPS) == 0


def test_falling_costs_nothing_and_rising_does():
    pos = sliding(0.02, 0.3)
    times = np.arange(len(pos)) / FPS
    pos[:, PELVIS, 1] -= times**2
    assert pfc(pos, FPS) == pytest.approx(0, abs=1e-6)
    pos[:, PELVIS, 1] += 2 * times**2
    assert pfc(pos, FPS) == pytest.approx(1e4 * 0.02**2)


def test_a_glitch_hides_slides_from_pfc_and_less_so_in_pieces():
    dance = np.concatenate([synthetic_dance()[::2]] * 3)[: 30 * 30]
    glitch = dance.copy()
    glitch[100, PELVIS] += 1.0
    assert pfc(glitch, FPS) < 0.3 * pfc(dance, FPS)
    assert pfc(glitch, FPS, variant="pieces") > 0.7 * pfc(dance, FPS, variant="pieces")


@settings(max_examples=30)
@given(step_m=st.floats(0.011, 0.1), heading=st.floats(-3.1, 3.1))
def test_all_frames_of_a_slide_count_whatever_its_heading(step_m, heading):
    assert foot_skating_ratio(sliding(step_m, heading), FPS) == 1.0
    assert foot_skating_ratio(sliding(step_m * 0.009 / 0.1, heading), FPS) == 0.0


def test_the_published_ratio_misses_slides_along_the_diagonal_and_the_last_frame():
    diagonal = sliding(0.05, np.pi * 3 / 4)  # x = -z
    assert foot_skating_ratio(diagonal, FPS, variant="published") == 0
    assert foot_skating_ratio(diagonal, FPS) == 1
    assert foot_skating_ratio(sliding(0.05, 0.0), FPS, variant="published") == pytest.approx(89 / 90)


def test_the_published_ground_is_the_first_frame():
    pos = sliding(0.05, 0.0)
    pos[0, LEFT + RIGHT, 1] -= 0.3
    assert np.isnan(foot_skating_ratio(pos[:1], FPS))  # one frame has no step
    published = foot_skating_ratio(pos, FPS, variant="published")
    assert published == 1.0  # only the first frame is in contact, and slides
    assert foot_skating_ratio(pos, FPS) == 1.0
    still = standing()
    still[0, LEFT + RIGHT, 1] += 0.3
    assert foot_skating_ratio(still, FPS) == 0.0


def test_one_foot_of_two_and_never_in_contact():
    pos = standing()
    pos[:, LEFT, 0] += np.arange(90)[:, None] * 0.02
    assert foot_skating_ratio(pos, FPS) == 0.5
    pos[:, LEFT, 1] += 0.2
    assert foot_skating_ratio(pos, FPS) == 0.0  # the left foot is left out
    pos[:, LEFT[0], 1] += 0.2
    pos[:, RIGHT[0], 1] += 0.2
    assert np.isnan(foot_skating_ratio(pos, FPS))


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
    assert pfc(standing(n_frames), FPS) == 0


@pytest.mark.parametrize("check", [validate, evaluate, pfc, foot_skating_ratio])
def test_empty_and_malformed(check):
    for broken in (
        np.zeros((0, 21, 3)), np.zeros((5, 20, 3)), np.zeros((5, 21)), np.full((5, 21, 3), np.nan),
        np.full((5, 21, 3), np.inf),
    ):  # fmt: skip
        with pytest.raises(ParameterError, match="body positions") as raised:
            check(broken, FPS)
        assert "\n" not in str(raised.value)
    for fps in (0.0, -30.0, np.nan, np.inf):
        with pytest.raises(ParameterError, match="frame rate"):
            check(standing(), fps)


@pytest.mark.parametrize("score", [pfc, foot_skating_ratio])
def test_unknown_variants_are_refused(score):
    with pytest.raises(ParameterError, match="variant"):
        score(standing(), FPS, variant="fixed")
