"""Caches: values of equal content are kept once, within a bound, by threads and processes, and come back."""

from __future__ import annotations

import hashlib
import os
import pickle
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from choreograph.core import cache
from choreograph.core.cache import (
    NO_CACHE,
    NO_MEMORY,
    CachedRows,
    DiskCache,
    Memory,
    caching,
    digest,
    each_cached,
    key_of,
    rows_from,
)
from choreograph.core.counts import Counts

# Keys, and values in the process.

plain = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary()
some_arrays = arrays.arrays(
    st.sampled_from([np.float32, np.int64, bool]), arrays.array_shapes(min_side=0, max_side=3)
)
contents = st.recursive(plain | some_arrays, lambda inner: st.lists(inner, max_size=3), max_leaves=6)


@dataclass(frozen=True, eq=False)
class Inputs:
    number: int
    values: np.ndarray


def written(content: object) -> str:
    """The content with types and shapes, as text that differs for other content."""
    if isinstance(content, list):
        return f"[{', '.join(map(written, content))}]"
    if isinstance(content, np.ndarray):
        return f"{content.dtype}{content.shape}{content.tobytes()!r}"
    return f"{type(content).__name__} {content!r}"


@given(contents, contents)
def test_digests_are_equal_for_equal_content_only(one, other):
    assert (digest(one) == digest(other)) == (written(one) == written(other))


def test_the_digest_of_a_dataclass_is_that_of_its_fields():
    of = [
        digest(Inputs(n, np.array(values))) for n, values in ((1, [2.0]), (1, [2.0]), (1, [3.0]), (2, [2.0]))
    ]
    assert of[0] == of[1]
    assert len(set(of)) == 3


def test_an_array_and_its_transpose_differ():
    square = np.arange(4.0).reshape(2, 2)
    assert digest(square) != digest(square.T)
    assert digest(square.T) == digest(square.T.copy())


def test_objects_without_a_content_have_no_digest():
    with pytest.raises(TypeError, match="object"):
        digest([object()])
    with pytest.raises(TypeError, match="ndarray"):
        digest(np.array([object()]))


def test_a_value_is_computed_once_for_the_same_inputs():
    memory, computed = Memory(1000), []

    def value(*inputs):
        return memory.value(lambda: computed.append(inputs), *inputs)  # None is a value, too

    for inputs in (("a", 1), ("a", 1), ("a", 2), ("b", 1), ("a", 1)):
        value(*inputs)
    assert computed == [("a", 1), ("a", 2), ("b", 1)]


def test_parts_of_a_memory_share_its_bytes_but_not_their_values():
    memory = Memory(3000)
    one, other = memory.of("one"), memory.of("other")
    assert one.value(lambda: np.zeros(125), "v").sum() == 0
    assert other.value(lambda: np.ones(125), "v").sum() == 125
    assert one.of("x").value(lambda: 5, "v") == 5
    assert 2000 < memory.n_bytes <= 3000
    other.value(lambda: np.ones(250), "w")  # in place of the value that was not used for longest
    assert one.value(lambda: np.full(1, 7.0), "v").sum() == 7
    assert memory.n_bytes <= 3000


def test_no_memory_keeps_nothing():
    computed = [NO_MEMORY.of("a").value(lambda: object(), "b") for _ in range(2)]
    assert computed[0] is not computed[1]
    assert not NO_MEMORY.is_on and NO_MEMORY.n_bytes == 0
    assert Memory(1).is_on


def test_a_value_is_made_from_the_last_ones_of_the_same_common_inputs():
    memory, got = Memory(2000), []

    def value(common, name):
        def compute(last):
            got.append((name, list(last)))
            return name

        return memory.value_from_last(compute, (common,), name)

    assert [value(*pair) for pair in (("x", "a"), ("x", "b"), ("y", "c"), ("x", "a"), ("x", "d"))] == [
        *"abcad"
    ]
    assert got == [("a", []), ("b", ["a"]), ("c", []), ("d", ["a", "b"])]  # a was used last
    for name in "efg":
        value("x", name)
    assert got[-1] == ("g", ["f", "e", "d", "a"])
    memory.value(lambda: np.zeros(225), "large")  # in place of all others
    value("x", "h")
    assert got[-1] == ("h", [])


