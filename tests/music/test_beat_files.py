"""Beats from text files, in the layouts of trackers and label tracks, and what is wrong with them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.errors import FormatError
from choreograph.music.beats import read_beats


def read(tmp_path, text, **options):
    path = tmp_path / "song.beats"
    path.write_text(text, encoding="utf-8")
    return read_beats(path, **options)


@pytest.mark.parametrize(
    "text",
    [
        "0.5 1\n1.0 2\n1.5 3\n2.0 1\n",
        "0.5\t1\r\n1.0\t2\r\n1.5\t3\r\n2.0\t1\r\n",
        "0.5, 1\n1.0, 2\n1.5, 3\n2.0, 1",
        "# by ear\n\n0.5 1  # here it begins\n1.0 2.0\n1.5 3\n2.0 1",
        "0.500000\t0.500000\t1\n1.0\t1.0\t2\n1.5\t1.5\t3\n2.0\t2.0\t1\n",
        "\ufeff0.5 1\n1.0\n1.5 3\n2.0 1\n",
    ],
)
def test_layouts(tmp_path, text):
    counts = read(tmp_path, text)
    assert counts.times_s.tolist() == [0.5, 1.0, 1.5, 2.0]
    assert counts.numbers.tolist() == [1, 2, 3, 1]
    assert (counts.metre, counts.source, counts.confidence) == (3, "annotation", 1.0)


def test_numbers_are_counted_on_and_back_from_those_given(tmp_path):
    counts = read(tmp_path, "1\n2\n3 1\n4\n5\n6\n7 1\n8\n")
    assert counts.numbers.tolist() == [3, 4, 1, 2, 3, 4, 1, 2]


def test_beats_without_numbers_have_no_bars(tmp_path):
    counts = read(tmp_path, "0.5\n1.0\n")
    assert counts.metre == 0 and counts.numbers.tolist() == [0, 0]
    assert len(read(tmp_path, "# none\n")) == 0


def test_a_part_of_the_song(tmp_path):
    counts = read(tmp_path, "1 1\n2 2\n3 3\n4 1\n5 2\n", start_s=1.5, duration_s=2.5)
    assert counts.times_s.tolist() == [0.5, 1.5, 2.5]
    assert counts.numbers.tolist() == [2, 3, 1] and counts.metre == 3


@given(st.lists(st.floats(0.01, 5), min_size=1, max_size=30), st.integers(2, 12))
def test_what_is_written_is_read(tmp_path_factory, intervals_s, metre):
    times_s = np.cumsum(intervals_s)
    numbers = np.arange(len(times_s)) % metre + 1
    lines = [f"{time_s!r} {number}" for time_s, number in zip(times_s.tolist(), numbers, strict=True)]
    path = tmp_path_factory.mktemp("beats") / "a.txt"
    path.write_text("\n".join(lines))
    if len(lines) == 1:
        with pytest.raises(FormatError, match="only downbeats"):
            read_beats(path)
        return
    counts = read_beats(path)
    assert counts.times_s.tolist() == times_s.tolist()
    assert counts.numbers.tolist() == numbers.tolist()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("one\n", "line 1"),
        ("1.0 1\n2.0 beat\n", "line 2"),
        ("1.0 1.5\n", "line 1"),
        ("1.0 0\n", "line 1"),
        ("1 2 3 4\n", "line 1"),
        ("1.0 1e999\n", "line 1"),
        ("2.0 1\n1.0 2\n", "increasing"),
        ("1.0\n1.0\n", "increasing"),
        ("-1.0\n1.0\n", "increasing"),
        ("nan\n", "increasing"),
        ("1 1\n2 1\n3 1\n", "only downbeats"),
        ('1 1\n"\n', "line 2"),
        ("1 1\n\x0b\n", "line 2"),
        ("time beat\ntime beat\n", "line 2"),
        ("0.5 1.1\n1.0 1.2\n1.5 2.0\n", "line 1"),
        ("1 1\n" + "\n".join(map(str, range(2, 20))), "lack its 1"),
    ],
)
def test_malformed_files_are_told_in_one_line(tmp_path, text, reason):
    with pytest.raises(FormatError, match=reason) as caught:
        read(tmp_path, text)
    assert "song.beats" in str(caught.value) and "\n" not in str(caught.value)


def test_a_file_that_is_not_text(tmp_path):
    (tmp_path / "a.beats").write_bytes(b"\xff\xfe\x00\x81")
    for path in (tmp_path / "a.beats", tmp_path / "none.beats", tmp_path):
        with pytest.raises(FormatError, match="expected"):
            read_beats(path)
