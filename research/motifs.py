"""Do motion words find similar words in other takes, and do motifs separate genres? On held-out takes.

    python research/motifs.py path/to/dance-with-melody --seeds 0 1 [--strips folder] [--pretrained]
    python research/motifs.py path/to/rendered/starter/takes --every 4

The word network and the motifs are made from the other takes, with `--pretrained` beginning with the network
of the built-in takes, which is also judged as it is. Distances are mean joint distances in cm after
alignment: each word is in its root frame, and time-warped by up to 3 of 13 frames. `positions` is the nearest
neighbour by positions frame by frame, and `best` the one by the measured distance. An altered copy is warped,
on other beats, at another frame rate, or of another size. Beats are those of the music, by the default
tracker. Takes with NAME.truth.json are cut at the beats in that file, and their moves are compared with the
motifs.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from sklearn.metrics import normalized_mutual_info_score

from choreograph.choreography.motif_sequences import NEEDS, draw_motifs
from choreograph.core.numerics import chi_square_distance
from choreograph.core.timebase import WORD_FRAMES
from choreograph.formats.register import import_takes
from choreograph.library.repertoire import starter_repertoire
from choreograph.library.vocabulary import (
    Motifs,
    Words,
    find_motifs,
    make_vocabulary,
    segment_words,
    signature,
    template,
    transition_matrix,
)
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Take
from choreograph.music.beats import get_beat_tracker
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song
from choreograph.nets.configs import word_config
from choreograph.nets.words import WordNet, WordTake, augmented_words, clips_to_root_frame, train_word_net
from choreograph.view.strip import ShownWord, words_to_show, write_motif_strip

FPS = 30.0
BAND = 3
COPIES = 500
DRAWN = (20, 60, 120, 250)  # words


@dataclass(frozen=True, eq=False)
class Danced:
    """A take and its words."""

    take: Take
    words: Words
    moves: list[str]  # the move each word is from, and which beat of it, empty if unknown

    def for_training(self) -> WordTake:
        body = body_pos_m(self.take.motion.resampled(FPS))
        return WordTake(self.take.name, body, FPS, self.words.start_s, self.words.end_s)


def danced(take: Take) -> Danced:
    known = take.source_paths[0].with_name(f"{take.name}.truth.json")
    body = body_pos_m(take.motion.resampled(FPS))
    if not known.exists():
        song = load_song(take.song_path)
        beats = get_beat_tracker().beats(song, log_mel(song.samples)) - take.song_start_s
        return Danced(take, segment_words(body, FPS, beats), [])
    truth = json.loads(known.read_text(encoding="utf-8"))
    beats = np.array(truth["beat_times_s"])
    words = segment_words(body, FPS, beats - take.song_start_s)
    starts = np.array([move["start_s"] for move in truth["moves"]]) - take.song_start_s
    index = np.maximum(np.searchsorted(starts, words.start_s + 0.05, side="right") - 1, 0)
    beat = np.round((words.start_s - starts[index]) / np.median(np.diff(beats))).astype(int)
    names = [truth["moves"][i]["name"] for i in index]
    return Danced(take, words, [f"{take.credits.genre} {n}@{b}" for n, b in zip(names, beat, strict=True)])


def warped_distance_m(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Mean joint distance along the best time-warp of all pairs of words (N, ...) and (M, ...), (N, M)."""
    x, y = (torch.from_numpy(w.astype(np.float32)).permute(1, 2, 0, 3) for w in (a, b))  # (13, 21, N, 3)
    cost: dict[tuple[int, int], torch.Tensor] = {}
    for s in range(WORD_FRAMES):
        for t in range(max(0, s - BAND), min(WORD_FRAMES, s + BAND + 1)):
            here = torch.cdist(x[s], y[t]).mean(dim=0)  # (N, M)
            # A step in one word alone weighs 1, in both 2: all ways weigh 26.
            ways = [
                cost[p] + w * here
                for p, w in (((s - 1, t - 1), 2), ((s - 1, t), 1), ((s, t - 1), 1))
                if p in cost
            ]
            cost[s, t] = torch.stack(ways).amin(dim=0) if ways else 2 * here
    return (cost[WORD_FRAMES - 1, WORD_FRAMES - 1] / (2 * WORD_FRAMES)).numpy()


