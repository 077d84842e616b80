"""Motif signatures of dances against those of their genre, over time.

    python research/steered_dances.py path/to/dance-with-melody REPERTOIRE… [--plot FIGURE.png]

Each REPERTOIRE must have been built with `--leave-out @research/dance_with_melody_held_out.txt` and its own
seed, and hold a vocabulary. Numbers are mean ± spread over repertoires. The songs are the held-out ones and
those of DATA without motion. Each is danced with its genre given, without, and with no weight on motifs.
"real" is the held-out take itself. Words are segmented on the beats of the song, as those of the takes are.
The distance is χ² (Rhythm is a Dancer, equation 11) to the signature of the genre, after so many seconds.
Dances of each repertoire are measured by the word network of the next one, which no cost of the dances is
from. Those of a single repertoire are measured by their own.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import chi_square_distance
from choreograph.evaluation.metrics import beat
from choreograph.evaluation.metrics.beat import savitzky_golay_beats_s
from choreograph.formats.dance_with_melody import read
from choreograph.library.vocabulary import segment_words, signature
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import motion_beat_times_s

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
WITHOUT_MOTION = {"DANCE_C_1": "cha-cha", "DANCE_C_3": "cha-cha", "DANCE_R_6": "rumba", "DANCE_R_10": "rumba"}
UNPRICED = {"signature": 0.0, "motif_transition": 0.0}
FPS = 30.0
BEAT_FPS = 60.0
AFTER_S = (10, 20, 30, 40, 50, 60, 70, 80)

Row = dict[str, float]


class Judge:
    """Measures dances with a repertoire's vocabulary."""

    def __init__(self, repertoire: cg.Repertoire) -> None:
        self.vocabulary, self.net = repertoire.vocabulary, repertoire.word_net()

    def measured(self, motion: Motion, beats_s: np.ndarray, genre: str) -> dict[str, float]:
        """Distance after each of `AFTER_S` that the dance lasts, and how it keeps the beat."""
        body = body_pos_m(motion.resampled(FPS))
        words = segment_words(body, FPS, beats_s)
        motifs = self.vocabulary.motifs.nearest(self.net.embed(words.body_pos_m))
        goal = self.vocabulary.signatures[self.vocabulary.genre_index(genre)]
        steps = self.vocabulary.transitions[self.vocabulary.genre_index(genre)]
        row = {"chi2": self.distance(motifs, goal)}
        for seconds in AFTER_S:
            if words.end_s[0] <= seconds and words.end_s[-1] > seconds - 5:
                row[f"{seconds} s"] = self.distance(motifs[words.end_s <= seconds], goal)
        row["-log T"] = float(-np.log(np.maximum(steps[motifs[:-1], motifs[1:]], 1e-3)).mean())
        made = motion_beat_times_s(body_pos_m(motion.resampled(BEAT_FPS)), BEAT_FPS)
        inside = beats_s[beats_s <= motion.duration_s]
        kinematic = savitzky_golay_beats_s(body_pos_m(motion), motion.fps)
        return {**row, "F": beat.f_score(made, inside), "aligned": beat.aligned_share(kinematic, inside)}

    def distance(self, motifs: np.ndarray, goal: np.ndarray) -> float:
        return float(chi_square_distance(signature(motifs, len(goal)), goal))


