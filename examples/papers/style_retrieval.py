"""Does a song that training never saw find dances of its own genre?

The style networks are trained on all takes but those of the songs left out. Every second of a song left out
selects its 50 best clips among the other songs of a fixed pool. Printed is the share of the song's genre
among them, averaged per genre, then over genres: for all the pool's clips, and with equally many clips a
genre, where chance is one third.

    python examples/papers/style_retrieval.py path/to/dance-with-melody --seeds 2 [--from-scratch]
        [--loss paper]

As in `build-db`, training starts from networks trained on the built-in takes and these. The built-in networks
were trained on most of the pool, so they are trained again without the songs left out, one of each genre at a
time. `--from-scratch` starts from random weights and leaves out single songs.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from scipy.signal import resample_poly

from choreograph.audio.song import load_song
from choreograph.features.mel import log_mel
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.features.tempogram import RHYTHM_FPS, rhythm_features
from choreograph.importers import dance_with_melody
from choreograph.metrics.retrieval import chance_precision, mean_over_groups, precision_at_k
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.nets.style.config import STYLE_LOSSES, StyleConfig, style_config
from choreograph.nets.style.data import StyleTake, count_beats
from choreograph.nets.style.model import StyleNets
from choreograph.nets.style.train import train_style
from choreograph.selection import select_clips
from choreograph.starter.takes import render_spec, take_specs
from choreograph.synthesis.songs.voices import RATE_HZ
from choreograph.takes import Take
from choreograph.timebase import CLIP_FRAMES, MUSIC_FPS, NET_FPS, SAMPLE_RATE_HZ, SEGMENT_FRAMES, SEGMENT_S

# All cha-chas and rumbas with motion, and six waltzes chosen before any result was seen.
POOL = (
    *(f"DANCE_C_{n}" for n in (2, 4, 6, 8)),
    *(f"DANCE_R_{n}" for n in (2, 3, 4, 7, 8)),
    *(f"DANCE_W_{n}" for n in (1, 6, 11, 16, 23, 28)),
)
SELECTED = 50
N_FOLDS = 5  # no more than two songs of a genre are left out together


def style_take(take: Take) -> StyleTake:
    """A take as the style networks learn from it."""
    samples = load_song(take.song_path).samples
    names = (take.name, take.song_name, take.credits.genre)
    return learned_from(names, take.motion, samples, take.song_start_s)


def built_in_takes() -> list[StyleTake]:
    """The starter's own takes, rendered again."""
    made = []
    for spec in take_specs():
        song, dance = render_spec(spec)
        mono = resample_poly(song.samples.mean(axis=1), 1, RATE_HZ // SAMPLE_RATE_HZ)
        made.append(learned_from((spec.name, spec.name, spec.genre), dance.motion, mono, 0.0))
    return made


def folds(takes: dict[str, StyleTake]) -> list[tuple[str, ...]]:
    """The pool in parts to be left out together, the songs of each genre dealt out in turn."""
    dealt: list[list[str]] = [[] for _ in range(N_FOLDS)]
    for genre in sorted({takes[name].genre for name in POOL}):
        for i, name in enumerate(name for name in POOL if takes[name].genre == genre):
            dealt[i % N_FOLDS].append(name)
    return [tuple(names) for names in dealt]


def learned_from(
    names: tuple[str, str, str], motion: Motion, samples: np.ndarray, song_start_s: float
) -> StyleTake:
    """What the networks see of a motion and its song; `names` are the take's, the song's and the genre's."""
    body = body_pos_m(motion.resampled(NET_FPS)).astype(np.float32)
    mel = log_mel(samples)
    first = round(song_start_s * MUSIC_FPS)
    n_rows = len(body) * RHYTHM_FPS // NET_FPS + 1
    return StyleTake(
        *names,
        mel[first : first + len(body) * MUSIC_FPS // NET_FPS],
        rhythm_features(mel, start_s=song_start_s)[:n_rows],
        body,
        motion_beat_times_s(body, NET_FPS),
    )


def shares(
    nets: StyleNets, config: StyleConfig, song: StyleTake, others: list[StyleTake]
) -> tuple[float, float, float]:
    """Share of the song's genre among selected clips: of all, of equally many a genre, and by chance."""
    starts_s = np.arange(max(1, int(len(song.log_mel) / MUSIC_FPS) - SEGMENT_S + 1))
    song_features = nets.embed_music(song.log_mel, song.rhythm, starts_s)
    beat_count = nets.predict_beat_count(song_features)
    styles, counts, genres = [], [], []
    for take in others:
        middle = np.arange(0, len(take.body_pos_m) - CLIP_FRAMES + 1, NET_FPS) + SEGMENT_FRAMES // 2
        styles.append(nets.embed_motion(take.body_pos_m, middle))
        counts.append(count_beats(take.motion_beat_times_s, middle / NET_FPS))
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
            song_features,
            beat_count,
            style[clips],
            count[clips],
            candidates=SELECTED,
            beat_weight=config.beat_weight / config.style_weight,
        )
        return float(precision_at_k(own[clips][chosen], SELECTED).mean())

    return share(np.arange(len(genre))), share(balanced), float(chance_precision(own.sum(), len(own)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--preset", default="small")
    parser.add_argument("--loss", choices=STYLE_LOSSES, default="contrastive")
    parser.add_argument("--music-inputs", default="mel+rhythm")
    parser.add_argument("--steps", type=int)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--from-scratch", action="store_true", help="start from random weights")
    options = parser.parse_args()
    torch.set_num_threads(1)
    changes = {"loss": options.loss, "music_inputs": options.music_inputs}
    if options.steps:
        changes["steps"] = options.steps
    config = style_config(options.preset, **changes)
    takes = [style_take(take) for take in dance_with_melody.read(options.data)]
    by_name = {take.name: take for take in takes}
    means = []
    built_in = [] if options.from_scratch else built_in_takes()
    left_out = [(name,) for name in POOL] if options.from_scratch else folds(by_name)
    for seed in range(options.seeds):
        rows = {}
        for names in left_out:
            songs = {by_name[name].song_name for name in names}
            trained_on = [take for take in takes if take.song_name not in songs]
            pretrained = None
            if built_in:
                all_takes = [*built_in, *trained_on]
                longer = style_config(
                    options.preset, n_songs=len({t.song_name for t in all_takes}), **changes
                )
                pretrained = train_style(all_takes, longer, seed=seed).to_arrays()[0]
            nets = train_style(trained_on, config, seed=seed, pretrained=pretrained)
            for name in names:
                others = [by_name[n] for n in POOL if n != name]
                rows[name] = shares(nets, config, by_name[name], others)
                values = rows[name]
                print(
                    f"seed {seed} {name:10s} all {values[0]:.2f}  balanced {values[1]:.2f}"
                    f"  chance {values[2]:.2f}",
                    flush=True,
                )
        genres = [by_name[name].genre for name in rows]
        for genre in sorted(set(genres)):
            values = np.mean(
                [row for row, g in zip(rows.values(), genres, strict=True) if g == genre], axis=0
            )
            print(f"seed {seed} {genre:10s}", *(f"{v:.3f}" for v in values))
        means.append([mean_over_groups(column, genres) for column in np.transpose(list(rows.values()))])
        print(f"seed {seed} mean      ", *(f"{v:.3f}" for v in means[-1]), flush=True)
    print("all, balanced, chance over seeds:", *(f"{v:.3f}" for v in np.mean(means, axis=0)))


if __name__ == "__main__":
    main()