def test_without_a_memory_there_is_no_last_value_and_no_key():
    assert NO_MEMORY.value_from_last(lambda last: [last], ("x",), "a") == [[]]
    assert NO_MEMORY.value_from_last(lambda last: [last], ("x",), "b") == [[]]
    assert NO_MEMORY.key("x") == b""
    assert Memory(1).key("x") != Memory(1).of("y").key("x")


ids = st.lists(st.integers(0, 20), unique=True, min_size=1, max_size=12).map(np.array)


def rows_of(numbers):
    """Rows that follow from their ids."""
    return {"square": (numbers**2)[:, None] * [1.0, 2.0], "name": np.array([f"{n:>3}" for n in numbers])}


@given(st.lists(ids, max_size=3), ids)
def test_rows_are_taken_where_they_are_and_the_others_made(last, wanted):
    made = []

    def make(new):
        made.extend(wanted[new].tolist())
        return rows_of(wanted[new])

    found = rows_from([rows_of(one) for one in last], last, wanted, make)
    assert made == [one for one in wanted.tolist() if not any(one in other for other in last)]
    for name, values in rows_of(wanted).items():
        assert found[name].dtype == values.dtype
        np.testing.assert_array_equal(found[name], values)


def test_kept_items_are_bounded_in_bytes_and_the_oldest_leave_first():
    kept = Memory(4000)
    for index in range(6):
        kept.keep(index, f"item {index}", 1000)
        assert kept.get(0) == "item 0"  # used each time, so it stays
    assert [kept.get(index) for index in range(6)] == ["item 0", None, None, "item 3", "item 4", "item 5"]


def test_an_item_that_is_too_large_is_not_kept_and_removes_none():
    kept = Memory(100)
    kept.keep("a", "small", 60)
    kept.keep("b", "large", 101)
    assert (kept.get("a"), kept.get("b")) == ("small", None)
    kept.keep("c", "fits", 40)
    assert (kept.get("a"), kept.get("c")) == ("small", "fits")


def test_an_item_replaces_that_of_its_key():
    kept = Memory(100)
    kept.keep("a", "first", 60)
    kept.keep("a", "second", 70)
    assert (kept.get("a"), kept.n_bytes) == ("second", 70)
    kept.keep("a", "large", 101)
    assert (kept.get("a"), kept.n_bytes) == (None, 0)


def test_a_copy_is_empty():
    kept = Memory(100)
    kept.keep("a", "small", 60)
    copy = pickle.loads(pickle.dumps(kept))
    assert copy.get("a") is None
    copy.keep("b", "small", 100)
    copy.keep("c", "large", 101)
    assert (copy.get("b"), copy.get("c")) == ("small", None)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 200), st.integers(1, 40), st.integers(1, 6), st.integers(0, 1000))
def test_rows_are_those_of_the_array_with_room_for_any_number_of_blocks(n, block_rows, n_slots, seed):
    rng = np.random.default_rng(seed)
    array = rng.normal(size=(n, 3)).astype(np.float32)
    kept = CachedRows(array.shape, "f4", block_rows, n_slots * block_rows * 12)
    reads: list[int] = []

    def read(blocks):
        reads.extend(blocks)
        return (array[b * block_rows : (b + 1) * block_rows] for b in blocks)

    for _ in range(4):
        wanted = rng.integers(0, n, rng.integers(0, 30)).reshape(-1, 1)
        np.testing.assert_array_equal(kept.rows(wanted, read), array[wanted])
    if n <= n_slots * block_rows:
        assert len(reads) == len(set(reads))


