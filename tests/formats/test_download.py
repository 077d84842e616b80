"""Data sets, their download, and takes at addresses."""

from __future__ import annotations

import io
import stat
import sys
import zipfile
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from command_line import assert_one_line, run
from file_server import hosted
from synthetic_motions import stepping

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.formats.download import (
    DataSet,
    SetFile,
    data_set,
    data_sets,
    fetch,
    is_address,
    local_sources,
    unpack,
)
from choreograph.formats.register import save_motion

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


BLOCK = 1 << 18  # bytes that are written at a time: a break loses less than one
NOISE = np.random.default_rng(0).bytes(3 * BLOCK)


def zipped(entries, method=zipfile.ZIP_STORED) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as out:
        for name, data in entries:
            out.writestr(name, data)
    return content.getvalue()


CONTENT = zipped([("set/a.bvh", NOISE), ("set/deep/b.bvh", b"b"), ("set/readme.txt", b"x"), ("._a.bvh", b"")])


def set_of(host, **changes) -> DataSet:
    file = SetFile(host.url, 1_000_000, ("*.bvh",), "takes", 1_000_000, host.sum)
    file = replace(file, **changes)
    return DataSet("mine", "Mine", "", "", (), "https://example.org", "takes", "takes/*", (file,))


@pytest.fixture
def host():
    with hosted(CONTENT) as host:
        yield host


def test_what_is_kept_is_unpacked_and_a_second_call_downloads_nothing(tmp_path, host):
    assert fetch(set_of(host), tmp_path) == (2, ())
    takes = tmp_path / "takes"
    assert sorted(path.name for path in takes.iterdir()) == ["a.bvh", "b.bvh"]
    assert (takes / "a.bvh").read_bytes() == NOISE
    (takes / "b.bvh").unlink()
    assert fetch(set_of(host), tmp_path) == (2, ())
    assert (takes / "b.bvh").read_bytes() == b"b"
    assert host.asked == [None]
    assert sorted(path.name for path in (tmp_path / "downloads").iterdir()) == ["set.zip"]


def test_a_cut_connection_is_continued_in_the_same_call(tmp_path, host):
    host.cut_after = [BLOCK, BLOCK]
    assert fetch(set_of(host), tmp_path)[0] == 2
    assert host.asked == [None, f"bytes={BLOCK}-", f"bytes={2 * BLOCK}-"]
    assert (tmp_path / "takes" / "a.bvh").read_bytes() == NOISE


def test_a_later_call_continues_what_was_stopped(tmp_path, host):
    host.cut_after = [BLOCK, 0, 0]
    with pytest.raises(ChoreographError, match="the same command goes on"):
        fetch(set_of(host), tmp_path)
    assert (tmp_path / "downloads" / "set.zip.part").stat().st_size == BLOCK
    host.asked.clear()
    assert fetch(set_of(host), tmp_path)[0] == 2
    assert host.asked == [f"bytes={BLOCK}-"]


@pytest.mark.parametrize("change", ["another file", "no parts", "no tag", "a weak tag"])
def test_a_part_that_cannot_be_continued_is_downloaded_again(tmp_path, host, change):
    host.cut_after = [BLOCK, 0, 0]
    host.tag = {"no tag": None, "a weak tag": 'W/"one"'}.get(change, host.tag)
    with pytest.raises(ChoreographError):
        fetch(set_of(host), tmp_path)
    if change == "another file":
        host.content, host.tag = zipped([("c.bvh", NOISE[::-1])]), '"two"'
    host.ranges = change != "no parts"
    fetch(set_of(host), tmp_path)
    name, data = ("c.bvh", NOISE[::-1]) if change == "another file" else ("a.bvh", NOISE)
    assert (tmp_path / "takes" / name).read_bytes() == data


def test_a_part_that_is_longer_than_the_file_is_removed(tmp_path, host):
    (tmp_path / "downloads").mkdir()
    (tmp_path / "downloads" / "set.zip.part").write_bytes(CONTENT + b"more")
    (tmp_path / "downloads" / "set.zip.part.tag").write_text(host.tag)
    assert fetch(set_of(host), tmp_path)[0] == 2
    assert host.asked == [f"bytes={len(CONTENT) + 4}-", None]


def test_a_wrong_sum_leaves_nothing_to_unpack(tmp_path, host):
    with pytest.raises(FormatError, match=r"expected the sum sha256:0+, got another"):
        fetch(set_of(host, sum=f"sha256:{'0' * 64}"), tmp_path)
    assert not (tmp_path / "takes").exists()
    assert not list((tmp_path / "downloads").glob("set*"))


