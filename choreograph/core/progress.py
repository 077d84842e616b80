"""How stages report what they are doing."""

from __future__ import annotations

from collections.abc import Callable

# Called with the stage's name, how much is done, and of how much; 0 for a total that is not known.
ProgressReport = Callable[[str, int, int], None]
StepReport = Callable[[int, int], None]  # the same of one stage


def substage(report: ProgressReport | None, stage: str) -> StepReport | None:
    """A report of how much of one stage is done; None for none."""
    return None if report is None else lambda done, total: report(stage, done, total)


def part(report: StepReport | None, start: int, stop: int, total: int) -> StepReport | None:
    """A report of a part of a stage, which takes it from `start` to `stop` of `total`; None for none."""
    if report is None:
        return None
    return lambda done, steps: report(start + (stop - start) * done // steps, total)