def positions_m(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Mean joint distance frame by frame of all pairs, (N, M)."""
    x, y = (torch.from_numpy(w.astype(np.float32)).flatten(1, 2).transpose(0, 1) for w in (a, b))
    return sum(torch.cdist(p, q) for p, q in zip(x, y, strict=True)).numpy() / len(x)


def embedded(net: WordNet, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return torch.cdist(*(torch.from_numpy(net.embed(w)) for w in (a, b))).numpy()


def show_neighbours(net: WordNet, known: list[Danced], unknown: list[Danced], truth_m: np.ndarray) -> None:
    """Nearest neighbours of held-out words among all others, and of altered copies."""
    queries, others = (np.concatenate([d.words.body_pos_m for d in part]) for part in (unknown, known))
    genre, theirs = (
        np.repeat([d.take.credits.genre for d in part], [len(d.words) for d in part])
        for part in (unknown, known)
    )
    methods = {
        "embedding": embedded(net, queries, others), "positions": positions_m(queries, others),
        "best": truth_m, "random": np.random.default_rng(0).random(truth_m.shape),
    }  # fmt: skip
    for name, apart in methods.items():
        nearest = apart.argmin(axis=1)
        distance, right = 100 * truth_m[np.arange(len(queries)), nearest], theirs[nearest] == genre
        per_genre = np.mean([right[genre == g].mean() for g in set(genre)])
        print(f"  nearest by {name:10s} {distance.mean():5.2f} cm  of its genre {per_genre:.2f}")
    copies = augmented_words([d.for_training() for d in unknown], COPIES, np.random.default_rng(5))
    clean, altered = (clips_to_root_frame(t).numpy() for t in (copies.words, copies.first))
    clean, chosen = np.unique(clean, axis=0, return_index=True)
    found = {
        n: np.mean(f(altered[chosen], clean).argmin(axis=1) == np.arange(len(clean)))
        for n, f in (("embedding", lambda a, b: embedded(net, a, b)), ("positions", positions_m))
    }
    print(
        f"  altered copies that find their word among {len(clean)}:",
        *(f"{n} {s:.3f}" for n, s in found.items()),
    )


def show_signatures(
    motifs: Motifs, labels: dict[str, np.ndarray], known: list[Danced], unknown: list[Danced]
) -> None:
    """Distance of held-out dances, and of random ones, to the signature of their genre."""
    k = len(motifs)
    genres = sorted({d.take.credits.genre for d in known})
    of = {g: [labels[d.take.name] for d in known if d.take.credits.genre == g] for g in genres}
    goals, steps = ({g: make(of[g], k) for g in genres} for make in (template, transition_matrix))
    rows = []
    for d in unknown:
        far = {g: float(chi_square_distance(signature(labels[d.take.name], k), goals[g])) for g in genres}
        own = far.pop(d.take.credits.genre)
        rows.append((own, np.mean(list(far.values())), own < min(far.values())))
    own, others, right = np.mean(rows, axis=0)
    print(
        f"  {k} motifs, held-out dances to their own template {own:.3f}, to others {others:.3f}, "
        f"own nearest {right:.2f}"
    )
    halves = {
        d.take.name: [signature(h, k) for h in np.array_split(labels[d.take.name], 2)]
        for d in (*known, *unknown)
    }
    genre = {d.take.name: d.take.credits.genre for d in (*known, *unknown)}
    pairs = {"the same dance": [], "one genre": [], "two genres": []}
    for a, (first, _) in halves.items():
        for b, (_, second) in halves.items():
            kind = "the same dance" if a == b else "one genre" if genre[a] == genre[b] else "two genres"
            pairs[kind].append(chi_square_distance(first, second))
    print("  half to half of", *(f"{kind} {np.mean(v):.3f}" for kind, v in pairs.items()))
    for need in NEEDS:
        far = [
            [chi_square_distance(signature(m[:n], k), goals[g]) for n in DRAWN]
            for g in genres
            for seed in range(3)
            for m in [draw_motifs(DRAWN[-1], goals[g], steps[g], rng=np.random.default_rng(seed), need=need)]
        ]
        print(f"  drawn, need {need}: to the template after {DRAWN} words", np.mean(far, axis=0).round(3))


def write_strips(folder: Path, motifs: Motifs, labels: np.ndarray, everything: list[Danced]) -> None:
    """Every 20th motif, one PNG: its medoid and three words of other takes, at begin, middle and end."""
    folder.mkdir(parents=True, exist_ok=True)
    words = [d.words for d in everything]
    vocabulary = make_vocabulary(
        motifs, labels, np.repeat(np.arange(len(words)), [len(w) for w in words]),
        np.concatenate([w.start_s for w in words]), np.concatenate([w.end_s for w in words]),
        [d.take.credits.genre for d in everything],
    )  # fmt: skip
    for motif in range(0, len(motifs), 20):
        shown = [
            ShownWord(
                everything[vocabulary.word_take[word]].take.name,
                everything[vocabulary.word_take[word]].take.motion,
                vocabulary.word_start_s[word],
                vocabulary.word_end_s[word],
            )
            for word in words_to_show(vocabulary, motif)
        ]
        write_motif_strip(folder / f"motif-{motif:03d}.png", shown)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument(
        "--held-out", type=Path, default=Path(__file__).with_name("dance_with_melody_held_out.txt")
    )
    parser.add_argument("--every", type=int, help="hold every n-th take out instead of those in --held-out")
    parser.add_argument("--preset", default="small")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--strips", type=Path, help="folder for strips of motifs, made if missing")
    parser.add_argument(
        "--pretrained", action="store_true", help="begin with the words of the built-in takes"
    )
    options = parser.parse_args()
    torch.set_num_threads(1)
    everything = [danced(take) for take in import_takes(options.data)]
    names = (
        {d.take.name for d in everything[1 :: options.every]}
        if options.every
        else set(options.held_out.read_text(encoding="utf-8").split())
    )
    known = [d for d in everything if d.take.name not in names]
    unknown = [d for d in everything if d.take.name in names]
    own, words = (np.concatenate([d.words.body_pos_m for d in part]) for part in (known, unknown))
    truth_m = warped_distance_m(words, own)
    print(f"{len(known)} takes of {len(own)} words, {len(unknown)} held out of {len(words)}")
    shipped = starter_repertoire().net("words") if options.pretrained else None
    if shipped is not None:
        print("the words of the built-in takes as they are")
        show_neighbours(WordNet.from_arrays(shipped.weights, shipped.config), known, unknown, truth_m)
    for seed in options.seeds:
        begun = time.process_time()
        config = word_config(options.preset, n_words=len(own), pretrained=shipped is not None)
        weights = None if shipped is None else shipped.weights
        net = train_word_net([d.for_training() for d in known], config, seed=seed, pretrained=weights)
        spent_s = time.process_time() - begun
        print(f"{options.preset}, seed {seed}: {config.steps} steps in {spent_s:.0f} CPU s")
        show_neighbours(net, known, unknown, truth_m)
        motifs, of_known = find_motifs(net.embed(own), seed=seed)
        medoids = own[motifs.words]
        apart = [
            np.linalg.norm(own - medoids[motif], axis=-1).mean()
            for motif in (of_known, np.roll(of_known, 999))
        ]
        print(f"  word to its motif {100 * apart[0]:.1f} cm, to another word's {100 * apart[1]:.1f} cm")
        labels = {d.take.name: motifs.nearest(net.embed(d.words.body_pos_m)) for d in everything}
        show_signatures(motifs, labels, known, unknown)
        if all(d.moves for d in unknown):
            show_moves(
                np.concatenate([labels[d.take.name] for d in unknown]), [m for d in unknown for m in d.moves]
            )
        if options.strips:
            write_strips(options.strips, motifs, of_known, known)


def show_moves(labels: np.ndarray, moves: list[str]) -> None:
    """Mutual information of motifs with the moves that held-out words are from."""
    shuffled = np.random.default_rng(0).permutation(labels)
    for what, truth in (("moves", [m.split("@")[0] for m in moves]), ("beats of moves", moves)):
        score, chance = (normalized_mutual_info_score(truth, m) for m in (labels, shuffled))
        print(f"  normalised mutual information with {what}: {score:.3f}, shuffled {chance:.3f}")


if __name__ == "__main__":
    main()
