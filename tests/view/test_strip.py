"""Pictures of poses, and plots of motifs."""

from __future__ import annotations

import builtins

import numpy as np
import pytest
from PIL import Image
from synthetic_motions import swaying
from synthetic_repertoire import synthetic_contents, synthetic_repertoire, synthetic_takes, with_vocabulary

from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import write_repertoire
from choreograph.view import strip
from choreograph.view.strip import (
    MOTIFS_SHOWN,
    dances_of,
    distance_figure,
    draw_strip,
    signature_figure,
    transitions_figure,
    words_to_show,
    write_motif_plots,
    write_strip,
)

MOTION = swaying(60)
TILE = (48, 64)


def test_poses_are_in_rows_with_labels(tmp_path):
    times = np.linspace(0, 1.0, 5)
    write_strip(tmp_path / "strip.png", MOTION, times, columns=2, tile=TILE)
    with Image.open(tmp_path / "strip.png") as image:
        sheet = np.asarray(image)
    bar = round(0.085 * 48)
    assert sheet.shape == (3 * (64 + bar + 2) - 2, 2 * 50 - 2, 3)
    assert (sheet[-30:, 60:] == 255).all()  # the sixth place is empty
    assert list(tmp_path.iterdir()) == [tmp_path / "strip.png"]


def test_same_time_gives_the_same_tile():
    sheet = draw_strip(MOTION, [0.2, 0.2, 0.9], tile=TILE, labels=["", "", ""])
    tiles = [sheet[:64, x : x + 48] for x in (0, 50, 100)]
    assert np.array_equal(tiles[0], tiles[1]) and not np.array_equal(tiles[0], tiles[2])


def test_a_turned_back_is_seen_as_a_back():
    turned = MOTION.moved(yaw_rad=np.pi)
    face, back, other_side = (
        draw_strip(motion, [0.5], tile=(120, 160), labels=[""], front_rad=front_rad)[:160].astype(int)
        for motion, front_rad in ((MOTION, 0.0), (turned, 0.0), (turned, np.pi))
    )
    # The left arm and leg are warm, the right ones cool. Facing the camera, left is to the right.
    assert warm_to_the_right(face) and not warm_to_the_right(back)
    assert np.abs(face - other_side).mean() < 5 < np.abs(face - back).mean()


def warm_to_the_right(tile: np.ndarray) -> bool:
    warmth, columns = tile[..., 0] - tile[..., 2], np.arange(tile.shape[1])
    warm, cool = ((side > 40).sum(axis=0) for side in (warmth, -warmth))
    return bool((warm @ columns) / warm.sum() > (cool @ columns) / cool.sum())


def test_labels_are_written():
    named, other = (draw_strip(MOTION, [0.0], labels=[text], tile=(200, 60)) for text in ("beat 1", "beat 8"))
    assert np.array_equal(named[:60], other[:60])  # the pose
    assert not np.array_equal(named[60:], other[60:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"times_s": []}, "poses"),
        ({"labels": ["a"]}, "label for each of 2"),
        ({"columns": 0}, "columns"),
        ({"tile": (0, 20)}, "pixels"),
        ({"tile": (20000, 20000)}, "too large"),
        ({"times_s": [0.0, 99.0]}, "within the motion"),
    ],
)
def test_wrong_input_is_a_one_line_error(changes, message):
    arguments = {"times_s": [0.0, 0.5], "tile": TILE} | changes
    with pytest.raises(ParameterError, match=message) as caught:
        draw_strip(MOTION, arguments.pop("times_s"), **arguments)
    assert "\n" not in str(caught.value)


def test_missing_folder(tmp_path):
    with pytest.raises(ParameterError, match="no folder"):
        write_strip(tmp_path / "none" / "strip.png", MOTION, [0.0], tile=TILE)


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    takes = synthetic_takes(periods_s=(0.5, 0.6, 0.55, 0.75), genres=("a/b", "c", "a/b", ""))
    return synthetic_repertoire(tmp_path_factory.mktemp("plots") / "rep.h5", takes, vocabulary=True)


@pytest.fixture(scope="module")
def dances(repertoire):
    genres = [take.credits.genre for take in repertoire.takes]
    return {genre: dances_of(repertoire.vocabulary, genres, genre) for genre in ("a/b", "c")}


