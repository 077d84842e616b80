"""Trains the network that counts music: `content/music_counting.py`.

    python research/train_music_counts.py songs/ -o clean.npz [--seed N] [--songs N] [--steps N] \\
        [--without-genres salsa tango …]
    python research/train_music_counts.py songs/ -o research.npz --start clean.npz \\
        --real dance-with-melody/ --choreographies choreonet/choreographies.json [--fold 0]

Songs are those of `content.songs.training_songs`. Their log-mel spectrograms are kept in the folder `songs/`,
where a second training finds them. If a genre is left out, so are the songs with its drums.

Real songs are used if two trackers agree on their beats (F-score of 0.9 at 70 ms) at the tempo of their
choreography, and if their tracked metre is that of their genre. Their labels are those of the first tracker.
`--fold N` leaves out every third real song from the N-th on, for cross-validation.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soxr
from numpy.typing import NDArray

from choreograph.core.counts import Counts
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.music.bars import track_bars
from choreograph.music.beats import get_beat_tracker
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song
from choreograph.nets.music_counts import read_music_counts, write_music_counts
from choreograph.nets.training import TrainingContext, TrainingProgress
from content.count_networks import music_counts_config
from content.music_counting import CountedMel, train_music_counts
from content.songs.synthesis.song import STYLES
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.training_songs import FIRST_SEED, drawn_song, style_of

N_SONGS = 480
FOLDS = 3
THREES = 0.4  # share of the training excerpts
REAL_SHARE = 0.3
AGREEMENT, SAME_TEMPO = 0.9, 0.05
# ChoreoNet's lists do not fit these songs (a tenth to two fifths off).
MISCOUNTED = {"DANCE_C_4", "DANCE_C_8", "DANCE_R_7", "DANCE_T_5"}
_PER_FILE = 40


@dataclass(frozen=True, eq=False)
class TrainingSong:
    """A synthetic song to train on."""

    mel: CountedMel
    genres: frozenset[str]  # of its parts and of its drums


def synthetic_songs(folder: Path, n_songs: int) -> Iterator[TrainingSong]:
    """Songs from `FIRST_SEED` on, rendered unless the folder has them."""
    folder.mkdir(parents=True, exist_ok=True)
    for first in range(FIRST_SEED, FIRST_SEED + n_songs, _PER_FILE):
        path = folder / f"{first}.npz"
        if not path.exists():
            arrays = {}
            for seed in range(first, first + _PER_FILE):
                song = drawn_song(seed)
                mono = soxr.resample(song.samples.mean(axis=1), RATE_HZ, SAMPLE_RATE_HZ)
                arrays[f"{seed}.mel"] = log_mel(mono).astype(np.float16)
                arrays[f"{seed}.t"], arrays[f"{seed}.n"] = song.counts.times_s, song.counts.numbers
                arrays[f"{seed}.k"] = np.array([song.genre, song.kind, str(song.counts.metre)])
            np.savez(path, **arrays)
            print(f"rendered {path}", flush=True)
        with np.load(path) as stored:
            for seed in range(first, first + _PER_FILE):
                genre, kind, metre = stored[f"{seed}.k"]
                counts = Counts(stored[f"{seed}.t"], stored[f"{seed}.n"], int(metre))
                genres = {name for name in STYLES if name in style_of(str(genre), str(kind), seed=seed).name}
                yield TrainingSong(CountedMel(stored[f"{seed}.mel"], counts), frozenset(genres))


@dataclass(frozen=True, eq=False)
class RealSong:
    """A real song, and the counts that two trackers agree on."""

    name: str
    mel: CountedMel


def real_songs(folder: Path, data: Path, choreographies: Path) -> list[RealSong]:
    """The songs of dance-with-melody that can be trusted, kept in the folder beside the synthetic ones."""
    path = folder / "real.npz"
    if not path.exists():
        arrays = {}
        for song in trusted_songs(data, choreographies):
            counts = song.mel.counts
            arrays[f"{song.name}.mel"] = song.mel.log_mel
            arrays[f"{song.name}.t"], arrays[f"{song.name}.n"] = counts.times_s, counts.numbers
        np.savez(path, **arrays)
    with np.load(path) as stored:
        names = sorted(name.removesuffix(".mel") for name in stored if name.endswith(".mel"))
        counted = {n: Counts(stored[f"{n}.t"], stored[f"{n}.n"], metre_of(n)) for n in names}
        return [RealSong(n, CountedMel(stored[f"{n}.mel"], counted[n])) for n in names]


def trusted_songs(folder: Path, choreographies: Path) -> Iterator[RealSong]:
    """Real songs whose beats two trackers agree on, with the labels of the first."""
    bpm = counted_tempi(choreographies)
    for path in sorted(folder.glob("DANCE_*/audio.*")):
        name = path.parent.name
        song = load_song(path)
        mel = log_mel(song.samples)
        first, second = (get_beat_tracker(tracker).beats(song, mel) for tracker in ("tempo-path", "librosa"))
        counts = track_bars(song.samples, mel, first)
        tempo = 60.0 / np.median(np.diff(first))
        same = name not in bpm or abs(tempo / bpm[name] - 1.0) < SAME_TEMPO
        if f_score(first, second) >= AGREEMENT and same and counts.metre == metre_of(name):
            yield RealSong(name, CountedMel(mel.astype(np.float16), counts))


def counted_tempi(choreographies: Path) -> dict[str, float]:
    """Counts a minute by ChoreoNet's lists, by song."""
    rows = json.loads(choreographies.read_text(encoding="utf-8"))
    return {
        row["name"]: 60.0 * 25.0 * sum(row["durations"]) / (row["end_pos"] - row["start_pos"])
        for row in rows
        if row["name"] not in MISCOUNTED
    }


