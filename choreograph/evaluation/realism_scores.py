"""Scores against real dances: FPD and FMD of single dances, FID and diversity of sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.evaluation.scores import Scores
from choreograph.metrics import fid, frechet, references
from choreograph.motion.motion import Motion
from choreograph.motion.retargeting import retarget

Floats = NDArray[np.float64]

_HALVINGS = 5


class RealDances:
    """Real dances to compare with. Each belongs to a song; a dance is never compared with its own song's."""

    def __init__(self, motions: Sequence[Motion], songs: Sequence[str], *, like: Motion) -> None:
        """`like` has the rig of the dances to compare. Raises `ParameterError` if rigs do not match.

        Rotations on bodies of other proportions, or of other rest poses, differ where poses do not: all
        motions are brought to that rig first.
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
        """FPD and FMD of a dance to the real dances to other songs; empty if the dance is too short.

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
        """Features of each 20 s of a motion; `ParameterError` if its rig's joint names are unknown."""
        return cls(
            fid.features_of([motion], variant="corrected"),
            fid.features_of([motion], variant="published"),
            None if real is None else real.poses_of(motion),
        )


def set_scores(dances: Sequence[FeatureRows], real: Sequence[FeatureRows]) -> dict[str, float]:
    """FID and diversity of a set of dances by name, if both sides have two pieces; pooled FPD and FMD."""
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
        one, other = references.halves(songs, rng)
        rounds.append(set_scores([real[i] for i in one], [real[i] for i in other]))
    return {name: float(np.mean([r[name] for r in rounds])) for name in rounds[0]}


def _pooled(parts: Sequence[fid.DanceFeatures]) -> fid.DanceFeatures:
    return fid.DanceFeatures(
        np.concatenate([part.kinetic for part in parts]),
        np.concatenate([part.geometric for part in parts]),
        parts[0].variant,
    )