def test_every_plot_is_a_picture_with_something_on_it(repertoire, tmp_path, monkeypatch):
    monkeypatch.setattr(strip, "STRIPS", 2)
    written = write_motif_plots(tmp_path / "new" / "plots", repertoire)
    assert [path.name for path in written] == [
        "signature-a_b.png", "transitions-a_b.png", "signature-c.png", "transitions-c.png",
        "distance-over-time.png", "motif-000.png", "motif-001.png",
    ]  # fmt: skip
    assert sorted(path.name for path in written) == sorted(p.name for p in (tmp_path / "new/plots").iterdir())
    for path in written:
        pixels = np.asarray(Image.open(path).convert("L"))
        assert max(pixels.shape) < 1600
        assert pixels.std() > 10


def test_a_genre_without_takes_has_no_plots(tmp_path, monkeypatch):
    monkeypatch.setattr(strip, "STRIPS", 0)
    named, others = (synthetic_takes(duration_s=10.0, genres=genres) for genres in (("a", "b"), ("b", "b")))
    write_repertoire(tmp_path / "rep.h5", with_vocabulary(synthetic_contents(others), named))
    written = write_motif_plots(tmp_path / "plots", Repertoire.open(tmp_path / "rep.h5"))
    assert [path.name for path in written] == [
        "signature-b.png", "transitions-b.png", "distance-over-time.png",
    ]  # fmt: skip


def test_bars_show_the_most_frequent_motifs_of_the_template(repertoire, dances):
    vocabulary = repertoire.vocabulary
    figure = signature_figure(vocabulary, "a/b", dances["a/b"], [take.name for take in repertoire.takes])
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    template = vocabulary.signatures[vocabulary.genre_index("a/b")]
    np.testing.assert_allclose(heights, 100 * np.sort(template)[::-1][:MOTIFS_SHOWN])
    labels = [int(text.get_text()) for text in figure.axes[-1].get_xticklabels()]
    np.testing.assert_array_equal(template[labels], np.sort(template)[::-1][:MOTIFS_SHOWN])
    assert [axis.get_title(loc="left").split(":")[0] for axis in figure.axes] == ["a/b", "take0", "take2"]


def test_heat_map_shows_the_transitions(repertoire):
    vocabulary = repertoire.vocabulary
    axis = transitions_figure(vocabulary, "c").axes[0]
    labels = [int(text.get_text()) for text in axis.get_xticklabels()]
    shown = vocabulary.transitions[vocabulary.genre_index("c")][np.ix_(labels, labels)]
    np.testing.assert_array_equal(axis.images[0].get_array(), shown)


def test_curves_end_at_the_distance_of_the_take(repertoire, dances):
    figure = distance_figure(repertoire.vocabulary, dances)
    assert [axis.get_title(loc="left") for axis in figure.axes] == ["a/b: 2 takes", "c: 1 take"]
    only, mean = figure.axes[1].lines
    assert only.get_ydata()[-1] == pytest.approx(0.0, abs=1e-12)  # the template is this take's signature
    assert mean.get_ydata()[-1] == pytest.approx(0.0, abs=1e-12)
    assert only.get_ydata()[0] > 0.3
    assert only.get_xdata()[-1] == pytest.approx(30.0, abs=2.0)


def test_words_shown_of_a_motif_are_its_medoid_and_words_of_other_takes(repertoire):
    vocabulary = repertoire.vocabulary
    for motif in range(vocabulary.n_motifs):
        words = words_to_show(vocabulary, motif)
        assert words[0] == vocabulary.motifs.words[motif]
        takes = vocabulary.word_take[words]
        assert len(set(takes)) == len(takes)
        assert set(vocabulary.word_motif[words]) == {motif}
        everywhere = set(vocabulary.word_take[vocabulary.words_of_motif(motif)])
        assert len(takes) == min(4, len(everywhere))
        np.testing.assert_array_equal(words, words_to_show(vocabulary, motif))


def test_errors_of_plots(repertoire, tmp_path, monkeypatch):
    with pytest.raises(RepertoireError, match="build-db"):
        write_motif_plots(tmp_path / "x", synthetic_repertoire(tmp_path / "old.h5"))
    (tmp_path / "file").write_text("")
    with pytest.raises(ParameterError, match="file"):
        write_motif_plots(tmp_path / "file", repertoire)
    true_import = builtins.__import__

    def without_matplotlib(name, *args, **kwargs):
        if name.partition(".")[0] == "matplotlib":
            raise ImportError(name)
        return true_import(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_matplotlib)
    with pytest.raises(ParameterError, match="extra 'plots'"):
        write_motif_plots(tmp_path / "x", repertoire)
    assert not (tmp_path / "x").exists()
