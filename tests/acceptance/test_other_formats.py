"""Sane files of the smaller formats, as other programs and people write them: none may be refused."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from acceptance.corpus import SaneFile, assert_read
from synthetic_markers import markers_on, write_c3d
from synthetic_motions import swaying
from synthetic_plans import MIXED, PINNED, PLAN, ROLLED

from choreograph.choreography.constraints import read_signature
from choreograph.formats.manifest import read_counts
from choreograph.formats.register import import_takes, save_motion
from choreograph.motion import rotations as rot
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.motion.bone_map import read_bone_map
from choreograph.music.beats import read_beats
from choreograph.plan.plan import Plan
from choreograph.settings import load_config

MOTION = swaying(90, fps=60.0)
MARKERS = markers_on(MOTION)


def text_files(name: str, texts: dict[str, str | bytes]) -> list[SaneFile]:
    """Files with the given contents by what is special about them."""

    def writer(content: str | bytes) -> Callable[[Path], Path]:
        def write(folder: Path) -> Path:
            (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
            return folder / name

        return write

    return [SaneFile(special, writer(content)) for special, content in texts.items()]


def encodings(text: str, plain: str) -> dict[str, str | bytes]:
    """A text as editors of three systems save it."""
    return {
        plain: text,
        "byte order mark": text.encode("utf-8-sig"),
        "utf-16": text.encode("utf-16"),
        "crlf": text.replace("\n", "\r\n"),
        "blank lines at the end": text + "\n\n",
        "no line end": text.rstrip("\n"),
    }


def check_takes(path: Path) -> None:
    """One upright body of the right size that lasts as long as the motion."""
    (take,) = import_takes(path)
    pos_m = body_pos_m(take.motion).mean(axis=0)
    assert 1.3 < pos_m[BODY_JOINTS.index("head"), 1] < 1.9
    assert 0.6 < pos_m[BODY_JOINTS.index("left_hip"), 1] < 1.1
    assert take.motion.duration_s == pytest.approx(MOTION.duration_s, rel=0.1)


def c3d_files() -> list[SaneFile]:
    scaled_mm = {name: 1000.0 * pos for name, pos in MARKERS.items()}
    other_names = {"LFWT": "LASI", "RFWT": "RASI", "LBWT": "LPSI", "RBWT": "RPSI", "LSHN": "LTIB"}
    noise = np.zeros((4, 8))

    def events(writer) -> None:
        group = writer.add_group(writer.numeric_key_next, "EVENT", "events")
        group.add("USED", "", 2, "<H", 2)
        group.add_array("TIMES", "", np.array([[0.0, 0.1], [0.0, 0.4]], np.float32))
        group.add_str("LABELS", "", "Foot StrikeFoot Off   ", 11, 2)

    def file(name: str, markers=MARKERS, **options) -> SaneFile:
        options = {"fps": 60.0} | options
        return SaneFile(name, lambda folder: write_c3d(folder / "take.c3d", markers, **options))

    def padded(folder: Path) -> Path:
        path = write_c3d(folder / "take.c3d", MARKERS, fps=60.0)
        path.write_bytes(path.read_bytes() + bytes(512))
        return path

    return [
        file("float"),
        file("integers of a tenth of a mm", point_scale=0.1),
        file("integers with gaps", point_scale=0.1, missing={"LKNE": slice(20, 40)}),
        file("no prefix", prefix=""),
        file("name of two words as prefix", prefix="Ada Lovelace:"),
        file("lower case", {name.lower(): pos for name, pos in MARKERS.items()}),
        file("other names of markers", {other_names.get(name, name): pos for name, pos in MARKERS.items()}),
        file("unnamed markers", MARKERS | {"*12": MARKERS["C7"], "*13": 0.0 * MARKERS["C7"]}),
        file("a prop beside the dancer", {"d:" + n: p for n, p in MARKERS.items()} | prop(), prefix=""),
        file("angles and forces", MARKERS | {"LKneeAngles": scaled_mm["LKNE"], "LGRF": 0 * MARKERS["LKNE"]}),
        file("a marker never seen", MARKERS | {"LFIN": 0.0 * MARKERS["LFIN"]}),
        file("gaps", missing={"LKNE": slice(20, 40), "RTOE": slice(0, 3)}, zeros={"LWRA": slice(80, 90)}),
        file("analog channels", analog=noise),
        file("integers and analog channels", analog=noise, point_scale=0.1),
        file("events", adapt=events),
        file("metres", {name: pos / 1000 for name, pos in MARKERS.items()}, unit="m"),
        file("Millimetres", unit="MM"),
        file("no unit", unit=" "),
        file("59.94 frames a second", fps=59.94),
        file("cut from a longer recording", adapt=lambda writer: writer.set_start_frame(501)),
        SaneFile("zeros at the end", padded),
    ]


def prop() -> dict[str, np.ndarray]:
    return {f"stick:{end}": MARKERS["LFIN"] + offset for end, offset in (("top", 0.4), ("end", -0.4))}


def smpl_files() -> list[SaneFile]:
    poses = rot.to_rotvec(MOTION.local_quat).reshape(MOTION.n_frames, -1)  # (T, 72)
    trans = MOTION.root_pos_m
    to_z_up = rot.from_rotvec(np.array([np.pi / 2, 0, 0]))
    lying = poses.copy()
    lying[:, :3] = rot.to_rotvec(rot.multiply(to_z_up, rot.from_rotvec(poses[:, :3])))
    raised = rot.rotate(to_z_up, trans)
    hands = np.hstack([lying[:, :66], np.zeros((90, 90))])  # (T, 156)
    amass = {"poses": hands, "trans": raised, "betas": np.zeros(16), "dmpls": np.zeros((90, 8))}
    smplx = {"poses": np.hstack([hands, np.zeros((90, 9))]), "trans": raised, "surface_model_type": "smplx"}
    smplx |= {"latent_labels": np.array(["C7", None], object), "mocap_time_length": 1.5}
    aist = {"smpl_poses": poses, "smpl_trans": 93.0 * trans, "smpl_scaling": np.array([93.0])}

    def npz(name: str, file_name: str = "take.npz", *, save=np.savez, **arrays) -> SaneFile:
        def write(folder: Path) -> Path:
            save(folder / file_name, **arrays)
            return folder / file_name

        return SaneFile(name, write)

    def ours(folder: Path) -> Path:
        save_motion(folder / "take.npz", MOTION)
        return folder / "take.npz"

    def ours_again(folder: Path) -> Path:
        with np.load(ours(folder)) as archive:
            arrays = {name: archive[name] for name in archive}
        np.savez_compressed(folder / "again.npz", note="edited", **arrays)
        return folder / "again.npz"

    def pickled(name: str, content: dict, protocol: int, *, alone: bool = False) -> SaneFile:
        def write(folder: Path) -> Path:
            (folder / "motions").mkdir()
            path = folder / "motions" / "gBR_sBM_cAll_d04_mBR0_ch01.pkl"
            path.write_bytes(pickle.dumps(content, protocol=protocol))
            return path if alone else folder

        return SaneFile(name, write)

    single = {name: np.asarray(value, np.float32) for name, value in aist.items()}
    return [
        SaneFile("ours", ours),
        SaneFile("ours, compressed, with an array more", ours_again),
        npz("amass smpl-h", **amass, gender="male", mocap_framerate=60.0),
        npz("amass with bytes and whole rate", **amass, gender=np.array(b"male"), mocap_framerate=60),
        npz("amass smpl-x", "take_stageii.npz", **smplx, gender="neutral", mocap_frame_rate=60.0),
        npz("amass compressed", save=np.savez_compressed, **amass, mocap_framerate=np.array([60.0])),
        npz("smpl of 72 values, Y up", poses=poses, trans=trans, mocap_framerate=60.0),
        npz("smpl by joint and fps", poses=lying.reshape(90, 24, 3), trans=raised, fps=60),
        npz("smpl in single precision", poses=np.float32(lying), trans=np.float32(raised), fps=60),
        npz("aist++ as npz", **aist),
        *(pickled(f"aist++ protocol {p}", aist | {"smpl_loss": 0.1}, p) for p in (0, 2, 4, 5)),
        pickled("aist++ single precision", single | {"smpl_loss": np.float32(0.1)}, 4),
        pickled("aist++ column by column", aist | {"smpl_poses": np.asfortranarray(poses)}, 4),
        pickled("aist++ scaling as a number", aist | {"smpl_scaling": 93.0}, 3),
        pickled("aist++ file alone", aist, 4, alone=True),
    ]


C3D_FILES, SMPL_FILES = c3d_files(), smpl_files()


def test_takes_are_read(tmp_path):
    assert_read([*C3D_FILES, *SMPL_FILES], check_takes, tmp_path, n_files=36)


COUNTS = "time_s,number,figure\n0.480,1,Größe\n0.962,2,\n1.445,3,\n2.410,1,-\n"
COUNT_FILES = encodings(COUNTS, "as written") | {
    "semicolons and decimal commas": COUNTS.replace(",", ";").replace(".", ","),
    "tabs": COUNTS.replace(",", "\t"),
    "sep line": "sep=;\r\n" + COUNTS.replace(",", ";").replace("\n", "\r\n"),
    "windows-1252": COUNTS.encode("cp1252"),
    "capitals": COUNTS.replace("time_s,number,figure", "Time_s,NUMBER,Figure"),
    "spaces": COUNTS.replace(",", " , "),
    "old macintosh": COUNTS.replace("\n", "\r"),
    "quotes": "\n".join(",".join(f'"{cell}"' for cell in row.split(",")) for row in COUNTS.split("\n")[:-1]),
    "blank rows": COUNTS.replace("\n", "\n,,\n") + ",,\n",
    "trailing commas": COUNTS.replace("\n", ",,\n"),
    "numbers with decimals": COUNTS.replace(",1,", ",1.0,").replace(",2,", ",2.0,").replace(",3,", ",3.0,"),
    "other order": "number,figure,time_s\n1,Größe,0.480\n2,,0.962\n3,,1.445\n1,-,2.410\n",
}


def check_counts(path: Path) -> None:
    counts, figures = read_counts(path)
    assert counts.times_s.tolist() == [0.480, 0.962, 1.445, 2.410] and counts.numbers.tolist() == [1, 2, 3, 1]
    assert [figure.name for figure in figures] == ["Größe"]


def test_tables_of_counts_are_read(tmp_path):
    assert_read(text_files("take.counts.csv", COUNT_FILES), check_counts, tmp_path, n_files=18)


BEATS = "0.5\t1\n1.0\t2\n1.5\t3\n2.0\t1\n"
BEAT_FILES = encodings(BEATS, "tabs") | {
    "spaces": BEATS.replace("\t", "   "),
    "commas": BEATS.replace("\t", ","),
    "commas and spaces": BEATS.replace("\t", ", "),
    "semicolons and decimal commas": BEATS.replace("\t", ";").replace(".", ","),
    "comments": "# song.mp3, by hand\n\n" + BEATS.replace("\n", "  # sure\n"),
    "numbers with decimals": BEATS.replace("\n", ".0\n"),
    "header": "time,beat\n" + BEATS.replace("\t", ","),
    "audacity labels": "".join(f"{t}00000\t{t}00000\t{n}\n" for t, n in map(str.split, BEATS.splitlines())),
    "audacity with frequencies": BEATS.replace("\n", "\n\\\t100.000000\t2000.000000\n"),
    "audacity with decimal commas": "".join(
        f"{t}00000\t{t}00000\t{n}\n".replace(".", ",") for t, n in map(str.split, BEATS.splitlines())
    ),
    "sonic visualiser bars and beats": "".join(
        f'{t}0000,"{bar}.{n}"\n'
        for (t, n), bar in zip(map(str.split, BEATS.splitlines()), "1112", strict=True)
    ),
    "sonic visualiser numbers": 'TIME,LABEL\n0.5,"1"\n1.0,"2"\n1.5,"3"\n2.0,"1"\n',
    "old macintosh": BEATS.replace("\n", "\r"),
    "only downbeats numbered": "0.5 1\n1.0\n1.5\n2.0 1\n",
    "windows-1252 comment": ("# für Ada\n" + BEATS).encode("cp1252"),
}
UNNUMBERED = {
    "times alone": "0.5\n1.0\n1.5\n2.0\n",
    "audacity beat finder": "0.5\t0.5\tB\n1.0\t1.0\tB\n1.5\t1.5\tB\n2.0\t2.0\tB\n",
    "sonic visualiser time instants": '0.5,"New Point"\n1.0,"New Point"\n1.5,"New Point"\n2.0,"New Point"\n',
}


def check_beats(path: Path) -> None:
    counts = read_beats(path)
    assert counts.times_s.tolist() == [0.5, 1.0, 1.5, 2.0]
    assert counts.numbers.tolist() in ([1, 2, 3, 1], [0, 0, 0, 0])
    assert (counts.metre == 0) == (path.parent.name in UNNUMBERED)


def test_beats_are_read(tmp_path):
    assert_read(text_files("song.beats", BEAT_FILES | UNNUMBERED), check_beats, tmp_path, n_files=24)


def test_plans_are_read(tmp_path):
    data = json.loads(PLAN.to_json())
    whole = json.dumps(data | {"duration_s": 2, "start_s": 0, "fps": 60})
    texts = encodings(PLAN.to_json(), "as written") | {
        "one line": json.dumps(data, separators=(",", ":")),
        "sorted keys": json.dumps(dict(sorted(data.items())), indent=4),
        "tabs and letters as they are": json.dumps(data, indent="\t", ensure_ascii=False),
        "whole numbers": whole,
        "pinned words": PINNED.to_json(),
        "of the mixer": MIXED.to_json(),
        "of the rollout": ROLLED.to_json(),
        "no bars known": replace(PLAN, music_beats_s=()).to_json(),
    }
    assert_read(text_files("plan.json", texts), Plan.read, tmp_path, n_files=14)


def test_bone_maps_signatures_and_configs_are_read(tmp_path):
    bones = json.dumps({"left_hip": "Oberschenkel_Größe.L", "pelvis": "Hüfte"}, indent=1, ensure_ascii=False)
    shares = {"format": "choreograph-signature", "version": 1, "name": "a", "repertoire": "rep.h5"}
    thirds = json.dumps(shares | {"shares": [0.333, 0.333, 0.333]})
    signatures = {
        "whole numbers": json.dumps(shares | {"shares": [0, 1, 0]}),
        "three digits": thirds,
        "with a comment": json.dumps({"comment": "by hand"} | shares | {"shares": [0.25, 0.75]}),
    }
    config = (
        "# Größe\nengine = 'graph'\nfps = 30\nlock_feet = true # feet\n[weights]\nrhythm = 1_0.5\ngenre=0\n"
    )
    configs = {
        "dotted keys": "weights.rhythm = 2.5\nweights.'genre' = 1\nseed = 0x10\n",
        "inline table": "weights = { rhythm = 2.5, genre = 0 }\n",
        "empty": "",
    }
    files = {
        "map.json": (read_bone_map, encodings(bones, "as written") | {"empty map": "{}"}),
        "signature.json": (read_signature, encodings(thirds, "as written") | signatures),
        "config.toml": (load_config, encodings(config, "as written") | configs),
    }
    for name, (read, texts) in files.items():
        assert_read(text_files(name, texts), read, tmp_path / name, n_files=7)
