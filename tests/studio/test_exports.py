"""Exports: parts of the dance in each format, and what no format can have."""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from synthetic_motions import stepping

import choreograph as cg
from choreograph.core.counts import Figure
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.formats.register import save_motion
from choreograph.studio import exports
from choreograph.studio.exports import EXPORTED, export, suffix_of
from choreograph.studio.jobs import Jobs

# Exports: parts of the dance in each format, and what no format can have.


def test_every_format_that_is_offered_is_written():
    assert {suffix_of(format) for format in EXPORTED} <= set(exports.output_formats())
    assert suffix_of("usd") == "usdc" and suffix_of("bvh") == "bvh"


@pytest.mark.parametrize("format", ["", "exe", "BVH", ".bvh", "../bvh"])
def test_another_format_is_refused_in_one_line(format):
    with pytest.raises(ParameterError, match="format") as refused:
        suffix_of(format)
    assert "\n" not in str(refused.value)


def test_a_whole_dance_is_that_of_the_command(made, tmp_path):
    made.save(tmp_path / "other.npz")
    stages = []
    export(tmp_path / "dance.npz", made, None, None, lambda stage, done, total: stages.append(stage))
    assert (tmp_path / "dance.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()
    assert stages[0] == "writing dance.npz"


def test_a_part_has_the_frames_of_its_span(made, tmp_path):
    export(tmp_path / "part.npz", made, (2.0, 4.5), None, None)
    part = cg.load_motion(tmp_path / "part.npz")
    whole = made.motion.sliced(round(2.0 * made.motion.fps), round(4.5 * made.motion.fps))
    assert part.n_frames == whole.n_frames == round(2.5 * made.motion.fps)
    np.testing.assert_allclose(part.local_quat, whole.local_quat, atol=1e-6)


def test_the_plan_of_a_part_begins_with_it(made, tmp_path, monkeypatch):
    saved = []
    monkeypatch.setattr(exports, "save_dance", lambda path, parts, report: saved.append(parts))
    export(tmp_path / "a.bvh", made, (2.0, 6.0), None, None)
    plan, whole = saved[0].plan, made.plan
    assert plan.start_s == whole.start_s + 2.0 and plan.duration_s == saved[0].motion.duration_s
    beats_s = [s - 2.0 for s in whole.music_beats_s if 2.0 <= s < 6.0]
    assert list(plan.music_beats_s) == pytest.approx(beats_s) and len(beats_s) > 4
    assert len(plan.music_beat_numbers) == (len(beats_s) if whole.music_beat_numbers else 0)
    export(tmp_path / "a.bvh", made, None, None, None)
    assert saved[1].plan is whole and saved[1].motion is made.motion


def test_hands_follow_the_figures_also_in_a_part(made, tmp_path):
    figures = (Figure("cabbage patch", 1.0, 3.0, 4), Figure("fan", 3.0, 6.0, 6))
    danced = replace(made, figures=figures)
    danced.save(tmp_path / "other.vmd")
    export(tmp_path / "whole.vmd", danced, None, None, None)
    assert (tmp_path / "whole.vmd").read_bytes() == (tmp_path / "other.vmd").read_bytes()
    export(tmp_path / "relaxed.vmd", replace(made, figures=()), None, None, None)
    assert (tmp_path / "relaxed.vmd").read_bytes() != (tmp_path / "whole.vmd").read_bytes()
    part = exports._part(tmp_path / "a.vmd", danced, (2.0, 5.0))
    assert [(f.start_s, f.end_s) for f in part.figures] == [(0.0, 1.0), (1.0, 4.0)]


@pytest.mark.parametrize("suffix", ["json", "html"])
def test_a_part_of_a_plan_or_a_page_is_refused(made, tmp_path, suffix):
    with pytest.raises(ParameterError, match="expected the whole dance"):
        export(tmp_path / f"a.{suffix}", made, (2.0, 4.0), None, None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("span", [(4.0, 2.0), (2.0, 2.0), (-1.0, 2.0), (0.0, 500.0), (float("nan"), 2.0)])
def test_a_part_that_the_dance_does_not_have_is_refused(made, tmp_path, span):
    with pytest.raises(ParameterError, match="expected a part of the dance"):
        export(tmp_path / "a.bvh", made, span, None, None)
    assert list(tmp_path.iterdir()) == []


# Builds in a process of their own: their log, their failures, and their end when they are cancelled.


@pytest.fixture
def jobs():
    made = Jobs()
    yield made
    made.close()


def test_takes_are_checked_with_a_row_for_each(client):
    assert client.post("/api/build/check").status_code == 404
    folder = client.service.scratch
    save_motion(folder / "walk.bvh", stepping(6 * 30, seed=1))
    for content, name in (((folder / "walk.bvh").read_bytes(), "walk.bvh"), (b"no take", "bad.bvh")):
        assert client.send("/api/build", content, name).status_code == 200
    assert client.send("/api/build", b"x", "bad.exe").status_code == 415
    assert [file["name"] for file in client.get("/api/build").json()["files"]] == ["bad.bvh", "walk.bvh"]
    job = client.wait(client.post("/api/build/check"))
    log = "\n".join(job["log"])
    assert "walk.bvh" in log and "bad.bvh" in log and str(folder) not in log
    for name in ("../mine", "a/b", ""):
        assert client.post("/api/build/start", name=name).status_code in (400, 415)
    assert client.http.delete("/api/build").json() == {"files": []}


def fake(monkeypatch, code):
    monkeypatch.setattr(exports.subprocess, "Popen", _with(exports.subprocess.Popen, code))


def _with(start, code):
    return lambda command, **options: start([sys.executable, "-u", "-c", code], **options)


def test_a_failed_build_says_its_last_line(jobs, tmp_path, monkeypatch):
    fake(monkeypatch, "print('reading'); print('choreograph: expected takes, got none'); raise SystemExit(2)")
    with pytest.raises(ChoreographError, match=r"^expected takes, got none$"):
        jobs.do("build", lambda job: exports.build(tmp_path / "takes", tmp_path / "a.h5", "tiny", job))


def test_a_cancelled_build_ends_its_process(jobs, tmp_path, monkeypatch):
    code = "import time, os; print(os.getpid())\nwhile True: time.sleep(0.05); print('training')"
    fake(monkeypatch, code)
    job = jobs.start("build", lambda job: exports.build(tmp_path / "takes", tmp_path / "a.h5", "tiny", job))
    while len(job.log) < 2:
        time.sleep(0.01)
    jobs.cancel(job.id)
    while job.state == "running":
        time.sleep(0.01)
    assert job.state == "cancelled"
    from choreograph.core.files import is_running

    assert not is_running(int(job.log[0]))