def dances_to(name: str, path: Path, genre: str, take: cg.Take | None, repertoire: cg.Repertoire, given):
    """The music's beats, and every kind of dance to a song."""
    part = {
        "config": cg.DanceConfig(planner=given.planner),
        "start_s": take.song_start_s if take else 0.0,
        "duration_s": given.duration,
    }
    plain = cg.dance(path, repertoire, **part)
    dances = {
        "graph, no genre asked": plain.motion,
        "graph, motifs unpriced": cg.dance(path, repertoire, weights=UNPRICED, **part).motion,
    }
    for engine in given.engines:
        more = {"weights": given.weights} if engine == "graph" else {}
        dances[f"{engine}, genre"] = cg.dance(
            path, repertoire, engine=engine, genre=genre, **part, **more
        ).motion
    if take:
        dances["real"] = take.motion
    return np.array(plain.plan.music_beats_s), dances


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("--songs", type=Path, default=HELD_OUT)
    parser.add_argument("--engines", nargs="+", default=["graph"], help="danced with the genre given")
    parser.add_argument("--planner", default="exact")
    parser.add_argument("--weights", type=json.loads, default={}, help='of the graph\'s, as {"signature": 2}')
    parser.add_argument("--duration", type=float, default=80.0)
    parser.add_argument("--plot", type=Path, help="PNG of the distance over time. Needs matplotlib")
    given = parser.parse_args()
    held_out = given.songs.read_text(encoding="utf-8").split()
    takes = {take.name: take for take in read(given.data) if take.name in held_out}
    rows: dict[str, list[list[Row]]] = defaultdict(list)  # by kind, repertoire and song
    judges = given.repertoires[1:] + given.repertoires[:1]
    for path, judge in zip(given.repertoires, judges, strict=True):
        print(path.name, "judged by", "its own network" if judge == path else judge.name)
        for kind, of_kind in measured_dances(path, judge, takes, given).items():
            rows[kind].append(of_kind)
    for kind, by_repertoire in rows.items():
        keys = dict.fromkeys(key for of_kind in by_repertoire for row in of_kind for key in row)
        means = {key: [mean_of(of_kind, key) for of_kind in by_repertoire] for key in keys}
        texts = (f"{key} {np.mean(v):.3f} ± {np.std(v):.3f}" for key, v in means.items())
        print(f"mean of {len(by_repertoire[0])} songs, {kind:16s}", *texts)
    if given.plot:
        plot(
            given.plot,
            {kind: [r for rep in by_repertoire for r in rep] for kind, by_repertoire in rows.items()},
        )


def measured_dances(path: Path, judge_path: Path, takes: dict[str, cg.Take], given) -> dict[str, list[Row]]:
    """Rows of the dances of one repertoire, by kind."""
    repertoire = cg.Repertoire.open(path)
    seen = {take.song_name for take in repertoire.takes} & set(takes)
    if seen:
        raise ParameterError(f"{path} holds {', '.join(sorted(seen))}: build it with --leave-out")
    songs = {name: (take.song_path, take.credits.genre) for name, take in takes.items()}
    for name, genre in WITHOUT_MOTION.items():
        if (given.data / name / "audio.mp3").exists():
            songs[name] = (given.data / name / "audio.mp3", genre)
    judge = Judge(cg.Repertoire.open(judge_path))
    rows: dict[str, list[Row]] = defaultdict(list)
    for name, (song_path, genre) in songs.items():
        beats_s, dances = dances_to(name, song_path, genre, takes.get(name), repertoire, given)
        for kind, motion in dances.items():
            rows[kind].append(judge.measured(motion, beats_s, genre))
            shown = {k: v for k, v in rows[kind][-1].items() if not k.endswith(" s")}
            print(f"{name:10s} {kind:16s}", *(f"{k} {v:.3f}" for k, v in shown.items()), flush=True)
    return rows


def mean_of(rows: list[Row], key: str) -> float:
    return float(np.mean([row[key] for row in rows if key in row]))


def plot(path: Path, rows: dict[str, list[Row]]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4))
    for kind, of_kind in rows.items():
        reached = [s for s in AFTER_S if any(f"{s} s" in r for r in of_kind)]
        axes.plot(reached, [mean_of(of_kind, f"{s} s") for s in reached], marker="o", label=kind)
    axes.set(xlabel="seconds danced", ylabel="χ² distance to the genre's template", ylim=(0, 1))
    axes.legend()
    figure.savefig(path, dpi=120, bbox_inches="tight")


if __name__ == "__main__":
    main()
