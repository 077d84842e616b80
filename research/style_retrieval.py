"""Does a song that training never saw find dances of its own genre?

    python research/style_retrieval.py path/to/dance-with-melody --work FOLDER --seeds 0 1 2
        [--pretrained clean|research|nothing] [--loss paper] [--music-inputs mel]

Songs are left out of everything, one of each genre at a time. As in `build-db`, style begins with shipped
networks and goes on with the takes that are left: `clean` ones are trained on built-in takes and rendered
songs alone, `research` ones also on the takes that are left, as the shipped ones on all. Every second of a
song left out selects its 50 best clips among the other songs of a fixed pool. Printed is the share of the
song's genre among them, averaged per genre, then over genres: for all the pool's clips, and with equally many
clips a genre, where chance is one third. Songs of dance-with-melody without a take, which are in no training,
are asked, too. Checkpoints are kept in FOLDER, for each way a folder of its own.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from choreograph.choreography.selection import select_clips
from choreograph.core.timebase import CLIP_FRAMES, MUSIC_FPS, NET_FPS, SEGMENT_FRAMES, SEGMENT_S
from choreograph.library.songs import DEFAULT_BEATS, song_counts
from choreograph.music.mel import log_mel
from choreograph.music.rhythm import rhythm_features
from choreograph.music.song import load_song
from choreograph.nets.configs import MUSIC_INPUTS, STYLE_LOSSES, StyleConfig, style_config
from choreograph.nets.style import StyleNets
from choreograph.nets.style_training import StyleSong, StyleTake, train_style
from choreograph.nets.training import TrainingContext
from content.style_networks import built_in_style_takes, shipped_style_config, style_songs, style_takes
from research.retrieval import chance_precision, mean_over_groups, precision_at_k

# All cha-chas and rumbas with motion, and six waltzes chosen before any result was seen.
POOL = (
    *(f"DANCE_C_{n}" for n in (2, 4, 6, 8)),
    *(f"DANCE_R_{n}" for n in (2, 3, 4, 7, 8)),
    *(f"DANCE_W_{n}" for n in (1, 6, 11, 16, 23, 28)),
)
WITHOUT_TAKE = {"DANCE_C_1": "cha-cha", "DANCE_C_3": "cha-cha", "DANCE_R_6": "rumba", "DANCE_R_10": "rumba"}
SELECTED = 50
N_FOLDS = 5  # no more than two songs of a genre are left out together
BEAT_WEIGHT = StyleConfig().beat_weight / StyleConfig().style_weight


def folds(takes: dict[str, StyleTake]) -> list[tuple[str, ...]]:
    """The pool in parts to be left out together, the songs of each genre dealt out in turn."""
    dealt: list[list[str]] = [[] for _ in range(N_FOLDS)]
    for genre in sorted({takes[name].genre for name in POOL}):
        for i, name in enumerate(name for name in POOL if takes[name].genre == genre):
            dealt[i % N_FOLDS].append(name)
    return [tuple(names) for names in dealt]


def song_alone(data: Path, name: str, genre: str) -> StyleSong:
    """A song without a take."""
    song = load_song(data / name / "audio.mp3")
    mel = log_mel(song.samples)
    return StyleSong(name, genre, mel, rhythm_features(mel, song_counts(song, mel, DEFAULT_BEATS)))


def trained(
    given: argparse.Namespace, takes: list[StyleTake], built_in: list[StyleTake], songs: list[StyleSong],
    *, seed: int, fold: int,
) -> StyleNets:  # fmt: skip
    """Networks as a build makes them of these takes."""
    changes = {"loss": given.loss, "music_inputs": given.music_inputs}
    begun = None
    if given.pretrained != "nothing":
        recorded = takes if given.pretrained == "research" else []
        name = f"{seed}" if given.pretrained == "clean" else f"{seed}-{fold}"
        context = TrainingContext(given.work / f"{given.pretrained}-{name}", resume=True)
        config = shipped_style_config(**changes)
        shipped = train_style([*built_in, *recorded], config, seed=seed, songs=songs, context=context)
        begun = shipped.to_arrays()[0]
    config = style_config(given.preset, n_songs=len({take.song_name for take in takes}), **changes)
    return train_style(takes, config, seed=seed, pretrained=begun)


def shares(nets: StyleNets, song: StyleSong, others: list[StyleTake]) -> tuple[float, float, float]:
    """Share of the song's genre among selected clips: of all, of equally many a genre, and by chance."""
    starts_s = np.arange(max(1, int(len(song.log_mel) / MUSIC_FPS) - SEGMENT_S + 1))
    wanted = nets.embed_music(song.log_mel, song.rhythm, starts_s)
    beat_count = nets.predict_beat_count(wanted)
    styles, counts, genres = [], [], []
    for take in others:
        middle = np.arange(0, len(take.body_pos_m) - CLIP_FRAMES + 1, NET_FPS) + SEGMENT_FRAMES // 2
        styles.append(nets.embed_motion(take.body_pos_m, middle))
        counts.append(take.beat_counts(middle * 2 // NET_FPS))
        genres += [take.genre] * len(middle)
    style, count, genre = np.concatenate(styles), np.concatenate(counts), np.array(genres)
    own = genre == song.genre
    smallest = min(np.sum(genre == g) for g in set(genres))
    rng = np.random.default_rng(0)
    balanced = np.concatenate(
        [rng.choice(np.flatnonzero(genre == g), smallest, replace=False) for g in sorted(set(genres))]
    )

    def share(clips: np.ndarray) -> float:
        chosen = select_clips(
            wanted, beat_count, style[clips], count[clips], candidates=SELECTED, beat_weight=BEAT_WEIGHT
        )
        return float(precision_at_k(own[clips][chosen], SELECTED).mean())

    return share(np.arange(len(genre))), share(balanced), float(chance_precision(own.sum(), len(own)))


def results(
    given: argparse.Namespace, by_name: dict[str, StyleTake], alone: list[StyleSong],
    built_in: list[StyleTake], songs: list[StyleSong], seed: int,
) -> Iterator[tuple[StyleSong, tuple[float, float, float]]]:  # fmt: skip
    """Shares of every song left out, and of the songs without a take by the networks of each fold."""
    for fold, names in enumerate(folds(by_name)):
        out = {by_name[name].song_name for name in names}
        takes = [take for take in by_name.values() if take.song_name not in out]
        nets = trained(given, takes, built_in, songs, seed=seed, fold=fold)
        for song in (*(by_name[name] for name in names), *alone):
            yield song, shares(nets, song, [by_name[n] for n in POOL if n not in (song.name, *out)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--work", type=Path, required=True, help="folder of rendered takes and checkpoints")
    parser.add_argument("--preset", default="small")
    parser.add_argument("--pretrained", choices=("clean", "research", "nothing"), default="clean")
    parser.add_argument("--loss", choices=STYLE_LOSSES, default=StyleConfig.loss)
    parser.add_argument("--music-inputs", choices=MUSIC_INPUTS, default=StyleConfig.music_inputs)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    given = parser.parse_args()
    torch.set_num_threads(1)
    by_name = {take.name: take for take in style_takes([given.data])}
    alone = [song_alone(given.data, name, genre) for name, genre in WITHOUT_TAKE.items()]
    begins = given.pretrained != "nothing"
    built_in = built_in_style_takes(given.work / "takes") if begins else []
    songs = style_songs() if begins else []
    means = []
    for seed in given.seeds:
        rows, without = [], []
        for song, values in results(given, by_name, alone, built_in, songs, seed):
            (without if song.name in WITHOUT_TAKE else rows).append((song, values))
            print(f"seed {seed} {song.name:10s}", *(f"{v:.2f}" for v in values), flush=True)
        genres = [song.genre for song, _ in rows]
        for genre in sorted(set(genres)):
            of_genre = np.mean([values for song, values in rows if song.genre == genre], axis=0)
            print(f"seed {seed} {genre:10s}", *(f"{v:.3f}" for v in of_genre))
        means.append(
            [mean_over_groups(np.array(column), genres) for column in zip(*(v for _, v in rows), strict=True)]
        )
        print(f"seed {seed} mean      ", *(f"{v:.3f}" for v in means[-1]))
        print(
            f"seed {seed} no take   ",
            *(f"{v:.3f}" for v in np.mean([v for _, v in without], axis=0)),
            flush=True,
        )
    print("all, balanced, chance over seeds:", *(f"{v:.3f}" for v in np.mean(means, axis=0)))
    print("standard deviation:", *(f"{v:.3f}" for v in np.std(means, axis=0)))


if __name__ == "__main__":
    main()
