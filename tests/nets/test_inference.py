"""Inference in NumPy: it agrees with the torch modules whose weights it reads, and refuses other weights."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from choreograph.core.errors import ParameterError
from choreograph.music.rhythm import RHYTHM_DIM
from choreograph.nets.configs import rollout_config, style_config, word_config
from choreograph.nets.inference import MEL_FRAMES, SongStyle, WordEmbedder
from choreograph.nets.music_counts import MusicCounts, levelled
from choreograph.nets.rollout import RolloutNet
from choreograph.nets.rollout_poses import PosePredictor, RolloutConditions
from choreograph.nets.style import StyleNets
from choreograph.nets.words import WordNet
from content.count_networks import MotionCountsNet, MusicCountsNet, motion_counts_config, music_counts_config

RNG = np.random.default_rng(0)


def trained(net):
    """The network with random statistics of a training, which its initial ones would not test."""
    generator = torch.Generator().manual_seed(0)
    for buffer in net.buffers():
        if buffer.is_floating_point():
            buffer.copy_(0.5 + torch.rand(buffer.shape, generator=generator))
    for parameter in net.parameters():  # some layers start at zero
        parameter.data += 0.05 * torch.randn(parameter.shape, generator=generator)
    return net.eval()


def assert_equal_to_rounding(found, expected):
    assert found.dtype == np.float32 and found.shape == expected.shape
    np.testing.assert_allclose(found, expected, atol=2e-5 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("preset", "n_frames"),
    [(preset, n_frames) for preset in ("small", "tiny") for n_frames in (1, 2, 59, 61, 1500)]
    + [("tiny", 17_001)],  # in three blocks
)
def test_the_curves_of_a_song_are_those_of_torch(preset, n_frames):
    module = trained(MusicCountsNet(music_counts_config(preset)))
    mel = RNG.normal(-6, 2, (n_frames, 96)).astype(np.float32)
    curves = MusicCounts.from_arrays(*module.to_arrays()).curves(mel)
    even = np.pad(levelled(mel), ((0, n_frames % 2), (0, 0)), mode="edge")
    with torch.no_grad():
        logits, vectors = module(torch.from_numpy(even)[None])
    assert_equal_to_rounding(np.stack([curves.beat, curves.downbeat]), torch.sigmoid(logits[0]).numpy())
    found = np.concatenate([curves.phases.beat.T, *curves.phases.bar.transpose(1, 2, 0)])
    assert_equal_to_rounding(found.astype(np.float32), vectors[0].numpy())


@pytest.mark.parametrize("preset", ["small", "tiny"])
@pytest.mark.parametrize("n_frames", [1, 2, 40, 700])
def test_the_curves_of_a_take_are_those_of_torch(preset, n_frames):
    module = trained(MotionCountsNet(motion_counts_config(preset)))
    body = RNG.normal(size=(n_frames, 21, 3)).astype(np.float32)
    curves = module.for_inference().curves(body, (1.0,))
    with torch.no_grad():
        (vectors,) = module(torch.from_numpy(body)[None], torch.ones(1, n_frames)).numpy()
    found = np.concatenate([curves.beat.T, *curves.bar.transpose(1, 2, 0)])
    assert_equal_to_rounding(found.astype(np.float32), vectors)


@pytest.mark.parametrize("normalised", [True, False])
@pytest.mark.parametrize("music_inputs", ["mel", "counts", "mel+counts"])
def test_the_style_of_a_song_and_its_expected_beats_are_those_of_torch(music_inputs, normalised):
    config = style_config("small", music_inputs=music_inputs, normalised=normalised)
    module = trained(StyleNets(config))
    mel = RNG.normal(-6, 2, (600, 96)).astype(np.float32)
    rhythm = RNG.normal(size=(20, RHYTHM_DIM)).astype(np.float32)
    starts_s = np.arange(4)
    net = SongStyle.from_arrays(*module.to_arrays())
    style = net.embed_music(mel, rhythm, starts_s)
    segments = mel[starts_s[:, None] * 60 + np.arange(MEL_FRAMES)]
    with torch.no_grad():
        expected = module.style_of_music(
            torch.from_numpy(segments), torch.from_numpy(rhythm[2 * starts_s + 4])
        )
        counts = module.beat_count(expected)
    assert_equal_to_rounding(style, expected.numpy())
    assert_equal_to_rounding(net.predict_beat_count(expected.numpy()), counts.numpy())


@pytest.mark.parametrize("preset", ["small", "tiny"])
@pytest.mark.parametrize("n_words", [0, 1, 130])
def test_embeddings_of_words_are_those_of_torch(preset, n_words):
    module = trained(WordNet(word_config(preset)))
    words = RNG.normal(size=(n_words, 13, 21, 3)).astype(np.float32)
    with torch.no_grad():
        expected = module(torch.from_numpy(words)).numpy()
    if n_words:
        assert_equal_to_rounding(WordEmbedder.from_arrays(*module.to_arrays()).embed(words), expected)
    else:
        assert WordEmbedder.from_arrays(*module.to_arrays()).embed(words).shape == (0, 184)


PAPER = {"condition_width": 0, "count_phase": False, "style_fade_s": 0.0, "n_layers": 3}


@pytest.mark.parametrize("with_style", [True, False])
@pytest.mark.parametrize("changes", [{}, PAPER, {"motifs": False}, {"phase": False}, {"use_audio": False}])
@pytest.mark.parametrize("preset", ["small", "tiny"])
def test_poses_of_a_rollout_are_those_of_torch(preset, changes, with_style):
    module = trained(RolloutNet(rollout_config(preset, **changes)))
    n_frames, widths = 40, (184, 4, None, None, 4, 87)
    rows = [RNG.normal(size=(n_frames, *(() if n is None else (n,)))).astype(np.float32) for n in widths]
    rows[2], rows[3] = rows[2] % 1, 0.5 + rows[3] % 1  # phases, and durations of words
    spectral = rows.pop()
    net = PosePredictor.from_arrays(*module.to_arrays())
    conditions = RolloutConditions(*rows, spectral if with_style else None)
    tensors = RolloutConditions(*(torch.from_numpy(r)[None] for r in rows), torch.from_numpy(spectral)[None])
    first = RNG.normal(size=102).astype(np.float32)
    state = net.initial_state()
    found = []
    with torch.no_grad():
        embedded = module.embed_conditions(tensors)
        for ours, torchs in zip(net.embed_conditions(conditions), embedded, strict=True):
            if ours.size or torchs.numel():
                assert_equal_to_rounding(ours, torchs[0].numpy())
        torch_pose, torch_state, expected = torch.from_numpy(first)[None], module.initial_state(1), []
        for frame, inputs in enumerate(zip(*net.embed_conditions(conditions), strict=True)):
            # Both continue the same pose, or errors of rounding would grow from pose to pose.
            pose, state = net.step(torch_pose[0].numpy(), *inputs, state)
            found.append(pose)
            logits, torch_state = module.step(torch_pose, *(v[:, frame] for v in embedded), torch_state)
            torch_pose = module.as_input(logits)
            expected.append(logits)
        styled = torch.stack(expected, dim=1)
        if with_style:
            styled = module.apply_style(styled, tensors)
    assert_equal_to_rounding(net.apply_style(np.stack(found), conditions), module.as_input(styled)[0].numpy())


@pytest.mark.parametrize(
    ("net", "module"),
    [
        (MusicCounts, MusicCountsNet(music_counts_config("tiny"))),
        (SongStyle, StyleNets(style_config("tiny", music_inputs="mel+counts"))),
        (WordEmbedder, WordNet(word_config("tiny"))),
        (PosePredictor, RolloutNet(rollout_config("tiny"))),
    ],
)
def test_weights_of_another_shape_are_refused(net, module):
    arrays, config = module.to_arrays()
    used = net.shapes(module.config)
    assert used.items() <= {name: array.shape for name, array in arrays.items()}.items()
    stored, same = net.from_arrays(arrays, config).to_arrays()
    assert same == config and set(stored) == set(used)
    for name in used:
        for damaged in ({**arrays, name: np.zeros((3, 5))}, {k: v for k, v in arrays.items() if k != name}):
            with pytest.raises(ParameterError, match=f"weights of the {net.__name__}"):
                net.from_arrays(damaged, config)


def test_torch_imported_within_a_dance_has_one_thread_until_its_end():
    from choreograph.core.numerics import one_thread, torch_imported

    before = torch.get_num_threads()
    try:
        torch.set_num_threads(2)
        with one_thread():
            torch.set_num_threads(3)  # as if torch were imported here
            with one_thread():
                torch_imported()
                assert torch.get_num_threads() == 1
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 2
        torch_imported()
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