def test_a_damaged_file_of_an_earlier_call_is_downloaded_again(tmp_path, host):
    (tmp_path / "downloads").mkdir()
    (tmp_path / "downloads" / "set.zip").write_bytes(b"damaged")
    assert fetch(set_of(host), tmp_path)[0] == 2


def test_without_a_published_sum_the_first_one_is_kept(tmp_path, host):
    mine = set_of(host, sum="")
    assert "publish no sum" in fetch(mine, tmp_path)[1][0]
    record = tmp_path / "downloads" / "set.zip.sha256"
    assert record.read_text() == f"{host.sum.removeprefix('sha256:')}  set.zip\n"
    (tmp_path / "downloads" / "set.zip").write_bytes(b"damaged")
    fetch(mine, tmp_path)
    host.content = zipped([("a.bvh", b"other")])
    (tmp_path / "downloads" / "set.zip").unlink()
    with pytest.raises(FormatError, match="got another: the host has changed"):
        fetch(mine, tmp_path)


def test_a_file_that_is_gone_says_how_to_get_it_by_hand(tmp_path, host):
    host.status = 404
    with pytest.raises(ChoreographError, match="got 404 Not Found: download it in a browser") as raised:
        fetch(set_of(host), tmp_path)
    assert "https://example.org" in str(raised.value) and str(tmp_path / "downloads") in str(raised.value)
    (tmp_path / "downloads").mkdir(exist_ok=True)
    (tmp_path / "downloads" / "set.zip").write_bytes(CONTENT)  # by hand
    assert fetch(set_of(host), tmp_path)[0] == 2


def test_a_machine_that_does_not_answer_is_one_line(tmp_path):
    with hosted(CONTENT) as host:
        mine = set_of(host)
    with pytest.raises(ChoreographError, match="connection failed") as raised:
        fetch(mine, tmp_path)
    assert "\n" not in str(raised.value)


def test_a_longer_file_than_stated_is_not_downloaded(tmp_path, host):
    with pytest.raises(FormatError, match="at most 1000 bytes"):
        fetch(set_of(host, max_bytes=1000), tmp_path)
    assert not list((tmp_path / "downloads").glob("set.zip*"))


@pytest.mark.parametrize("record", [b"", b" \n", b"abc", b"\xff\xfe", b"g" * 64, b"0" * 63, b"0" * 65])
def test_a_record_without_a_sum_is_refused(tmp_path, host, record):
    (tmp_path / "downloads").mkdir()
    (tmp_path / "downloads" / "set.zip.sha256").write_bytes(record)
    with pytest.raises(FormatError, match=r"set\.zip\.sha256: expected") as raised:
        fetch(set_of(host, sum=""), tmp_path)
    assert "\n" not in str(raised.value) and host.asked == []


@pytest.mark.parametrize("length", ["", "abc", "1e3", "9" * 5000])
def test_an_answer_that_is_not_of_http_is_no_wrong_sum(tmp_path, host, length):
    host.length = length
    with pytest.raises(ChoreographError, match="an address or an answer that is not of HTTP"):
        fetch(set_of(host), tmp_path)


def test_an_address_that_no_host_can_have_is_no_wrong_sum(tmp_path, host):
    with pytest.raises(ChoreographError, match="an address or an answer that is not of HTTP"):
        fetch(set_of(host, url=f"http://{'a' * 70}.com/set.zip"), tmp_path)


def test_a_part_that_was_not_asked_for_is_refused(tmp_path, host):
    host.status = 206
    with pytest.raises(ChoreographError, match="connection failed"):
        fetch(set_of(host), tmp_path)


# Unpacking.


@pytest.mark.parametrize("mine", [b"longer than it was", b"B"])
def test_a_file_that_was_changed_stays_and_is_named(tmp_path, host, mine):
    fetch(set_of(host), tmp_path)
    (tmp_path / "takes" / "b.bvh").write_bytes(mine)
    (tmp_path / "takes" / "a.bvh").unlink()
    n_files, (note,) = fetch(set_of(host), tmp_path)
    assert n_files == 2 and "left as they are: b.bvh. Remove" in note
    assert (tmp_path / "takes" / "b.bvh").read_bytes() == mine
    assert (tmp_path / "takes" / "a.bvh").read_bytes() == NOISE
    (tmp_path / "takes" / "b.bvh").unlink()
    assert fetch(set_of(host), tmp_path) == (2, ())
    assert (tmp_path / "takes" / "b.bvh").read_bytes() == b"b"


