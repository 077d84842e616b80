"""Laws of working in blocks: they cover every frame once, and change no bit of a result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from synthetic_motions import swaying

from choreograph.core.numerics import BLOCK_FRAMES, frame_blocks
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.library.schema import zigzag_encode
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_indices, body_pos_m
from choreograph.motion.motion_beats import SMOOTHING_S, mean_joint_speed_m_s
from choreograph.music.mel import ONSET_RANGE, band_means, loudness, onset_envelopes, scaled, sums_before
from choreograph.music.song_features import energy_per_second
from choreograph.view.page import ROTVEC_STEP_RAD, compress_motion, deflate_base64

SEVERAL = 2 * BLOCK_FRAMES + 17  # frames: three blocks


@pytest.mark.parametrize("n_frames", [0, 1, 7, 8, 9, 16])
def test_blocks_cover_every_frame_once(n_frames):
    frames = [frame for block in frame_blocks(n_frames, 8) for frame in range(block.start, block.stop)]
    assert frames == list(range(n_frames))


@pytest.mark.parametrize("size", [1, 5, 64, 1000])
def test_sums_are_those_of_all_rows_to_the_bit(size):
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(200, 3)) * 10.0 ** rng.integers(-8, 8, (200, 1))
    frames = np.r_[0, 200, rng.integers(0, 201, 50)].reshape(-1, 2)
    whole = np.vstack([np.zeros((1, 3)), np.cumsum(rows, axis=0)])
    found = sums_before((rows[block] for block in frame_blocks(len(rows), size)), frames)
    assert np.array_equal(found, whole[frames])


def test_features_of_a_song_of_several_blocks_are_those_of_the_whole():
    rng = np.random.default_rng(1)
    mel = rng.normal(-8.0, 4.0, (SEVERAL, 96)).astype(np.float32)
    level = np.maximum(mel, mel.max() - ONSET_RANGE)
    rise = np.zeros_like(level)
    rise[2:] = np.maximum(0.0, level[2:] - level[:-2])
    assert np.array_equal(onset_envelopes(mel), band_means(rise))

    samples = rng.normal(0.0, 0.1, 735 * (BLOCK_FRAMES + 17) + 100).astype(np.float32)
    peak = float(np.abs(samples).max())
    energy = np.add.reduceat(np.square(samples / peak, dtype=np.float64), np.arange(0, len(samples), 735))
    level = peak * np.sqrt(energy.sum() / len(samples))
    assert np.array_equal(scaled(samples, loudness(samples)), (samples / level).astype(np.float32))


def test_energy_of_a_last_second_that_is_not_full():
    samples = np.tile(np.float32([0.5, -0.5]), SAMPLE_RATE_HZ * 2 + 50)  # 4 s and 100 samples
    assert energy_per_second(samples, 5).min() > 0.97


@pytest.mark.parametrize("n_frames", [2, 3, BLOCK_FRAMES, BLOCK_FRAMES + 1, BLOCK_FRAMES + 7, SEVERAL])
@pytest.mark.parametrize("fps", [20, 60])
def test_speeds_of_several_blocks_are_those_of_the_whole(n_frames, fps):
    pos_m = np.cumsum(np.random.default_rng(n_frames).normal(size=(n_frames, 5, 3)), axis=0)
    smooth = gaussian_filter1d(pos_m, SMOOTHING_S * fps, axis=0, mode="nearest")
    whole = np.linalg.norm(np.gradient(smooth, axis=0) * fps, axis=2).mean(axis=1)
    assert np.array_equal(mean_joint_speed_m_s(pos_m, fps), whole)


@pytest.mark.parametrize("n_frames", [1, 2, BLOCK_FRAMES + 1, SEVERAL])
def test_pages_of_several_blocks_are_those_of_the_whole(n_frames):
    motion = swaying(n_frames, fps=60.0)
    root_m = motion.root_pos_m + 5e-3 * np.random.default_rng(3).normal(size=(n_frames, 3))
    compressed = compress_motion(replace(motion, root_pos_m=root_m))
    turns = rot.to_rotvec(motion.local_quat).reshape(n_frames, -1) / ROTVEC_STEP_RAD
    root = (root_m - compressed.root_origin_m) / compressed.root_step_m
    steps = np.round(np.concatenate([root, turns], axis=1).T).astype(np.int64)
    change = np.diff(steps, n=2, axis=1, prepend=np.zeros((len(steps), 2), np.int64))
    folded = zigzag_encode(change.astype(np.int16))
    planes = np.concatenate([(folded & 0xFF).ravel(), (folded >> 8).ravel()]).astype(np.uint8)
    assert compressed.text == deflate_base64(planes.tobytes())


def test_motions_of_several_blocks_are_those_of_the_whole():
    motion = swaying(SEVERAL, fps=60.0)
    flipped = motion.local_quat * np.random.default_rng(2).choice([-1.0, 1.0], (SEVERAL, 1, 1))
    sign = np.sign(np.sum(flipped[0, 0] * motion.local_quat[0, 0]))
    assert np.array_equal(rot.make_continuous(flipped), sign * rot.make_continuous(motion.local_quat))
    joints = body_indices(motion.skeleton)
    assert np.array_equal(body_pos_m(motion), motion.joint_pos_m()[:, joints])

    frames = np.arange(0.2, SEVERAL, 0.93)
    low = np.minimum(frames.astype(np.int64), SEVERAL - 1)
    high, weight = np.minimum(low + 1, SEVERAL - 1), np.where(frames < SEVERAL - 1, frames - low, 0.0)
    whole = rot.slerp(flipped[low], flipped[high], weight[:, None])
    sampled = replace(motion, local_quat=flipped).sampled(frames)
    assert np.array_equal(sampled.local_quat, rot.make_continuous(whole))

    frames = np.array([0.0, 10.3, SEVERAL / 2 + 0.7, SEVERAL - 1.0])
    spline = CubicSpline(np.arange(SEVERAL), rot.make_continuous(flipped))
    sampled = replace(motion, local_quat=flipped).sampled_smooth(frames)
    np.testing.assert_allclose(sampled.local_quat, rot.normalize(spline(frames)), atol=1e-12)
