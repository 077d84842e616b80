"""Counts of takes and songs at a steady tempo."""

from __future__ import annotations

import numpy as np

from choreograph.core.counts import Counts, make_counts, numbers_in_bar


def counted(
    period_s: float, *, first_s: float = 0.0, metre: int = 4, first: int = 1, length_s: float = 30.0
) -> Counts:
    n_counts = int((length_s - first_s) / period_s) + 1
    numbers = numbers_in_bar(n_counts, metre, first=first) if metre else np.zeros(n_counts, int)
    return make_counts(first_s + period_s * np.arange(n_counts), numbers, metre)
