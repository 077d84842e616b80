"""VMD: planted answers in the axes of MikuMikuDance, round trips, IK of feet, and damaged files."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from synthetic_motions import swaying

import choreograph as cg
from choreograph.core.counts import Figure
from choreograph.core.errors import ChoreographError, FormatError
from choreograph.formats.register import load_motion, save_motion
from choreograph.formats.vmd import (
    UNIT_M,
    BoneKeys,
    VmdWriter,
    curve_value,
    hinged_thigh,
    on_hinges,
    parse_vmd,
    read_vmd,
    standard_body,
    vmd_bytes,
)
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget

BODY = standard_body()
QUARTER = float(np.sqrt(0.5))


def key(frame: int, quat=rot.IDENTITY, pos=(0.0, 0.0, 0.0), handles=(20, 20, 107, 107)) -> BoneKeys:
    """One key in the axes of the file, with the same curve for all of its values."""
    curves = np.tile(np.array(handles) / 127, (1, 4, 1))
    return BoneKeys(np.array([frame]), np.array([pos], float), np.array([quat], float), curves)


def joined(*keys: BoneKeys) -> BoneKeys:
    return BoneKeys(
        *(np.concatenate([getattr(k, f) for k in keys]) for f in ("frames", "pos", "quat", "curves"))
    )


def posed(tmp_path, bones, switches=b"") -> Motion:
    path = tmp_path / "a.vmd"
    content = vmd_bytes("test", bones, [])
    path.write_bytes(content[: len(content) - 13] + switches if switches else content)
    return read_vmd(path)[0]


def place(motion: Motion, name: str, frame: int = 0) -> np.ndarray:
    return motion.joint_pos_m()[frame, BODY.index(name)]


def test_the_body_stands_in_front_of_the_audience():
    rest = BODY.rest_pos_m()
    assert rest[BODY.index("左つま先"), 1] == pytest.approx(0.0)
    assert rest[BODY.index("左つま先"), 2] > rest[BODY.index("左足首"), 2]
    assert rest[BODY.index("左腕"), 0] > 0 > rest[BODY.index("右腕"), 0]
    assert rest[BODY.index("頭"), 1] + BODY.tips_m[0, 1] == pytest.approx(1.60)
    arm = rest[BODY.index("左ひじ")] - rest[BODY.index("左腕")]
    assert np.degrees(np.arctan2(-arm[1], arm[0])) == pytest.approx(38.0)


def test_a_head_that_turns_right_turns_right(tmp_path):
    # About +Y of left-handed axes, a positive angle turns the face from -Z to -X, which is the right.
    motion = posed(tmp_path, {"頭": key(0, (QUARTER, 0.0, QUARTER, 0.0))})
    facing = rot.rotate(motion.local_quat[0, BODY.index("頭")], np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(facing, [-1.0, 0.0, 0.0], atol=1e-6)


def test_an_arm_by_90_degrees(tmp_path):
    # About +Z, which points to the back of a model: X goes to Y as everywhere, so the left arm rises.
    motion = posed(tmp_path, {"左腕": key(0, (QUARTER, 0.0, 0.0, QUARTER))})
    arm = place(motion, "左ひじ") - place(motion, "左腕")
    angle = np.radians(90.0 - 38.0)
    np.testing.assert_allclose(arm, 2.9 * UNIT_M * np.array([np.cos(angle), np.sin(angle), 0.0]), atol=1e-6)


def test_upper_and_lower_body_turn_apart(tmp_path):
    turn = (QUARTER, 0.0, QUARTER, 0.0)
    rest = BODY.rest_pos_m()
    lower = posed(tmp_path, {"下半身": key(0, turn)})
    np.testing.assert_allclose(place(lower, "左腕"), rest[BODY.index("左腕")], atol=1e-6)
    np.testing.assert_allclose(place(lower, "左足") - place(lower, "下半身"), [0, -0.08, 0.072], atol=1e-6)
    upper = posed(tmp_path, {"上半身": key(0, turn)})
    np.testing.assert_allclose(place(upper, "左足"), rest[BODY.index("左足")], atol=1e-6)
    assert place(upper, "左腕")[2] > 0.1
    centre = posed(tmp_path, {"センター": key(0, turn, (1.0, 2.0, 3.0))})
    shift = np.array([1.0, 2.0, -3.0]) * UNIT_M
    np.testing.assert_allclose(place(centre, "下半身"), rest[0] + shift, atol=1e-6)
    assert place(centre, "左腕")[2] > -0.2 and place(centre, "左足")[2] == pytest.approx(shift[2] + 0.072)


def test_twists_and_parents_of_shoulders_apply(tmp_path):
    turn = (QUARTER, 0.0, 0.0, QUARTER)
    apart = posed(tmp_path, {"左腕捩": key(0, turn)})
    as_elbow = posed(tmp_path, {"左ひじ": key(0, turn)})
    np.testing.assert_allclose(apart.joint_pos_m(), as_elbow.joint_pos_m(), atol=1e-6)
    shoulder = posed(tmp_path, {"左肩P": key(0, turn)})
    arm = place(shoulder, "左ひじ") - place(shoulder, "左腕")
    rest = BODY.offsets_m[BODY.index("左ひじ")]
    np.testing.assert_allclose(arm, rest, atol=1e-6)  # the shoulder rises, the arm keeps its direction
    assert place(shoulder, "左腕")[1] > BODY.rest_pos_m()[BODY.index("左腕"), 1]


def test_curves_as_computed_by_hand():
    # x(s) = 3 (1 - s)² s + s³ and y(s) = 3 (1 - s) s² + s³: at s = 1/4, x = 0.4375 and y = 0.15625.
    handles = np.tile([1.0, 0.0, 0.0, 1.0], (4, 1))
    value = curve_value(handles, np.array([0.0, 0.4375, 0.5625, 1.0]))
    np.testing.assert_allclose(value, [0.0, 0.15625, 0.84375, 1.0], atol=1e-9)
    straight = np.tile(np.array([20, 20, 107, 107]) / 127, (3, 1))
    np.testing.assert_allclose(curve_value(straight, np.array([0.1, 0.5, 0.9])), [0.1, 0.5, 0.9])


def test_sparse_keys_follow_their_curves(tmp_path):
    # The curve belongs to the later key. 7 of 16 frames are 0.4375, which is 0.15625 of the way.
    bent = key(16, pos=(16.0, 0.0, 0.0), handles=(127, 0, 0, 127))
    motion = posed(tmp_path, {"センター": joined(key(0), bent)})
    assert motion.n_frames == 17 and motion.fps == 30
    assert motion.root_pos_m[7, 0] == pytest.approx(16 * 0.15625 * UNIT_M, abs=1e-5)


def test_a_curve_is_read_beside_bytes_with_another_use(tmp_path):
    content = bytearray(vmd_bytes("a", {"センター": key(16, handles=(127, 0, 0, 127))}, []))
    first = 54 + 47
    assert content[first : first + 4] == bytes([127] * 4)
    content[first + 2 : first + 4] = b"\0\0"  # physics are switched here by new programs
    np.testing.assert_allclose(parse_vmd(bytes(content)).bones["センター"].curves[0, 3], [1, 0, 0, 1])


def test_a_foot_is_put_on_its_target(tmp_path):
    rest = BODY.rest_pos_m()
    bones = {"左足ＩＫ": key(0, (QUARTER, 0.0, QUARTER, 0.0), pos=(0.5, 2.0, -1.0))}
    motion = posed(tmp_path, bones)
    target = rest[BODY.index("左足首")] + np.array([0.5, 2.0, 1.0]) * UNIT_M
    np.testing.assert_allclose(place(motion, "左足首"), target, atol=1e-6)
    assert place(motion, "左ひざ")[2] > rest[BODY.index("左ひざ"), 2] + 0.05  # the knee bends to the front
    toe = place(motion, "左つま先") - place(motion, "左足首")
    np.testing.assert_allclose(toe, [-1.75 * UNIT_M, -1.3 * UNIT_M, 0.0], atol=1e-6)
    np.testing.assert_allclose(place(motion, "右足首"), rest[BODY.index("右足首")], atol=1e-6)


def test_a_target_out_of_reach_is_pointed_at(tmp_path):
    motion = posed(tmp_path, {"左足ＩＫ": key(0, pos=(30.0, 0.0, 0.0))})
    leg = place(motion, "左足首") - place(motion, "左足")
    lengths = [np.linalg.norm(BODY.offsets_m[BODY.index(name)]) for name in ("左ひざ", "左足首")]
    assert np.linalg.norm(leg) == pytest.approx(sum(lengths))


def test_without_ik_legs_have_their_own_rotations(tmp_path):
    bones = {"左足": key(0, (QUARTER, QUARTER, 0.0, 0.0)), "左足ＩＫ": key(0)}
    name = "左足ＩＫ".encode("cp932").ljust(20, b"\0")
    off = struct.pack("<IIBI", 1, 0, 1, 1) + name + b"\0"
    held, free = posed(tmp_path, bones), posed(tmp_path, bones, off)
    np.testing.assert_allclose(place(held, "左足首"), BODY.rest_pos_m()[BODY.index("左足首")], atol=1e-6)
    assert place(free, "左ひざ")[2] == pytest.approx(4.9 * UNIT_M)  # raised to the front
    only_fk = posed(tmp_path, {"左足": bones["左足"]})
    np.testing.assert_allclose(only_fk.joint_pos_m(), free.joint_pos_m(), atol=1e-9)


@pytest.mark.parametrize("take", [0, 60, 132])
def test_takes_come_back(tmp_path, take):
    motion, _ = cg.starter_repertoire().motion(take, start_s=0.0, stop_s=6.0)
    n_frames = round(motion.duration_s * 30)
    expected = retarget(motion.sampled_smooth(np.arange(n_frames) / 30 * motion.fps, fps=30.0), BODY)
    save_motion(tmp_path / "a.vmd", motion)
    back = read_vmd(tmp_path / "a.vmd")[0]
    off_m = np.linalg.norm(back.joint_pos_m() - expected.joint_pos_m(), axis=-1)
    assert off_m.max() < 0.010


def test_a_motion_of_the_body_comes_back_twice_and_has_feet_in_both_ways(tmp_path):
    first = read_vmd_of(tmp_path, retarget(swaying(60), BODY))
    again = read_vmd_of(tmp_path, first)
    np.testing.assert_allclose(again.joint_pos_m(), first.joint_pos_m(), atol=1e-5)
    content = (tmp_path / "a.vmd").read_bytes()
    bones = {name: keys for name, keys in parse_vmd(content).bones.items() if "IK" not in name}
    np.testing.assert_allclose(posed(tmp_path, bones).joint_pos_m(), first.joint_pos_m(), atol=1e-5)


def read_vmd_of(tmp_path, motion: Motion) -> Motion:
    save_motion(tmp_path / "a.vmd", motion)
    return read_vmd(tmp_path / "a.vmd")[0]


def test_knees_are_hinges_that_do_not_bend_back():
    rng = np.random.default_rng(3)
    local = np.tile(rot.IDENTITY, (200, BODY.n_joints, 1))
    hip, knee, ankle = (BODY.index(f"左{name}") for name in ("足", "ひざ", "足首"))
    local[:, hip] = rot.from_rotvec(rng.normal(0.0, 0.6, (200, 3)))
    local[:, knee] = rot.from_rotvec(rng.uniform(-0.2, 2.0, (200, 1)) * np.array([[1.0, 0.0, 0.0]]))
    motion = Motion(BODY, np.tile(BODY.offsets_m[0], (200, 1)), local, 30.0)
    hinged = on_hinges(motion)
    bend = rot.to_rotvec(hinged.local_quat[:, knee])
    np.testing.assert_allclose(bend[:, 1:], 0.0, atol=1e-9)
    off_m = np.linalg.norm(hinged.joint_pos_m() - motion.joint_pos_m(), axis=-1)
    np.testing.assert_allclose(off_m[:, ankle], 0.0, atol=1e-9)
    forward = rot.to_rotvec(local[:, knee])[:, 0] > 0.02
    assert off_m[forward].max() < 1e-6 and off_m[~forward].max() > 1e-3


def test_a_thigh_is_twisted_to_the_axis_of_its_knee():
    knee_m, ankle_m = np.array([[0.0, -0.4, 0.0]]), np.array([[-0.2, -0.4, 0.0]])  # the shin points to -X
    thigh = hinged_thigh(rot.about_y(np.array([1.3])), knee_m, ankle_m)
    axis = rot.rotate(thigh, np.array([[1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(axis, [[0.0, 0.0, -1.0]], atol=0.02)


def test_the_file_is_as_models_expect(tmp_path):
    save_motion(tmp_path / "a.vmd", swaying(60, fps=60.0))
    content = (tmp_path / "a.vmd").read_bytes()
    assert content[:50] == b"Vocaloid Motion Data 0002".ljust(30, b"\0") + b"choreograph".ljust(20, b"\0")
    file = parse_vmd(content)
    assert file.bones["センター"].frames.tolist() == list(range(30))
    assert file.switches == {
        f"{side}{name}": ((0, True),) for side in "左右" for name in ("足IK", "つま先IK")
    }
    assert "左足ＩＫ".encode("cp932") in content
    assert all(len(name.encode("cp932")) <= 15 for name in file.bones)


def test_a_dance_has_fingers_in_the_shapes_of_its_figures_and_a_motion_has_none(tmp_path):
    motion = swaying(240, fps=60.0)
    save_motion(tmp_path / "a.vmd", motion)
    plain = parse_vmd((tmp_path / "a.vmd").read_bytes()).bones
    writer = VmdWriter()
    writer.is_dance, writer.figures = True, [Figure("jack", 2.0, 3.0, 4)]
    save_motion(tmp_path / "b.vmd", motion, writer=writer)
    bones = parse_vmd((tmp_path / "b.vmd").read_bytes()).bones
    fingers = {name for name in bones if "指" in name}
    assert not any("指" in name for name in plain) and set(bones) == set(plain) | fingers
    assert {"左親指0", "左人指1", "右中指2", "右薬指3", "左小指1"} < fingers and len(fingers) == 30
    keys = bones["左人指1"]
    # Keys where it begins and changes: half a second around 2 s and 3 s, at 30 fps.
    assert keys.frames[0] == 0 and 20 < len(keys.frames) < 45
    # About +Z of the file, which points to the back: a left hand, below the arm at +X, bends by -Z.
    for frame, degrees in ((0, 18.0), (45, 18.0), (75, 80.0), (119, 18.0)):
        turn = np.degrees(rot.to_rotvec(keys.sampled(np.array([float(frame)]))[1]))
        np.testing.assert_allclose(turn, [[0.0, 0.0, -degrees]], atol=1e-3)
    right = bones["右親指1"].sampled(np.array([75.0]))[1]
    np.testing.assert_allclose(
        bones["左親指1"].sampled(np.array([75.0]))[1], right * [1, 1, -1, -1], atol=1e-6
    )
    motion_again, notes = read_vmd(tmp_path / "b.vmd")
    np.testing.assert_array_equal(motion_again.local_quat, read_vmd(tmp_path / "a.vmd")[0].local_quat)
    assert len(notes) == 1


def test_other_formats_take_a_vmd(tmp_path):
    save_motion(tmp_path / "a.vmd", swaying(60))
    motion = load_motion(tmp_path / "a.vmd")
    for suffix in ("bvh", "glb", "npz"):
        save_motion(tmp_path / f"a.{suffix}", motion)
        again = load_motion(tmp_path / f"a.{suffix}")
        assert again.n_frames == motion.n_frames and again.skeleton.n_joints == BODY.n_joints


def test_keys_in_any_order_and_names_in_any_width(tmp_path):
    keys = joined(key(4, pos=(4.0, 0, 0)), key(0), key(4, pos=(8.0, 0, 0)))
    motion = posed(tmp_path, {"ｾﾝﾀｰ": keys})
    np.testing.assert_allclose(motion.root_pos_m[:, 0], np.arange(5) * 2 * UNIT_M, atol=1e-6)


GOOD = vmd_bytes("a", {"センター": key(0), "頭": key(3)}, ["左足ＩＫ"])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "starts with"),
        (b"Vocaloid Motion Data 0003" + GOOD[25:], "starts with"),
        (GOOD[:40], "cut off"),
        (GOOD[:100], "keys of bones, got"),
        (GOOD[:50] + b"\xff\xff\xff\xff" + GOOD[54:], "keys of bones, got"),
        (GOOD[:-3], "bones with IK, got"),
        (GOOD[:54] + b"\x81 \x81 " + GOOD[58:], "Shift-JIS"),
        (GOOD[:69] + b"\xff\xff\xff\xff" + GOOD[73:], "an hour"),
        (GOOD[:73] + struct.pack("<f", np.nan) + GOOD[77:], "positions below"),
        (vmd_bytes("カメラ・照明", {}, []), "a camera"),
        (vmd_bytes("a", {"Bip01": key(0)}, []), "1 other bones"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused_in_a_line(tmp_path, content, says):
    (tmp_path / "a.vmd").write_bytes(content)
    with pytest.raises(FormatError) as refused:
        load_motion(tmp_path / "a.vmd")
    assert says in str(refused.value) and "\n" not in str(refused.value) and "a.vmd" in str(refused.value)


def test_older_files_end_before_shadows_and_ik(tmp_path):
    old = GOOD[: 54 + 2 * 111 + 12]
    (tmp_path / "a.vmd").write_bytes(old)
    assert load_motion(tmp_path / "a.vmd").n_frames == 4
    (tmp_path / "a.vmd").write_bytes(b"Vocaloid Motion Data file".ljust(30, b"\0") + b"a" * 10 + old[50:])
    assert load_motion(tmp_path / "a.vmd").n_frames == 4


def test_rotations_of_zeros_are_none(tmp_path):
    motion = posed(tmp_path, {"頭": key(0, np.zeros(4))})
    np.testing.assert_allclose(motion.local_quat[0, BODY.index("頭")], rot.IDENTITY)


def test_changed_bytes_are_read_or_refused_in_a_line(tmp_path):
    rng = np.random.default_rng(0)
    path = tmp_path / "a.vmd"
    save_motion(path, swaying(8))
    good = path.read_bytes()
    messages = []
    for _ in range(200):
        content = bytearray(good)
        for at in rng.integers(0, len(good) if rng.random() < 0.5 else 80, rng.integers(1, 6)):
            content[at] = rng.integers(256)
        path.write_bytes(content[: len(good) if rng.random() < 0.7 else rng.integers(len(good))])
        try:
            load_motion(path)
        except ChoreographError as error:
            messages.append(str(error))
    assert 0 < len(messages) < 200
    assert not any("\n" in message for message in messages)
