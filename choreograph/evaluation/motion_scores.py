"""One motion, and the beats of its music, to every metric that applies, each with its chance level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.errors import ParameterError
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.metrics import (
    beat,
    dance_features,
    frechet,
    labels,
    physical,
    references,
    retrieval,
    structure,
    warping,
)
from choreograph.motion.body import body_pos_m
from choreograph.motion.floor import sole_pos_m
from choreograph.motion.motion import Motion
from choreograph.plan import Plan
from choreograph.repertoire import Repertoire
from choreograph.song_analysis import analyse_song
from choreograph.timebase import NET_FPS, NODE_FRAMES, STORE_FPS

Floats = NDArray[np.float64]

_CHANCE_ROUNDS = 100
_HALVINGS = 5
RETRIEVED = 50  # clips looked at


@dataclass(frozen=True, eq=False)
class Scores:
    """Numbers by the names of `catalogue.METRICS`, and what chance gets where that is known."""

    values: Mapping[str, float]
    chance: Mapping[str, float] = field(default_factory=dict)

    def __or__(self, other: Scores) -> Scores:
        return Scores({**self.values, **other.values}, {**self.chance, **other.chance})


def beat_scores(motion: Motion, music_beats_s: Floats, rng: np.random.Generator) -> Scores:
    """Beat metrics of a motion and the music's beats (Q,), those after its end left out.

    Raises `ParameterError` if beats are not increasing or the rig's names are unknown.
    """
    motion = motion.resampled(STORE_FPS)
    pos_m = body_pos_m(motion)
    music = np.asarray(music_beats_s, np.float64)
    music = music[music <= motion.duration_s]
    made = motion_beat_times_s(pos_m, motion.fps)
    values = beat.evaluate(made, music) | beat.evaluate_published(pos_m, motion.fps, music)
    if len(made) == 0 or len(music) == 0:
        return Scores(values)
    length_s, rounds = motion.duration_s, _CHANCE_ROUNDS
    chance = beat.evaluate_chance(made, music, duration_s=length_s, rng=rng, rounds=rounds)
    for name in beat.PROTOCOLS:
        score = partial(beat.alignment_score, protocol=name)
        theirs = beat.published_motion_beats_s(pos_m, motion.fps, name)
        chance[f"alignment_{name}_published"] = beat.chance_level(
            score, theirs, music, duration_s=length_s, rng=rng, rounds=rounds
        )
    return Scores(values, chance)


def physical_scores(motion: Motion, boundary_times_s: Sequence[float] | Floats = ()) -> Scores:
    """Feet, floor, jerk and bones; of joins at `boundary_times_s` if there are any."""
    motion = motion.resampled(STORE_FPS)
    return Scores(
        physical.evaluate(body_pos_m(motion), motion.fps, boundary_times_s, sole_pos_m=sole_pos_m(motion))
    )


class RealDances:
    """Real dances that others are held against; each belongs to a song, and no dance meets its own song's."""

    def __init__(self, motions: Sequence[Motion], songs: Sequence[str], *, like: Motion) -> None:
        """`like` is of the rig of the dances to come. Raises `ParameterError` if rigs cannot be compared."""
        self.songs = tuple(songs)
        self._roles = frechet.validate([*motions, like])
        self.poses = [self.poses_of(motion) for motion in motions]
        self._gaussians: dict[str, dict[str, frechet.Gaussian]] = {}

    def poses_of(self, motion: Motion) -> Floats:
        """A dance's poses (T', D), in radians, at the joints that all dances have."""
        return frechet.poses_rad(motion, self._roles)

    def scores(self, motion: Motion, song: str, rng: np.random.Generator) -> Scores:
        """FPD and FMD of a dance to the real dances to other songs; nothing if it is too short."""
        if song not in self._gaussians:
            others = [p for p, other in zip(self.poses, self.songs, strict=True) if other != song]
            self._gaussians[song] = _gaussians(others)
        real = self._gaussians[song]
        poses = self.poses_of(motion)
        if len(poses) < frechet.MOVEMENT_POSES + 1:
            return Scores({})
        still = np.repeat(poses[rng.integers(len(poses))][None], len(poses), axis=0)
        return Scores(
            *(
                {name: frechet.frechet_distance(ours[name], real[name]) for name in ours}
                for ours in (_gaussians([poses]), _gaussians([still]))
            )
        )


def _gaussians(poses: Sequence[Floats]) -> dict[str, frechet.Gaussian]:
    movements = [frechet.movements_of(p) for p in poses]
    return {
        "fpd": frechet.fit_gaussian(np.concatenate(poses)),
        "fmd": frechet.fit_gaussian(np.concatenate(movements)),
    }


@dataclass(frozen=True, eq=False)
class FeatureRows:
    """Features of a dance's pieces in both variants, and its poses, to be pooled over dances."""

    corrected: dance_features.DanceFeatures
    published: dance_features.DanceFeatures
    poses: Floats | None  # (T', D) as `RealDances` has them

    @classmethod
    def of(cls, motion: Motion, real: RealDances | None) -> FeatureRows:
        """Of each 20 s of a motion; raises `ParameterError` if its rig's names are unknown."""
        return cls(
            dance_features.features_of([motion], variant="corrected"),
            dance_features.features_of([motion], variant="published"),
            None if real is None else real.poses_of(motion),
        )


