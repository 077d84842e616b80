"""The counts of a dance as a network reads them from its motion alone.

Of a dance made of takes the counts are known (`danced_counts`); of one that a network generated they are not.
The reader hears no music, so that it cannot hear the beats it is held against; but where it errs in the
experts' own dances, it errs here, too: read a dance's share beside that of real ones.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from choreograph.building.counting import MotionReader, motion_reader
from choreograph.counts import NO_COUNTS, Counts
from choreograph.evaluation.motion_scores import count_scores
from choreograph.evaluation.scores import Scores
from choreograph.evaluation.song_music import SongMusic
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.pretrained.library import pretrained_set
from choreograph.timebase import NET_FPS

_NAMES = {"counts_within": "counts_read_within", "downbeat_share": "downbeat_share_read"}
_SHORTEST_S = 4.0  # of a motion with counts to be read


def read_counts(motion: Motion) -> Counts:
    """Counts of a motion by the shipped network that knows most dances; none below 4 s."""
    if motion.duration_s < _SHORTEST_S:
        return NO_COUNTS
    return _reader()(body_pos_m(motion.resampled(NET_FPS)))


def read_count_scores(motion: Motion, music: SongMusic, rng: np.random.Generator) -> Scores:
    """The counts read from a motion against the song's beats, at the level that the motion counts at."""
    read = read_counts(motion)
    scores = count_scores(read, music.counted_as(read), music.duration_s, rng)
    return Scores(
        {new: scores.values[name] for name, new in _NAMES.items() if name in scores.values},
        {new: scores.chance[name] for name, new in _NAMES.items() if name in scores.chance},
    )


@cache
def _reader() -> MotionReader:
    read = motion_reader(pretrained_set("research"))
    assert read is not None, "the set 'research' has a network that counts motion"
    return read
