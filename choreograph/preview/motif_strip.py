"""Pose strips of a motif: start, middle and end of its medoid and of words from other takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.motifs.vocabulary import Vocabulary
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.pose import ground_pos_m, heading_rad
from choreograph.preview.strip import write_strip

WORDS_SHOWN = 4
_POSES = 3  # of a word
_FPS = 1.0  # of the row of poses: any rate will do


@dataclass(frozen=True, eq=False)
class ShownWord:
    """A motion word within its motion."""

    caption: str
    motion: Motion
    start_s: float  # in that motion
    end_s: float


def words_to_show(vocabulary: Vocabulary, motif: int, n_words: int = WORDS_SHOWN) -> NDArray[np.int64]:
    """The motif's medoid and random words of its cluster (fixed seed), (n,), n ≤ `n_words`.

    Each is from another take; there are fewer if fewer takes contain the motif.
    """
    words = np.random.default_rng(motif).permutation(vocabulary.words_of_motif(motif))
    words = np.concatenate([vocabulary.motifs.words[motif : motif + 1], words])
    _, first = np.unique(vocabulary.word_take[words], return_index=True)
    return words[np.sort(first)[:n_words]]


def write_motif_strip(
    path: str | Path, words: Sequence[ShownWord], *, tile: tuple[int, int] = (160, 220)
) -> None:
    """Write a PNG with one row per word: its first, middle and last pose, centred and facing the front.

    Raises as `preview.strip.write_strip`.
    """
    poses = [_poses(word) for word in words]
    row = Motion(
        poses[0].skeleton,
        np.concatenate([part.root_pos_m for part in poses]),
        np.concatenate([part.local_quat for part in poses]),
        _FPS,
    )
    captions = [text for word in words for text in (word.caption, f"{word.end_s - word.start_s:.2f} s", "")]
    write_strip(
        path, row, (np.arange(row.n_frames) / _FPS).tolist(), labels=captions, columns=_POSES, tile=tile
    )


def _poses(word: ShownWord) -> Motion:
    at_s = np.linspace(word.start_s, word.end_s, _POSES)
    poses = word.motion.sampled(np.minimum(at_s * word.motion.fps, word.motion.n_frames - 1))
    body = body_pos_m(poses)
    poses = poses.moved(shift_m=-ground_pos_m(body).mean(axis=0))
    return poses.moved(yaw_rad=-float(heading_rad(body[_POSES // 2])))
