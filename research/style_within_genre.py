"""Does the style of a part of a song select clips within its genre? By songs that were held out.

    python -m research.style_within_genre path/to/dance-with-melody q0.h5 q1.h5

Each repertoire was built without the songs of dance_with_melody_held_out.txt. For every second of a song,
the cost `genre` of all clips of its genre is divided into a part of the second, a part of the clip and their
interaction. Only the last two choose among clips, and only the interaction responds to the music. Printed is
the share of the interaction in all of the variance, its share in what chooses among clips, and the same of
random directions of the song's vectors, which is chance. Then, every second of the song retrieves clips of
its own take, which training never had. A hit is a clip at most 2 s away among the nearest tenth, which chance
hits as often as printed. Dancers of dance-with-melody were not recorded in step with their songs, but their
sections follow one another with the song's.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.core.numerics import Floats
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SEGMENT_FRAMES
from choreograph.nets.style import StyleNets
from choreograph.nets.style_training import StyleTake
from content.style_networks import style_takes

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
NEAR_S = 2
SHARE = 0.1


def distances(music: Floats, clips: Floats) -> Floats:
    """Distances (S, N) of the vectors of seconds (S, D) and of clips (N, D)."""
    away: Floats = np.linalg.norm(music[:, None].astype(np.float64) - clips[None], axis=-1)
    return away


def interaction(away: Floats) -> tuple[float, float]:
    """Shares of the interaction in the variance of distances (S, N), with and without the seconds' part."""
    of_seconds, of_clips = away.mean(axis=1, keepdims=True), away.mean(axis=0, keepdims=True)
    rest = away - of_seconds - of_clips + away.mean()
    return float(rest.var() / away.var()), float(rest.var() / (rest.var() + of_clips.var()))


def hits(away: Floats) -> tuple[float, float]:
    """How often a clip of the same time is among the nearest tenth, from distances (S, N), and chance."""
    n_nearest = max(1, round(SHARE * away.shape[1]))
    nearest = np.argsort(away, axis=1)[:, :n_nearest]
    seconds = np.arange(len(away))[:, None]
    found = (np.abs(nearest - seconds) <= NEAR_S).any(axis=1)
    n_near = (np.abs(np.arange(away.shape[1]) - seconds) <= NEAR_S).sum(axis=1)  # (S,)
    missed = np.ones(len(away))
    for drawn in range(n_nearest):
        missed *= np.clip((away.shape[1] - n_near - drawn) / (away.shape[1] - drawn), 0.0, 1.0)
    return float(found.mean()), float(1.0 - missed.mean())


def row_of(
    take: StyleTake, nets: StyleNets, repertoire: cg.Repertoire, rng: np.random.Generator
) -> list[float]:
    """The scores of one held-out take."""
    starts = np.arange(0, len(take.body_pos_m) - CLIP_FRAMES + 1, NET_FPS)  # of its clips
    motion = nets.embed_motion(take.body_pos_m, starts + SEGMENT_FRAMES // 2)
    music = nets.embed_music(take.log_mel, take.rhythm, np.arange(len(starts)) + 2.0)  # their middle 4 s
    genres = np.array([info.credits.genre for info in repertoire.takes])[repertoire.clip_take]
    of_genre = repertoire.clip_style[genres == take.genre]
    turned = rng.permuted(music - music.mean(axis=0), axis=1) + music.mean(axis=0)
    return [*interaction(distances(music, of_genre)), interaction(distances(turned, of_genre))[1],
            *hits(distances(music, motion))]  # fmt: skip


def main() -> None:
    """Print a line for each song and repertoire, and the means."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    given = parser.parse_args()
    takes = style_takes([given.data / name for name in HELD_OUT.read_text(encoding="utf-8").split()])
    print("song, interaction of all, of what chooses, chance, hits, chance")
    for path in given.repertoires:
        repertoire = cg.Repertoire.open(path)
        net = repertoire.net("style")
        nets, rng = StyleNets.from_arrays(net.weights, net.config), np.random.default_rng(0)
        rows = [row_of(take, nets, repertoire, rng) for take in takes]
        for take, row in zip(takes, rows, strict=True):
            print(f"{path.name} {take.name:12s} {take.genre:8s}", *(f"{value:.2f}" for value in row))
        print(f"{path.name} mean", *(f"{value:.3f}" for value in np.mean(rows, axis=0)), flush=True)


if __name__ == "__main__":
    main()
