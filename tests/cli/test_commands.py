"""The command line as a user meets it: what works, and how what cannot ends."""

import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import soundfile
from click.testing import CliRunner
from synthetic_repertoire import synthetic_repertoire

from choreograph.cli import main
from choreograph.errors import ParameterError
from choreograph.repertoire import Repertoire

RATE = 22050


@pytest.fixture(scope="module")
def db(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("db") / "rep.h5").path


@pytest.fixture(scope="module")
def song(tmp_path_factory):
    return write_clicks(tmp_path_factory.mktemp("song") / "song.wav", seconds=6.0)


def write_clicks(path: Path, *, seconds: float, rate: int = RATE) -> Path:
    samples = np.zeros(int(seconds * rate), np.float32)
    noise = np.random.default_rng(0).normal(size=rate // 50).astype(np.float32) * 0.3
    for start in range(0, len(samples) - len(noise), rate // 2):
        samples[start : start + len(noise)] += noise
    soundfile.write(path, samples, rate)
    return path


def run(*arguments: object):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def assert_one_line(result, *, says: str) -> None:
    assert result.exit_code == 2, result.output
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, result.stderr
    assert says in lines[0]
    assert "Traceback" not in result.output


def test_dance_writes_every_output_and_the_same_bytes_again(tmp_path, song, db):
    outputs = [tmp_path / name for name in ("a.bvh", "a.npz", "a.json")]
    result = run("dance", song, "--db", db, *[x for o in outputs for x in ("-o", o)])
    assert result.exit_code == 0, result.output
    first = [o.read_bytes() for o in outputs]
    assert run("dance", song, "--db", db, *[x for o in outputs for x in ("-o", o)]).exit_code == 0
    assert [o.read_bytes() for o in outputs] == first


def test_a_plan_is_rendered_again(tmp_path, song, db):
    plan, bvh, again = tmp_path / "p.json", tmp_path / "d.bvh", tmp_path / "e.bvh"
    assert run("dance", song, "--db", db, "-o", plan, "-o", bvh).exit_code == 0
    result = run("dance", "--plan", plan, "--db", db, "-o", again)
    assert result.exit_code == 0, result.output
    assert again.read_bytes() == bvh.read_bytes()


def test_inspect_speaks_to_people_and_machines(db):
    assert "clips" in run("inspect", db).output
    facts = json.loads(run("inspect", db, "--json").output)
    assert facts["n_clips"] == sum(take["clips"] for take in facts["takes"])
    assert facts["vocabulary"] is None
    assert_one_line(run("inspect", db, "--plots", db.with_name("plots")), says="build-db")


def test_inspect_tells_and_plots_what_genres_are_made_of(tmp_path, monkeypatch):
    monkeypatch.setattr("choreograph.preview.motif_plots.STRIPS", 1)
    path = synthetic_repertoire(tmp_path / "rep.h5", vocabulary=True).path
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
    long = write_clicks(tmp_path / "long.wav", seconds=12.0)
    assert run("dance", long, "--db", db, "-o", bvh).exit_code == 0
    rep = tmp_path / "rep.h5"
    built = run("build-db", bvh.parent, "-o", rep, "--preset", "tiny")
    assert built.exit_code == 0, built.output
    assert "no networks" in built.stderr
    danced = run("dance", song, "--db", rep, "-o", tmp_path / "x.bvh")
    assert danced.exit_code == 0, danced.output


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--candidates", "0"], "candidates"),
        (["--weight", "grace=2"], "grace"),
        (["--weight", "style"], "COST=NUMBER"),
        (["--weight", "style=nan"], "style"),
        (["--planner", "lazy"], "planner"),
        (["--blending", "none"], "blending"),
        (["--fps", "0"], "fps"),
        (["--beats", "ear"], "ear"),
        (["--start", "1e6"], "start"),
        (["-o", "no/such/folder/x.bvh"], "no/such/folder"),
        (["-o", "x.doc"], "doc"),
    ],
)
def test_options_that_cannot_be_used(song, db, tmp_path, monkeypatch, options, says):
    monkeypatch.chdir(tmp_path)
    assert_one_line(run("dance", song, "--db", db, *options), says=says)
    assert not list(tmp_path.iterdir())


def test_songs_that_are_none(tmp_path, db):
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
    soundfile.write(cases["nan"], np.full(RATE, np.nan, np.float32), RATE, subtype="FLOAT")
    whole = write_clicks(tmp_path / "whole.wav", seconds=2.0).read_bytes()
    cases["cut"].write_bytes(whole[: len(whole) // 2])
    before = sorted(tmp_path.iterdir())
    for path in cases.values():
        result = run("dance", path, "--db", db, "-o", tmp_path / "out.bvh")
        assert_one_line(result, says=str(path))
    assert sorted(tmp_path.iterdir()) == before


def test_repertoires_that_are_none(tmp_path, song, db):
    cut, text, other, version = (tmp_path / f"{n}.h5" for n in ("cut", "text", "other", "version"))
    cut.write_bytes(db.read_bytes()[:2000])
    text.write_text("not hdf5")
    with h5py.File(other, "w") as file:
        file["x"] = 1
    version.write_bytes(db.read_bytes())
    with h5py.File(version, "a") as file:
        file.attrs["version"] = 99
    for path, says in (
        (tmp_path / "none.h5", "no such"),
        (tmp_path, "folder"),
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


def test_sources_that_are_none(tmp_path):
    (tmp_path / "empty").mkdir()
    for source in (tmp_path / "none", tmp_path / "empty"):
        assert_one_line(run("build-db", source, "-o", tmp_path / "r.h5"), says=str(source))
    assert_one_line(run("build-db", tmp_path, "-o", tmp_path / "no" / "r.h5"), says="folder")


@pytest.mark.parametrize(
    ("given", "style_from", "mirroring"),
    [
        ([], "starter.h5", True),
        (["--preset", "tiny"], None, True),
        (["--style-from", "nothing", "--no-mirroring"], None, False),
        (["--style-from", "other.h5", "--preset", "tiny"], "other.h5", True),
    ],
)
def test_what_training_begins_with(tmp_path, monkeypatch, given, pretrained_style, augment_mirror):
    def build(sources, output, options, **reports):
        assert (options.pretrained_style and options.pretrained_style.name) == pretrained_style
        assert options.augment_mirror == augment_mirror
        raise ParameterError("asked for as expected")

    monkeypatch.setattr("choreograph.building.build_repertoire", build)
    assert_one_line(run("build-db", tmp_path, "-o", tmp_path / "r.h5", *given), says="asked for as expected")


def test_networks_to_begin_with_must_be_there(tmp_path):
    wanted = run("build-db", tmp_path, "-o", tmp_path / "r.h5", "--style-from", tmp_path / "none.h5")
    assert_one_line(wanted, says="none.h5")


def test_the_installed_command_answers():
    shown = subprocess.run(
        [sys.executable, "-m", "choreograph", "--help"], capture_output=True, text=True, check=True
    )
    assert "build-db" in shown.stdout
