"""The dance-with-melody importer on real data, where there is any, and on damaged files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from choreograph.core.errors import FormatError
from choreograph.formats import dance_with_melody
from choreograph.formats.register import import_takes
from choreograph.motion import rotations as rot
from choreograph.motion.kinematics import forward
from choreograph.motion.marker_fitting import cluster_bodies, fit_error_m, fit_positions, measure_skeleton
from choreograph.motion.skeleton import canonical_skeleton

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "dance-with-melody"


def _write(folder: Path, **changes) -> Path:
    folder.mkdir()
    data = {"length": 3, "center": [[0, 0, 0]] * 3, "skeletons": [[[0, 0, 0]] * 23] * 3} | changes
    (folder / "skeletons.json").write_text(json.dumps(data))
    (folder / "config.json").write_text(json.dumps({"start_position": 0, "end_position": 3}))
    return folder


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"center": [[0, 0]] * 3}, "expected center"),
        ({"center": None}, "expected center|expected numbers"),
        ({"length": 9}, "cut short"),
        ({"center": [[float("nan"), 0, 0]] * 3}, "finite"),
    ],
)
def test_damaged_files_end_in_one_line(tmp_path, changes, words):
    with pytest.raises(FormatError, match=words) as caught:
        list(import_takes(_write(tmp_path / "DANCE_C_9", **changes)))
    assert "\n" not in str(caught.value)


def test_not_json(tmp_path):
    folder = _write(tmp_path / "DANCE_W_9")
    (folder / "skeletons.json").write_text("{")
    with pytest.raises(FormatError, match="JSON"):
        list(import_takes(tmp_path))


def test_other_folders_are_not_detected(tmp_path):
    assert not dance_with_melody.detect(tmp_path)


def test_joins_by_straight_lines_are_found_and_stillness_is_not():
    rng = np.random.default_rng(2)
    pos_m = np.cumsum(rng.normal(0, 0.01, (120, 22, 3)), axis=0)
    for start in (20, 70):
        weight = np.linspace(0, 1, 7)[:, None, None]
        pos_m[start - 1 : start + 6] = pos_m[start - 1] * (1 - weight) + pos_m[start + 5] * weight
    pos_m[90:110] = pos_m[90]
    assert dance_with_melody.straight_spans(np.round(pos_m, 4)) == [(20, 25), (70, 75)]


def _dancer(stature: float, thigh: float, n_frames: int, phase: float) -> np.ndarray:
    """Markers (T, 22, 3) of a synthetic body that bends, waves and walks, turning."""
    canonical = canonical_skeleton()
    offsets = stature * canonical.offsets_m
    offsets[[canonical.index(f"{side}_knee") for side in ("left", "right")]] *= thigh
    skeleton = replace(canonical, offsets_m=offsets)
    wave = np.sin(np.linspace(0, 9, n_frames) + phase)
    turns = np.zeros((n_frames, 24, 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turns[:, skeleton.index(f"{side}_hip"), 0] = -0.5 + 0.4 * sign * wave
        turns[:, skeleton.index(f"{side}_knee"), 0] = 0.8 + 0.4 * wave
        turns[:, skeleton.index(f"{side}_elbow"), 1] = sign * (-0.7 + 0.5 * wave)
        turns[:, skeleton.index(f"{side}_shoulder"), 2] = sign * (-0.6 + 0.4 * wave)
    turns[:, 0, 1] = np.linspace(0, 4, n_frames)
    root_pos_m = stature * np.stack([wave, np.full(n_frames, 0.85), wave**2], axis=-1)
    pos_m, world = forward(skeleton, root_pos_m, rot.from_rotvec(turns))

    def marker(role: str) -> np.ndarray:
        side, part = role.split("_") if "_" in role else ("", role)
        if part == "heel":
            parent, offset = skeleton.index(f"{side}_ankle"), np.array([0.0, -0.05, -0.05])
        elif part == "temple":
            parent, offset = skeleton.index("head"), np.array([0.07 if side == "left" else -0.07, 0.0, 0.0])
        else:
            return pos_m[:, skeleton.index(role)]
        return pos_m[:, parent] + rot.rotate(world[:, parent], stature * offset)

    return np.stack([marker(role) for role in dance_with_melody.ROLES], axis=1)


def test_spliced_bodies_of_several_sizes_come_out_on_one_skeleton():
    frames = 200
    synthetic = [
        _dancer(1.08, 1.04, frames, 0.0),
        _dancer(0.95, 1.0, frames, 1.0),
        _dancer(1.0, 0.94, frames, 2.0),
    ]
    pos_m = np.concatenate(synthetic)
    bodies = cluster_bodies(pos_m, dance_with_melody.ROLES, 3)
    assert len(bodies.skeletons) == 3
    skeleton = measure_skeleton(pos_m, dance_with_melody.ROLES)
    _, quat, error_m = dance_with_melody.fit_bodies(skeleton, bodies, pos_m, 25.0)
    inside = np.ones(3 * frames, bool)
    for cut in (frames, 2 * frames):  # spliced without a crossfade: a jump that no motion has
        inside[cut - 15 : cut + 15] = False
    assert error_m[inside].mean() < 0.02
    step = inside[1:] & inside[:-1]
    cosine = np.abs(np.sum(quat[1:] * quat[:-1], axis=-1))[step]
    assert np.degrees(2 * np.arccos(cosine.clip(0, 1))).max() < 60
    tall = slice(15, frames - 15)
    as_captured = fit_positions(skeleton, pos_m, dance_with_melody.ROLES, fps=25.0)
    unsized_m = fit_error_m(skeleton, *as_captured, pos_m, dance_with_melody.ROLES)
    assert error_m[tall].mean() < 0.6 * unsized_m[tall].mean()


@pytest.mark.skipif(not DATA.is_dir(), reason=f"the real data is not at {DATA}")
def test_a_real_take_fits_and_stands_on_the_floor():
    (take,) = dance_with_melody.read(DATA / "DANCE_W_23")
    pos = dance_with_melody.read_points_m(DATA / "DANCE_W_23" / "skeletons.json")
    bodies = cluster_bodies(pos, dance_with_melody.ROLES, 1)
    fitted = dance_with_melody.fit_bodies(take.motion.skeleton, bodies, pos, take.motion.fps)
    assert fitted[2].mean() < 0.01  # one body, its own bones
    assert take.credits.genre == "waltz"
    assert take.motion.duration_s == pytest.approx(1036 / 25)
    lowest = dance_with_melody.sole_pos_m(take.motion)[..., 1].min(axis=1)
    assert abs(np.median(lowest)) < 0.03


@pytest.mark.skipif(not DATA.is_dir(), reason=f"the real data is not at {DATA}")
def test_real_takes_of_two_bodies_fit_their_markers_on_one_skeleton(tmp_path):
    for name in ("DANCE_C_2", "DANCE_C_6", "DANCE_W_5"):  # the hardest by body, by jumps, by splices
        (tmp_path / name).symlink_to(DATA / name)
    takes = list(dance_with_melody.read(tmp_path))
    points = [dance_with_melody.read_points_m(DATA / take.name / "skeletons.json") for take in takes]
    bodies = cluster_bodies(np.concatenate(points), dance_with_melody.ROLES, dance_with_melody.N_BODIES)
    for take, pos_m in zip(takes, points, strict=True):
        skeleton, quat = take.motion.skeleton, take.motion.local_quat
        error_m = dance_with_melody.fit_bodies(skeleton, bodies, pos_m, take.motion.fps)[2]
        assert error_m.mean() < 0.02
        assert np.abs(np.sum(quat[1:] * quat[:-1], axis=-1)).min() > np.cos(np.pi / 4)  # no turn over 90°
