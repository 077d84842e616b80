"""A rating study: a page that shows dances of several variants blindly and asks the four questions.

ChoreoGraph, section 4.4, asked 20 judges to rate 10 dances of 6 s from each of four systems, 0 to 5, by
variation, naturalness, style match and rhythm alignment. The same here, but that variation is asked of each
dance: with variants mixed and unnamed, nobody can say how a system's dances differ from one another.
Without sound only the first two questions are asked, since nobody can hear what the others are about.

`write_study` leaves two files in a folder. `study.html` is all that a rater gets: one page for any browser,
offline, that plays the dances with the preview's own player and saves the answers as a small file. It
holds no name of a variant, song or take, and nothing of a plan; all dances have the same body and rate. What
is what is in `key.json`, which stays with whoever runs the study. `study_results.read_study` reads the
key and the raters' files.
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
_KEY_NOTE = "Which dance is of which variant: keep this file from the raters, who get study.html alone."
_FPS = 60.0
_ORDERS_TRIED = 200
_PLAYER = (
    "math.js", "decompress.js", "skeleton.js", "clock.js", "camera.js", "shaders.js", "skin.js",
    "renderer.js", "stage.js", "orbit.js", "elements.js", "player.js",
)  # fmt: skip
_SCRIPTS = ("answers.js", "questions.js", "study.js")


@dataclass(frozen=True)
class Question:
    """What is asked of every dance, answered from 0 to 5."""

    id: str
    title: str
    text: str
    needs_sound: bool


QUESTIONS = (
    Question("variation", "Variation", "Is the dance varied, without repeating itself?", False),
    Question(
        "naturalness", "Naturalness",
        "Is the motion natural and real, as if a person had danced it and not a machine?", False,
    ),
    Question(
        "style", "Style match",
        "Does the style of the dance match the style of the music? Leave the beat aside here.", True,
    ),
    Question("rhythm", "Rhythm", "Does the dance move with the beats of the music?", True),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class StudyDance:
    """One dance to be rated: of any engine, of another system, or a real one."""

    motion: Motion
    song_path: Path
    start_s: float = 0.0  # of the motion in the song file


def write_study(
    dances: Mapping[str, Sequence[StudyDance]],
    folder: str | Path,
    *,
    seed: int,
    sound: bool = True,
    excerpt_s: float | None = None,
) -> None:
    """Write a blinded rating page of the dances, `study.html`, and its key, `key.json`.

    Parameters
    ----------
    dances : by variant, at least one each. Ratings are compared pairwise where variants share a song: the
        n-th dance of a variant to a song with the n-th of another
    folder : for the two files; made if its parent is there
    seed : of the order, in which no song follows itself where that can be had
    sound : whether the songs play, and questions about music are asked
    excerpt_s : seconds to show, about the middle of each dance (the paper: 6); all of it unless given

    The same dances and seed give the same bytes. Dances on several skeletons are all retargeted to the
    canonical one, all are shown at 60 fps, and those to one song are cut to the shortest: no variant is
    known by its body, its rate or its length.

    Raises
    ------
    ParameterError     no variant or dance, a folder that holds a study already, an excerpt below 1 s, a
                       skeleton that cannot be retargeted
    FormatError        a song cannot be read
    ChoreographError   the disk is full, or may not be written to
    """
    folder = Path(folder)
    shown = _in_order(dances, np.random.default_rng(_checked_seed(seed)))
    check_study_folder(folder)
    questions = [question for question in QUESTIONS if sound or not question.needs_sound]
    excerpts = _excerpts([dance for _, _, dance in shown], excerpt_s)
    data, texts = _packed(excerpts, sound=sound)
    asked = [{"id": q.id, "title": q.title, "text": q.text} for q in questions]
    study = hashlib.sha256(json.dumps([asked, data, texts], sort_keys=True).encode()).hexdigest()[:16]
    page = _page({"study": study, "questions": asked, "sound": sound, **data}, texts)
    key = {
        "format": KEY_FORMAT,
        "version": VERSION,
        "note": _KEY_NOTE,
        "study": study,
        "seed": seed,
        "questions": [question.id for question in questions],
        "dances": [
            {
                "dance": compressed["id"],
                "variant": variant,
                "song": cut.song_path.name,
                "number": number,
                "start_s": cut.start_s,
            }
            for compressed, (variant, number, _), cut in zip(data["dances"], shown, excerpts, strict=True)
        ],
    }
    folder.mkdir(exist_ok=True)
    for name, text in ((PAGE_NAME, page), (KEY_NAME, json.dumps(key, indent=1, ensure_ascii=False) + "\n")):
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")


def check_study_folder(folder: str | Path) -> None:
    """Raise `ParameterError` if no study can be written there: one is there, or it cannot be a folder."""
    folder = Path(folder)
    if (folder / KEY_NAME).exists():
        raise ParameterError(
            f"cannot write a study to {folder}: there is one already, and its ratings need its key"
        )
    if not folder.parent.is_dir() or (folder.exists() and not folder.is_dir()):
        raise ParameterError(f"cannot write a study to {folder}: it is no folder, or its parent is not there")


def _checked_seed(seed: int) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ParameterError(f"expected a seed that is a whole number of 0 or more, got {seed!r}")
    return seed


def _in_order(
    dances: Mapping[str, Sequence[StudyDance]], rng: np.random.Generator
) -> list[tuple[str, int, StudyDance]]:
    """Variant, the how many-th of it to its song, and dance; shuffled: of many orders the one where songs
    follow themselves the least."""
    if not dances or not all(dances.values()):
        raise ParameterError("expected variants with at least one dance each, got none or an empty one")
    listed = []
    for variant, own in dances.items():
        count: Counter[str] = Counter()
        for dance in own:
            listed.append((variant, count[dance.song_path.name], dance))
            count[dance.song_path.name] += 1
    songs = np.unique([str(dance.song_path) for _, _, dance in listed], return_inverse=True)[1]  # (N,)
    orders = [rng.permutation(len(listed)) for _ in range(_ORDERS_TRIED)]
    best = min(orders, key=lambda order: int((np.diff(songs[order]) == 0).sum()))
    return [listed[i] for i in best]


def _excerpts(dances: Sequence[StudyDance], excerpt_s: float | None) -> list[StudyDance]:
    """The middles of all dances at one rate; those to one part of a song with one length, the shortest's."""
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


