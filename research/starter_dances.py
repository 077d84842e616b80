"""How the built-in repertoire dances: beats on songs with known beats, on real songs, and variety.

Run: python research/starter_dances.py [--repertoire REP] [--songs SONG...] [--beats librosa]

The benchmark songs are rendered here. None of them is a song of the built-in takes. Each F-score (70 ms) is
printed with that of the beat tracker against the true beats, and with chance, which is the same motion beats
against the song shifted by random amounts. Real songs have no true beats. Their F-score is against the
tracker that was used for the dance, and against a second one.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.evaluation.metrics import beat, physical
from choreograph.motion.body import body_pos_m
from choreograph.music.beats import get_beat_tracker
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song
from choreograph.plan.plan import Plan
from content.songs.known_songs import BENCHMARK_SONGS
from content.songs.synthesis.song import STYLES, render_song, write_song

FPS = 60.0
OTHER_TRACKER = {"tempo-path": "librosa", "librosa": "tempo-path", "beat-this": "librosa"}


def repeats(plan: Plan) -> int:
    """Seconds after which the dance goes back into what it has just danced, less than a clip's length."""
    pairs = zip(plan.seconds, plan.seconds[1:], strict=False)
    back_s = [(a.take == b.take) * (a.source_times_s[-1] - b.source_times_s[0]) for a, b in pairs]
    return sum(0.25 < back < 8.0 for back in back_s)


def measured(made: cg.Dance, beats_s: np.ndarray) -> dict[str, float]:
    """Beats, feet and variety of one dance, against `beats_s`."""
    pos = body_pos_m(made.motion.resampled(FPS))
    rng = np.random.default_rng(0)
    motion_beats = made.motion_beats_s
    if len(beats_s):  # a rendered song rings out after its last beat
        motion_beats = motion_beats[motion_beats < beats_s[-1] + 0.5]
    return {
        "f": beat.f_score(motion_beats, beats_s),
        "chance": beat.chance_level(beat.f_score, motion_beats, beats_s, duration_s=len(pos) / FPS, rng=rng),
        "motion_to_music": beat.evaluate(motion_beats, beats_s)["motion_to_music"],
        "slide_cm_s": physical.foot_slide_cm_s(pos, FPS),
        "jerk_ratio": physical.jerk_ratio_at(pos, FPS, np.arange(1.0, made.plan.duration_s)),
        "takes": len({second.take for second in made.plan.seconds}),
        "repeats": repeats(made.plan),
    }


def show(name: str, row: dict[str, float]) -> None:
    """One line of the table."""
    print(f"{name:28s}", " ".join(f"{key} {value:.2f}" for key, value in row.items()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repertoire", type=Path)
    parser.add_argument("--songs", type=Path, nargs="*", default=[])
    parser.add_argument("--duration", type=float, default=60.0, help="seconds of each real song")
    parser.add_argument("--beats", default="tempo-path")
    parser.add_argument(
        "--variety-song-s", type=float, default=180.0, help="seconds of a song of every genre, or 0 for none"
    )
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()
    config = cg.DanceConfig(beats=given.beats)
    groups = defaultdict(list)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "song.wav"
        for bench in BENCHMARK_SONGS:
            truth = bench.render()
            write_song(path, truth)
            made = cg.dance(path, repertoire, config=config)
            row = measured(made, truth.beat_times_s)
            row["tracker"] = beat.f_score(np.array(made.plan.music_beats_s), truth.beat_times_s)
            row["genre"] = np.mean([s.credits.genre == bench.genre for s in made.plan.seconds])
            groups[bench.group].append(row)
            show(bench.name, row)
        for group, rows in groups.items():
            show(f"mean {group}", {key: float(np.mean([row[key] for row in rows])) for key in rows[0]})
        for genre in STYLES if given.variety_song_s else ():
            write_song(path, render_song(genre, duration_s=given.variety_song_s, seed=3000))
            made = cg.dance(path, repertoire, config=config)
            show(f"{genre} of {given.variety_song_s:g} s", measured(made, np.array(made.plan.music_beats_s)))
    rows = []
    for song_path in given.songs:
        song = load_song(song_path, duration_s=given.duration)
        made = cg.dance(song, repertoire, config=config)
        row = measured(made, np.array(made.plan.music_beats_s))
        other = get_beat_tracker(OTHER_TRACKER[given.beats]).beats(song, log_mel(song.samples))
        row["f_other_tracker"] = beat.f_score(made.motion_beats_s, other)
        rows.append(row)
        show("/".join(song_path.parts[-2:]), row)
    if rows:
        show("mean of real songs", {key: float(np.mean([row[key] for row in rows])) for key in rows[0]})


if __name__ == "__main__":
    main()
