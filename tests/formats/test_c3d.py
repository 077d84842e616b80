"""C3D: markers, joint centres and takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_markers import markers_on, write_c3d
from synthetic_motions import swaying

from choreograph.core.errors import FormatError, ParameterError
from choreograph.formats.c3d import REQUIRED_MARKERS, joint_centres, read_c3d_files, read_markers
from choreograph.formats.register import import_takes
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.kinematics import forward

STEPS = swaying(400, fps=80.0)
SKIN_MARKERS = markers_on(STEPS)
# The hand, from a marker, and the landmarks are where they are defined to be.
FOUND = tuple(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
)


def error_m(markers) -> dict[str, float]:
    pos_m, roles = joint_centres(markers)
    true_m = STEPS.joint_pos_m()
    moved = (pos_m[:, roles.index(role)] - true_m[:, STEPS.skeleton.index(role)] for role in FOUND)
    return {role: float(np.linalg.norm(d, axis=-1).mean()) for role, d in zip(FOUND, moved, strict=True)}


def test_joints_are_found_inside_the_body():
    errors = error_m(SKIN_MARKERS)
    assert max(errors.values()) < 0.02
    on_skin = SKIN_MARKERS["LKNE"] - STEPS.joint_pos_m()[:, STEPS.skeleton.index("left_knee")]
    assert errors["left_knee"] < 0.25 * np.linalg.norm(on_skin, axis=-1).mean()


def test_bones_keep_their_length():
    pos_m, roles = joint_centres(SKIN_MARKERS)
    for side in ("left", "right"):
        for a, b in (("hip", "knee"), ("knee", "ankle"), ("elbow", "wrist")):
            bone = pos_m[:, roles.index(f"{side}_{a}")] - pos_m[:, roles.index(f"{side}_{b}")]
            assert np.linalg.norm(bone, axis=-1).std() < 0.006


def test_markers_placed_too_high_are_corrected_by_the_motion():
    """Some performers of ChoreoNet have their ankle markers 5 cm above the ankle."""
    up = 0.125 * (SKIN_MARKERS["LKNE"] - SKIN_MARKERS["LANK"])
    assert np.linalg.norm(up, axis=-1).mean() > 0.045
    errors = error_m(SKIN_MARKERS | {"LANK": SKIN_MARKERS["LANK"] + up})
    assert errors["left_ankle"] < 0.025


def test_the_directions_of_left_and_right_are_kept():
    mirror = np.array([-1.0, 1.0, 1.0])
    mirrored = {
        name.translate({ord("L"): "R", ord("R"): "L"})[0] + name[1:]: pos * mirror
        for name, pos in SKIN_MARKERS.items()
        if name in REQUIRED_MARKERS and name[1:] in {m[1:] for m in REQUIRED_MARKERS if m[0] == "R"}
    } | {name: SKIN_MARKERS[name] * mirror for name in ("C7", "T10", "CLAV", "STRN")}
    without_extras = {name: SKIN_MARKERS[name] for name in REQUIRED_MARKERS}
    there, roles = joint_centres(without_extras)
    back, _ = joint_centres(mirrored)
    for role in FOUND:
        other = role.replace("left", "*").replace("right", "left").replace("*", "right")
        np.testing.assert_allclose(
            back[:, roles.index(other)] * mirror, there[:, roles.index(role)], atol=2e-3
        )


def test_stretched_knees_are_straight_not_bent_back():
    """The shank's markers 3 cm too far in front: every knee seems bent back by some degrees."""
    names = STEPS.skeleton.names
    quat = STEPS.local_quat.copy()
    for side in ("left", "right"):  # half of the frames with straight legs
        quat[::2, names.index(f"{side}_knee")] = [1.0, 0.0, 0.0, 0.0]
    motion = replace(STEPS, local_quat=quat)
    markers = markers_on(motion)
    pos_m, _ = forward(motion.skeleton, motion.root_pos_m, quat)
    hip, ankle = (pos_m[:, names.index(f"left_{part}")] for part in ("hip", "ankle"))
    backwards = np.cross(markers["LKNE"] - hip, ankle - hip)
    backwards = backwards / np.linalg.norm(backwards, axis=-1, keepdims=True)
    for shift_m in (-0.03, 0.0):
        moved = {name: markers[name] + shift_m * backwards for name in ("LKNE", "LTHI")}
        centres, roles = joint_centres(markers | moved)
        hip, knee, ankle = (centres[:, roles.index(f"left_{part}")] for part in ("hip", "knee", "ankle"))
        bend = np.sum(np.cross(knee - hip, ankle - knee) * (markers["LKNE"] - knee), axis=-1)
        assert np.percentile(bend, 5) > -1e-4


def test_a_missing_marker_is_named():
    with pytest.raises(ParameterError, match=r"missing LTHI$"):
        joint_centres({name: pos for name, pos in SKIN_MARKERS.items() if name != "LTHI"})


