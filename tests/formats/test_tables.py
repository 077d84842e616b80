"""Tables as spreadsheets write them, and what is wrong with others."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import FormatError
from choreograph.formats.tables import as_number, read_table

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
