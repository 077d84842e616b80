"""`choreograph dance`, `build-db` and `inspect` as a user meets them, and how they fail."""

import json
import re
import subprocess
import sys
import warnings
from itertools import pairwise

import h5py
import numpy as np
import pytest
import soundfile
from command_line import assert_one_line, run
from synthetic_motions import swaying
from synthetic_repertoire import synthetic_contents, synthetic_takes, with_vocabulary, write_clicks

import choreograph as cg
from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS, Bars
from choreograph.core.errors import ParameterError
from choreograph.core.settings import described
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.formats.register import save_motion
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import write_repertoire
from choreograph.settings import DanceConfig, load_config

pytestmark = pytest.mark.slow


def test_dance_writes_every_output_and_the_same_bytes_again(tmp_path, song, db):
    outputs = [tmp_path / name for name in ("a.bvh", "a.npz", "a.json")]
    result = run("dance", song, "--db", db, *[x for o in outputs for x in ("-o", o)])
    assert result.exit_code == 0, result.output
    first = [o.read_bytes() for o in outputs]
    assert run("dance", song, "--db", db, *[x for o in outputs for x in ("-o", o)]).exit_code == 0
    assert [o.read_bytes() for o in outputs] == first


def test_the_published_method_says_what_it_needs(tmp_path, song, db):
    build = ("build-db", tmp_path, "-o", tmp_path / "x.h5", "--published")
    assert_one_line(
        run(*build, "--density", "analytic", "--no-lock-feet"), says="decides density, lock_feet: leave"
    )
    assert_one_line(run(*build, "--preset", "huge"), says="preset among tiny, small, paper")
    assert_one_line(run("dance", song, "--db", db, "--config", "published"), says="--density learned")
    other = run(
        "dance", song, "--db", db, "--config", "published", "--engine", "mixer", "--set", "density=clip"
    )
    assert_one_line(other, says="graph engine")
    rolled = run("dance", song, "--config", "published", "--engine", "rollout")
    assert_one_line(rolled, says="build-db --published --rollout`, got one that was trained otherwise")
    rolled = run("dance", song, "--db", db, "--config", "published", "--engine", "rollout")
    assert_one_line(rolled, says="build-db --published --rollout`, got none")
    evaluated = run(
        "evaluate", "--db", db, "--songs", song.parent, "--variants", "as-published", "--seeds", 1
    )
    assert_one_line(evaluated, says="build-db --published")


def test_a_dance_without_what_rendering_adds(tmp_path, song, db):
    plan = tmp_path / "p.json"
    given = ("warping=dtw", "time-maps=raw", "lock_feet=false", "hold_ends=false", "stage=free")
    result = run("dance", song, "--db", db, *(f"--set={setting}" for setting in given), "-o", plan)
    assert result.exit_code == 0, result.output
    made = cg.Plan.read(plan)
    assert (made.lock_feet, made.stage, made.opening_s, made.closing_s) == (False, "free", 0.0, None)
    steps = np.diff([second.source_times_s for second in made.seconds], axis=1) * 20
    assert np.abs(steps[..., None] - [0.5, 1.0, 2.0]).min(axis=-1).max() < 1e-3


def test_a_plan_is_rendered_again(tmp_path, song, db):
    plan, bvh, again = tmp_path / "p.json", tmp_path / "d.bvh", tmp_path / "e.bvh"
    assert run("dance", song, "--db", db, "-o", plan, "-o", bvh).exit_code == 0
    result = run("dance", "--plan", plan, "--db", db, "-o", again)
    assert result.exit_code == 0, result.output
    assert again.read_bytes() == bvh.read_bytes()


def test_progress_comes_as_lines_and_the_blocks_as_json(tmp_path, song, db):
    made = run("dance", song, "--db", db, "-o", tmp_path / "p.json", "--json")
    assert made.exit_code == 0, made.output
    lines = made.stderr.strip().splitlines()
    assert any(line.startswith("planning ") for line in lines)
    assert all(re.fullmatch(r".+ \d+/\d+", line) for line in lines), lines
    facts = json.loads(made.stdout)
    edges = [(block["start_s"], block["end_s"]) for block in facts["blocks"]]
    assert edges[0][0] == 0.0 and edges[-1][1] == pytest.approx(facts["duration_s"], abs=1e-3)
    assert all(end == start for (_, end), (start, _) in pairwise(edges))
    assert {block["source"] for block in facts["blocks"]} == {take["name"] for take in facts["takes"]}