def _packed(excerpts: Sequence[StudyDance], *, sound: bool) -> tuple[dict[str, Any], dict[str, str]]:
    """What the page knows of the dances, in their order, and compressed bytes by the element that holds them.

    A stretch of a song that several dances share is there once.
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
    sound_ids: dict[tuple[Path, float, float], int] = {}
    shown = []
    width = len(str(len(motions)))
    for number, (motion, excerpt) in enumerate(zip(motions, excerpts, strict=True), start=1):
        duration_s = round(motion.duration_s, 6)
        span = (excerpt.song_path, excerpt.start_s, duration_s)
        if sound and span not in sound_ids:
            sound_ids[span] = len(sound_ids)
            texts[f"sound-{sound_ids[span]}"] = _sound(*span)
        compressed = compress_motion(motion, max_bytes=2**62)  # at its full rate, however long
        dance = {
            "id": f"{number:0{width}d}", "duration_s": duration_s, "frames": compressed.n_frames,
            "root_step_m": compressed.root_step_m, "root_origin_m": compressed.root_origin_m,
            "sound": sound_ids.get(span),
        }  # fmt: skip
        texts[f"dance-{dance['id']}"] = compressed.text
        shown.append(dance)
    return {"body": body, "dances": shown}, texts


def _sound(path: Path, start_s: float, duration_s: float) -> str:
    return base64.b64encode(encode_mp4(song_part(path, start_s=start_s, duration_s=duration_s))).decode()


def _page(study: dict[str, Any], texts: dict[str, str]) -> str:
    own = {"package": "choreograph.evaluation", "folder": "study_page"}
    scripts = [page_part(name) for name in _PLAYER] + [page_part(name, **own) for name in _SCRIPTS]

    def elements(kind: str) -> str:
        return "\n".join(
            f'<script type="text/plain" id="{name}">{text}</script>'
            for name, text in texts.items()
            if name.startswith(kind)
        )

    return fill_template(
        page_part("index.html", **own),
        style=page_part("style.css") + page_part("study.css", **own),
        study=to_script_json(study),
        mesh=texts["mesh"],
        dances=elements("dance-"),
        sounds=elements("sound-"),
        script=bundle_scripts(scripts),
    )
