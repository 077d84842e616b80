"""The table of public data sets, and tables that are refused."""

import pytest

from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.data_sets import data_set, data_sets

MINE = """
[mine]
title = "Mine"
about = "a set"
licence = "CC0"
terms = ["none"]
page = "https://example.org"
build = "takes"
layout = "takes/*.bvh"
"""
FILE = """
[[mine.files]]
url = "https://example.org/a.zip"
max_bytes = 10
keep = ["*.bvh"]
into = "takes"
max_unpacked_bytes = 20
"""


def test_every_set_shows_terms_and_says_how_it_is_got():
    known = data_sets()
    assert {"aist++", "lafan1", "100style", "cmu", "amass"} <= set(known)
    for one in known.values():
        assert one.terms and all(one.terms) and one.licence and one.page.startswith("http")
        assert one.files or one.by_hand
        assert one.layout.startswith(one.build)
        assert len({file.name for file in one.files}) == len(one.files)  # they lie in one folder
        assert all(file.into.startswith(one.build) for file in one.files)
    assert not known["amass"].files and not known["motorica"].files  # their owners ask for a form


def test_a_set_is_found_by_its_name_in_any_case():
    assert data_set("AIST++").title == "AIST++"
    with pytest.raises(ParameterError, match=r"among aist\+\+, .*got 'edge'"):
        data_set("edge")


def test_a_table_of_ones_own(tmp_path):
    path = tmp_path / "sets.toml"
    path.write_text(MINE + FILE)
    assert data_set("mine", path).files[0].name == "a.zip"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("mine", "in TOML"),
        ("mine = 1", "a table of keys"),
        (MINE, "files or by_hand"),
        (MINE.replace("[mine]", "[Mine]") + "by_hand = 'x'", "small letters"),
        (MINE.replace('licence = "CC0"', "") + FILE, "got no licence"),
        (MINE + "extra = 1" + FILE, "got also extra"),
        (MINE.replace('["none"]', '"none"') + FILE, "expected terms"),
        (MINE + FILE.replace("10", '"10"'), "expected max_bytes"),
        (MINE + FILE.replace("10", "-1"), "expected max_bytes"),
        (MINE + FILE.replace("https:", "file:"), "http or https"),
        (MINE + FILE.replace("/a.zip", ""), "address of a file"),
        (MINE + FILE + 'sum = "sha256:12"', "expected a sum"),
        (MINE + FILE + f'sum = "md5:{"g" * 32}"', "expected a sum"),
        (MINE + FILE.replace('into = "takes"', 'into = "../takes"'), "inside"),
        (MINE.replace('"takes"', '"/takes"') + FILE, "inside"),
        (MINE + "files = 3", "[[mine.files]]"),
        ("", "got none"),
        (MINE + FILE.replace("10", "9" * 5000), "in TOML"),
        ("a = " + "[" * 100_000, "in TOML"),
        (MINE + FILE + FILE, "one name twice"),
        (MINE + FILE.replace("/a.zip", "/lock"), "locks the folder"),
        (MINE + FILE.replace("/a.zip", "/Owner.json"), "locks the folder"),
        (MINE + FILE.replace('["*.bvh"]', "[]"), "expected keep"),
        *(
            (MINE + FILE.replace("/a.zip", end), "address of a file")
            for end in (
                "/..",
                "/a/..",
                "/..?x=1",
                r"/a\u0000b",
                r"/a\nb.zip",
                "/a:b.zip",
                "/.hidden",
                f"/{'n' * 300}",
                r"/a\\..\\b",
                ":99999/a.zip",
                ":x/a.zip",
            )
        ),
        *((MINE + FILE.replace("example.org", host), "address of a file") for host in ("", "[bad", ":80")),
        *(
            ((MINE + FILE).replace("mine", name), "name")
            for name in (
                '".."',
                '"."',
                '"../x"',
                '"/tmp/x"',
                '""',
                r'"a\u0000"',
                r'"a\\b"',
                '"c:"',
                f'"{"n" * 300}"',
            )
        ),
        *((MINE.replace("takes/*.bvh", glob) + FILE, "glob") for glob in ("", ".", "**x", "a/***")),
        (MINE.replace("takes/*.bvh", r"takes/*\u0000") + FILE, "inside"),
        (MINE.replace('"takes"', r'"a\u0000"') + FILE, "inside"),
        (MINE.replace('"takes"', f'"{"a" * 5000}"') + FILE, "inside"),
    ],
)
def test_a_damaged_table_is_refused_in_one_line(tmp_path, text, says):
    path = tmp_path / "sets.toml"
    path.write_text(text)
    with pytest.raises(FormatError) as raised:
        data_sets(path)
    assert says in str(raised.value) and "\n" not in str(raised.value)
