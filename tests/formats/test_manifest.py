"""Tables beside motions: counts, and rows as spreadsheets write them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from choreograph.core.counts import ANNOTATED, NO_COUNTS, Figure, make_counts, numbers_in_bar
from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.manifest import as_number, read_counts, read_table, write_counts

TABLE = "name,genre,offset_s\nwalk,waltz,0.5\nNeujahr,Größe,\n"
ROWS = [
    {"name": "walk", "genre": "waltz", "offset_s": "0.5"},
    {"name": "Neujahr", "genre": "Größe", "offset_s": ""},
]


def read(path, content: bytes, **options):
    path = path / "table.csv"
    path.write_bytes(content)
    return read_table(path, "a table of takes", required=("name",), optional=("genre", "offset_s"), **options)


@pytest.mark.parametrize(
    "text",
    [
        TABLE,
        TABLE.replace(",", ";"),
        TABLE.replace(",", "\t"),
        TABLE.replace(",", ", "),
        TABLE.replace("\n", "\r\n"),
        TABLE.replace("\n", "\r"),
        TABLE.replace("\n", "\n\n") + "\n,,\n  \n",
        TABLE.replace("\n", ",,\n"),
        TABLE.replace("name,genre,offset_s", " Name,GENRE,Offset S"),
        "sep=;\n" + TABLE.replace(",", ";"),
        "SEP=\t\r\n" + TABLE.replace(",", "\t"),
        "\n\n" + TABLE.rstrip("\n"),
        TABLE + "\0\0",
        TABLE.replace("walk", '"walk"'),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_layouts_and_encodings(tmp_path, text, encoding):
    assert [row.cells for row in read(tmp_path, text.encode(encoding))] == ROWS


def test_quoted_cells_and_line_numbers(tmp_path):
    rows = read(tmp_path, b'name;genre\n\n"a;b";"a\nc"\nd;e\n')
    assert [row.cells for row in rows] == [{"name": "a;b", "genre": "a\nc"}, {"name": "d", "genre": "e"}]
    assert [row.where.partition(", ")[2] for row in rows] == ["line 4", "line 5"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "header name and any of genre, offset_s, got no name"),
        ("genre\nwaltz\n", "got no name"),
        ("name,style\na,b\n", "got 'style'"),
        ("name,genre,Genre\na,b,c\n", "got 'genre' twice"),
        ("name,,genre\na,b,c\n", "got ''"),
        ("name,genre\na\n", "line 2: expected 2 cells, got 1"),
        ("name,genre\na,b,c\n", "line 2: expected 2 cells, got 3"),
        ("name\n" + "x" * 200_000 + "\n", "line 2: expected a table of takes, got field larger"),
        ("x" * 200_000, "got field larger"),
        (f"name,{'x' * 1000}\n", "xxx"),
    ],
)
def test_other_tables_are_refused_in_one_short_line(tmp_path, text, message):
    with pytest.raises(FormatError, match=message) as caught:
        read(tmp_path, text.encode())
    assert len(str(caught.value)) - len(str(tmp_path)) < 200 and "table.csv" in str(caught.value)


def test_any_other_columns(tmp_path):
    (tmp_path / "a.csv").write_text("name,mood\na,merry\n")
    (row,) = read_table(tmp_path / "a.csv", "a table", required=("name",))
    assert row.cells == {"name": "a", "mood": "merry"}


def test_numbers():
    assert [as_number(cell) for cell in ("0.25", "0,25", "-1,5", "3", "1e-3")] == [
        0.25,
        0.25,
        -1.5,
        3.0,
        1e-3,
    ]
    assert np.isnan([as_number(cell) for cell in ("", "one", "1,2,3", "1.000,5", ",")]).all()


COUNTS = "time_s,number,figure\n0.5,1,basic\n1.0,2,\n1.5,3,turn\n2.0,1,\n2.5,2,-\n3.0,3,\n"


def test_a_table_by_hand(tmp_path):
    (tmp_path / "a.counts.csv").write_text("\ufeff" + COUNTS.replace("\n", "\r\n"), encoding="utf-8")
    counts, figures = read_counts(tmp_path / "a.counts.csv")
    np.testing.assert_array_equal(counts.times_s, [0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    np.testing.assert_array_equal(counts.numbers, [1, 2, 3, 1, 2, 3])
    assert (counts.metre, counts.source, counts.confidence) == (3, ANNOTATED, 1.0)
    assert figures == (Figure("basic", 0.5, 1.5, 2), Figure("turn", 1.5, 2.5, 2))


def test_a_last_figure_ends_on_the_last_count(tmp_path):
    (tmp_path / "a.csv").write_text("time_s,number,figure\n0,1,a\n1,2,\n2,1,\n")
    assert read_counts(tmp_path / "a.csv")[1] == (Figure("a", 0.0, 2.0, 2),)


def test_bars_may_be_unknown(tmp_path):
    (tmp_path / "a.csv").write_text("time_s,number\n0.2,0\n0.7,0\n")
    counts, figures = read_counts(tmp_path / "a.csv")
    assert not counts.has_bars and figures == ()


@given(
    st.lists(st.floats(0.05, 2.0), min_size=8, max_size=40),
    st.integers(2, 7),
    st.sets(st.integers(0, 7), min_size=2, max_size=8),
)
def test_what_is_written_is_read_again(tmp_path_factory, steps_s, metre, borders):
    path = tmp_path_factory.mktemp("counts") / "a.counts.csv"
    times_s = np.round(np.cumsum(steps_s), 6)
    counts = make_counts(times_s, numbers_in_bar(len(times_s), metre), metre)
    starts = sorted(borders)
    figures = tuple(
        Figure(f"figure {first}", times_s[first], times_s[last], last - first)
        for first, last in pairwise(starts)
        if first % 3  # some counts are in no figure
    )
    write_counts(path, counts, figures)
    read, read_figures = read_counts(path)
    np.testing.assert_allclose(read.times_s, times_s, atol=1e-6)
    np.testing.assert_array_equal(read.numbers, counts.numbers)
    assert read.metre == metre and read_figures == figures


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "header"),
        ("time_s\n1\n", "header"),
        ("time,number\n1,1\n", "header"),
        ("time_s,number,move\n1,1,a\n", "header"),
        ("0.5,1\n1.0,2\n", "header"),
        ("time_s,number\n", "got none"),
        ("time_s,number\n1.0,1\n1.0,2\n", "line 3: .*increasing"),
        ("time_s,number\n2.0,1\n1.0,2\n", "line 3: .*increasing"),
        ("time_s,number\n-0.5,1\n1.0,2\n", "line 2: .*0 or more"),
        ("time_s,number\nnan,1\n", "line 2: .*time_s, got 'nan'"),
        ("time_s,number\n1.0,inf\n", "line 2: .*number, got 'inf'"),
        ("time_s,number\n1.0,one\n", "line 2: .*'one'"),
        ("time_s,number\n1.0,1.5\n", "line 2: .*'1.5'"),
        ("time_s,number\n1.0,13\n", "line 2: .*0 to 12, got '13'"),
        ("time_s,number\n1.0,-1\n", "line 2: .*'-1'"),
        ("time_s,number\n1.0,1\n2.0,0\n", "got both"),
        ("time_s,number\n1.0\n", "line 2: .*2 cells"),
        ("time_s,number\n1.0,1,a\n", "line 2: .*2 cells"),
    ],
)
def test_no_such_tables(tmp_path, text, message):
    (tmp_path / "a.counts.csv").write_text(text)
    with pytest.raises(FormatError, match=message) as caught:
        read_counts(tmp_path / "a.counts.csv")
    assert "a.counts.csv" in str(caught.value) and "\n" not in str(caught.value)


def test_bytes_that_are_no_text(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"time_s,number\n\xff\xfe,1\n")
    with pytest.raises(FormatError, match=r"line 2: expected a number in time_s, got 'ÿþ'"):
        read_counts(tmp_path / "a.csv")


def test_nothing_to_read_or_write(tmp_path):
    with pytest.raises(ParameterError, match="no file"):
        read_counts(tmp_path / "a.csv")
    with pytest.raises(ParameterError, match="not counted"):
        write_counts(tmp_path / "a.csv", NO_COUNTS)