def test_inspect_prints_text_and_json(db):
    assert "clips" in run("inspect", db).output
    facts = json.loads(run("inspect", db, "--json").output)
    assert facts["n_clips"] == sum(take["clips"] for take in facts["takes"])
    assert facts["vocabulary"] is None
    assert_one_line(run("inspect", db, "--plots", db.with_name("plots")), says="build-db")


def test_inspect_prints_and_plots_the_motifs_of_genres(tmp_path, monkeypatch, db_with_motifs):
    monkeypatch.setattr("choreograph.view.strip.STRIPS", 1)
    path = db_with_motifs
    shown = run("inspect", path, "--plots", tmp_path / "plots")
    assert shown.exit_code == 0, shown.output
    assert "motion words of" in shown.output
    assert f"8 plots in {tmp_path / 'plots'}" in shown.output
    facts = json.loads(run("inspect", path, "--json").output)["vocabulary"]
    vocabulary = Repertoire.open(path).vocabulary
    assert (facts["n_words"], facts["n_motifs"]) == (len(vocabulary.word_motif), vocabulary.n_motifs)
    assert list(facts["genres"]) == ["a", "b", "c", "all"]
    for index, genre in enumerate("abc"):
        about, template = facts["genres"][genre], vocabulary.signatures[index]
        assert about["takes"] == 1
        assert about["takes_to_template"] == 0.0  # one take is its genre's template
        assert list(about["common_motifs"].values()) == pytest.approx(np.sort(template)[::-1][:5], abs=1e-4)
        assert set(about["to_other_templates"]) == {"a", "b", "c", "all"} - {genre}
        assert all(0 < distance <= 1 for distance in about["to_other_templates"].values())
    assert facts["genres"]["all"]["takes"] == 3


