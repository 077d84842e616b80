"""References for a distance: halves of the real data as the floor, chance dances as the ceiling.

A distance between sets of dances means little alone. The floor is the distance between two halves of the real
dances, split by song. The ceiling is the distance of a body that stands still, or whose joints or frames are
shuffled, from the real dances. Functions take and return motions. `rng` decides all random choices.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Indices
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion


def halves(groups: Sequence[str], rng: np.random.Generator) -> tuple[Indices, Indices]:
    """Split items 0 … len(groups) - 1 into halves (N,), (N',) so that no group (song, dancer) is in both.

    Groups are drawn in random order and go to the half that has fewer items so far. Raises `ParameterError`
    if there are fewer than two groups.

    Examples
    --------
    >>> songs = ["a", "a", "b", "b"]
    >>> one, other = cg.metrics.references.halves(songs, np.random.default_rng(0))
    >>> {songs[i] for i in one} & {songs[i] for i in other}
    set()
    """
    names = np.asarray(groups)
    different = np.unique(names)
    if len(different) < 2:
        raise ParameterError(f"expected items of at least 2 groups to halve, got {len(different)}")
    parts: tuple[list[int], list[int]] = ([], [])
    for group in rng.permutation(different):
        min(parts, key=len).extend(np.flatnonzero(names == group).tolist())
    return np.sort(np.array(parts[0])), np.sort(np.array(parts[1]))


def still(motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion frozen in one random frame.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> held = cg.metrics.references.still(motion, np.random.default_rng(0))
    >>> held.n_frames == motion.n_frames, np.ptp(held.root_pos_m, axis=0)
    (True, array([0., 0., 0.]))
    """
    return motion.sampled(np.full(motion.n_frames, float(rng.integers(motion.n_frames))))


def shuffled_joints(motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion with the rotations of all joints but the root permuted, in the same way in all frames.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> shuffled = cg.metrics.references.shuffled_joints(motion, np.random.default_rng(0))
    >>> bool(np.allclose(shuffled.local_quat[:, 0], motion.local_quat[:, 0]))
    True
    """
    order = np.concatenate([[0], 1 + rng.permutation(motion.skeleton.n_joints - 1)])
    return replace(motion, local_quat=motion.local_quat[:, order])


def shuffled_frames(motion: Motion, rng: np.random.Generator) -> Motion:
    """The motion with its poses in random order and its root path unchanged.

    The set of poses stays the same at this rate only: resample before shuffling, not after.

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 4.0)  # 4 s of a built-in take
    >>> shuffled = cg.metrics.references.shuffled_frames(motion, np.random.default_rng(0))
    >>> bool(np.allclose(shuffled.root_pos_m, motion.root_pos_m))
    True
    """
    quat = motion.local_quat[rng.permutation(motion.n_frames)]
    return replace(motion, local_quat=rot.make_continuous(quat))


CHANCE: Mapping[str, Callable[[Motion, np.random.Generator], Motion]] = {
    "still": still,
    "joints shuffled": shuffled_joints,
    "frames shuffled": shuffled_frames,
}
