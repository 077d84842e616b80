"""The rollout network: its poses, its losses, what it learns, and that it goes on for long."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from choreograph.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.nets.kinematics import BodyKinematics, geodesic_rad
from choreograph.nets.rollout.config import rollout_config
from choreograph.nets.rollout.data import ROLLOUT_FPS, RolloutData, to_motion, to_poses, word_conditions
from choreograph.nets.rollout.model import N_FEET, ROOT_DIM, RolloutNet
from choreograph.nets.rollout.train import RolloutLosses, rolled, train_rollout
from choreograph.nets.training import TrainingContext
from tests.synthetic_rollouts import synthetic_takes, synthetic_words


def random_motion(seed: int, n_frames: int = 40) -> Motion:
    rng = np.random.default_rng(seed)
    steps = rng.normal(0, 0.05, (n_frames, 24, 3))
    quat = rot.from_rotvec(np.cumsum(steps, axis=0))
    root = np.cumsum(rng.normal(0, 0.02, (n_frames, 3)), axis=0) + np.array([0.0, 0.9, 0.0])
    return Motion(canonical_skeleton(), root, rot.make_continuous(quat), ROLLOUT_FPS)


@given(st.integers(0, 1000), st.floats(-3, 3), st.floats(-5, 5), st.floats(-5, 5))
def test_poses_do_not_know_where_the_dancer_stands_or_faces(seed, yaw, x, z):
    motion = random_motion(seed)
    moved = motion.moved(yaw_rad=yaw, shift_m=np.array([x, 0.0, z]))
    assert np.allclose(to_poses(motion), to_poses(moved), atol=1e-4)


@given(st.integers(0, 1000))
def test_poses_and_back_is_the_same_dance_from_the_origin(seed):
    motion = random_motion(seed)
    again = to_motion(to_poses(motion), motion.skeleton, heading_rad=float(rot.yaw(motion.local_quat[0, 0])))
    shift = motion.root_pos_m[0] * [1, 0, 1]
    assert np.allclose(body_pos_m(again), body_pos_m(motion) - shift, atol=2e-4)


def test_rotations_of_poses_mostly_have_no_negative_w():
    poses = to_poses(random_motion(3))
    w = poses[:, ROOT_DIM:-N_FEET].reshape(len(poses), -1, 4)[..., 0]
    assert (w.sum(axis=0) >= 0).all()


@given(st.integers(0, 1000))
def test_kinematics_agree_with_those_of_motions(seed):
    motion = random_motion(seed, 5)
    made = BodyKinematics(motion.skeleton).body_pos_m(
        torch.from_numpy(motion.root_pos_m).float(), torch.from_numpy(motion.local_quat).float()
    )
    assert np.allclose(made.numpy(), body_pos_m(motion), atol=1e-5)


@given(st.integers(0, 1000), st.floats(0.01, 3.0))
def test_geodesic_distance_is_the_angle_of_the_turn_between(seed, angle):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    a = rot.normalize(rng.normal(size=4))
    b = rot.multiply(a, rot.from_rotvec(angle * axis / np.linalg.norm(axis)))
    sign = rng.choice([-1.0, 1.0])
    got = geodesic_rad(torch.from_numpy(a), torch.from_numpy(sign * b))
    assert float(got) == pytest.approx(angle, abs=2e-3)


def test_geodesic_distance_has_a_gradient_where_rotations_agree():
    quat = torch.tensor([1.0, 0.0, 0.0, 0.0], requires_grad=True)
    geodesic_rad(quat, quat.detach()).backward()
    assert torch.isfinite(quat.grad).all()


def test_every_frame_is_asked_for_its_word():
    motif = np.arange(3)[:, None] * np.ones(184)
    rhythm = np.arange(60)[:, None] * np.ones(4)
    conditions = word_conditions(
        np.array([0.5, 1.0, 1.5]), np.array([1.0, 1.5, 2.0]), 70, rhythm, motif, None
    )
    assert conditions.motif[0, :, 0].tolist() == [0] * 30 + [1] * 15 + [2] * 25
    assert float(conditions.progress[0, 15]) == 0.0 and float(conditions.progress[0, 29]) == pytest.approx(
        14 / 15
    )
    assert conditions.progress.max() <= 1.0
    assert (
        conditions.rhythm[0, 0, 0] == 9 and conditions.rhythm[0, -1, 0] == 59
    )  # ahead, and the last one held


@pytest.fixture(scope="module")
def synthetic():
    takes = synthetic_takes()
    words = synthetic_words(takes)
    return takes, words


def test_the_right_poses_cost_next_to_nothing_and_others_more(synthetic):
    takes, words = synthetic
    config = rollout_config("tiny", perceptual_weight=0.0)
    net = RolloutNet(config)
    batch = RolloutData(takes, config.frames).sequences(
        4, np.random.default_rng(0), own_embedding_share=1.0, with_style=False
    )
    losses = RolloutLosses(takes[0].motion.skeleton, words, config)
    danced = batch.pose[:, 1:].clone()
    danced[..., -N_FEET:] = torch.logit(danced[..., -N_FEET:].clamp(0.01, 0.99))
    right = float(losses.total(net, danced, batch))
    wrong = float(losses.total(net, danced.flip(1), batch))
    assert right < 0.15 and wrong > 3 * right


def test_the_perceptual_loss_falls_where_words_are_what_was_asked_for(synthetic):
    takes, words = synthetic
    data = RolloutData(takes, 60)
    config = rollout_config("tiny")
    losses = RolloutLosses(takes[0].motion.skeleton, words, config)
    batch = data.sequences(8, np.random.default_rng(0), own_embedding_share=1.0, with_style=False)
    world_m = losses._world_m(RolloutNet(config), batch.pose[:, 1:])
    right = float(losses._perceptual_m(world_m, batch))
    shuffled = torch.roll(batch.word_motif, 1, dims=0)
    wrong = float((batch.word_motif - shuffled).norm(dim=-1).mean())
    assert right < 0.3 * wrong


def test_auto_conditioning_gives_the_network_what_was_danced_and_what_it_made(synthetic):
    takes, _ = synthetic
    config = rollout_config("tiny", frames=20, teacher_frames=3)
    net = RolloutNet(config)
    batch = RolloutData(takes, 20).sequences(
        2, np.random.default_rng(0), own_embedding_share=0.0, with_style=False
    )
    given, step = [], net.step
    net.step = lambda pose, *rest: (given.append(pose), step(pose, *rest))[1]
    made = rolled(net, batch, self_fed_frames=4)
    assert made.shape == (2, 19, batch.pose.shape[2])
    for frame, pose in enumerate(given):
        if frame % 7 < 3:
            assert torch.equal(pose, batch.pose[:, frame])
        else:
            assert torch.equal(pose[..., :-N_FEET], made[:, frame - 1, :-N_FEET])


def test_the_papers_style_leaves_the_borders_of_words_and_the_root_as_they_are():
    net = RolloutNet(rollout_config("tiny", style_fade_s=0.0))
    poses = torch.from_numpy(to_poses(random_motion(1, 45)))[None]
    conditions = word_conditions(
        np.array([0.0, 0.5, 1.0]), np.array([0.5, 1.0, 1.5]), 45, np.zeros((45, 4)), np.zeros((3, 184)),
        np.random.default_rng(0).normal(size=(3, 87)),
    )  # fmt: skip
    with torch.no_grad():
        styled = net.styled(poses, conditions)
    change = (styled - poses).abs()[0]
    assert change[[0, 15, 30]].max() < 1e-5
    assert change[7, ROOT_DIM:-N_FEET].max() > 1e-3
    assert change[:, :ROOT_DIM].max() == 0 and change[:, -N_FEET:].max() == 0


def test_styles_of_words_pass_into_each_other():
    net = RolloutNet(rollout_config("tiny", style_fade_s=0.5))
    poses = torch.from_numpy(to_poses(random_motion(1, 1)))[None].expand(1, 60, -1)  # one pose held
    colours = np.random.default_rng(0).normal(size=(2, 87))
    conditions = word_conditions(
        np.array([0.0, 1.0]), np.array([1.0, 2.0]), 60, np.zeros((60, 4)), np.zeros((2, 184)), colours
    )
    with torch.no_grad():
        quat = net.styled(poses, conditions)[0, :, ROOT_DIM:-N_FEET]
    steps = quat.diff(dim=0).norm(dim=-1)
    assert steps[:12].max() < 1e-5 and steps[-12:].max() < 1e-5  # within a word nothing moves on that account
    assert 0 < steps.max() < 0.15 * (quat[0] - quat[-1]).norm()  # from one to the other in no jump


@pytest.mark.parametrize("off", ["hears", "motifs"])
def test_what_is_switched_off_is_not_heard(off):
    net = RolloutNet(rollout_config("tiny", **{off: False}))
    starts, ends = np.array([0.0, 0.5]), np.array([0.5, 1.0])
    rng = np.random.default_rng(0)

    def into(motif, rhythm):
        conditions = word_conditions(starts, ends, 30, rhythm, motif, None)
        with torch.no_grad():
            return net.conditioned(conditions)[0]

    motif, rhythm = rng.normal(size=(2, 184)), rng.normal(size=(30, 4))
    same = (
        into(motif, rng.normal(size=(30, 4))) if off == "hears" else into(rng.normal(size=(2, 184)), rhythm)
    )
    assert torch.equal(into(motif, rhythm), same)


def test_training_learns_goes_on_from_a_checkpoint_and_is_the_same_twice(synthetic, tmp_path):
    takes, words = synthetic
    config = rollout_config("tiny", steps=12)
    seen = []
    context = TrainingContext(tmp_path, report=seen.append)
    net = train_rollout(takes, words, config, seed=1, context=context)
    assert seen[-1].loss < seen[0].loss
    again = train_rollout(takes, words, config, seed=1)
    for name, value in net.state_dict().items():
        assert torch.equal(value, again.state_dict()[name]), name
    arrays, stored = net.to_arrays()
    assert RolloutNet.from_arrays(arrays, stored).config == net.config


def test_takes_too_short_are_refused_in_one_line(synthetic):
    takes, words = synthetic
    with pytest.raises(ParameterError, match=r"motion words for over 333\.3 s"):
        train_rollout(takes, words, rollout_config("tiny", frames=10_000), seed=0)