MOTION = swaying(240, fps=80.0)
MARKERS = markers_on(MOTION)


def test_a_planted_body_comes_back(tmp_path):
    (take,) = import_takes(write_c3d(tmp_path / "a.c3d", MARKERS))
    assert (take.name, take.song_path, take.motion.fps) == ("a", None, 60.0)
    assert take.motion.duration_s == pytest.approx(3.0)
    found, true = body_pos_m(take.motion), body_pos_m(MOTION.resampled(60.0))
    # The trunk's inner joints have no markers: only where the limbs are can be compared.
    parts = ("knee", "ankle", "elbow", "wrist")
    limbs = [BODY_JOINTS.index(f"{side}_{part}") for side in ("left", "right") for part in parts]
    error_m = np.linalg.norm(found[:, limbs] - true[:, limbs], axis=-1)
    assert np.median(error_m) < 0.03 and error_m.max() < 0.08


def test_recordings_of_a_folder_share_a_skeleton_and_take_songs_and_credits(tmp_path):
    write_c3d(tmp_path / "a.c3d", MARKERS)
    write_c3d(tmp_path / "b.C3D", {name: 1.1 * pos for name, pos in MARKERS.items()}, prefix="")
    (tmp_path / "b.wav").touch()
    (tmp_path / "manifest.csv").write_text("name,genre\nb.c3d,rumba\n")
    a, b = import_takes(tmp_path)
    assert a.motion.skeleton.same_as(b.motion.skeleton)
    assert (b.credits.genre, b.song_path) == ("rumba", tmp_path / "b.wav")
    np.testing.assert_allclose(body_pos_m(a.motion)[:, 0, 1], body_pos_m(b.motion)[:, 0, 1], atol=0.01)


def test_one_name_for_two_motions_is_refused(tmp_path):
    write_c3d(tmp_path / "a.c3d", MARKERS)
    (tmp_path / "a.bvh").touch()
    with pytest.raises(FormatError, match=r"one motion of each name, got a\.bvh"):
        list(import_takes(tmp_path))


def test_gaps_are_filled_and_long_ones_noted(tmp_path):
    gap = slice(100, 110)
    path = write_c3d(
        tmp_path / "a.c3d", MARKERS, missing={"LKNE": gap}, zeros={"RTHI": slice(50, 80), "LFIN": slice(0, 5)}
    )
    markers = read_markers(path)
    assert markers.notes == ("marker RTHI is missing for 0.38 s, which was interpolated",)
    assert markers.fps == 80.0 and markers.n_frames == 240
    np.testing.assert_allclose(markers.pos_m["LKNE"][gap], MARKERS["LKNE"][gap], atol=0.01)
    held = np.repeat(MARKERS["LFIN"][5:6], 5, axis=0)
    np.testing.assert_allclose(markers.pos_m["LFIN"][:5], held, atol=1e-4)


def test_samples_that_jump_are_gaps(tmp_path):
    jumping = MARKERS["RHEE"].copy()
    jumping[120:122] += [0.2, 0.0, 0.1]
    found = read_markers(write_c3d(tmp_path / "a.c3d", MARKERS | {"RHEE": jumping})).pos_m["RHEE"]
    np.testing.assert_allclose(found, MARKERS["RHEE"], atol=0.01)


@pytest.mark.parametrize("unit", ["m", "cm"])
def test_other_units(tmp_path, unit):
    scale = {"m": 0.001, "cm": 0.1}[unit]
    path = write_c3d(tmp_path / "a.c3d", {n: scale * p for n, p in MARKERS.items()}, unit=unit)
    np.testing.assert_allclose(read_markers(path).pos_m["LTOE"], MARKERS["LTOE"], atol=1e-3)


def test_other_names_of_markers(tmp_path):
    renamed = {{"LFWT": "LASI", "RBWT": "RPSI", "LSHN": "LTIB"}.get(n, n): p for n, p in MARKERS.items()}
    points = renamed | {"*12": MARKERS["C7"]}
    assert set(read_markers(write_c3d(tmp_path / "a.c3d", points)).pos_m) == set(MARKERS)


def test_props_are_not_read_and_noted(tmp_path):
    stick = {f"stick:{name}": MARKERS["LFIN"] + 0.3 for name in ("TOP", "C7")}
    points = {f"Ada:{name}": pos_m for name, pos_m in MARKERS.items()} | stick
    read = read_markers(write_c3d(tmp_path / "a.c3d", points, prefix=""))
    assert set(read.pos_m) == set(MARKERS)
    np.testing.assert_allclose(read.pos_m["C7"], MARKERS["C7"], atol=1e-3)
    assert read.notes == ("markers of stick are not read, because they are not those of a body",)
    two = {f"{who}:{name}": pos_m for name, pos_m in MARKERS.items() for who in ("Ada", "Ben")}
    with pytest.raises(FormatError, match="expected one dancer, got subjects Ada, Ben"):
        read_markers(write_c3d(tmp_path / "b.c3d", two, prefix=""))


