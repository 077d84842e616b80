"""A study: a blinded web page on which people rate dances of several variants, or compare two at a time."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, check_apart
from choreograph.core.progress import ProgressReport
from choreograph.evaluation.results import REAL
from choreograph.evaluation.run import Variant, dance_variant
from choreograph.evaluation.songs import EvaluatedSong, check_unseen
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.motion.skinned_mesh import build_mannequin
from choreograph.studio.ratings import BETTER, KEY_FORMAT, KEY_NAME, VERSION
from choreograph.view.page import (
    ROTVEC_STEP_RAD,
    bundle_scripts,
    compress_mesh,
    compress_motion,
    fill_template,
    page_part,
    to_script_json,
)
from choreograph.view.sound import encode_mp4, song_part

# The questions of a study: about each dance, as in ChoreoGraph, and about pairs, as in Rhythm is a Dancer.
#
# In ChoreoGraph, section 4.4, 20 judges rated 10 dances of 6 s from each of four systems, from 0 to 5, by
# variation, naturalness, style match and rhythm alignment. We differ in one point: variation is rated for
# each dance, because raters who see mixed, unnamed variants cannot compare the dances of one system with each
# other. Without sound, only the first two questions are used, because the others are about the music.
#
# In Rhythm is a Dancer, section 5.3, 45 observers chose one of two clips that represents the genre better,
# and marked single clips as recorded or generated. Here both questions are about pairs: which of two dances
# to one song is more salsa, and which was made by a computer. A forced choice has a chance level of 0.5, for
# any share of "real" answers. The paper played no music with the question about realism. To do the
# same, write the study without sound.

ASKED = ("ratings", "pairs", "both")
_ORDERS_TRIED = 200


@dataclass(frozen=True)
class Question:
    """A question about every dance, answered from 0 to 5."""

    id: str
    title: str
    text: str
    needs_sound: bool


@dataclass(frozen=True)
class PairQuestion:
    """A question about every pair of dances, answered by one of them."""

    id: str
    title: str
    text: str  # a question with {genre} is used if the genre is known


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
PAIR_QUESTIONS = (
    PairQuestion("genre", "Genre", "Which is more {genre}?"),
    PairQuestion("computer", "Computer", "Which was made by a computer? If both were: which looks more so?"),
)
STUDIO_QUESTION = PairQuestion(BETTER, "Better", "Which is better?")  # of two versions in the studio


def pair_questions(genre: str) -> list[dict[str, str]]:
    """The questions about a pair of dances of a genre, as the page shows them. "" is no genre."""
    return [
        {"id": q.id, "title": q.title, "text": q.text.format(genre=genre)}
        for q in PAIR_QUESTIONS
        if genre or "{genre}" not in q.text
    ]


def paired(
    ordered: Sequence[tuple[str, int, StudyDance]], rng: np.random.Generator
) -> list[tuple[tuple[int, int], str]]:
    """Pairs of dances (variant, number, dance) to one song as indices, and their genre, in random order.

    Raises `ParameterError` if no two variants danced to one song.
    """
    by_song: dict[tuple[str, float, int], list[int]] = {}
    for index, (_, number, dance) in enumerate(ordered):
        by_song.setdefault((dance.song_path.name, dance.start_s, number), []).append(index)
    pairs = [
        (song, first, second)
        for (song, _, _), indices in sorted(by_song.items())
        for first, second in combinations(indices, 2)
    ]
    if not pairs:
        raise ParameterError("expected two variants that danced to one song, to compare them: got none")
    mixed = [pairs[i] for i in mixed_order([song for song, _, _ in pairs], rng)]
    sides = rng.permuted(np.array([pair[1:] for pair in mixed]), axis=1)  # (P, 2)
    genres = [ordered[first][2].genre or ordered[second][2].genre for _, first, second in mixed]
    return [((int(a), int(b)), genre) for (a, b), genre in zip(sides, genres, strict=True)]


def mixed_order(songs: Sequence[str], rng: np.random.Generator) -> NDArray[np.int64]:
    """A random order (N,) of items, the one of many in which a song follows itself least often."""
    of_item = np.unique(list(songs), return_inverse=True)[1]  # (N,)
    orders = [rng.permutation(len(songs)) for _ in range(_ORDERS_TRIED)]
    return min(orders, key=lambda order: int((np.diff(of_item[order]) == 0).sum()))


# A study is a blinded web page on which people rate dances of several variants, or compare two at a time.
#
# `write_study` writes two files to a folder. Raters get only `study.html`, an offline page for any browser
# that plays the dances and saves the answers as a small file. It contains no name of a variant, song or take,
# and no plan. All dances have the same body and frame rate. `key.json` maps dances to variants and stays with
# the organiser. `results.read_study` reads the key and the files of the raters.


PAGE_NAME = "study.html"
_KEY_NOTE = "Which dance is of which variant: keep this file from the raters, and give them study.html only."
_FPS = 60.0
_PLAYER = (
    "math.js", "decompress.js", "ground_path.js", "skeleton.js", "clock.js", "camera.js", "shaders.js",
    "skin.js", "stage_colours.js", "resolution.js", "webgl.js", "body.js", "shadows.js", "renderer.js",
    "stage.js", "orbit.js", "elements.js", "player.js",
)  # fmt: skip
_SCRIPTS = ("answers.js", "questions.js", "study.js")
_OWN = Path(__file__).with_name("page")


@dataclass(frozen=True, eq=False)
class StudyDance:
    """One dance to rate: from any engine, from another system, or a real one."""

    motion: Motion
    song_path: Path
    start_s: float = 0.0  # start of the motion in the song file
    genre: str = ""  # that pairs are compared by


def write_study(
    dances: Mapping[str, Sequence[StudyDance]],
    folder: str | Path,
    *,
    seed: int,
    sound: bool = True,
    excerpt_s: float | None = None,
    ask: str = "ratings",
) -> None:
    """Write a blinded page for the dances, `study.html`, and its key, `key.json`.

    Parameters
    ----------
    dances : by variant, at least one each. Ratings are compared pairwise where variants share a song: the
        n-th dance of one variant to the song with the n-th of the other
    folder : for the two files, created if its parent exists
    seed : of the order of the dances, in which the same song is not used twice in a row if possible
    sound : whether to play the songs and to ask the questions about music
    excerpt_s : seconds from the middle of each dance (6 in the paper), or the whole dance if None
    ask : "ratings" of each dance, "pairs" to compare, or "both". Pairs are the n-th dances of two variants to
        a song, for every two variants. Which one is shown first is random

    The same dances and seed give the same bytes. Raters cannot recognise a variant by its body, frame rate or
    length. Dances on different skeletons are retargeted to the canonical one, all play at 60 fps, and dances
    to the same song are cut to the shortest.

    Raises
    ------
    ParameterError     no variant or dance, a folder that already holds a study, an excerpt below 1 s, a
                       skeleton that cannot be retargeted, pairs without two variants to a song
    FormatError        a song cannot be read
    ChoreographError   the disk is full or not writable
    """
    folder = Path(folder)
    rng = np.random.default_rng(_checked_seed(seed))
    if ask not in ASKED:
        raise ParameterError(f"expected to ask one of {', '.join(ASKED)}, got {ask!r}")
    ordered = _shuffled(dances, rng)
    pairs = paired(ordered, rng) if ask != "ratings" else []
    check_study_folder(folder)
    listed = [dance.song_path for of_variant in dances.values() for dance in of_variant]
    check_apart([folder / PAGE_NAME, folder / KEY_NAME], listed)
    questions = [q for q in QUESTIONS if ask != "pairs" and (sound or not q.needs_sound)]
    excerpts = _excerpts([dance for _, _, dance in ordered], excerpt_s)
    data, texts = _page_data(excerpts, sound=sound)
    ids = [entry["id"] for entry in data["dances"]]
    pair_data: list[dict[str, Any]] = [
        {"id": f"p{number}", "dances": [ids[i] for i in pair], "questions": pair_questions(genre)}
        for number, (pair, genre) in enumerate(pairs, start=1)
    ]
    asked = {
        "questions": [{"id": q.id, "title": q.title, "text": q.text} for q in questions],
        "pairs": pair_data,
    }
    study = hashlib.sha256(json.dumps([asked, data, texts], sort_keys=True).encode()).hexdigest()[:16]
    page = _page({"study": study, "sound": sound, **asked, **data}, texts)
    key = {
        "format": KEY_FORMAT, "version": VERSION, "note": _KEY_NOTE, "study": study, "seed": seed,
        "questions": [question.id for question in questions],
        **_key_items(ids, ordered, excerpts, pair_data),
    }  # fmt: skip
    folder.mkdir(exist_ok=True)
    for name, text in ((PAGE_NAME, page), (KEY_NAME, json.dumps(key, indent=1, ensure_ascii=False) + "\n")):
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")


def _key_items(
    ids: Sequence[str],
    ordered: Sequence[tuple[str, int, StudyDance]],
    excerpts: Sequence[StudyDance],
    pairs: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """The dances and pairs of the page, with their variants and songs."""
    return {
        "dances": [
            {"dance": name, "variant": variant, "song": excerpt.song_path.name, "number": number,
             "start_s": excerpt.start_s}
            for name, (variant, number, _), excerpt in zip(ids, ordered, excerpts, strict=True)
        ],
        "pairs": [
            {"pair": pair["id"], "dances": pair["dances"], "questions": [q["id"] for q in pair["questions"]]}
            for pair in pairs
        ],
    }  # fmt: skip


def check_study_folder(folder: str | Path) -> None:
    """Raise `ParameterError` if the folder already holds a study, or cannot be created."""
    folder = Path(folder)
    for name in (KEY_NAME, PAGE_NAME):
        if os.path.lexists(folder / name):
            raise ParameterError(
                f"{folder}: expected a folder without a study, got {name} already there: its ratings need it"
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
    """All dances as (variant, number among its dances to the song, dance), in random order."""
    if not dances or not all(dances.values()):
        raise ParameterError("expected variants with at least one dance each, got none or an empty one")
    listed = []
    for variant, of_variant in dances.items():
        count: Counter[str] = Counter()
        for dance in of_variant:
            listed.append((variant, count[dance.song_path.name], dance))
            count[dance.song_path.name] += 1
    return [listed[i] for i in mixed_order([str(dance.song_path) for _, _, dance in listed], rng)]


def _excerpts(dances: Sequence[StudyDance], excerpt_s: float | None) -> list[StudyDance]:
    """The middle of every dance at one rate. Dances to the same part of a song are cut to the shortest."""
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
        sliced = motion.sliced(first, first + n_frames)
        excerpts.append(StudyDance(sliced, dance.song_path, start_s, dance.genre))
    return excerpts


def _page_data(excerpts: Sequence[StudyDance], *, sound: bool) -> tuple[dict[str, Any], dict[str, str]]:
    """The page's data about the dances in order, and encoded bytes by the id of the element that holds them.

    A part of a song that several dances share is stored once.
    """
    motions = [excerpt.motion for excerpt in excerpts]
    if not all(motion.skeleton.same_as(motions[0].skeleton) for motion in motions[1:]):
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
    scripts = [page_part(name) for name in _PLAYER] + [_own_part(name) for name in _SCRIPTS]

    def elements(kind: str) -> str:
        return "\n".join(
            f'<script type="text/plain" id="{name}">{text}</script>'
            for name, text in texts.items()
            if name.startswith(kind)
        )

    return fill_template(
        _own_part("index.html"),
        style=page_part("style.css") + _own_part("study.css"),
        study=to_script_json(study),
        mesh=texts["mesh"],
        dances=elements("dance-"),
        sounds=elements("sound-"),
        script=bundle_scripts(scripts),
    )


def _own_part(name: str) -> str:
    """The text of a part of the page that is a study's own."""
    return (_OWN / name).read_text(encoding="utf-8")


