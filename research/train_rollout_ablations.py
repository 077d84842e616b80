"""Trains rollout networks without one of their conditions, losses or augmentations.

    python research/train_rollout_ablations.py TAKES REPERTOIRE… -o FOLDER

Each REPERTOIRE was built with `--rollout` from TAKES, for example dance-with-melody, or the takes of `make
starter` (build/starter/takes). Its ablations are trained on the same takes, with its preset and seed, and
written to FOLDER/NAME OF THE REPERTOIRE for `rollout.py --ablations FOLDER`. Each takes as long as the
network itself, or as many steps as `--steps` gives. With `--steps`, compare them with `as-built`, which lacks
nothing.

`published` is the network of Rhythm is a Dancer as printed (`choreograph.pipeline.published.ROLLOUT`), one
for each genre, in NAME@GENRE.pt. `published-no-perceptual-loss` and `published-acLSTM` are the other columns
of its Table 1. `as-built` and all that are named after what they lack are trained on the takes alone (`--set
rollout_teacher=false`). `graph-dances-too` is trained on graph dances to their songs as well, as with
`build-db --rollout`, and `synthesised-songs-too` on one to each of their songs and as many to synthesised
songs of their genres. `counts-at-accents` has words, and beats of the music, at the accents of the motion
instead of the counts. After a stop, the same command continues.
"""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

import choreograph as cg
from choreograph.formats.register import import_takes
from choreograph.library.building.networks import rollout_takes, words_of_dances
from choreograph.library.building.takes import measure_take
from choreograph.library.building.words import segment_takes
from choreograph.library.songs import SongCache
from choreograph.library.writing import MeasuredTake
from choreograph.motion.motion import Take
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.music.count_grids import accent_shifts_s
from choreograph.nets.configs import rollout_config
from choreograph.nets.rollout_training import RolloutTake, train_rollouts
from choreograph.nets.training import TrainingContext, TrainingProgress
from choreograph.nets.words import WordNet
from choreograph.pipeline.building import AGAIN_PER_GENRE, dances_to_teach, graph_dances
from choreograph.pipeline.published import ROLLOUT, ROLLOUT_STEPS
from content.songs.synthesis.song import STYLES, render_song, write_song

WITH_GRAPH_DANCES = "graph-dances-too"
WITH_SYNTHESISED_SONGS = "synthesised-songs-too"
SONG_S = 60.0  # of a synthesised song
SEEDS_FROM = 70_000  # of synthesised songs, beyond those of songs that anything is measured on
AT_ACCENTS = "counts-at-accents"
PUBLISHED = {**ROLLOUT, "steps": ROLLOUT_STEPS["small"]}
ABLATIONS = {
    "as-built": {},
    "published": PUBLISHED,
    "published-no-perceptual-loss": {**PUBLISHED, "perceptual_weight": 0.0},
    "published-acLSTM": {**PUBLISHED, "perceptual_weight": 0.0, "motifs": False},
    "no-perceptual-loss": {"perceptual_weight": 0.0},
    "no-audio": {"use_audio": False},
    "acLSTM-no-motifs": {"motifs": False, "perceptual_weight": 0.0},
    "acLSTM-5-frames": {"motifs": False, "perceptual_weight": 0.0, "self_fed_frames": (5,)},
    "acLSTM-5-frames-rotations": {
        "motifs": False, "perceptual_weight": 0.0, "self_fed_frames": (5,), "position_weight": 0.0,
        "velocity_weight": 0.0, "slide_weight": 0.0, "border_speed_weight": 0.0,
    },
    "acLSTM-15-frames": {"motifs": False, "perceptual_weight": 0.0, "self_fed_frames": (15,)},
    "no-word-phase": {"phase": False},
    "no-count-phase": {"count_phase": False},
    "no-own-words": {"own_embedding_share": 0.0},
    "no-position-loss": {"position_weight": 0.0},
    "no-velocity-loss": {"velocity_weight": 0.0},
    "no-slide-loss": {"slide_weight": 0.0},
    "no-border-speed-loss": {"border_speed_weight": 0.0},
    "third-border-speed-loss": {"border_speed_weight": 0.1},
    "half-border-speed-loss": {"border_speed_weight": 0.15},
    "no-other-tempi": {"tempi": (1.0,)},
    WITH_GRAPH_DANCES: {},
    WITH_SYNTHESISED_SONGS: {},
    AT_ACCENTS: {},
}  # fmt: skip


def learned_takes(takes: Mapping[str, Take], repertoire: cg.Repertoire) -> list[RolloutTake]:
    """The takes of a repertoire as the network is trained on them."""
    own, songs = own_takes(takes, repertoire), SongCache(keep_samples=True)
    segmented, _ = segment_takes(own, songs)
    return rollout_takes(own, segmented, repertoire.vocabulary, word_net(repertoire), songs=songs)


def own_takes(takes: Mapping[str, Take], repertoire: cg.Repertoire) -> list[MeasuredTake]:
    """The takes of a repertoire with the motion, the counts and the credits that it stores."""
    return [
        MeasuredTake(
            replace(
                takes[t.name], motion=repertoire.motion(index)[0], counts=repertoire.counts(index),
                credits=t.credits,
            ),
            repertoire.body_pos_m(index), repertoire.motion_beats_s(index),
        )
        for index, t in enumerate(repertoire.takes)
    ]  # fmt: skip