def test_fingers_without_a_marker(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", {n: p for n, p in MARKERS.items() if n != "RFIN"})
    ((motion, _),) = read_c3d_files([path])
    bone = motion.skeleton.offsets_m[motion.skeleton.index("right_hand")]
    assert np.linalg.norm(bone) == pytest.approx(0.085, abs=0.002)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda markers: {n: p for n, p in markers.items() if n != "LTHI"}, "missing LTHI"),
        (lambda markers: {n: 0.0 * p for n, p in markers.items()}, "none with a valid sample"),
        (lambda markers: {n: 1e-6 * p for n, p in markers.items()}, r"a body, got one .* m tall"),
        (lambda markers: {n: 90.0 * p for n, p in markers.items()}, r"a body, got one .* m tall"),
        (lambda markers: {n: 1e30 * p for n, p in markers.items()}, "none with a valid sample"),
        (lambda markers: markers | {"LKNE": 0 * markers["LKNE"] + 900}, r"damaged|a body"),
        (lambda markers: {f"{n[0]}:{n}": p for n, p in markers.items()}, "subjects C, L, R"),
    ],
)
def test_markers_that_cannot_be_fitted(tmp_path, change, message):
    path = write_c3d(tmp_path / "a.c3d", change(MARKERS), prefix="")
    with pytest.raises(FormatError, match=message) as caught:
        list(import_takes(path))
    assert "a.c3d" in str(caught.value) and "\n" not in str(caught.value)


def test_a_unit_that_is_none(tmp_path):
    with pytest.raises(FormatError, match="expected a unit"):
        read_markers(write_c3d(tmp_path / "a.c3d", MARKERS, unit="V"))


@pytest.mark.parametrize("share", [0.0, 0.002, 0.01, 0.3, 0.9])
def test_files_that_are_cut_off(tmp_path, share):
    path = write_c3d(tmp_path / "a.c3d", MARKERS)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(FormatError, match=r"damaged|cut short") as caught:
        list(import_takes(path))
    assert "\n" not in str(caught.value)


def test_more_labels_than_points(tmp_path):
    path = write_c3d(tmp_path / "a.c3d", MARKERS)
    content = bytearray(path.read_bytes())
    # After the name: two bytes to the next one, the type, two dimensions, the length and number of labels.
    content[content.index(b"LABELS") + 11] += 1
    path.write_bytes(bytes(content))
    with pytest.raises(FormatError, match=r"a\.c3d: expected a point for each of 41 labels, got 40"):
        list(import_takes(path))


def test_a_recording_over_an_hour_is_refused(tmp_path):
    with pytest.raises(FormatError, match="up to an hour"):
        list(import_takes(write_c3d(tmp_path / "a.c3d", MARKERS, fps=0.05)))


def test_bytes_that_are_no_c3d(tmp_path):
    rng = np.random.default_rng(0)
    for trial in range(50):
        path = tmp_path / f"{trial}.c3d"
        path.write_bytes((b"\x02\x50" if trial % 2 else b"") + rng.bytes(4096))
        with pytest.raises(FormatError):
            list(import_takes(path))


def test_a_real_recording_bends_and_stands_as_people_do(shared_data):
    path = shared_data / "choreonet" / "c3d" / "ll_qq_03_3.c3d"
    markers = read_markers(path).pos_m
    ((motion, notes),) = read_c3d_files([path])
    pos_m = motion.joint_pos_m()
    at = {name: pos_m[:, index] for index, name in enumerate(motion.skeleton.names)}
    for side, marker, sign in (("left", "LKNE", 1.0), ("right", "RKNE", -1.0)):
        hip, knee, ankle = (at[f"{side}_{part}"] for part in ("hip", "knee", "ankle"))
        outwards = markers[marker] - knee
        thigh, shank, axis = (
            v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (knee - hip, ankle - knee, outwards)
        )
        degrees = np.degrees(np.arcsin(sign * np.sum(np.cross(thigh, shank) * axis, axis=-1)))
        assert degrees.min() > -8.0 and np.percentile(degrees, 90) > 20.0
        assert np.linalg.norm(hip - knee, axis=-1).mean() == pytest.approx(0.45, abs=0.06)
    lowest_m = np.minimum(at["left_foot"][:, 1], at["right_foot"][:, 1])
    assert np.ptp(lowest_m) < 0.05
    assert np.linalg.norm(np.diff(pos_m, n=2, axis=0), axis=-1).max() < 0.05
    assert notes == ("joints, estimated from markers, are fitted within 0.7 cm on average",)
