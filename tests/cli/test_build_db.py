"""`choreograph get`: terms first, nothing without a yes, and what to do by hand."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from functools import partial

import pytest
from click.testing import CliRunner
from command_line import assert_one_line, run
from file_server import hosted
from synthetic_motions import stepping

import choreograph as cg
from choreograph.cli.main import main
from choreograph.formats.register import save_motion
from choreograph.nets import configs


@pytest.fixture
def host(tmp_path, monkeypatch):
    """A host of two takes, and the table `sets.toml` that names it."""
    monkeypatch.chdir(tmp_path)
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as out:
        for seed in (1, 2):
            save_motion(tmp_path / "one.bvh", stepping(12 * 30, seed=seed))
            out.write(tmp_path / "one.bvh", f"set/dance{seed}.bvh")
    limits = "max_bytes = 10000000, max_unpacked_bytes = 10000000"
    with hosted(content.getvalue()) as host:
        (tmp_path / "sets.toml").write_text(
            f"""
[mine]
title = "Mine"
about = "two dances"
licence = "CC BY 4.0"
terms = ["Name the dancers."]
page = "https://example.org/mine"
build = "takes"
layout = "takes/*.bvh"
files = [{{ url = "{host.url}", sum = "{host.sum}", {limits}, keep = ["*.bvh"], into = "takes" }}]

[asked]
title = "Asked"
about = "dances behind a form"
licence = "research"
terms = ["Ask first."]
page = "https://example.org/asked"
build = "takes"
layout = "takes/*.bvh"
by_hand = "Fill in the form."
""",
            encoding="utf-8",
        )
        yield host


def test_the_shipped_sets_are_listed():
    listed = run("get")
    assert listed.exit_code == 0
    assert "aist++" in listed.output and "CC BY 4.0" in listed.output and "(by hand)" in listed.output


def test_terms_come_first_and_nothing_is_downloaded_without_a_yes(tmp_path, host):
    for answer in ("no\n", "y\n", ""):
        refused = CliRunner().invoke(main, ["get", "mine", "--table", "sets.toml"], input=answer)
        assert refused.exit_code == 2
        for part in ("CC BY 4.0", "Name the dancers.", "https://example.org/mine", host.url):
            assert part in refused.stdout
    assert host.asked == [] and not (tmp_path / "mine").exists()
    agreed = CliRunner().invoke(main, ["get", "MINE", "--table", "sets.toml"], input="yes\n")
    assert agreed.exit_code == 0, agreed.output
    assert "build: choreograph build-db mine/takes -o rep.h5" in agreed.stdout
    assert len(list((tmp_path / "mine" / "takes").iterdir())) == 2


def test_what_was_downloaded_can_be_built_from(tmp_path, host):
    assert run("get", "mine", "--table", "sets.toml", "--agree", "-o", "there").exit_code == 0
    checked = run("build-db", "there/takes", "--check")
    assert checked.exit_code == 0, checked.output
    assert "2 rows: 2 read" in checked.output


def test_a_repertoire_is_built_if_asked_for(tmp_path, host, monkeypatch):
    fewer = {"preset": "tiny", "pretrained": "nothing", "words": False, "workers": 1}
    monkeypatch.setattr(cg, "build", partial(cg.build, **fewer))  # the networks of the default take minutes
    tiny = configs._DENSITY_PRESETS["tiny"], configs._STYLE_PRESETS["tiny"]
    for presets, preset in zip((configs._DENSITY_PRESETS, configs._STYLE_PRESETS), tiny, strict=True):
        few = {name: 10 for name in ("steps", "music_steps") if hasattr(preset, name)}
        monkeypatch.setitem(presets, "tiny", replace(preset, **few))
    built = run("get", "mine", "--table", "sets.toml", "--agree", "--build", "rep.h5")
    assert built.exit_code == 0, built.output
    assert "rep.h5: 2 takes" in built.output
    assert (tmp_path / "rep.h5").is_file()


def test_a_set_behind_a_form_says_what_to_put_where(tmp_path, host):
    refused = run("get", "asked", "--table", "sets.toml")
    assert_one_line(refused, says="asked: expected takes/*.bvh in it, got none")
    assert "by hand: Fill in the form." in refused.stdout and "https://example.org/asked" in refused.stdout
    (tmp_path / "asked" / "takes").mkdir(parents=True)
    (tmp_path / "one.bvh").rename(tmp_path / "asked" / "takes" / "one.bvh")
    assert "build-db asked/takes" in run("get", "asked", "--table", "sets.toml").output


def test_what_is_wrong_is_one_line(tmp_path, host):
    assert_one_line(run("get", "edge"), says="among aist++")
    assert_one_line(run("get", "--agree"), says="expected no --agree without NAME")
    assert_one_line(run("get", "mine", "--table", "no.toml"), says="no.toml")
    host.status = 503
    assert_one_line(run("get", "mine", "--table", "sets.toml", "--agree", "-q"), says="got 503")
    (tmp_path / "sets.toml").write_bytes(b"\xff")
    assert_one_line(run("get", "--table", "sets.toml"), says="sets.toml")