def test_of_many_changed_files_a_few_are_named(tmp_path, host):
    host.content = zipped([(f"{index}.bvh", b"x") for index in range(9)])
    fetch(set_of(host), tmp_path)
    for path in (tmp_path / "takes").iterdir():
        path.write_bytes(b"")
    (note,) = fetch(set_of(host), tmp_path)[1]
    assert "0.bvh, 1.bvh, 2.bvh and 6 more. Remove" in note


def unpacked(tmp_path, content, **changes) -> int:
    archive = tmp_path / "set.zip"
    archive.write_bytes(content)
    file = SetFile("http://x/set.zip", 1, ("*.bvh",), "takes", 1_000_000)
    return len(unpack(archive, tmp_path / "takes", replace(file, **changes))[0])


@pytest.mark.parametrize(
    "name", ["../../evil.bvh", "/tmp/evil.bvh", "..\\..\\evil.bvh", "C:\\evil.bvh", "a/../../b/evil.bvh"]
)
def test_nothing_is_written_outside_of_the_folder(tmp_path, name):
    (tmp_path / "in").mkdir()
    assert unpacked(tmp_path / "in", zipped([(name, b"1")])) == 1
    files = [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()]
    assert sorted(files) == ["in/set.zip", "in/takes/evil.bvh"]


def test_a_link_is_unpacked_as_a_file(tmp_path):
    link = zipfile.ZipInfo("link.bvh")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    assert unpacked(tmp_path, zipped([(link, b"/etc/passwd")])) == 1
    assert not (tmp_path / "takes" / "link.bvh").is_symlink()
    assert (tmp_path / "takes" / "link.bvh").read_bytes() == b"/etc/passwd"


@pytest.mark.parametrize(
    ("entries", "changes", "says"),
    [
        ([("a.bvh", b"1"), ("b/A.bvh", b"2")], {}, "two named A.bvh"),
        ([("a\n.bvh", b"1")], {}, "usual names"),
        ([("a:b.bvh", b"1")], {}, "usual names"),
        ([("a" * 300 + ".bvh", b"1")], {}, "usual names"),
        ([("a.txt", b"1")], {}, r"expected \*\.bvh in it, got none"),
        ([("a.bvh", bytes(2_000_000))], {}, "at most 1000000 bytes, got 2000000"),
    ],
)
def test_archives_that_are_refused_write_nothing(tmp_path, entries, changes, says):
    with pytest.raises(FormatError, match=says):
        unpacked(tmp_path, zipped(entries, zipfile.ZIP_DEFLATED), **changes)
    assert not (tmp_path / "takes").exists()


def test_too_many_files_are_refused(tmp_path):
    with pytest.raises(FormatError, match=r"100,?001 files"):
        unpacked(tmp_path, zipped([(f"{i}.bvh", b"") for i in range(100_001)]))


def test_a_stated_size_that_is_too_small_is_no_way_to_write_more(tmp_path):
    content = zipped([("a.bvh", bytes(500_000))], zipfile.ZIP_DEFLATED)
    size = (500_000).to_bytes(4, "little")
    with pytest.raises(FormatError):
        unpacked(tmp_path, content.replace(size, (10).to_bytes(4, "little")))
    assert not list((tmp_path / "takes").iterdir())


@pytest.mark.parametrize("damage", ["text", "cut", "flipped", "locked"])
def test_damaged_archives_are_one_line(tmp_path, damage):
    content = {
        "text": b"no archive", "cut": CONTENT[:-30], "flipped": CONTENT.replace(NOISE[:50], NOISE[50:100]),
        "locked": CONTENT.replace(b"PK\x01\x02\x14\x03\x14\0\0\0", b"PK\x01\x02\x14\x03\x14\0\x01\0"),
    }[damage]  # fmt: skip
    assert content != CONTENT
    with pytest.raises(FormatError, match="expected a ZIP file") as raised:
        unpacked(tmp_path, content)
    assert "\n" not in str(raised.value)
    assert not list(tmp_path.glob("takes/*"))


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_archive_with_any_damage_is_unpacked_or_refused(tmp_path, method):
    content, rng = zipped([("set/a.bvh", b"abc" * 99), ("é.bvh", b"x")], method), np.random.default_rng(1)
    for _ in range(300):
        damaged = bytearray(content)
        for at in rng.integers(len(damaged), size=2):
            damaged[at] = rng.integers(256)
        with suppress(FormatError):  # no error of writing
            unpacked(tmp_path, bytes(damaged))


