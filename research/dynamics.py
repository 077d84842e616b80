"""Does a dance follow the dynamics of its song? Songs with a known change of level, and the motion there.

    python research/dynamics.py [--genres waltz house ...] [--seeds 5] [--engine graph] \\
        [--data path/to/dance-with-melody] [--reach]

Songs of every genre are rendered here, of seeds from which no network was trained. With `--data`, the songs
are those of `dance_with_melody_held_out.txt`, which the built-in networks have never been given. Each song is
changed in four ways, at times that are known from the change itself:

- crescendo: the level rises by 24 dB over the whole song. Rank correlation of loudness and speed in windows
  of 4 s
- break: the song's own break, of rendered songs only. Speed in it divided by that in the section before it
- softened: the middle third is 15 dB softer. Speed in it divided by that in the dance to the unchanged song
- silence: one bar, and two bars elsewhere, are silent. Speed in them divided by that before

Speed is that of all joints of the rendered motion. A row is for the default settings, for `dynamics` 0, for
the weight 0 of the cost `energy` besides, and for the dance to the unchanged song, measured as if it were
changed, which is chance. The second number is that of the worst song, the third the spread over seeds. With
`--reach`, the slowest and the fastest dance that the choice of clips alone can find are measured.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import choreograph as cg
from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.core.numerics import Floats
from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics import counts, energy_response, physical
from choreograph.evaluation.plan_scores import danced_counts, transition_times_s
from choreograph.evaluation.songs import find_songs, song_music
from choreograph.motion.body import body_pos_m
from choreograph.music.song import Song, load_song
from content.songs.synthesis.composition import Section
from content.songs.synthesis.song import STYLES, SyntheticSong, render_song, write_song

HELD_OUT = Path(__file__).with_name("dance_with_melody_held_out.txt")
FIRST_SEED = 9700  # of rendered songs: beyond those of all other songs
DURATION_S = {"crescendo": 85.0, "break": 60.0, "softened": 60.0, "silence": 60.0}
CRESCENDO_DB, SOFT_DB = 24.0, -15.0
WINDOW_S = 4.0
FADE_S = 0.02
Span = tuple[float, float]
SETTINGS: dict[str, cg.DanceConfig] = {
    "default": cg.DanceConfig(),
    "dynamics 0": cg.DanceConfig(dynamics=0.0),
    "dynamics 0, energy 0": cg.DanceConfig(dynamics=0.0, weights={"energy": 0.0}),
}


class Speed(cg.Cost):
    """The size of motion in its genre, to find the slowest dance, or with a negative weight the fastest."""

    def node(self, layer, song_features):  # type: ignore[no-untyped-def]
        return layer.liveliness


@dataclass(frozen=True, eq=False)
class ChangedSong:
    """A song, its changed version, and where it was changed."""

    name: str
    group: str
    plain: Song
    song: Song
    counts: Counts
    spans_s: tuple[Span, ...] = ()  # where it was changed
    before_s: tuple[Span, ...] = ()  # with what each is compared


def rendered(genre: str, group: str, seed: int) -> ChangedSong:
    """A rendered song with its true counts, changed in one way."""
    bars = round(DURATION_S[group] / (STYLES[genre].beats_per_bar * 60.0 / float(np.mean(STYLES[genre].bpm))))
    if group == "break":
        made = render_song(genre, duration_s=DURATION_S[group], seed=seed)
    else:
        made = render_song(genre, n_bars=bars, seed=seed, sections=[Section("chorus", 0, bars, 0.9)])
    times_s = made.beat_times_s
    song_counts = Counts(times_s, numbers_in_bar(len(times_s), made.beats_per_bar), made.beats_per_bar)
    plain = ChangedSong(genre, group, loaded(made), loaded(made), song_counts)
    if group == "break":
        bounds_s = made.bar_times_s[[*(section.first_bar for section in made.sections), made.n_bars]]
        spans = list(pairwise(bounds_s.tolist()))
        at = [i for i, section in enumerate(made.sections) if section.name == "break"]
        return replace(plain, spans_s=tuple(spans[i] for i in at), before_s=tuple(spans[i - 1] for i in at))
    return changed(plain, made.bar_times_s)


def loaded(made: SyntheticSong) -> Song:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{made.genre}-{made.seed}.wav"
        write_song(path, made)
        return load_song(path)


def changed(song: ChangedSong, bars_s: Floats) -> ChangedSong:
    """The song with the level of its group. `bars_s` are the true or estimated starts of its bars."""
    length_s = song.plain.duration_s
    if song.group == "crescendo":
        return replace(song, song=with_gain(song.plain, [0.0, length_s], [-CRESCENDO_DB, 0.0]))
    if song.group == "softened":
        span = nearest(bars_s, length_s / 3), nearest(bars_s, 2 * length_s / 3)
        return replace(song, song=silenced(song.plain, [span], SOFT_DB), spans_s=(span,), before_s=(span,))
    first, second = (int(np.abs(bars_s - share * length_s).argmin()) for share in (0.4, 0.7))
    spans = ((bars_s[first], bars_s[first + 1]), (bars_s[second], bars_s[second + 2]))
    spans = tuple((float(start_s), float(end_s)) for start_s, end_s in spans)
    before = tuple((2 * start_s - end_s, start_s) for start_s, end_s in spans)
    return replace(song, song=silenced(song.plain, spans, -120.0), spans_s=spans, before_s=before)


def nearest(times_s: Floats, time_s: float) -> float:
    return float(times_s[np.abs(times_s - time_s).argmin()])


def silenced(song: Song, spans_s: Sequence[Span], gain_db: float) -> Song:
    corners = [(t, g) for a, b in spans_s for t, g in
               ((a - FADE_S, 0.0), (a, gain_db), (b - FADE_S, gain_db), (b, 0.0))]  # fmt: skip
    return with_gain(song, [time_s for time_s, _ in corners], [gain for _, gain in corners])


def with_gain(song: Song, times_s: Sequence[float], gains_db: Sequence[float]) -> Song:
    at_s = np.arange(len(song.samples)) / SAMPLE_RATE_HZ
    gain = 10.0 ** (np.interp(at_s, times_s, gains_db) / 20.0)
    return replace(song, samples=(song.samples * gain).astype(np.float32))


def real_songs(folder: Path) -> Iterator[ChangedSong]:
    """Held-out songs with estimated counts, changed in the three ways that need no form."""
    for found in find_songs(folder, only=HELD_OUT.read_text(encoding="utf-8").split()):
        song = found.load()
        estimated = song_music(song, "tempo-path").levels[0]
        for group in ("crescendo", "softened", "silence"):
            plain = ChangedSong(found.name, group, song, song, estimated)
            yield changed(plain, estimated.downbeat_times_s)


def measured(changed_song: ChangedSong, made: cg.Dance, plain: cg.Dance) -> list[float]:
    """The score of a group for one dance: one number for each change of the song."""
    body, fps = body_pos_m(made.motion), made.motion.fps
    if changed_song.group == "crescendo":
        bounds_s = np.arange(made.plan.opening_s, made.plan.danced_until_s, WINDOW_S)
        loudness = energy_response.section_loudness_db(changed_song.song.samples, SAMPLE_RATE_HZ, bounds_s)
        return [energy_response.speed_response(body, fps, bounds_s, loudness)]
    if changed_song.group == "softened":
        own, other = (
            energy_response.speed_within_m_s(body_pos_m(dance.motion), fps, changed_song.spans_s[0])
            for dance in (made, plain)
        )
        return [own / other]
    return [
        energy_response.speed_within_m_s(body, fps, span_s)
        / energy_response.speed_within_m_s(body, fps, before_s)
        for span_s, before_s in zip(changed_song.spans_s, changed_song.before_s, strict=True)
    ]


def other_scores(song: ChangedSong, made: cg.Dance, repertoire: cg.Repertoire) -> dict[str, float]:
    """Scores that should not change."""
    body, fps = body_pos_m(made.motion), made.motion.fps
    placed = danced_counts(made.plan, repertoire)
    pair = (placed.times_s, placed.numbers, song.counts.times_s, song.counts.numbers)
    joins_s = transition_times_s(made.plan) if made.plan.from_takes else np.zeros(0)
    return {
        "counts": counts.counts_within(*pair[::2]) if len(placed) else np.nan,
        "count 1": counts.downbeat_share(*pair) if len(placed) else np.nan,
        "jumps/min": physical.jumps_per_minute(body, fps),
        "jerk at joins": physical.jerk_ratio_at(body, fps, joins_s) if len(joins_s) else np.nan,
        "slide cm/s": physical.foot_slide_cm_s(body, fps),
        "PFC": physical.pfc(body, fps),
    }


def show(name: str, scores: Sequence[Sequence[Sequence[float]]], others: Sequence[dict[str, float]]) -> None:
    """A row of scores by song, seed and change, and of the means of other scores."""
    by_song = [float(np.nanmean([value for seed in song for value in seed])) for song in scores]
    by_seed = [np.nanmean([value for seed in seeds for value in seed]) for seeds in zip(*scores, strict=True)]
    rising = "crescendo" in name
    worst = min(by_song) if rising else max(by_song)
    cells = [f"{np.mean(by_song):.2f}, worst {worst:.2f}, spread {np.std(by_seed):.2f}"]
    for key in others[0] if others else ():
        values = [row[key] for row in others if np.isfinite(row[key])]
        cells.append(f"{key} {np.mean(values):.3f}" if values else f"{key} -")
    print(f"  {name}: " + ", ".join(cells), flush=True)


def show_group(name: str, songs: Sequence[ChangedSong], given: argparse.Namespace) -> None:
    repertoire = cg.starter_repertoire()
    print(f"{name}: {len(songs)} songs, {given.seeds} seeds, {given.engine}", flush=True)
    for title, config in SETTINGS.items():
        if given.engine != "graph" and config.weights:
            continue
        config = replace(config, engine=given.engine)
        scores, plain_scores, others, plain_others = [], [], [], []
        for song in songs:
            made = [
                cg.dance(song.song, repertoire, config=replace(config, seed=s)) for s in range(given.seeds)
            ]
            plain = made
            if song.group != "break":
                plain = [
                    cg.dance(song.plain, repertoire, config=replace(config, seed=s))
                    for s in range(given.seeds)
                ]
            scores.append([measured(song, *pair) for pair in zip(made, plain, strict=True)])
            plain_scores.append([measured(song, dance, dance) for dance in plain])
            others += [other_scores(song, dance, repertoire) for dance in made]
            plain_others += [other_scores(song, dance, repertoire) for dance in plain]
        show(f"{name}, {title}", scores, others)
        if name.split()[-1] != "break":
            show(f"{name}, {title}, unchanged song (chance)", plain_scores, plain_others)


def show_reach(songs: Sequence[ChangedSong]) -> None:
    """The speed of the slowest and the fastest dance that the choice of clips finds."""
    repertoire = cg.starter_repertoire()
    for song in songs:
        speeds = []
        for weight in (1000.0, -1000.0):
            config = cg.DanceConfig(dynamics=0.0, weights={"speed": weight})
            made = cg.dance(song.plain, repertoire, costs=[Speed()], config=config)
            span_s = (made.plan.opening_s, made.plan.danced_until_s)
            speeds.append(energy_response.speed_within_m_s(body_pos_m(made.motion), made.motion.fps, span_s))
        print(
            f"  {song.name}: {speeds[0]:.3f} to {speeds[1]:.3f} m/s, {speeds[0] / speeds[1]:.2f}", flush=True
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--genres", nargs="+", default=["waltz", "house", "rumba", "disco"])
    parser.add_argument("--groups", nargs="+", default=list(DURATION_S))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--engine", default="graph")
    parser.add_argument("--data", type=Path, help="dance-with-melody")
    parser.add_argument("--reach", action="store_true", help="what the choice of clips alone can reach")
    given = parser.parse_args()
    groups: dict[str, list[ChangedSong]] = {}
    if given.data:
        for song in real_songs(given.data):
            if song.group in given.groups:
                groups.setdefault(f"real {song.group}", []).append(song)
    else:
        for group in given.groups:
            groups[group] = [rendered(genre, group, FIRST_SEED + i) for i, genre in enumerate(given.genres)]
    if given.reach:
        show_reach([song for songs in groups.values() for song in songs])
        return
    for name, songs in groups.items():
        show_group(name, songs, given)


if __name__ == "__main__":
    main()