def set_scores(dances: Sequence[FeatureRows], real: Sequence[FeatureRows]) -> dict[str, float]:
    """FID and diversity of a set of dances by name, if there are two pieces or more; pooled FPD and FMD."""
    scores: dict[str, float] = {}
    for variant, suffix in (("corrected", ""), ("published", "_published")):
        ours, theirs = (_pooled([getattr(rows, variant) for rows in side]) for side in (dances, real))
        if min(len(ours.kinetic), len(theirs.kinetic)) < 2:
            continue
        found = dance_features.evaluate(ours, theirs)
        scores |= {f"{name}{suffix}": v for name, v in found.items() if not name.startswith("real_")}
    poses = [[rows.poses for rows in side if rows.poses is not None] for side in (dances, real)]
    if all(poses):
        one, other = (_gaussians(of_side) for of_side in poses)
        scores |= {f"{name}_all": frechet.frechet_distance(one[name], other[name]) for name in one}
    return scores


def real_set_scores(
    real: Sequence[FeatureRows], songs: Sequence[str], rng: np.random.Generator
) -> dict[str, float]:
    """The same of one half of the real dances against the other, the mean of some halvings by song."""
    if len(set(songs)) < 2:
        return {}
    rounds = []
    for _ in range(_HALVINGS):
        one, other = references.halves(songs, rng)
        rounds.append(set_scores([real[i] for i in one], [real[i] for i in other]))
    return {name: float(np.mean([r[name] for r in rounds])) for name in rounds[0]}


def _pooled(parts: Sequence[dance_features.DanceFeatures]) -> dance_features.DanceFeatures:
    return dance_features.DanceFeatures(
        np.concatenate([part.kinetic for part in parts]),
        np.concatenate([part.geometric for part in parts]),
        parts[0].variant,
    )


def plan_scores(plan: Plan, repertoire: Repertoire, genre: str = "") -> Scores:
    """What a plan makes of the repertoire, and how fast it plays takes; nothing if a network dances.

    `genre` is the song's, where it is known.
    """
    blocks = plan.blocks
    takes = [block.planned.take for block in blocks]
    if not all(takes):
        return Scores({})
    pieces_s = np.array([(b.start_s, b.end_s, b.source_start_s, b.source_end_s) for b in blocks])
    scores = {
        "longest_repeat_s": structure.longest_repeat_s(takes, pieces_s),
        "distinct_takes_per_minute": structure.distinct_takes_per_minute(takes, plan.duration_s),
    }
    if plan.seconds:
        scores |= warping.evaluate(time_maps(plan))
    genres = {take.name: take.credits.genre for take in repertoire.takes}
    if genre not in genres.values():
        return Scores(scores)
    of_genre_s = sum(length_s for take, length_s in plan.takes_s().items() if genres[take] == genre)
    lengths_s = np.array([take.duration_s for take in repertoire.takes])
    chance = float(
        lengths_s[[take.credits.genre == genre for take in repertoire.takes]].sum() / lengths_s.sum()
    )
    return Scores(scores | {"own_genre": of_genre_s / plan.duration_s}, {"own_genre": chance})


def time_maps(plan: Plan) -> Floats:
    """The take's frame at every frame of the plan's seconds, ends included, (S, 21) at 20 fps."""
    times_s = np.array([second.source_times_s for second in plan.seconds], np.float64)
    return times_s.reshape(-1, NODE_FRAMES + 1) * NET_FPS


def retrieval_scores(song: Song, genre: str, repertoire: Repertoire) -> Scores:
    """How many of the clips nearest in style to each second of a song are of its genre, and how early.

    Nothing if the repertoire has no style networks, or no clip of the genre.
    """
    genres = np.array([take.credits.genre for take in repertoire.takes])[repertoire.clip_take]
    of_genre = genres == genre
    if not genre or "style" not in repertoire.net_names or not of_genre.any():
        return Scores({})
    music, _ = analyse_song(song, repertoire)
    distances = np.linalg.norm(music.style[:, None] - repertoire.clip_style, axis=2)  # (S, N)
    relevant = of_genre[np.argsort(distances, axis=1, kind="stable")]
    k = min(RETRIEVED, repertoire.n_clips)
    found = retrieval.evaluate(relevant, k)
    found = {name.replace(f"_at_{k}", ""): value for name, value in found.items()}
    chance = {name.removesuffix("_chance"): v for name, v in found.items() if name.endswith("_chance")}
    return Scores({name: v for name, v in found.items() if not name.endswith("_chance")}, chance)


def dance_label_values(motion: Motion) -> Floats:
    """The four dance labels of each window of 4 s, in their own units, (N, 4)."""
    return labels.dance_values(body_pos_m(motion), motion.fps, labels.window_starts_s(motion.duration_s))


def label_scores(scale: labels.LabelScale, dance_values: Floats, music_values: Floats) -> Scores:
    """Label distances over the windows that dance and music both have; none if there is no such window."""
    n = min(len(dance_values), len(music_values))
    if n == 0:
        return Scores({})
    found = labels.evaluate(scale.dance_labels(dance_values[:n]), scale.music_labels(music_values[:n]))
    chance = {name.removesuffix("_chance"): v for name, v in found.items() if name.endswith("_chance")}
    return Scores({name: v for name, v in found.items() if not name.endswith("_chance")}, chance)


def check_measurable(motion: Motion, name: str) -> None:
    """Raise `ParameterError` naming the dance if its rig is not a body that can be measured."""
    try:
        body_pos_m(motion.sliced(0, 1))
    except ParameterError as error:
        raise ParameterError(f"{name}: {error}") from None
