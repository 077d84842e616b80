"""A build whose rollout network learns from graph dances of its takes."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_motions import stepping
from synthetic_repertoire import write_clicks

import choreograph as cg
from choreograph.formats.register import save_motion
from choreograph.pipeline import building

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("short_trainings")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A take to clicks, in a folder of its own."""
    folder = tmp_path_factory.mktemp("taught") / "takes"
    folder.mkdir()
    save_motion(folder / "steps.bvh", stepping(24 * 30, period_s=0.5, seed=1))
    write_clicks(folder / "steps.wav", duration_s=24.0)
    return folder


def weights(built: cg.BuildResult) -> np.ndarray:
    return np.concatenate([values.ravel() for values in built.repertoire.net("rollout").weights.values()])


def test_the_rollout_learns_from_graph_dances_unless_told_otherwise(folder, monkeypatch):
    settings = {"preset": "tiny", "rollout": True}
    taught = cg.build(folder, folder.parent / "taught.h5", **settings)
    alone = cg.build(folder, folder.parent / "alone.h5", rollout_teacher=False, **settings)
    assert taught.repertoire.provenance["rollout_teacher"] is True
    assert alone.repertoire.provenance["rollout_teacher"] is False
    assert not np.allclose(weights(taught), weights(alone))
    plans = list((folder.parent / "taught.h5.build").glob("graph-dances-*/*.json"))
    assert len(plans) == 1 + building.AGAIN_PER_GENRE
    assert not list((folder.parent / "alone.h5.build").glob("graph-dances-*"))

    before = plans[0].stat().st_mtime_ns
    resumed = cg.build(folder, folder.parent / "taught.h5", resume=True, **settings)
    assert np.array_equal(weights(resumed), weights(taught))
    assert plans[0].stat().st_mtime_ns == before
    # A checkpoint of a network that was taught is not continued without its teacher.
    untaught = cg.build(folder, folder.parent / "taught.h5", resume=True, rollout_teacher=False, **settings)
    assert np.array_equal(weights(untaught), weights(alone))
    assert any("training of rollout starts again" in note for note in untaught.notes)


def test_no_dances_are_made_where_no_rollout_is_trained(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(building, "teach_rollout", lambda *a, **k: pytest.fail("danced for nothing"))
    built = cg.build(folder, tmp_path / "a.h5", preset="tiny")
    assert "rollout" not in built.repertoire.net_names
    assert built.repertoire.provenance["rollout_teacher"] is False
