"""ChoreoNet's layout: recordings with figures, lists that count other takes, damaged lists."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from synthetic_markers import markers_on, write_c3d
from synthetic_motions import swaying

from choreograph.core.counts import ANNOTATED, DATA_SET, Figure, make_counts
from choreograph.core.errors import FormatError
from choreograph.formats.choreonet import figure_counts, read_choreographies
from choreograph.formats.manifest import write_counts
from choreograph.formats.register import annotate_takes, import_takes, save_motion
from choreograph.library.building.options import BuildOptions
from choreograph.library.building.takes import measured_takes
from choreograph.motion.motion import Credits, Take

MOTION = swaying(800, fps=80.0)  # 10 s
HEADER = "c3d_file,movement_tag,fake_start_frame,fake_end_frame,start_frame,end_frame,beats\n"
DANCE = {
    "name": "DANCE_C_1", "dance_type": "C", "dance_id": 1, "start_pos": 25, "end_pos": 225,
    "movements": ["START", "C-1-1", "HOLD", "C-2-1"], "durations": [1, 4, 1, 6],
}  # fmt: skip


def row(name: str, start: float, end: float, beats: int | str, *, recording: str = "7") -> str:
    return f"{recording},{name},{start / 2},{end / 2},{start},{end},{beats}\n"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return write_c3d(tmp_path_factory.mktemp("c3d") / "7.c3d", markers_on(MOTION))


@pytest.fixture
def folder(tmp_path, recording):
    """A folder of one recording; figures.csv and choreographies.json are for the test to write."""
    (tmp_path / "choreonet" / "c3d").mkdir(parents=True)
    (tmp_path / "choreonet" / "c3d" / "7.c3d").symlink_to(recording)
    return tmp_path / "choreonet"


def read_one(folder, *rows: str) -> Take:
    (folder / "figures.csv").write_text(HEADER + "".join(rows))
    (take,) = import_takes(folder)
    return take


def test_figures_are_counted_through_and_anew_after_a_gap(folder):
    take = read_one(
        folder,
        row("C-2-1", 321.2, 481.2, 4),  # rows in any order, a frame between them
        row("C-1-1", 80, 320, 6),
        row("C-3-1", 560, 720, 4),  # after a gap of two counts
    )
    assert (take.name, take.credits.genre, take.credits.licence) == ("choreonet-7", "cha-cha", "none stated")
    assert (take.counts.source, take.counts.metre, take.counts.confidence) == (DATA_SET, 4, 1.0)
    np.testing.assert_array_equal(take.counts.numbers, [1, 2, 3, 4, 1, 2, 3, 4, 1, 2, 3, 1, 2, 3, 4, 1])
    first = np.linspace(80, 321.2, 7)[:-1]
    second, third = np.linspace(321.2, 481.2, 5), np.linspace(560, 720, 5)
    np.testing.assert_allclose(take.counts.times_s, np.concatenate([first, second, third]) / 80)
    assert [(f.name, f.n_counts) for f in take.figures] == [("C-1-1", 6), ("C-2-1", 4), ("C-3-1", 4)]
    assert [f.start_s for f in take.figures] == pytest.approx([1.0, 4.015, 7.0])
    assert [f.end_s for f in take.figures] == pytest.approx([4.015, 6.015, 9.0])


def test_waltz_has_three_counts_in_a_bar(folder):
    take = read_one(folder, row("W-1-1", 0, 240, 6))
    np.testing.assert_array_equal(take.counts.numbers, [1, 2, 3, 1, 2, 3, 1])
    assert take.credits.genre == "waltz"


def test_rows_that_are_no_figures(folder):
    take = read_one(
        folder,
        row("NIL", 0, 80, 1),
        row("T-1-1", 80, 240, 4),
        row("HOLD", 240, 320, 2),
        row("T-0-0", 320, 400, ""),
        row("T-2-1", 400, 420, 4),
    )
    assert [f.name for f in take.figures] == ["T-1-1"]
    assert take.notes[-1] == "not counted, since faster than 4 counts a second: T-2-1"


def test_figures_at_another_tempo_lower_the_confidence(folder):
    take = read_one(folder, row("R-1-1", 0, 320, 6), row("R-2-1", 320, 560, 2))
    assert take.counts.confidence == 0.75


def test_recordings_without_rows_are_not_counted(folder):
    take = read_one(folder, row("R-1-1", 0, 320, 6, recording="8"))
    assert not len(take.counts) and take.figures == () and take.credits.genre == ""


def test_an_annotation_beside_a_recording_replaces_its_figures(folder):
    write_counts(folder / "c3d" / "7.counts.csv", make_counts([1.0, 2.0], [1, 2], 2))
    take = read_one(folder, row("R-1-1", 0, 320, 6))
    assert take.counts.source == ANNOTATED and take.figures == ()
    np.testing.assert_array_equal(take.counts.times_s, [1.0, 2.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("c3d_file,movement_tag\n7,C-1-1\n", "header .*start_frame, end_frame, beats, got no start_frame"),
        (HEADER + row("C-1-1", 80, 40, 4), "line 2: .*got '80', '40'"),
        (HEADER + row("C-1-1", 80, 160, "four"), "line 2: .*'four'"),
        (HEADER + row("C-1-1", 80, 160, 2.5), "line 2: .*whole number of beats"),
        (HEADER + row("C-1-1", float("nan"), 160, 2), "line 2: .*'nan'"),
        (HEADER + "7,C-1-1\n", "line 2: expected 7 cells, got 2"),
    ],
)
def test_damaged_figures(folder, text, message):
    (folder / "figures.csv").write_text(text)
    with pytest.raises(FormatError, match=message) as caught:
        list(import_takes(folder))
    assert "figures.csv" in str(caught.value) and "\n" not in str(caught.value)


def write_lists(folder, *dances) -> None:
    (folder / "choreographies.json").write_text(json.dumps(dances))


def test_choreographies(folder):
    write_lists(folder, DANCE)
    (dance,) = read_choreographies(folder / "choreographies.json")
    assert (dance.name, dance.genre, dance.start_s, dance.end_s) == ("DANCE_C_1", "cha-cha", 1.0, 9.0)
    assert (dance.n_counts, dance.metre) == (12, 4)
    assert figure_counts(dance) == [("", 1), ("C-1-1", 4), ("", 1), ("C-2-1", 6)]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dance_type": "X"}, "dance_type"),
        ({"durations": [1, 4, 1]}, "4 movements, 3 durations"),
        ({"durations": [1, 4, 1, 0]}, "whole number of counts"),
        ({"durations": [1, 4, 1, 2.5]}, "whole number of counts"),
        ({"movements": [], "durations": []}, "0 movements"),
        ({"end_pos": 25}, "25 to 25"),
        ({"start_pos": "soon"}, "soon"),
        ({"movements": 3}, "movements"),
    ],
)
def test_damaged_choreographies(folder, changes, message):
    write_lists(folder, DANCE, DANCE | changes)
    with pytest.raises(FormatError, match=f"dance 2: .*{message}"):
        read_choreographies(folder / "choreographies.json")


@pytest.mark.parametrize("text", ["{", "{}", "3"])
def test_lists_that_are_none(folder, text):
    (folder / "choreographies.json").write_text(text)
    with pytest.raises(FormatError, match=r"choreographies\.json"):
        read_choreographies(folder / "choreographies.json")


def test_a_dance_is_its_figures_end_to_end(folder):
    write_lists(folder, DANCE)
    take, other = (Take(name, MOTION, Credits()) for name in ("DANCE_C_1", "DANCE_C_2"))
    counted, unchanged = annotate_takes([take, other], folder)
    assert unchanged is other
    np.testing.assert_allclose(counted.counts.times_s, np.arange(13) * 10.0 / 12)
    np.testing.assert_array_equal(counted.counts.numbers, [1, 2, 3, 4, 1, 2, 3, 4, 1, 2, 3, 4, 1])
    assert counted.figures == (
        Figure("C-1-1", pytest.approx(10 / 12), pytest.approx(50 / 12), 4),
        Figure("C-2-1", pytest.approx(60 / 12), pytest.approx(10.0), 6),
    )
    (again,) = annotate_takes([replace(take, counts=make_counts([1.0], [0], 0))], folder)
    assert len(again.counts) == 1  # what a take has already is kept


def test_dances_that_do_not_fit_their_lists(folder):
    write_lists(folder, DANCE | {"durations": [1, 40, 1, 6]}, DANCE | {"name": "DANCE_C_8"})
    fast, off = annotate_takes([Take(name, MOTION, Credits()) for name in ("DANCE_C_1", "DANCE_C_8")], folder)
    assert not len(fast.counts) and "48 counts in 10 s" in fast.notes[-1]
    assert off.counts.confidence == 0.5 and "another tempo" in off.notes[-1]


def test_sources_meet_in_any_order(folder, tmp_path):
    write_lists(folder, DANCE)
    (folder / "figures.csv").write_text(HEADER + row("C-1-1", 0, 320, 6))
    takes = tmp_path / "takes"
    takes.mkdir()
    save_motion(takes / "DANCE_C_1.bvh", MOTION.resampled(30.0))
    for sources in ([takes, folder], [folder, takes]):
        measured, _ = measured_takes(sources, BuildOptions(lock_feet=False), None)
        by_name = {m.take.name: m.take for m in measured}
        assert len(by_name["DANCE_C_1"].counts) == 13
        assert len(by_name["choreonet-7"].counts) == 7
        assert by_name["DANCE_C_1"].source_paths[-1] == folder / "choreographies.json"


def test_lists_alone_are_a_source_of_counts(tmp_path):
    write_lists(tmp_path, DANCE)
    assert list(import_takes(tmp_path)) == []


def test_the_real_lists(shared_data):
    dances = {d.name: d for d in read_choreographies(shared_data / "choreonet" / "choreographies.json")}
    assert len(dances) == 53
    assert dances["DANCE_C_6"].n_counts == 148
    assert 60 * dances["DANCE_W_1"].n_counts / (dances["DANCE_W_1"].end_s - dances["DANCE_W_1"].start_s) == (
        pytest.approx(87.6, abs=0.1)
    )
    assert sum(name == "" for name, _ in figure_counts(dances["DANCE_W_1"])) < 3


@pytest.mark.slow
def test_real_takes_are_counted(shared_data):
    takes = list(import_takes(shared_data / "dance-with-melody" / "DANCE_W_23"))
    takes += import_takes(shared_data / "dance-with-melody" / "DANCE_T_5")
    waltz, tango = annotate_takes(takes, shared_data / "choreonet")
    assert (len(waltz.counts), waltz.counts.metre, len(waltz.figures)) == (61, 3, 17)
    assert waltz.counts.times_s[-1] == pytest.approx(waltz.motion.duration_s)
    assert not len(tango.counts)
