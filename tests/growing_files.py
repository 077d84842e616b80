"""Files of every format of any number of bytes, sane and hostile."""

from __future__ import annotations

import base64
import io
import json
import pickle
import struct
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import soundfile
from synthetic_markers import markers_on, write_c3d
from synthetic_motions import swaying

from choreograph.formats.gltf import read_rig, read_skin_points
from choreograph.formats.gltf_document import GltfDocument, read_gltf
from choreograph.formats.register import save_motion
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion

Bytes = Callable[[int], bytes]  # of about a size
_TO_FRAMES = "HIERARCHY\nROOT a {\nCHANNELS 1 Xrotation\n}\nMOTION\n"


def repeated(text: str | bytes, before: str | bytes = "", after: str | bytes = "") -> Bytes:
    """A part again and again, between two others."""
    part, first, last = (x if isinstance(x, bytes) else x.encode() for x in (text, before, after))
    return lambda n: first + part * max(1, (n - len(first) - len(last)) // len(part)) + last


def numbered(part: str, before: str = "", after: str = "") -> Bytes:
    """Parts with their number in place of %d."""
    return lambda n: (before + "".join(part % i for i in range(n // (len(part) + 3))) + after).encode()


def saved(write: Callable[[Path], object], suffix: str) -> bytes:
    """What a program writes to a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        write(path)
        return path.read_bytes()


def dancing_for(n_bytes: int, bytes_a_frame: int) -> Motion:
    """A motion whose file is of about a size."""
    return swaying(min(max(2, n_bytes // bytes_a_frame), 160_000), fps=60.0)


@cache
def bvh_parts() -> tuple[str, str]:
    """A hierarchy and a row of numbers."""
    text = saved(lambda path: save_motion(path, swaying(2)), ".bvh").decode()
    return text.partition("MOTION")[0], text.splitlines()[-1] + "\n"


def bvh(row: str = "", *, before: str = "", between: str = "", frames: str = "") -> Bytes:
    """BVH files of a number of rows, or of rows of something else."""

    def make(n: int) -> bytes:
        head, sane_row = bvh_parts()
        rows = max(2, (n if row or not (before or between) else 10_000) // len(row or sane_row))
        text = before * (n // max(1, len(before))) + head + between * (n // max(1, len(between)))
        return (
            f"{text}MOTION\nFrames: {frames or rows}\nFrame Time: 0.02\n{(row or sane_row) * rows}".encode()
        )

    return make


BVH = {
    "sane": bvh(),
    "blank lines before": bvh(before="\n"),
    "blank lines with spaces": bvh(before=" \n\t"),
    "blank lines before MOTION": bvh(between="\n"),
    "spaces before MOTION": bvh(between=" "),
    "blank lines between rows": bvh("\n"),
    "commas": bvh("1,5 " * 75 + "\n"),
    "words": bvh("x " * 75 + "\n"),
    "missing values": bvh("-1.#IND00 " * 75 + "\n"),
    "comments": bvh(before="#\n"),
    "comments in a row": bvh(before="#"),
    "NULs": repeated("\0"),
    "one word": repeated("x", "HIERARCHY\n"),
    "braces": repeated("{", "HIERARCHY\nROOT a"),
    "closing braces": repeated("}", "HIERARCHY\nROOT a"),
    "open joints": repeated("JOINT a {\n", "HIERARCHY\nROOT a {\n"),
    "end sites": repeated("End Site {\n}\n", "HIERARCHY\nROOT a {\n"),
    "offsets": repeated("OFFSET 0 0 0\n", "HIERARCHY\nROOT a {\n"),
    "words of a name": repeated("a ", "HIERARCHY\nROOT "),
    "MOTION": repeated("MOTION\n", "HIERARCHY\n"),
    "Frames": repeated("Frames", _TO_FRAMES),
    "spaces after Frames": repeated(" ", _TO_FRAMES + "Frames: 2", "x"),
}  # fmt: skip


def npz(n: int) -> bytes:
    return saved(lambda path: save_motion(path, dancing_for(n, 800)), ".npz")


def npz_of_names(n: int) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for i in range(n // 120):
            archive.writestr(f"{i}.npy", b"")
    return packed.getvalue()


def smpl_arrays(n: int) -> dict[str, np.ndarray]:
    motion = dancing_for(n, 300)
    poses = rot.to_rotvec(motion.local_quat).reshape(motion.n_frames, -1).astype(np.float32)
    return {"poses": poses, "trans": motion.root_pos_m.astype(np.float32)}


def amass(n: int) -> bytes:
    packed = io.BytesIO()
    np.savez(packed, mocap_framerate=60.0, **smpl_arrays(n))
    return packed.getvalue()


def aist(n: int) -> bytes:
    arrays = smpl_arrays(n)
    content = {"smpl_poses": arrays["poses"], "smpl_trans": arrays["trans"], "smpl_scaling": np.ones(1)}
    return pickle.dumps(content)


def text_of_pickle(n: int) -> bytes:
    return pickle.dumps({"smpl_poses": "\x80" * (n // 2)})


def glb(n: int) -> bytes:
    return saved(lambda path: save_motion(path, dancing_for(n, 24 * 20)), ".glb")


def vrma(n: int) -> bytes:
    return saved(lambda path: save_motion(path, dancing_for(n, 24 * 20)), ".vrma")


def vmd(n: int) -> bytes:
    return saved(lambda path: save_motion(path, dancing_for(n, 22 * 111 // 2)), ".vmd")


def gltf_text(n: int) -> bytes:
    content = glb(n * 3 // 4)
    n_json = struct.unpack_from("<I", content, 12)[0]
    data = json.loads(content[20 : 20 + n_json])
    text = base64.b64encode(content[28 + n_json :]).decode()
    data["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
    return json.dumps(data).encode()


def document(change: Callable[[GltfDocument, int], object]) -> Bytes:
    """A small animation with something repeated."""

    def make(n: int) -> bytes:
        small = GltfDocument(*gltf_parts())
        small.json = json.loads(json.dumps(small.json))
        change(small, n)
        return small.to_glb()

    return make


@cache
def gltf_parts() -> tuple[dict, bytes]:
    content = saved(lambda path: save_motion(path, swaying(4)), ".glb")
    n_json = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + n_json]), content[28 + n_json :]


def nodes_in_a_chain(small: GltfDocument, n: int) -> None:
    first = len(small.json["nodes"])
    small.json["nodes"] += [{"children": [first + i + 1]} for i in range(n // 20)] + [{}]


def animations_of_one(small: GltfDocument, n: int) -> None:
    animation = small.json["animations"][0]
    small.json["animations"] += [{**animation, "name": f"{i}" + "x" * 30_000} for i in range(n // 36_000)]


def channels(small: GltfDocument, n: int) -> None:
    small.json["animations"][0]["channels"] *= n // 5000 + 1


def tracks_that_share(small: GltfDocument, n: int) -> None:
    """One accessor that all tracks use."""
    times = small.accessor(np.linspace(0, 1, n // 20 + 2, dtype=np.float32))
    rows = small.accessor(np.tile(np.array([0, 0, 0, 1], np.float32), (n // 20 + 2, 1)))
    for channel in small.json["animations"][0]["channels"]:
        channel["target"]["path"] = "rotation"
    small.json["animations"][0]["samplers"] = [
        {"input": times, "output": rows} for _ in small.json["animations"][0]["samplers"]
    ]


def skins_of_one(small: GltfDocument, n: int) -> None:
    small.json["skins"] *= n // len(json.dumps(small.json["skins"][0])) + 1


def meshes_of_one(small: GltfDocument, n: int) -> None:
    primitive = small.json["meshes"][0]["primitives"][0]
    small.json["meshes"][0]["primitives"] += [
        {**primitive, "attributes": {**primitive["attributes"], "POSITION": i % 8}} for i in range(n // 90)
    ]


GLTF = {
    "sane": glb,
    "text": gltf_text,
    "nodes": document(lambda small, n: small.json["nodes"].extend([{"name": "a"}] * (n // 13))),
    "nodes in a chain": document(nodes_in_a_chain),
    "children": document(lambda small, n: small.json["nodes"].append({"children": list(range(n // 7))})),
    "a name": document(lambda small, n: small.json["nodes"][1].update(name="aB" * (n // 2))),
    "animations": document(animations_of_one),
    "channels": document(channels),
    "tracks that share": document(tracks_that_share),
    "skins": document(skins_of_one),
    "meshes": document(meshes_of_one),
    "accessors": document(lambda small, n: small.json["accessors"].extend([{"count": 1}] * (n // 13))),
    "images": document(lambda small, n: small.json.update(images=[{"uri": "data:,"}] * (n // 20))),
    "brackets": repeated("["),
    "braces": repeated('{"a":'),
    "lists": repeated("[],", '{"asset":{"version":"2.0"},"x":[', "0]}"),
    "keys": numbered('"%d":1,', '{"asset":{"version":"2.0"},', '"x":1}'),
    "quotes": repeated('\\"', '{"asset":"'),
    "digits": repeated("9", '{"asset":'),
    "chunks": repeated(struct.pack("<II", 0, 7), struct.pack("<III", 0x46546C67, 2, 12)),
}  # fmt: skip


OF_CHARACTERS = ("sane", "nodes", "nodes in a chain", "children", "skins", "meshes", "accessors")


def character(path: Path) -> None:
    read = read_gltf(path)
    read_skin_points(read, read_rig(read))


def c3d(n: int) -> bytes:
    return saved(lambda path: write_c3d(path, markers_on(dancing_for(n, 41 * 20))), ".c3d")


C3D = {
    "sane": c3d,
    "zeros": repeated(b"\0"),
    "groups": repeated(b"\x02\xff\x00\x04", b"\x02\x50" + bytes(510)),
}
TABLE = {
    "blank lines": repeated("\n"), "commas": repeated(","), "quotes": repeated('"'),
    "semicolons": repeated(";"),
    "tabs": repeated("\t"), "quoted quotes": repeated('""', 'time_s,number\n"'), "letters": repeated("x"),
    "NULs": repeated("\0"), "digits": repeated("1", "time_s,number\n"), "lines of a letter": repeated("x\n"),
    "spaces": repeated(" "), "lines of CR": repeated("\r"),
}  # fmt: skip
JSON = {
    "brackets": repeated("["), "braces": repeated('{"a":'), "numbers": repeated("1,", "[", "1]"),
    "keys": numbered('"%d":"a",', "{", '"x":"a"}'), "one key": repeated('"a":1,', "{", '"a":1}'),
    "lists": repeated("[],", "[", "[]]"), "objects": repeated("{},", "[", "{}]"), "digits": repeated("9"),
    "a text": repeated("a", '"', '"'), "escapes": repeated("\\u0041", '"', '"'), "spaces": repeated(" "),
    "letters": repeated("x"), "quotes": repeated('"'),
}  # fmt: skip

FEW = {
    shape: JSON[shape] for shape in ("keys", "numbers", "brackets")
}  # of what reads JSON by the same function


def points(n: int) -> bytes:
    """Of dance-with-melody."""
    frame = np.random.default_rng(0).normal(scale=30, size=(23, 3)).round(2).tolist()
    n_frames = n // 430 + 2
    return json.dumps({"center": [[0, 90, 0]] * n_frames, "skeletons": [frame] * n_frames}).encode()


def sound(kind: str, subtype: str) -> Bytes:
    def make(n: int) -> bytes:
        content = io.BytesIO()
        samples = np.random.default_rng(0).normal(scale=0.1, size=n // 2)
        soundfile.write(content, samples, 22050, format=kind, subtype=subtype)
        return content.getvalue()

    return make


SONGS = {
    "WAV": sound("WAV", "PCM_16"), "FLAC": sound("FLAC", "PCM_16"), "zeros": repeated(b"\0"),
    "letters": repeated("x"), "RIFF": repeated(b"RIFF\x04\0\0\0WAVE"), "ID3": repeated(b"ID3\4\0\0\0\0\0\0"),
    "syncs": repeated(b"\xff\xfb\x90\0"),
    "OggS": repeated(b"OggS\0"), "boxes": repeated(struct.pack(">I", 8) + b"free"), "fLaC": repeated("fLaC"),
    "MThd": repeated("MThd"), "chunks": repeated(b"abcd\0\0\0\0", b"RIFF\xff\xff\xff\x7fWAVE"),
}  # fmt: skip
