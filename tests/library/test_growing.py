"""Takes added to a repertoire, replaced and removed: the file is that of a build of all takes at once."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_repertoire import (
    synthetic_contents,
    synthetic_repertoire,
    synthetic_takes,
    with_counts,
    with_vocabulary,
)

import choreograph as cg
from choreograph.core.counts import FROM_MOTION
from choreograph.core.errors import ChoreographError, ParameterError, RepertoireError
from choreograph.core.files import folder_beside, locked_folder
from choreograph.formats.register import save_motion
from choreograph.library.building.growing import (
    TakeOrigin,
    TakeRows,
    joined_arrays,
    joined_notes,
    novelty_notes,
)
from choreograph.library.building.words import WordTable
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.derived import with_derived
from choreograph.library.notes import Note
from choreograph.library.schema import NetArrays
from choreograph.library.store import RepertoireFile
from choreograph.library.writing import Contents, to_arrays, write_repertoire
from choreograph.music.song_features import motion_density

# Takes added to a repertoire, replaced and removed: the file is that of a build of all takes at once.


A, B = ("one", "two"), ("three", "four")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Folders A and B of two takes each, with and without music, and a folder of another take `one`."""
    root = tmp_path_factory.mktemp("sources")
    starter = cg.Repertoire.open(STARTER_PATH)

    def put(folder, name, take, start_s, stop_s, song=None):
        (root / folder).mkdir(exist_ok=True)
        motion, _ = starter.motion(take, start_s=start_s, stop_s=stop_s)
        save_motion(root / folder / f"{name}.bvh", motion)
        if song is not None:
            shutil.copy(cg.example_songs()[song], root / folder / f"{name}.ogg")

    put("A", "one", 0, 0, 16, "cha-cha")
    put("A", "two", 20, 5, 18)
    put("B", "three", 60, 0, 14, "house")
    (root / "B" / "three.counts.csv").write_text(
        "time_s,number\n" + "".join(f"{i / 2},{i % 4 + 1}\n" for i in range(24))
    )
    put("B", "four", 100, 0, 10)
    put("other", "one", 4, 2, 13)
    return root


def build(sources, output, init, **options):
    return cg.build(sources, output, init_from=init, keep_networks=True, workers=1, **options).path


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "compressed"])
def law(request, folders, tmp_path_factory):
    """How to build with the networks and motifs of a repertoire of A, and what that makes of A."""
    folder, options = tmp_path_factory.mktemp("law"), {"compress": request.param}
    init = build(folders / "A", folder / "init.h5", STARTER_PATH, **options)

    def build_kept(sources, output):
        return build(sources, output, init, **options)

    return build_kept, build_kept(folders / "A", folder / "base.h5"), init


@pytest.mark.slow
def test_changed_repertoires_have_the_bytes_of_builds_of_all_takes(law, folders, tmp_path):
    build_kept, base, init = law
    before = base.read_bytes()
    expected = build_kept([folders / "A", folders / "B"], tmp_path / "all.h5").read_bytes()
    of_init = RepertoireFile(cg.change_takes(init, add=folders / "B", output=tmp_path / "init.h5").path)
    at_once = RepertoireFile(tmp_path / "all.h5")
    for name, array in at_once.arrays().items():
        np.testing.assert_array_equal(of_init.read(name), array)
    # It states how the networks were made that it keeps, as before.
    assert of_init.provenance["init_from"] == STARTER_PATH.name != at_once.provenance["init_from"]

    grown = tmp_path / "grown.h5"
    added = cg.change_takes(base, add=folders / "B", output=grown, workers=1)
    assert grown.read_bytes() == expected and base.read_bytes() == before
    assert any("farther from every motif than 95%" in note for note in added.notes)
    added.repertoire.verify()

    one_by_one = tmp_path / "one_by_one.h5"
    shutil.copy(base, one_by_one)
    for leave_out in (("four",), ("three",)):
        cg.change_takes(one_by_one, add=folders / "B", leave_out=leave_out, workers=1)
    again = cg.Repertoire.open(one_by_one)
    assert [take.name for take in again.takes] == [*A, "three", "four"]  # in the order of the additions

    mixed = tmp_path / "mixed"
    mixed.mkdir()
    for path in (*(folders / "A").glob("two.*"), folders / "other" / "one.bvh"):
        shutil.copy(path, mixed)
    expected = build_kept([mixed, folders / "B"], tmp_path / "mixed.h5").read_bytes()
    cg.change_takes(grown, replace=folders / "other", workers=1)
    assert grown.read_bytes() == expected

    cg.change_takes(grown, replace=folders / "A", leave_out=["two"], remove=B, workers=1)
    assert [take.name for take in cg.Repertoire.open(grown).takes] == list(A)


