"""Whether the repeats and the borders of phrases are found in songs of known form.

    python -m research.song_forms --beats true       # or --beats tracked, and --development

Prints for each song the F-score of repeated pairs of counts (`metrics.structure.repeat_f`) and of the borders
of phrases within half a bar. Beside them are two references: sections as phrases, which is the simplest
baseline, and chance: phrases of four bars with random repeats, as many as were found.
"""

from __future__ import annotations

import argparse

import numpy as np

import choreograph as cg
from choreograph.core.counts import Counts
from choreograph.core.numerics import AnyFloats, Floats, Indices
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics.beat import f_score
from choreograph.evaluation.metrics.structure import repeat_f
from choreograph.library.songs import DEFAULT_BEATS, song_counts
from choreograph.music.form import Form, Phrase, Sections, phrase_bounds_s, song_form, song_sections
from choreograph.music.mel import log_mel
from choreograph.music.spectral import spectral_features
from content.songs.known_forms import DEVELOPED_ON, HELD_OUT_FORMS, FormAudio, FormSong

_OF_PHRASE = 10_000  # more than the counts of a phrase
N_CHANCE = 20  # draws


def ids_of(form: Form, times_s: Floats) -> Indices:
    """An id for each count (Q,): equal for counts at the same place of phrases that repeat each other."""
    ids = -1 - np.arange(len(times_s))
    half_s = 0.5 * float(np.median(np.diff(times_s)))
    for phrase, label in zip(form.phrases, form.labels, strict=True):
        inside = np.flatnonzero((times_s >= phrase.start_s - half_s) & (times_s < phrase.end_s - half_s))
        place = (times_s[inside] - phrase.start_s) / (phrase.end_s - phrase.start_s) * phrase.n_counts
        ids[inside] = _OF_PHRASE * label + np.rint(place).astype(np.int64)
    return ids


def form_of_sections(sections: Sections, times_s: Floats) -> Form:
    """The sections as phrases, where equal labels are repeats."""
    bounds_s, labels = sections.bounds_s, sections.labels.tolist()
    phrases = []
    for index, label in enumerate(labels):
        first = labels.index(label)
        start_s, end_s = float(bounds_s[index]), float(bounds_s[index + 1])
        n_counts = max(1, int(((times_s >= start_s) & (times_s < end_s)).sum()))
        phrases.append(Phrase(start_s, end_s, n_counts, index, None if first == index else first))
    return Form(tuple(phrases))


def chance_form(counts: Counts, n_labels: int, rng: np.random.Generator) -> Form:
    """Phrases of four bars from a random bar on, with random labels."""
    starts_s = counts.downbeat_times_s[int(rng.integers(4)) :: 4]
    labels = rng.integers(max(1, n_labels), size=max(0, len(starts_s) - 1)).tolist()
    phrases = []
    for index, label in enumerate(labels):
        first = labels.index(label)
        start_s, end_s = float(starts_s[index]), float(starts_s[index + 1])
        phrases.append(Phrase(start_s, end_s, 4 * counts.metre, 0, None if first == index else first))
    return Form(tuple(phrases))


def scores(form: Form, audio: FormAudio) -> tuple[float, float]:
    """F-scores of repeats and of borders."""
    times_s = audio.counts.times_s
    half_bar_s = 0.5 * audio.counts.metre * float(np.median(np.diff(times_s)))
    starts_s = np.array([phrase.start_s for phrase in form.phrases[1:]])
    return (
        repeat_f(ids_of(form, times_s), audio.ids),
        f_score(starts_s, audio.borders_s, window_s=half_bar_s),
    )


def measured(song: FormSong, *, tracked: bool) -> list[float]:
    """F-scores of repeats and borders of a song of known form, as `form_scores`."""
    audio = song.render()
    mono = np.asarray(audio.samples.mean(axis=1)[::2], np.float32)
    counts = audio.counts
    if tracked:
        counts = song_counts(cg.Song(mono, song.name), log_mel(mono), DEFAULT_BEATS)
    return form_scores(mono, counts, audio)


def form_scores(mono: AnyFloats, counts: Counts, audio: FormAudio) -> list[float]:
    """F-scores of repeats and borders: of the form found with these counts, of the sections and by chance."""
    bounds_s = phrase_bounds_s(counts, len(mono) / SAMPLE_RATE_HZ)
    features = spectral_features(mono, bounds_s)
    sections = song_sections(
        features[: len(counts) - 1], counts.times_s, downbeat_times_s=counts.downbeat_times_s
    )
    form = song_form(features, bounds_s, counts, sections)
    rng = np.random.default_rng(0)
    chance = [scores(chance_form(counts, len(set(form.labels)), rng), audio) for _ in range(N_CHANCE)]
    baseline = scores(form_of_sections(sections, counts.times_s), audio)
    return [*scores(form, audio), *baseline, *np.mean(chance, axis=0).tolist()]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--beats", choices=("true", "tracked"), default="true")
    parser.add_argument("--development", action="store_true", help="the songs of development, not held out")
    options = parser.parse_args()
    rows = []
    print(f"{'repeats, borders of':46s}   form      sections    chance")
    for song in DEVELOPED_ON if options.development else HELD_OUT_FORMS:
        rows.append(measured(song, tracked=options.beats == "tracked"))
        print(f"{song.name:46s}", *(f"{value:5.2f}" for value in rows[-1]))
    print(f"{'mean':46s}", *(f"{value:5.2f}" for value in np.mean(rows, axis=0)))


if __name__ == "__main__":
    main()
