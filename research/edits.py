"""What edits of a dance change, and whether chains of them are rendered to the same bytes from their plans.

    python research/edits.py [--edits 100] [--chains 100] [--length 20] [--seed 0] [--song SONG] [--db rep.h5]

Every edit is of a random kind, span and seed: a swap, a variation, a pinned take, a repetition or a mirrored
one. For single edits of one dance, the script prints the seconds that changed outside of the span and two
beats on either side, the farthest border from what was asked, in beats, the time of an edit, and foot slide
and joint speed beside those of the dance. For chains, it prints how many are rendered to the same bytes after
they were saved and opened again, which is also done in the middle of each chain. At last it prints the time
of eight alternatives for four seconds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.choreography.edits import edit_slots, slot_bounds_s
from choreograph.core.errors import NoPathError
from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.motion.body import body_pos_m


def random_edits(plan: cg.Plan, takes: list[str], rng: np.random.Generator) -> Iterator[tuple[object, tuple]]:
    """Edits at random times, each with the span that it changes."""
    bounds_s = slot_bounds_s(plan)
    while True:
        length_s = rng.uniform(1.0, 6.0)
        start_s = rng.uniform(0.0, plan.duration_s - length_s)
        end_s = start_s + length_s
        kind = int(rng.integers(5))
        if kind == 0:
            yield cg.Swap(start_s, end_s), (start_s, end_s)
        elif kind == 1:
            yield cg.Vary(start_s, end_s), (start_s, end_s)
        elif kind == 2:
            yield cg.TakePin(start_s, end_s, str(rng.choice(takes))), (start_s, end_s)
        else:
            slots = edit_slots(start_s, end_s, bounds_s)
            first = int(rng.integers(0, len(bounds_s) - 1 - (slots.stop - slots.first)))
            at_s = float(bounds_s[first])
            until_s = float(bounds_s[first + slots.stop - slots.first])
            yield cg.Repeat(start_s, end_s, at_s, mirrored=kind == 4), (at_s, until_s)


def edited(dance: cg.Dance, one: object, repertoire: cg.Repertoire, seed: int) -> cg.Dance | None:
    """The dance with an edit, or None if the take that was asked for is too short or too slow."""
    try:
        return cg.edit(dance, [one], repertoire, seed=seed)
    except NoPathError:
        return None


def is_same(a: cg.Motion, b: cg.Motion) -> bool:
    """Whether two motions have the same bytes."""
    pairs = (a.root_pos_m, b.root_pos_m), (a.local_quat, b.local_quat)
    return all(x.tobytes() == y.tobytes() for x, y in pairs)


def single_edits(dance: cg.Dance, repertoire: cg.Repertoire, n: int, seed: int) -> None:
    """Print what `n` edits of one dance change."""
    rng, fps = np.random.default_rng(seed), dance.motion.fps
    takes = [take.name for take in repertoire.takes]
    beats_s = slot_bounds_s(dance.plan)
    beat_s = float(np.median(np.diff(beats_s)))
    outside_s, moved, seconds, slides, speeds, refused = [], [], [], [], [], 0
    source = random_edits(dance.plan, takes, rng)
    while len(outside_s) < n:
        one, (start_s, end_s) = next(source)
        began = time.process_time()
        made = edited(dance, one, repertoire, int(rng.integers(3)))
        if made is None:
            refused += 1
            continue
        seconds.append(time.process_time() - began)
        planned = made.plan.edits
        changed = np.any(made.motion.local_quat != dance.motion.local_quat, axis=(1, 2))
        changed |= np.any(made.motion.root_pos_m != dance.motion.root_pos_m, axis=1)
        times_s = np.arange(len(changed)) / fps
        slots = edit_slots(start_s, end_s, beats_s)
        span_s = beats_s[slots.first], beats_s[slots.stop]
        allowed = (times_s >= span_s[0] - 2 * beat_s - 1 / fps) & (
            times_s <= span_s[1] + 2 * beat_s + 1 / fps
        )
        outside_s.append(float((changed & ~allowed).sum() / fps))
        moved.append(max(abs(span_s[0] - start_s), abs(span_s[1] - end_s)) / beat_s)
        part = slice(round(planned[0].start_s * fps), round(planned[-1].end_s * fps))
        slides.append(foot_slide_cm_s(body_pos_m(made.motion)[part], fps))
        speeds.append(np.linalg.norm(np.diff(made.motion.root_pos_m[part], axis=0), axis=1).max() * fps)
    whole_m_s = np.linalg.norm(np.diff(dance.motion.root_pos_m, axis=0), axis=1).max() * fps
    print(f"{n} edits ({refused} refused): {sum(outside_s):.3f} s changed outside of span and two beats")
    print(f"  farthest border from what was asked: {max(moved):.2f} beats")
    print(f"  time of an edit: median {np.median(seconds):.2f} s, longest {max(seconds):.2f} s of CPU")
    slide_cm_s = foot_slide_cm_s(body_pos_m(dance.motion), fps)
    print(f"  foot slide: median {np.nanmedian(slides):.1f} cm/s, {slide_cm_s:.1f} in the dance")
    print(f"  fastest root: {max(speeds):.2f} m/s, {whole_m_s:.2f} in the dance")


def chains(dance: cg.Dance, repertoire: cg.Repertoire, n: int, length: int, seed: int) -> None:
    """Print how many chains of edits are rendered to the same bytes from their files."""
    takes, same = [take.name for take in repertoire.takes], 0
    with TemporaryDirectory() as folder:
        path = Path(folder) / "plan.json"
        for chain in range(n):
            rng = np.random.default_rng([seed, chain])
            made, source = dance, random_edits(dance.plan, takes, rng)
            done = 0
            while done < length:
                after = edited(made, next(source)[0], repertoire, int(rng.integers(3)))
                if after is None:
                    continue
                made, done = after, done + 1
                if done == length // 2:  # saved and opened again
                    made.save(path)
                    plan = cg.Plan.read(path)
                    made = cg.Dance(cg.render(plan, repertoire), plan)
            made.save(path)
            same += is_same(cg.render(cg.Plan.read(path), repertoire), made.motion)
            print(f"chain {chain + 1}: {same} of {chain + 1} the same", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--edits", type=int, default=100)
    parser.add_argument("--chains", type=int, default=100)
    parser.add_argument("--length", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--song", default=cg.example_songs()["house"])
    parser.add_argument("--db", default=None)
    args = parser.parse_args()
    repertoire = cg.starter_repertoire() if args.db is None else cg.Repertoire.open(args.db)
    session = cg.Session(args.song, repertoire)
    dance = session.dance()
    if args.edits:
        single_edits(dance, repertoire, args.edits, args.seed)
        began = time.process_time()
        found = session.alternatives((12.0, 16.0))
        print(f"{len(found)} alternatives for 4 s: {time.process_time() - began:.2f} s of CPU")
        for one in found:
            print(f"  {one}")
    chains(dance, repertoire, args.chains, args.length, args.seed)


if __name__ == "__main__":
    main()
