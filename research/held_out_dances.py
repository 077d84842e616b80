"""The table of dances to held-out songs: beats, transitions, feet and length.

Run: python research/held_out_dances.py DATA REPERTOIRE [--songs FILE] [--planner greedy]

DATA is a folder in the layout of dance-with-melody. REPERTOIRE must have been built with `--leave-out @FILE`.
Every dance is compared with the held-out take itself ("real") and with chance, which is the same motion beats
against the song shifted by random amounts. Feet are compared with those of the takes in the dance.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.core.errors import ParameterError
from choreograph.evaluation.metrics import beat, physical
from choreograph.formats.dance_with_melody import read
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.beats import get_beat_tracker
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
FPS = 60.0


def evaluate(pos_m: np.ndarray, music_beats_s: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """Beat metrics of one motion (T, 21, 3) at 60 fps."""
    beats = motion_beat_times_s(pos_m, FPS)
    return {
        **beat.evaluate(beats, music_beats_s),
        "chance_f": beat.chance_level(
            beat.f_score, beats, music_beats_s, duration_s=len(pos_m) / FPS, rng=rng
        ),
        "slide_cm_s": physical.foot_slide_cm_s(pos_m, FPS),
    }


def librosa_beats(take: cg.Take) -> np.ndarray:
    """Beats of a take's music by another tracker than the dance's own."""
    song = load_song(take.song_path, start_s=take.song_start_s, duration_s=take.motion.duration_s)
    return get_beat_tracker("librosa").beats(song, log_mel(song.samples))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoire", type=Path)
    parser.add_argument("--songs", type=Path, default=HELD_OUT)
    parser.add_argument("--planner", default="exact")
    parser.add_argument("--blending", default="inertial")
    parser.add_argument("--beats", default="tempo-path", help="tracker danced to")
    given = parser.parse_args()
    songs = [line.strip() for line in given.songs.read_text().splitlines() if line.strip()]
    repertoire = cg.Repertoire.open(given.repertoire)
    seen = {take.song_name for take in repertoire.takes} & set(songs)
    if seen:
        raise ParameterError(f"the repertoire holds {', '.join(sorted(seen))}: build it with --leave-out")
    takes = {take.name: take for take in read(given.data)}
    slides = {
        take.name: physical.foot_slide_cm_s(body_pos_m(repertoire.motion(index)[0].resampled(FPS)), FPS)
        for index, take in enumerate(repertoire.takes)
    }
    config = cg.DanceConfig(planner=given.planner, blending=given.blending, fps=FPS, beats=given.beats)
    rows = []
    for song in songs:
        take = takes[song]
        made = cg.dance(
            take.song_path, repertoire, config=config,
            start_s=take.song_start_s, duration_s=take.motion.duration_s,
        )  # fmt: skip
        song_features = np.array(made.plan.music_beats_s)
        rng = np.random.default_rng(0)
        pos = body_pos_m(made.motion)
        row = evaluate(pos, song_features, rng)
        row["f_librosa"] = beat.f_score(motion_beat_times_s(pos, FPS), librosa_beats(take))
        real = evaluate(body_pos_m(take.motion.resampled(FPS)), song_features, rng)
        row["real_f"] = real["f_score"]
        row["real_motion_to_music"] = real["motion_to_music"]
        own = np.mean([slides[second.take] for second in made.plan.seconds])
        row["slide_ratio"] = row.pop("slide_cm_s") / own
        borders = np.arange(1.0, made.plan.duration_s)
        row["jerk_ratio"] = physical.jerk_ratio_at(pos, FPS, borders)
        row["frames_off"] = abs(made.motion.n_frames - made.plan.duration_s * FPS)
        row["takes"] = len({second.take for second in made.plan.seconds})
        letter = take.credits.genre
        row["same_genre"] = np.mean([second.credits.genre == letter for second in made.plan.seconds])
        rows.append(row)
        print(song, " ".join(f"{name} {value:.2f}" for name, value in row.items()), flush=True)
    print("mean", " ".join(f"{name} {np.mean([r[name] for r in rows]):.3f}" for name in rows[0]))


if __name__ == "__main__":
    main()
