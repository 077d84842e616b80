"""`Scores`, which are metric values by name, and the scores of a motion and its music."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from choreograph.core.counts import Counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS, STORE_FPS
from choreograph.evaluation.metrics import (
    beat,
    counts,
    energy_response,
    fid,
    frechet,
    front,
    labels,
    physical,
    structure,
    transitions,
)
from choreograph.evaluation.metrics.beat import our_beats_s
from choreograph.motion.body import body_pos_m
from choreograph.motion.contacts import sole_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget

# `Scores`: metric values by name with their chance levels.


@dataclass(frozen=True, eq=False)
class Scores:
    """Values by the names in `results.METRICS`, and chance levels where they are known."""

    values: Mapping[str, float]
    chance: Mapping[str, float] = field(default_factory=dict)

    def __or__(self, other: Scores) -> Scores:
        return Scores({**self.values, **other.values}, {**self.chance, **other.chance})


def split_chance(metrics: Mapping[str, float]) -> Scores:
    """`Scores` of a metric module's `evaluate`, whose chance levels are named `…_chance`."""
    return Scores(
        {name: value for name, value in metrics.items() if not name.endswith("_chance")},
        {name.removesuffix("_chance"): value for name, value in metrics.items() if name.endswith("_chance")},
    )


def weighted_mean(values: Mapping[str, Mapping[str, float]], weights: Mapping[str, float]) -> Scores:
    """Means by metric over the items that have a weight. Values that are not finite are left out."""
    names = {name for item in weights for name in values[item]}
    means = {}
    for name in sorted(names):
        pairs = [(values[item][name], weight) for item, weight in weights.items() if name in values[item]]
        pairs = [(value, weight) for value, weight in pairs if np.isfinite(value)]
        if pairs:
            finite, shares = zip(*pairs, strict=True)
            means[name] = float(np.average(finite, weights=shares))
    return Scores(means)


# Scores of one motion and its music: beats, counts, endings, physics and labels.


_CHANCE_ROUNDS = 100
_OF_KINEMATIC_BEATS = {"aligned_share": beat.aligned_share, "beat_ratio": beat.beat_ratio}


def beat_scores(motion: Motion, music_beats_s: Floats, rng: np.random.Generator) -> Scores:
    """Beat metrics of a motion against music beats (Q,). Beats after the end of the motion are left out.

    The detectors get positions at the rate of the motion, and resample them by splines. Rotations
    interpolated between frames would repeat each speed, and two equal speeds are no minimum for some
    detectors.

    Raises `ParameterError` if beats do not increase or the rig's joint names are unknown.
    """
    pos_m = body_pos_m(motion)
    music = np.asarray(music_beats_s, np.float64)
    music = music[music <= motion.duration_s]
    by_detector = beat.beats_by_detector(pos_m, motion.fps)
    motion_beats_s, kinematic_s = by_detector["ours"], by_detector["savitzky_golay"]
    values = beat.evaluate(motion_beats_s, music) | beat.evaluate_published(pos_m, motion.fps, music)
    values |= _by_detector(beat.detector_scores(by_detector, music))
    values |= {f"{name}_published": score(kinematic_s, music) for name, score in _OF_KINEMATIC_BEATS.items()}
    if len(motion_beats_s) == 0 or len(music) == 0:
        return Scores(values)
    duration_s, rounds = motion.duration_s, _CHANCE_ROUNDS
    chance = beat.evaluate_chance(motion_beats_s, music, duration_s=duration_s, rng=rng, rounds=rounds)
    for name in beat.ALIGNMENT_VARIANTS:
        score = partial(beat.alignment_score, variant=name)
        published_s = beat.published_motion_beats_s(pos_m, motion.fps, name)
        chance[f"alignment_{name}_published"] = beat.chance_level(
            score, published_s, music, duration_s=duration_s, rng=rng, rounds=rounds
        )
    chance |= _by_detector(
        beat.evaluate_detectors_chance(by_detector, music, duration_s=duration_s, rng=rng, rounds=rounds)
    )
    if len(kinematic_s):
        chance["aligned_share_published"] = beat.chance_level(
            beat.aligned_share, kinematic_s, music, duration_s=duration_s, rng=rng, rounds=rounds
        )
    return Scores(values, chance)


def second_opinion_scores(motion: Motion, danced: Counts, music_beats_s: Floats) -> Scores:
    """F-score of all detectors and the share of counts on beats, by the beats (Q,) of a second tracker."""
    music = np.asarray(music_beats_s, np.float64)
    music = music[music <= motion.duration_s]
    by_detector = beat.beats_by_detector(body_pos_m(motion), motion.fps)
    scores = {"f_score_mean_second": beat.detector_scores(by_detector, music)["f_score_mean"]}
    if len(danced) and len(music) > 1:
        scores["counts_within_second"] = counts.counts_within(danced.times_s, music)
    return Scores(scores)


