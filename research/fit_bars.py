"""Fits the weights by which `music.bars` finds bars to synthetic songs.

Run: python research/fit_bars.py [--write]

There are 430 songs with seeds from 2000 on. They cover eleven genres at all their tempi and 5 % beyond,
steady, swung or with a ramp, and the ten genres in four with one beat cut out of every bar, so that a bar of
three is not recognised as a waltz by its instruments. Songs in five, six and seven are made of the beats of
the genres (`content.songs.training_songs.odd_metre_style`). Excerpts have 8 to 48 beats, tracked and true. A
softmax decides between 25 hypotheses, the phases of three to seven. Its scores are sums over beats of weights
times evidence. The problem is convex and solved by L-BFGS with a penalty on the squares. All metres have
equal weight. Rare metres then lose a little at every beat (`RARE_NATS`), about half of what separates songs
in them from other songs.

The confidence is logistic in the margin over the root of the number of beats. It is fitted to excerpts of 4
to 35 s of every sixth of those songs, which are right if the downbeat F-score is 0.8 or more. They are clean,
or with noise 10 dB below to 10 dB above the music. One excerpt of four is noise alone, which is always wrong.

A logistic model decides from the mean repeats of beats and the instants between them whether those are the
beats, as in 6/8 and 7/8 that are tracked on every second eighth.

The script also prints the share of correct excerpts of each genre by weights that were fitted without the
genre.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import soxr
import torch
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from choreograph.core.numerics import Floats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.music import bars
from choreograph.music.bars import ACCENT_NAMES, METRES, REPEAT_NAMES, beat_evidence
from choreograph.music.mel import log_mel
from choreograph.nets.music_counts import network_beats, shipped_music_counts
from content.songs.synthesis.song import STYLES, render_song
from content.songs.synthesis.style import SongStyle
from content.songs.training_songs import in_three, odd_metre_style

FIRST_SEED, FIRST_ODD_SEED, N_ODD = 2000, 2300, 54  # songs of each odd metre
FIRST_COMPOUND_SEED, N_COMPOUND = 2500, 72  # songs in 6/8
DURATION_S = 45.0
EXCERPT_BEATS = (8, 12, 16, 24, 32, 48)
EXCERPTS = 3  # of each length and song
PENALTY = 0.1
FASTEST_BEATS_BPM = {5: 170.0, 6: 140.0, 7: 140.0}  # from which on the beats of a metre may be eighths
SLOWEST_EIGHTHS_BPM = 250.0  # that are not the beats of other songs
RARE_NATS = {5: 0.08, 6: 0.05, 7: 0.08}  # of a beat
FIRST_STATE = dict(zip(METRES, np.cumsum([0, *METRES]).tolist(), strict=False))


@dataclass(frozen=True, eq=False)
class BarSong:
    """A song with true beats."""

    genre: str
    metre: int
    samples: NDArray[np.float32]  # (S,) mono, 22.05 kHz
    true_s: Floats  # (Q,)
    tracked_s: Floats  # (R,)


def songs() -> Iterator[BarSong]:
    rng = np.random.default_rng(1)
    seed = FIRST_SEED
    for genre, style in STYLES.items():
        low, high = 0.95 * style.bpm[0], 1.05 * style.bpm[1]
        for i in range(36 if genre == "waltz" else 12):
            bpm, ramp, swing = float(rng.uniform(low, high)), None, None
            if i % 4 == 1:
                ramp = float(rng.uniform(low, high)) if genre == "waltz" else bpm * rng.uniform(0.75, 1.3)
            if i % 4 == 2:
                swing = float(rng.uniform(0.5, 1))
            yield rendered(genre, style, seed, bpm=bpm, ramp_to_bpm=ramp, swing=swing)
            seed += 1
        for _ in range(0 if genre == "waltz" else 4):
            three = in_three(style, dropped=int(rng.integers(1, 4)))
            yield rendered(genre, three, seed, bpm=float(rng.uniform(*style.bpm)))
            seed += 1
    rng = np.random.default_rng(2)
    seed = FIRST_ODD_SEED
    for metre in (5, 6, 7):
        for i in range(N_ODD):
            genre, style, bpm = odd_metre_style(metre, rng)
            ramp = bpm * rng.uniform(0.85, 1.15) if i % 4 == 1 else None
            swing = float(rng.uniform(0.3, 1.0)) if i % 4 == 2 and metre != 6 else None
            yield rendered(genre, style, seed, bpm=bpm, ramp_to_bpm=ramp, swing=swing)
            seed += 1
    rng = np.random.default_rng(3)
    for i in range(N_COMPOUND):
        genre, style, bpm = odd_metre_style(6, rng, compound=True)
        ramp = bpm * rng.uniform(0.85, 1.15) if i % 4 == 1 else None
        yield rendered(genre, style, FIRST_COMPOUND_SEED + i, bpm=bpm, ramp_to_bpm=ramp)


def rendered(genre: str, style: SongStyle, seed: int, **options: float | None) -> BarSong:
    song = render_song(style, seed=seed, duration_s=DURATION_S, **options)  # type: ignore[arg-type]
    mono = soxr.resample(song.samples.mean(axis=1), 44100, SAMPLE_RATE_HZ)
    tracked_s = network_beats(log_mel(mono), shipped_music_counts())
    tracked_s = tracked_s[tracked_s < len(mono) / SAMPLE_RATE_HZ]
    return BarSong(genre, song.beats_per_bar, mono, song.beat_times_s, tracked_s)


def position_in_bar(song: BarSong, beats_s: Floats) -> NDArray[np.int64]:
    """Position in the bar, 0 on the downbeat. It is -1 if no true beat is within 70 ms."""
    nearest = np.abs(beats_s[:, None] - song.true_s).argmin(axis=1)
    found = np.abs(song.true_s[nearest] - beats_s) < 0.07
    return np.where(found, nearest % song.metre, -1)


def excerpts(song: BarSong, rng: np.random.Generator) -> Iterator[tuple[Floats, Floats, int]]:
    """Sums of accents (25, F) over every third to seventh beat, of repeats (R + 1,), and the true state."""
    mel = log_mel(song.samples)
    for beats_s in (song.tracked_s, song.true_s[song.true_s < len(song.samples) / SAMPLE_RATE_HZ]):
        accents, repeats = beat_evidence(song.samples, mel, beats_s)
        position = position_in_bar(song, beats_s)
        for length in EXCERPT_BEATS:
            for start in rng.choice(max(1, len(beats_s) - length), size=EXCERPTS):
                part = slice(start, start + length)
                known = position[part] >= 0
                first = ((position[part] - np.arange(known.size)) % song.metre)[known]
                votes = np.bincount(first, minlength=max(METRES))
                if known.size < length or known.mean() < 0.9 or votes.max() < 0.95 * known.sum():
                    continue  # the tracker lost the beat here, or found another level
                sums = [accents[part][k::metre].sum(axis=0) for metre in METRES for k in range(metre)]
                repeated = np.append(repeats[part].sum(axis=0), length)
                yield np.stack(sums), repeated, int(votes.argmax()) + FIRST_STATE[song.metre]


def scores(weights: torch.Tensor, metre: torch.Tensor, sums: torch.Tensor, repeats: torch.Tensor):
    """Score of each state as that of the excerpt's first beat, (N, 25)."""
    accents = []
    for n, first in FIRST_STATE.items():
        in_bar = np.arange(n)
        for k in in_bar:  # beat j of the excerpt, and every n-th after it, has number (j + k) % n + 1
            of_number = weights[first + (in_bar + k) % n]
            accents.append((sums[:, first : first + n] * of_number).sum(dim=(1, 2)))
    of_metre = repeats @ metre  # (N, 5)
    return torch.stack(accents, dim=1) + of_metre[:, np.repeat(np.arange(len(METRES)), METRES)]