def test_a_block_that_cannot_be_read_is_not_kept():
    kept = CachedRows((10, 1), "f4", 5)

    def damaged(blocks):
        raise OSError("damaged")

    with pytest.raises(OSError, match="damaged"):
        kept.rows(np.array([7]), damaged)
    array = np.arange(10, dtype=np.float32)[:, None]
    assert kept.rows(np.array([7]), lambda blocks: [array[5 * b : 5 * b + 5] for b in blocks]) == 7.0


# Values in files.


KEYS = [bytes([number]) * 16 for number in range(6)]
ENTRY = 32 + len(pickle.dumps(bytes(100), 5))  # bytes of a file of 100, with its checksum


@dataclass(frozen=True)
class Foreign:
    """A dataclass that is not of the program."""

    number: int


def counts_at(first_s: float) -> Counts:
    return Counts(np.array([first_s, first_s + 0.5]), np.array([1, 2]), 4)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "results_cache", lambda size: DiskCache(tmp_path, size))
    return tmp_path


@pytest.fixture
def made():
    """The inputs of a function that were worked on, the function, and its key."""
    calls: list[float] = []

    def make(first_s: float) -> Counts:
        calls.append(first_s)
        return counts_at(first_s)

    return calls, make, lambda first_s: digest(first_s)


def test_results_come_back_in_order_and_only_new_ones_are_made(folder, made):
    calls, make, key = made
    for inputs, new in (([1.0, 2.0], [1.0, 2.0]), ([3.0, 2.0, 4.0, 1.0], [3.0, 4.0]), ([4.0], [])):
        calls.clear()
        with caching(1.0) as results:
            found = list(each_cached(make, inputs, key=key))
        assert [one.times_s[0] for one in found] == inputs and calls == new
        assert isinstance(found[0], Counts) and found[0].numbers.dtype == np.int64
        assert results.n_read == ({"make": len(inputs) - len(new)} if len(inputs) > len(new) else {})


def test_outside_and_without_bytes_nothing_is_kept(folder, made):
    calls, make, key = made
    list(each_cached(make, [1.0], key=key))
    with caching(0.0) as results:
        list(each_cached(make, [1.0], key=key))
    assert results is NO_CACHE and len(calls) == 2 and not list(folder.iterdir())


def test_results_without_a_key_and_refused_ones_are_made_again(folder, made):
    calls, make, key = made
    with caching(1.0):
        for _ in range(2):
            list(each_cached(make, [1.0], key=lambda first_s: None))
            list(each_cached(make, [2.0], key=key, is_kept=lambda counts: False))
    assert len(calls) == 4 and not list(folder.iterdir())


def test_a_damaged_result_is_made_again(folder, made, caplog):
    calls, make, key = made
    for _ in range(2):
        with caching(1.0):
            [found] = each_cached(make, [1.0], key=key)
        [entry] = folder.iterdir()
        entry.write_bytes(entry.read_bytes()[:-1])
    assert calls == [1.0, 1.0] and found.times_s[0] == 1.0 and "damaged" in caplog.text


def test_code_and_foreign_classes_are_made_again(tmp_path, caplog):
    results = DiskCache(tmp_path, 1 << 20)
    for key, wrong in zip(KEYS, (os.system, Foreign(1), DiskCache, partial(print, 1)), strict=False):
        results.write(key, wrong)
        caplog.clear()
        assert results.read(key) is None and "may run code" in caplog.text


def test_values_come_back_as_they_were(tmp_path):
    results = DiskCache(tmp_path, 1 << 20)
    value = (Path("a") / "b", [counts_at(1.0)], {"n": np.float64(2.0)}, np.zeros((2, 3)).T, np.array([]))
    results.write(KEYS[0], value)
    read = results.read(KEYS[0])
    assert digest(read) == digest(value) and isinstance(read[0], Path)
    assert read[3].flags.f_contiguous and read[3].flags.writeable


