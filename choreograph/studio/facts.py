"""What the page of the studio shows of a dance, a part of it and its song, as JSON."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.characters.gltf_character import GltfCharacter
from choreograph.core.numerics import Floats
from choreograph.library.repertoire import Repertoire
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS
from choreograph.motion.skinned_mesh import build_mannequin
from choreograph.music.places import Places
from choreograph.music.song import Song
from choreograph.music.song_features import SongFeatures
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.rearranging import joins_s
from choreograph.view.page import dance_facts
from choreograph.view.page_data import (
    ROTVEC_STEP_RAD,
    CompressedMotion,
    compress_mesh,
    compress_motion,
    other_facts,
)

_MOST_MOTION_BYTES = 1 << 25  # on this machine, a page may load more than one that is sent around
_FAST = 1  # the level of zlib for what does not leave this machine
_SMALL_FPS = 20.0  # of small figures
_TURN_RAD = 1e-4  # of a joint, below which a pose is the same
_GAP_S = 0.25  # between parts that changed, which are then one


def mannequin_facts(repertoire: Repertoire) -> tuple[str, dict[str, Any]]:
    """The mesh of the mannequin as text, and what is needed to decode it and to move its joints."""
    skeleton = repertoire.skeleton
    mesh, layout = compress_mesh(build_mannequin(skeleton))
    return mesh, {
        "rotvec_step_rad": ROTVEC_STEP_RAD,
        "names": list(skeleton.names),
        "parents": skeleton.parents.tolist(),
        "offsets_m": np.round(skeleton.offsets_m, 6).tolist(),
        "mesh": layout,
    }


def character_facts(character: GltfCharacter) -> dict[str, Any]:
    """A character as JSON: bones by canonical joint, all bones, and nodes as in the page of a dance."""
    known = [name for name in CANONICAL_JOINTS if name in character.bones]
    return {
        "name": Path(character.document.name).name,
        "bones": {name: character.rig.names[character.bones[name]] for name in character.bones},
        "all_bones": list(character.rig.names), "joints": list(CANONICAL_JOINTS),
        "names": known, "nodes": [character.nodes[character.bones[name]] for name in known],
    }  # fmt: skip


def motion_data(motion: Motion, *, small: bool = False) -> dict[str, Any]:
    """A compressed motion as `facts` and `motion`. Small ones have 20 frames a second."""
    shown = motion.resampled(min(motion.fps, _SMALL_FPS)) if small else motion
    made = _compressed(shown)
    facts = {
        "fps": made.fps, "frames": made.n_frames, "root_step_m": made.root_step_m,
        "root_origin_m": list(made.root_origin_m),
    }  # fmt: skip
    return {"facts": facts, "motion": made.text}


def other_motion_data(motion: Motion, dancer: int, first: Motion, mesh: dict[str, Any]) -> dict[str, Any]:
    """As `motion_data` of another dancer of a scene, with the facts of its body.

    `dancer` is its index, `first` the motion of the first one, and `mesh` the layout of the first one's mesh.
    """
    made = _compressed(motion)
    return {"facts": other_facts(made, motion, dancer, first, mesh), "motion": made.text}


def _compressed(motion: Motion) -> CompressedMotion:
    return compress_motion(motion, max_bytes=_MOST_MOTION_BYTES, level=_FAST)


def whole_facts(
    dance: Dance, features: SongFeatures, mannequin: dict[str, Any], motion: dict[str, Any]
) -> dict[str, Any]:
    """The facts of a dance as in the page of `choreograph dance`, with sections, phrases, words and edits.

    `mannequin` and `motion` are the facts of both.
    """
    plan = dance.plan
    duration_s = min(dance.motion.duration_s, plan.blocks[-1].end_s)
    facts = dance_facts(plan, duration_s, title=plan.song or "Dance", motion_beats_s=dance.motion_beats_s)
    return {
        **facts, **mannequin, **motion,
        "start_s": plan.start_s, "opening_s": plan.opening_s, "closing_s": plan.danced_until_s,
        **places(features),
        "words": [
            {"start_s": word.start_s, "end_s": word.end_s, "motif": word.motif, "take": word.take,
             "mirrored": word.mirrored, "pinned": word.pinned}
            for word in plan.words
        ],
        "edits": [
            {"start_s": edit.start_s, "end_s": edit.end_s, "request": edit.request} for edit in plan.edits
        ],
        "joins": [round(join_s, 4) for join_s in joins_s(plan)],
        "engine": plan.engine, "weights": plan.weights, "notes": list(dance.notes),
        "unmet": list(dance.unmet), "cost": round(plan.total_cost, 4),
    }  # fmt: skip


def places(features: SongFeatures) -> dict[str, Any]:
    """The sections, phrases, bars, choruses and verses of a song, and its energy by second."""
    named = Places.of_song(features).spans_s
    bounds_s = features.sections.bounds_s.tolist()
    sections = [
        {"name": name, "start_s": round(start_s, 4), "end_s": round(end_s, 4)}
        for name, (start_s, end_s) in zip(features.sections.names, pairwise(bounds_s), strict=True)
    ]
    spans = {
        f"{name}s": [[round(start_s, 4), round(end_s, 4)] for start_s, end_s in named[kind]]
        for name, kind in (("bar", "bar"), ("phrase", "phrase"), ("choruse", "chorus"), ("verse", "verse"))
    }
    return {"sections": sections, **spans, "energy": np.round(features.energy, 3).tolist()}


def waveform(song: Song, points: int) -> list[float]:
    """The peaks of a song in `points` parts of one length, the loudest of which is 1."""
    samples = np.abs(song.samples)
    borders = np.linspace(0, len(samples), points + 1).astype(np.int64)
    starts = np.minimum(borders[:-1], len(samples) - 1)
    peaks = np.maximum.reduceat(samples, starts) if len(samples) else np.zeros(points)
    loudest = max(float(peaks.max(initial=0.0)), 1e-4)
    return [round(float(peak), 3) for peak in peaks / loudest]


def changed_spans(before: Motion, after: Motion) -> list[tuple[float, float]]:
    """The parts of a dance (T frames) in which its poses differ from those before, in order of time."""
    n = min(before.n_frames, after.n_frames)
    apart: Floats = np.abs(before.local_quat[:n, 1:] - after.local_quat[:n, 1:]).max(axis=(1, 2))
    frames = np.flatnonzero(apart > _TURN_RAD)
    spans: list[tuple[float, float]] = []
    for frame in frames.tolist():
        start_s, end_s = frame / after.fps, (frame + 1) / after.fps
        if spans and start_s - spans[-1][1] < _GAP_S:
            spans[-1] = spans[-1][0], end_s
        else:
            spans.append((start_s, end_s))
    return spans
