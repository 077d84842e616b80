"""Figures: what a line says, where a figure ends, its mirror image, and takes danced of figures."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from body_capsules import depths_m

from choreograph.core.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.contacts import sole_pos_m
from content.moves.figures import Figure, Manner
from content.moves.genres import GENRES
from content.moves.notation import SIDES
from content.moves.sequencer import RenderedTake, render, render_take, sequence_moves
from content.moves.stylings import styled
from content.songs.danced_styles import DANCED
from content.starter_takes import WAYS

every_genre = pytest.mark.parametrize("genre", GENRES.values(), ids=lambda genre: genre.name)
SQUARE = Figure("square", 4, "1 L 0 40 @90, 2 R 0 40 @90, 3 L 0 40 @90, 4 R 0 40 @90")


def test_a_line_is_read() -> None:
    step = Figure("one", 1, "1 R -14 46 @-45 b").relative[0]
    assert (step.count, step.foot, step.out_m, step.fwd_m, step.turn_deg, step.kind) == (
        1.0, "right", -0.14, 0.46, -45.0, "b",
    )  # fmt: skip
    assert Figure("kick", 1, "1 L 2 40 k22").relative[0].height_m == 0.22


@pytest.mark.parametrize("line", ["1 X 0 40", "L 0 40", "1 L 0", "1 L 0 40 z", "1 L 0 40, "])
def test_a_line_that_cannot_be_read_is_an_error(line: str) -> None:
    with pytest.raises(ParameterError, match="expected a step such as"):
        Figure("wrong", 4, line)


def test_steps_add_up() -> None:
    walk = Figure("walk", 2, "1 L 0 40, 2 R 0 40").move(Manner())
    assert walk.travel == pytest.approx((0.0, 0.8, 0.0))
    assert SQUARE.move(Manner()).travel[2] == pytest.approx(360.0)
    assert walk.free_foot == "left" and walk.first_foot == "left"


def test_weight_comes_back_to_where_a_foot_stands() -> None:
    rock = Figure("rock", 2, "1 L 0 -30, 2 R 0 0 p").move(Manner())
    assert rock.travel == pytest.approx((0.0, 0.0, 0.0)) and rock.free_foot == "left"


def test_a_turned_figure_ends_turned() -> None:
    straight, turned = (SQUARE.move(Manner(), steer_deg=deg).travel[2] for deg in (0.0, 40.0))
    assert turned - straight == pytest.approx(40.0)


def test_the_mirror_image_keeps_a_frame() -> None:
    manner = Manner(arms=(("frame_up", "frame_round"),), swaps_arms=False)
    one, other = (SQUARE.move(manner, mirrored=m) for m in (False, True))
    assert one.poses[1].arms == other.poses[1].arms
    assert other.travel == pytest.approx((-one.travel[0], one.travel[1], -one.travel[2]))


def test_a_figure_is_danced_differently_each_time() -> None:
    rng = np.random.default_rng(0)
    a, b = (SQUARE.move(Manner(), rng) for _ in range(2))
    apart = [np.hypot(*np.subtract(s.at, t.at)) for s, t in zip(a.steps, b.steps, strict=True)]
    assert max(apart) > 0.03


def test_a_count_without_a_step_settles_over_the_standing_foot() -> None:
    walk = Figure("slow walk", 4, "1 L 0 40, 3 R 0 40")
    settling = walk.move(Manner(settles={"twist": 8.0, "drop": 0.01}))
    plain = walk.move(Manner())
    more = {
        c: {n: settling.poses[c].values[n] - plain.poses[c].values[n] for n in ("twist", "drop")}
        for c in range(1, 5)
    }
    assert more[1] == more[3] == {"twist": 0.0, "drop": 0.0}
    assert more[2] == pytest.approx({"twist": 8.0, "drop": 0.01})
    assert more[4] == pytest.approx({"twist": -8.0, "drop": 0.01})  # on the right foot
    assert settling.poses[2].flow == 0.0 < settling.poses[1].flow


def pelvis_m(steps: str, counts: int) -> tuple[np.ndarray, np.ndarray]:
    """The pelvis (T, 3) in a figure danced as written, and the frames of its counts."""
    counts_s = 1.0 + np.arange(counts + 1) * 0.6
    move = Figure("figure", counts, steps).move(Manner())
    rendered = render(sequence_moves([move]), counts_s, rng=None)
    return rendered.motion.root_pos_m, np.round(counts_s * rendered.motion.fps).astype(int)


def test_a_body_arrives_over_a_slow_step_on_the_count_after_it() -> None:
    pos_m, frames = pelvis_m("1 L 0 40, 3 R 0 40, 4 L 0 0 t", 4)
    speed = np.linalg.norm(np.diff(pos_m[:, [0, 2]], axis=0), axis=1) * 60.0
    assert speed[frames[1]] < 0.1 < 0.2 < speed[(frames[0] + frames[1]) // 2]


def test_a_body_does_not_get_over_a_held_step_that_it_comes_back_from() -> None:
    (stays, frames), (back, _) = (pelvis_m(f"1 L 0 40, 3 {s}, 4 L 0 0 t", 4) for s in ("R 0 40", "R 0 0 p"))
    assert back[frames[1], 2] < 0.7 * stays[frames[1], 2]


@every_genre
def test_a_genre_has_many_figures_with_their_own_names(genre) -> None:
    names = [written.name for written in (*genre.moves, *genre.figures)]
    assert len(names) >= 23 and len(names) == len(set(names))
    assert genre.name in DANCED


@cache
def danced(name: str, seed: int) -> RenderedTake:
    low, high = DANCED[name].bpm
    beats_s = 0.6 + np.arange(40) * 60.0 / (low + (high - low) * (seed % 3) / 2)
    genre = styled(GENRES[name], WAYS[seed % len(WAYS)])
    return render_take(genre, beats_s, energy=[0.3, 0.6, 0.9][seed % 3], seed=seed)


@pytest.mark.slow
@every_genre
def test_a_take_keeps_its_feet_on_the_floor_and_its_arms_out_of_the_body(genre) -> None:
    for seed in range(2):
        rendered = danced(genre.name, seed)
        motion = rendered.motion
        pos = motion.joint_pos_m()
        for side in SIDES:
            path = rendered.feet[side]
            ankle = pos[:, motion.skeleton.index(f"{side}_ankle")]
            assert (np.linalg.norm(ankle - path.ankle_m(), axis=-1) > 0.01).mean() < 0.03
            speed = np.linalg.norm(np.diff(pos[:, motion.skeleton.index(f"{side}_foot")], axis=0), axis=1)
            slid_m_s = speed[path.planted[1:] & path.planted[:-1]] * motion.fps
            assert np.percentile(slid_m_s, 99) < 0.02
        assert sole_pos_m(motion)[..., 1].min() > -0.005
        for pair, depth in depths_m(motion).items():
            assert (depth > 0.02).mean() < (0.01 if "torso" in pair else 0.08), pair


@pytest.mark.slow
@every_genre
def test_joints_of_a_take_turn_no_faster_than_real_ones(genre) -> None:
    motion = danced(genre.name, 1).motion
    turn = rot.multiply(rot.invert(motion.local_quat[:-1]), motion.local_quat[1:])
    speed = np.linalg.norm(rot.to_rotvec(turn), axis=-1).max(axis=1) * motion.fps
    assert np.percentile(speed, 99) < 22.0