def metre_of(name: str) -> int:
    """By genre: waltzes are in three."""
    return 3 if name.startswith("DANCE_W") else 4


def shares(songs: list[CountedMel], n_real: int) -> NDArray[np.float64]:
    """How often each song is drawn. Songs in three and real songs (the last ones) are drawn more often."""
    threes = np.array([song.counts.metre == 3 for song in songs])
    share = np.where(threes, THREES / max(1, threes.sum()), (1 - THREES) / max(1, (~threes).sum()))
    if n_real:
        share[-n_real:] *= REAL_SHARE / share[-n_real:].sum()
        share[:-n_real] *= (1 - REAL_SHARE) / share[:-n_real].sum()
    return share / share.sum()


def report(progress: TrainingProgress) -> None:
    if progress.step % 20 == 0 or progress.step == progress.n_steps:
        print(f"{progress.step}: {progress.loss:.3f}, {progress.seconds_left:.0f} s left", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path, help="of rendered songs")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--songs", type=int, default=N_SONGS)
    parser.add_argument("--steps", type=int, default=music_counts_config().steps)
    parser.add_argument("--learning-rate", type=float, default=music_counts_config().learning_rate)
    parser.add_argument("--without-genres", nargs="*", default=[], choices=list(STYLES))
    parser.add_argument("--start", type=Path, help="weights to begin with")
    parser.add_argument("--real", type=Path, help="dance-with-melody")
    parser.add_argument("--choreographies", type=Path)
    parser.add_argument("--fold", type=int, choices=range(FOLDS))
    given = parser.parse_args()
    songs = [
        song.mel
        for song in synthetic_songs(given.folder, given.songs)
        if not song.genres & set(given.without_genres)
    ]
    about = {"songs": len(songs), "seed": given.seed, "without_genres": given.without_genres, "real": []}
    if given.real:
        real = real_songs(given.folder, given.real, given.choreographies)
        kept = [song for i, song in enumerate(real) if given.fold is None or i % FOLDS != given.fold]
        about["real"] = [song.name for song in kept]
        songs += [song.mel for song in kept]
    print(about, flush=True)
    config = music_counts_config(steps=given.steps, learning_rate=given.learning_rate)
    net = train_music_counts(
        songs, config, seed=given.seed, weights=shares(songs, len(about["real"])),
        context=TrainingContext(folder=given.output.with_suffix(""), resume=True, report=report),
        pretrained=read_music_counts(given.start)[0].to_arrays()[0] if given.start else None,
    )  # fmt: skip
    write_music_counts(given.output, net, about)


if __name__ == "__main__":
    main()
