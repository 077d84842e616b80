"""Items that are kept for later calls are bounded in bytes. Those not used for longest leave first."""

from __future__ import annotations

import pickle

from choreograph.core.numerics import RecentItems


def test_kept_items_are_bounded_in_bytes_and_the_oldest_leave_first():
    kept: RecentItems[str] = RecentItems(4000)
    for index in range(6):
        kept.keep(index, f"item {index}", 1000)
        assert kept.get(0) == "item 0"  # used each time, so it stays
    assert [kept.get(index) for index in range(6)] == ["item 0", None, None, "item 3", "item 4", "item 5"]


def test_an_item_that_is_too_large_is_not_kept_and_removes_none():
    kept: RecentItems[str] = RecentItems(100)
    kept.keep("a", "small", 60)
    kept.keep("b", "large", 101)
    assert (kept.get("a"), kept.get("b")) == ("small", None)
    kept.keep("c", "fits", 40)
    assert (kept.get("a"), kept.get("c")) == ("small", "fits")


def test_an_item_replaces_that_of_its_key():
    kept: RecentItems[str] = RecentItems(100)
    kept.keep("a", "first", 60)
    kept.keep("a", "second", 70)
    assert (kept.get("a"), kept.n_bytes) == ("second", 70)
    kept.keep("a", "large", 101)
    assert (kept.get("a"), kept.n_bytes) == (None, 0)


def test_a_copy_is_empty():
    kept: RecentItems[str] = RecentItems(100)
    kept.keep("a", "small", 60)
    copy = pickle.loads(pickle.dumps(kept))
    assert copy.get("a") is None
    copy.keep("b", "small", 100)
    copy.keep("c", "large", 101)
    assert (copy.get("b"), copy.get("c")) == ("small", None)
