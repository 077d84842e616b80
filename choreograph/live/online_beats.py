"""Beats and bars of music while it plays, from what was played so far, and `BeatClock`, which continues them.

Every half second, the last seconds are analysed as a song of their own: the network and the bar pointer find
beats, and the metre model numbers them. The newest beats give a tempo and a phase, and the clock follows
them. So the clock is causal, and what an analysis finds at the edge of what was played is not taken over at
once: a small error is corrected within two beats, and other beats must be found several times in a row.

That short windows are analysed again and again is the method of Meier, Chiu and Müller, *A real-time beat
tracking system with zero latency and enhanced controllability* (2024), who also extrapolate the beats.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from choreograph.core.counts import FROM_MUSIC, NO_COUNTS, Counts
from choreograph.core.numerics import Floats
from choreograph.core.timebase import MUSIC_FPS, SAMPLE_RATE_HZ
from choreograph.live.stream import stay_behind
from choreograph.music.bars import track_bars, with_eighths
from choreograph.music.mel import MEL_BANDS, MEL_WINDOW, log_mel_of_windows
from choreograph.nets.music_counts import MusicCounts, network_beats, shipped_music_counts

# The beats of music that is still playing, continued into the seconds that come.


CORRECTION_BEATS = (
    2.0  # in which an error of the phase is corrected, by a tempo up to a quarter faster or slower
)


@dataclass(frozen=True)
class BeatClock:
    """Beats as positions: beat i is where the position is i. The position is continuous and increases.

    Between the start and the time when the correction ends, the position runs at one rate, and from then on
    at the tempo. Before the start it is continued backwards at the tempo.
    """

    start_s: float  # in the stream
    start_beat: float  # the position there
    steady_s: float  # when a correction of the phase ends, after the start
    steady_beat: float  # the position there
    period_s: float  # between two beats
    metre: int = 0  # beats in a bar, or 0 if bars are not known
    first_number: int = 0  # number in the bar of beat 0, from 0 to metre - 1
    generation: int = 0  # another one has other beats, and not only corrected ones

    @classmethod
    def steady(cls, time_s: float, beat: float, period_s: float, generation: int) -> BeatClock:
        """A clock with a position at a time, without a correction."""
        return cls(time_s, beat, time_s + period_s, beat + 1.0, period_s, generation=generation)

    def beat_at(self, times_s: ArrayLike) -> Floats:
        """The positions at times (...) of the stream."""
        times = np.asarray(times_s, np.float64)
        before = self.start_beat + (times - self.start_s) / self.period_s
        after = self.steady_beat + (times - self.steady_s) / self.period_s
        share = (times - self.start_s) / (self.steady_s - self.start_s)
        between = self.start_beat + share * (self.steady_beat - self.start_beat)
        return np.where(share < 0, before, np.where(share > 1, after, between))

    def time_at(self, beats: ArrayLike) -> Floats:
        """The times in the stream at positions (...): inverse of `beat_at`."""
        given = np.asarray(beats, np.float64)
        before = self.start_s + (given - self.start_beat) * self.period_s
        after = self.steady_s + (given - self.steady_beat) * self.period_s
        share = (given - self.start_beat) / (self.steady_beat - self.start_beat)
        between = self.start_s + share * (self.steady_s - self.start_s)
        return np.where(share < 0, before, np.where(share > 1, after, between))

    def number_of(self, beats: ArrayLike) -> np.ndarray:
        """The numbers in the bar, from 1, of whole positions (...), or 0 if bars are not known."""
        index = np.asarray(beats, np.int64)
        return (index + self.first_number) % self.metre + 1 if self.metre else np.zeros_like(index)

    def counts(self, from_s: float, to_s: float) -> Counts:
        """The beats from one time of the stream to another, with times from the first one."""
        first, last = np.ceil(self.beat_at(from_s) - 1e-9), np.floor(self.beat_at(to_s) + 1e-9)
        if last < first:
            return NO_COUNTS
        index = np.arange(int(first), int(last) + 1)
        return Counts(
            np.clip(self.time_at(index) - from_s, 0.0, to_s - from_s), self.number_of(index), self.metre,
            FROM_MUSIC,
        )  # fmt: skip

    def followed(self, time_s: float, error_beats: float, period_s: float) -> BeatClock:
        """This clock from a time on, with an error of its phase there corrected, at another tempo.

        The error is what must be added to the position, at most half a beat.
        """
        beat = float(self.beat_at(time_s))
        corrected = beat + CORRECTION_BEATS + error_beats
        return BeatClock(
            time_s, beat, time_s + CORRECTION_BEATS * period_s, corrected, period_s, self.metre,
            self.first_number, self.generation,
        )  # fmt: skip


# The beats of what was played.


HOP_S = 0.5  # between two analyses
WINDOW_S = 20.0  # of the music that is analysed
_FEWEST_BEATS = 4
_LEAST_S = 4.0  # of music before the first analysis
_FITTED_BEATS = 16  # the newest ones, which give tempo and phase
_LEAD_BEATS = 4.0  # after the newest beat, for which the tempo is predicted
_MOST_CHANGE = 0.07  # relative, of the tempo until then
_SAME_TEMPO = 0.12  # relative change of a tempo that is followed
_SAME_PHASE = 0.3  # error of a phase in beats that is corrected
_GAIN = 0.7  # share of an error that is corrected
_TIMES_OTHER = 4  # analyses in a row that must find other beats
_NUMBERINGS = 8  # the latest analyses, most of which decide on count 1
_SILENT_S = 2.5  # without sound, after which there is no clock
_SILENCE = 1e-3  # amplitude, -60 dB


@dataclass(frozen=True)
class _Found:
    """What one analysis finds."""

    last_s: float  # the newest beat, by a curve through the newest ones
    period_s: float  # of the beats that come
    metre: int
    number: int  # of the newest beat


class OnlineBeats:
    """Follows beats and bars of a stream of samples, mono at 22.05 kHz."""

    def __init__(self, net: MusicCounts | None = None, *, window_s: float = WINDOW_S) -> None:
        self._net, self._window_s = net or shipped_music_counts(), window_s
        self._samples = np.zeros(0, np.float32)  # the last ones
        self._first = 0  # index in the stream of the first of them
        self._mel = np.zeros((0, MEL_BANDS), np.float32)  # of the last frames, as in `music.mel`
        self._n_frames = 0  # number of all frames so far
        self._analysed = self._sounded = 0  # samples at the last analysis, and at the last sound
        self._other: deque[_Found] = deque(maxlen=_TIMES_OTHER)
        self._numberings: deque[tuple[int, int]] = deque(maxlen=_NUMBERINGS)
        self._generation = 0
        self.clock: BeatClock | None = None  # of the beats from now on, or None if none are known

    @property
    def heard_s(self) -> float:
        """Seconds of the stream so far."""
        return (self._first + len(self._samples)) / SAMPLE_RATE_HZ

    @property
    def recent(self) -> tuple[float, NDArray[np.float32]]:
        """The last seconds of the stream: the time of their start, and their samples (S,)."""
        return self._first / SAMPLE_RATE_HZ, self._samples

    def feed(self, samples: NDArray[np.floating]) -> bool:
        """Add samples (S,) that follow those before. Returns whether the music was analysed again."""
        block = np.asarray(samples, np.float32)
        loud = np.flatnonzero(np.abs(block) > _SILENCE)
        if len(loud):
            self._sounded = self._first + len(self._samples) + int(loud[-1]) + 1
        self._samples = np.concatenate([self._samples, block])
        self._add_frames()
        n_fed = self._first + len(self._samples)
        if n_fed - self._analysed < HOP_S * SAMPLE_RATE_HZ:
            return False
        self._analysed = n_fed
        if n_fed - self._sounded > _SILENT_S * SAMPLE_RATE_HZ:
            self._forget()
        elif len(self._mel) >= _LEAST_S * MUSIC_FPS:
            self._follow(self._counted())
        return True

    def _add_frames(self) -> None:
        """Compute the frames whose windows are complete, and drop what is older than the window."""
        half = MEL_WINDOW // 2
        n_complete = self._first + len(self._samples) - half  # samples before half a window
        n_frames = int(np.floor(n_complete * MUSIC_FPS / SAMPLE_RATE_HZ)) + 1
        centres = np.rint(np.arange(self._n_frames, n_frames) * SAMPLE_RATE_HZ / MUSIC_FPS).astype(np.int64)
        if len(centres) == 0:
            return
        starts = centres - half - self._first
        before = max(0, -int(starts[0]))  # silence before the stream
        padded = np.concatenate([np.zeros(before, np.float32), self._samples])
        windows = np.lib.stride_tricks.sliding_window_view(padded, MEL_WINDOW)[starts + before]
        keep = round(self._window_s * MUSIC_FPS)
        self._mel = np.concatenate([self._mel, log_mel_of_windows(windows)])[-keep:]
        self._n_frames = n_frames
        drop = round((n_frames - len(self._mel)) * SAMPLE_RATE_HZ / MUSIC_FPS) - half - self._first
        if drop > 0:
            self._samples, self._first = self._samples[drop:], self._first + drop

    def _counted(self) -> Counts:
        """The beats of the window with their numbers, in seconds of the stream."""
        first_frame = self._n_frames - len(self._mel)
        start = round(first_frame * SAMPLE_RATE_HZ / MUSIC_FPS)
        samples = self._samples[start - self._first :]
        beats_s = network_beats(self._mel, self._net)
        beats_s = beats_s[beats_s < len(samples) / SAMPLE_RATE_HZ]
        if len(beats_s) < _FEWEST_BEATS:
            return NO_COUNTS
        counts = with_eighths(samples, self._mel, track_bars(samples, self._mel, beats_s))
        return replace(counts, times_s=counts.times_s + first_frame / MUSIC_FPS)

    def _follow(self, counts: Counts) -> None:
        if len(counts) < _FEWEST_BEATS:
            return
        now_s, clock, found = self.heard_s, self.clock, _newest(counts)
        if clock is not None:
            error = (now_s - found.last_s) / found.period_s - float(clock.beat_at(now_s))
            error -= round(error)
            same_tempo = abs(np.log(found.period_s / clock.period_s)) < _SAME_TEMPO
            if same_tempo and abs(error) < _SAME_PHASE:
                self._other.clear()
                self.clock = self._numbered(clock.followed(now_s, _GAIN * error, found.period_s), found)
                return
        if self._is_found_again(found):
            self._generation += 1
            self._other.clear()
            self._numberings.clear()
            beat = (now_s - found.last_s) / found.period_s
            if clock is not None:  # the next whole position is the next beat
                beat += np.ceil(float(clock.beat_at(now_s)) - beat)
            self.clock = self._numbered(
                BeatClock.steady(now_s, beat, found.period_s, self._generation), found
            )

    def _is_found_again(self, found: _Found) -> bool:
        """Whether the latest analyses agree with this one. The first beats of all are believed sooner."""
        if self._other:
            last = self._other[-1]
            error = (found.last_s - last.last_s) / found.period_s
            if (
                abs(np.log(found.period_s / last.period_s)) > _SAME_TEMPO
                or abs(error - round(error)) > _SAME_PHASE
            ):
                self._other.clear()
        self._other.append(found)
        return len(self._other) >= (2 if self.clock is None else _TIMES_OTHER)

    def _numbered(self, clock: BeatClock, found: _Found) -> BeatClock:
        """The clock with the metre and count 1 of most of the latest analyses."""
        if found.metre:
            index = round(
                float(clock.beat_at(clock.start_s)) - (clock.start_s - found.last_s) / found.period_s
            )
            self._numberings.append((found.metre, (found.number - 1 - index) % found.metre))
        if not self._numberings:
            return clock
        votes = list(self._numberings)
        own = (clock.metre, clock.first_number)
        best = max(set(votes), key=lambda one: (votes.count(one), one == own, one == votes[-1]))
        return replace(clock, metre=best[0], first_number=best[1])

    def _forget(self) -> None:
        self.clock = None
        self._other.clear()
        self._numberings.clear()


def _newest(counts: Counts) -> _Found:
    """The curve through the newest beats, whose tempo may change evenly, and the tempo a few beats later."""
    newest = counts.times_s[-_FITTED_BEATS:]
    index = np.arange(len(newest)) - (len(newest) - 1.0)
    curve = np.polyfit(index, newest, 2 if len(newest) >= _FITTED_BEATS // 2 else 1)
    last_s, period_s = float(curve[-1]), float(curve[-2])
    later_s = period_s + (2 * _LEAD_BEATS * float(curve[0]) if len(curve) == 3 else 0.0)
    most = _MOST_CHANGE * period_s
    period_s += min(max(later_s - period_s, -most), most)
    return _Found(last_s, period_s, counts.metre, int(counts.numbers[-1]))


# In a process of its own, so that the analysis does not delay the frames that are sent.


_LISTENERS: list[OnlineBeats] = []


def open_listener() -> None:
    """Open a follower of beats in this process, for `hear_here`."""
    stay_behind()
    pulses = np.zeros(round(2 * _LEAST_S * SAMPLE_RATE_HZ), np.float32)
    pulses[:: SAMPLE_RATE_HZ // 2] = 1.0
    OnlineBeats().feed(pulses)  # whose first analysis loads and compiles what the others use
    _LISTENERS.append(OnlineBeats())


def hear_here(samples: NDArray[np.floating]) -> BeatClock | None:
    """The clock after more samples, by the follower of this process."""
    _LISTENERS[0].feed(samples)
    return _LISTENERS[0].clock