def count_scores(danced: Counts, music: Counts, duration_s: float, rng: np.random.Generator) -> Scores:
    """The counts of a dance against the beats of the song, without scores that are not known."""
    if len(danced) == 0 or len(music) < 2:
        return Scores({})
    pair = (danced.times_s, danced.numbers, music.times_s, music.numbers)
    values = counts.evaluate(*pair)
    chance = counts.evaluate_chance(*pair, duration_s=duration_s, rng=rng, rounds=_CHANCE_ROUNDS)
    known = {name: value for name, value in values.items() if np.isfinite(value)}
    return Scores(known, {name: level for name, level in chance.items() if name in known})


def ending_scores(motion: Motion, music: Counts) -> Scores:
    """Speed at both ends, and the delay of the last pose after the song's last downbeat, or its last beat."""
    strong_s = music.downbeat_times_s if music.has_bars else music.times_s
    strong_s = strong_s[strong_s <= motion.duration_s]
    last_strong_s = float(strong_s[-1]) if len(strong_s) else None
    values = transitions.evaluate_ends(body_pos_m(motion), motion.fps, last_strong_s)
    return Scores({name: value for name, value in values.items() if np.isfinite(value)})


def front_scores(motion: Motion, *, front_known: bool) -> Scores:
    """Whether the dancer faces the audience: at +Z, or if that is not known in the direction faced most."""
    pos_m = body_pos_m(motion)
    front_rad = 0.0 if front_known else front.usual_front_rad(pos_m, motion.fps)
    return Scores(front.evaluate(pos_m, motion.fps, front_rad=front_rad), front.uniform_chance())


def energy_scores(
    motion: Motion, danced_s: tuple[float, float], section_bounds_s: Floats, loudness_db: Floats
) -> Scores:
    """Motion size against loudness (S,) over the sections. Empty for songs that cannot be measured."""
    given = (body_pos_m(motion), motion.fps, danced_s, section_bounds_s, loudness_db)
    values = energy_response.evaluate(*given)
    known = {name: value for name, value in values.items() if np.isfinite(value)}
    chance = energy_response.evaluate_chance(*given, rounds=_CHANCE_ROUNDS) if known else {}
    return Scores(known, {name: level for name, level in chance.items() if name in known})


def physical_scores(motion: Motion, boundary_times_s: Sequence[float] | Floats = ()) -> Scores:
    """Scores of feet, floor, jerk, jumps and bones, and of transitions if `boundary_times_s` are given."""
    # Jumps at the motion's own rate, since resampling it by slerp makes corners.
    jumps_per_minute = physical.jumps_per_minute(body_pos_m(motion), motion.fps)
    motion = motion.resampled(STORE_FPS)
    values = physical.evaluate(
        body_pos_m(motion), motion.fps, boundary_times_s, sole_pos_m=sole_pos_m(motion)
    )
    # Chance is joins at random instants.
    chance = {name: 1.0 for name in ("foot_slide_ratio_at_joins", "jerk_ratio_at_joins")}
    known = {name: level for name, level in chance.items() if np.isfinite(values[name])}
    return Scores(values | {"jumps_per_minute": jumps_per_minute}, known)


