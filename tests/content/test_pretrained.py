"""The shipped networks: their files, and the parts of the recipe that decide what is held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_counts import counted

from choreograph.core.counts import FROM_MOTION, NO_COUNTS, Figure
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.library.building.counting import SURE_MOTION_CONFIDENCE
from choreograph.library.builtin import (
    MAX_MOTION_UNCERTAINTY,
    MOTION_NET,
    PRETRAINED,
    load_motion_counter,
    pretrained_path,
    pretrained_set,
)
from choreograph.library.schema import NetArrays
from choreograph.library.store import read_networks
from choreograph.library.writing import write_networks
from content.motion_counting import CountedMotion
from content.moves.genres import GENRES
from content.networks import (
    N_FOLDS,
    RecordedTake,
    built_in_takes,
    share_right,
    shuffled,
    song_folds,
    trials_by_figure,
    trials_by_genre,
    trials_by_song,
    without_figures,
)


def recorded(name: str, genre: str, *figures: str, song: str | None = None) -> RecordedTake:
    counts = counted(0.5, length_s=4.0 * len(figures))
    spans = tuple(Figure(f, 4.0 * i, 4.0 * (i + 1), 8) for i, f in enumerate(figures))
    motion = CountedMotion(name, genre, np.zeros((80 * len(figures), 21, 3), np.float32), counts)
    return RecordedTake(motion, name if song is None else song, spans)


EARLIER = ("house", "hip-hop", "disco", "cha-cha", "salsa", "waltz", "swing", "contemporary")  # of `research`

TAKES = [recorded(f"t{i}", "rumba", f"R-{i}", "R-x", f"R-{i + 1}") for i in range(7)] + [
    recorded("w0", "waltz", "W-1", "W-2"),
    recorded("recording", "rumba", "R-0", "R-9", song=""),
]


def test_networks_are_stored_in_half_precision(tmp_path):
    weights = {"a": np.linspace(0, 1, 5000, dtype=np.float32), "b": np.zeros((2, 3), np.float32)}
    write_networks(tmp_path / "n.h5", {"net": NetArrays({"width": 3}, weights)}, {"trained_on": ["x"]})
    nets, provenance = read_networks(tmp_path / "n.h5")
    assert provenance == {"trained_on": ["x"]} and nets["net"].config == {"width": 3}
    np.testing.assert_allclose(nets["net"].weights["a"], weights["a"], atol=1e-3)
    assert nets["net"].weights["b"].dtype == np.float32


def test_other_files_are_refused(tmp_path):
    (tmp_path / "text.h5").write_text("no")
    for name in ("text.h5", "none.h5"):
        with pytest.raises(RepertoireError, match="expected networks"):
            read_networks(tmp_path / name)


def test_unknown_sets_are_refused():
    with pytest.raises(ParameterError, match="clean, research, nothing"):
        pretrained_set("other")


def test_nothing_is_a_set():
    assert pretrained_set("nothing") == {}


def test_a_take_keeps_only_the_counts_of_other_figures():
    kept = without_figures(recorded("a", "rumba", "R-1", "R-2", "R-3"), {"R-2"}).counts
    assert kept.times_s.tolist() == [*np.arange(0, 4.1, 0.5), *np.arange(8, 12.1, 0.5)]


def test_songs_are_spread_over_folds():
    folds = song_folds(TAKES)
    assert "recording" not in folds
    assert sorted(folds[f"t{i}"] for i in range(N_FOLDS)) == list(range(N_FOLDS))
    for trial in trials_by_song(TAKES, []):
        names = {take.name for take in trial.train}
        assert "recording" in names and not names & {take.name for take in trial.test}


def test_figures_left_out_are_counted_nowhere():
    figures = {take.motion.name: {f.name for f in take.figures} for take in TAKES}
    spans = {take.motion.name: take.figures for take in TAKES}
    tested = set()
    for trial in trials_by_figure(TAKES, []):
        gone = set().union(*(figures[take.name] for take in trial.test))
        tested |= {take.name for take in trial.test}
        for take in trial.train:
            for figure in spans[take.name]:
                inner = (take.counts.times_s > figure.start_s) & (take.counts.times_s < figure.end_s)
                assert inner.any() == (figure.name not in gone)
    assert len(tested) == 6  # one rumba a fold, and the waltz


def test_genres_left_out_are_not_trained_on():
    takes = [CountedMotion(g, g, np.zeros((1, 21, 3), np.float32), counted(0.5)) for g in "abc"]
    trials = list(trials_by_genre(takes))
    assert [[t.name for t in trial.test] for trial in trials] == [["a", "b"], ["c"]]
    assert [[t.name for t in trial.train] for trial in trials] == [["c"], ["a", "b"]]


def test_a_shuffled_take_is_made_of_its_frames_in_another_order():
    motion = recorded("a", "rumba", "R-1", "R-2").motion
    frames = np.arange(160, dtype=np.float32)[:, None, None] * np.array([0.0, 1.0, 0.0], np.float32)
    motion = replace(motion, body_pos_m=np.repeat(frames, 21, axis=1))
    made = shuffled(motion)
    heights = made.body_pos_m[:, 0, 1]
    assert made.body_pos_m.shape == motion.body_pos_m.shape and set(heights) <= set(range(160))
    assert 3 < (np.diff(heights) != 1).sum() < 16
    assert made.counts is motion.counts and motion.body_pos_m[5, 0, 1] == 5


def test_counts_at_another_level_are_not_right():
    true = counted(0.5)
    assert share_right(counted(0.5, first_s=0.05), true) == 1.0
    assert share_right(counted(0.5, first_s=0.2), true) == 0.0
    assert share_right(counted(1.0), true) == share_right(counted(0.25), true) == 0.0
    assert share_right(NO_COUNTS, true) == 0.0


def test_by_default_each_network_is_of_the_better_set():
    chosen = pretrained_set("default")
    assert {name: net.set_name for name, net in chosen.items()} == {"style": "clean", MOTION_NET: "research"}
    assert "states no licence" in chosen[MOTION_NET].description
    assert not any(song.startswith("DANCE_") for song in chosen["style"].trained_on)


@pytest.mark.parametrize("name", PRETRAINED)
def test_a_shipped_set_is_small_and_says_what_it_heard(name):
    shipped = pretrained_set(name)
    assert pretrained_path(name).stat().st_size < 1.5e6
    assert {MOTION_NET, "style"} == set(shipped)
    for net in shipped.values():
        assert any(song.startswith("DANCE_") for song in net.trained_on) == (name == "research")
        genres = GENRES if name == "clean" else EARLIER
        assert {f"{g.replace(' ', '-').lower()}-01" for g in genres} <= set(net.trained_on)
    card = pretrained_path(name).with_name("NETWORKS.md").read_text(encoding="utf-8")
    assert f"`{name}`" in card and "no licence" in card


@pytest.mark.slow
@pytest.mark.parametrize("name", PRETRAINED)
def test_a_shipped_network_counts_what_it_knows_and_knows_what_it_does_not(name):
    read = load_motion_counter(pretrained_set(name))
    unseen = built_in_takes(2, first_seed=70_000, genres=["waltz", "disco"])
    counts = [read(take.body_pos_m) for take in unseen]
    assert np.mean([share_right(c, t.counts) for c, t in zip(counts, unseen, strict=True)]) > 0.9
    assert all(c.source == FROM_MOTION and c.confidence >= SURE_MOTION_CONFIDENCE for c in counts)
    standing = [read(np.repeat(take.body_pos_m[:1], 400, axis=0)) for take in unseen]
    assert np.mean([c.confidence for c in standing]) < SURE_MOTION_CONFIDENCE
    assert all(c.uncertainty.mean() > MAX_MOTION_UNCERTAINTY for c in standing)


@pytest.mark.slow
def test_built_in_takes_are_those_of_their_seeds():
    (first,), (again,) = (built_in_takes(1, genres=["waltz"]) for _ in range(2))
    np.testing.assert_array_equal(first.body_pos_m, again.body_pos_m)
    assert first.counts.metre == 3 and first.is_built_in and len(first.counts) > 30
    (other,) = built_in_takes(1, first_seed=60_000, genres=["waltz"])
    assert other.counts.times_s[-1] != first.counts.times_s[-1]