def word_net(repertoire: cg.Repertoire) -> WordNet:
    """The word network of a repertoire, P of the perceptual loss."""
    net = repertoire.net("words")
    return WordNet.from_arrays(net.weights, net.config)


def train(
    takes: Mapping[str, Take],
    repertoire: cg.Repertoire,
    folder: Path,
    names: Sequence[str],
    *,
    changes: Mapping[str, Any],
    genres: Collection[str] = (),
) -> None:
    """Train those of `names` that `folder` lacks, with some fields of their configurations changed.

    With `genres`, they are trained on the takes of these genres alone.
    """
    lacking = [name for name in names if not any(folder.glob(f"{name}*.pt"))]
    if lacking:
        train_networks(takes, repertoire, folder, lacking, changes, genres)


def train_networks(
    takes: Mapping[str, Take],
    repertoire: cg.Repertoire,
    folder: Path,
    names: Sequence[str],
    changes: Mapping[str, Any],
    genres: Collection[str],
) -> None:
    """Train the networks `names`. The other arguments are those of `train`."""
    folder.mkdir(parents=True, exist_ok=True)
    seed, words = int(repertoire.provenance["seed"]), word_net(repertoire)
    learned = learned_takes(takes, repertoire)
    for name in names:
        config = rollout_config(str(repertoire.provenance["preset"]), **{**ABLATIONS[name], **changes})
        context = TrainingContext(folder / name, resume=True, report=show)
        data = learned
        if name in (WITH_GRAPH_DANCES, WITH_SYNTHESISED_SONGS):
            own = [m.take for m in own_takes(takes, repertoire)]
            dances = taught(repertoire, own, folder / f"{name}-plans", name, seed)
            data = [*learned, *as_learned([measure_take(dance) for dance in dances], repertoire)]
        elif name == AT_ACCENTS:
            data = as_learned([at_accents(m) for m in own_takes(takes, repertoire)], repertoire)
        data = [take for take in data if not genres or take.genre in genres]
        for net in train_rollouts(data, words, config, seed=seed, context=context):
            of_genre = f"{name}@{net.config.genre}" if config.by_genre else name
            torch.save(net.to_arrays()[1] | {"weights": net.state_dict()}, folder / f"{of_genre}.pt")


def taught(
    repertoire: cg.Repertoire, takes: Sequence[Take], folder: Path, name: str, seed: int
) -> list[Take]:
    """Graph dances to the takes' songs, or if `name` says so once to each, and to synthesised songs."""
    wanted = dances_to_teach(takes)
    if name == WITH_SYNTHESISED_SONGS:
        wanted = [one for one in wanted if one[2] == 0]
        songs = synthesised_songs((genre for _, genre, _ in wanted), folder / "songs")
        wanted += [(song, genre, 0) for song, genre in songs.items()]
    return graph_dances(repertoire, wanted, folder, beats=DEFAULT_TRACKER, seed=seed)


def synthesised_songs(genres: Iterable[str], folder: Path) -> dict[Path, str]:
    """Synthesised songs of those `genres` that the synthesiser has, written to `folder`, with their genres.

    Songs that are in the folder are not rendered again.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [
        (folder / f"{genre}-{i}.flac", genre, bpm, SEEDS_FROM + i)
        for genre in sorted(set(genres) & set(STYLES))
        for i, bpm in enumerate(np.linspace(*STYLES[genre].bpm, AGAIN_PER_GENRE))
    ]
    for path, genre, bpm, seed in wanted:
        if not path.exists():
            write_song(path, render_song(genre, bpm=bpm, duration_s=SONG_S, seed=seed))
    return {path: genre for path, genre, _, _ in wanted}


def as_learned(dances: Sequence[MeasuredTake], repertoire: cg.Repertoire) -> list[RolloutTake]:
    """Dances as the network is trained on them, by the motifs of the repertoire."""
    words, songs = word_net(repertoire), SongCache(keep_samples=True)
    segmented, vocabulary = words_of_dances(dances, repertoire.vocabulary, words, songs)
    return rollout_takes(dances, segmented, vocabulary, words, songs=songs)


def at_accents(measured: MeasuredTake) -> MeasuredTake:
    """The take with its counts moved to the accents that lie just beside them."""
    counts = measured.take.counts
    shifts_s = accent_shifts_s(measured.motion_beats_s, counts.times_s)
    moved = replace(counts, times_s=counts.times_s + shifts_s)
    return replace(measured, take=replace(measured.take, counts=moved))


def show(progress: TrainingProgress) -> None:
    print(progress.step, f"{progress.loss:.3f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("takes", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--steps", type=int, help="of every training, by default the preset's")
    parser.add_argument("--width", type=int, help="of the LSTM, by default the preset's")
    parser.add_argument("--learning-rate", type=float, help="of every training, by default its own")
    parser.add_argument("--genres", nargs="+", default=[], help="learned from, by default all")
    parser.add_argument("--networks", nargs="+", choices=list(ABLATIONS), default=list(ABLATIONS))
    given = parser.parse_args()
    torch.set_num_threads(1)
    takes = {take.name: take for take in import_takes(given.takes)}
    fields = ("steps", "width", "learning_rate")
    changes = {name: value for name in fields if (value := getattr(given, name)) is not None}
    for path in given.repertoires:
        repertoire, folder = cg.Repertoire.open(path), given.output / path.stem
        train(takes, repertoire, folder, given.networks, changes=changes, genres=given.genres)


if __name__ == "__main__":
    main()
