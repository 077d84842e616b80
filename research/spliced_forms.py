"""Whether repeats and borders of phrases are found in recordings that are cut and put together anew.

    python -m research.spliced_forms SONGS [--development] [--songs-each 3]

`SONGS` is a folder whose subfolders hold one recording each. Pieces of eight bars are cut from a recording on
the downbeats that are tracked in it, and put together to a song of known form. The beats of the new song are
tracked again. Every second recording is one of development. Prints for each song the F-scores of the repeated
pairs of counts and of the borders of phrases within half a bar, as `research.song_forms` does, with sections
as phrases and chance beside them, and the F-scores of the tracked beats and downbeats. The last line is the
mean of the songs whose beats (0.95) and downbeats (0.90) are right. A recording repeats itself in places, so
that some repeats that are found beside the constructed ones are right as well.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.core.counts import Counts
from choreograph.core.numerics import AnyFloats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.library.songs import DEFAULT_BEATS, song_counts
from choreograph.music.mel import log_mel
from content.songs.known_forms import FormAudio
from research.song_forms import form_scores

FORMS = ("AABA", "ABAB", "ABAC", "AAAA", "ABCABC")
PIECE_BARS, UNIT_BARS = 8, 4  # borders and repeats are those of units of four bars
FADE_S = 0.01
_OF_PIECE = 10_000  # more than the counts of a piece
RIGHT_BEATS_F, RIGHT_DOWNBEATS_F = 0.95, 0.90


def tracked(samples: AnyFloats, name: str) -> Counts:
    """The beats and bars of mono samples at 22.05 kHz."""
    return song_counts(cg.Song(samples, name), log_mel(samples), DEFAULT_BEATS)


def spliced(
    samples: AnyFloats, counts: Counts, letters: str, rng: np.random.Generator
) -> tuple[AnyFloats, FormAudio] | None:
    """Mono samples of a song of this form with its true form, or None if the recording is too short."""
    downbeats_s = counts.downbeat_times_s
    kinds = sorted(set(letters))
    n_pieces = (len(downbeats_s) - 1) // PIECE_BARS
    if n_pieces < len(kinds):
        return None
    first_bar = int(rng.integers(len(downbeats_s) - n_pieces * PIECE_BARS))
    bars = first_bar + PIECE_BARS * rng.permutation(n_pieces)
    fade = round(FADE_S * SAMPLE_RATE_HZ)
    ramp = np.linspace(0.0, 1.0, fade, dtype=np.float32)
    song, times, numbers, ids, borders_s = np.zeros(fade, np.float32), [], [], [], []
    for letter in letters:
        bar = bars[kinds.index(letter)]
        start_s, unit_s, end_s = downbeats_s[[bar, bar + UNIT_BARS, bar + PIECE_BARS]]
        first, stop = (round(time_s * SAMPLE_RATE_HZ) for time_s in (start_s, end_s))
        piece = np.pad(samples, (fade, 0))[first : stop + fade]  # from a fade before the downbeat on
        at_s = len(song) / SAMPLE_RATE_HZ
        song = np.concatenate([song[:-fade], song[-fade:] * (1 - ramp) + piece[:fade] * ramp, piece[fade:]])
        inside = np.flatnonzero((counts.times_s > start_s - FADE_S) & (counts.times_s < end_s - FADE_S))
        times.append(counts.times_s[inside] - start_s + at_s)
        numbers.append(counts.numbers[inside])
        ids.append(_OF_PIECE * kinds.index(letter) + np.arange(len(inside)))
        borders_s += [at_s, unit_s - start_s + at_s]
    true = Counts(np.concatenate(times), np.concatenate(numbers), counts.metre, "spliced", 1.0)
    return song, FormAudio(np.zeros((0, 2), np.float32), true, np.concatenate(ids), np.array(borders_s[1:]))


def measured(mono: AnyFloats, truth: FormAudio, name: str) -> list[float]:
    """F-scores of repeats and borders, as `form_scores`, and of the tracked beats and downbeats."""
    counts, true = tracked(mono, name), truth.counts
    return [
        *form_scores(mono, counts, truth),
        f_score(counts.times_s, true.times_s),
        f_score(counts.downbeat_times_s, true.downbeat_times_s),
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("songs", type=Path)
    parser.add_argument("--development", action="store_true", help="the songs of development, not held out")
    parser.add_argument("--songs-each", type=int, default=3, help="songs made of each recording")
    options = parser.parse_args()
    rows = []
    recordings = sorted(options.songs.rglob("audio.mp3"))
    print(f"{'repeats, borders of':25s}   form      sections    chance    beats downbeats")
    for index, path in enumerate(recordings):
        if (index % 2 == 0) != options.development:
            continue
        samples = cg.load_song(path).samples
        counts = tracked(samples, path.parent.name)
        for number in range(options.songs_each):
            letters = FORMS[(index // 2 + 2 * number) % len(FORMS)]
            song = spliced(samples, counts, letters, np.random.default_rng([index, number]))
            if song is not None:
                rows.append(measured(*song, path.parent.name))
                print(f"{path.parent.name:16s} {letters:8s}", *(f"{x:5.2f}" for x in rows[-1]), flush=True)
    table = np.array(rows)
    is_right = (table[:, -2] >= RIGHT_BEATS_F) & (table[:, -1] >= RIGHT_DOWNBEATS_F)
    for title, chosen in (("all", table), ("right beats and bars", table[is_right])):
        print(f"{title}, {len(chosen)} songs".ljust(25), *(f"{x:5.2f}" for x in chosen.mean(axis=0)))


if __name__ == "__main__":
    main()