@pytest.mark.slow
def test_removed_takes_leave_what_a_build_without_them_makes(law, folders, tmp_path):
    build_kept, base, _ = law
    build_kept([folders / "A", folders / "B"], tmp_path / "all.h5")
    cg.change_takes(tmp_path / "all.h5", remove=B)
    assert (tmp_path / "all.h5").read_bytes() == base.read_bytes()
    lacking = cg.change_takes(base, remove=["two"], output=tmp_path / "less.h5")
    assert lacking.repertoire.vocabulary.n_motifs < cg.Repertoire.open(base).vocabulary.n_motifs
    assert any("not danced any more" in note for note in lacking.notes)
    cg.dance(cg.example_songs()["cha-cha"], lacking.repertoire, duration_s=8.0, engine="mixer")


@pytest.mark.slow
def test_clips_of_a_library_without_motifs_are_compared_by_their_style(folders, tmp_path):
    options = {"keep_networks": True, "words": False, "workers": 1}
    base = cg.build(folders / "A", tmp_path / "base.h5", **options)
    at_once = cg.build([folders / "A", folders / "B"], tmp_path / "all.h5", **options)
    grown = cg.change_takes(base.path, add=folders / "B", workers=1)
    assert grown.path.read_bytes() == at_once.path.read_bytes()
    assert any("farther in style" in note for note in grown.notes)


@pytest.fixture
def small(tmp_path):
    """A repertoire of the takes take0 to take2 without networks, and a folder with a take `new`."""
    path = synthetic_repertoire(tmp_path / "rep.h5", with_counts(synthetic_takes(duration_s=10.0))).path
    folder = tmp_path / "new"
    folder.mkdir()
    save_motion(folder / "new.bvh", synthetic_takes(duration_s=9.0)[1].take.motion)
    return path, folder


def test_the_file_is_replaced_as_a_whole_or_not_at_all(small, tmp_path, monkeypatch):
    path, folder = small
    before = path.read_bytes()
    changed = cg.change_takes(path, add=folder, remove=["take1"])
    assert [take.name for take in changed.repertoire.takes] == ["take0", "take2", "new"]
    changed.repertoire.verify()
    assert changed.path == path and sorted(p.name for p in tmp_path.iterdir()) == ["new", "rep.h5"]

    path.write_bytes(before)
    monkeypatch.setattr(Path, "replace", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        cg.change_takes(path, remove=["take1"])
    assert path.read_bytes() == before and sorted(p.name for p in tmp_path.iterdir()) == ["new", "rep.h5"]


def test_only_new_takes_are_measured(small, monkeypatch):
    path, folder = small
    measured = []
    from choreograph.library.building import takes

    real = takes.measure_take
    monkeypatch.setattr(takes, "measure_take", lambda take: measured.append(take.name) or real(take))
    old = cg.Repertoire.open(path).body_pos_m(2)
    changed = cg.change_takes(path, add=folder, workers=1).repertoire
    assert measured == ["new"]
    np.testing.assert_array_equal(changed.body_pos_m(2), old)


def test_takes_on_another_skeleton_are_moved_onto_that_of_the_repertoire(small, tmp_path):
    path, _ = small
    motion, _ = cg.starter_repertoire().motion(0, stop_s=9.0)
    (tmp_path / "rig").mkdir()
    save_motion(tmp_path / "rig" / "other.bvh", motion)
    skeleton = cg.Repertoire.open(path).skeleton
    assert not motion.skeleton.same_as(skeleton)
    changed = cg.change_takes(path, add=tmp_path / "rig")
    assert changed.repertoire.skeleton.same_as(skeleton)
    assert any("retargeted to that of the repertoire" in note for note in changed.notes)


def test_genres_that_the_networks_have_not_seen_are_named(law, folders, tmp_path):
    _, base, _ = law
    (tmp_path / "polka").mkdir()
    shutil.copy(folders / "B" / "four.bvh", tmp_path / "polka" / "five.bvh")
    (tmp_path / "polka" / "manifest.csv").write_text("name,genre\nfive,polka\n")
    changed = cg.change_takes(base, add=tmp_path / "polka", output=tmp_path / "out.h5")
    assert any("without polka" in note and "--init-from" in note for note in changed.notes)


def test_takes_that_were_left_out_are_not_held_out_any_more(small):
    path, folder = small
    shutil.copy(folder / "new.bvh", folder / "also.bvh")
    changed = cg.change_takes(path, add=folder, leave_out=["new", "other"]).repertoire
    assert changed.provenance["left_out"] == ["new", "other"] and changed.takes[-1].name == "also"
    changed = cg.change_takes(path, add=folder / "new.bvh").repertoire
    assert changed.provenance["left_out"] == ["other"] and changed.takes[-1].name == "new"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "takes to add, to replace or to remove"),
        ({"remove": ["take0", "gone"]}, "no 'gone'"),
        ({"remove": ["take0", "take1", "take2"]}, "a take that is left"),
        ({"replace": "new"}, "no 'new'"),
        ({"add": "known"}, "the repertoire has 'take0'"),
        ({"replace": "known", "remove": ["take0"]}, "two of 'take0'"),
        ({"add": "new", "preset": "tiny"}, "build the repertoire again"),
        ({"remove": "take0"}, "texts"),
        ({"remove": ["take0"], "output": "rep.h5"}, "it is an input"),
    ],
)
def test_changes_that_do_not_fit_are_refused(small, tmp_path, monkeypatch, changes, says):
    path, folder = small
    monkeypatch.chdir(tmp_path)
    (tmp_path / "known").mkdir()
    shutil.copy(folder / "new.bvh", tmp_path / "known" / "take0.bvh")
    before = path.read_bytes()
    with pytest.raises(ParameterError, match=says):
        cg.change_takes(path, **changes)
    assert path.read_bytes() == before


