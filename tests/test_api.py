"""The public API as a user of librosa or scikit-learn tries it first."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from synthetic_repertoire import synthetic_repertoire, write_clicks

import choreograph as cg
from choreograph.cli.main import main
from choreograph.evaluation.results import to_json

USER_SCRIPT = """
from pathlib import Path
from typing import Any
import numpy as np
from numpy.typing import NDArray
import choreograph as cg


class Low(cg.Cost):
    def node(self, layer: cg.Layer, song_features: cg.SongFeatures) -> NDArray[np.floating[Any]]:
        return layer.first_pose_m[:, 0, 1]


def main(song: Path) -> list[str]:
    repertoire: cg.Repertoire = cg.starter_repertoire()
    made: cg.Dance = cg.dance(song, repertoire, engine="graph", seed=3, costs=[Low()])
    again = cg.dance(cg.load_song(song), "rep.h5", planner="greedy", config=cg.DanceConfig(fps=30.0))
    built: cg.BuildResult = cg.build("takes/", "rep.h5", preset="tiny", words=False)
    dances: list[cg.Dance] = cg.vary(song, repertoire, 2, engine="mixer", genre="house")
    made.save("out.bvh")
    plan: cg.Plan = made.plan
    motion: cg.Motion = cg.render(plan, built.repertoire)
    version: str = cg.__version__
    return [version, *made.notes, *again.notes, *built.notes, str(motion.fps), str(len(dances))]


def wrong() -> None:
    cg.dance(5)
    cg.build("takes/", "rep.h5", preset=3)
    cg.not_there
    cg.dance("a.wav", planner="best")
    cg.dance("a.wav", planer="exact")
    cg.vary("a.wav", seeds=3)
