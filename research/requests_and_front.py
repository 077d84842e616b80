"""Are requests danced, to the front, without frozen ends and sliding feet? A table of five seeds.

    python research/requests_and_front.py [--seeds 5] [--duration 40] [--only NAME ...] \\
        [--engine mixer] [--stage 4x3] [--weights JSON]
    python research/requests_and_front.py --repertoire REP --data path/to/dance-with-melody

The first form dances with the built-in takes to six songs: the three that are shipped, and three synthetic
songs whose seeds none of the built-in takes has. The second form dances with the takes of REP, built with
`--leave-out @research/dance_with_melody_held_out.txt`, to those songs, and measures the takes to them as
recorded, too. Every row is a mean over the seeds, and every number is of a metric of `cg.metrics`. Beats and
bars are those of the dance itself. The last table asks for each genre of the repertoire, to songs in its own
metre and in another one.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.core.errors import ChoreographError
from choreograph.evaluation.metrics import counts, front, physical, structure, transitions
from choreograph.evaluation.plan_scores import danced_counts, tempo_scores, transition_times_s
from choreograph.formats.dance_with_melody import read
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from content.songs.synthesis.song import render_song, write_song

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
UNSEEN = ("hip-hop", "disco", "salsa")  # genres of the synthetic songs
SEED_OF_SONGS = 3000
COLUMNS = {
    "away": 2, "last°": 0, "to front": 2, "off 4x3": 2, "frozen": 3, "still": 3, "lift cm": 1, "slide": 2,
    "jerk": 2, "pfc": 3, "jumps": 1, "counts": 2, "count 1": 2, "tempo": 2,
}  # fmt: skip


def motion_row(motion: Motion, joins_s: np.ndarray, front_rad: float = 0.0) -> dict[str, float]:
    """The values of a motion alone. Joins are in seconds."""
    pos, fps = body_pos_m(motion), motion.fps
    faces = front.evaluate(pos, fps, front_rad=front_rad)
    places_m = pos - pos[0, 0] * [1.0, 0.0, 1.0]  # from where it begins
    near = {"half_width_s": physical.JOIN_HALF_WIDTH_S}
    return {
        "away": faces["turned_away_share"],
        "last°": faces["last_heading_deg"],
        "to front": faces["ends_to_front"],
        "off 4x3": front.outside_share(places_m, 4.0, 3.0),
        "frozen": transitions.frozen_ends_share(pos, fps),
        "still": transitions.frozen_ends_share(pos, fps, frozen_m_s=transitions.HELD_M_S),
        "lift cm": transitions.closing_lift_cm(pos, fps),
        "slide": physical.foot_slide_ratio_at(pos, fps, joins_s, **near),
        "jerk": physical.jerk_ratio_at(pos, fps, joins_s, **near),
        "pfc": physical.evaluate_contacts(pos, fps)["pfc"],
        "jumps": physical.jumps_per_minute(pos, fps),
    }


def dance_row(dance: cg.Dance, repertoire: cg.Repertoire) -> dict[str, float]:
    """The values of a dance, whose joins between the held poses count."""
    plan, danced = dance.plan, danced_counts(dance.plan, repertoire)
    joins_s = transition_times_s(plan)
    joins_s = joins_s[(joins_s > plan.opening_s) & (joins_s < plan.danced_until_s)]
    row = motion_row(dance.motion, joins_s)
    if len(danced) and plan.music_beat_numbers:
        song = np.array(plan.music_beats_s), np.array(plan.music_beat_numbers)
        scores = counts.evaluate(danced.times_s, danced.numbers, *song)
        row |= {"counts": scores["counts_within"], "count 1": scores["downbeat_share"]}
    tempo = tempo_scores(plan, repertoire, danced).values
    return row | {"tempo": tempo.get("outside_tempi", float("nan"))}


def genres_of(dance: cg.Dance) -> str:
    """The genres of a dance with their seconds, the most frequent first."""
    genre_of = {block.source: block.planned.credits.genre for block in dance.plan.blocks}
    seconds: Counter[str] = Counter()
    for source, danced_s in dance.plan.takes_s().items():
        seconds[genre_of[source]] += round(danced_s)
    return " ".join(f"{genre} {danced_s}" for genre, danced_s in seconds.most_common())


def show(name: str, rows: Sequence[dict[str, float]], extra: str = "") -> None:
    """A line of the means over rows. nan is left out."""
    cells = []
    for column, digits in COLUMNS.items():
        values = [row[column] for row in rows if np.isfinite(row.get(column, np.nan))]
        cells.append(f"{np.mean(values):8.{digits}f}" if values else "       –")
    print(f"{name:24s}{''.join(cells)}  {extra}", flush=True)


def seed_table(
    songs: dict[str, cg.Song],
    repertoire: cg.Repertoire,
    seeds: int,
    takes: dict[str, cg.Take],
    settings: dict[str, object],
) -> None:
    """Dances of several seeds to each song, the distances between them, and real takes to the same songs."""
    print(" " * 24 + "".join(f"{column:>8s}" for column in COLUMNS))
    everything = []
    for name, song in songs.items():
        made = [cg.dance(song, repertoire, seed=seed, **settings) for seed in range(seeds)]
        rows = [dance_row(dance, repertoire) for dance in made]
        everything += rows
        bodies = [body_pos_m(dance.motion) for dance in made]
        distances = [
            structure.joint_distance_m(bodies[i], bodies[j], made[0].motion.fps)
            for i, j in combinations(range(seeds), 2)
        ]
        rotated = [np.roll(body, len(body) // 2, axis=0) for body in bodies]
        chance = [
            structure.joint_distance_m(bodies[i], rotated[j], made[0].motion.fps)
            for i, j in combinations(range(seeds), 2)
        ]
        away = " ".join(f"{row['away']:.2f}" for row in rows)
        far = (
            f"seeds {np.mean(distances):.2f} (least {min(distances):.2f}, chance {np.mean(chance):.2f}) m, "
            if distances
            else ""
        )
        show(name, rows, f"{far}away {away}; {genres_of(made[0])}")
        if name in takes:
            motion = takes[name].motion
            motion = motion.sliced(0, min(motion.n_frames, round(song.duration_s * motion.fps)))
            facing = front.usual_front_rad(body_pos_m(motion), motion.fps)
            show("  as recorded", [motion_row(motion, np.zeros(0), facing)])
    show("mean", everything)
    level = front.uniform_chance()
    show(
        "chance",
        [{"away": level["turned_away_share"], "last°": 90.0, "to front": 0.25, "slide": 1.0, "jerk": 1.0}],
    )


def genre_table(songs: dict[str, cg.Song], repertoire: cg.Repertoire, engines: Sequence[str]) -> None:
    """The share of the requested genre, for every genre to every song, and the notes without it."""
    genres = sorted({take.credits.genre for take in repertoire.takes})
    lengths = [take.duration_s for take in repertoire.takes]
    in_repertoire = [take.credits.genre for take in repertoire.takes]
    for engine in engines:
        shares, noted = [], 0
        for name, song in songs.items():
            for genre in genres:
                share, note = asked(song, repertoire, genre, engine)
                shares.append(share)
                noted += share < 0.95 and bool(note)
                if share < 0.95:
                    print(f"  {engine}: {genre} to {name}: {share:.2f}  {note}", flush=True)
        chance = np.mean([structure.genre_share(in_repertoire, lengths, genre) for genre in genres])
        kept = np.mean(np.array(shares) >= 0.95)
        print(
            f"{engine}: asked for a genre {len(shares)} times: share of it {np.mean(shares):.2f} (chance "
            f"{chance:.2f}), danced {kept:.2f}, or a note {kept + noted / len(shares):.2f}",
            flush=True,
        )


def asked(song: cg.Song, repertoire: cg.Repertoire, genre: str, engine: str) -> tuple[float, str]:
    """The share of the seconds or words of a requested genre, and the notes that name it."""
    try:
        dance = cg.dance(song, repertoire, genre=genre, engine=engine)
    except ChoreographError as error:
        return 0.0, str(error)
    notes = "; ".join(note for note in dance.notes if genre in note)
    plan = dance.plan
    if not plan.from_takes:
        return float("nan"), notes
    if plan.words and not plan.seconds:
        words = [word.credits.genre for word in plan.words]
        return structure.genre_share(words, np.ones(len(words)), genre), notes
    parts = [(block.planned.credits.genre, block.end_s - block.start_s) for block in plan.blocks]
    names, lengths_s = zip(*parts, strict=True)
    return structure.genre_share(names, lengths_s, genre), notes


def shipped_and_unseen(folder: Path, duration_s: float) -> Iterator[cg.Song]:
    """The six songs of the built-in takes' table."""
    for path in cg.example_songs().values():
        yield cg.load_song(path, duration_s=duration_s)
    for genre in UNSEEN:
        path = folder / f"{genre}.wav"
        write_song(path, render_song(genre, duration_s=duration_s, seed=SEED_OF_SONGS))
        yield cg.load_song(path)


