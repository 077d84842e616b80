"""The counts of the takes of a repertoire: those of its file, and estimates where it has none."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import FROM_MOTION, NO_COUNTS, Counts
from choreograph.library.checks import check_counts, check_parts
from choreograph.library.shards import AnyFile
from choreograph.music.metrical_level import tempo_bpm

if TYPE_CHECKING:
    from choreograph.library.building.counting import MotionCounter


@dataclass(frozen=True, eq=False)
class TakeTempi:
    """What most decisions read of the counts of all takes."""

    metre: NDArray[np.int64]  # (takes,) 0 where bars are not known
    bpm: NDArray[np.float64]  # (takes,) the median tempo, 0 for fewer than two counts
    n_counts: NDArray[np.int64]  # (takes,)
    counted_s: NDArray[np.float64]  # (takes,) from the first count to the last
    is_estimated: NDArray[np.bool_]  # (takes,) from the motion

    def of(self, takes: NDArray[Any]) -> TakeTempi:
        """The same of some takes, by their numbers or a mask."""
        return TakeTempi(*(getattr(self, field.name)[takes] for field in fields(self)))


class TakeCounts:
    """The counts of the takes of a file, of these names.

    Where the file has none, they are estimated from the motion by the network of the set that the file was
    built with, if they are more likely right than wrong. Those of takes that the build `refused` are not.

    Raises `RepertoireError`, without the name of the file, if counts are not in order.
    """

    def __init__(self, file: AnyFile, names: Sequence[str], refused: Collection[str]) -> None:
        self._file, self._names, self._refused = file, names, refused
        self._start, self._stop = file.read("takes/count_start"), file.read("takes/count_stop")
        check_parts("count", self._start, self._stop, file.shapes["counts/time_s"][0], shortest=0)
        self._metres, self._sources = file.read("takes/metre"), file.read("takes/counts_source")
        self._confidence = file.read("takes/counts_confidence")
        self._times_s, self._numbers = file.read("counts/time_s"), file.read("counts/number")
        self._uncertainty = np.zeros(0)
        if "uncertainty" in file.parts:
            self._uncertainty = file.read("counts/doubt").astype(np.float64)
        self._made: dict[int, Counts] = {}

    def of_take(self, take: int) -> Counts:
        """The counts of a take, or `NO_COUNTS`."""
        if take not in self._made:
            self._made[take] = self._counts(take)
        return self._made[take]

    def _counts(self, take: int) -> Counts:
        own = slice(self._start[take], self._stop[take])
        if own.start == own.stop:
            return self._estimated(take)
        source, confidence = str(self._sources[take]), float(self._confidence[take])
        times_s, numbers, metre = self._times_s[own], self._numbers[own], int(self._metres[take])
        check_counts(self._names[take], times_s, numbers, metre)
        return Counts(times_s, numbers, metre, source, confidence, self._uncertainty[own])

    @cached_property
    def tempi(self) -> TakeTempi:
        """What most decisions read of the counts of all takes."""
        n_counts = self._stop - self._start
        counted_s = np.zeros(len(n_counts))
        counted = n_counts > 0
        ends_s = self._times_s[np.stack([self._start, self._stop - 1])[:, counted]]
        counted_s[counted] = ends_s[1] - ends_s[0]
        bpm, is_estimated = self._file.read("takes/tempo_bpm"), self._sources == FROM_MOTION
        metre = self._metres.copy()
        refused = [name in self._refused for name in self._names]
        missing = np.flatnonzero(~counted & ~np.array(refused, bool))
        if len(missing) and self._count_motion is not None:
            for take in missing.tolist():
                counts = self.of_take(take)
                metre[take], n_counts[take] = counts.metre, len(counts)
                bpm[take] = tempo_bpm(counts) if len(counts) > 1 else 0.0
                counted_s[take] = np.ptp(counts.times_s) if len(counts) else 0.0
                is_estimated[take] = counts.source == FROM_MOTION
        return TakeTempi(metre, bpm, n_counts, counted_s, is_estimated)

    def _estimated(self, take: int) -> Counts:
        """The counts of a take that a network estimates from its motion, or none if they are likely wrong."""
        from choreograph.library.building.counting import are_likely_right

        if self._count_motion is None or self._names[take] in self._refused:
            return NO_COUNTS
        rows = (self._file.read(f"takes/body_{end}", slice(take, take + 1))[0] for end in ("start", "stop"))
        counts = self._count_motion(self._file.read_rows("body/pos_m", *rows))
        return counts if are_likely_right(counts) else NO_COUNTS

    @cached_property
    def _count_motion(self) -> MotionCounter | None:
        from choreograph.library.building.counting import load_motion_counter
        from choreograph.library.builtin import CHOICES, pretrained_set

        networks = self._file.provenance.get("pretrained")
        return load_motion_counter(pretrained_set(networks)) if networks in CHOICES else None
