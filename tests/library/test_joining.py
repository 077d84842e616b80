"""Takes of a file joined with new ones: the arrays and the notes are those of all takes at once."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_repertoire import synthetic_takes, with_counts

from choreograph.core.counts import FROM_MOTION
from choreograph.library.building.joining import TakeOrigin, TakeRows, joined_arrays, joined_notes
from choreograph.library.derived import with_derived
from choreograph.library.notes import Note
from choreograph.library.schema import Contents
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import to_arrays, write_repertoire
from choreograph.music.song_features import motion_density

PERIODS_S = (0.5, 0.6, 0.75, 0.55, 0.65)


@pytest.fixture(scope="module")
def takes():
    """Five takes of different lengths: counted with figures, not counted, and counted by a network."""
    made = [
        synthetic_takes(periods_s=[period_s], duration_s=9.0 + 2 * index, genres=[genre])[0]
        for index, (period_s, genre) in enumerate(zip(PERIODS_S, "abaca", strict=True))
    ]
    named = [replace(m, take=replace(m.take, name=f"take{i}")) for i, m in enumerate(made)]
    counted = with_counts(named, PERIODS_S)
    estimated = counted[3].take.counts
    by_network = replace(estimated, source=FROM_MOTION, uncertainty=np.linspace(0, 0.2, len(estimated)))
    counted[3] = replace(counted[3], take=replace(counted[3].take, counts=by_network))
    return [counted[0], named[1], *counted[2:]]


def arrays_of(takes, *, compress):
    """The arrays of takes. A file of every take has two sources."""
    arrays = to_arrays(
        takes,
        embed_motion=lambda pos, starts: pos[starts, :11].reshape(len(starts), -1)[:, :32],
        density=lambda m: motion_density(len(m.body_pos_m), m.motion_beats_s),
        checksums=[
            (f"{m.take.name}.{kind}", "0" * 64, i) for i, m in enumerate(takes) for kind in ("bvh", "wav")
        ],
    )
    return with_derived(arrays, compress=compress)


def write(path, arrays, *, compress):
    write_repertoire(path, Contents(arrays, "analytic", {"preset": "none"}), compress=compress)
    return path.read_bytes()


OLD = (0, 1, 2)
ORDERS = {  # of which takes the result consists, and which of these are new
    "added": ([0, 1, 2, 3, 4], {3, 4}),
    "removed": ([0, 2], set()),
    "the first removed": ([1, 2], set()),
    "replaced": ([0, 3, 2], {3}),
    "all at once": ([4, 2, 3], {3, 4}),
    "all replaced": ([3], {3}),
    "nothing": ([0, 1, 2], set()),
}


@pytest.mark.parametrize("compress", [False, True], ids=["plain", "compressed"])
@pytest.mark.parametrize("case", ORDERS)
def test_joined_takes_have_the_bytes_of_all_takes_at_once(tmp_path, takes, case, compress):
    wanted, new = ORDERS[case]
    write(tmp_path / "old.h5", arrays_of([takes[i] for i in OLD], compress=compress), compress=compress)
    file = RepertoireFile(tmp_path / "old.h5")
    number = {take: index for index, take in enumerate(sorted(new))}
    added = arrays_of([takes[i] for i in number], compress=compress) if new else {}
    order = [TakeOrigin(i in new, number.get(i, i)) for i in wanted]
    joined = joined_arrays(TakeRows(file, added, len(number), order), file, added)
    at_once = arrays_of([takes[i] for i in wanted], compress=compress)
    expected = write(tmp_path / "at_once.h5", at_once, compress=compress)
    assert write(tmp_path / "joined.h5", joined, compress=compress) == expected


NAMES = ("a", "b", "c")


def told(old, new, names=NAMES, *, gone=(), files=(), counted=None):
    is_counted = np.array([True] * len(names) if counted is None else counted)
    return joined_notes(old, new, names, gone=gone, files=files, is_counted=is_counted)


def no_counts(name):
    return Note("no counts", name)


def imported(name):
    return Note("import", name, {"text": "read as inches"})


def test_notes_are_in_the_order_of_a_build_of_all_takes():
    old = [imported("a"), imported("c"), no_counts("a"), no_counts("c"), Note("uncounted danced")]
    new = [imported("b"), no_counts("b"), Note("uncounted danced")]
    expected = [*map(imported, "abc"), *map(no_counts, "abc")]
    assert told(old, new, counted=[False] * 3) == [
        *expected, Note("uncounted danced"),
    ]  # fmt: skip
    assert told(old, new, counted=[True, False, False]) == [*expected, Note("uncounted left out")]
    assert told(old, new) == expected


def test_notes_on_what_is_gone_are_left_out():
    song = Note("song", "waltz.ogg", {"text": "damaged"})
    old = [imported("a"), imported("b"), song, Note("unknown take", "c")]
    assert told(old, [], ("a", "c"), gone={"b"}, files=["x/waltz.ogg"]) == [imported("a"), song]
    assert told(old, [imported("b")], gone={"b"}) == [imported("a"), imported("b")]
    bad = Note("unreadable file", "new/c.bvh", {"text": "no header"})
    assert told([bad], [], ("a", "b")) == [bad]
    assert told([bad], [], NAMES) == []  # it has been read since


def test_a_note_on_a_song_or_a_build_is_not_repeated():
    song, networks = (
        Note("song", "x.ogg", {"text": "damaged"}),
        Note("counting networks", values={"networks": "n"}),
    )
    assert told([networks, song], [networks, song], files=["x.ogg"]) == [networks, song]
