"""Any number of songs with known counts, in styles that combine other styles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import Counts, numbers_in_bar
from choreograph.core.errors import ParameterError
from content.songs.synthesis.song import STYLES, SyntheticSong, render_song
from content.songs.synthesis.sounds import RATE_HZ
from content.songs.synthesis.style import STEPS_PER_BEAT, Lane, Part, SongStyle

# Styles made of other styles, in other metres, with other instruments, or with drums at half or double time.
#
# The training songs of a network must vary more than the genres as written, or the network overfits them.


Source = TypeVar("Source", Lane, Part)

_EIGHTHS = ("hat", "shaker", "brush", "ride", "guiro", "cascara")
_SOFTER = str.maketrans("Xx", "xo")
_LEVEL_DB = 4.0  # standard deviation of a source's level from that of its style
_P_OTHER_VOICE, _P_SILENT_LANE, _P_WITHOUT_DRUMS, _P_EVERYWHERE = 0.35, 0.2, 0.12, 0.25


def rebarred(style: SongStyle, beats: Sequence[int], *, softer: Sequence[int] = ()) -> SongStyle:
    """A style whose bars are made of beats (0 to 3, or 0 to 2) of its own bars, in this order.

    The beats at the places `softer` of the new bar have softer notes. `ParameterError` for a beat that the
    style does not have.
    """
    bar, n_beats = style.steps_per_bar, style.beats_per_bar
    if not beats or not all(0 <= beat < n_beats for beat in beats):
        raise ParameterError(f"expected beats from 0 to {n_beats - 1} of a bar, got {list(beats)}")

    def change(pattern: str) -> str:
        bars = [pattern[i : i + bar] for i in range(0, len(pattern), bar)]
        return "".join(
            steps.translate(_SOFTER) if place in softer else steps
            for old in bars
            for place, beat in enumerate(beats)
            for steps in [old[STEPS_PER_BEAT * beat : STEPS_PER_BEAT * (beat + 1)]]
        )

    return replace(
        _with_patterns(style, change), name=f"{style.name} {tuple(beats)}", beats_per_bar=len(beats),
        fills=tuple((drum, change(pattern)) for drum, pattern in style.fills),
    )  # fmt: skip


def in_three(style: SongStyle, *, dropped: int) -> SongStyle:
    """A style in four with one beat (0 to 3) of every bar left out. `ParameterError` for another metre."""
    _expect_metre(style, 4)
    three = rebarred(style, [beat for beat in range(4) if beat != dropped])
    return replace(three, name=f"{style.name} in three")


def in_compound_six(style: SongStyle, *, every_eighth: bool) -> SongStyle:
    """A style in four as 6/8: two of its beats are a bar, and each is divided in three eighths.

    The beats of the new style are the eighths. Notes between two beats move to the second or third eighth.
    `every_eighth` fills the hats and shakers. `ParameterError` for another metre.
    """
    _expect_metre(style, 4)

    def change(pattern: str) -> str:
        slots = []
        for i in range(0, len(pattern), STEPS_PER_BEAT):
            first, second, third, fourth = pattern[i : i + STEPS_PER_BEAT]
            slots += [first, second, fourth if third in ".-" and fourth not in ".-" else third]
        following = [*slots[1:], "."]
        return "".join(
            slot + (STEPS_PER_BEAT - 1) * ("-" if slot == "-" or after == "-" else ".")
            for slot, after in zip(slots, following, strict=True)
        )

    lanes = _repatterned(style.lanes, change)
    if every_eighth:
        eighths = tuple("x...o...o..." * (len(p) // 12) for p in lanes[0].patterns[:1])
        lanes = tuple(replace(lane, patterns=eighths) if lane.drum in _EIGHTHS else lane for lane in lanes)
    return replace(
        style, name=f"{style.name} in 6/8", beats_per_bar=6, lanes=lanes, swing=0.0,
        parts=_repatterned(style.parts, change),
        fills=tuple((drum, change(pattern)[24:]) for drum, pattern in style.fills),
    )  # fmt: skip


# Bars of five and seven made of the beats of a bar of four, and the places of their softer beats.
_BARS = {
    5: (((0, 1, 2, 0, 1), (3,)), ((0, 1, 3, 2, 3), ()), ((0, 1, 2, 3, 3), ()), ((0, 1, 0, 1, 2), (2,)),
        ((0, 1, 2, 2, 3), ())),
    7: (((0, 1, 0, 1, 0, 1, 2), (2, 4)), ((0, 1, 2, 0, 1, 0, 1), (3, 5)), ((0, 1, 2, 3, 0, 1, 2), (4,)),
        ((0, 1, 2, 0, 1, 2, 3), (3,)), ((0, 1, 2, 3, 2, 3, 3), ())),
}  # fmt: skip
_BPM_OF_METRE = {5: (85.0, 200.0), 6: (140.0, 235.0), 7: (110.0, 235.0)}


def odd_metre_style(
    metre: int, rng: np.random.Generator, *, compound: bool = False
) -> tuple[str, SongStyle, float]:
    """A genre, its style in five, six or seven, and a tempo, all drawn. Beats of six are eighths of 6/8.

    A bar of six is made of two bars of three, or with `compound` of two beats.
    """
    fours = [name for name, style in STYLES.items() if style.beats_per_bar == 4]
    genre = str(rng.choice(fours))
    if metre != 6:
        beats, softer = _BARS[metre][rng.integers(len(_BARS[metre]))]
    elif compound:
        style = in_compound_six(STYLES[genre], every_eighth=rng.random() < 0.5)
        return genre, style, float(rng.uniform(*_BPM_OF_METRE[metre]))
    elif rng.random() < 0.3:
        genre, beats, softer = "waltz", (0, 1, 2, 0, 1, 2), (3, 4, 5)
    else:
        beats, softer = 2 * tuple(sorted(map(int, rng.choice(4, 3, replace=False)))), (3, 4, 5)
        if rng.random() < 0.5:
            beats, softer = (0, 1, 1, 2, 3, 3), ()
    return genre, rebarred(STYLES[genre], beats, softer=softer), float(rng.uniform(*_BPM_OF_METRE[metre]))


def in_six(style: SongStyle) -> SongStyle:
    """A style in three with two of its bars in one. The second one is softer, and chords last both.

    `ParameterError` for another metre.
    """
    _expect_metre(style, 3)
    bar = style.steps_per_bar

    def doubled(pattern: str) -> str:
        bars = [pattern[i : i + bar] for i in range(0, len(pattern), bar)]
        return pattern if len(bars) % 2 == 0 else "".join(bar + bar.translate(_SOFTER) for bar in bars)

    return replace(
        _with_patterns(style, doubled), name=f"{style.name} in six", beats_per_bar=6,
        fills=tuple((drum, "." * bar + pattern) for drum, pattern in style.fills),
    )  # fmt: skip


def half_time_drums(style: SongStyle) -> SongStyle:
    """The drums at half the tempo of the beats, as in a half-time groove. Fills are unchanged."""
    lanes = _repatterned(style.lanes, lambda pattern: "".join(f"{letter}." for letter in pattern))
    return replace(style, name=f"{style.name} at half time", lanes=lanes)


def double_time_drums(style: SongStyle) -> SongStyle:
    """The drums at twice the tempo of the beats. Hits between their new steps are left out."""
    lanes = _repatterned(style.lanes, lambda pattern: 2 * pattern[::2])
    return replace(style, name=f"{style.name} at double time", lanes=lanes)


def drums_of(drums: SongStyle, rest: SongStyle) -> SongStyle:
    """The drums of one style with the parts of another. `ParameterError` unless their metre is the same."""
    _expect_metre(drums, rest.beats_per_bar)
    return replace(rest, name=f"{rest.name} with {drums.name}'s drums", lanes=drums.lanes, fills=drums.fills)


def reorchestrated(style: SongStyle, voices: dict[str, Sequence[str]], rng: np.random.Generator) -> SongStyle:
    """Other levels, and at times other voices of a role, silent drums, or drums without rests."""
    without_drums = rng.random() < _P_WITHOUT_DRUMS
    kept = [lane for lane in style.lanes if not without_drums and rng.random() >= _P_SILENT_LANE]
    lanes = tuple(_relevelled(lane, rng) for lane in kept)
    parts = []
    for part in style.parts:
        other = (str(rng.choice(voices[part.role])),) if rng.random() < _P_OTHER_VOICE else part.voices
        parts.append(replace(_relevelled(part, rng), voices=other))
    return replace(style, lanes=lanes, parts=tuple(parts), room_s=float(style.room_s * rng.uniform(0.6, 1.8)))


def _relevelled(source: Source, rng: np.random.Generator) -> Source:
    level_db = source.db + float(rng.normal(0.0, _LEVEL_DB))
    if rng.random() < _P_EVERYWHERE:
        return replace(source, db=level_db, enters=0.0, leaves=2.0)
    return replace(source, db=level_db)


def _with_patterns(style: SongStyle, change: Callable[[str], str]) -> SongStyle:
    return replace(style, lanes=_repatterned(style.lanes, change), parts=_repatterned(style.parts, change))


def _repatterned(sources: Sequence[Source], change: Callable[[str], str]) -> tuple[Source, ...]:
    return tuple(replace(s, patterns=tuple(change(pattern) for pattern in s.patterns)) for s in sources)


def _expect_metre(style: SongStyle, metre: int) -> None:
    if style.beats_per_bar != metre:
        raise ParameterError(f"expected a style in {metre}, got {style.name!r} in {style.beats_per_bar}")


# Any number of songs with known counts, on which trackers of beats and bars are trained and measured.
#
# Each song has a kind, so that a table can show the results of a tracker by kind. The seeds of training songs
# start at `FIRST_SEED`, and those of test songs at `FIRST_UNSEEN_SEED`.
#
# Six in a bar is counted as two threes, as dancers do.


FIRST_SEED = 20_000
FIRST_UNSEEN_SEED = 60_000
KINDS = (
    "steady", "ramp", "swing", "wandering", "rubato introduction", "three", "six", "pick-up", "half time",
    "double time", "break",
)  # fmt: skip
SOURCE = "synthesis"
_COUNTED = {3: 3, 4: 4, 6: 3}  # beats in a bar: counts in a bar
_TEMPO_MARGIN = 1.1  # beyond a genre's usual tempi
_P_HYBRID, _P_REORCHESTRATED = 0.3, 0.7
_BREAK_DB = -30.0


@dataclass(frozen=True, eq=False)
class CountedSong:
    """A rendered song with its true counts."""

    samples: NDArray[np.float32]  # (S, 2) at 44.1 kHz
    counts: Counts
    genre: str  # of its parts
    kind: str  # of `KINDS`


def counted_song(
    genre: str, kind: str, *, seed: int, duration_s: float = 50.0, others: Sequence[str] = tuple(STYLES)
) -> CountedSong:
    """A song of a kind of about this length. Everything that the kind does not determine is drawn at random.

    It may have the drums of one of the genres `others`. Some kinds change the metre of the genre ("three",
    "six"). Raises `ParameterError` for an unknown genre or kind.
    """
    if genre not in STYLES or kind not in KINDS:
        raise ParameterError(
            f"expected a genre among {', '.join(STYLES)} and a kind among {', '.join(KINDS)}, got {genre!r} "
            f"and {kind!r}"
        )
    rng = np.random.default_rng([seed, 1])
    style = _drawn_style(genre, kind, others, rng)
    bpm = float(rng.uniform(style.bpm[0] / _TEMPO_MARGIN, style.bpm[1] * _TEMPO_MARGIN))
    options: dict[str, object] = {"bpm": bpm, "swing": style.swing}
    if kind == "ramp":
        options["ramp_to_bpm"] = bpm * float(rng.choice([rng.uniform(0.7, 0.9), rng.uniform(1.1, 1.45)]))
    elif kind == "swing":
        options["swing"] = float(rng.uniform(0.5, 1.0))
    elif kind in ("wandering", "rubato introduction"):
        options["tempo_map"] = _free_tempo(bpm, duration_s, kind, rng)
    song = render_song(
        style,
        seed=seed,
        duration_s=duration_s,
        lead_in_s=float(rng.uniform(0.0, 2.0)),
        **options,  # type: ignore[arg-type]
    )
    metre = _COUNTED[song.beats_per_bar]
    numbers = numbers_in_bar(len(song.beat_times_s), metre)
    samples, times_s = song.samples, song.beat_times_s
    if kind == "pick-up":
        samples, times_s, numbers = _begun_within_a_bar(song, numbers, rng)
    elif kind == "break":
        samples = _with_breaks(song, rng)
    return CountedSong(samples, Counts(times_s, numbers, metre, SOURCE, 1.0), genre, kind)


def style_of(genre: str, kind: str, *, seed: int, others: Sequence[str] = tuple(STYLES)) -> SongStyle:
    """The style in which `counted_song` renders. Its name has the genres of its parts and of its drums."""
    return _drawn_style(genre, kind, others, np.random.default_rng([seed, 1]))


def _drawn_style(genre: str, kind: str, others: Sequence[str], rng: np.random.Generator) -> SongStyle:
    style = STYLES[genre]
    same_metre = [name for name in others if STYLES[name].beats_per_bar == style.beats_per_bar]
    if same_metre and rng.random() < _P_HYBRID:
        style = drums_of(STYLES[str(rng.choice(same_metre))], style)
    if rng.random() < _P_REORCHESTRATED:
        style = reorchestrated(style, _voices_by_role(), rng)
    if kind in ("three", "six") and style.beats_per_bar == 4:
        style = in_three(style, dropped=int(rng.integers(1, 4)))
    if kind == "six":
        style = in_six(style)
    elif kind == "half time":
        style = half_time_drums(style)
    elif kind == "double time":
        style = double_time_drums(style)
    return style


def _voices_by_role() -> dict[str, Sequence[str]]:
    voices: dict[str, set[str]] = {}
    for style in STYLES.values():
        for part in style.parts:
            voices.setdefault(part.role, set()).update(part.voices)
    return {role: sorted(names) for role, names in voices.items()}


def _free_tempo(
    bpm: float, duration_s: float, kind: str, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """A tempo that varies by a few per cent throughout, or by more in the first bars alone."""
    n_beats = bpm * duration_s / 60.0
    if kind == "wandering":
        beats = np.arange(0.0, n_beats, 6.0)
        drift = np.cumsum(rng.normal(0.0, 0.02, len(beats)))
        return [
            (float(b), float(bpm * np.exp(np.clip(d, -0.2, 0.2)))) for b, d in zip(beats, drift, strict=True)
        ]
    free = [(float(b), float(bpm * rng.uniform(0.75, 1.15))) for b in range(0, 12, 2)]
    return [*free, (14.0, bpm)]


def _begun_within_a_bar(
    song: SyntheticSong, numbers: NDArray[np.int64], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.int64]]:
    """The song from a beat of its first bar other than the first, with a little silence before it."""
    first = int(rng.integers(1, song.beats_per_bar))
    silence_s = float(rng.uniform(0.02, 0.5))
    start = round((song.beat_times_s[first] - 0.01) * RATE_HZ)
    silence = np.zeros((round(silence_s * RATE_HZ), 2), np.float32)
    moved_s = song.beat_times_s[first:] - start / RATE_HZ + len(silence) / RATE_HZ
    return np.concatenate([silence, song.samples[start:]]), moved_s, numbers[first:]


def _with_breaks(song: SyntheticSong, rng: np.random.Generator) -> NDArray[np.float32]:
    """The song nearly silent for one or two bars, three times."""
    gain = np.ones(len(song.samples), np.float32)
    bars = np.rint(song.bar_times_s * RATE_HZ).astype(np.int64)
    for first in rng.choice(np.arange(2, len(bars) - 3), size=3):
        gain[bars[first] : bars[first + int(rng.integers(1, 3))]] = 10.0 ** (_BREAK_DB / 20.0)
    return song.samples * gain[:, None]


def drawn_song(seed: int, genres: Sequence[str] = tuple(STYLES), *, duration_s: float = 50.0) -> CountedSong:
    """A song of any genre and kind, drawn at random, a third of them in three."""
    rng = np.random.default_rng([seed, 0])
    genre, kind = str(rng.choice(genres)), str(rng.choice(KINDS, p=_KIND_SHARES))
    return counted_song(genre, kind, seed=seed, duration_s=duration_s, others=genres)


_SHARES = {"steady": 3, "ramp": 2, "swing": 2, "wandering": 1.5, "three": 4, "six": 1.5, "pick-up": 1.5}
_KIND_SHARES = np.array([_SHARES.get(kind, 0.7) for kind in KINDS])
_KIND_SHARES /= _KIND_SHARES.sum()
