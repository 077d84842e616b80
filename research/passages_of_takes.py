"""How much of a dance's motif sequences the takes have, and what drawing passages costs.

    python research/passages_of_takes.py mixer SONG... [--repertoire R.h5] [--judge J.h5] [--seeds 0 1 2 3 4]
        [--phrase-counts 1 | --published]

Prints a line for each dance and their means: the share of runs of four and of eight motifs that the takes
have, as planned and as danced, χ² of the danced motifs to the signature of the genre, foot slide, the seconds
from one change of source to the next, and counts. Danced motifs are judged by a network of another seed: that
of the repertoire --judge of the same takes, or else one that is trained here. The first lines are of takes
that are left out, and of chance.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.core.numerics import Floats, Indices, chi_square_distance
from choreograph.core.timebase import NET_FPS, WORD_FPS, WORD_FRAMES
from choreograph.evaluation.metrics import counts, physical
from choreograph.evaluation.metrics.structure import n_gram_chance, n_gram_share
from choreograph.evaluation.plan_scores import danced_counts
from choreograph.library.vocabulary import (
    Vocabulary,
    dance_bounds_s,
    find_motifs,
    make_vocabulary,
    poses_at,
    segment_words,
    signature,
)
from choreograph.motion.body import body_pos_m, clips_to_root_frame
from choreograph.nets.configs import word_config
from choreograph.nets.words import WordTake, train_word_net
from choreograph.pipeline.published import published_dance

Embed = Callable[[Floats], "np.ndarray[tuple[int, ...], np.dtype[np.float32]]"]
Judge = tuple[Vocabulary, Embed]
LENGTHS = (4, 8)


def trained_judge(repertoire: cg.Repertoire, seed: int) -> Judge:
    """The vocabulary and the embedding of a word network of another seed, of the words of a repertoire."""
    v = repertoire.vocabulary
    body = [np.asarray(repertoire.body_pos_m(take), np.float64) for take in range(len(repertoire.takes))]
    words = [v.words_of_take(take) for take in range(len(body))]
    takes = [
        WordTake(info.name, pos, NET_FPS, v.word_start_s[own], v.word_end_s[own])
        for info, pos, own in zip(repertoire.takes, body, words, strict=True)
    ]
    embed = train_word_net(takes, word_config("small"), seed=seed).embed
    shares = np.linspace(0.0, 1.0, WORD_FRAMES)
    embeddings = [
        embed(clips_to_root_frame(poses_at(pos, NET_FPS, v.word_start_s[own][:, None] + length * shares)))
        for pos, own in zip(body, words, strict=True)
        for length in [(v.word_end_s[own] - v.word_start_s[own])[:, None]]
    ]
    motifs, labels = find_motifs(np.concatenate(embeddings), seed=seed)
    genres = [take.credits.genre for take in repertoire.takes]
    return make_vocabulary(motifs, labels, v.word_take, v.word_start_s, v.word_end_s, genres), embed


def judge_of(path: Path | None, repertoire: cg.Repertoire) -> Judge:
    """The vocabulary and the embedding of another repertoire of the same takes, or of a trained network."""
    if path is None:
        return trained_judge(repertoire, seed=1)
    judging = cg.Repertoire.open(path)
    return judging.vocabulary, judging.word_net().embed


def sequences(vocabulary: Vocabulary) -> list[Indices]:
    """The motifs of each take."""
    takes = range(int(vocabulary.word_take.max()) + 1)
    return [vocabulary.word_motif[vocabulary.words_of_take(take)] for take in takes]


def references(vocabulary: Vocabulary) -> dict[str, float]:
    """The shares of takes that are left out, and of their motifs in a random order."""
    takes = [take for take in sequences(vocabulary) if len(take) >= max(LENGTHS)]
    found = {}
    for n in LENGTHS:
        others = [takes[:i] + takes[i + 1 :] for i in range(len(takes))]
        found[f"left_out_{n}"] = np.mean([n_gram_share(t, o, n) for t, o in zip(takes, others, strict=True)])
        found[f"chance_{n}"] = np.mean([n_gram_chance(take, takes, n) for take in takes])
    return found


def measured(dance: cg.Dance, repertoire: cg.Repertoire, judge: Judge) -> tuple[str, dict[str, float]]:
    """The genre of a dance, and its scores."""
    plan, (vocabulary, embed) = dance.plan, judge
    bounds_s = dance_bounds_s(np.array(plan.music_beats_s), plan.duration_s)
    words = segment_words(body_pos_m(dance.motion.resampled(WORD_FPS)), WORD_FPS, bounds_s)
    is_held = (words.start_s < plan.opening_s - 1e-6) | (words.end_s > (plan.closing_s or np.inf) + 1e-6)
    danced = vocabulary.motifs.nearest(embed(words.body_pos_m))[~is_held]
    shares = signature(danced, vocabulary.n_motifs)
    away = chi_square_distance(shares, vocabulary.signatures[:-1])
    of_takes = Counter(word.credits.genre for word in plan.words if word.take)
    genre = of_takes.most_common(1)[0][0] if of_takes else vocabulary.genres[int(away.argmin())]
    planned = np.array([word.motif for word in plan.words])
    scores: dict[str, float] = {}
    for n in LENGTHS:
        scores[f"planned_{n}"] = n_gram_share(planned, sequences(repertoire.vocabulary), n)
        scores[f"judged_{n}"] = n_gram_share(danced, sequences(vocabulary), n)
    scores["chi2"] = float(away[vocabulary.genre_index(genre)])
    own = repertoire.vocabulary
    shown = own.motifs.nearest(repertoire.word_net().embed(words.body_pos_m))  # (N,)
    if len(shown) == len(planned):
        scores["as_planned"] = float(np.mean((shown == planned)[~is_held]))
    of_genre = own.signatures[own.genre_index(genre)]
    scores["chi2_planned"] = float(chi_square_distance(signature(planned, own.n_motifs), of_genre))
    scores["slide_cm_s"] = physical.foot_slide_cm_s(body_pos_m(dance.motion), dance.motion.fps)
    if of_takes:
        changes = sum(
            one.take != other.take or abs(one.source_end_s - other.source_start_s) > 1e-3
            for one, other in pairwise(plan.words)
        )
        of_dance = danced_counts(plan, repertoire)
        scores |= {"source_s": plan.duration_s / max(changes, 1)}
        on_beats = counts.evaluate(
            of_dance.times_s, of_dance.numbers, plan.music_beats_s, plan.music_beat_numbers
        )
        scores |= {name: on_beats[name] for name in ("counts_within", "downbeat_share")}
    return genre, scores


def show(name: str, row: dict[str, float]) -> None:
    """One line of the table."""
    print(f"{name:32s}", " ".join(f"{key} {value:.3f}" for key, value in row.items()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("engine", choices=("mixer", "rollout"))
    parser.add_argument("songs", type=Path, nargs="+")
    parser.add_argument("--repertoire", type=Path)
    parser.add_argument("--judge", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--phrase-counts", type=int, default=cg.DanceConfig().phrase_counts)
    parser.add_argument("--published", action="store_true", help="the settings of the paper")
    parser.add_argument("--duration", type=float, default=60.0, help="seconds of each song")
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()
    judge = judge_of(given.judge, repertoire)
    show("takes", references(repertoire.vocabulary))
    show("takes, judged", references(judge[0]))
    means = []
    for seed in given.seeds:
        config = cg.DanceConfig(engine=given.engine, seed=seed, phrase_counts=given.phrase_counts)
        if given.published:
            config = published_dance(given.engine, seed=seed)
        rows = []
        for path in given.songs:
            dance = cg.dance(path, repertoire, config=config, duration_s=given.duration)
            genre, row = measured(dance, repertoire, judge)
            rows.append(row)
            show(f"{path.parent.name}/{path.stem} ({genre}), seed {seed}", row)
        means.append({key: float(np.mean([row[key] for row in rows])) for key in rows[0]})
    show("mean of the seeds", {key: float(np.mean([mean[key] for mean in means])) for key in means[0]})
    show("their deviation", {key: float(np.std([mean[key] for mean in means])) for key in means[0]})


if __name__ == "__main__":
    main()
