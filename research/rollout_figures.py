"""Figures 8 and 14 of Rhythm is a Dancer, as PNG: tempo, and the perceptual loss, in a rollout's words.

    python research/rollout_figures.py -o FOLDER [--db REPERTOIRE] [--without-perceptual-loss NET.pt]

`tempo.png`: the same motifs danced to songs of 155 and 220 BPM. `perceptual-loss.png`: motion words of a
motif and of others in the plane (t-SNE), the words that the network danced when it was asked for the motif,
and those of a network without the perceptual loss, NET.pt, which
`train_rollout_ablations.py --networks no-perceptual-loss` trains. Figures 3 and 12 are among the plots of
`choreograph inspect --plots FOLDER`.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from sklearn.manifold import TSNE
from swapped_net import WithNet, ablated_net, bounds_of

import choreograph as cg
from choreograph.choreography.enforcement import danced_embeddings
from choreograph.nets.rollout_poses import PosePredictor
from choreograph.view.strip import draw_strip
from content.songs.synthesis.song import render_song, write_song

GENRE = "salsa"
TEMPI_BPM = (155, 220)  # of figure 8
SONG_S = 16.0
FROM_S, SHOWN_S, STEP_S = 5.0, 1.6, 0.1
TILE = (150, 190)
SONGS_BPM = (160, 175, 190)  # of figure 14
NEIGHBOURS, MOST_WORDS = 12, 40  # motifs around the one that is shown, and words of each
OTHERS, OWN, WITH_LOSS, WITHOUT_LOSS, MEDOID = "#c6cad3", "#8a6fb0", "#c1272d", "#2a6fbb", "#3b0f5c"


def song_at(folder: Path, bpm: float) -> tuple[Path, Path]:
    """A song of `GENRE` at a tempo, and its true beats."""
    song = render_song(GENRE, bpm=bpm, duration_s=SONG_S, seed=80_000)
    path, beats = folder / f"{bpm:g}.wav", folder / f"{bpm:g}.txt"
    write_song(path, song)
    beats.write_text("\n".join(f"{time_s:.4f}" for time_s in song.beat_times_s) + "\n", encoding="utf-8")
    return path, beats


def dances_at(folder: Path, repertoire: cg.Repertoire) -> list[cg.Dance]:
    """The motifs of a dance to the slower song, danced to both songs."""
    motifs: list[int] | None = None
    dances = []
    for bpm in TEMPI_BPM:
        path, beats = song_at(folder, bpm)
        asked = {"genre": GENRE} if motifs is None else {"motifs": motifs}
        dances.append(cg.dance(path, repertoire, engine="rollout", beats=str(beats), seed=1, **asked))
        motifs = motifs or [word.motif for word in dances[0].plan.words]
    return dances


def tempo_figure(dances: list[cg.Dance]) -> Figure:
    """Poses every 0.1 s of both dances, from the beat on that follows `FROM_S` at the first tempo.

    Both rows begin with the same word. Red lines are beats, numbers the motifs asked for.
    """
    times_s = np.arange(0.0, SHOWN_S, STEP_S)
    word = int(np.searchsorted(bounds_of(dances[0]), FROM_S))
    figure = Figure(figsize=(15.0, 4.6), dpi=110, layout="constrained")
    for axis, dance, bpm in zip(figure.subplots(2, 1), dances, TEMPI_BPM, strict=True):
        bounds_s = bounds_of(dance)
        start_s = bounds_s[word]
        shown = draw_strip(dance.motion, (start_s + times_s).tolist(), labels=[""] * len(times_s),
                           columns=len(times_s), tile=TILE)  # fmt: skip
        half = STEP_S / 2
        # Without the labels' bars.
        axis.imshow(shown[: TILE[1]], extent=(-half, times_s[-1] + half, 0.0, 1.0), aspect="auto")
        for index in range(word, len(dance.plan.words)):
            from_s, to_s = bounds_s[index : index + 2] - start_s
            if from_s > times_s[-1] + half:
                break
            axis.axvline(from_s, color=WITH_LOSS, linestyle="--")
            middle_s = min((from_s + to_s) / 2, times_s[-1])
            axis.text(middle_s, 0.97, dance.plan.words[index].motif, ha="center", va="top")
        axis.set_title(f"{bpm} BPM, beats in red, motifs by number", loc="left")
        axis.set_yticks([])
    figure.supxlabel("seconds")
    return figure


def danced_embeddings_of(repertoire: WithNet, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """The embeddings (N, D) of the words of dances to some songs, and the motifs (N,) asked for."""
    embeddings, asked = [], []
    for bpm in SONGS_BPM:
        path, beats = song_at(folder, bpm)
        dance = cg.dance(path, repertoire, engine="rollout", beats=str(beats), genre=GENRE, seed=2)
        danced = danced_embeddings(dance.motion, bounds_of(dance), repertoire)
        known = ~np.isnan(danced[:, 0])
        embeddings.append(danced[known])
        asked.append(np.array([word.motif for word in dance.plan.words])[known])
    return np.concatenate(embeddings), np.concatenate(asked)


def loss_figure(repertoire: WithNet, folder: Path, without: PosePredictor | None) -> Figure:
    """Words of the most requested motif, of its neighbours, and as danced, and the distances of all."""
    medoids = repertoire.vocabulary.motifs.embeddings  # (K, D)
    networks = {"with the perceptual loss": (None, WITH_LOSS)}
    if without is not None:
        networks["without it"] = (without, WITHOUT_LOSS)
    danced = {}
    for name, (net, _) in networks.items():
        repertoire.swapped = net
        danced[name] = danced_embeddings_of(repertoire, folder)
    repertoire.swapped = None
    motif = int(np.bincount(danced["with the perceptual loss"][1]).argmax())
    near = np.argsort(np.linalg.norm(medoids - medoids[motif], axis=1))[:NEIGHBOURS]
    words = np.concatenate([repertoire.vocabulary.words_of_motif(int(m))[:MOST_WORDS] for m in near])
    parts = [embeddings_of_words(repertoire, words), medoids[motif][None]]
    parts += [embeddings[asked == motif] for embeddings, asked in danced.values()]
    plane = TSNE(perplexity=20, random_state=0).fit_transform(np.concatenate(parts))  # (N, 2)
    first = np.cumsum([0, *map(len, parts)])
    of_part = [plane[i:j] for i, j in pairwise(first)]
    figure = Figure(figsize=(8.0, 6.4), dpi=110, layout="constrained")
    axis = figure.subplots()
    own = repertoire.vocabulary.word_motif[words] == motif
    axis.scatter(
        *of_part[0][~own].T, s=14, color=OTHERS, label=f"words of the {NEIGHBOURS - 1} nearest motifs"
    )
    axis.scatter(*of_part[0][own].T, s=22, color=OWN, label=f"words of motif {motif}")
    for (name, (_, colour)), points in zip(networks.items(), of_part[2:], strict=True):
        embeddings, asked = danced[name]
        apart = np.linalg.norm(embeddings - medoids[asked], axis=1).mean()
        label = f"danced {name}: {apart:.2f} from the medoid (all {len(asked)} words)"
        axis.scatter(*points.T, s=60, marker="D", color=colour, label=label)
    axis.scatter(*of_part[1].T, s=220, marker="*", color=MEDOID, label="its medoid")
    axis.set_xticks([])
    axis.set_yticks([])
    axis.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, 0.0))
    return figure


def embeddings_of_words(repertoire: cg.Repertoire, words: np.ndarray) -> np.ndarray:
    """The embeddings (N, D) of words of the takes."""
    vocabulary, embeddings = repertoire.vocabulary, []
    for word in words:
        bounds_s = np.array([vocabulary.word_start_s[word], vocabulary.word_end_s[word]])
        motion, first_s = repertoire.motion(int(vocabulary.word_take[word]), *bounds_s)
        embeddings.append(danced_embeddings(motion, bounds_s - first_s, repertoire))
    return np.concatenate(embeddings)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--db", type=Path, help="default: the built-in repertoire")
    parser.add_argument("--without-perceptual-loss", type=Path, metavar="NET.pt")
    given = parser.parse_args()
    repertoire = WithNet.open(given.db or cg.starter_repertoire().path)
    without = ablated_net(given.without_perceptual_loss) if given.without_perceptual_loss else None
    given.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        tempo_figure(dances_at(Path(folder), repertoire)).savefig(given.output / "tempo.png")
        loss_figure(repertoire, Path(folder), without).savefig(given.output / "perceptual-loss.png")


if __name__ == "__main__":
    main()
