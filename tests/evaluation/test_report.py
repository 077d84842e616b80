"""A page of dances side by side."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import assert_one_line, run
from synthetic_motions import stepping, swaying
from synthetic_repertoire import write_clicks

from choreograph.core.errors import ParameterError
from choreograph.evaluation import report
from choreograph.evaluation.report import write_side_by_side
from choreograph.formats.register import save_motion
from choreograph.music.song import load_song


@pytest.fixture
def song(tmp_path):
    return load_song(write_clicks(tmp_path / "song.wav", duration_s=4.0))


def test_dances_stand_from_left_to_right_and_end_together(tmp_path, song, monkeypatch):
    written = {}

    def keep(path, motion, plan, **given):
        written.update(given, motions=[motion, *given["others"]], plan=plan)

    monkeypatch.setattr(report, "write_page", keep)
    dances = {
        "a": stepping(90),
        "b": swaying(120).moved(shift_m=np.array([5.0, 0.0, 2.0])),
        "c": stepping(300),
    }
    write_side_by_side(tmp_path / "p.html", dances, song, beats_s=np.arange(0.5, 4.0, 0.5))
    means_m = [one.root_pos_m.mean(axis=0) for one in written["motions"]]
    np.testing.assert_allclose([mean[[0, 2]] for mean in means_m], [[-1.8, 0], [0, 0], [1.8, 0]], atol=1e-9)
    assert len({one.n_frames for one in written["motions"]}) == 1
    assert written["title"] == "From left: a, b, c"
    assert max(written["plan"].music_beats_s) < written["motions"][0].duration_s + 1 / 30


def test_no_more_than_eight(tmp_path, song):
    with pytest.raises(ParameterError, match="1 to 8 dances"):
        write_side_by_side(
            tmp_path / "p.html", dict.fromkeys("abcdefghi", stepping(60)), song, beats_s=np.ones(0)
        )


def test_the_command_writes_the_page(tmp_path, song):
    for name, motion in (("a.bvh", stepping(90)), ("b.npz", swaying(90))):
        save_motion(tmp_path / name, motion)
    page = tmp_path / "both.html"
    result = run("evaluate", tmp_path / "a.bvh", tmp_path / "b.npz", song.path, "--page", page)
    assert result.exit_code == 0, result.output
    assert "From left: a.bvh, b.npz" in page.read_text(encoding="utf-8")
    assert_one_line(run("evaluate", "--songs", tmp_path, "--page", page), says="expected no --page beside")
    assert_one_line(
        run("evaluate", tmp_path / "a.bvh", song.path, "--page", tmp_path / "a.bvh"), says="a.bvh"
    )
