"""Is a dance smaller where its song is softer? Loudness of sections against the size of the motion in them.

    python research/section_energy.py [--repertoires REP...] [--weights 2 0] [--seeds 3] \\
        [--data path/to/dance-with-melody --songs NAMES.txt]

Without `--data`, songs of every genre are rendered here with their true sections, in their own form, and with
the middle third played by the instruments of a break, 12 dB softer. With `--data`, the songs are those of
NAMES.txt with estimated sections, and the real takes to them are measured as well. Several repertoires
replace the seeds. There is a row for every weight of the energy cost, for the dances of the first weight
rotated in time (chance), and for the real takes.

Columns are the correlation of loudness and motion over the sections of all songs, centred by song, for joint
speed relative to the pelvis and for the volume of the convex hull of the body, the motion in the softest
section divided by that in the loudest, and other scores that should not change. ± is the spread over seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.core.numerics import Floats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics import counts, energy_response
from choreograph.evaluation.plan_scores import (
    danced_counts,
    plan_scores,
    transition_scores,
    transition_times_s,
)
from choreograph.evaluation.scores import physical_scores
from choreograph.evaluation.songs import find_songs, song_music
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.music.song import Song, load_song
from content.songs.known_songs import FIRST_SOFTENED_SEED as FIRST_SEED
from content.songs.known_songs import softened_song
from content.songs.synthesis.song import STYLES, SyntheticSong, render_song, write_song

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
DURATION_S = 60.0
CHANCE_ROUNDS = 20
Row = dict[str, float]
Sizes = tuple[Floats, Floats]  # speed and space of every section, (S,) each


@dataclass(frozen=True, eq=False)
class SectionedSong:
    """A song with its sections and beats, and the real dance to it where there is one."""

    name: str
    group: str
    song: Song
    bounds_s: Floats  # (S + 1,)
    beats: Counts
    genre: str
    take: Motion | None = None

    @property
    def loudness_db(self) -> Floats:
        return energy_response.section_loudness_db(self.song.samples, SAMPLE_RATE_HZ, self.bounds_s)


@dataclass(frozen=True, eq=False)
class SectionedDance:
    """Motion size in the sections of a song, by chance too, and other scores of the dance."""

    song: SectionedSong
    sizes: Sizes
    chance: tuple[Sizes, ...]
    other: Row


def rendered_songs(first_seed: int, genres: Sequence[str]) -> Iterator[SectionedSong]:
    """Songs by their own form and softened ones. A genre has the same seed whichever others take part."""
    for index, genre in enumerate(STYLES):
        if genre in genres:
            seed = first_seed + 2 * index
            yield with_truth("own form", render_song(genre, duration_s=DURATION_S, seed=seed))
            yield with_truth("softened", softened_song(genre, duration_s=DURATION_S, seed=seed + 1))


def with_truth(group: str, made: SyntheticSong) -> SectionedSong:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{made.genre}-{made.seed}.wav"
        write_song(path, made)
        song = load_song(path)
    times_s = made.beat_times_s
    bounds_s = made.bar_times_s[[*(section.first_bar for section in made.sections), made.n_bars]]
    beats = Counts(times_s, numbers_in_bar(len(times_s), made.beats_per_bar), made.beats_per_bar)
    return SectionedSong(song.name, group, song, bounds_s, beats, made.genre)


def real_songs(folder: Path, names: Sequence[str]) -> Iterator[SectionedSong]:
    for found in find_songs(folder, only=names):
        song = found.load()
        music = song_music(song, "tempo-path")
        take = None if found.take is None else found.take.motion
        bounds_s, beats = music.sections.bounds_s, music.levels[0]
        yield SectionedSong(found.name, "real", song, bounds_s, beats, found.genre, take)


def sectioned(
    song: SectionedSong, motion: Motion, danced_s: tuple[float, float], other: Row
) -> SectionedDance:
    frames = energy_response.motion_size(body_pos_m(motion), motion.fps)
    turns = (np.arange(CHANCE_ROUNDS) + 1) / (CHANCE_ROUNDS + 1)
    turned = [energy_response.turned_round(frames, danced_s, turn) for turn in turns]
    sizes, *chance = (
        tuple(energy_response.section_means(values, song.bounds_s, danced_s) for values in pair)
        for pair in (frames, *turned)
    )
    return SectionedDance(song, sizes, tuple(chance), other)


def danced(song: SectionedSong, repertoire: cg.Repertoire, config: cg.DanceConfig) -> SectionedDance:
    """The dance of a repertoire to a song."""
    made = cg.dance(song.song, repertoire, config=config)
    plan, placed = made.plan, danced_counts(made.plan, repertoire)
    beats = song.beats
    pair = (placed.times_s, placed.numbers, beats.times_s, beats.numbers)
    other = {"counts": counts.counts_within(*pair[::2]), "downbeats": counts.downbeat_share(*pair)}
    of_plan = {**plan_scores(plan, repertoire, song.genre).values}
    of_plan |= transition_scores(plan, repertoire, beats).values
    of_plan |= physical_scores(made.motion, transition_times_s(plan)).values
    for name in ("own_genre", "transitions_at_borders", "transitions_per_minute", "jerk_ratio_at_boundaries"):
        other[name] = of_plan.get(name, np.nan)
    return sectioned(song, made.motion, (plan.opening_s, plan.danced_until_s), other)


def row_of(dances: Sequence[SectionedDance], sizes: Sequence[Sizes]) -> Row:
    """Scores over the songs of one seed, with `sizes` in place of those of the dances."""
    row: Row = {}
    for index, name in enumerate(("speed", "space")):
        pairs = [(d.song.loudness_db, s[index]) for d, s in zip(dances, sizes, strict=True)]
        row[f"response {name}"] = energy_response.pooled_response(pairs)
        ratios = [energy_response.soft_to_loud(*pair) for pair in pairs]
        row[f"soft/loud {name}"] = float(np.nanmean(ratios)) if np.isfinite(ratios).any() else np.nan
    return row


def rows_of(seeds: Sequence[Sequence[SectionedDance]]) -> list[Row]:
    """A row a seed."""
    rows = []
    for dances in seeds:
        other = {name: float(np.nanmean([d.other[name] for d in dances])) for name in dances[0].other}
        rows.append(row_of(dances, [d.sizes for d in dances]) | other)
    return rows


def chance_rows(seeds: Sequence[Sequence[SectionedDance]]) -> list[Row]:
    """A row a seed, mean over rounds."""
    rows = []
    for dances in seeds:
        rounds = [row_of(dances, [d.chance[i] for d in dances]) for i in range(CHANCE_ROUNDS)]
        rows.append({name: float(np.mean([row[name] for row in rounds])) for name in rounds[0]})
    return rows


def show(name: str, rows: Sequence[Row]) -> None:
    """Mean ± spread of every column over the seeds."""
    cells = []
    for key in rows[0]:
        values = [row[key] for row in rows]
        cells.append(f"{key} {np.mean(values):.2f}" + (f" ± {np.std(values):.2f}" if len(rows) > 1 else ""))
    print(f"{name}: " + ", ".join(cells), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repertoires", type=Path, nargs="+", help="default: the built-in one")
    parser.add_argument("--weights", type=float, nargs="+", default=[2.0, 0.0], help="of the energy cost")
    parser.add_argument("--seeds", type=int, default=3, help="of one repertoire. Several have one each")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="of the rendered songs")
    parser.add_argument("--genres", nargs="+", default=list(STYLES), help="of the rendered songs")
    parser.add_argument("--data", type=Path, help="dance-with-melody")
    parser.add_argument("--songs", type=Path, default=HELD_OUT)
    given = parser.parse_args()
    if given.repertoires is None or len(given.repertoires) == 1:
        only = cg.Repertoire.open(given.repertoires[0]) if given.repertoires else cg.starter_repertoire()
        repertoires = [only] * given.seeds
    else:
        repertoires = [cg.Repertoire.open(path) for path in given.repertoires]
    if given.data:
        songs = list(real_songs(given.data, given.songs.read_text(encoding="utf-8").split()))
    else:
        songs = list(rendered_songs(given.first_seed, given.genres))
    for group in dict.fromkeys(song.group for song in songs):
        of_group = [song for song in songs if song.group == group]
        print(f"{group}: {len(of_group)} songs, {len(repertoires)} seeds", flush=True)
        for weight in given.weights:
            seeds = [
                [danced(song, rep, cg.DanceConfig(seed=s, weights={"energy": weight})) for song in of_group]
                for s, rep in enumerate(repertoires)
            ]
            show(f"  energy {weight:g}", rows_of(seeds))
            if weight == given.weights[0]:
                show("  chance", chance_rows(seeds))
        takes = [(song, song.take) for song in of_group if song.take is not None]
        if takes:
            real = [sectioned(song, take, (0.0, take.duration_s), {}) for song, take in takes]
            show("  real takes", rows_of([real]))
            show("  real takes, chance", chance_rows([real]))


if __name__ == "__main__":
    main()
