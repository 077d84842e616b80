"""What the page of the studio shows, as JSON.

These are the facts of a dance, a part of it and its song, why something is danced (`explained`), and the
`Palette`: parts of takes and motifs to choose from, by genre, energy, level, travel and name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.characters.character import GltfCharacter
from choreograph.choreography.edits import edit_slots, slot_bounds_s
from choreograph.choreography.enforcement import AvoidRepeating, KeptBorders
from choreograph.choreography.graph.candidates import AllowedNodes
from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.costs import DEFAULT_WEIGHTS, cost_kinds
from choreograph.choreography.pieces import PieceRequest
from choreograph.core.counts import bars_of
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, Indices, default_numerics, one_thread
from choreograph.core.timebase import NET_FPS
from choreograph.library.repertoire import Repertoire
from choreograph.motion.body import ground_pos_m
from choreograph.motion.motion import Credits, Motion
from choreograph.motion.skeleton import CANONICAL_JOINTS
from choreograph.motion.skinned_mesh import build_mannequin
from choreograph.music.song import Song
from choreograph.music.song_features import Places, SongFeatures
from choreograph.pipeline.dancing import Dance
from choreograph.pipeline.editing import Editor, joins_s
from choreograph.plan.plan import Block, Plan, PlannedSecond, goes_on
from choreograph.view.page import (
    ROTVEC_STEP_RAD,
    CompressedMotion,
    compress_mesh,
    compress_motion,
    dance_facts,
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


# Why something is danced.


_LONGEST_S = 6.0  # of a part for which the next best is looked for

# Of pieces of takes for a part of a dance, in metres of joint distance.
OF_PIECE = {
    "joins": "The poses at both ends differ from the dance around it.",
    "travel": "The path must be corrected to lead back to the dance.",
    "front": "It begins with the back to the audience.",
    "tempo": "It is played faster or slower than it was danced.",
    "count": "It begins on another count of the bar.",
    "genre": "It is of another genre than the dance has here.",
    "energy": "It is livelier or quieter than the dance was here.",
    "again": "The same part of a take is danced nearby.",
    "difference": "It differs from what was danced here.",
}


def explained(dance: Dance, repertoire: Repertoire, at_s: float) -> dict[str, Any]:
    """What is danced at a time: the take, its credits, what it costs in one sentence each, and the next best.

    Raises `ParameterError` outside of the dance.
    """
    plan = dance.plan
    if not 0 <= at_s <= plan.duration_s:
        raise ParameterError(f"expected a time within the dance of {plan.duration_s:g} s, got {at_s:g}")
    run = run_at(plan, at_s)
    first, last = run[0], run[-1]
    start_s, end_s = first.start_s, last.end_s
    source_s = last.source_end_s - first.source_start_s
    costs: dict[str, float] = {}
    for block in run:
        if isinstance(block.planned, PlannedSecond):
            for name, cost in block.planned.costs.items():
                costs[name] = costs.get(name, 0.0) + cost
    edits = [edit.request for edit in plan.edits if edit.start_s < end_s and edit.end_s > start_s]
    return {
        "take": first.source, **asdict(first.planned.credits),
        "figure": _figure(repertoire, first, at_s, run),
        "start_s": round(start_s, 4), "end_s": round(end_s, 4), "bars": _bars(plan, start_s, end_s),
        "from_s": round(first.source_start_s, 3), "to_s": round(last.source_end_s, 3),
        "stretched": round((end_s - start_s) / source_s, 4) if source_s > 0 else None,
        "mirrored": first.mirrored, "edits": edits, "reasons": reasons(costs, of_dance()),
        "next_best": next_best(dance, repertoire, (start_s, end_s), at_s),
    }  # fmt: skip


def run_at(plan: Plan, at_s: float) -> Sequence[Block]:
    """The blocks around a time in which one take goes on without a jump."""
    blocks = plan.blocks
    here = next((i for i, block in enumerate(blocks) if block.start_s <= at_s < block.end_s), len(blocks) - 1)
    first = last = here
    while first > 0 and goes_on(blocks[first - 1], blocks[first]):
        first -= 1
    while last < len(blocks) - 1 and goes_on(blocks[last], blocks[last + 1]):
        last += 1
    return blocks[first : last + 1]


def reasons(costs: Mapping[str, float], sentences: Mapping[str, str]) -> list[dict[str, Any]]:
    """The costs in order, each with its share of all and a sentence. Those of 0 are left out."""
    total = sum(costs.values())
    return [
        {
            "name": name, "cost": round(cost, 4), "share": round(cost / total, 4),
            "sentence": sentences.get(name, "A cost of your own."),
        }
        for name, cost in sorted(costs.items(), key=lambda item: -item[1])
        if cost > 0
    ]  # fmt: skip


def of_dance() -> dict[str, str]:
    """The sentences of the costs of the graph engine, by name, also of those that requests add."""
    kinds: list[type[Cost]] = [*cost_kinds(), AllowedNodes, KeptBorders, AvoidRepeating]
    return {kind.name: kind.sentence for kind in kinds}


def weight_choices() -> list[dict[str, Any]]:
    """A slider for the weight of each cost of the graph engine. That of another package is not used at 0."""
    return [
        {"name": cost.name, "label": cost.label, "default": DEFAULT_WEIGHTS.get(cost.name, 0.0), "low": 0.0,
         "high": cost.highest_weight, "sentence": cost.sentence}
        for cost in cost_kinds()
    ]  # fmt: skip


@default_numerics()
@one_thread()
def next_best(
    dance: Dance, repertoire: Repertoire, span_s: tuple[float, float], at_s: float
) -> dict[str, Any] | None:
    """The cheapest piece of a take that could be danced instead, or None if there is none."""
    bounds_s = slot_bounds_s(dance.plan)
    start_s = max(span_s[0], at_s - 0.5 * _LONGEST_S)
    end_s = min(span_s[1], start_s + _LONGEST_S)
    editor = Editor(dance, repertoire, (), 0)
    _, found = editor.pieces(edit_slots(start_s, end_s, bounds_s), PieceRequest(editor.allowed))
    if not found:
        return None
    best = found[0]
    return {
        "take": best.words[0].take, "genre": best.words[0].credits.genre, "why": best.why,
        "start_s": best.words[0].start_s, "end_s": best.words[-1].end_s, "cost": round(best.cost, 4),
        "reasons": reasons(best.costs, OF_PIECE),
    }  # fmt: skip


def _figure(repertoire: Repertoire, first: Block, at_s: float, run: Sequence[Block]) -> str | None:
    """The figure of the take at a time, if it is known."""
    if not first.planned.take:
        return None
    here = next((block for block in run if block.start_s <= at_s < block.end_s), first)
    source_s = here.source_s(at_s)
    figures = repertoire.figures(repertoire.take_index(first.planned.take))
    return next((figure.name for figure in figures if figure.start_s <= source_s < figure.end_s), None)


def _bars(plan: Plan, start_s: float, end_s: float) -> list[int]:
    """The numbers of the first and the last bar of a part, or none if bars are not known."""
    if not plan.music_beat_numbers:
        return []
    beats = zip(plan.music_beats_s, bars_of(plan.music_beat_numbers).tolist(), strict=True)
    inside = [int(bar) for s, bar in beats if start_s <= s < end_s]
    return [inside[0], inside[-1]] if inside else []


# The palette.


THIRDS = ("low", "middle", "high")
_COUNTS = 8  # of a part, in takes without figures
_COUNT_S = 0.5  # where counts are not known
_SHORTEST_S = 1.0
_MOST_PARTS = 20_000  # of a large library, evenly from all its takes
_LONGEST_SHOWN_S = 12.0
_MOST_MOTIFS = 200


@dataclass(frozen=True)
class PalettePart:
    """A part of a take. Energy, level and travel are thirds of all parts: 0 is the lowest."""

    take: str
    figure: str  # its name, or empty
    credits: Credits
    from_s: float
    to_s: float
    travel_m: float
    energy: int
    level: int  # of the hips above the floor
    travel: int

    @property
    def text(self) -> str:
        """What a search finds it by, in lower case."""
        return " ".join((self.take, self.figure, self.credits.genre, self.credits.performer)).lower()

    @property
    def facts(self) -> dict[str, Any]:
        """The part as JSON."""
        return {
            "take": self.take, "figure": self.figure or None, "genre": self.credits.genre,
            "performer": self.credits.performer, "licence": self.credits.licence, "from_s": self.from_s,
            "to_s": self.to_s, "energy": THIRDS[self.energy], "level": THIRDS[self.level],
            "travel": THIRDS[self.travel], "travel_m": self.travel_m,
        }  # fmt: skip


class Palette:
    """The parts and the motifs of a repertoire."""

    def __init__(self, repertoire: Repertoire) -> None:
        """Measure all parts."""
        self.parts = _parts(repertoire)
        self.motifs = _motifs(repertoire)

    def found(
        self, *, text: str, genre: str, energy: str, level: str, travel: str, offset: int, limit: int
    ) -> dict[str, Any]:
        """A page of the parts that have all of these. An empty text is any.

        Raises `ParameterError` for a third that is none.
        """
        wanted = {"energy": energy, "level": level, "travel": travel}
        for name, third in wanted.items():
            if third and third not in THIRDS:
                raise ParameterError(f"expected {name} among {', '.join(THIRDS)}, got {third[:20]!r}")
        words = text.lower().split()
        kept = [
            part
            for part in self.parts
            if (not genre or part.credits.genre == genre)
            and all(not third or THIRDS[getattr(part, name)] == third for name, third in wanted.items())
            and all(word in part.text for word in words)
        ]
        motifs = [motif for motif in self.motifs if not genre or motif["genre"] == genre]
        return {
            "total": len(kept), "takes": [part.facts for part in kept[offset : offset + limit]],
            "motifs": motifs[:_MOST_MOTIFS] if offset == 0 and not text else [],
        }  # fmt: skip


def part_motion(repertoire: Repertoire, take: str, from_s: float, to_s: float) -> dict[str, Any]:
    """The motion of a part of a take for a small figure.

    Raises `RepertoireError` for an unknown take, and `ParameterError` for a part that it does not have.
    """
    index = repertoire.take_index(take)
    duration_s = repertoire.takes[index].duration_s
    if not 0 <= from_s < to_s <= duration_s + 0.1:
        raise ParameterError(
            f"expected a part of {take}, which lasts {duration_s:.1f} s, got {from_s:g} to {to_s:g}"
        )
    motion, first_s = repertoire.motion(index, from_s, min(to_s, from_s + _LONGEST_SHOWN_S))
    return {"from_s": first_s, **motion_data(motion, small=True)}


def _parts(repertoire: Repertoire) -> list[PalettePart]:
    spans = [(i, *span) for i in range(len(repertoire.takes)) for span in _spans(repertoire, i)]
    spans = spans[:: -(-len(spans) // _MOST_PARTS)] if spans else []
    measured = np.zeros((len(spans), 3))  # metres a second of all joints, metres above the floor, metres
    take = -1
    body: Floats = np.zeros((0, 21, 3))
    for row, (index, from_s, to_s, _) in enumerate(spans):
        if index != take:
            take, body = index, np.asarray(repertoire.body_pos_m(index), np.float64)
        measured[row] = _measured(body[round(from_s * NET_FPS) : round(to_s * NET_FPS) + 1])
    thirds = np.stack([_thirds(measured[:, 0]), _thirds(measured[:, 1]), _thirds(measured[:, 2])], axis=1)
    found = []
    for (index, from_s, to_s, figure), values, third in zip(spans, measured, thirds.tolist(), strict=True):
        info, travel_m = repertoire.takes[index], round(float(values[2]), 2)
        span = round(from_s, 3), round(to_s, 3)
        found.append(PalettePart(info.name, figure, info.credits, *span, travel_m, *third))
    return found


def _spans(repertoire: Repertoire, index: int) -> list[tuple[float, float, str]]:
    """The parts of a take: its figures, or else eight counts each."""
    duration_s = repertoire.takes[index].duration_s
    figures = repertoire.figures(index)
    if figures:
        spans = [(figure.start_s, min(figure.end_s, duration_s), figure.name) for figure in figures]
    else:
        counts_s = repertoire.counts(index).times_s
        if len(counts_s) <= _COUNTS:
            counts_s = np.arange(0.0, duration_s, _COUNT_S)
        borders = [float(time_s) for time_s in counts_s[::_COUNTS] if time_s <= duration_s]
        spans = [(a, b, "") for a, b in pairwise(borders)]
    return [span for span in spans if span[1] - span[0] >= _SHORTEST_S]


def _measured(body_m: Floats) -> tuple[float, float, float]:
    """Speed of the joints, height of the hips and way of poses (T, 21, 3) at 20 fps."""
    if len(body_m) < 2:
        return 0.0, 0.0, 0.0
    ground_m = ground_pos_m(body_m)
    speed = np.linalg.norm(np.diff(body_m, axis=0), axis=-1).mean() * NET_FPS
    height_m = (body_m[:, 0, 1] - body_m[..., 1].min(axis=1)).mean()
    way_m = np.linalg.norm(ground_m[-1] - ground_m[0])
    return float(speed), float(height_m), float(way_m)


def _thirds(values: Floats) -> Indices:
    """The third (N,) of all values (N,) that each is in."""
    if len(values) == 0:
        return np.zeros(0, np.int64)
    borders = np.quantile(values, [1 / 3, 2 / 3])
    return np.searchsorted(borders, values, side="right").astype(np.int64)


def _motifs(repertoire: Repertoire) -> list[dict[str, Any]]:
    """Each motif with the word of a take that represents it."""
    if not repertoire.has_vocabulary:
        return []
    vocabulary = repertoire.vocabulary
    shown = []
    for motif in range(vocabulary.n_motifs):
        word = int(vocabulary.motifs.words[motif])
        info = repertoire.takes[int(vocabulary.word_take[word])]
        shown.append(
            {
                "motif": motif, "words": int(vocabulary.motifs.counts[motif]), "take": info.name,
                "genre": info.credits.genre, "from_s": round(float(vocabulary.word_start_s[word]), 3),
                "to_s": round(float(vocabulary.word_end_s[word]), 3),
            }
        )  # fmt: skip
    return shown