fsspec = pytest.importorskip("fsspec")


@pytest.fixture
def address(tmp_path):
    """A folder in memory with a take in it and a file below it, and the same in a folder here."""
    folder = tmp_path / "takes"
    save_motion_to = folder / "walk.bvh"
    folder.mkdir()
    save_motion(save_motion_to, stepping(30 * 9, seed=1))
    (folder / "notes").mkdir()
    (folder / "notes" / "read me.txt").write_text("hello")
    memory = fsspec.filesystem("memory")
    memory.put(f"{folder}/", "/bucket/takes/", recursive=True)
    yield "memory://bucket/takes"
    memory.rm("/bucket", recursive=True)


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("s3://bucket/takes", True), ("memory://x", True), ("takes", False), ("C:/takes", False),
        ("://", False), ("../a://b", False),
    ],
)  # fmt: skip
def test_addresses_have_a_protocol(source, expected):
    assert is_address(source) == expected


def test_a_folder_is_copied_with_its_name_and_removed(address, tmp_path):
    with local_sources([tmp_path / "takes", address, f"{address}/walk.bvh"], tmp_path / "work") as paths:
        here, folder, file = paths
        assert here == tmp_path / "takes" and (folder.name, file.name) == ("takes", "walk.bvh")
        for inside in ("walk.bvh", "notes/read me.txt"):
            assert (folder / inside).read_bytes() == (here / inside).read_bytes()
        assert file.read_bytes() == (here / "walk.bvh").read_bytes()
    assert not (tmp_path / "work" / "fetched").exists()


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("memory://nothing/here", "expected takes at memory://nothing/here, got nothing"),
        ("nosuch://bucket", "nosuch://bucket: expected takes, could not read them: Protocol not known"),
        pytest.param(
            "s3://bucket/takes",
            "s3://bucket/takes: expected takes, could not read them: Install s3fs",
            marks=pytest.mark.skipif(find_spec("s3fs") is not None, reason="s3fs is installed"),
        ),
    ],
)
def test_what_cannot_be_read_is_said_in_a_line(tmp_path, source, says):
    assert_one_line(run("build-db", source, "-o", tmp_path / "rep.h5"), says=says)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "source",
    [
        "reference://x", "data://x", "data://,x", "data://text/plain;base64,AAAA", "dir://x", "generic://x",
        "github://x", "dask://x", "filecache://x", "zip://x", "memory://\0", "http://[bad/", "file://\0",
        "http://127.0.0.1:99999/takes",
    ],
)  # fmt: skip
def test_no_protocol_raises_an_error_of_its_own(tmp_path, source):
    with (
        pytest.raises(ParameterError, match=r"expected takes") as raised,
        local_sources([source], tmp_path / "work"),
    ):
        pass
    assert "\n" not in str(raised.value) and not (tmp_path / "work" / "fetched").exists()


def test_a_name_that_leads_out_of_the_folder_is_replaced(tmp_path):
    memory = fsspec.filesystem("memory")
    memory.pipe("/bucket/..", b"x")
    try:
        with local_sources(["memory://bucket/.."], tmp_path / "work") as (path,):
            assert path == tmp_path / "work" / "fetched" / "0" / "takes" and path.read_bytes() == b"x"
    finally:
        memory.rm("/bucket", recursive=True)


def test_without_the_package_addresses_are_refused(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    refused = pytest.raises(ParameterError, match=r"expected the package fsspec .*choreograph\[remote\]")
    with refused, local_sources(["memory://a"], tmp_path):
        pass


def test_files_outside_of_the_address_are_refused(address, tmp_path, monkeypatch):
    found = fsspec.implementations.memory.MemoryFileSystem.find
    monkeypatch.setattr(
        "fsspec.implementations.memory.MemoryFileSystem.find",
        lambda *given, **options: [*found(*given, **options), "/bucket/takes/../../evil.bvh"],
    )
    with pytest.raises(ParameterError, match="expected files below it"), local_sources([address], tmp_path):
        pass


def test_check_shows_takes_at_an_address(address):
    shown = run("build-db", address, "--check")
    assert shown.exit_code == 0, shown.output
    assert "read as walk" in shown.stdout
