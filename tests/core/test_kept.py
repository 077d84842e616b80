"""Kept results: what comes back, what is refused, which entries are removed, and what makes another key."""

from __future__ import annotations

import os
import pickle
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from choreograph.core import kept
from choreograph.core.counts import Counts
from choreograph.core.kept import KeptEntries, KeptResults, each_kept, keeping, key_of

KEYS = [bytes([number]) * 16 for number in range(6)]
ENTRY = 32 + 100  # bytes of an entry of 100, with its checksum


@dataclass(frozen=True)
class Foreign:
    """A dataclass that is not of the program."""

    number: int


def counts_at(first_s: float) -> Counts:
    return Counts(np.array([first_s, first_s + 0.5]), np.array([1, 2]), 4)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "kept_folder", lambda: (tmp_path, ""))
    return tmp_path


@pytest.fixture
def made():
    """The inputs of a function that were worked on, the function, and its key."""
    calls: list[float] = []

    def make(first_s: float) -> Counts:
        calls.append(first_s)
        return counts_at(first_s)

    return calls, make, lambda first_s: kept.digest(first_s)


def test_results_come_back_in_order_and_only_new_ones_are_made(folder, made):
    calls, make, key = made
    for inputs, new in (([1.0, 2.0], [1.0, 2.0]), ([3.0, 2.0, 4.0, 1.0], [3.0, 4.0]), ([4.0], [])):
        calls.clear()
        with keeping(1.0) as results:
            found = list(each_kept(make, inputs, key=key))
        assert [one.times_s[0] for one in found] == inputs and calls == new
        assert isinstance(found[0], Counts) and found[0].numbers.dtype == np.int64
        assert results.n_read == ({"make": len(inputs) - len(new)} if len(inputs) > len(new) else {})


def test_outside_and_without_bytes_nothing_is_kept(folder, made):
    calls, make, key = made
    list(each_kept(make, [1.0], key=key))
    with keeping(0.0) as results:
        list(each_kept(make, [1.0], key=key))
    assert results is None and len(calls) == 2 and not list(folder.iterdir())


def test_results_without_a_key_and_refused_ones_are_made_again(folder, made):
    calls, make, key = made
    with keeping(1.0):
        for _ in range(2):
            list(each_kept(make, [1.0], key=lambda first_s: None))
            list(each_kept(make, [2.0], key=key, is_kept=lambda counts: False))
    assert len(calls) == 4 and not list(folder.iterdir())


def test_a_damaged_result_is_made_again(folder, made, caplog):
    calls, make, key = made
    for _ in range(2):
        with keeping(1.0):
            [found] = each_kept(make, [1.0], key=key)
        [entry] = folder.iterdir()
        entry.write_bytes(entry.read_bytes()[:-1])
    assert calls == [1.0, 1.0] and found.times_s[0] == 1.0 and "damaged" in caplog.text


def test_code_and_foreign_classes_are_made_again(tmp_path, caplog):
    results = KeptResults(tmp_path, 1 << 20)
    for key, wrong in zip(KEYS, (os.system, Foreign(1), kept.KeptEntries, partial(print, 1)), strict=False):
        results.write(key, wrong)
        caplog.clear()
        assert results.read(key) is None and "may run code" in caplog.text


def test_values_come_back_as_they_were(tmp_path):
    results = KeptResults(tmp_path, 1 << 20)
    value = (Path("a") / "b", [counts_at(1.0)], {"n": np.float64(2.0)}, np.zeros((2, 3)).T, np.array([]))
    results.write(KEYS[0], value)
    read = results.read(KEYS[0])
    assert kept.digest(read) == kept.digest(value) and isinstance(read[0], Path)
    assert read[3].flags.f_contiguous and read[3].flags.writeable


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
    entries = KeptEntries(tmp_path, 1 << 20, ".result")
    entries.write(KEYS[0], b"cchoreograph.core.counts\nCounts\n)\x81" + pickle.dumps(state, 2)[2:-1] + b"b.")
    assert KeptResults(tmp_path, 1 << 20).read(KEYS[0]) is None
    assert "the fields of another Counts" in caplog.text


def test_the_oldest_entries_are_removed_unless_they_were_used_here(tmp_path):
    first = KeptEntries(tmp_path, 3 * ENTRY, ".x")
    for number, key in enumerate(KEYS[:3]):
        first.write(key, bytes(100))
        os.utime(tmp_path / f"{key.hex()}.x", (number, number))
    second = KeptEntries(tmp_path, 3 * ENTRY, ".x")
    assert second.has(KEYS[0])  # the oldest
    second.write(KEYS[3], bytes(100))
    assert [second.read(key) is not None for key in KEYS] == [True, False, True, True, False, False]
    second.write(KEYS[4], bytes(100))  # all others were used
    assert second.read(KEYS[4]) is None and len(list(tmp_path.iterdir())) == 3


def test_an_entry_larger_than_the_bound_is_not_written(tmp_path):
    entries = KeptEntries(tmp_path, 2 * ENTRY, ".x")
    entries.write(KEYS[0], bytes(100))
    entries.write(KEYS[1], bytes(1000))
    assert entries.read(KEYS[1]) is None


def test_a_folder_that_cannot_be_written_is_said(tmp_path, caplog):
    KeptEntries(tmp_path / "gone", 1000, ".x").write(KEYS[0], b"1")
    assert "not kept" in caplog.text


def test_keys_are_those_of_functions_arguments_and_values():
    read = kept.program
    keys = [
        key_of(read), key_of(partial(read, 1)), key_of(partial(read, n=1)), key_of(kept.keeping),
        key_of(read, Path("a")), key_of(read, "a"), key_of(read, np.zeros(1)),
        key_of(read, np.zeros(1, "f4")),
    ]  # fmt: skip
    assert len(set(keys)) == len(keys) and key_of(read, Path("a")) == keys[4]
    assert key_of(counts_at, 1.0) is None  # of another package
