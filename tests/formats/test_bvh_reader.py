"""The BVH reader: unusual synthetic files, a real file against another reader, and damaged files."""

from __future__ import annotations

import itertools
import re
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from synthetic_motions import swaying

from choreograph.core.errors import ChoreographError, FormatError, ParameterError
from choreograph.core.numerics import frame_blocks
from choreograph.formats.bvh import BvhOptions, BvhWriter, read_bvh
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m

MOTION = swaying(20)


def bvh_text(tmp_path, **options) -> str:
    BvhWriter(BvhOptions(**options)).write(MOTION, tmp_path / "plain.bvh")
    return (tmp_path / "plain.bvh").read_text()


def read_text(tmp_path, text: str | bytes):
    path = tmp_path / "in.bvh"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_bvh(path)


def rows(text: str) -> tuple[str, np.ndarray]:
    head, body = re.split(r"(?<=Frame Time: )", text)
    time, _, numbers = body.partition("\n")
    return head + time + "\n", np.array([line.split() for line in numbers.splitlines()], float)


def joined(head: str, values: np.ndarray) -> str:
    return head + "\n".join(" ".join(map(repr, row)) for row in values.tolist()) + "\n"


def six_channels(text: str) -> str:
    """The same file with position channels, equal to the offsets, on every joint."""
    head, values = rows(text)
    offsets = [list(map(float, o.split())) for o in re.findall(r"OFFSET (.*)\n\s*CHANNELS", head)]
    columns = [values[:, :3]]
    for joint, offset in enumerate(offsets):
        if joint:
            columns.append(np.tile(offset, (len(values), 1)))
        columns.append(values[:, 3 + 3 * joint : 6 + 3 * joint])
    return joined(
        head.replace("CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition "), np.hstack(columns)
    )


def assert_same_dance(motion, tolerance_m=1e-4):
    assert np.abs(body_pos_m(motion) - body_pos_m(MOTION)).max() < tolerance_m


@pytest.mark.parametrize("order", ["".join(p) for p in itertools.permutations("XYZ")])
def test_every_euler_order(tmp_path, order):
    motion, _ = read_text(tmp_path, bvh_text(tmp_path, order=order))
    assert_same_dance(motion)


def test_angles_are_unwrapped_across_blocks_as_at_once(tmp_path, monkeypatch):
    turning = swaying(400).moved(yaw_rad=3.0)
    for turn in (0.05, -0.3):
        quat = turning.local_quat.copy()
        quat[:, 0] = rot.multiply(rot.about_y(turn * np.arange(400)), quat[:, 0])
        motion = replace(turning, local_quat=rot.make_continuous(quat))
        BvhWriter().write(motion, tmp_path / "at once.bvh")
        with monkeypatch.context() as patched:
            patched.setattr("choreograph.formats.bvh.frame_blocks", partial(frame_blocks, size=7))
            BvhWriter().write(motion, tmp_path / "in blocks.bvh")
        _, values = rows((tmp_path / "in blocks.bvh").read_text())
        order = [rot.to_euler("ZXY", motion.local_quat[:, joint]) for joint in (0, 1)]
        unwrapped = np.degrees([np.unwrap(angles, axis=0) for angles in order])
        np.testing.assert_allclose(values[:, 3:9], np.hstack(list(unwrapped)), atol=1e-5)
        assert (tmp_path / "in blocks.bvh").read_bytes() == (tmp_path / "at once.bvh").read_bytes()


@pytest.mark.parametrize(
    ("units_per_m", "name"),
    [(1, "metres"), (100, "centimetres"), (1000, "millimetres"), (10, "decimetres"), (39.3701, "inches"),
     (17.7165, "CMU"), (3.28084, "feet"), (0.02, "no known unit")],
)  # fmt: skip
def test_units_come_from_body_height_and_are_noted(tmp_path, units_per_m, name):
    motion, notes = read_text(tmp_path, bvh_text(tmp_path, units_per_m=units_per_m))
    assert name in notes[0]
    assert_same_dance(motion, 0.05 if name == "no known unit" else 1e-3)


def test_tabs_crlf_comments_byte_order_mark_and_case(tmp_path):
    text = bvh_text(tmp_path).replace("  ", "\t").replace("JOINT neck", "joint neck // a comment")
    text = text.replace("MOTION", "# a comment {here}\nMotion").replace("\n", "\r\n")
    motion, _ = read_text(tmp_path, b"\xef\xbb\xbf" + text.encode())
    assert_same_dance(motion)