def held_out(data: Path, duration_s: float) -> tuple[dict[str, cg.Song], dict[str, cg.Take]]:
    """The held-out songs and their takes by name."""
    names = HELD_OUT.read_text(encoding="utf-8").split()
    songs, takes = {}, {}
    for take in read(data):
        if take.name in names and take.song_path is not None:
            length_s = min(duration_s, take.motion.duration_s)
            songs[take.name] = cg.load_song(take.song_path, start_s=take.song_start_s, duration_s=length_s)
            takes[take.name] = take
    return songs, takes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repertoire", type=Path)
    parser.add_argument("--data", type=Path, help="dance-with-melody, of a repertoire of its takes")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--duration", type=float, default=40.0, help="seconds of each song")
    parser.add_argument("--engine", default="graph")
    parser.add_argument("--stage", default="near")
    parser.add_argument("--weights", type=json.loads, default={}, help='of the graph\'s, as {"seed": 1}')
    parser.add_argument("--only", nargs="*", default=[], help="names of songs")
    parser.add_argument("--asked", nargs="*", default=[], metavar="ENGINE", help="ask for genres, too")
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()
    with TemporaryDirectory() as folder:
        takes: dict[str, cg.Take] = {}
        if given.data:
            songs, takes = held_out(given.data, given.duration)
        else:
            songs = {song.name: song for song in shipped_and_unseen(Path(folder), given.duration)}
        songs = {name: song for name, song in songs.items() if not given.only or name in given.only}
        if given.seeds:
            settings = {"engine": given.engine, "stage": given.stage, "weights": given.weights}
            seed_table(songs, repertoire, given.seeds, takes, settings)
        genre_table(songs, repertoire, given.asked)


if __name__ == "__main__":
    main()
