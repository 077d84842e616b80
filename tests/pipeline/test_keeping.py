"""Parts of a dance kept, the rest danced anew, by every engine: judged by the motion."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from command_line import run

import choreograph as cg
from choreograph.engines.danced_motifs import danced_motifs
from choreograph.errors import ParameterError

pytestmark = pytest.mark.slow

SONG = cg.example_songs()["house"] if hasattr(cg.example_songs(), "keys") else cg.example_songs()[0]
SPAN_S = 20.0
KEEP = [cg.Keep(0.0, 6.0), cg.Keep(13.0, SPAN_S)]


@pytest.fixture(scope="module")
def old():
    return cg.dance(SONG, duration_s=SPAN_S)


@pytest.fixture(scope="module", params=["graph", "mixer", "rollout"])
def new(request, old):
    return cg.dance(SONG, duration_s=SPAN_S, engine=request.param, existing=old, keep=KEEP, seed=1)


def frames(dance, keep):
    return slice(round(keep.start_s * dance.motion.fps), round(keep.end_s * dance.motion.fps))


def test_what_is_kept_is_the_existing_dance_to_the_bit_and_the_gap_is_not(old, new):
    assert new.motion.n_frames == old.motion.n_frames
    for keep in KEEP:
        part = frames(new, keep)
        assert np.array_equal(new.motion.root_pos_m[part], old.motion.root_pos_m[part])
        assert np.array_equal(new.motion.local_quat[part], old.motion.local_quat[part])
    gap = frames(new, cg.Keep(7.0, 12.0))
    dot = np.abs(np.sum(new.motion.local_quat[gap] * old.motion.local_quat[gap], axis=-1))
    assert 2 * np.arccos(dot.clip(max=1.0)).max() > 0.5  # rad


def test_the_plan_says_what_is_kept_and_of_whom(old, new):
    kept = [word for word in new.plan.words if word.kept]
    assert {word.kept for word in kept} == {old.plan.song}
    assert sum(word.end_s - word.start_s for word in kept) == pytest.approx(13.0, abs=0.05)
    assert {w.credits for w in kept} <= {block.planned.credits for block in old.plan.blocks}
    blocks = new.plan.blocks
    assert blocks[0].start_s == 0.0 and blocks[-1].end_s == pytest.approx(new.plan.duration_s)
    for before, after in pairwise(blocks):
        assert before.end_s == pytest.approx(after.start_s, abs=2e-3)
    assert cg.Plan.from_json(new.plan.to_json()) == new.plan
    with pytest.raises(ParameterError, match="dance it again"):
        cg.render(new.plan, cg.starter_repertoire())


def test_a_pin_in_the_gap_is_danced_or_said(old):
    starter = cg.starter_repertoire()
    motif = int(np.bincount(starter.vocabulary.word_motif).argmax())
    made = cg.dance(
        SONG, duration_s=SPAN_S, engine="mixer", existing=old, keep=KEEP, pins=[cg.MotifPin(9.6, motif)]
    )
    bounds_s = np.array(
        [*(w.start_s for w in made.plan.words if not w.kept and 6.5 < w.start_s < 12.5), 12.6]
    )
    slot = int(np.searchsorted(bounds_s, 9.6, side="right")) - 1
    assert (danced_motifs(made.motion, bounds_s, starter)[slot] == motif) == (not made.unmet)


def test_from_the_command_line(old, tmp_path):
    for name in ("old.npz", "old.bvh", "old.json"):
        old.save(tmp_path / name)
    asked = (
        "dance",
        SONG,
        "--duration",
        SPAN_S,
        "--engine",
        "mixer",
        "--keep",
        "0-6",
        "--keep",
        "13-20",
        "-q",
    )
    for name in ("old.npz", "old.bvh", "old.json"):
        made = run(
            *asked, "--existing", tmp_path / name, "-o", tmp_path / "new.npz", "-o", tmp_path / "new.json"
        )
        assert made.exit_code == 0, made.output
        plan = json.loads((tmp_path / "new.json").read_text(encoding="utf-8"))
        assert {word["kept"] for word in plan["words"] if word["kept"]} == {name}
    before, after = (np.load(tmp_path / name) for name in ("old.npz", "new.npz"))
    assert set(before.files) == set(after.files)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--keep", "0-6"), "expected an existing dance"),
        (("--existing", "old.txt", "--keep", "0-6"), "expected an existing dance as .bvh, .npz or .json"),
        (("--existing", "none.npz", "--keep", "0-6"), "none.npz"),
        (("--existing", "old.npz"), "expected a stretch to keep"),
        (("--existing", "old.npz", "--keep", "0-6", "--fps", "30"), "leave out fps"),
        (("--existing", "old.npz", "--keep", "0-6", "--pin", "3=motif:1"), "move it into a gap"),
        (("--existing", "old.npz", "--keep", "0-6", "--duration", "10"), "is it to another song"),
    ],
)
def test_what_cannot_be_kept_is_said_in_one_line(old, tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    old.save(tmp_path / "old.npz")
    made = run(
        "dance", SONG, *(() if "--duration" in options else ("--duration", SPAN_S)), *options, "-o", "a.bvh"
    )
    assert made.exit_code == 2 and said in made.output.replace("\n", " ")
    assert not (tmp_path / "a.bvh").exists()
