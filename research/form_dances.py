"""Does a dance return with the phrases of its song? Songs of known form, danced with other weights of `form`.

    python -m research.form_dances [--repertoire REP] [--weights 0 4] [--seeds 5] [--songs 4 8] [--true-form]
        [--engine mixer --judge REP]

The songs are those of `content.songs.known_forms` that were held out of the detection, and the form that the
dances are judged by is the true one. Without --true-form, dances are planned with the detected form. With
--songs, only these are danced. Columns are the pose distances of phrases to their first occurrence
and to other phrases, their ratio, the share of the time that returns with the music beside chance, the share
that is also danced in another section, the seconds between changes of takes, the share of changes
within 0.3 s of the border of a phrase, the quality of the motion, and the counts and count 1 of the dance
against the true ones. The last lines are the Fréchet distance of poses between the dances of each weight and
the takes. With --engine mixer or rollout, a dance at weight 0 is one to a song without phrases. With a judge,
the columns of `research.passages_of_takes` follow, by its word network. "takes_slide" is the foot sliding of
the takes that are danced, as recorded.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import soundfile

import choreograph as cg
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.counts import Counts
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.metrics import counts, frechet, front, physical, structure
from choreograph.evaluation.plan_scores import danced_counts, transition_times_s
from choreograph.motion.body import body_pos_m
from choreograph.music.form import Form, Phrase
from content.songs.known_forms import HELD_OUT_FORMS, UNIT_BARS, FormAudio, FormSong
from content.songs.synthesis.sounds import RATE_HZ
from research import passages_of_takes

Row = dict[str, float]
NEAR_S = 0.3  # of the border of a phrase
RETURNING = tuple(song for song in HELD_OUT_FORMS if len(set(song.letters)) < len(song.letters))


def true_form(audio: FormAudio) -> Form:
    """The form of a song in units of four bars."""
    n_counts = UNIT_BARS * audio.counts.metre
    first = int(np.flatnonzero(audio.ids >= 0)[0])
    times_s = audio.counts.times_s
    starts_s = times_s[first::n_counts]
    bounds_s = np.append(starts_s, 2 * starts_s[-1] - starts_s[-2])
    labels = (audio.ids[first::n_counts] // n_counts).tolist()
    phrases = []
    for index, (start_s, end_s) in enumerate(pairwise(bounds_s.tolist())):
        before = labels.index(labels[index])
        phrases.append(Phrase(start_s, end_s, n_counts, index, None if before == index else before))
    return Form(tuple(phrases))


def measured(dance: cg.Dance, repertoire: cg.Repertoire, form: Form, true: Counts) -> Row:
    """Scores of one dance, by the true phrases and counts of its song."""
    plan = dance.plan
    blocks = plan.blocks
    if plan.from_takes:
        takes = [block.planned.take for block in blocks]
        pieces_s = np.array([(b.start_s, b.end_s, b.source_start_s, b.source_end_s) for b in blocks])
    else:  # what returns is the motif
        takes = [f"motif {word.motif}" for word in plan.words]
        pieces_s = np.array([(w.start_s, w.end_s, 0.0, w.end_s - w.start_s) for w in plan.words])
    row = structure.evaluate_returns(
        body_pos_m(dance.motion), dance.motion.fps, takes, pieces_s,
        phrases_s=np.array([(phrase.start_s, phrase.end_s) for phrase in form.phrases]), labels=form.labels,
    )  # fmt: skip
    joins_s = transition_times_s(plan)
    borders_s = np.array([phrase.start_s for phrase in form.phrases])
    row["change_every_s"] = plan.duration_s / (len(joins_s) + 1)
    if len(joins_s):
        near = np.abs(joins_s[:, None] - borders_s).min(axis=1) <= NEAR_S
        row["joins_at_phrases"] = float(near.mean())
    body = body_pos_m(dance.motion), dance.motion.fps
    row["jerk_ratio_at_joins"] = physical.jerk_ratio_at(*body, joins_s)
    row["jumps_per_minute"] = physical.jumps_per_minute(*body)
    row["pfc"] = physical.pfc(*body)
    row["turned_away_share"] = front.turned_away_share(*body)
    row["foot_slide_cm_s"] = physical.foot_slide_cm_s(*body)
    if plan.from_takes:
        placed = danced_counts(plan, repertoire)
        pair = (placed.times_s, placed.numbers, true.times_s, true.numbers)
        row["counts_within"] = counts.counts_within(*pair[::2])
        row["downbeat_share"] = counts.downbeat_share(*pair)
        row["takes_slide_cm_s"] = slide_of_takes(plan, repertoire)
    return row


@cache
def take_slide_cm_s(repertoire: cg.Repertoire, take: str) -> float:
    """Foot sliding of a take as recorded."""
    motion, _ = repertoire.motion(repertoire.take_index(take))
    return physical.foot_slide_cm_s(body_pos_m(motion), motion.fps)


def slide_of_takes(plan: cg.Plan, repertoire: cg.Repertoire) -> float:
    """Mean foot sliding of the takes of a dance, by how long each is danced."""
    danced_s = plan.takes_s()
    slides = [take_slide_cm_s(repertoire, take) for take in danced_s]
    return float(np.average(slides, weights=list(danced_s.values())))


def dances(
    song: FormSong,
    repertoire: cg.Repertoire,
    weights: Sequence[float],
    seeds: int,
    *,
    planted: bool,
    engine: str = "graph",
    judge: passages_of_takes.Judge | None = None,
) -> list[list[tuple[Row, cg.Motion]]]:
    """Scores and motion at 20 fps for each weight and seed. The song is analysed once."""
    audio = song.render()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "song.wav"
        soundfile.write(path, audio.samples, RATE_HZ)
        features, notes = analyse_song(cg.load_song(path), repertoire)
        if planted:
            features = replace(features, form=true_form(audio))
        rows = []
        for weight in weights:
            rows.append([])
            of_weight = features if weight or engine == "graph" else replace(features, form=Form.empty())
            config = cg.DanceConfig(engine=engine, weights={"form": weight} if engine == "graph" else {})
            with patch("choreograph.pipeline.dancing.analyse_song", return_value=(of_weight, notes)):
                for seed in range(seeds):
                    started = time.process_time()
                    dance = cg.dance(path, repertoire, config=replace(config, seed=seed))
                    took = {"dance_took_s": time.process_time() - started}
                    row = measured(dance, repertoire, true_form(audio), audio.counts) | took
                    if judge is not None:
                        row |= passages_of_takes.measured(dance, repertoire, judge)[1]
                    rows[-1].append((row, dance.motion.resampled(NET_FPS)))
    return rows


def text(danced: Sequence[tuple[Row, cg.Motion]]) -> str:
    """Means of the columns, without values that are not known."""
    rows = [row for row, _ in danced]
    names = {name: None for row in rows for name in row}
    known = {key: [row[key] for row in rows if np.isfinite(row.get(key, np.nan))] for key in names}
    return " ".join(f"{key} {np.mean(values):.3f}" for key, values in known.items() if values)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repertoire", type=Path, help="default: the built-in one")
    parser.add_argument("--weights", type=float, nargs="+", default=[0.0, 4.0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--songs", type=int, nargs="+", default=range(len(RETURNING)), help="numbers, from 0")
    parser.add_argument("--true-form", action="store_true", help="plan with the true form")
    parser.add_argument("--engine", default="graph")
    parser.add_argument("--judge", type=Path, help="repertoire whose word network judges motifs")
    parser.add_argument("--trained-judge", action="store_true", help="train the judge, on the same takes")
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()
    judge = None
    if given.judge or given.trained_judge:
        judge = passages_of_takes.judge_of(given.judge, repertoire)
    of_weights: list[list[tuple[Row, cg.Motion]]] = [[] for _ in given.weights]
    for song in [RETURNING[number] for number in given.songs]:
        rows = dances(
            song,
            repertoire,
            given.weights,
            given.seeds,
            planted=given.true_form,
            engine=given.engine,
            judge=judge,
        )
        for weight, of_weight, new in zip(given.weights, of_weights, rows, strict=True):
            of_weight.extend(new)
            print(f"{song.name:44s} form {weight:g}:", text(new), flush=True)
    for weight, of_weight in zip(given.weights, of_weights, strict=True):
        print(f"mean of {len(of_weight)} dances, form {weight:g}:", text(of_weight), flush=True)
    takes = [repertoire.motion(take)[0].resampled(NET_FPS) for take in range(len(repertoire.takes))]
    for weight, of_weight in zip(given.weights, of_weights, strict=True):
        print(
            f"FPD, form {weight:g}: {frechet.fpd([motion for _, motion in of_weight], takes):.3f}", flush=True
        )


if __name__ == "__main__":
    main()
