"""Checksums of what networks learn from."""

from dataclasses import replace

import numpy as np

from choreograph.core.counts import ANNOTATED, make_counts
from choreograph.library.building.networks import checksum_of
from content.motion_counting import CountedMotion

COUNTS = make_counts(np.arange(4.0), np.arange(1, 5), 4, source=ANNOTATED)
TAKE = CountedMotion("a", "waltz", np.zeros((80, 21, 3)), COUNTS)


def test_takes_have_the_same_checksum_only_if_their_content_is_the_same():
    moved = TAKE.body_pos_m.copy()
    moved[79, 20, 2] = 1e-9
    later = make_counts(np.arange(4.0) + 1e-9, np.arange(1, 5), 4, source=ANNOTATED)
    others = [
        replace(TAKE, name="b"),
        replace(TAKE, is_built_in=True),
        replace(TAKE, body_pos_m=moved),
        replace(TAKE, body_pos_m=TAKE.body_pos_m.astype(np.float32)),
        replace(TAKE, body_pos_m=TAKE.body_pos_m[:40]),
        replace(TAKE, counts=later),
    ]
    checksums = [checksum_of(takes) for takes in ([TAKE], [], [TAKE, TAKE], *([other] for other in others))]
    assert len(set(checksums)) == len(checksums)
    assert checksum_of([replace(TAKE, body_pos_m=TAKE.body_pos_m.copy())]) == checksums[0]
