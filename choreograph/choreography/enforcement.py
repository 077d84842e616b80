"""Pinned, banned and kept motion in a dance.

A rendered dance is segmented at its words to find the motif that each of them shows. Where a pinned motif is
not danced, or a banned one is, `Repairs` has words of takes. `choreograph.pipeline.planning` renders them and
asks again. At the borders of what is kept of another dance, costs lead from and to the poses there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.graph.cost import Cost
from choreograph.choreography.graph.layers import Layer
from choreograph.choreography.mixer.words import AROUND_S, CandidatePool, Candidates, WordBank, search_words
from choreograph.choreography.slots import KeptDance, ResolvedConstraints
from choreograph.core.errors import NoPathError
from choreograph.core.numerics import Floats, Indices, frame_blocks
from choreograph.core.timebase import NET_FPS, WORD_FPS, frame_times_s, seconds_to_frames
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import WORDS_AT_ONCE, poses_at, word_bounds_s, words_between
from choreograph.motion.body import BODY_JOINTS, body_pos_m, clips_to_root_frame, to_root_frame
from choreograph.motion.motion import Motion
from choreograph.music.count_grids import coming_to_rest_s
from choreograph.music.song_features import SongFeatures
from choreograph.plan.plan import Plan, PlannedWord

# The motif of each word of a rendered motion.


def danced_motifs(
    motion: Motion,
    bounds_s: NDArray[np.float64],
    repertoire: Repertoire,
    pinned: Mapping[int, int] | None = None,
) -> NDArray[np.int64]:
    """The motif of each word (N,) of a motion segmented at `bounds_s` (N + 1,), as in a repertoire.

    It is -1 for a word that is too short to have one, and where a pinned motif (slot -> motif) is nearest but
    too far: see `without_distant`.
    """
    embeddings = danced_embeddings(motion, bounds_s, repertoire)
    return without_distant(motifs_of_embeddings(embeddings, repertoire), embeddings, pinned or {}, repertoire)


def danced_embeddings(
    motion: Motion, bounds_s: NDArray[np.float64], repertoire: Repertoire
) -> NDArray[np.float32]:
    """The embedding of each word (N, D) of a motion segmented at `bounds_s` (N + 1,), nan if too short."""
    body = _body_at_word_rate(motion)
    inside = np.clip(bounds_s, 0.0, (len(body) - 1) / WORD_FPS)
    cut_s = word_bounds_s(inside, (len(body) - 1) / WORD_FPS)
    medoids = repertoire.vocabulary.motifs.embeddings  # (K, D)
    embeddings = np.full((len(bounds_s) - 1, medoids.shape[1]), np.nan, np.float32)
    for block in frame_blocks(len(cut_s) - 1, WORDS_AT_ONCE):
        words = words_between(body, WORD_FPS, cut_s[block.start : block.stop + 1])
        slots = np.searchsorted(bounds_s, (words.start_s + words.end_s) / 2, side="right") - 1
        embeddings[slots] = repertoire.word_net().embed(words.body_pos_m)
    return embeddings


def _body_at_word_rate(motion: Motion) -> NDArray[np.float64]:
    """Body positions (T, 21, 3) of `motion.resampled(WORD_FPS)`, in blocks, since a long dance is large."""
    if motion.fps == WORD_FPS:
        return body_pos_m(motion)
    n_frames = max(1, seconds_to_frames(motion.duration_s, WORD_FPS))
    frames = frame_times_s(n_frames, WORD_FPS) * motion.fps
    body: Floats = np.empty((n_frames, len(BODY_JOINTS), 3))
    for block in frame_blocks(n_frames):
        body[block] = body_pos_m(motion.sampled(frames[block], fps=WORD_FPS))
    return body


def motifs_of_embeddings(embeddings: NDArray[np.float32], repertoire: Repertoire) -> NDArray[np.int64]:
    """The motif (N,) nearest to each embedding (N, D), or -1 for nan."""
    motifs = np.full(len(embeddings), -1, np.int64)
    known = ~np.isnan(embeddings[:, 0])
    if known.any():
        motifs[known] = repertoire.vocabulary.motifs.nearest(embeddings[known])
    return motifs


_RADIUS_PERCENT = 95.0
_LEAST_RADIUS_M = 0.1  # transitions change words by as much, also those of motifs whose words are all alike


def without_distant(
    danced: NDArray[np.int64],
    embeddings: NDArray[np.float32],
    pinned: Mapping[int, int],
    repertoire: Repertoire,
) -> NDArray[np.int64]:
    """The motifs (N,) of a dance, -1 where a pinned one (slot -> motif) is danced only by name.

    The nearest motif of a word may be far from it. A word dances a pinned motif if it is as near to its
    medoid as 95 % of the words of the motif in the takes are, or within 0.1 m.
    """
    motifs = danced.copy()
    vocabulary = repertoire.vocabulary
    bank = WordBank(vocabulary, repertoire.clip_motion.poses_at, repertoire.word_net().embed)
    for slot, motif in pinned.items():
        if danced[slot] != motif:
            continue
        of_words = bank.distances_to_motifs(vocabulary.words_of_motif(motif))[:, motif]
        radius_m = max(float(np.percentile(of_words, _RADIUS_PERCENT)), _LEAST_RADIUS_M)
        if np.linalg.norm(embeddings[slot] - vocabulary.motifs.embeddings[motif]) > radius_m:
            motifs[slot] = -1
    return motifs


# Pinned and banned motifs. Words of takes replace motion that violates them, until none does.


class Repairs:
    """Words of takes for the slots of a dance where pinned motifs are not danced or banned ones are.

    Each word is the one with the best transitions from and to the dance around it. A word that does not show
    its motif in the rendered dance, or makes another slot wrong, is replaced by the next best.
    """

    def __init__(
        self, plan: Plan, motion: Motion, constraints: ResolvedConstraints, repertoire: Repertoire
    ) -> None:
        self._plan, self._constraints, self._repertoire = plan, constraints, repertoire
        self._pool = CandidatePool.of(constraints, repertoire, np.random.default_rng(plan.seed))
        self._body, self._fps = body_pos_m(motion), motion.fps
        self._candidates: dict[int, Candidates] = {}
        self._chosen: dict[int, int] = {}

    def words(self, embeddings: NDArray[np.float32]) -> tuple[PlannedWord, ...] | None:
        """The words for a dance whose words have these embeddings (N, D), or None if nothing is wrong.

        They are those for what was wrong before as well. Raises `NoPathError` naming the motif and the time
        for which no word is left.
        """
        constraints, repertoire = self._constraints, self._repertoire
        nearest = motifs_of_embeddings(embeddings, repertoire)
        danced = without_distant(nearest, embeddings, constraints.motifs, repertoire)
        wrong = [
            slot for slot in violated_slots(danced, constraints) if is_danced(slot, self._plan, constraints)
        ]
        if not wrong:
            return None
        for slot in wrong:
            here = self._candidates.get(slot) or self._near(slot)
            self._candidates[slot] = here.without(self._chosen[slot]) if slot in self._chosen else here
            if not self._candidates[slot].any_left:
                raise NoPathError(no_word_left(slot, constraints))
        self._chosen = {}
        for slots in consecutive_slots(dict.fromkeys(self._candidates)):  # chosen together
            words = search_words([self._candidates[slot] for slot in slots])
            self._chosen.update(zip(slots, words.tolist(), strict=True))
        return tuple(
            self._pool.planned(slot, word, pinned=True) for slot, word in sorted(self._chosen.items())
        )

    def _near(self, slot: int) -> Candidates:
        """The words for a slot. The distance from the dance at both borders adds to their cost."""
        here = self._pool.candidates(slot, self._constraints.motifs.get(slot))
        start_s, end_s = self._constraints.bounds_s[slot : slot + 2]
        distance_m = self._distance_m(here.first_m, start_s) + self._distance_m(here.last_m, end_s)
        return replace(here, cost_m=here.cost_m + distance_m)

    def _distance_m(self, poses_m: NDArray[np.floating], at_s: float) -> NDArray[np.floating]:
        danced_m = clips_to_root_frame(poses_at(self._body, self._fps, at_s + AROUND_S))  # (3, 21, 3)
        distance_m: NDArray[np.floating] = np.sqrt(
            np.square(poses_m - danced_m).sum(axis=-1).mean(axis=(1, 2))
        )
        return distance_m


def is_danced(slot: int, plan: Plan, constraints: ResolvedConstraints) -> bool:
    """Whether a slot is danced throughout, without a pose that is held."""
    end_s = plan.duration_s if plan.closing_s is None else coming_to_rest_s(plan.opening_s, plan.closing_s)[0]
    start_s, stop_s = constraints.bounds_s[slot : slot + 2]
    inside: bool = start_s >= plan.opening_s and stop_s <= end_s
    return inside


def violated_slots(danced: Indices, constraints: ResolvedConstraints) -> list[int]:
    """Slots whose motif (N,) is not the required one, or is banned. A word without a motif is -1."""
    banned = np.append(constraints.motif_banned, False)[danced]
    return [
        slot
        for slot, motif in enumerate(danced)
        if banned[slot] or (slot in constraints.motifs and motif != constraints.motifs[slot])
    ]


def no_word_left(slot: int, constraints: ResolvedConstraints) -> str:
    """The message for a slot for which no word is left."""
    at = f"{constraints.bounds_s[slot]:.1f} s"
    if slot in constraints.motifs:
        return (
            f"no word of motif {constraints.motifs[slot]} can be danced at {at} without becoming another "
            "motif: pin it at another time, or pin another motif"
        )
    return f"no word without a banned motif can be danced at {at}: ban fewer motifs"


# The borders of the parts that are kept of another dance, and the poses there.


_POSE_WEIGHT = 6.0  # per metre, twice the default of `transition`, since a gap has only two ends
_VELOCITY_WEIGHT = 0.6  # per metre a second


@dataclass(frozen=True)
class Border:
    """The time at which a gap begins or ends."""

    at_s: float
    begins: bool


def gap_borders(kept: KeptDance, duration_s: float) -> list[Border]:
    """The times at which gaps begin after a kept part, or end before one."""
    ends = [Border(k.end_s, True) for k in kept.spans if k.end_s < duration_s]
    starts = [Border(k.start_s, False) for k in kept.spans if k.start_s > 0]
    return sorted(ends + starts, key=lambda border: border.at_s)


class KeptBorders(Cost):
    """Distance in pose and velocity of nodes at a gap's borders from the existing dance there.

    Nodes are compared on the whole second nearest to a border.
    """

    name = "kept_borders"
    sentence = "The pose differs from that of the part that is kept."
    min_jump_cost = 0.0

    def __init__(self, kept: KeptDance, duration_s: float) -> None:
        body, fps = body_pos_m(kept.motion), kept.motion.fps
        self._at: dict[tuple[int, bool], tuple[Floats, Floats]] = {}
        for border in gap_borders(kept, duration_s):
            second = round(border.at_s)
            poses = poses_at(body, fps, second + AROUND_S)  # (3, 21, 3)
            velocity = (poses[2] - poses[0]) / (AROUND_S[2] - AROUND_S[0])
            of_layer = second if border.begins else second - 1
            self._at[of_layer, border.begins] = to_root_frame(poses[1]), to_root_frame(poses[1], velocity)

    def node(self, layer: Layer, song_features: SongFeatures) -> Floats | None:
        cost = np.zeros(layer.n_nodes)
        for begins in (True, False):
            if (layer.second, begins) not in self._at:
                continue
            pose_m, velocity_m_s = self._at[layer.second, begins]
            poses = layer.first_pose_m if begins else layer.last_pose_m
            velocities = layer.first_velocity_m_s if begins else layer.last_velocity_m_s
            cost += _POSE_WEIGHT * _rms(poses - pose_m) + _VELOCITY_WEIGHT * _rms(velocities - velocity_m_s)
        return cost if cost.any() else None


_SAME_S = 0.5  # parts of a take that are nearer look the same


class AvoidRepeating(Cost):
    """1 for a node that an earlier dance had in this second, in the same take within half a second."""

    name = "unlike"  # in plans
    sentence = "An earlier dance has the same here."

    def __init__(self, earlier: Sequence[Plan]) -> None:
        self._earlier = [plan for plan in earlier if plan.seconds]

    def node(self, layer: Layer, song_features: SongFeatures) -> NDArray[np.floating]:
        same = np.zeros(layer.n_nodes, bool)
        start_s = layer.take_frames[:, 0] / NET_FPS
        for plan in self._earlier:
            there = plan.seconds[layer.second]
            same |= (layer.take_names == there.take) & (abs(start_s - there.source_times_s[0]) < _SAME_S)
        return same.astype(np.float64)


def with_border_costs(
    candidates: list[Candidates], kept: KeptDance, constraints: ResolvedConstraints
) -> list[Candidates]:
    """The words for each slot (N,), with the distance from the existing dance at borders of gaps as cost."""
    body, fps, bounds_s = body_pos_m(kept.motion), kept.motion.fps, constraints.bounds_s
    dearer = list(candidates)
    for border in gap_borders(kept, float(bounds_s[-1])):
        nearest = int(np.abs(bounds_s - border.at_s).argmin())
        slot = nearest if border.begins else nearest - 1
        if not 0 <= slot < len(dearer):
            continue
        here = dearer[slot]
        poses = clips_to_root_frame(poses_at(body, fps, bounds_s[nearest] + AROUND_S))  # (3, 21, 3)
        own = here.first_m if border.begins else here.last_m
        distance_m = np.sqrt(np.square(own - poses).sum(axis=-1).mean(axis=(1, 2)))
        dearer[slot] = replace(here, cost_m=here.cost_m + distance_m)
    return dearer


def _rms(vectors: NDArray[np.floating]) -> Floats:
    """Root mean square lengths (N,) of vectors (N, 21, 3)."""
    rms: Floats = np.sqrt(np.square(vectors).sum(axis=-1).mean(axis=-1))
    return rms


def consecutive_slots(slots: Mapping[int, object]) -> list[list[int]]:
    """Slots that follow one another with the same value, in order."""
    groups: list[list[int]] = []
    for slot in sorted(slots):
        if groups and groups[-1][-1] == slot - 1 and slots[slot - 1] == slots[slot]:
            groups[-1].append(slot)
        else:
            groups.append([slot])
    return groups
