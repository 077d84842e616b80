"""Several files that are read as one have the arrays, and give the dances, of one file of all takes."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping
from synthetic_repertoire import (
    synthetic_contents,
    synthetic_takes,
    with_counts,
    with_vocabulary,
    write_clicks,
)

import choreograph as cg
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.formats.register import save_motion
from choreograph.library.catalogue import (
    RepertoireShards,
    add_files,
    create_library,
    merge_library,
    open_files,
    remove_files,
)
from choreograph.library.schema import layout_of
from choreograph.library.store import RepertoireFile
from choreograph.library.vocabulary import Motifs, make_vocabulary, motif_arrays
from choreograph.library.writing import Contents, write_repertoire

PERIODS_S = (0.5, 0.6, 0.75, 0.5)
GENRES = ("a", "b", "a", "c")
RANGES = {"M": "motion", "B": "body", "Q": "beat", "U": "count"}
TAKE_OF = {"N": "clips/take", "C": "sources/take", "F": "figures/take", "W": "motifs/word_take"}


def part_of(contents: Contents, first: int, stop: int) -> Contents:
    """The contents with the takes `first` to `stop` alone, and all motifs."""
    arrays = contents.arrays
    rows = {"X": slice(first, stop)}
    for axis, part in RANGES.items():
        rows[axis] = slice(arrays[f"takes/{part}_start"][first], arrays[f"takes/{part}_stop"][stop - 1])
    for axis, name in TAKE_OF.items():
        rows[axis] = slice(*np.searchsorted(arrays[name], [first, stop]))
    part = {}
    for name, (_, axes, *_) in layout_of(arrays).items():
        if name in arrays:
            part[name] = arrays[name][rows.get(axes.split()[0], slice(None))]
    for axis, name in RANGES.items():
        for end in ("start", "stop"):
            part[f"takes/{name}_{end}"] = part[f"takes/{name}_{end}"] - rows[axis].start
    for name in TAKE_OF.values():
        part[name] = part[name] - first
    provenance = {**contents.provenance, "motifs": "0" * 32}  # the set that the motifs are of
    return replace(contents, arrays=part | with_own_motifs(part), provenance=provenance)


def with_own_motifs(arrays):
    """The vocabulary of the words of some takes: the motifs that they have."""
    counts = np.bincount(arrays["motifs/word_motif"], minlength=len(arrays["motifs/counts"]))
    danced = np.flatnonzero(counts)
    motif = np.searchsorted(danced, arrays["motifs/word_motif"])
    medoids = [np.flatnonzero(motif == number)[0] for number in range(len(danced))]
    motifs = Motifs(arrays["motifs/embeddings"][danced], np.array(medoids), counts[danced])
    words = (arrays[f"motifs/word_{of}"] for of in ("take", "start_s", "end_s"))
    return motif_arrays(make_vocabulary(motifs, motif, *words, arrays["takes/genre"].tolist()))


@pytest.fixture(scope="module")
def contents():
    takes = with_counts(synthetic_takes(periods_s=PERIODS_S, genres=GENRES), PERIODS_S)
    return with_vocabulary(synthetic_contents(takes), takes)


@pytest.fixture(scope="module")
def whole(contents, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "whole.h5"
    write_repertoire(path, contents)
    return path


@pytest.fixture(scope="module")
def folder(contents, tmp_path_factory):
    """A folder of three files: of one take, of two, and of one."""
    folder = tmp_path_factory.mktemp("archive")
    for name, (first, stop) in {"a.h5": (0, 1), "b.h5": (1, 3), "c.h5": (3, 4)}.items():
        write_repertoire(folder / name, part_of(contents, first, stop))
    return folder


def test_all_arrays_are_those_of_one_file(whole, folder):
    one, several = RepertoireFile(whole), open_files([folder])
    assert isinstance(several, RepertoireShards)
    assert several.names == one.names
    for name in one.names:
        if name in ("provenance", "motifs/words"):  # medoids of the parts are other words
            continue
        assert np.array_equal(several.read(name), one.read(name)), name
        if name in several.shapes:
            assert several.shapes[name] == one.shapes[name]
            rows = np.random.default_rng(0).integers(0, one.shapes[name][0], size=(5, 2))
            assert np.array_equal(several.rows(name, rows), one.rows(name, rows)), name
            assert np.array_equal(several.read(name, slice(1, 4)), one.read(name, slice(1, 4))), name
            assert np.array_equal(several.read_rows(name, 0, 3), one.read_rows(name, 0, 3)), name


@pytest.mark.parametrize("engine", ["graph", "mixer"])
def test_dances_are_those_of_one_file(whole, folder, tmp_path, engine):
    song = cg.load_song(write_clicks(tmp_path / "clicks.wav", duration_s=12.4))
    one, several = (cg.dance(song, cg.Repertoire.open(path), engine=engine) for path in (whole, folder))
    assert replace(several.plan, repertoire="") == replace(one.plan, repertoire="")
    assert np.array_equal(several.motion.local_quat, one.motion.local_quat)
    assert np.array_equal(several.motion.root_pos_m, one.motion.root_pos_m)


def test_files_and_folders_are_given_in_any_number(folder, whole):
    files = sorted(folder.glob("*.h5"))
    assert [take.name for take in cg.Repertoire.open(files).takes] == ["take0", "take1", "take2", "take3"]
    assert cg.Repertoire.open(files).path.name == "a.h5+b.h5+c.h5"
    assert cg.Repertoire.open(folder).path == folder
    assert cg.Repertoire.open(folder).paths == tuple(files)
    assert cg.Repertoire.open([whole]).path == whole
    reverse = cg.Repertoire.open([files[2], files[0]])
    assert [take.name for take in reverse.takes] == ["take3", "take0"]
    assert reverse.take_index("take0") == 1


def test_files_with_and_without_uncertain_counts_and_poses(contents, tmp_path):
    """Counts without uncertainty are certain. Poses that one file lacks are made from its positions."""
    first, second = part_of(contents, 0, 2), part_of(contents, 2, 4)
    doubt = np.full(len(first.arrays["counts/time_s"]), 0.25, np.float32)
    write_repertoire(tmp_path / "a.h5", replace(first, arrays={**first.arrays, "counts/doubt": doubt}))
    write_repertoire(tmp_path / "b.h5", second)
    both = cg.Repertoire.open(tmp_path)
    assert (both.counts(0).uncertainty == 0.25).all() and (both.counts(2).uncertainty == 0).all()
    assert "poses" in both._file.parts


def test_every_file_is_verified(folder, tmp_path):
    for path in folder.glob("*.h5"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    seen = []
    open_files([tmp_path]).verify(lambda *done: seen.append(done))
    assert seen == [(1, 3), (2, 3), (3, 3)]
    damaged = tmp_path / "b.h5"
    with open(damaged, "r+b") as file:
        file.seek(damaged.stat().st_size // 2)
        file.write(b"\xff" * 64)
    with pytest.raises(RepertoireError, match=r"b\.h5"):
        open_files([tmp_path]).verify()


def test_a_library_is_created_changed_and_merged(folder, whole, tmp_path):
    a, b, c = sorted(folder.glob("*.h5"))
    assert len(create_library(tmp_path / "lib", [a, b]).read("takes/name")) == 3
    assert len(add_files(tmp_path / "lib", [c]).read("takes/name")) == 4
    merged, one = merge_library([tmp_path / "lib"], tmp_path / "all.h5"), RepertoireFile(whole)
    assert merged.names == one.names and merged.provenance["motifs"] == "0" * 32
    for name in one.names:
        if name not in ("provenance", "motifs/words"):  # medoids of the parts are other words
            assert np.array_equal(merged.read(name), one.read(name)), name
    assert len(remove_files(tmp_path / "lib", ["b", "c.h5"]).read("takes/name")) == 1
    assert [path.name for path in (tmp_path / "lib").iterdir()] == ["a.h5"] and b.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.h5", "lib"]


def test_a_library_of_compressed_files_is_merged_to_a_compressed_one(contents, tmp_path):
    for name, (first, stop) in {"a.h5": (0, 2), "b.h5": (2, 4)}.items():
        write_repertoire(tmp_path / name, part_of(contents, first, stop), compress=True)
    merged = merge_library([tmp_path / "a.h5", tmp_path / "b.h5"], tmp_path / "all.h5")
    assert "poses" not in merged.parts
    assert np.array_equal(
        merged.read("body/pos_m"), open_files([tmp_path / "a.h5", tmp_path / "b.h5"]).read("body/pos_m")
    )


def test_changes_that_break_a_library_are_refused(folder, contents, tmp_path):
    a, b, _ = sorted(folder.glob("*.h5"))
    create_library(tmp_path / "lib", [a, b])
    wrong = tmp_path / "wrong.h5"
    write_repertoire(wrong, replace(part_of(contents, 2, 4), density="learned"))
    (tmp_path / "copy.h5").write_bytes(a.read_bytes())
    lib = tmp_path / "lib"
    for change, kind, says in (
        (lambda: add_files(lib, [wrong]), RepertoireError, "wrong.h5: expected the tempo-density of a.h5"),
        (
            lambda: add_files(lib, [tmp_path / "copy.h5"]),
            RepertoireError,
            "expected takes that a.h5 does not",
        ),
        (lambda: add_files(lib, [a]), ParameterError, "expected files with new names, but there is"),
        (lambda: add_files(tmp_path / "none", [a]), ParameterError, "expected the folder of a library"),
        (lambda: create_library(lib, [a]), ParameterError, "expected a new folder, .* is a library"),
        (lambda: remove_files(lib, ["x"]), ParameterError, "expected files of .*, got 'x': it has a, b"),
        (lambda: remove_files(lib, ["a", "b"]), ParameterError, "expected a file that is left"),
        (lambda: merge_library([lib], lib / "a.h5"), ParameterError, "it is an input"),
    ):
        with pytest.raises(kind, match=says):
            change()
    assert sorted(path.name for path in lib.iterdir()) == ["a.h5", "b.h5"]


def test_the_commands_of_a_library(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    a, b, c = sorted(folder.glob("*.h5"))
    for arguments, says in (
        (("create", "lib", a), "lib: 1 take,"), (("add", "lib", b, c), "lib: 4 takes,"),
        (("remove", "lib", "c"), "lib: 3 takes,"), (("check", "lib"), "lib: 3 takes, .*checksum is right"),
        (("merge", "lib", "-o", "all.h5"), "all.h5: 3 takes,"),
    ):  # fmt: skip
        shown = run("library", *arguments)
        assert shown.exit_code == 0 and re.match(says, shown.stdout), shown.output
    assert_one_line(run("library", "add", "lib", "gone.h5"), says="gone.h5")


def test_files_that_do_not_fit_are_refused_by_name(contents, folder, tmp_path):
    other = part_of(contents, 2, 4)
    of_another_set = {**other.provenance, "motifs": "1" * 32}
    longer = {**other.arrays, "skeleton/offsets_m": other.arrays["skeleton/offsets_m"] * 2}
    for number, (what, wrong) in enumerate(
        {
            "motifs": replace(other, provenance=of_another_set), "skeleton": replace(other, arrays=longer),
            "tempo-density": replace(other, density="learned"), "networks": replace(other, nets={}),
        }.items()
    ):  # fmt: skip
        path = tmp_path / f"{number}.h5"
        if what == "networks":
            wrong = replace(wrong, arrays={n: a for n, a in wrong.arrays.items() if "motifs/" not in n})
        write_repertoire(path, wrong)
        with pytest.raises(
            RepertoireError, match=f"{number}.h5: expected the {what} of a.h5, got another: .*build"
        ):
            cg.Repertoire.open([folder / "a.h5", path])


def test_a_take_in_two_files_and_a_folder_without_files_are_refused(folder, tmp_path):
    for one, two in itertools.permutations(("a.h5", "copy.h5")):
        (tmp_path / "copy.h5").write_bytes((folder / "a.h5").read_bytes())
        (tmp_path / "a.h5").write_bytes((folder / "a.h5").read_bytes())
        with pytest.raises(
            RepertoireError, match=f"{two}: expected takes that {one} does not have, got 'take0'"
        ):
            cg.Repertoire.open([tmp_path / one, tmp_path / two])
    (tmp_path / "empty").mkdir()
    with pytest.raises(RepertoireError, match=r"empty: expected repertoire files \(\.h5\) in this folder"):
        cg.Repertoire.open(tmp_path / "empty")
    with pytest.raises(RepertoireError, match="expected repertoire files, got none"):
        cg.Repertoire.open([])


@pytest.mark.slow
@pytest.mark.usefixtures("short_trainings")
def test_a_file_that_is_built_with_the_networks_and_motifs_of_another_fits_it(tmp_path):
    for name in ("first", "more"):
        (tmp_path / name).mkdir()
    for name, seeds in {"first": range(4), "more": range(4, 6)}.items():
        for seed in seeds:
            save_motion(tmp_path / name / f"{name}{seed}.bvh", stepping(14 * 30, period_s=0.5, seed=seed))
    archive = tmp_path / "archive"
    archive.mkdir()
    cg.build(tmp_path / "first", archive / "a.h5", preset="tiny")
    cg.build(tmp_path / "more", tmp_path / "alone.h5", preset="tiny")
    kept = {"init_from": archive / "a.h5", "keep_networks": True}
    cg.build(tmp_path / "more", archive / "b.h5", preset="tiny", **kept)
    both = cg.Repertoire.open(archive)
    assert len(both.takes) == 6
    of_folder = cg.build(
        tmp_path / "more", tmp_path / "c.h5", preset="tiny", **{**kept, "init_from": archive}
    )
    assert of_folder.repertoire.motif_set == both.motif_set
    with pytest.raises(RepertoireError, match=r"alone\.h5: expected the .* of a\.h5, got another"):
        cg.Repertoire.open([archive / "a.h5", tmp_path / "alone.h5"])