def test_build_and_dance_with_takes_without_music(tmp_path, song, db):
    bvh = tmp_path / "takes" / "one.bvh"
    bvh.parent.mkdir()
    long = write_clicks(tmp_path / "long.wav", duration_s=12.0)
    assert run("dance", long, "--db", db, "-o", bvh).exit_code == 0
    rep = tmp_path / "rep.h5"
    built = run("build-db", bvh.parent, "-o", rep, "--preset", "tiny")
    assert built.exit_code == 0, built.output
    assert "no music networks" in built.stderr
    danced = run("dance", song, "--db", rep, "-o", tmp_path / "x.bvh")
    assert danced.exit_code == 0, danced.output


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--set", "candidates=0"], "candidates"),
        (["--weight", "grace=2"], "grace"),
        (["--weight", "style"], "COST=NUMBER"),
        (["--weight", "style=nan"], "style"),
        (["--set", "planner=lazy"], "planner"),
        (["--set", "blending=none"], "blending"),
        (["--fps", "0"], "fps"),
        (["--beats", "ear"], "ear"),
        (["--start", "1e6"], "start"),
        (["-o", "no/such/folder/x.bvh"], "no/such/folder"),
        (["-o", "x.doc"], "doc"),
    ],
)
def test_invalid_values_of_options_are_refused(song, db, tmp_path, monkeypatch, options, says):
    monkeypatch.chdir(tmp_path)
    assert_one_line(run("dance", song, "--db", db, *options), says=says)
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_no_song_is_refused(tmp_path, db):
    cases = {
        "missing": tmp_path / "none.wav",
        "folder": tmp_path,
        "empty": tmp_path / "empty.wav",
        "text": tmp_path / "text.mp3",
        "nan": tmp_path / "nan.wav",
        "cut": tmp_path / "cut.wav",
    }
    cases["empty"].write_bytes(b"")
    cases["text"].write_text("la la la " * 100)
    soundfile.write(
        cases["nan"], np.full(SAMPLE_RATE_HZ, np.nan, np.float32), SAMPLE_RATE_HZ, subtype="FLOAT"
    )
    whole = write_clicks(tmp_path / "whole.wav", duration_s=2.0).read_bytes()
    cases["cut"].write_bytes(whole[: len(whole) // 2])
    before = sorted(tmp_path.iterdir())
    for path in cases.values():
        result = run("dance", path, "--db", db, "-o", tmp_path / "out.bvh")
        assert_one_line(result, says=str(path))
    assert sorted(tmp_path.iterdir()) == before


def test_a_file_that_is_no_repertoire_is_refused(tmp_path, song, db):
    cut, text, other, version = (tmp_path / f"{n}.h5" for n in ("cut", "text", "other", "version"))
    cut.write_bytes(db.read_bytes()[:2000])
    text.write_text("not hdf5")
    with h5py.File(other, "w") as file:
        file["x"] = 1
    version.write_bytes(db.read_bytes())
    with h5py.File(version, "a") as file:
        file.attrs["version"] = 99
    (tmp_path / "empty").mkdir()
    for path, says in (
        (tmp_path / "none.h5", "no such"),
        (tmp_path / "empty", "expected repertoire files (.h5) in this folder"),
        (cut, "truncated"),
        (text, "HDF5"),
        (other, "another kind"),
        (version, "version"),
    ):
        assert_one_line(run("dance", song, "--db", path, "-o", tmp_path / "out.bvh"), says=says)
        assert_one_line(run("inspect", path), says=says)
    assert not (tmp_path / "out.bvh").exists()


def test_config_files(tmp_path, song, db):
    good, bad = tmp_path / "good.toml", tmp_path / "bad.toml"
    good.write_text("candidates = 8\n[weights]\ntransition = 6.0\n")
    plan = tmp_path / "p.json"
    assert run("dance", song, "--db", db, "--config", good, "-o", plan).exit_code == 0
    assert json.loads(plan.read_text())["weights"]["transition"] == 6.0
    bad.write_text("candidate = 8\n")
    assert_one_line(run("dance", song, "--db", db, "--config", bad, "-o", plan), says="candidate")


def test_sources_without_takes_are_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    for source in (tmp_path / "none", tmp_path / "empty"):
        assert_one_line(run("build-db", source, "-o", tmp_path / "r.h5"), says=str(source))
    assert_one_line(run("build-db", tmp_path, "-o", tmp_path / "no" / "r.h5"), says="folder")


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ([], {"augment_mirror": True, "compress": False, "lock_feet": True}),
        (["--preset", "tiny"], {"preset": "tiny"}),
        (["--set", "augment_mirror=false"], {"augment_mirror": False, "pretrained": "default"}),
        (["--set", "words=true", "--set", "words=false"], "expected a value of words once"),
        (["--set", "words=no"], "expected words as True or False, got 'no'"),
        (["--set", "word=false"], "the most similar one is 'words'"),
        (["--set", "preset=tiny", "--preset", "tiny"], "expected preset once, got --preset and --set preset"),
        (["--pretrained", "clean"], {"pretrained": "clean"}),
        (["--pretrained", "nothing", "--keep-networks"], {"pretrained": "nothing", "keep_networks": True}),
        (["--no-lock-feet", "--compress"], {"lock_feet": False, "compress": True}),
        (["--density", "learned", "--leave-out", "a", "--leave-out", "@names.txt"],
         {"density": "learned", "leave_out": ("a", "b", "c")}),
    ],
)  # fmt: skip
def test_build_options(tmp_path, monkeypatch, given, expected):
    def build(sources, output, *, options, report, training_report):
        assert {name: getattr(options, name) for name in expected} == expected
        raise ParameterError("built with these options")

    monkeypatch.chdir(tmp_path)
    (tmp_path / "names.txt").write_text("# takes\nb\n\nc\n")
    monkeypatch.setattr("choreograph.build", build)
    says = expected if isinstance(expected, str) else "built with these options"
    assert_one_line(run("build-db", tmp_path, "-o", "r.h5", *given), says=says)


@pytest.mark.parametrize(("option", "file"), [("--leave-out", "@none.txt"), ("--init-from", "none.h5")])
def test_files_that_options_name_must_be_there(tmp_path, monkeypatch, option, file):
    monkeypatch.chdir(tmp_path)
    assert_one_line(run("build-db", tmp_path, "-o", "r.h5", option, file), says=file.removeprefix("@"))


def test_unknown_sets_of_networks_are_refused(tmp_path):
    result = run("build-db", tmp_path, "-o", tmp_path / "r.h5", "--pretrained", "other")
    assert_one_line(result, says="default, clean, research, nothing")