# The dances of a rating study: one per variant and held-out song, and the real ones.


def make_study_dances(
    repertoire: Repertoire,
    songs: Sequence[EvaluatedSong],
    variants: Sequence[Variant],
    *,
    seen: bool = False,
    report: ProgressReport | None = None,
) -> dict[str, list[StudyDance]]:
    """Dances to every song by variant, with seed 0. Songs with a real dance add the variant `REAL`.

    Raises as `evaluate` does, and `ParameterError` if the repertoire was built from a song, unless `seen`.
    """
    if not seen:
        check_unseen(songs, repertoire)
    dances: dict[str, list[StudyDance]] = {variant.name: [] for variant in variants}
    n_dances = len(songs) * len(variants)
    for number, song in enumerate(songs):
        loaded = song.load()
        for done, variant in enumerate(variants, start=number * len(variants)):
            if report is not None:
                report("dancing", done, n_dances)
            dance = dance_variant(variant, loaded, repertoire)
            dances[variant.name].append(StudyDance(dance.motion, song.path, song.start_s, song.genre))
        if song.take is not None:
            motion = song.take.motion
            motion = motion.sliced(0, max(1, min(motion.n_frames, round(loaded.duration_s * motion.fps))))
            dances.setdefault(REAL, []).append(StudyDance(motion, song.path, song.start_s, song.genre))
    return dances
