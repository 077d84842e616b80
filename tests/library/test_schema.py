"""Checks of repertoire files: what is just within a limit is read, and what is just beyond it is refused."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.core.errors import RepertoireError
from choreograph.library.schema import (
    WEIGHTS,
    StoredArray,
    check_clips,
    check_counts,
    check_finite,
    check_parts,
    check_provenance,
    check_quantisation,
    check_size,
    check_stored,
    check_text,
    check_values,
)

MIB = 1 << 20


def is_refused(check, *arguments, **options) -> str:
    """The message of a refusal, which is one line."""
    with pytest.raises(RepertoireError) as caught:
        check(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message and len(message) < 300
    return message


def stored(shape, *, name="body/density", dtype="f4", packed=None, filters=(), **options) -> StoredArray:
    """An array of a file that holds all of it, or `packed` bytes of it."""
    whole = int(np.prod(shape, dtype=object)) * np.dtype(dtype).itemsize
    options = {"is_quantised": False, "chunk": (), "is_elsewhere": False, **options}
    return StoredArray(
        name=name, dtype=np.dtype(dtype), shape=tuple(shape), filters=filters,
        n_stored_bytes=whole if packed is None else packed, **options,
    )  # fmt: skip


# How arrays are stored.


def test_an_array_that_is_not_packed_is_stored_in_full():
    check_stored(stored((250, 4)), "f4")
    message = is_refused(check_stored, stored((250, 4), packed=3999), "f4")
    assert "expected all of (250, 4), got 3,999 bytes" in message


@pytest.mark.parametrize("filters", [(1,), (2,), (3,), (1, 2, 3)])
def test_an_array_that_is_packed_claims_no_more_than_deflate_can_reach(filters):
    check_stored(stored((1032, 250), dtype="f4", packed=1000, filters=filters), "f4")
    assert "1,000 bytes" in is_refused(
        check_stored, stored((1032 * 250 + 1,), packed=1000, filters=filters), "f4"
    )


def test_no_size_of_a_header_overflows():
    claimed = stored((2**33, 2**31), dtype="f4", packed=1000, filters=(1,))
    assert claimed.n_bytes == 2**66
    assert "1,000 bytes" in is_refused(check_stored, claimed, "f4")
    assert "unpacked" in is_refused(check_size, [claimed], 1000)


def test_chunks_have_at_most_16_mib():
    check_stored(stored((2 * MIB, 4), chunk=(MIB, 4)), "f4")
    assert "at most 16,777,216 bytes, got 16,777,232" in is_refused(
        check_stored, stored((2 * MIB, 4), chunk=(MIB + 1, 4)), "f4"
    )


@pytest.mark.parametrize("n_file_bytes", [0, 1000, 5 * MIB])
def test_all_arrays_are_at_most_64_mib_and_16_times_the_file(n_file_bytes):
    limit = 64 * MIB + 16 * n_file_bytes
    half = stored((limit // 2,), dtype="u1")
    check_size([half, half], n_file_bytes)
    assert f"at most {limit:,} bytes unpacked, got {limit + 1:,}" in is_refused(
        check_size, [half, half, stored((1,), dtype="u1")], n_file_bytes
    )


@pytest.mark.parametrize("n_characters", [0, 100])
def test_a_long_text_makes_room_for_itself_in_a_few_rows_only(n_characters):
    """Each row is as long as the longest: 4 bytes a character, in a file as large as all the texts."""
    long = "x" * (64 * 1024 + 128)
    rows = next(
        n for n in range(100, 2000)
        if 4 * len(long) * n > 64 * MIB + 16 * (len(long) + (n - 1) * n_characters)
    )  # fmt: skip
    check_text("takes/notes", [long, *["a" * n_characters] * (rows - 2)])
    message = is_refused(check_text, "takes/notes", [long, *["a" * n_characters] * (rows - 1)])
    assert f"{rows} texts of up to 65,664 characters" in message
    check_text("takes/notes", [])


@pytest.mark.parametrize(
    ("array", "kind", "message"),
    [
        (stored((4,), dtype="f8"), "f4", "float32"),
        (stored((4,), dtype="f2", name="takes/fps"), "f4", "float32"),  # not one of half precision
        (stored((4,), dtype="f4"), "s", "uint8"),
        (stored((4, 4), dtype="u1"), "s", "bytes of texts"),
        (stored((4,), dtype="u4"), WEIGHTS, "float16"),
        (stored((4,), dtype="f4", filters=(1, 32000)), "f4", "32000"),
        (stored((4,), is_elsewhere=True), "f4", "another place"),
        (stored((4,), dtype="i2"), "f4", "float32"),  # as of a quantised array, but without a step
        (stored((4,), dtype="i2", is_quantised=True, name="takes/fps"), "f4", "float32"),
    ],
)
def test_an_array_of_another_kind_is_refused(array, kind, message):
    assert message in is_refused(check_stored, array, kind)


@pytest.mark.parametrize(
    ("array", "kind"),
    [
        (stored((4,), dtype="u1"), "s"),
        (stored((4, 4), dtype="i8"), WEIGHTS),
        (stored((4, 96), dtype="f2", name="motifs/embeddings"), "f4"),
        (stored((4, 24, 4), dtype="i2", is_quantised=True, name="motion/local_quat"), "f4"),
        (stored((0,)), "f4"),
    ],
)
def test_every_way_in_which_this_program_stores_arrays_is_read(array, kind):
    check_stored(array, kind)


# Values.


SIZES = {"X": 3, "M": 100, "K": 5}


@pytest.mark.parametrize(
    ("name", "least", "most", "beyond"),
    [
        ("takes/motion_stop", 0, 100, 1),  # an end: the length itself
        ("clips/take", 0, 2, 1),  # an index: the last one
        ("motifs/word_motif", 0, 4, 1),
        ("takes/metre", 0, 12, 1),
        ("takes/fps", 1e-3, 1000.0, 1e-4),
        ("takes/counts_confidence", 0.0, 1.0, 1e-6),
        ("motion/local_quat", -12.0, 12.0, 1e-3),
        ("clips/step_rank", 0.0, 1.0, 1e-6),
    ],
)
def test_values_reach_to_their_limits_and_no_further(name, least, most, beyond):
    check_values(name, np.array([least, most]), SIZES)
    for wrong in (least - beyond, most + beyond):
        assert name in is_refused(check_values, name, np.array([least, wrong, most]), SIZES)
    if isinstance(most, float):
        assert name in is_refused(check_values, name, np.array([least, np.nan]), SIZES)
    check_values(name, np.zeros(0), SIZES)


def test_shares_sum_to_one_in_every_row():
    check_values("motifs/signatures", np.array([[0.25, 0.75], [1.0, 0.0]]), {})
    for wrong in ([0.25, 0.7], [0.5, 0.6]):
        message = is_refused(check_values, "motifs/signatures", np.array([[1.0, 0.0], wrong]), {})
        assert "sum to 1" in message
    check_values("clips/style", np.array([[0.25, 0.7]]), {})


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_weights_are_finite(value):
    check_finite("nets/words/out.weight", np.array([1e30, -1.0]))
    assert "finite" in is_refused(check_finite, "nets/words/out.weight", np.array([0.0, value]))


GOOD = {"step": np.float64(1e-4), "order": np.int64(2), "restart": np.int64(8192), "folded": np.True_}


@pytest.mark.parametrize("step", [np.float64(1e-9), np.float32(1.0)])
def test_a_step_reaches_to_its_limits(step):
    check_quantisation("motion/root_pos_m", {**GOOD, "step": step})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("step", np.float64(0.9e-9)), ("step", np.float64(1.001)), ("step", np.float64(np.nan)),
        ("step", np.int64(1)), ("step", None), ("order", np.int64(1)), ("order", np.float64(2.0)),
        ("restart", np.int64(8191)), ("folded", np.False_), ("folded", None),
    ],
)  # fmt: skip
def test_another_encoding_is_refused(name, value):
    assert name in is_refused(check_quantisation, "motion/root_pos_m", {**GOOD, name: value})


# Relations between arrays.


def test_a_clip_ends_with_its_take_at_the_latest():
    """Of 160 frames, in takes of 160 and 400."""
    takes, n_frames = np.array([0, 1, 1]), np.array([160, 400])
    check_clips(takes, np.array([0, 0, 240]), n_frames)
    for starts in ([1, 0, 240], [0, 241, 0], [0, 0, 399]):
        assert "beyond the ends" in is_refused(check_clips, takes, np.array(starts), n_frames)
    check_clips(np.zeros(0, int), np.zeros(0, int), n_frames)


@pytest.mark.parametrize(
    ("starts", "stops"),
    [
        ([0, 5], [5, 9]),  # not to the end
        ([0, 5], [5, 11]),
        ([1, 5], [5, 10]),  # not from the start
        ([0, 6], [5, 10]),  # a gap
        ([0, 4], [5, 10]),  # an overlap
        ([0, 9], [9, 10]),  # shorter than 2
        ([], []),
    ],
)
def test_parts_of_takes_cover_all_rows_in_order(starts, stops):
    check_parts("beat", np.array([0, 8]), np.array([8, 10]), 10, shortest=2)
    check_parts("beat", np.array([0, 0]), np.array([0, 10]), 10, shortest=0)
    parts = np.array(starts, int), np.array(stops, int)
    assert "10 rows" in is_refused(check_parts, "beat", *parts, 10, shortest=2)


@pytest.mark.parametrize(
    ("times_s", "numbers", "metre"),
    [
        ([0.0, 0.0], [1, 2], 4),
        ([0.5, 0.4], [1, 2], 4),
        ([0.0, 0.5], [4, 5], 4),
        ([0.0, 0.5], [0, 1], 4),  # 0 is of counts without bars
        ([0.0, 0.5], [0, 1], 0),
    ],
)
def test_counts_increase_and_are_numbered_in_their_bars(times_s, numbers, metre):
    check_counts("take", np.array([0.0, 0.1, 0.2, 0.3]), np.array([1, 2, 3, 4]), 4)
    check_counts("take", np.array([0.0, 0.1]), np.array([0, 0]), 0)
    check_counts("take", np.zeros(0), np.zeros(0, int), 4)
    assert "'take'" in is_refused(check_counts, "take", np.array(times_s), np.array(numbers), metre)


@pytest.mark.parametrize(
    "provenance",
    [
        {"trained_on": "song"}, {"trained_on": ["song", 5]}, {"selection_beat_weight": "x"},
        {"selection_beat_weight": -0.1}, {"selection_beat_weight": 1.1e6}, {"selection_beat_weight": None},
        {"selection_beat_weight": float("nan")},
    ],
)  # fmt: skip
def test_provenance_of_another_type_is_refused(provenance):
    check_provenance({})
    check_provenance({"trained_on": [], "selection_beat_weight": 0})
    check_provenance({"trained_on": ["song"], "selection_beat_weight": 1e6})
    assert next(iter(provenance)) in is_refused(check_provenance, provenance)