def test_songs_are_listed_located_and_copied(tmp_path):
    names = list(json.loads(run("songs", "--json").stdout))
    assert names and all(name in run("songs").stdout for name in names)
    assert run("songs", "--path", names[0]).stdout.strip().endswith((".mp3", ".ogg", ".flac", ".wav"))
    assert run("songs", "--copy", tmp_path, "--json").exit_code == 0
    assert len(list(tmp_path.iterdir())) == len(names)
    assert_one_line(run("songs", "--path", "nothing"), says="nothing")


def test_help_of_dance_fits_two_screens_by_purpose():
    """At most 40 options, in groups, on two screens of 50 lines, with examples."""
    shown = run("dance", "--help").output
    lines = shown.splitlines()
    options = [line for line in lines if re.match(r" +(-\w, )?--?\w", line)]
    assert 30 <= len(options) <= 40 and len(lines) <= 100
    titles = ("Song and repertoire:", "What is danced:", "Engine and settings:", "Output:", "Examples:")
    places = [shown.index(f"  {title}") for title in titles]
    assert places == sorted(places)
    assert shown.index("Engine and settings:") < shown.index("--set NAME=VALUE") < shown.index("Output:")


def test_the_installed_command_answers():
    shown = subprocess.run(
        [sys.executable, "-m", "choreograph", "--help"], capture_output=True, text=True, check=True
    )
    assert "build-db" in shown.stdout


def test_counts_are_shown_written_and_imported_again(tmp_path):
    """From a table beside the take to the repertoire, out of it, and in again: the same counts."""
    folder = tmp_path / "takes"
    folder.mkdir()
    save_motion(folder / "a.bvh", swaying(300))
    save_motion(folder / "b.bvh", swaying(300, seed=1))
    rows = [f"{0.5 * k:.6f},{k % 3 + 1},{'turn' if k == 3 else '-' if k == 9 else ''}" for k in range(18)]
    (folder / "a.counts.csv").write_text("\n".join(["time_s,number,figure", *rows, ""]))
    built = cg.build(folder, tmp_path / "rep.h5", preset="tiny", words=False)
    assert any(note.startswith("b: there are no counts, since those estimated") for note in built.notes)
    assert "takes without counts are not danced beside takes with counts" in built.notes
    shown = run("inspect", built.path).output
    assert "18 counts in 3 (annotation 1.00), 1 figure " in shown and "no counts" in shown
    facts = json.loads(run("inspect", built.path, "--json").output)["takes"][0]["counts"]
    assert facts == {"n": 18, "metre": 3, "source": "annotation", "confidence": 1.0, "figures": 1}

    written = run("inspect", built.path, "--counts", "a", "-o", tmp_path / "out.csv")
    assert written.exit_code == 0, written.output
    assert (tmp_path / "out.csv").read_text() == (folder / "a.counts.csv").read_text()
    assert_one_line(run("inspect", built.path, "--counts", "b", "-o", tmp_path / "b.csv"), says="not counted")
    assert_one_line(run("inspect", built.path, "--counts", "c", "-o", tmp_path / "b.csv"), says="'c'")
    assert_one_line(run("inspect", built.path, "--counts", "a"), says="expected --output beside --counts")
    assert not (tmp_path / "b.csv").exists()


def test_a_genre_without_takes_is_shown_without_a_distance(tmp_path):
    contents = with_vocabulary(synthetic_contents(synthetic_takes(genres="bb")), synthetic_takes(genres="ab"))
    write_repertoire(tmp_path / "rep.h5", contents)
    with warnings.catch_warnings(category=RuntimeWarning, action="error"):
        shown = run("inspect", tmp_path / "rep.h5")
    assert shown.exit_code == 0 and "nan" not in shown.output
    genres = json.loads(run("inspect", tmp_path / "rep.h5", "--json").stdout)["vocabulary"]["genres"]
    assert genres["a"]["takes"] == 0 and genres["a"]["takes_to_template"] is None


def test_help_names_both_sources_of_counted_takes():
    assert "dance-with-melody/ choreonet/" in run("build-db", "--help").output


def test_settings_are_explained():
    shown = run("settings").output
    for setting in described(DanceConfig):
        assert f"{setting.name}: {setting.kind}, default {setting.default!r}" in shown
    assert run("settings", "lock-feet").output.startswith("lock_feet: True or False, default True\n")
    assert "preset: 'tiny', 'small', 'paper', default 'small'" in run("settings", "--build").output
    refused = run("settings", "feet")
    assert refused.exit_code == 2 and "the most similar one is 'lock_feet'" in refused.output


