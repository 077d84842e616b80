"""Counts annotated beside a take: `NAME.counts.csv` next to its motion."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from choreograph.count_files import SUFFIX, read_counts
from choreograph.counts import ANNOTATED, Counts
from choreograph.errors import FormatError
from choreograph.takes import Take

_BEYOND_S = 0.1  # a last count may be noted a little after the last frame


def with_counts_beside(take: Take) -> Take:
    """The take with the counts in NAME.counts.csv beside its motion, if there is such a file.

    They replace a data set's, not what a manifest names. `FormatError` if the file is damaged.
    """
    if take.counts.source == ANNOTATED or not take.source_paths:
        return take
    beside = take.source_paths[0].with_suffix(SUFFIX)
    return with_counts_of(take, beside) if os.path.exists(beside) else take


def with_counts_of(take: Take, path: Path) -> Take:
    """The take with the counts and figures of a file; `FormatError` if it is damaged or of another take."""
    counts, figures = read_counts(path)
    check_within(take, counts, str(path))
    return replace(take, counts=counts, figures=figures, source_paths=(*take.source_paths, path))


def check_within(take: Take, counts: Counts, where: str) -> None:
    """`FormatError` if a count lies outside the take."""
    if counts.times_s[0] < 0 or counts.times_s[-1] > take.motion.duration_s + _BEYOND_S:
        raise FormatError(
            f"{where}: expected counts within the {take.motion.duration_s:.2f} s of {take.name}, got "
            f"{counts.times_s[0]:.2f} to {counts.times_s[-1]:.2f} s: seconds from the take's first frame, "
            "not of the song"
        )
