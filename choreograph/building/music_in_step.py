"""The music of a take as if it had been danced in step: its beats on the take's counts, bars on bars.

Music and motion of a recorded pair need not be in step. A network that learns to dance by the phase of the
music needs pairs that are. Here the music is brought to the motion, which stays as it was danced; in a dance
it is the motion that is warped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.building.song_cache import AnalysedSong
from choreograph.counts import Counts
from choreograph.features.count_phase import count_phase, index_at, time_at
from choreograph.features.frame_rhythm import FRAME_RHYTHM_FPS, FRAME_RHYTHM_NAMES, frame_rhythm
from choreograph.features.metrical_level import level_at_tempo, tempo_bpm
from choreograph.features.word_audio import rhythm_from, word_spectra
from choreograph.takes import Take
from choreograph.timebase import frame_times_s, times_to_frames
from choreograph.warping import steady_times_s

Floats = NDArray[np.float64]

_FEWEST_COUNTS = 8


@dataclass(frozen=True, eq=False)
class TakeMusic:
    """What the rollout network hears with a take, from the take's first frame on, at 30 fps."""

    rhythm: NDArray[np.float32]  # (T, 4) `features.frame_rhythm`
    count_phase: NDArray[np.float32]  # (T, 4) `features.count_phase`
    spectral: NDArray[np.float32]  # (N, 87) of each word


def music_of_take(take: Take, analysed: AnalysedSong, bounds_s: Floats) -> TakeMusic:
    """The music of a take whose words begin and end at `bounds_s` (N + 1,), in step with its counts.

    `analysed` has samples. As recorded, and without phase, if too few counts of take or song are known.
    """
    song, counts = analysed.song, take.counts
    assert song is not None
    n_frames = 1 + int(np.ceil(times_to_frames(take.motion.duration_s, FRAME_RHYTHM_FPS)))
    times_s = frame_times_s(n_frames + FRAME_RHYTHM_FPS, FRAME_RHYTHM_FPS)
    if min(len(counts), len(analysed.counts)) < _FEWEST_COUNTS:
        return TakeMusic(
            rhythm_from(song, analysed.beat_times_s, take.song_start_s),
            np.zeros((len(times_s), 4), np.float32),
            word_spectra(song, take.song_start_s + bounds_s),
        )
    beats = analysed.counts
    if counts.has_bars:
        beats = level_at_tempo(song.samples, analysed.log_mel, beats, counts.metre, tempo_bpm(counts))
    of_take = steady_times_s(counts.times_s)
    shift = beats_ahead(of_take, counts, beats, take.song_start_s)
    beats_s = steady_times_s(beats.times_s)
    return TakeMusic(
        _rhythm_at(song, beats_s, time_at(beats_s, index_at(of_take, times_s) + shift), of_take),
        count_phase(counts, times_s),
        word_spectra(song, np.sort(time_at(beats_s, index_at(of_take, bounds_s) + shift))),
    )


def beats_ahead(count_times_s: Floats, counts: Counts, beats: Counts, song_start_s: float) -> int:
    """How many beats of its song lie before a take's first count, when the take is in step.

    The number nearest to how music and motion were recorded, of those that have count 1 on a downbeat where
    both have bars of one metre.
    """
    recorded = float(
        np.median(index_at(beats.times_s, count_times_s + song_start_s) - np.arange(len(counts)))
    )
    shifts = round(recorded) + np.arange(-counts.metre, counts.metre + 1)
    if counts.has_bars and beats.metre == counts.metre:
        of_take = int(counts.numbers[0])
        in_bar = [_number_at(beats, int(shift)) == of_take for shift in shifts]
        shifts = shifts[in_bar] if any(in_bar) else shifts
    return int(shifts[np.argmin(np.abs(shifts - recorded))])


def _number_at(beats: Counts, index: int) -> int:
    """The number in the bar of a beat, also before the first and after the last."""
    nearest = min(max(index, 0), len(beats) - 1)
    return (int(beats.numbers[nearest]) - 1 + index - nearest) % beats.metre + 1


def _rhythm_at(
    song: Song, beats_s: Floats, song_times_s: Floats, count_times_s: Floats
) -> NDArray[np.float32]:
    """The rhythm of a song (T, 4) at the time in it that each frame of a take has, beats on counts."""
    inside = beats_s[(beats_s >= 0) & (beats_s <= song.duration_s)]
    rows = frame_rhythm(song.samples, inside)
    # The nearest rows, not rows between: onsets are short.
    frames = np.rint(times_to_frames(song_times_s, FRAME_RHYTHM_FPS)).astype(np.int64)
    rhythm = rows[frames.clip(0, len(rows) - 1)].copy()
    counted = np.rint(times_to_frames(count_times_s, FRAME_RHYTHM_FPS)).astype(np.int64)
    rhythm[:, FRAME_RHYTHM_NAMES.index("beat")] = np.isin(np.arange(len(rhythm)), counted)
    return rhythm
