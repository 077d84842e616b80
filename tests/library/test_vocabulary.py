"""Motion words and motifs in a repertoire file: read back as written, inconsistencies reported."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_motions import stepping, swaying
from synthetic_repertoire import synthetic_contents, synthetic_takes, synthetic_vocabulary, with_vocabulary

from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.core.numerics import chi_square_distance
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import MOTIFS
from choreograph.library.vocabulary import (
    DEFAULT_WORD_S,
    MAX_WORD_S,
    MIN_WORD_S,
    SpanMotifLookup,
    checked_signature,
    dance_bounds_s,
    find_motifs,
    n_motifs_for,
    poses_at,
    segment_words,
    signature,
    template,
    transition_matrix,
    word_bounds_s,
)
from choreograph.library.writing import write_repertoire
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, ground_pos_m, heading_rad
from choreograph.nets.words import WordNet

# Motion words: where a dance is segmented, and what a word preserves and discards.


FPS = 30.0
BODY = body_pos_m(swaying(300, fps=FPS, seed=1))  # 10 s
BEATS = np.arange(0.25, 10, 0.5)


def test_words_are_the_dance_between_beats():
    words = segment_words(BODY, FPS, BEATS)
    np.testing.assert_allclose(words.start_s, BEATS[:-1])
    np.testing.assert_allclose(words.end_s, BEATS[1:])
    assert words.body_pos_m.shape == (19, 13, 21, 3)
    # Distances between joints do not depend on the frame of reference; frame 6 is the middle of a word.
    middle = BODY[15]  # 0.5 s
    wanted = np.linalg.norm(middle[:, None] - middle[None], axis=-1)
    got = words.body_pos_m[0, 6]
    np.testing.assert_allclose(np.linalg.norm(got[:, None] - got[None], axis=-1), wanted, atol=1e-9)


def test_a_word_is_in_its_root_frame_and_keeps_its_travel():
    words = segment_words(BODY, FPS, BEATS).body_pos_m
    np.testing.assert_allclose(heading_rad(words[:, 6]), 0.0, atol=1e-9)
    np.testing.assert_allclose(ground_pos_m(words).mean(axis=1), 0.0, atol=1e-9)
    travel = np.linalg.norm(words[:, -1, 0] - words[:, 0, 0], axis=-1)
    first, last = BODY[7] * 0.5 + BODY[8] * 0.5, BODY[22] * 0.5 + BODY[23] * 0.5  # 0.25 and 0.75 s
    assert travel[0] == pytest.approx(np.linalg.norm(last[0] - first[0]), abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(-3, 3), st.floats(-4, 4), st.floats(-4, 4))
def test_words_do_not_depend_on_the_position_on_the_floor(yaw, x, z):
    moved = rot.rotate(rot.about_y(yaw), BODY) + np.array([x, 0.0, z])
    np.testing.assert_allclose(
        segment_words(moved, FPS, BEATS).body_pos_m, segment_words(BODY, FPS, BEATS).body_pos_m, atol=1e-9
    )


def test_a_word_danced_twice_as_fast_is_the_same_word():
    slow = segment_words(body_pos_m(stepping(301, fps=60, period_s=1.0, seed=2)), 60, np.arange(5.0))
    fast = segment_words(body_pos_m(stepping(301, fps=60, period_s=0.5, seed=2)), 60, np.arange(5.0) / 2)
    apart_m = np.linalg.norm(slow.body_pos_m - fast.body_pos_m, axis=-1).mean(axis=(-2, -1))
    assert apart_m.max() < 0.002
    there, back = slow.body_pos_m[:2]
    assert np.linalg.norm(there - back, axis=-1).mean() > 0.02


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-2, 14), max_size=40))
def test_words_tile_the_time_between_the_beats(beats):
    words = segment_words(BODY, FPS, np.array(beats))
    assert np.isfinite(words.body_pos_m).all()
    np.testing.assert_array_equal(words.start_s[1:], words.end_s[:-1])
    lengths = words.end_s - words.start_s
    assert np.all(lengths >= MIN_WORD_S - 1e-9) and np.all(lengths <= MAX_WORD_S + 1e-9)
    assert np.all(words.start_s >= 0) and np.all(words.end_s <= 299 / FPS)


def test_beats_too_close_are_dropped_and_gaps_are_divided():
    np.testing.assert_allclose(word_bounds_s(np.array([1.0, 1.1, 1.5]), 9.0), [1.0, 1.5])
    np.testing.assert_allclose(word_bounds_s(np.array([4.0, 1.0]), 9.0), [1.0, 2.5, 4.0])
    for beats in ([], [2.0], [-1.0, 3.0, 20.0]):
        assert len(segment_words(BODY, FPS, np.array(beats))) == 0


@pytest.mark.parametrize(
    ("body", "fps", "beats"),
    [
        (BODY[:, :5], FPS, BEATS),
        (np.full_like(BODY, np.nan), FPS, BEATS),
        (BODY, 0.0, BEATS),
        (BODY, FPS, np.array([0.0, np.nan])),
        (BODY, FPS, BEATS[:, None]),
    ],
)
def test_malformed_input_of_words_is_refused(body, fps, beats):
    with pytest.raises(ParameterError):
        segment_words(body, fps, beats)


def test_one_frame_has_no_word():
    assert len(segment_words(BODY[:1], FPS, BEATS)) == 0


@settings(max_examples=100)
@given(st.lists(st.floats(0, 40), max_size=60), st.floats(0.01, 45), st.sampled_from([0.35, 0.5, 0.71, None]))
def test_words_cover_the_whole_dance_and_include_those_between_beats(beats, duration_s, period_s):
    beats = np.array(beats) if period_s is None else np.arange(1.3, 40, period_s)
    bounds = dance_bounds_s(beats, duration_s)
    assert len(bounds) >= 2 and (np.diff(bounds) > 0).all()
    assert bounds[0] >= -1e-9 and bounds[-1] <= duration_s + 1e-9
    inner = word_bounds_s(beats, duration_s)
    if len(inner) > 1:
        assert set(inner.tolist()) <= set(bounds.tolist())
        assert np.diff(bounds).min() >= MIN_WORD_S - 1e-9 and np.diff(bounds).max() <= 2 * MAX_WORD_S
        gaps = np.diff(inner)
        assert bounds[0] <= np.median(gaps[:8]) / 2 + MIN_WORD_S
        assert duration_s - bounds[-1] <= np.median(gaps[-8:]) / 2 + MIN_WORD_S


def test_words_before_the_first_beat_are_as_long_as_beats():
    bounds = dance_bounds_s(np.arange(1.6, 8.1, 0.5), 9.2)
    np.testing.assert_allclose(np.diff(bounds[:4]), 1.6 / 3)
    np.testing.assert_allclose(bounds[-4:], [7.6, 8.1 + 1 / 30, 8.2 + 14 / 30, 9.2])
    assert (
        dance_bounds_s(np.arange(0.1, 9, 0.5), 9.2)[0] == 0.1
    )  # a tenth of a second is too short for a word
    np.testing.assert_allclose(dance_bounds_s(np.zeros(0), 2.0), np.arange(0, 2.1, DEFAULT_WORD_S))
    np.testing.assert_allclose(dance_bounds_s(np.zeros(0), 0.1), [0.0, 0.1])


def test_poses_between_frames_and_beyond_the_ends():
    np.testing.assert_allclose(poses_at(BODY, FPS, np.array([1.05])), (BODY[31:32] + BODY[32:33]) / 2)
    np.testing.assert_array_equal(poses_at(BODY, FPS, np.array([[-1.0, 99.0]])), BODY[None, [0, -1]])


# Motifs: synthetic clusters are found, medoids are words, and everything is deterministic.


def _blobs(rng, n_blobs=5, n_each=20, dim=8):
    middles = 10.0 * rng.normal(size=(n_blobs, dim))
    labels = rng.permutation(np.repeat(np.arange(n_blobs), n_each))
    return middles[labels] + 0.1 * rng.normal(size=(len(labels), dim)), labels


def test_synthetic_clusters_are_found():
    vectors, truth = _blobs(np.random.default_rng(1))
    motifs, labels = find_motifs(vectors, n_motifs=5, seed=0)
    assert len(motifs) == 5
    for cluster in range(5):
        assert len(np.unique(truth[labels == cluster])) == 1
    np.testing.assert_array_equal(motifs.counts, 20)


def test_a_dance_of_two_moves_has_two_motifs():
    # There and back, each half a second: a word from every rest to the next.
    body = body_pos_m(stepping(601, fps=60, period_s=0.5, seed=4))
    words = segment_words(body, 60, np.arange(0.0, 10.1, 0.5)).body_pos_m
    motifs, labels = find_motifs(words.reshape(len(words), -1), n_motifs=2)
    np.testing.assert_array_equal(labels, [labels[0], 1 - labels[0]] * 10)
    np.testing.assert_array_equal(motifs.counts, 10)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12))
def test_medoids_are_words_of_their_own_cluster_and_counts_fall(seed, n_motifs):
    vectors = np.random.default_rng(seed).normal(size=(40, 3))
    motifs, labels = find_motifs(vectors, n_motifs=n_motifs, seed=seed)
    np.testing.assert_array_equal(motifs.embeddings, vectors[motifs.words].astype(np.float32))
    np.testing.assert_array_equal(labels[motifs.words], np.arange(len(motifs)))
    np.testing.assert_array_equal(motifs.nearest(vectors), labels)
    np.testing.assert_array_equal(np.bincount(labels), motifs.counts)
    assert np.all(np.diff(motifs.counts) <= 0) and motifs.counts.min() >= 1


def test_the_same_seed_gives_the_same_motifs():
    vectors = np.random.default_rng(3).normal(size=(400, 16))
    first, labels = find_motifs(vectors, seed=7)
    again, labels_again = find_motifs(vectors, seed=7)
    np.testing.assert_array_equal(first.words, again.words)
    np.testing.assert_array_equal(labels, labels_again)


def test_identical_words_are_one_motif():
    motifs, labels = find_motifs(np.ones((30, 4)), n_motifs=5)
    assert len(motifs) == 1
    np.testing.assert_array_equal(labels, 0)


def test_the_number_of_motifs_follows_the_rule():
    assert [n_motifs_for(n) for n in (1, 19, 20, 40, 2000, 10_000, 100_000)] == [1, 1, 1, 2, 100, 500, 500]
    vectors = np.random.default_rng(0).normal(size=(100, 4))
    assert len(find_motifs(vectors)[0]) == 5


@pytest.mark.parametrize(
    ("vectors", "n_motifs"),
    [
        (np.zeros((0, 4)), None),
        (np.zeros(4), None),
        (np.full((4, 4), np.nan), None),
        (np.eye(4), 0),
        (np.eye(4), 5),
    ],
)
def test_malformed_input_of_clustering_is_refused(vectors, n_motifs):
    with pytest.raises(ParameterError):
        find_motifs(vectors, n_motifs=n_motifs)


def test_embeddings_of_another_dimension_are_refused():
    motifs, _ = find_motifs(np.eye(4))
    with pytest.raises(ParameterError, match="4"):
        motifs.nearest(np.eye(5))
    assert motifs.nearest(np.zeros((0, 4))).shape == (0,)


def test_words_that_differ_by_rounding_alone_are_one_motif():
    """Else rounding, which differs between CPUs, would decide which of two motifs a word shows."""
    rng = np.random.default_rng(3)
    distinct = rng.normal(size=(4, 8)).astype(np.float32)
    words = np.repeat(distinct, 30, axis=0) + rng.normal(scale=1e-7, size=(120, 8)).astype(np.float32)
    motifs, of_word = find_motifs(words, n_motifs=9)
    assert len(motifs) == 4
    assert all(len(np.unique(of_word[start : start + 30])) == 1 for start in range(0, 120, 30))


# Signatures, templates, equation 11 and transitions: laws, and values computed by hand.


K = 6
dances = st.lists(st.integers(0, K - 1), min_size=1, max_size=30).map(np.array)
libraries = st.lists(dances, min_size=1, max_size=5)


@given(dances, dances)
def test_chi_square_is_a_distance_between_0_and_1(a, b):
    a, b = signature(a, K), signature(b, K)
    assert chi_square_distance(a, b) == pytest.approx(chi_square_distance(b, a))
    assert chi_square_distance(a, a) == 0.0
    assert 0.0 <= chi_square_distance(a, b) <= 1.0 + 1e-12
    assert (chi_square_distance(a, b) < 1e-12) == np.allclose(a, b)


def test_chi_square_by_hand_and_over_leading_axes():
    a, b = np.array([0.5, 0.5, 0.0]), np.array([0.25, 0.25, 0.5])
    # ½ (0.0625 / 0.75 · 2 + 0.25 / 0.5) = ½ (1/6 + 1/2)
    assert chi_square_distance(a, b) == pytest.approx(1 / 3)
    assert chi_square_distance(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])) == 1.0
    np.testing.assert_allclose(chi_square_distance(np.stack([a, b]), b), [1 / 3, 0.0])


@given(libraries)
def test_signatures_and_templates_sum_to_1(library):
    for dance in library:
        assert signature(dance, K).sum() == pytest.approx(1.0)
    mean = template(library, K)
    assert mean.sum() == pytest.approx(1.0)
    checked_signature(mean, K)


@given(libraries)
def test_rows_of_transitions_sum_to_1_and_only_observed_ones_have_a_probability(library):
    steps = transition_matrix(library, K)
    np.testing.assert_allclose(steps.sum(axis=1), 1.0)
    pairs = {(int(a), int(b)) for dance in library for a, b in pairwise(dance)}
    for a in {a for a, _ in pairs} - {int(dance[-1]) for dance in library}:
        assert set(np.flatnonzero(steps[a])) == {b for c, b in pairs if c == a}


def test_a_template_weights_all_dances_equally():
    np.testing.assert_allclose(
        template([np.zeros(100, int), np.array([1, 1]), np.zeros(0, int)], 3), [0.5, 0.5, 0]
    )


def test_transitions_by_hand_and_none_across_dances():
    steps = transition_matrix([np.array([0, 1, 0, 2]), np.array([1, 1])], 3)
    np.testing.assert_allclose(steps[0], [0, 0.5, 0.5])
    anything = np.array([2, 3, 1]) / 6
    np.testing.assert_allclose(steps[1], (np.array([1, 1, 0]) + anything) / 3)  # a dance ended there
    np.testing.assert_allclose(steps[2], anything)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: signature(np.zeros(0, int), 3),
        lambda: signature(np.array([3]), 3),
        lambda: signature(np.array([-1]), 3),
        lambda: signature(np.array([0.5]), 3),
        lambda: signature(np.zeros((2, 2), int), 3),
        lambda: template([], 3),
        lambda: template([np.zeros(0, int)], 3),
        lambda: transition_matrix([], 3),
        lambda: transition_matrix([np.array([9])], 3),
        lambda: checked_signature(np.array([0.5, 0.4]), 2),
        lambda: checked_signature(np.array([1.5, -0.5]), 2),
        lambda: checked_signature(np.array([np.nan, 1.0]), 2),
        lambda: checked_signature(np.array([1.0]), 2),
    ],
)
def test_malformed_input_of_signatures_is_refused(wrong):
    with pytest.raises(ParameterError):
        wrong()


# Motifs of spans: those of the words segmented there, embedded once.


def body_of(seed: int, n_frames: int = 600) -> np.ndarray:
    """A body (T, 21, 3) whose joints sway slowly and independently."""
    rng = np.random.default_rng(seed)
    times = np.arange(n_frames) / 20
    phase, rate = rng.uniform(0, 6, (1, 21, 3)), rng.uniform(0.5, 2.0, (1, 21, 3))
    base = np.random.default_rng(99).normal(size=(1, 21, 3))
    return base + 0.3 * np.sin(rate * times[:, None, None] + phase)


def embed(words: np.ndarray) -> np.ndarray:
    return words.reshape(len(words), -1).astype(np.float32)


@pytest.fixture
def labelled_takes():
    takes = [body_of(0), body_of(1)]
    words = [segment_words(take, 20.0, np.arange(0, 29, 0.5)).body_pos_m for take in takes]
    motifs, labels = find_motifs(embed(np.concatenate(words)), n_motifs=12)
    return takes, motifs, labels


def poses_of(takes):
    """Poses of takes (N,) at times (N, T)."""
    return lambda take, times_s: np.stack(
        [poses_at(takes[one], 20.0, times) for one, times in zip(take.tolist(), times_s, strict=True)]
    )


def test_spans_have_the_motifs_of_the_words_segmented_there(labelled_takes):
    takes, motifs, labels = labelled_takes
    spans = SpanMotifLookup(poses_of(takes), embed, motifs)
    start_s = np.tile(np.arange(0, 28.5, 0.5), 2)
    take = np.repeat([0, 1], 57)
    found = spans.motifs_of(take, start_s, start_s + 0.5)
    assert np.mean(found == labels[: len(found)]) > 0.9
    shifted = spans.motifs_of(take, start_s + 0.25, start_s + 0.75)
    assert np.mean(shifted == labels[: len(found)]) < 0.9


def test_a_span_is_embedded_only_once(labelled_takes):
    takes, motifs, _ = labelled_takes
    embedded = []

    def counting(words):
        embedded.append(len(words))
        return embed(words)

    spans = SpanMotifLookup(poses_of(takes), counting, motifs)
    take = np.array([0, 1, 0, 1])
    first = spans.motifs_of(take, np.array([3.0, 3.0, 3.0, 9.0]), np.array([3.5, 3.5, 3.5, 9.7]))
    assert len(embedded) == 1  # a batch of a fixed size
    again = spans.motifs_of(take[::-1], np.array([9.0, 3.0, 3.0, 3.0]), np.array([9.7, 3.5, 3.5, 3.5]))
    assert len(embedded) == 1
    assert np.array_equal(first, again[::-1])
    both = spans.motifs_of(take[:2], np.array([5.0, 3.0]), np.array([5.5, 3.5]))
    assert len(embedded) == 2
    assert both[1] == first[1]


def test_any_shape_and_spans_beyond_the_ends(labelled_takes):
    takes, motifs, _ = labelled_takes
    spans = SpanMotifLookup(poses_of(takes), embed, motifs)
    start_s = np.array([[-3.0, 29.9], [40.0, 12.0]])
    found = spans.motifs_of(np.array([[0, 1], [1, 0]]), start_s, start_s + 0.6)
    assert found.shape == (2, 2)
    assert (found >= 0).all() and (found < len(motifs)).all()
    assert spans.motifs_of(np.zeros(0, int), np.zeros(0), np.zeros(0)).shape == (0,)


# Motion words and motifs in a repertoire file: read back as written, inconsistencies reported.


COLUMNS = (
    "word_take", "word_start_s", "word_end_s", "word_motif", "signatures", "transitions",
)  # fmt: skip


@pytest.fixture(scope="module")
def takes():
    return synthetic_takes()


@pytest.fixture(scope="module")
def contents(takes):
    return with_vocabulary(synthetic_contents(takes), takes)


@pytest.fixture(scope="module")
def path(contents, tmp_path_factory):
    path = tmp_path_factory.mktemp("vocabulary") / "rep.h5"
    write_repertoire(path, contents)
    return path


def test_a_vocabulary_is_read_back(path, takes):
    expected, _ = synthetic_vocabulary(takes)
    found = Repertoire.open(path).vocabulary
    assert found.genres == expected.genres == ("a", "b", "c", "all")
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(found, column), getattr(expected, column))
    for column in ("embeddings", "words", "counts"):
        np.testing.assert_array_equal(getattr(found.motifs, column), getattr(expected.motifs, column))


def test_the_word_network_reproduces_the_embeddings(path, takes):
    repertoire = Repertoire.open(path)
    vocabulary, net = repertoire.vocabulary, repertoire.word_net()
    cut = [segment_words(body_pos_m(m.take.motion), m.take.motion.fps, m.motion_beats_s) for m in takes]
    embedded = net.embed(np.concatenate([c.body_pos_m for c in cut]))
    np.testing.assert_allclose(embedded[vocabulary.motifs.words], vocabulary.motifs.embeddings, atol=1e-6)
    np.testing.assert_array_equal(vocabulary.motifs.nearest(embedded), vocabulary.word_motif)


def test_the_word_network_is_read_once(path, monkeypatch):
    repertoire, read = Repertoire.open(path), []
    net = Repertoire.net
    monkeypatch.setattr(Repertoire, "net", lambda self, name: read.append(name) or net(self, name))
    assert repertoire.word_net() is repertoire.word_net()
    assert read == ["words"]


def test_a_compressed_file_keeps_every_words_motif(contents, path, takes, tmp_path):
    write_repertoire(tmp_path / "compressed.h5", contents, compress=True)
    compressed, whole = Repertoire.open(tmp_path / "compressed.h5"), Repertoire.open(path)
    cut = segment_words(body_pos_m(takes[1].take.motion), takes[1].take.motion.fps, takes[1].motion_beats_s)
    labels = [r.vocabulary.motifs.nearest(r.word_net().embed(cut.body_pos_m)) for r in (whole, compressed)]
    assert np.mean(labels[0] == labels[1]) > 0.95
    assert compressed.vocabulary.motifs.embeddings.dtype == np.float32
    np.testing.assert_array_equal(compressed.vocabulary.word_motif, whole.vocabulary.word_motif)


def test_a_file_without_words_opens(takes, tmp_path):
    write_repertoire(tmp_path / "none.h5", synthetic_contents(takes))
    repertoire = Repertoire.open(tmp_path / "none.h5")
    assert not repertoire.has_vocabulary
    assert repertoire.n_clips > 0
    for access in (lambda: repertoire.vocabulary, repertoire.word_net):
        with pytest.raises(RepertoireError, match="build-db") as error:
            access()
        assert "\n" not in str(error.value)


def test_an_incomplete_vocabulary_is_not_written(contents, tmp_path):
    incomplete = {name: array for name, array in contents.arrays.items() if name != "motifs/words"}
    with pytest.raises(RepertoireError, match="motifs/words"):
        write_repertoire(tmp_path / "rep.h5", type(contents)(incomplete, "analytic", {}, contents.nets))


def changed(name: str, array: np.ndarray):
    array = array.copy()
    if name == "motifs/words":
        array[0] = 10**6
    elif name == "motifs/embeddings":
        array[1, 1] = np.nan
    elif name in ("motifs/word_start_s", "motifs/word_end_s"):
        array[3] += 0.1
    elif name == "motifs/genres":
        return np.frombuffer(b"a\0b\0c\0d\0", np.uint8)
    else:
        array[-1] += 1
    return array


@pytest.mark.parametrize("name", MOTIFS)
def test_an_inconsistent_array_is_damage(path, tmp_path, name):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "a") as file:
        array = changed(name, file[name][()])
        del file[name]
        file[name] = array
    with pytest.raises(RepertoireError, match="damaged file") as error:
        _ = Repertoire.open(copy).vocabulary.transitions[-1]
    assert "\n" not in str(error.value) and str(copy) in str(error.value)


@pytest.mark.parametrize("damage", ["no array", "another shape", "no network", "another network", "config"])
def test_missing_parts_are_damage(path, tmp_path, damage):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "a") as file:
        if damage == "no array":
            del file["motifs/counts"]
        elif damage == "another shape":
            del file["motifs/transitions"]
            file["motifs/transitions"] = np.ones((2, 2, 2))
        elif damage == "no network":
            del file["nets/words"]
        elif damage == "another network":
            del file["nets/words/linear.bias"]
            file["nets/words/linear.bias"] = np.zeros(7, np.float32)
        else:
            config = json.loads(file["nets/words"].attrs["config"])
            file["nets/words"].attrs["config"] = json.dumps({**config, "depth": 3})
    with pytest.raises(RepertoireError, match=str(copy)) as error:
        Repertoire.open(copy).word_net()
    assert "\n" not in str(error.value)


def test_opening_a_file_does_not_load_the_network(path, monkeypatch):
    def loaded(*args):
        raise AssertionError("the network was loaded")

    monkeypatch.setattr(WordNet, "from_arrays", loaded)
    assert Repertoire.open(Path(path)).vocabulary.n_motifs > 1