def fit(sums: torch.Tensor, repeats: torch.Tensor, truth: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Weights (25, F) of accents and (R + 1, 5) of repeats."""
    weights = torch.zeros(sum(METRES), sums.shape[2], dtype=torch.float64, requires_grad=True)
    metre = torch.zeros(repeats.shape[1], len(METRES), dtype=torch.float64, requires_grad=True)
    of_metre = torch.as_tensor(np.repeat(np.arange(len(METRES)), METRES))[truth]
    share = (1.0 / len(METRES) / torch.bincount(of_metre).double())[of_metre]
    optimiser = torch.optim.LBFGS([weights, metre], max_iter=150, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        log_p = torch.log_softmax(scores(weights, metre, sums, repeats), dim=1)
        value = -(share * log_p.gather(1, truth[:, None])[:, 0]).sum()
        value = value + PENALTY * (weights.square().sum() + metre[:-1].square().sum())
        value.backward()
        return value

    optimiser.step(loss)
    return weights.detach(), metre.detach()


def margins(
    all_songs: list[BarSong], weights: tuple[Floats, Floats], rng: np.random.Generator
) -> Iterator[tuple[float, bool]]:
    """Margin of excerpts (nats per root of beats), and whether their bars are right."""
    for song in all_songs:
        for i in range(3):
            duration_s = min(rng.choice([4, 6, 8, 12, 20, 35]), len(song.samples) / SAMPLE_RATE_HZ)
            start_s = rng.uniform(0, len(song.samples) / SAMPLE_RATE_HZ - duration_s)
            first = round(start_s * SAMPLE_RATE_HZ)
            part = song.samples[first : first + round(duration_s * SAMPLE_RATE_HZ)]
            snr_db = rng.choice([30.0, 10.0, 0.0, -10.0])
            part = part + rng.normal(size=len(part)) * part.std() * 10 ** (-snr_db / 20)
            true, tracked, down = (
                times_s[(times_s > start_s) & (times_s < start_s + duration_s - 0.05)] - start_s
                for times_s in (song.true_s, song.tracked_s, song.true_s[:: song.metre])
            )
            beats_s = tracked if i % 2 else true
            if len(beats_s) < 5 or len(down) == 0 or f_score(beats_s, true) < 0.9:
                continue
            states, margin = margin_of(part, beats_s, weights)
            found = beats_s[bars.STATE_NUMBER[states] == 1]
            yield margin / np.sqrt(len(beats_s)), len(found) > 0 and f_score(found, down) >= 0.8
            if i == 0:
                _, of_noise = margin_of(rng.normal(size=len(part)), beats_s, weights)
                yield of_noise / np.sqrt(len(beats_s)), False


def margin_of(
    samples: Floats, beats_s: Floats, weights: tuple[Floats, Floats]
) -> tuple[NDArray[np.int64], float]:
    evidence = beat_evidence(samples, log_mel(samples), beats_s)
    return bars.best_bars(bars.state_evidence(*evidence, *weights))


def calibrated(all_songs: list[BarSong], weights: tuple[Floats, Floats]) -> tuple[float, float]:
    """Offset and slope of the log odds that bars are right."""
    found = np.array(list(margins(all_songs, weights, np.random.default_rng(3))))
    margin, right = found[:, :1], found[:, 1].astype(bool)
    model = LogisticRegression(C=100.0).fit(margin, right)
    for low, high in ((0.0, 0.3), (0.3, 0.5), (0.5, 0.7), (0.7, 0.9), (0.9, 1.01)):
        p = model.predict_proba(margin)[:, 1]
        inside = (p >= low) & (p < high)
        print(f"confidence from {low:.1f}: {inside.sum()} excerpts, {right[inside].mean():.2f} right")
    return float(model.intercept_[0]), float(model.coef_[0, 0])


def leave_genres_out(
    genres: NDArray[np.str_], sums: torch.Tensor, repeats: torch.Tensor, truth: torch.Tensor
) -> None:
    for genre in sorted(set(genres)):
        out = torch.as_tensor(genres == genre)
        weights, metre = fit(sums[~out], repeats[~out], truth[~out])
        found = scores(weights, metre, sums[out], repeats[out]).argmax(dim=1)
        print(
            f"without {genre}: {(found == truth[out]).double().mean():.2f} right, {out.sum()} excerpts of it"
        )


def eighths_rows(all_songs: list[BarSong], rng: np.random.Generator) -> Iterator[tuple[Floats, bool]]:
    """Mean repeats (R,) of eighths, and whether they are the beats, of excerpts and of whole songs."""
    for i, song in enumerate(all_songs):
        true_bpm, tracked_bpm = (60.0 / np.median(np.diff(t)) for t in (song.true_s, song.tracked_s))
        mel = log_mel(song.samples)
        levels = []
        if true_bpm >= FASTEST_BEATS_BPM.get(song.metre, np.inf):
            levels.append((song.true_s, True))
        if true_bpm <= SLOWEST_EIGHTHS_BPM / 2 and (song.metre != 4 or i % 3 == 0):
            levels.append((with_halves(song.true_s), False))
        octaves = np.log2(2 * tracked_bpm / true_bpm)
        if tracked_bpm <= SLOWEST_EIGHTHS_BPM / 2 and min(abs(octaves), abs(octaves - 1)) < 0.1:
            levels.append((with_halves(song.tracked_s), abs(octaves) < 0.1))
        for beats_s, are_beats in levels:
            inside = beats_s[beats_s < len(song.samples) / SAMPLE_RATE_HZ]
            _, repeats = beat_evidence(song.samples, mel, inside)
            for length in (24, 48, 96, len(repeats)):
                for start in rng.choice(
                    max(1, len(repeats) - length + 1), size=2 if length < len(repeats) else 1
                ):
                    yield repeats[start : start + length].mean(axis=0), are_beats


def with_halves(times_s: Floats) -> Floats:
    return np.interp(np.arange(2 * len(times_s) - 1) / 2, np.arange(len(times_s)), times_s)


def fit_eighths(all_songs: list[BarSong]) -> Floats:
    """Weights (R + 1,) of the log odds that eighths are the beats."""
    repeats, are_beats = zip(*eighths_rows(all_songs, np.random.default_rng(0)), strict=True)
    model = LogisticRegression(class_weight="balanced", max_iter=2000).fit(np.array(repeats), are_beats)
    return np.append(model.coef_[0], model.intercept_[0])


def source(weights: Floats, metre: Floats, eighths: Floats, confidence: tuple[float, float]) -> str:
    """The weights as `bars.fitted_weights` reads them."""
    accents = (weights - weights.mean(axis=0)).T
    repeats, names = metre - metre.mean(axis=1, keepdims=True), (*REPEAT_NAMES, "always")
    tables = {
        "accents": dict(zip(ACCENT_NAMES, accents.round(3).tolist(), strict=True)),
        "repeats": dict(zip(names, repeats.round(4).tolist(), strict=True)),
        "eighths": dict(zip(names, eighths.round(3).tolist(), strict=True)),
    }
    lines = (
        f"  {json.dumps(table)}: {{\n"
        + ",\n".join(f"    {json.dumps(name)}: {json.dumps(row)}" for name, row in rows.items())
        + "\n  }"
        for table, rows in tables.items()
    )
    return (
        "{\n" + ",\n".join([*lines, f'  "confidence": {[round(value, 2) for value in confidence]}']) + "\n}\n"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--write", action="store_true", help="replace the program's weights")
    options = parser.parse_args()
    all_songs = list(songs())
    rng = np.random.default_rng(0)
    rows = [(song.genre, *row) for song in all_songs for row in excerpts(song, rng)]
    genres = np.array([row[0] for row in rows])
    sums, repeats, truth = (torch.as_tensor(np.array([row[i] for row in rows])) for i in (1, 2, 3))
    leave_genres_out(genres, sums, repeats, truth)
    weights, metre = fit(sums, repeats, truth)
    metre[-1] -= torch.tensor([RARE_NATS.get(n, 0.0) for n in METRES], dtype=torch.float64)
    confidence = calibrated(all_songs[::6], (weights.numpy().T, metre.numpy()))
    text = source(weights.numpy(), metre.numpy(), fit_eighths(all_songs), confidence)
    if options.write:
        bars.WEIGHTS_PATH.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