"""


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    return synthetic_repertoire(tmp_path_factory.mktemp("api") / "rep.h5", vocabulary=True)


@pytest.fixture(scope="module")
def song(tmp_path_factory):
    return write_clicks(tmp_path_factory.mktemp("api-song") / "clicks.wav", duration_s=6.0)


@pytest.fixture(scope="module")
def made(repertoire, song):
    return cg.dance(str(song), str(repertoire.path), seed=1)


def test_every_public_name_is_listed_and_there():
    for name in cg.__all__:
        assert name in dir(cg)
        assert getattr(cg, name) is not None
    assert cg.__version__ == "0.1.0"
    assert cg.metrics.beat.f_score([0.5], [0.5]) == 1.0
    with pytest.raises(AttributeError, match="nobody"):
        _ = cg.nobody


def test_importing_is_quick_and_pulls_in_nothing_heavy():
    heavy = "import sys, choreograph; print([m for m in ('torch', 'numba', 'librosa') if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", heavy], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


def test_settings_are_keywords_and_replace_those_of_a_config(repertoire, song, made):
    config = cg.DanceConfig(seed=np.int64(1), fps=30.0)
    other = cg.dance(song, repertoire, config=config, fps=60.0)
    assert other.plan == made.plan
    assert cg.dance(cg.load_song(song), repertoire, seed=1, planner="greedy").plan.planner == "greedy"
    assert cg.dance(song, repertoire, engine="mixer", blending="linear").plan.blending == "linear"


@pytest.mark.parametrize(
    ("engine", "settings", "users"),
    [
        ("mixer", {"warping": "none"}, "graph"),
        ("mixer", {"candidates": 3}, "graph"),
        ("mixer", {"transitions": "beats"}, "graph"),  # the default, but given
        ("mixer", {"config": cg.DanceConfig(selection="random")}, "graph"),
        ("graph", {"style_song": "other.wav"}, "rollout"),
        ("rollout", {"planner": "greedy"}, "graph or mixer"),
    ],
)
def test_a_setting_that_the_engine_does_not_use_is_refused(repertoire, song, engine, settings, users):
    with pytest.raises(cg.ParameterError, match=f"{engine} engine.*setting of the {users} engine") as raised:
        cg.dance(song, repertoire, engine=engine, **settings)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"song": 5}, "expected a song as a path or a Song, got 5"),
        ({"repertoire": 7}, "expected a repertoire or its path, got 7"),
        ({"config": {"seed": 1}}, "expected a DanceConfig as config"),
        ({"weights": [1.0]}, "expected weights as a mapping of cost name to number"),
        ({"weights": {"style": "much"}}, "expected a finite number as weight of 'style'"),
        ({"costs": cg.Cost}, "expected costs as a list of Cost"),
        ({"costs": [cg.Cost]}, "a class instead of an instance"),
        ({"pins": cg.MotifPin(1.0, 1)}, "expected pins as a list of MotifPin or TakePin"),
        ({"pins": ["1=motif:2"]}, "expected pins as MotifPin or TakePin, got '1=motif:2'"),
        ({"bans": "genre:tango"}, "expected bans as a list of Ban"),
        ({"keep": ""}, "expected keep as a list of Keep, got ''"),
        ({"costs": ""}, "expected costs as a list of Cost, got ''"),
        ({"motifs": [1.5]}, "expected motifs as whole numbers or MotifPin, got 1.5"),
        ({"genre": 3}, "expected a genre as text, got 3"),
        ({"signature": "waltz"}, "expected a signature as a list of shares"),
        ({"seed": -1}, "expected seed as whole number of 0 or more, got -1"),
        ({"engine": "steam"}, "expected engine among graph, mixer, rollout, got 'steam'"),
        ({"start_s": "later"}, "expected start_s in seconds, got 'later'"),
        ({"duration_s": "all"}, "expected duration_s in seconds or None, got 'all'"),
        (
            {"song": cg.Song(np.zeros(22050), "quiet"), "duration_s": 0},
            "expected a duration in seconds above 0",
        ),
        (
            {"song": cg.Song(np.zeros(22050), "quiet"), "start_s": -1},
            "expected a start in seconds of 0 or more",
        ),
    ],
)
def test_wrong_arguments_are_reported_with_what_was_expected(repertoire, song, arguments, message):
    with pytest.raises(cg.ParameterError) as raised:
        cg.dance(**{"song": song, "repertoire": repertoire, **arguments})
    assert message in str(raised.value) and "\n" not in str(raised.value)


def test_wrong_arguments_of_build(tmp_path):
    for arguments, message in (
        ({"sources": 5}, "expected sources as a list of paths, got 5"),
        ({"output": None}, "expected the path of the output, got None"),
        ({"init_from": 3}, "expected init_from as path or None, got 3"),
        ({"words": "yes"}, "expected words as True or False, got 'yes'"),
        ({"leave_out": "take"}, "expected leave_out as list of texts, got 'take'"),
        ({"preset": "big"}, "expected preset among tiny, small, paper, got 'big'"),
        ({"device": "tpu"}, "expected device among auto, cpu, cuda, got 'tpu'"),
        ({"method": 3}, "expected method as text, got 3"),
        ({"pretrained": "all"}, "expected pretrained among default, clean, research, nothing, got 'all'"),
        ({"style_changes": {"gru": 3}}, "expected fields of StyleConfig, got gru"),
        ({"density_changes": {"steps": "few"}}, "expected steps of DensityConfig as "),
        ({"style_changes": 3}, "expected style_changes as table of name and value, got 3"),
        ({"density_changes": []}, "expected density_changes as table of name and value, got []"),
        ({"report": 3}, "expected a function as report, got 3"),
        ({"seed": None}, "expected seed as whole number of 0 or more, got None"),
    ):
        with pytest.raises(cg.ParameterError) as raised:
            cg.build(**{"sources": tmp_path, "output": tmp_path / "rep.h5", **arguments})
        assert message in str(raised.value)


def test_a_motion_is_written_read_and_evaluated(made, song, tmp_path):
    path = tmp_path / "a.npz"
    cg.save_motion(path, made.motion)
    motion = cg.load_motion(path)
    assert motion.n_frames == made.motion.n_frames
    np.testing.assert_allclose(motion.local_quat, made.motion.local_quat, atol=1e-12)
    shown = CliRunner().invoke(main, ["evaluate", str(path), str(song), "--json", "-", "-q"])
    assert shown.stdout == to_json(cg.evaluate(motion, song, name=str(path)))
    with pytest.raises(cg.ParameterError, match="expected a file with one motion, got a folder"):
        cg.load_motion(tmp_path)


def test_a_dance_and_a_repertoire_show_what_they_are(repertoire, made):
    n_takes = len(made.plan.takes_s())
    takes = "1 take" if n_takes == 1 else f"{n_takes} takes"
    assert repr(made) == f"<Dance to 'clicks': 6.0 s at 60 fps, graph engine, {takes}>"
    page = made._repr_html_()
    assert page.startswith("<iframe srcdoc=") and "&lt;canvas" in page
    assert "rep.h5" in repr(repertoire) and len(repr(repertoire)) < 200
    assert "<table" in repertoire._repr_html_()


@pytest.mark.slow
def test_the_types_serve_a_users_script(tmp_path):
    """mypy --strict over a script outside the package: right calls pass, wrong ones are found.

    With the cache of `make lint`: after it, only the script is checked.
    """
    root, script = Path(__file__).resolve().parents[1], tmp_path / "script.py"
    script.write_text(USER_SCRIPT)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", script],
        capture_output=True,
        text=True,
        check=False,
        cwd=root,
    )
    wrong_from = USER_SCRIPT.splitlines().index("def wrong() -> None:") + 1
    errors = [line.split(":", 3) for line in done.stdout.splitlines() if ": error:" in line]
    assert {Path(path).name for path, *_ in errors} == {"script.py"}, done.stdout
    lines = [int(line) for _, line, *_ in errors]
    assert lines == [wrong_from + number for number in range(1, 7)], done.stdout + done.stderr


@pytest.mark.parametrize(
    "call",
    [
        lambda made, repertoire: cg.load_song(3),
        lambda made, repertoire: cg.load_song("a.wav", start_s="x"),
        lambda made, repertoire: cg.load_song("a.wav", start_s=None),
        lambda made, repertoire: cg.DanceConfig(weights=3),
        lambda made, repertoire: cg.dance("a.wav", repertoire, report=3),
        lambda made, repertoire: cg.render(None, repertoire),
        lambda made, repertoire: cg.render(made.plan, 3),
        lambda made, repertoire: cg.Plan.read(3),
        lambda made, repertoire: cg.Plan.from_json(3),
        lambda made, repertoire: made.save("a.glb", character=3),
        lambda made, repertoire: made.save("a.bvh", bvh=3),
        lambda made, repertoire: cg.read_character(3),
        lambda made, repertoire: cg.motifs_of(3, repertoire),
        lambda made, repertoire: cg.motifs_of("walk", 3),
        lambda made, repertoire: cg.signature_of(3, repertoire),
    ],
)
def test_arguments_of_another_type_are_named_in_one_line(call, made, repertoire):
    with pytest.raises(cg.ChoreographError, match=r"^expected [^\n]+, got [^\n]+$"):
        call(made, repertoire)
