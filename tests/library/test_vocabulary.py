"""Motion words and motifs in a repertoire file: read back as written, inconsistencies reported."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic_repertoire import synthetic_contents, synthetic_takes, synthetic_vocabulary, with_vocabulary

from choreograph.core.errors import RepertoireError
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import MOTIFS
from choreograph.library.words import segment_words
from choreograph.library.writing import write_repertoire
from choreograph.motion.body import body_pos_m
from choreograph.nets.words import WordNet

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