def test_what_a_dataclass_has_computed_is_not_written(tmp_path):
    counts, results = counts_at(1.0), DiskCache(tmp_path, 1 << 20)
    vars(counts)["computed"] = 1  # as a cached property does
    results.write(KEYS[0], counts)
    assert digest(results.read(KEYS[0])) == digest(counts)


def test_files_of_another_version_are_ignored_and_leave_first(tmp_path, monkeypatch):
    (tmp_path / "old.npz").write_bytes(bytes(ENTRY))
    os.utime(tmp_path / "old.npz", (0, 0))
    (tmp_path / ".new.1-2.value").write_bytes(bytes(ENTRY))  # which another process is writing
    monkeypatch.setattr(cache, "program", lambda: ["old"])
    first = DiskCache(tmp_path, 2 * ENTRY)
    assert first.value(lambda: bytes(100), "input") == bytes(100)
    monkeypatch.setattr(cache, "program", lambda: ["new"])
    assert first.value(lambda: bytes(99), "input") == bytes(99)
    assert not (tmp_path / "old.npz").exists() and len(list(tmp_path.iterdir())) == 3


def test_a_full_disk_changes_no_value(tmp_path, monkeypatch, caplog):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    results = DiskCache(tmp_path, 1 << 20)
    made = iter(range(2))
    assert [results.value(made.__next__, "input") for _ in range(2)] == [0, 1]
    assert not list(tmp_path.iterdir()) and "not kept" in caplog.text


@pytest.mark.parametrize(
    "changed",
    [
        {"times_s": None},  # left out
        {"__class__": "another"},
        {"within": True},  # hides a method
    ],
)
def test_a_dataclass_takes_its_fields_alone(tmp_path, changed, caplog):
    state = {key: value for key, value in (vars(counts_at(1.0)) | changed).items() if value is not None}
    content = b"cchoreograph.core.counts\nCounts\n)\x81" + pickle.dumps(state, 2)[2:-1] + b"b."
    (tmp_path / f"{KEYS[0].hex()}.value").write_bytes(hashlib.sha256(content).digest() + content)
    assert DiskCache(tmp_path, 1 << 20).read(KEYS[0]) is None
    assert "the fields of another Counts" in caplog.text


def test_the_oldest_entries_are_removed_unless_they_were_used_here(tmp_path):
    first = DiskCache(tmp_path, 3 * ENTRY)
    for number, key in enumerate(KEYS[:3]):
        first.write(key, bytes(100))
        os.utime(tmp_path / f"{key.hex()}.value", (number, number))
    second = DiskCache(tmp_path, 3 * ENTRY)
    assert second.has(KEYS[0])  # the oldest
    second.write(KEYS[3], bytes(100))
    assert [second.read(key) is not None for key in KEYS] == [True, False, True, True, False, False]
    second.write(KEYS[4], bytes(100))  # all others were used
    assert second.read(KEYS[4]) is None and len(list(tmp_path.iterdir())) == 3


def test_an_entry_larger_than_the_bound_is_not_written(tmp_path):
    entries = DiskCache(tmp_path, 2 * ENTRY)
    entries.write(KEYS[0], bytes(100))
    entries.write(KEYS[1], bytes(1000))
    assert entries.read(KEYS[1]) is None


def test_a_folder_that_cannot_be_written_is_said(tmp_path, caplog):
    DiskCache(tmp_path / "gone", 1000).write(KEYS[0], 1)
    assert "not kept" in caplog.text


def test_keys_are_those_of_functions_arguments_and_values():
    read = cache.program
    keys = [
        key_of(read), key_of(partial(read, 1)), key_of(partial(read, n=1)), key_of(cache.caching),
        key_of(read, Path("a")), key_of(read, "a"), key_of(read, np.zeros(1)),
        key_of(read, np.zeros(1, "f4")),
    ]  # fmt: skip
    assert len(set(keys)) == len(keys) and key_of(read, Path("a")) == keys[4]
    assert key_of(counts_at, 1.0) is None  # of another package