def test_all_default_settings_as_a_file_are_the_defaults(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(run("settings", "--toml").output, encoding="utf-8")
    assert load_config(path) == DanceConfig()


def test_the_costs_are_explained_by_their_classes():
    printed = run("settings", "weights").stdout
    assert re.findall(r"^    (\w+) = ", printed, flags=re.M) == list(DEFAULT_WEIGHTS)
    assert f"bars = {DEFAULT_WEIGHTS['bars']}" in printed
    summary = (Bars.__doc__ or "").splitlines()[0]
    assert summary in " ".join(printed.split())
    assert printed.count("Raise") == len(DEFAULT_WEIGHTS)


def test_takes_are_added_replaced_and_removed(tmp_path, db):
    path, other = tmp_path / "rep.h5", tmp_path / "other.h5"
    path.write_bytes(db.read_bytes())
    for folder, name in (("new", "walk"), ("again", "take0")):
        (tmp_path / folder).mkdir()
        save_motion(tmp_path / folder / f"{name}.bvh", swaying(270))
    result = run("build-db", "--add", tmp_path / "new", "--remove", "take1", path)
    assert result.exit_code == 0 and "rep.h5: 3 takes" in result.stdout, result.output
    result = run("build-db", "--replace", tmp_path / "again", path, "-o", other, "-q")
    assert result.exit_code == 0 and not result.stdout, result.output
    names = [take["name"] for take in json.loads(run("inspect", other, "--json").output)["takes"]]
    assert names == ["take0", "take2", "walk"]
    assert_one_line(run("build-db", "--remove", "take1", path), says="no 'take1'")
    assert_one_line(run("build-db", "--add", tmp_path / "new", path), says="--replace")
    assert_one_line(run("build-db", "--remove", "take0", db, "-o", db), says="it is an input")


def test_a_damaged_block_is_found(tmp_path, db):
    result = run("inspect", db, "--check")
    assert result.exit_code == 0 and "every checksum is right" in result.stdout, result.output
    assert json.loads(run("inspect", db, "--check", "--json").output)["is_intact"]
    with h5py.File(db) as file:
        damaged = file["body/pos_m"].id.get_chunk_info(0).byte_offset + 7
    content = bytearray(db.read_bytes())
    content[damaged] ^= 1
    path = tmp_path / "rep.h5"
    path.write_bytes(content)
    assert run("inspect", path).exit_code == 0  # whatever reads only the tables finds nothing
    assert_one_line(run("inspect", path, "--check"), says="rep.h5")


def test_what_is_wrong_in_a_repertoire_is_printed(tmp_path, db):
    result = run("inspect", db, "--lint")
    assert result.exit_code == 0, result.output
    findings = json.loads(run("inspect", db, "--lint", "--json").output)
    lines = [
        f"  {found['take']}: {found['text']}" if found["take"] else f"  {found['text']}" for found in findings
    ]
    printed = [line for line in result.stdout.splitlines() if line.startswith("  ")]
    assert printed == lines or not findings
    assert not findings or f"{findings[0]['kind']}: " in result.stdout


def test_what_a_repertoire_lacks_for_songs_is_printed_and_drawn(tmp_path, song, db):
    pytest.importorskip("matplotlib")
    folder = tmp_path / "songs"
    folder.mkdir()
    write_clicks(folder / "clicks.wav", bpm=120, duration_s=12.0)
    picture = tmp_path / "tempi.png"
    result = run("inspect", db, "--coverage", song, "--coverage", folder, "-o", picture)
    assert result.exit_code == 0, result.output
    assert song.stem in result.stdout and "clicks" in result.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    found = json.loads(run("inspect", db, "--coverage", folder, "--json").output)
    [about] = found["songs"]
    assert len(about["seconds"]) == 12
    assert about["poor_s"] == sum(second["lacks"] != "" for second in about["seconds"])
    assert sum(lack["seconds"] for lack in found["lacks"]) == about["poor_s"]
    (tmp_path / "empty").mkdir()
    assert_one_line(run("inspect", db, "--coverage", tmp_path / "empty"), says="without audio files")
    assert_one_line(run("inspect", db, "--coverage", tmp_path / "none.wav"), says="none.wav")