def test_names_with_spaces_or_twice_and_braces_on_the_line(tmp_path):
    text = (
        bvh_text(tmp_path).replace("JOINT head", "JOINT Bip01 Head").replace("JOINT spine2", "JOINT spine1")
    )
    text = re.sub(r"\n\s*{", " {", text)
    motion, _ = read_text(tmp_path, text)
    assert {"Bip01 Head", "spine1", "spine1_2"} <= set(motion.skeleton.names)


def test_six_channels_on_every_joint(tmp_path):
    motion, notes = read_text(tmp_path, six_channels(bvh_text(tmp_path)))
    assert_same_dance(motion)
    assert len(notes) == 1


def test_positions_that_stay_zero_are_added_to_the_offsets(tmp_path):
    head, values = rows(six_channels(bvh_text(tmp_path)))
    for joint in range(1, 24):
        values[:, 6 * joint : 6 * joint + 3] = 0.0
    motion, notes = read_text(tmp_path, joined(head, values))
    assert_same_dance(motion)
    assert any("added" in note for note in notes)


def test_bones_that_vary_become_their_mean_with_a_note(tmp_path):
    head, values = rows(six_channels(bvh_text(tmp_path)))
    values[:, 6] += np.where(np.arange(len(values)) % 2, 1.0, -1.0)  # the first joint after the root, in cm
    motion, notes = read_text(tmp_path, joined(head, values))
    assert_same_dance(motion)
    assert any("vary in length by up to 0.01 m" in note for note in notes)


def test_a_root_above_the_hips_becomes_part_of_the_hips(tmp_path):
    head, values = rows(bvh_text(tmp_path))
    above = np.array([100.0, 0.0, 50.0])
    turn = np.array([0.0, 90.0, 0.0])  # about Y, degrees
    inner = six_channels(joined(head, values))
    head, values = rows(inner)
    head = head.replace(
        "ROOT pelvis",
        "ROOT Reference\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition "
        "Xrotation Yrotation Zrotation\n"
        "JOINT prop\n{\nOFFSET 1 2 3\nCHANNELS 0\n}\nJOINT pelvis",
    ).replace("MOTION", "}\nMOTION")
    values = np.hstack([np.tile([*above, *turn], (len(values), 1)), values])
    motion, notes = read_text(tmp_path, joined(head, values))
    assert motion.skeleton.names[0] == "pelvis"
    assert any("prop" in note for note in notes)
    expected = rot.rotate(rot.about_y(np.pi / 2), body_pos_m(MOTION)) + above / 100
    assert np.abs(body_pos_m(motion) - expected).max() < 1e-4


def test_z_up_is_rotated_with_a_note(tmp_path):
    head, values = rows(bvh_text(tmp_path, order="ZXY"))
    to_z_up = rot.from_rotvec(np.array([np.pi / 2, 0, 0]))
    values[:, :3] = rot.rotate(to_z_up, values[:, :3])
    turned = rot.multiply(to_z_up, rot.from_euler("ZXY", np.radians(values[:, 3:6])))
    values[:, 3:6] = np.degrees(rot.to_euler("ZXY", turned))
    motion, notes = read_text(tmp_path, joined(head, values))
    assert any("+Z up" in note for note in notes)
    assert_same_dance(motion)


@pytest.mark.parametrize(
    ("text", "fps"),
    [("0.0333333", 30), ("0.0083333", 120), ("0.016667", 60), ("0.0333", 30), ("0.0167", 60),
     ("0.033367", 1 / 0.033367),
     ("0.04", 25), ("0.02", 50)],
)  # fmt: skip
def test_frame_rates_as_files_print_them(tmp_path, text, fps):
    whole = re.sub(r"Frame Time: \S+", f"Frame Time: {text}", bvh_text(tmp_path))
    assert read_text(tmp_path, whole)[0].fps == pytest.approx(fps, rel=1e-12)


def test_real_file_agrees_with_another_reader(shared_data):
    bvhio = pytest.importorskip("bvhio")
    path = shared_data / "bvh" / "dance-short_normal_001.bvh"
    motion, notes = read_bvh(path)
    assert motion.fps == 30
    assert motion.n_frames == 1901
    assert notes == ("read as centimetres, which makes the body 1.74 m tall",)
    hierarchy = bvhio.readAsHierarchy(str(path))
    pos = motion.joint_pos_m()
    for frame in (0, 700, 1900):
        hierarchy.loadPose(frame)
        theirs = {joint.Name: np.array(joint.PositionWorld) / 100 for joint, _, _ in hierarchy.layout()}
        ours = dict(zip(motion.skeleton.names, pos[frame], strict=True))
        assert max(np.abs(ours[name] - theirs[name]).max() for name in ours) < 1e-3


