"""What stands beside a number so that it can be read: halves of the real data, and chance.

A distance between sets of dances says little alone. The floor is what two halves of the real dances, cut
by song, are from each other; the ceiling is what a body that stands still, or whose joints or instants
are exchanged, is from real ones. Motions in, motions out; `rng` settles every choice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion

Indices = NDArray[np.int64]


def halves(groups: Sequence[str], rng: np.random.Generator) -> tuple[Indices, Indices]:
    """Two halves (N,), (N',) of the items 0 … len(groups) - 1, no group (song, dancer) in both.

    Groups are drawn in random order, each into the half that has fewer items so far. Raises
    `ParameterError` if there are fewer than two groups.
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
    """One frame of the motion, held for as long as it lasts."""
    return motion.sampled(np.full(motion.n_frames, float(rng.integers(motion.n_frames))))


def shuffled_joints(motion: Motion, rng: np.random.Generator) -> Motion:
    """The rotations of all joints but the root exchanged among them, one exchange for all frames."""
    order = np.concatenate([[0], 1 + rng.permutation(motion.skeleton.n_joints - 1)])
    return replace(motion, local_quat=motion.local_quat[:, order])


def shuffled_frames(motion: Motion, rng: np.random.Generator) -> Motion:
    """The poses in random order; the root's path stays as it was. Sets of poses do not notice, at this rate:
    resample before, not after."""
    quat = motion.local_quat[rng.permutation(motion.n_frames)]
    return replace(motion, local_quat=rot.make_continuous(quat))


CHANCE: Mapping[str, Callable[[Motion, np.random.Generator], Motion]] = {
    "still": still,
    "joints shuffled": shuffled_joints,
    "frames shuffled": shuffled_frames,
}
