"""Beats and bars by trackers and networks, on unseen synthetic songs and on real songs.

    python research/music_counts.py dance-with-melody/ choreonet/ -o results.md \\
        --weights clean0.npz clean1.npz … without0.npz … research0.npz research1.npz research2.npz

Weights are those of `research/train_music_counts.py`. Their files hold what they were trained on. Networks
that were trained on every genre are evaluated on unseen songs. A network that was trained without some genres
is evaluated on songs of those genres, and one that was trained on real songs on the real songs that it was
not trained on. Columns are means over networks. Those of networks that were trained on every genre have the
spread (standard deviation) over them.

Synthetic songs have true beats and bars. They are songs of every kind in a third of the genres, none with the
drums of another genre, salsa at 160 to 200 BPM, waltz at 150 to 190 BPM, and the benchmark songs. "Level"
means that the median tempo is within a quarter of an octave of the true one. The metre of real songs is known
from their genre, and their tempo from the number of counts per second in the choreographies of ChoreoNet
(within 5 %). Beats in the silence before the first and after the last true one are left out, as in
`choreograph.evaluation.metrics.counts`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from runpy import run_path

import numpy as np
import soxr
from numpy.typing import NDArray

from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.core.numerics import Floats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.music.bar_pointer import decode_counts
from choreograph.music.bars import track_bars
from choreograph.music.beats import librosa_beats, tempo_path_beats
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song
from choreograph.nets.music_counts import (
    POINTER,
    MusicCounts,
    activated_beats,
    network_beats,
    read_music_counts,
)
from content.songs.known_songs import BENCHMARK_SONGS
from content.songs.synthesis.song import STYLES, render_song
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.training_songs import FIRST_UNSEEN_SEED, KINDS, counted_song

Method = Callable[[NDArray[np.float32], NDArray[np.float32]], Counts]  # of samples and log-mel

LEVEL_OCTAVES, SAME_TEMPO = 0.25, 0.05
AT_THEIR_TEMPO = {
    "salsa, 160-200 BPM": ("salsa", 160, 200),
    "Viennese waltz, 150-190 BPM": ("waltz", 150, 190),
}
N_AT_THEIR_TEMPO = 8
ROUNDS = 20  # of the chance level


@dataclass(frozen=True, eq=False)
class TrueSong:
    """A song, and what is true of it."""

    name: str
    group: str  # kind
    genre: str
    samples: NDArray[np.float32]  # (S,) mono at 22.05 kHz
    truth: Counts


@dataclass(frozen=True, eq=False)
class RealSong:
    """A real song, with nan if its tempo is not known."""

    name: str
    samples: NDArray[np.float32]
    metre: int
    bpm: float


def true_songs() -> Iterator[TrueSong]:
    seed = FIRST_UNSEEN_SEED
    for index, kind in enumerate(KINDS):
        for genre in list(STYLES)[index % 3 :: 3]:
            song = counted_song(genre, kind, seed=seed, others=())
            yield TrueSong(f"{kind} {genre} {seed}", kind, genre, mono(song.samples), song.counts)
            seed += 1
    rng = np.random.default_rng(FIRST_UNSEEN_SEED)
    for group, (genre, slowest, fastest) in AT_THEIR_TEMPO.items():
        for _ in range(N_AT_THEIR_TEMPO):
            rendered = render_song(genre, bpm=rng.uniform(slowest, fastest), duration_s=50.0, seed=seed)
            yield true_song(f"{group} {seed}", group, genre, rendered)
            seed += 1
    for bench in BENCHMARK_SONGS:
        yield true_song(bench.name, "benchmark songs", bench.genre, bench.render())


def true_song(name: str, group: str, genre: str, song) -> TrueSong:
    numbers = numbers_in_bar(len(song.beat_times_s), song.beats_per_bar)
    return TrueSong(
        name, group, genre, mono(song.samples), Counts(song.beat_times_s, numbers, song.beats_per_bar)
    )


def mono(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    return soxr.resample(samples.mean(axis=1), RATE_HZ, SAMPLE_RATE_HZ)


def real_songs(folder: Path, choreonet: Path) -> Iterator[RealSong]:
    beside = run_path(str(Path(__file__).with_name("train_music_counts.py")))
    bpm = beside["counted_tempi"](choreonet / "choreographies.json")
    paths = {path.parent.name: path for path in sorted(folder.glob("DANCE_*/audio.*"))}
    for path in sorted((choreonet / "songs").glob("*.mp3")):
        paths.setdefault(f"DANCE_{path.stem}", path)
    for name, path in paths.items():
        yield RealSong(name, load_song(path).samples, beside["metre_of"](name), bpm.get(name, np.nan))


def with_bars(samples: NDArray[np.float32], mel: NDArray[np.float32], beats_s: Floats) -> Counts:
    beats_s = beats_s[beats_s < len(samples) / SAMPLE_RATE_HZ]
    return track_bars(samples, mel, beats_s)


METHODS: dict[str, Method] = {
    "tempo path": lambda samples, mel: with_bars(samples, mel, tempo_path_beats(mel)),
    "librosa": lambda samples, mel: with_bars(
        samples, mel, librosa_beats(mel, len(samples) / SAMPLE_RATE_HZ)
    ),
}
NETWORK_METHODS: dict[str, Callable[..., Counts]] = {
    "network": lambda net, samples, mel: with_bars(samples, mel, network_beats(mel, net)),
    "network, its own bars": lambda net, samples, mel: decode_counts(net.curves(mel).phases, POINTER).counts,
    "network in tempo path": lambda net, samples, mel: with_bars(
        samples, mel, activated_beats(net.curves(mel), mel)
    ),
}


@dataclass(frozen=True, eq=False)
class Weights:
    """A trained network, and what it was trained on."""

    net: MusicCounts
    without: frozenset[str]  # genres
    real: frozenset[str]  # songs

    @classmethod
    def read(cls, path: Path) -> Weights:
        net, about = read_music_counts(path)
        return cls(net, frozenset(about["without_genres"]), frozenset(about["real"]))


def methods(weights: Sequence[Weights]) -> dict[str, list[tuple[Method, Weights | None]]]:
    """By the name of a column, what is averaged in it."""
    columns: dict[str, list[tuple[Method, Weights | None]]] = {k: [(m, None)] for k, m in METHODS.items()}
    groups = {
        "": [w for w in weights if not w.without and not w.real],
        ", genre left out": [w for w in weights if w.without],
        ", research": [w for w in weights if w.real],
    }
    for note, chosen in groups.items():
        for name, method in NETWORK_METHODS.items():
            if chosen and (not note or method is NETWORK_METHODS["network"]):
                columns[name + note] = [(partial(method, w.net), w) for w in chosen]
    return columns


def scores(found: Counts, truth: Counts) -> dict[str, float]:
    tempo = (
        np.median(np.diff(found.times_s)) / np.median(np.diff(truth.times_s)) if len(found) > 2 else np.nan
    )
    return {
        "beats": f_score(judged(found.times_s, truth), truth.times_s),
        "downbeats": f_score(judged(found.downbeat_times_s, truth), truth.downbeat_times_s),
        "metre": float(found.metre == truth.metre),
        "level": float(abs(np.log2(tempo)) < LEVEL_OCTAVES),
    }


def judged(times_s: Floats, truth: Counts) -> Floats:
    """Those that are no more than half a beat outside the true counts, where there is silence."""
    half_s = 0.5 * np.median(np.diff(truth.times_s))
    return times_s[(times_s > truth.times_s[0] - half_s) & (times_s < truth.times_s[-1] + half_s)]


def chance(found: Counts, truth: Counts, duration_s: float, rng: np.random.Generator) -> dict[str, float]:
    """Scores of the same beats, shifted circularly in the song."""
    rows = []
    for shift_s in rng.uniform(1.0, duration_s - 1.0, ROUNDS):
        beats, downs = (np.sort((t + shift_s) % duration_s) for t in (found.times_s, found.downbeat_times_s))
        rows.append((f_score(beats, truth.times_s), f_score(downs, truth.downbeat_times_s)))
    beats_f, downbeats_f = np.mean(rows, axis=0)
    return {"beats": beats_f, "downbeats": downbeats_f}


def synthetic_rows(columns: Mapping[str, Sequence[tuple[Method, Weights | None]]]) -> dict[str, dict]:
    """By group, then by column, the scores of its songs. "genre left out" is of those genres alone."""
    rng = np.random.default_rng(0)
    rows: dict[str, dict[str, list[dict[str, float]]]] = {}
    for song in true_songs():
        mel = log_mel(song.samples)
        for column, made in columns.items():
            for method, weights in made:
                if weights is not None and weights.without and song.genre not in weights.without:
                    continue
                if weights is not None and weights.real and method is not made[0][0]:
                    continue  # one of the folds of real songs is enough here
                found = method(song.samples, mel)
                row = scores(found, song.truth)
                for group in (song.group, "all kinds" if song.group in KINDS else song.group):
                    rows.setdefault(group, {}).setdefault(column, []).append(row)
                if column == "tempo path":
                    by_chance = chance(found, song.truth, len(song.samples) / SAMPLE_RATE_HZ, rng)
                    rows[song.group].setdefault("chance", []).append(by_chance)
                    if song.group in KINDS:
                        rows["all kinds"].setdefault("chance", []).append(by_chance)
        print(song.name, flush=True)
    return rows


def real_rows(
    songs: Sequence[RealSong], columns: Mapping[str, Sequence[tuple[Method, Weights | None]]]
) -> dict[str, dict[str, list[list[float]]]]:
    """By what is asked, then by column, for every song 1 for each network that is right of it."""
    rows: dict[str, dict[str, list[list[float]]]] = {}
    for song in songs:
        mel = log_mel(song.samples)
        for column, made in columns.items():
            unseen = [m for m, w in made if w is None or (not w.without and song.name not in w.real)]
            found = [method(song.samples, mel) for method in unseen]
            if not found:
                continue
            metre = [float(counts.metre == song.metre) for counts in found]
            asked = {"metre": metre, f"metre of those in {song.metre}": metre}
            if np.isfinite(song.bpm):
                tempi = [60.0 / np.median(np.diff(counts.times_s)) / song.bpm for counts in found]
                at = np.array([[abs(t * k - 1) < SAME_TEMPO for k in (1.0, 2.0, 0.5)] for t in tempi])
                asked["tempo of ChoreoNet's counts"] = at[:, 0].astype(float).tolist()
                asked["the same, its half or its double"] = at.any(axis=1).astype(float).tolist()
            for what, values in asked.items():
                rows.setdefault(what, {}).setdefault(column, []).append(values)
        print(song.name, flush=True)
    return rows


def seconds_for(method: Method, samples: NDArray[np.float32]) -> float:
    mel = log_mel(samples)
    method(samples, mel)
    start = time.perf_counter()
    method(samples, mel)
    return time.perf_counter() - start


def table(head: str, columns: Sequence[str], rows: Mapping[str, Sequence[str]]) -> str:
    lines = [f"| {head} | {' | '.join(columns)} |", f"| --- |{' --- |' * len(columns)}"]
    return "\n".join([*lines, *(f"| {name} | {' | '.join(cells)} |" for name, cells in rows.items())]) + "\n"


def mean(rows: Sequence[Mapping[str, float]] | None, *names: str, n_networks: int = 1) -> str:
    """Means over rows, of each song one for each network."""
    if not rows or names[0] not in rows[0]:
        return ""
    of_songs = [np.reshape([row[name] for row in rows], (-1, n_networks)) for name in names]
    return " / ".join(mean_and_spread(values) for values in of_songs)


def mean_and_spread(values: Sequence[Sequence[float]] | Floats) -> str:
    """Means of songs and networks (N, W). The spread is between the networks, if there are several."""
    per_song = [np.mean(of_song) for of_song in values]
    spread = np.std(np.mean(values, axis=0)) if len({len(v) for v in values}) == 1 < len(values[0]) else None
    return f"{np.mean(per_song):.2f}" + (f" ± {spread:.2f}" if spread is not None else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("choreonet", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--weights", type=Path, nargs="*", default=[])
    given = parser.parse_args()
    columns = methods([Weights.read(path) for path in given.weights])
    real = list(real_songs(given.data, given.choreonet))
    of_real = real_rows(real, columns)
    of_true = synthetic_rows(columns)
    names = [*columns, "chance"]
    parts = []
    for title, asked in (
        ("Beats / downbeats, F at 70 ms", ("beats", "downbeats")),
        ("Metre / level", ("metre", "level")),
    ):
        rows = {
            group: [
                mean(
                    of_group.get(name),
                    *asked,
                    n_networks=len(columns[name]) if name in NETWORK_METHODS else 1,
                )
                for name in names
            ]
            for group, of_group in of_true.items()
        }
        parts.append(table(title, names, rows))
    commoner = max(np.mean([song.metre == metre for song in real]) for metre in (3, 4))
    rows = {}
    for what, by_column in of_real.items():
        shown = [mean_and_spread(by_column[name]) if name in by_column else "" for name in columns]
        n_songs = len(by_column["tempo path"])
        rows[f"{what}, {n_songs} songs"] = [*shown, f"{commoner:.2f}" if what == "metre" else ""]
    parts.append(table("Real songs", names, rows))
    three_minutes = mono(render_song("cha-cha", duration_s=180.0, seed=FIRST_UNSEEN_SEED).samples)
    took = [f"{seconds_for(made[0][0], three_minutes):.1f}" for made in columns.values()]
    parts.append(
        table("Seconds for a song of 3 minutes, after its log-mel", [*columns], {"one thread": took})
    )
    given.output.write_text("\n".join(parts), encoding="utf-8")
    print("\n".join(parts))


if __name__ == "__main__":
    main()