DAMAGED = {
    "empty": (lambda t: "", "nothing"),
    "not a bvh": (lambda t: "RIFF....WAVE", "HIERARCHY"),
    "garbage": (lambda t: bytes(range(256)) * 20, "HIERARCHY"),
    "no motion section": (lambda t: t.partition("MOTION")[0], "MOTION"),
    "no frames": (lambda t: rows(t)[0].replace("Frames: 20", "Frames: 0"), "expected a motion, got 0"),
    "nan": (lambda t: t.rsplit(" ", 1)[0] + " nan\n", "frame 19 holds nan"),
    "too many frames announced": (lambda t: t.replace("Frames: 20", "Frames: 23"), "count is wrong"),
    "too few frames announced": (lambda t: t.replace("Frames: 20", "Frames: 7"), "count is wrong"),
    "cut in the motion": (lambda t: t[: len(t) - 700], "count is wrong"),
    "cut in the hierarchy": (lambda t: t[:900], "cut"),
    "a word in the motion": (lambda t: t[:-9] + " bla\n", "not a number"),
    "commas between numbers": (lambda t: re.sub(r"(?<=\d) (?=-?\d)", ",", t), "number"),
    "frames of 4000 digits": (lambda t: t.replace("Frames: 20", "Frames: " + "9" * 4000), "number of frames"),
    "a frame time of 4000 digits": (lambda t: re.sub(r"Time: ", "Time: " + "9" * 4000, t), "frame time"),
    "a word of 10⁵ letters": (lambda t: t[:-9] + " " + "x" * 100_000 + "\n", "not a number"),
    "an offset of 10⁵ letters": (lambda t: t.replace("OFFSET ", "OFFSET x" + "x" * 10**5, 1), "number after"),
    "channels of 10⁵ letters": (lambda t: t.replace("Xrot", "x" * 100_000 + "rot"), "channels"),
    "NULs in the middle": (lambda t: t[:-9] + "\0" * 9 + t[-9:], "not a number"),
    "joints without channels": (
        lambda t: t.replace("JOINT", "JOINT x\n{\n}\n" * 500 + "JOINT", 1),
        "most joints",
    ),
    "frame time zero": (lambda t: re.sub(r"Frame Time: \S+", "Frame Time: 0", t), "frame time"),
    "frames no number": (lambda t: t.replace("Frames: 20", "Frames: many"), "number of frames"),
    "two bodies": (lambda t: t.replace("MOTION", t[9 : t.index("MOTION")] + "MOTION"), "one ROOT"),
    "unknown channel": (lambda t: t.replace("Xrotation", "Xscale"), "channels"),
    "no channels": (lambda t: re.sub(r"CHANNELS .*", "CHANNELS 0", t), "there is no motion"),
    "no size": (lambda t: re.sub(r"OFFSET .*", "OFFSET 0 0 0", t), "no bone lengths"),
    "over an hour": (lambda t: re.sub(r"Time: \S+", "Time: 9", t).replace("s: 20", "s: 999"), "hour"),
    "10⁴ joints": (lambda t: t.replace("JOINT", "JOINT x\n{\n}\n" * 10_000 + "JOINT", 1), "4096 joints"),
    "10⁵ frames of 4000 joints": (
        lambda t: rows(t)[0]
        .replace("JOINT", "JOINT x\n{\nCHANNELS 0\n}\n" * 4000 + "JOINT", 1)
        .replace("Frames: 20", "Frames: 100000"),
        "frames × joints, got 100000 frames",
    ),
    "huge": (lambda t: re.sub(r"OFFSET \S+", "OFFSET 1e300", t), "number"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_end_in_one_line_that_names_them(tmp_path, name):
    damage, message = DAMAGED[name]
    with pytest.raises(FormatError, match=message) as caught:
        read_text(tmp_path, damage(bvh_text(tmp_path)))
    assert "in.bvh" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(tmp_path))


MISSING = (
    "nan", "NaN", "-nan", "nanq", "nan(ind)", "-nan(ind)", "nan(snan)", "nan(0x8000000000000)", "-1.#IND00",
    "-1.#IND", "1.#QNAN0", "-1.#QNAN", "1.#SNAN0", "1.#INF00", "-1.#INF", "1.#J", "-1.#IO", "-1,#IND00",
    "inf", "-Infinity",
)  # fmt: skip


@pytest.mark.parametrize("word", MISSING)
@pytest.mark.parametrize("column", ["first", "last"])
def test_missing_values_are_refused_as_nan_is_in_any_spelling(tmp_path, word, column):
    """As C libraries print them; "#" begins no comment there."""
    head, last = bvh_text(tmp_path).rstrip().rsplit("\n", 1)
    numbers = last.split()
    numbers[0 if column == "first" else -1] = word
    with pytest.raises(FormatError, match=r"frame 19 holds -?(nan|inf), which is not a valid"):
        read_text(tmp_path, f"{head}\n{' '.join(numbers)}\n")


@pytest.mark.parametrize("marks", ["\x1a", "\0", "\x1a\0\0\n", "\r\n\x1a\r\n", "\0" * 100_000])
def test_end_of_file_marks_are_left_out_with_a_note(tmp_path, marks):
    motion, notes = read_text(tmp_path, bvh_text(tmp_path) + marks)
    assert_same_dance(motion)
    assert motion.n_frames == 20
    assert sum("end-of-file marks" in note for note in notes) == 1


@pytest.mark.parametrize("space", [" ", "\t", "  "])
def test_decimal_commas_are_read_with_a_note(tmp_path, space):
    text = bvh_text(tmp_path)
    head, _, numbers = text.partition("Frame Time: ")
    motion, notes = read_text(
        tmp_path, (head + "Frame Time: " + numbers.replace(" ", space)).replace(".", ",")
    )
    assert_same_dance(motion)
    assert motion.fps == read_text(tmp_path, text)[0].fps
    assert sum("decimal commas" in note for note in notes) == 1


def test_a_comma_in_a_name_is_no_decimal_comma(tmp_path):
    motion, notes = read_text(tmp_path, bvh_text(tmp_path).replace("JOINT head", "JOINT head, crown"))
    assert "head, crown" in motion.skeleton.names and len(notes) == 1


@pytest.mark.parametrize("announced", [18, 19, 21, 22])
def test_a_frame_count_off_by_one_or_two_is_noted(tmp_path, announced):
    motion, notes = read_text(tmp_path, bvh_text(tmp_path).replace("Frames: 20", f"Frames: {announced}"))
    assert_same_dance(motion)
    assert sum(f"states {announced} frames and contains 20" in note for note in notes) == 1


def test_comments_begin_at_the_beginning_of_a_word(tmp_path):
    text = bvh_text(tmp_path).replace("JOINT head", "JOINT head#1 # a comment")
    text = "# made by hand\n" + text.replace("{", "{# open", 1).replace("Frames", "// the motion\nFrames")
    motion, _ = read_text(tmp_path, text)
    assert_same_dance(motion)
    assert "head#1" in motion.skeleton.names


@pytest.mark.parametrize("blank", ["\n", " ", "\t", "\r\n", "\n "])
def test_200_kb_of_blanks_take_a_moment(tmp_path, blank):
    """It was quadratic in blank lines: a minute and more."""
    blanks = blank * (200_000 // len(blank))
    began_s = time.process_time()
    with pytest.raises(FormatError, match="HIERARCHY"):
        read_text(tmp_path, blanks + "x")
    assert_same_dance(
        read_text(tmp_path, blanks + "\n" + bvh_text(tmp_path).replace("MOTION", blanks + "\nMOTION"))[0]
    )
    assert time.process_time() - began_s < 2.0


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(ParameterError):
        read_bvh(tmp_path / "none.bvh")
    with pytest.raises(FormatError, match="folder"):
        read_bvh(tmp_path)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_text_is_read_or_refused_but_never_crashes(tmp_path, data):
    text = bvh_text(tmp_path)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        size = data.draw(st.integers(0, 40))
        junk = data.draw(
            st.sampled_from(
                [
                    "",
                    "{",
                    "}",
                    "\n",
                    " 7 ",
                    "-1e9",
                    "nan",
                    "JOINT x {",
                    "CHANNELS 2",
                    "\0",
                    "MOTION",
                    "é",
                    "#",
                ]
            )
        )
        text = text[:at] + junk + text[at + size :]
    try:
        motion, notes = read_text(tmp_path, text)
    except ChoreographError as error:
        if not isinstance(error, FormatError) or "\n" in str(error):
            pytest.fail(f"expected a FormatError of one line, got {error!r}")
    else:
        assert motion.n_frames > 0
        assert notes
