"""Takes told from takes: motion that differs is told, and the same motion is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import choreograph as cg
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.skeleton import canonical_skeleton
from research import real_from_real as controls
from research.real_from_real import STEPS, Recorded
from research.real_or_built_in import windows_of


def takes_at(speed_hz: float, source: str, n: int = 6) -> list[controls.Body]:
    """Takes of 8 s whose joints swing at a frequency, each with its own phases."""
    rng = np.random.default_rng(round(10 * speed_hz))
    times = np.arange(160) / 20.0
    standing = body_pos_m(standing_take().motion)[0]
    bodies = []
    for number in range(n):
        phase = rng.uniform(0, 2 * np.pi, (len(BODY_JOINTS), 3))
        swing = 0.1 * np.sin(2 * np.pi * speed_hz * times[:, None, None] + phase)
        bodies.append((f"{source}-{number}", "waltz", source, standing + swing))
    return bodies


def standing_take() -> Recorded:
    from choreograph.motion.motion import Motion

    skeleton = canonical_skeleton()
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (50, skeleton.n_joints, 1))
    root = np.tile([0.0, skeleton.offsets_m[0][1], 0.0], (50, 1))
    return Recorded("stand", "waltz", "none", Motion(skeleton, root, quat, 25.0))


@pytest.fixture(scope="module", autouse=True)
def short_training():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("research.real_or_built_in.STEPS", 60)
        yield


def test_sources_that_differ_are_told_and_takes_of_one_source_are_not():
    slow, fast = takes_at(0.5, "slow"), takes_at(2.0, "fast")
    rows = {what: mean for what, mean, _ in controls.of_sources([*slow, *fast], 1)}
    assert rows["slow or fast"] > 0.95 and rows["slow or the other real takes"] > 0.95
    mean, _ = controls.of_halves(takes_at(1.0, "one", n=12), 2)
    assert 0.2 < mean < 0.8


def test_built_in_takes_are_never_among_the_real_ones_that_a_source_is_told_from(monkeypatch):
    seen = []
    monkeypatch.setattr(controls, "auc", lambda first, second, seed: seen.append(set(first.source)) or 0.5)
    bodies = [*takes_at(0.5, "a", 4), *takes_at(1.0, "b", 4), *takes_at(2.0, controls.BUILT_IN, 4)]
    list(controls.of_sources(bodies, 1))
    assert seen[:3] == [{"b"}, {"a"}, {"a", "b"}]


def test_a_genre_with_too_few_takes_in_a_source_is_left_out():
    many, few = takes_at(0.5, "many", 4), takes_at(2.0, "few", 3)
    assert list(controls.of_genres([*many, *few], ["waltz"], 1)) == []
    rows = list(controls.of_genres([*many, *takes_at(2.0, "also", 4)], ["waltz", "tango"], 1))
    assert [what for what, *_ in rows] == ["waltz: many or also"]


def test_takes_are_not_told_from_themselves_and_from_other_motion_they_are(monkeypatch):
    found = {}

    def kept(first, second, seed):
        found[len(found)] = np.abs(first.velocity - second.velocity).max()
        return 0.5

    monkeypatch.setattr(controls, "auc", kept)
    rows = list(controls.of_steps([standing_take(), standing_take()], 1))
    assert [what for what, *_ in rows] == list(STEPS)
    assert found[0] == 0.0 and max(found.values()) < 1e-6  # a body that stands still stays as it is


def test_every_step_keeps_the_length_of_a_take():
    motion = standing_take().motion
    for what, step in STEPS.items():
        assert step(motion).duration_s == pytest.approx(motion.duration_s, abs=1 / controls.LOW_FPS), what


def test_built_in_takes_are_on_the_same_skeleton_as_real_ones():
    starter = cg.starter_repertoire()
    two = SimpleNamespace(takes=starter.takes[:2], motion=starter.motion)
    bodies = controls.on_skeleton([standing_take()], two, canonical_skeleton())
    assert [body[2] for body in bodies] == ["none", controls.BUILT_IN, controls.BUILT_IN]

    def bone_m(body):
        pos = body[3]
        return np.linalg.norm(
            pos[:, BODY_JOINTS.index("left_ankle")] - pos[:, BODY_JOINTS.index("left_knee")], axis=1
        )

    for body in bodies:
        np.testing.assert_allclose(bone_m(body), bone_m(bodies[0])[0], atol=1e-6)


def test_takes_of_one_part_are_all_trained_on_or_all_tested_on():
    bodies = takes_at(1.0, "one", 3)
    both = controls.joined(controls.in_part(bodies[:2], False), controls.in_part(bodies[2:], True))
    n = len(windows_of(bodies[:1]).genre)
    assert both.is_tested.tolist() == [False] * 2 * n + [True] * n
    assert not controls.can_be_told(controls.in_part(bodies, True)) and controls.can_be_told(both)