def seed_scores(body_m: Floats, of_song: Sequence[Floats]) -> Scores:
    """Mean joint distance of a dance (T, 21, 3) at 20 fps to the others of its song. Empty if there are none.

    Chance is the others rotated in time by half of their length.
    """
    others = [other_m for other_m in of_song if other_m is not body_m]
    if not others:
        return Scores({})
    rotated = [np.roll(other_m, len(other_m) // 2, axis=0) for other_m in others]
    values, chance = (
        float(np.mean([structure.joint_distance_m(body_m, other_m, NET_FPS) for other_m in given]))
        for given in (others, rotated)
    )
    return Scores({"seed_distance_m": values}, {"seed_distance_m": chance})


def dance_label_values(motion: Motion) -> Floats:
    """The four dance labels of each window of 4 s in their own units, (N, 4)."""
    return labels.dance_values(body_pos_m(motion), motion.fps, labels.window_starts_s(motion.duration_s))


def label_scores(scale: labels.LabelScale, dance_values: Floats, music_values: Floats) -> Scores:
    """Label distances over the windows that dance and music share. Empty if there are none."""
    n = min(len(dance_values), len(music_values))
    if n == 0:
        return Scores({})
    return split_chance(
        labels.evaluate(scale.dance_labels(dance_values[:n]), scale.music_labels(music_values[:n]))
    )


def _by_detector(scores: Mapping[str, float]) -> dict[str, float]:
    """The F-scores by detector, without that of ours, which is `f_score`."""
    return {name: score for name, score in scores.items() if name != "f_score_ours"}


def check_measurable(motion: Motion, name: str) -> None:
    """Raise `ParameterError` naming the dance if its rig has no body that can be measured."""
    try:
        body_pos_m(motion.sliced(0, 1))
    except ParameterError as error:
        raise ParameterError(f"{name}: {error}") from None


# Phases of motion beats within the count, compared with the expert dances of the genre.


@dataclass(frozen=True, eq=False)
class DancedPhases:
    """The phases of a dance's motion beats within the song's beats."""

    genre: str
    song: str
    phases: Floats  # (Q,) 0 … 1


def danced_phases(motion: Motion, music_beats_s: Floats, genre: str, song: str) -> DancedPhases:
    """Phases of the beats of a motion. `genre` and `song` are those of the song."""
    motion_beats_s = our_beats_s(body_pos_m(motion), motion.fps)
    return DancedPhases(genre, song, counts.phases(motion_beats_s, music_beats_s))


def phase_scores(dance: DancedPhases, experts: Sequence[DancedPhases], rng: np.random.Generator) -> Scores:
    """Distance of a dance's phases to the experts' of the same genre to other songs.

    Chance is as many uniformly random phases. Empty unless the genre has two such dances or more.
    """
    others = [e for e in experts if e.genre == dance.genre and e.song != dance.song and len(e.phases)]
    if len({e.song for e in others}) < 2 or len(dance.phases) == 0:
        return Scores({})
    scores = counts.evaluate_phases(dance.phases, [e.phases for e in others], [e.song for e in others], rng)
    values = {name: scores[name] for name in ("phase_distance", "phase_nearness")}
    return Scores(
        {name: value for name, value in values.items() if np.isfinite(value)},
        {"phase_distance": scores["phase_distance_chance"]},
    )


# Scores against real dances: FPD and FMD of single dances, FID and diversity of sets.


_HALVINGS = 5


class RealDances:
    """Real dances to compare with. A dance is never compared with those to its own song."""

    def __init__(self, motions: Sequence[Motion], songs: Sequence[str], *, like: Motion) -> None:
        """`like` has the rig of the dances to compare. Raises `ParameterError` if rigs do not match.

        Equal poses of bodies of other proportions or rest poses have other rotations, so all motions are
        retargeted to that rig first.
        """
        self.songs = tuple(songs)
        self._skeleton = like.skeleton
        self._roles = frechet.validate([*motions, like])
        self.poses = [self.poses_of(motion) for motion in motions]
        self._gaussians: dict[str, dict[str, frechet.Gaussian]] = {}

    def poses_of(self, motion: Motion) -> Floats:
        """A dance's poses (T', D) in radians, at the joints that all dances share."""
        if not motion.skeleton.same_as(self._skeleton):
            motion = retarget(motion, self._skeleton)
        return frechet.poses_rad(motion, self._roles)

    def scores(self, motion: Motion, song: str, rng: np.random.Generator) -> Scores:
        """FPD and FMD of a dance to the real dances to other songs. Empty if the dance is too short.

        Chance is a body frozen in a random pose of the dance.
        """
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
                {name: frechet.frechet_distance(gaussians[name], real[name]) for name in gaussians}
                for gaussians in (_gaussians([poses]), _gaussians([still]))
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

    corrected: fid.DanceFeatures
    published: fid.DanceFeatures
    poses: Floats | None  # (T', D) from `RealDances.poses_of`

    @classmethod
    def from_motion(cls, motion: Motion, real: RealDances | None) -> FeatureRows:
        """Features of each 20 s of a motion. `ParameterError` if the joint names of its rig are unknown."""
        return cls(
            fid.features_of([motion], variant="corrected"),
            fid.features_of([motion], variant="published"),
            None if real is None else real.poses_of(motion),
        )


def set_scores(dances: Sequence[FeatureRows], real: Sequence[FeatureRows]) -> dict[str, float]:
    """Pooled FPD and FMD of a set of dances by name, and FID and diversity if both sides have two pieces."""
    scores: dict[str, float] = {}
    for variant, suffix in (("corrected", ""), ("published", "_published")):
        ours, theirs = (_pooled([getattr(rows, variant) for rows in side]) for side in (dances, real))
        if min(len(ours.kinetic), len(theirs.kinetic)) < 2:
            continue
        values = fid.evaluate(ours, theirs)
        scores |= {f"{name}{suffix}": v for name, v in values.items() if not name.startswith("real_")}
    poses = [[rows.poses for rows in side if rows.poses is not None] for side in (dances, real)]
    if all(poses):
        one, other = (_gaussians(of_side) for of_side in poses)
        scores |= {f"{name}_all": frechet.frechet_distance(one[name], other[name]) for name in one}
    return scores


def real_set_scores(
    real: Sequence[FeatureRows], songs: Sequence[str], rng: np.random.Generator
) -> dict[str, float]:
    """`set_scores` of one half of the real dances against the other, averaged over random splits by song."""
    if len(set(songs)) < 2:
        return {}
    rounds = []
    for _ in range(_HALVINGS):
        one, other = frechet.halves(songs, rng)
        rounds.append(set_scores([real[i] for i in one], [real[i] for i in other]))
    return {name: float(np.mean([r[name] for r in rounds])) for name in rounds[0]}


def _pooled(parts: Sequence[fid.DanceFeatures]) -> fid.DanceFeatures:
    return fid.DanceFeatures(
        np.concatenate([part.kinetic for part in parts]),
        np.concatenate([part.geometric for part in parts]),
        parts[0].variant,
    )
