"""What edits of a dance change, and whether chains of them are rendered to the same bytes from their plans.

    python research/edits.py [--edits 100] [--chains 100] [--length 20] [--seed 0] [--song SONG] [--db rep.h5]

Every edit is of a random kind, span and seed: a swap, a variation, a pinned take, a repetition or a mirrored
one, a held pose, a moved join, or a cut to a section of the song. For single edits of one dance, the script
prints the seconds that changed outside of the span and two beats on either side, the farthest border from
what was asked, in beats, the time of an edit, and foot slide and joint speed beside those of the dance. For
chains, it prints how many are rendered to the same bytes after they were saved and opened again, which is
also done in the middle of each chain. At last it prints the time of eight alternatives for four seconds.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.choreography.edits import EditRequest, edit_slots, slot_bounds_s
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.errors import NoPathError, ParameterError
from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.motion.body import body_pos_m
from choreograph.pipeline.editing import joins_s


@dataclass(frozen=True)
class Source:
    """What random edits are made of: the takes, and the bounds of the sections of the song (N + 1,), in s."""

    repertoire: cg.Repertoire
    sections_s: list[float]

    def edit(self, plan: cg.Plan, rng: np.random.Generator) -> tuple[EditRequest, tuple[float, float]]:
        """A random edit of a dance, with the span that it changes."""
        bounds_s = slot_bounds_s(plan)
        length_s = rng.uniform(1.0, 6.0)
        start_s = rng.uniform(0.0, plan.duration_s - length_s)
        end_s = start_s + length_s
        kind, joins = int(rng.integers(8)), joins_s(plan)
        if kind < 3:
            return (cg.Swap, cg.Vary, cg.Hold)[kind](start_s, end_s), (start_s, end_s)
        if kind == 3:
            takes = [take.name for take in self.repertoire.takes]
            return cg.TakePin(start_s, end_s, str(rng.choice(takes))), (start_s, end_s)
        if kind == 4 and joins:
            at_s, counts = float(rng.choice(joins)), int(rng.choice([-4, -3, -2, -1, 1, 2, 3, 4]))
            slot = int(np.clip(np.abs(bounds_s - at_s).argmin() + counts, 0, len(bounds_s) - 1))
            return cg.MoveJoin(at_s, counts), (min(at_s, bounds_s[slot]), max(at_s, bounds_s[slot]))
        if kind == 5:  # cut to the start of a section
            section = int(rng.integers(len(self.sections_s) - 1))
            from_s, to_s = self.sections_s[section : section + 2]
            part_s = from_s, min(to_s, from_s + length_s)
            return cg.Repeat(*part_s, start_s), _places_s(part_s, start_s, bounds_s)
        slots = edit_slots(start_s, end_s, bounds_s)
        at_s = float(bounds_s[int(rng.integers(0, len(bounds_s) - 1 - (slots.stop - slots.first)))])
        one = cg.Repeat(start_s, end_s, at_s, mirrored=kind == 7)
        return one, _places_s((start_s, end_s), at_s, bounds_s)


def _places_s(part_s: tuple[float, float], at_s: float, bounds_s: np.ndarray) -> tuple[float, float]:
    """Where a part is danced again, from one count to another."""
    slots = edit_slots(*part_s, bounds_s)
    first = int(np.abs(bounds_s - at_s).argmin())
    stop = min(first + slots.stop - slots.first, len(bounds_s) - 1)
    return float(bounds_s[first]), float(bounds_s[stop])


def edited(dance: cg.Dance, one: EditRequest, repertoire: cg.Repertoire, seed: int) -> cg.Dance | None:
    """The dance with an edit, or None if it is refused: a take is too short or too slow, for example."""
    try:
        return cg.edit(dance, [one], repertoire, seed=seed)
    except NoPathError:
        return None
    except ParameterError:  # it does not fit into the dance, or between the joins beside it
        if isinstance(one, cg.Repeat | cg.MoveJoin):
            return None
        raise


def is_same(a: cg.Motion, b: cg.Motion) -> bool:
    """Whether two motions have the same bytes."""
    pairs = (a.root_pos_m, b.root_pos_m), (a.local_quat, b.local_quat)
    return all(x.tobytes() == y.tobytes() for x, y in pairs)


def single_edits(dance: cg.Dance, source: Source, n: int, seed: int) -> None:
    """Print what `n` edits of one dance change."""
    rng, fps = np.random.default_rng(seed), dance.motion.fps
    beats_s = slot_bounds_s(dance.plan)
    beat_s = float(np.median(np.diff(beats_s)))
    outside_s, moved, seconds, slides, speeds, refused = [], [], [], [], [], 0
    kinds: Counter[str] = Counter()
    while len(outside_s) < n:
        one, (start_s, end_s) = source.edit(dance.plan, rng)
        began = time.process_time()
        made = edited(dance, one, source.repertoire, int(rng.integers(3)))
        if made is None:
            refused += 1
            continue
        seconds.append(time.process_time() - began)
        kinds[type(one).__name__] += 1
        planned = made.plan.edits
        changed = np.any(made.motion.local_quat != dance.motion.local_quat, axis=(1, 2))
        changed |= np.any(made.motion.root_pos_m != dance.motion.root_pos_m, axis=1)
        times_s = np.arange(len(changed)) / fps
        slots = edit_slots(start_s, end_s, beats_s, outwards=isinstance(one, cg.MoveJoin))
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
    print("  " + ", ".join(f"{name} {count}" for name, count in sorted(kinds.items())))
    print(f"  farthest border from what was asked: {max(moved):.2f} beats")
    print(f"  time of an edit: median {np.median(seconds):.2f} s, longest {max(seconds):.2f} s of CPU")
    slide_cm_s = foot_slide_cm_s(body_pos_m(dance.motion), fps)
    print(f"  foot slide: median {np.nanmedian(slides):.1f} cm/s, {slide_cm_s:.1f} in the dance")
    print(f"  fastest root: {max(speeds):.2f} m/s, {whole_m_s:.2f} in the dance")


def chains(dance: cg.Dance, source: Source, n: int, length: int, seed: int) -> None:
    """Print how many chains of edits are rendered to the same bytes from their files."""
    same, kinds = 0, Counter[str]()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "plan.json"
        for chain in range(n):
            rng = np.random.default_rng([seed, chain])
            made, done = dance, 0
            while done < length:
                one, _ = source.edit(made.plan, rng)
                after = edited(made, one, source.repertoire, int(rng.integers(3)))
                if after is None:
                    continue
                made, done = after, done + 1
                kinds[type(one).__name__] += 1
                if done == length // 2:  # saved and opened again
                    made.save(path)
                    plan = cg.Plan.read(path)
                    made = cg.Dance(cg.render(plan, source.repertoire), plan)
            made.save(path)
            same += is_same(cg.render(cg.Plan.read(path), source.repertoire), made.motion)
            print(
                f"chain {chain + 1}: {same} of {chain + 1} the same, {dict(sorted(kinds.items()))}",
                flush=True,
            )


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
    features, _ = analyse_song(session.song, repertoire, keep=True)
    source = Source(repertoire, features.sections.bounds_s.tolist())
    if args.edits:
        single_edits(dance, source, args.edits, args.seed)
        began = time.process_time()
        found = session.alternatives((12.0, 16.0))
        print(f"{len(found)} alternatives for 4 s: {time.process_time() - began:.2f} s of CPU")
        for one in found:
            print(f"  {one}")
    chains(dance, source, args.chains, args.length, args.seed)


if __name__ == "__main__":
    main()
