"""`make fuzz MINUTES=60`: sane files of every format, then damaged and hostile ones, for as long as wanted.

The minutes begin after the sane files. All jobs fuzz for that long, and each target gets its share. A target
that was not tried fails the run, as does an input that is neither read nor refused.

Inputs that fail are put into `corpus/TARGET/`, where the tests try them ever after.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from fuzz.harness import Tally, Target, accepted, fuzz, in_jobs, input_of, n_good
from fuzz.targets import all_targets

CORPUS = Path(__file__).with_name("corpus")


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=5.0, help="of fuzzing, in all jobs at once")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes; default: one for a core")
    parser.add_argument("--seed", type=int, default=None, help="inputs follow from it; default: the time")
    parser.add_argument("--targets", nargs="*", help="by name; default: all")
    given = parser.parse_args(arguments)
    seed = int(time.time()) if given.seed is None else given.seed
    with tempfile.TemporaryDirectory() as folder:
        targets = all_targets(Path(folder))
        if unknown := set(given.targets or ()).difference(target.name for target in targets):
            parser.error(f"expected names of targets, got {', '.join(sorted(unknown))}")
        targets = [target for target in targets if not given.targets or target.name in given.targets]
        untouched = in_jobs(
            lambda some: {t.name: accepted(t) for t in some}, targets, given.jobs, cost=n_good
        )
        tallies = in_jobs(
            lambda some: fuzz(some, seed=seed, seconds=60.0 * given.minutes), targets, given.jobs
        )
        _print(untouched, "untouched")
        _print(tallies, f"seed {seed}")
        for target in targets:
            _keep_failures(target, tallies[target.name], seed)
    untried = [name for name, tally in tallies.items() if not tally.tried]
    if untried:
        print(f"\nnot tried: {', '.join(untried)}", file=sys.stderr)
    return int(bool(untried) or any(t.failures for t in (*untouched.values(), *tallies.values())))


def _print(tallies: Mapping[str, Tally], inputs: str) -> None:
    columns = "target", "tried", "read", "failures", "slowest, CPU s (input)", "hungriest, MB (input)"
    print(f"\n{inputs}\n\n| {' | '.join(columns)} |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, tally in tallies.items():
        (slow_s, slow), (mb, hungry) = tally.slowest, tally.hungriest
        counted = f"{tally.tried:,} | {tally.was_read:,} | {len(tally.failures)}"
        print(f"| {name} | {counted} | {slow_s:.2f} ({slow}) | {mb:.0f} ({hungry}) |")
    for name, tally in tallies.items():
        for place, (number, what) in tally.failures.items():
            print(f"\n{name}, input {number}: {place}\n  {what.splitlines()[0]}")


def _keep_failures(target: Target, tally: Tally, seed: int) -> None:
    for number, _ in tally.failures.values():
        data = input_of(target, seed, number).data
        folder = CORPUS / target.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / hashlib.sha256(data).hexdigest()[:12]).write_bytes(data)


if __name__ == "__main__":
    sys.exit(main())