def test_no_other_process_changes_the_file_at_once(small):
    path, _ = small
    with locked_folder(folder_beside(path, ".build"), doing="builds rep.h5"), pytest.raises(ChoreographError):
        cg.change_takes(path, remove=["take0"])


def test_a_repertoire_that_was_opened_before_a_change_has_to_be_opened_again(small):
    path, _ = small
    before = cg.Repertoire.open(path)
    assert len(before.takes) == 3 and before.body_pos_m(0).any()
    cg.change_takes(path, remove=["take0"])
    for read in (before.body_pos_m, before.motion):
        with pytest.raises(RepertoireError, match="open it again"):
            read(0)
    assert cg.Repertoire.open(path).takes[0].name == "take1"


def test_options_of_the_build_that_are_not_valid_are_damage(tmp_path):
    contents = synthetic_contents(synthetic_takes(duration_s=10.0))
    provenance = {**contents.provenance, "beats": "none of these"}
    write_repertoire(tmp_path / "rep.h5", replace(contents, provenance=provenance))
    with pytest.raises(RepertoireError, match=r"rep\.h5: provenance: .*none of these"):
        cg.change_takes(tmp_path / "rep.h5", remove=["take0"])


def test_a_damaged_repertoire_is_not_replaced(small, tmp_path):
    path, folder = small
    path.write_bytes(path.read_bytes()[:4000])
    with pytest.raises(RepertoireError):
        cg.change_takes(path, add=folder)
    assert path.stat().st_size == 4000


# Takes of a file joined with new ones: the arrays and the notes are those of all takes at once.


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


# How far new takes are from those before: planted takes that are the same, and ones that are far.


@pytest.fixture(scope="module")
def with_motifs(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("novelty") / "rep.h5", vocabulary=True)


def of_words(repertoire, *, scale=1.0, genres=("a",)):
    """The notes on a take with the words of the first one, or on larger ones."""
    v = repertoire.vocabulary
    own = v.words_of_take(0)
    words = WordTable(v.word_take[own], v.word_start_s[own], v.word_end_s[own], ["new"], list(genres))
    return novelty_notes(repertoire, genres, np.zeros((0, 32)), words, [scale * repertoire.body_pos_m(0)])


def test_words_of_a_take_that_is_there_are_as_near_as_those_before(with_motifs):
    [note] = of_words(with_motifs)
    assert note.kind == "farther words" and note.values["share"] < 0.2
    assert note.values["new"] < 2 * note.values["known"]


def test_words_of_a_giant_are_far(with_motifs):
    [note] = of_words(with_motifs, scale=3.0)
    assert note.values["share"] == 1.0 and note.values["new"] > 5 * note.values["known"]
    assert "100% are farther from every motif than 95%" in str(note)


def test_genres_are_new_if_no_take_has_them(with_motifs):
    _, note = of_words(with_motifs, genres=("a", "polka", "", "jig"))
    assert "without jig, polka" in str(note) and "rep.h5" in str(note)


def test_only_takes_that_the_networks_were_trained_on_are_known(tmp_path):
    takes = synthetic_takes()
    contents = with_vocabulary(synthetic_contents(takes), takes)
    write_repertoire(
        tmp_path / "rep.h5", replace(contents, provenance={**contents.provenance, "trained_on": ["song1"]})
    )
    _, note = of_words(cg.Repertoire.open(tmp_path / "rep.h5"), genres=("a", "b"))
    assert "without a:" in str(note)  # the genre of another take, which was added later


def test_without_motifs_clips_are_compared_by_their_style(tmp_path):
    contents = synthetic_contents(synthetic_takes(duration_s=14.0))
    nets = {"style": NetArrays({}, {"w": np.zeros(3, np.float32)})}
    write_repertoire(tmp_path / "rep.h5", replace(contents, nets=nets))
    repertoire = cg.Repertoire.open(tmp_path / "rep.h5")
    style = repertoire.clip_style

    def share(new):
        [note] = novelty_notes(repertoire, ["a"], new, WordTable.of([]), [])
        assert note.kind == "farther clips"
        return note.values["share"]

    assert share(style) == 0.0 and share(style + 100.0) == 1.0
    assert novelty_notes(repertoire, ["a"], style[:0], WordTable.of([]), []) == []
