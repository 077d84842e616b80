"""Do the clips that a song selects differ from other clips in properties that people would notice?

    python research/style_selection.py dance-with-melody/ rep.h5 [more.h5] \\
        --only research/dance_with_melody_held_out.txt

Every second of a song that the repertoire was built without selects its nearest clips: by style alone, by
style, energy and density of steps (as a dance does), and at random. For the number of clips of a dance (512)
and for 50, the script prints the share of the genre of the song. Over the seconds of a song, it prints how
the size and the steps of the selected clips, ranked in their genres, follow the music (Spearman's
correlation, mean of the songs).

None of the measures is used for selection. Size is the volume of the convex hull times the speed relative to
the pelvis, steps are peaks of the speed of the ankles, loudness is the RMS of the samples, and onsets are
those of librosa. The last number is the share of the clips of two sections of one song that are the same.
"""

from __future__ import annotations

import argparse
from itertools import combinations
from pathlib import Path

import librosa
import numpy as np
import torch
from scipy.signal import find_peaks
from scipy.stats import spearmanr

import choreograph as cg
from choreograph.choreography.selection import energy_mismatch, select_clips, steps_mismatch
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SAMPLE_RATE_HZ, SEGMENT_FRAMES, SEGMENT_S
from choreograph.evaluation.metrics.energy_response import motion_size
from choreograph.motion.body import BODY_JOINTS
from choreograph.music.song import load_song
from choreograph.music.song_features import SongFeatures

GENRES = {"C": "cha-cha", "R": "rumba", "T": "tango", "W": "waltz"}
SIZES = (512, 50)
FEEL = 0.5  # as in a dance
ANKLES = [BODY_JOINTS.index(f"{side}_ankle") for side in ("left", "right")]
MIN_STEP_M_S, MIN_STEP_S = 0.4, 0.2
HOW = ("style", "style, energy, steps", "random")


def music(samples: np.ndarray, n_seconds: int) -> tuple[np.ndarray, np.ndarray]:
    """Level in dB and number of onsets (S,) of the 4 s from each second."""
    onsets_s = librosa.onset.onset_detect(y=samples, sr=SAMPLE_RATE_HZ, units="time")
    level, count = np.zeros(n_seconds), np.zeros(n_seconds)
    for second in range(n_seconds):
        part = samples[second * SAMPLE_RATE_HZ : (second + SEGMENT_S) * SAMPLE_RATE_HZ]
        level[second] = 10 * np.log10(np.mean(part.astype(np.float64) ** 2) + 1e-10)
        count[second] = np.sum((onsets_s >= second) & (onsets_s < second + SEGMENT_S))
    return level, count


def clips(repertoire: cg.Repertoire) -> tuple[np.ndarray, np.ndarray]:
    """Size and number of steps (N,) of the middle 4 s of every clip."""
    size, steps = np.zeros(repertoire.n_clips), np.zeros(repertoire.n_clips)
    for take in np.unique(repertoire.clip_take):
        pos = repertoire.body_pos_m(int(take)).astype(np.float64)
        speed, space = motion_size(pos, NET_FPS)
        ankles = np.linalg.norm(np.gradient(pos[:, ANKLES], axis=0), axis=-1) * NET_FPS  # (T, 2)
        peaks = np.concatenate(
            [find_peaks(a, MIN_STEP_M_S, distance=MIN_STEP_S * NET_FPS)[0] for a in ankles.T]
        )
        for clip in np.flatnonzero(repertoire.clip_take == take):
            start = repertoire.clip_start_frame[clip] + (CLIP_FRAMES - SEGMENT_FRAMES) // 2
            middle = slice(start, start + SEGMENT_FRAMES)
            size[clip] = (speed[middle] * space[middle]).mean()
            steps[clip] = np.sum((peaks >= start) & (peaks < start + SEGMENT_FRAMES))
    return size, steps


def select(features: SongFeatures, repertoire: cg.Repertoire, how: str, k: int) -> np.ndarray:
    """The clips (S, K) that each second selects."""
    rng = np.random.default_rng(0)
    if how == "random":
        return np.stack([rng.permutation(repertoire.n_clips)[:k] for _ in range(features.n_seconds)])

    def feel(second: int) -> np.ndarray:
        louder = float(features.energy[second : second + SEGMENT_S].mean() - features.energy.mean())
        density = float(features.onset_density[second])
        return FEEL * (
            energy_mismatch(louder, repertoire.clip_motion.liveliness_ranks)
            + steps_mismatch(density, repertoire.clip_motion.step_ranks)
        )

    return select_clips(
        features.style, features.beat_count, repertoire.clip_style, repertoire.clip_beat_count,
        candidates=k, beat_weight=repertoire.selection_beat_weight, penalty=feel if how == HOW[1] else None,
    )  # fmt: skip


def within_genre(values: np.ndarray, genre: np.ndarray) -> np.ndarray:
    """Values as their rank in their genre, so that a genre's own size tells nothing."""
    ranks = np.zeros(len(values))
    for name in np.unique(genre):
        inside = genre == name
        ranks[inside] = np.argsort(np.argsort(values[inside])) / inside.sum()
    return ranks


def shared(chosen: np.ndarray, features: SongFeatures) -> float:
    """Share of clips that the middles of two sections have in common, over all pairs of sections."""
    middles = 0.5 * (features.sections.bounds_s[1:] + features.sections.bounds_s[:-1])
    seconds = np.clip(middles.astype(int), 0, len(chosen) - 1)
    pairs = [len(np.intersect1d(chosen[a], chosen[b])) / chosen.shape[1] for a, b in combinations(seconds, 2)]
    return float(np.mean(pairs)) if pairs else float("nan")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("repertoires", type=Path, nargs="+")
    parser.add_argument("--only", type=Path, required=True, help="names of the songs to ask with")
    given = parser.parse_args()
    torch.set_num_threads(1)
    names = given.only.read_text(encoding="utf-8").split()
    songs = {name: load_song(given.data / name / "audio.mp3") for name in names}
    rows: dict[tuple[str, int], list[tuple[float, ...]]] = {(how, k): [] for how in HOW for k in SIZES}
    for path in given.repertoires:
        repertoire = cg.Repertoire.open(path)
        genre = np.array([take.credits.genre for take in repertoire.takes])[repertoire.clip_take]
        size, steps = (within_genre(values, genre) for values in clips(repertoire))
        for name, song in songs.items():
            features, _ = analyse_song(song, repertoire)
            level, onsets = music(song.samples, features.n_seconds)
            for how, k in rows:
                chosen = select(features, repertoire, how, k)
                rows[how, k].append(
                    (
                        float(np.mean(genre[chosen] == GENRES[name.split("_")[1]])),
                        spearmanr(size[chosen].mean(axis=1), level)[0],
                        spearmanr(steps[chosen].mean(axis=1), onsets)[0],
                        shared(chosen, features),
                    )
                )
    print("| clips | selected by | own genre | size ~ loudness | steps ~ onsets | shared by two sections |")
    print("| --- | --- | --- | --- | --- | --- |")
    for (how, k), values in sorted(rows.items(), key=lambda item: -item[0][1]):
        print(f"| {k} | {how} |", " | ".join(f"{v:.2f}" for v in np.nanmean(values, axis=0)), "|")


if __name__ == "__main__":
    main()
