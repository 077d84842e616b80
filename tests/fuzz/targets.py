"""Everything that is read from untrusted files, with good files to start from."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import av
import numpy as np
import soundfile
from acceptance import test_bvh, test_glb, test_manifests, test_rigs, test_songs
from acceptance.corpus import SaneFile
from acceptance.test_other_formats import BEAT_FILES, C3D_FILES, COUNT_FILES, SMPL_FILES, text_files
from fuzz.array_files import npy_program, npz_program, pickle_program
from fuzz.harness import Target
from fuzz.mutations import Rng
from fuzz.round_trips import counts_again, plan_again, signature_again, takes_again
from synthetic_characters import CHARACTERS, write_character
from synthetic_markers import markers_on, write_c3d
from synthetic_motions import stepping, swaying
from synthetic_repertoire import (
    read_all,
    synthetic_contents,
    synthetic_takes,
    with_counts,
    with_vocabulary,
    write_clicks,
)
from synthetic_studies import VARIANTS, rate_all, small_study

import choreograph as cg
from choreograph.choreography.constraints import read_motifs, read_signature
from choreograph.core.cache import DiskCache
from choreograph.core.errors import FormatError
from choreograph.formats.choreonet import read_choreographies
from choreograph.formats.gltf import read_rig
from choreograph.formats.gltf_document import read_gltf
from choreograph.formats.manifest import read_counts
from choreograph.formats.register import annotate_takes, import_takes, save_motion
from choreograph.library.repertoire import Repertoire
from choreograph.library.writing import write_repertoire
from choreograph.motion import rotations as rot
from choreograph.motion.bone_map import find_bones, read_bone_map
from choreograph.motion.motion import Take
from choreograph.music.beats import read_beats
from choreograph.music.song import load_song
from choreograph.plan.plan import Plan
from choreograph.render.rendering import render
from choreograph.settings import load_config
from choreograph.studio.ratings import KEY_NAME
from research.study.results import read_key, read_ratings

MOTION = stepping(60, period_s=0.5)
_COUNTS = "time_s,number,figure\n0.100,1,basic\n0.600,2,\n1.100,3,\n1.600,4,-\n"
_BEATS = "0.5 1\n1.0 2\n1.5 3\n2.0 4 # and on\n2.5\n3.0,3.0,2\n"
_CONFIG = 'engine = "graph"\nfps = 30.0\nseed = 3\nlock_feet = true\n[weights]\nrhythm = 2.5\nstyle = 0\n'
_MANIFEST = (
    "name,genre,performer,licence,source,audio_offset_s,song,beats\n"
    'take,waltz,"Ada, L.",CC0,here,0.25,song.wav,0.1 0.6 1.1\n'
)
_FIGURES = "c3d_file,movement_tag,start_frame,end_frame,beats\nrec,C-1,0,40,4\nrec,C-2,40,80,4\n"


def all_targets(folder: Path) -> list[Target]:
    """Every target, each with its files in a folder of its own below `folder`."""
    return [target for make in _MAKERS for target in make(folder)]


def _target(
    folder: Path, name: str, file_name: str, kind: str, seeds: list[bytes], read: Callable[[Path], Any],
    *, round_trip: Callable[[Any, Path], None] | None = None, sane: Sequence[SaneFile] = (),
    make: Callable[[Rng], bytes] | None = None,
) -> Target:  # fmt: skip
    own = folder / name
    own.mkdir(parents=True, exist_ok=True)
    return Target(name, file_name, kind, seeds, read, own, round_trip, sane, make)


def _takes(path: Path) -> list[Take]:
    """What `build-db` does with a source before it measures anything."""
    takes = annotate_takes(list(import_takes(path)), path)
    assert takes
    return takes


def _motions(folder: Path) -> Iterator[Target]:
    def saved(suffix: str, motion=MOTION) -> bytes:
        save_motion(folder / f"good.{suffix}", motion)
        return (folder / f"good.{suffix}").read_bytes()

    for suffix, kind, others, sane in (
        ("bvh", "words", [saved("bvh", swaying(20))], [*test_bvh.FILES, *test_rigs.FILES]),
        ("npz", "npz", [saved("npz", swaying(20))], []),
        ("glb", "glb", [saved("vrma")], test_glb.FILES),
        ("vmd", "bytes", [saved("vmd", swaying(8))], []),
    ):
        seeds = [saved(suffix), *others]
        yield _target(
            folder, suffix, f"take.{suffix}", kind, seeds, _takes, round_trip=takes_again, sane=sane
        )
    markers = write_c3d(folder / "good.c3d", markers_on(swaying(90, fps=80.0)))
    yield _target(
        folder,
        "c3d",
        "take.c3d",
        "bytes",
        [markers.read_bytes()],
        _takes,
        round_trip=takes_again,
        sane=C3D_FILES,
    )
    poses, trans = rot.to_rotvec(MOTION.local_quat).reshape(MOTION.n_frames, -1), MOTION.root_pos_m
    smpl = {"smpl_poses": poses, "smpl_trans": 93 * trans, "smpl_scaling": np.array([93.0]), "smpl_loss": 0.1}
    pickles = [pickle.dumps(smpl, protocol=protocol) for protocol in (0, 2, 4, 5)]

    def aist(path: Path) -> list[Take]:
        return _takes(path.parents[1])

    (folder / "pkl" / "motions").mkdir(parents=True)
    yield _target(
        folder,
        "pkl",
        "motions/gBR_sBM_cAll_d04_mBR0_ch01.pkl",
        "bytes",
        pickles,
        aist,
        round_trip=takes_again,
    )
    packed = io.BytesIO()
    np.savez(packed, poses=np.hstack([poses[:, :66], np.zeros((60, 90))]), trans=trans, mocap_framerate=30.0)
    yield _target(
        folder,
        "amass",
        "take.npz",
        "npz",
        [packed.getvalue()],
        _takes,
        round_trip=takes_again,
        sane=SMPL_FILES,
    )


def made_pickles(folder: Path) -> Iterator[Target]:
    """What may have pickles in it, made instruction by instruction."""
    poses, trans = np.zeros((60, 72), np.float32), MOTION.root_pos_m
    dance = {"smpl_poses": poses, "smpl_trans": trans}
    pickles = [pickle.dumps(dance, protocol=protocol) for protocol in range(6)]
    yield _target(folder, "made-pickle", "take.pkl", "bytes", pickles, _takes, make=pickle_program)
    arrays = []
    for content in (np.array(dance, object), MOTION.joint_pos_m(), np.asfortranarray(MOTION.joint_pos_m())):
        packed = io.BytesIO()
        np.save(packed, content)
        arrays.append(packed.getvalue())
    yield _target(folder, "made-npy", "take.npy", "bytes", arrays, _takes, make=npy_program)
    archives = []
    for given in (
        {"poses": poses, "trans": trans, "fps": np.array(30)},
        {**dance, "smpl_scaling": np.ones(1)},
    ):
        packed = io.BytesIO()
        np.savez(packed, **given)
        archives.append(packed.getvalue())
    save_motion(folder / "good.npz", MOTION)
    archives.append((folder / "good.npz").read_bytes())
    yield _target(
        folder, "made-npz", "take.npz", "npz", archives, _takes, make=partial(npz_program, archives)
    )
    key = bytes(16)

    def kept(data: bytes) -> bytes:
        return hashlib.sha256(data).digest() + data

    def result(path: Path) -> Any:
        found = DiskCache(path.parent, 1 << 30).read(key)
        if found is None:
            raise FormatError("it is made again")
        return found

    yield _target(
        folder,
        "made-result",
        f"{key.hex()}.value",
        "bytes",
        [kept(data) for data in (*pickles, pickle.dumps(MOTION, 5))],
        result,
        make=lambda rng: kept(pickle_program(rng)),
    )


def _characters(folder: Path) -> Iterator[Target]:
    seeds = []
    for spec in ("mixamo", "vrm"):
        write_character(folder / "character.glb", CHARACTERS[spec])
        seeds.append((folder / "character.glb").read_bytes())
    rig = read_rig(read_gltf(folder / "character.glb"))

    def character(path: Path) -> None:
        read = read_rig(read_gltf(path))
        find_bones(read.rig.posed, read.human_bones)

    yield _target(folder, "character", "character.glb", "glb", seeds, character)
    names = {"pelvis": rig.rig.names[0], "left_hip": rig.rig.names[1]}
    yield _target(
        folder, "bone-map", "map.json", "json", [json.dumps(names).encode()],
        lambda path: find_bones(rig.rig.posed, {}, read_bone_map(path)),
    )  # fmt: skip


def _tables(folder: Path) -> Iterator[Target]:
    def beside(path: Path) -> list[Take]:
        return _takes(path.parent if path.is_file() else path)  # the sane manifests' own folders

    manifest = _target(
        folder, "manifest", "manifest.csv", "table", [_MANIFEST.encode()], beside, sane=test_manifests.FILES
    )
    save_motion(manifest.folder / "take.bvh", MOTION)
    write_clicks(manifest.folder / "song.wav", duration_s=3.0)
    yield manifest
    counts, beats = text_files("take.counts.csv", COUNT_FILES), text_files("song.beats", BEAT_FILES)
    yield _target(
        folder, "counts", "take.counts.csv", "table", [_COUNTS.encode()], read_counts,
        round_trip=counts_again, sane=counts,
    )  # fmt: skip
    yield _target(folder, "beats", "song.beats", "words", [_BEATS.encode()], read_beats, sane=beats)
    yield _target(folder, "config", "config.toml", "words", [_CONFIG.encode()], load_config)
    figures = _target(folder, "figures", "figures.csv", "table", [_FIGURES.encode()], beside)
    (figures.folder / "c3d").mkdir()
    write_c3d(figures.folder / "c3d" / "rec.c3d", markers_on(swaying(90, fps=80.0)))
    yield figures
    dances = [
        {
            "name": "take",
            "dance_type": "W",
            "start_pos": 0,
            "end_pos": 50,
            "movements": ["A", "B"],
            "durations": [3, 3],
        }
    ]
    yield _target(
        folder,
        "choreographies",
        "choreographies.json",
        "json",
        [json.dumps(dances).encode()],
        read_choreographies,
    )
    (folder / "melody" / "DANCE_C_1").mkdir(parents=True)
    points = np.random.default_rng(0).normal(size=(4, 23, 3)).round(2).tolist()
    skeletons = {"length": 4, "center": [[0, 90, 0]] * 4, "skeletons": points}
    config = {"start_position": 0, "end_position": 4}
    (folder / "melody" / "DANCE_C_1" / "config.json").write_text(json.dumps(config))
    yield _target(
        folder, "melody", "DANCE_C_1/skeletons.json", "json", [json.dumps(skeletons).encode()],
        lambda path: _takes(path.parent),
    )  # fmt: skip


def _dances(folder: Path) -> Iterator[Target]:
    takes = with_counts(synthetic_takes(duration_s=12.0))
    contents = with_vocabulary(synthetic_contents(takes), takes)
    seeds = []
    for compress in (False, True):
        write_repertoire(folder / "good.h5", contents, compress=compress)
        seeds.append((folder / "good.h5").read_bytes())
    yield _target(folder, "repertoire", "rep.h5", "hdf5", seeds, read_all)
    repertoire = Repertoire.open(folder / "good.h5")
    song = load_song(write_clicks(folder / "song.wav", duration_s=6.0))
    plans = [
        cg.dance(song, repertoire, engine=engine).plan.to_json().encode() for engine in ("graph", "mixer")
    ]

    def dance(path: Path) -> None:
        damaged = Repertoire.open(path)
        for engine in ("graph", "mixer"):
            cg.dance(song, damaged, engine=engine)

    yield _target(folder, "danced-repertoire", "rep.h5", "hdf5", seeds, dance)

    def plan(path: Path) -> Plan:
        read = Plan.read(path)
        render(read, repertoire)
        return read

    yield _target(folder, "plan", "plan.json", "json", plans, plan, round_trip=plan_again)
    n_motifs = repertoire.vocabulary.n_motifs
    signature = {
        "format": "choreograph-signature",
        "version": 1,
        "name": "a",
        "shares": [1 / n_motifs] * n_motifs,
    }
    yield _target(
        folder,
        "signature",
        "signature.json",
        "json",
        [json.dumps(signature).encode()],
        read_signature,
        round_trip=signature_again,
    )
    motifs = [[1, 2, 3], [{"at_s": 1.0, "motif": 2}]]
    yield _target(
        folder, "motifs", "motifs.json", "json", [json.dumps(m).encode() for m in motifs], read_motifs
    )


def _studies(folder: Path) -> Iterator[Target]:
    study = small_study(folder)
    rate_all(study, dict.fromkeys(VARIANTS, 3.0), n_raters=1)
    key = read_key(study / KEY_NAME)
    (answers,) = study.glob("rating-*.json")
    yield _target(
        folder, "study-answers", "rating.json", "json", [answers.read_bytes()],
        lambda path: read_ratings(path.parent, key),
    )  # fmt: skip
    yield _target(folder, "study-key", "key.json", "json", [(study / KEY_NAME).read_bytes()], read_key)


def _songs(folder: Path) -> Iterator[Target]:
    samples = np.random.default_rng(1).normal(scale=0.1, size=(2205, 2)).astype(np.float32)
    seeds = []
    for kind, subtype in (
        ("WAV", "PCM_16"),
        ("WAV", "FLOAT"),
        ("FLAC", "PCM_16"),
        ("OGG", "VORBIS"),
        ("AIFF", "PCM_24"),
    ):
        content = io.BytesIO()
        soundfile.write(content, samples, 22050, format=kind, subtype=subtype)
        seeds.append(content.getvalue())
    for kind, codec in (("mp3", "libmp3lame"), ("mp4", "aac"), ("matroska", "libopus")):
        seeds.append(_encoded(samples, kind, codec))
    yield _target(folder, "song", "song.mp3", "bytes", seeds, load_song, sane=test_songs.FILES)


def _encoded(samples: np.ndarray, kind: str, codec: str) -> bytes:
    content = io.BytesIO()
    with av.open(content, "w", format=kind) as container:
        stream = container.add_stream(codec, rate=48000, layout="stereo")
        frame = av.AudioFrame.from_ndarray(samples.T.copy(), format="fltp", layout="stereo")
        frame.rate = 48000
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return content.getvalue()


_MAKERS = (_motions, made_pickles, _characters, _tables, _dances, _studies, _songs)
