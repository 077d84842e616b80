"""A rating study: a blinded web page on which people rate dances of several variants by four questions.

In ChoreoGraph, section 4.4, 20 judges rated 10 dances of 6 s from each of four systems, from 0 to 5, by
variation, naturalness, style match and rhythm alignment. We differ in one point: variation is rated for each
dance, because raters who see mixed, unnamed variants cannot compare the dances of one system with each other.
Without sound, only the first two questions are used; the others are about the music.

`write_study` writes two files to a folder. `study.html` is all that a rater gets: an offline page for any
browser that plays the dances with the preview's player and saves the answers as a small file. It contains no
name of a variant, song or take, and nothing of a plan; all dances have the same body and frame rate.
`key.json` holds the mapping from dances to variants and stays with whoever runs the study.
`study_results.read_study` reads the key and the raters' files.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.errors import ParameterError
from choreograph.files import atomic_path
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget, share_skeleton
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.preview.compression import ROTVEC_STEP_RAD, compress_mesh, compress_motion
from choreograph.preview.mannequin import build_mannequin
from choreograph.preview.page_assembly import bundle_scripts, fill_template, page_part, to_script_json
from choreograph.preview.sound import encode_mp4, song_part

PAGE_NAME = "study.html"
KEY_NAME = "key.json"
KEY_FORMAT = "choreograph-study-key"
VERSION = 1
_KEY_NOTE = "Which dance is of which variant: keep this file from the raters, and give them study.html only."
_FPS = 60.0
_ORDERS_TRIED = 200
_PLAYER = (
    "math.js", "decompress.js", "skeleton.js", "clock.js", "camera.js", "shaders.js", "skin.js",
    "renderer.js", "stage.js", "orbit.js", "elements.js", "player.js",
)  # fmt: skip
_SCRIPTS = ("answers.js", "questions.js", "study.js")


@dataclass(frozen=True)
class Question:
    """A question about every dance, answered from 0 to 5."""

    id: str
    title: str
    text: str
    needs_sound: bool


QUESTIONS = (
    Question("variation", "Variation", "Is the dance varied, without repeating itself?", False),
    Question(
        "naturalness", "Naturalness",
        "Is the motion natural and realistic, as if danced by a person and not a machine?", False,
    ),
    Question(
        "style", "Style match",
        "Does the style of the dance match the style of the music? Ignore the beat here.", True,
    ),
    Question("rhythm", "Rhythm", "Does the dance follow the beat of the music?", True),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class StudyDance:
    """One dance to rate: from any engine, from another system, or a real one."""

    motion: Motion
    song_path: Path
    start_s: float = 0.0  # start of the motion in the song file


def write_study(
    dances: Mapping[str, Sequence[StudyDance]],
    folder: str | Path,
    *,
    seed: int,
    sound: bool = True,
    excerpt_s: float | None = None,
) -> None:
    """Write a blinded rating page for the dances, `study.html`, and its key, `key.json`.

    Parameters
    ----------
    dances : by variant, at least one each. Ratings are compared pairwise where variants share a song: the
        n-th dance of one variant to the song with the n-th of the other
    folder : for the two files; created if its parent exists
    seed : of the order of the dances, in which the same song is not used twice in a row if possible
    sound : whether to play the songs and to ask the questions about music
    excerpt_s : seconds from the middle of each dance (6 in the paper); the whole dance if None

    The same dances and seed give the same bytes. Raters cannot recognise a variant by its body, frame rate or
    length: dances on different skeletons are retargeted to the canonical one, all play at 60 fps, and dances
    to the same song are cut to the shortest.

    Raises
    ------
    ParameterError     no variant or dance, a folder that already holds a study, an excerpt below 1 s, a
                       skeleton that cannot be retargeted
    FormatError        a song cannot be read
    ChoreographError   the disk is full or not writable
    """
    folder = Path(folder)
    ordered = _shuffled(dances, np.random.default_rng(_checked_seed(seed)))
    check_study_folder(folder)
    questions = [question for question in QUESTIONS if sound or not question.needs_sound]
    excerpts = _excerpts([dance for _, _, dance in ordered], excerpt_s)
    data, texts = _page_data(excerpts, sound=sound)
    question_data = [{"id": q.id, "title": q.title, "text": q.text} for q in questions]
    study = hashlib.sha256(json.dumps([question_data, data, texts], sort_keys=True).encode()).hexdigest()[:16]
    page = _page({"study": study, "questions": question_data, "sound": sound, **data}, texts)
    key = {
        "format": KEY_FORMAT,
        "version": VERSION,
        "note": _KEY_NOTE,
        "study": study,
        "seed": seed,
        "questions": [question.id for question in questions],
        "dances": [
            {
                "dance": entry["id"],
                "variant": variant,
                "song": excerpt.song_path.name,
                "number": number,
                "start_s": excerpt.start_s,
            }
            for entry, (variant, number, _), excerpt in zip(data["dances"], ordered, excerpts, strict=True)
        ],
    }
    folder.mkdir(exist_ok=True)
    for name, text in ((PAGE_NAME, page), (KEY_NAME, json.dumps(key, indent=1, ensure_ascii=False) + "\n")):
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")


def check_study_folder(folder: str | Path) -> None:
    """Raise `ParameterError` if the folder already holds a study, or cannot be created."""
    folder = Path(folder)
    if (folder / KEY_NAME).exists():
        raise ParameterError(
            f"{folder}: expected a folder without a study, got one with {KEY_NAME}, which its ratings need"
        )
    if not folder.parent.is_dir() or (folder.exists() and not folder.is_dir()):
        raise ParameterError(
            f"{folder}: expected a folder to write to: it is a file, or its parent is missing"
        )


def _checked_seed(seed: int) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ParameterError(f"expected a seed that is a whole number of 0 or more, got {seed!r}")
    return seed


def _shuffled(
    dances: Mapping[str, Sequence[StudyDance]], rng: np.random.Generator
) -> list[tuple[str, int, StudyDance]]:
    """All dances as (variant, number among its dances to the song, dance), in random order.

    The order is the one of many in which a song follows itself least often.
    """
    if not dances or not all(dances.values()):
        raise ParameterError("expected variants with at least one dance each, got none or an empty one")
    listed = []
    for variant, of_variant in dances.items():
        count: Counter[str] = Counter()
        for dance in of_variant:
            listed.append((variant, count[dance.song_path.name], dance))
            count[dance.song_path.name] += 1
    songs = np.unique([str(dance.song_path) for _, _, dance in listed], return_inverse=True)[1]  # (N,)
    orders = [rng.permutation(len(listed)) for _ in range(_ORDERS_TRIED)]
    best = min(orders, key=lambda order: int((np.diff(songs[order]) == 0).sum()))
    return [listed[i] for i in best]


def _excerpts(dances: Sequence[StudyDance], excerpt_s: float | None) -> list[StudyDance]:
    """The middle of every dance at one rate; dances to the same part of a song are cut to the shortest."""
    if excerpt_s is not None and not (np.isfinite(excerpt_s) and excerpt_s >= 1.0):
        raise ParameterError(f"expected an excerpt of 1 s or more, got {excerpt_s:g} s")
    motions = [dance.motion.resampled(_FPS) for dance in dances]
    shortest: dict[tuple[Path, float], int] = {}
    for dance, motion in zip(dances, motions, strict=True):
        part_of_song = (dance.song_path, dance.start_s)
        shortest[part_of_song] = min(motion.n_frames, shortest.get(part_of_song, motion.n_frames))
    excerpts = []
    for dance, motion in zip(dances, motions, strict=True):
        whole = shortest[dance.song_path, dance.start_s]
        n_frames = whole if excerpt_s is None else min(whole, round(excerpt_s * _FPS))
        first = (whole - n_frames) // 2
        start_s = round(dance.start_s + first / _FPS, 6)
        excerpts.append(StudyDance(motion.sliced(first, first + n_frames), dance.song_path, start_s))
    return excerpts


def _page_data(excerpts: Sequence[StudyDance], *, sound: bool) -> tuple[dict[str, Any], dict[str, str]]:
    """The page's data about the dances in order, and encoded bytes by the id of the element that holds them.

    A part of a song that several dances share is stored once.
    """
    motions = [excerpt.motion for excerpt in excerpts]
    if not share_skeleton(motions):
        motions = [retarget(motion, canonical_skeleton()) for motion in motions]
    mesh, mesh_layout = compress_mesh(build_mannequin(motions[0].skeleton, motions[0]))
    skeleton = motions[0].skeleton
    body = {
        "fps": _FPS, "rotvec_step_rad": ROTVEC_STEP_RAD, "names": skeleton.names, "mesh": mesh_layout,
        "parents": skeleton.parents.tolist(), "offsets_m": np.round(skeleton.offsets_m, 6).tolist(),
    }  # fmt: skip
    texts = {"mesh": mesh}
    sounds: dict[tuple[Path, float, float], int] = {}
    entries = []
    width = len(str(len(motions)))
    for number, (motion, excerpt) in enumerate(zip(motions, excerpts, strict=True), start=1):
        duration_s = round(motion.duration_s, 6)
        span = (excerpt.song_path, excerpt.start_s, duration_s)
        if sound and span not in sounds:
            sounds[span] = len(sounds)
            texts[f"sound-{sounds[span]}"] = _sound(*span)
        compressed = compress_motion(motion, max_bytes=2**62)  # full rate at any length
        dance = {
            "id": f"{number:0{width}d}", "duration_s": duration_s, "frames": compressed.n_frames,
            "root_step_m": compressed.root_step_m, "root_origin_m": compressed.root_origin_m,
            "sound": sounds.get(span),
        }  # fmt: skip
        texts[f"dance-{dance['id']}"] = compressed.text
        entries.append(dance)
    return {"body": body, "dances": entries}, texts


def _sound(path: Path, start_s: float, duration_s: float) -> str:
    return base64.b64encode(encode_mp4(song_part(path, start_s=start_s, duration_s=duration_s))).decode()


def _page(study: dict[str, Any], texts: dict[str, str]) -> str:
    study_page = {"package": "choreograph.evaluation", "folder": "study_page"}
    scripts = [page_part(name) for name in _PLAYER] + [page_part(name, **study_page) for name in _SCRIPTS]

    def elements(kind: str) -> str:
        return "\n".join(
            f'<script type="text/plain" id="{name}">{text}</script>'
            for name, text in texts.items()
            if name.startswith(kind)
        )

    return fill_template(
        page_part("index.html", **study_page),
        style=page_part("style.css") + page_part("study.css", **study_page),
        study=to_script_json(study),
        mesh=texts["mesh"],
        dances=elements("dance-"),
        sounds=elements("sound-"),
        script=bundle_scripts(scripts),
    )
