"""Beats of a song by the tempo path (the default), by librosa or beat-this, or from a file."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import ANNOTATED, MAX_METRE, Counts
from choreograph.core.errors import FormatError, ParameterError
from choreograph.core.files import MAX_TABLE_BYTES, read_text
from choreograph.core.kernel_cache import njit
from choreograph.core.numerics import Floats, Indices, frame_blocks
from choreograph.core.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, frames_to_seconds
from choreograph.music.mel import autocorrelations, checked_log_mel, mel_band_hz, onset_envelopes
from choreograph.music.song import Song

# Beat tracking of music whose tempo may change. Tempo and beats are tracked together.
#
# librosa's tracker assumes one tempo for the whole song and fails halfway through a ramp from 90 to 140 BPM.
# Here every interval may differ a little from the one before, according to the local autocorrelation of the
# onsets. The method is dynamic programming over beat time and interval, after Ellis, *Beat tracking by
# dynamic programming*, 2007, with the interval as part of the state. Where another piece of music begins, as
# in a medley, the interval may change to any other at a fixed cost.


_SHORTEST_PERIOD, _LONGEST_PERIOD = 15, 80  # frames between beats at 60 fps: 240 to 45 BPM
_BANDS_HZ = (0.0, 120.0, 250.0, 2000.0, 11025.0)  # kick, bass, melody, percussion
_BAND_WEIGHTS = (0.4, 0.2, 0.2, 0.2)  # the kick decides which of two even pulses is the beat
_LEVEL_S = 8.0  # span of the local level normalisation
_COMPRESSION = 0.6  # exponent of the strength, since a loud accent need not be a beat
_CONTEXT_S = 8.0  # length of the music from which the local tempo is estimated
_TEMPO_HOP = 30  # frames between two tempo estimates
_TEMPO_WEIGHT = 1.5  # of the autocorrelation, relative to the onset strength at the beats
_CHANGE_PENALTY = 1000.0
# Of any other tempo. Up to 75, breaks look like new music. From 600 on, new music is missed.
_NEW_TEMPO_PENALTY = 250.0
# The tempo prior decides between octaves.
_PRIOR_BPM, _PRIOR_OCTAVES = 112.0, 0.7
# Delay of the peak of the amplitude rise: 11 ms in the median (spread 6) over mixed songs of eleven genres
# whose beats are known to the sample. For a single kick or click it is between 1 ms and -7 ms.
_LAG_S = 0.011


def tempo_path_beats(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), throughout a song, or empty if it is silent.

    `log_mel` (T, 96) is the result of `music.mel.log_mel`. Settings were tuned on synthetic drum loops and on
    real songs of known dance tempo, none of them from a benchmark. Raises `ParameterError` for another shape.
    """
    return np.maximum(0.0, path_of(onset_strength(checked_log_mel(log_mel))) - _LAG_S)


def path_of(strength: NDArray[np.floating]) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), at which a strength (T,) at 60 fps peaks, or empty if it is 0 throughout."""
    level = np.asarray(strength, np.float64)
    if not level.any():
        return np.zeros(0)
    frames = best_beat_sequence(
        level, _tempo_gain(level), _TEMPO_HOP, _SHORTEST_PERIOD, _CHANGE_PENALTY, _NEW_TEMPO_PENALTY
    )
    return frames_to_seconds(frames, MUSIC_FPS)


def onset_strength(log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
    """Onset strength: rise of amplitude in four bands, level-normalised over 8 s, summed: (T,) at 60 fps.

    The amplitude is used and not its logarithm. In the logarithm, an open hat or a bass note between the
    beats rises as much as the kick on them, and the tracker slips by half a period.
    """
    hz = mel_band_hz()
    total = np.zeros(len(log_mel))
    amplitude = np.empty(len(log_mel))
    for low, high, weight in zip(_BANDS_HZ, _BANDS_HZ[1:], _BAND_WEIGHTS, strict=False):
        for block in frame_blocks(len(log_mel)):
            power = np.exp(log_mel[block, (hz >= low) & (hz < high)])
            amplitude[block] = np.sqrt(power.sum(axis=1, dtype=np.float64))
        rise = np.zeros(len(log_mel))
        rise[2:] = np.maximum(0.0, amplitude[2:] - amplitude[:-2])
        rise[rise < 1e-3 * rise.max(initial=0.0)] = 0.0  # noise in a pause is not an onset
        total += weight * level_normalized(rise)
    return level_normalized(total) ** _COMPRESSION


def level_normalized(strength: NDArray[np.floating]) -> NDArray[np.float64]:
    """Onset strength (T,) over its local RMS (8 s), which is floored at a tenth of the song's RMS."""
    from scipy.ndimage import uniform_filter1d

    power = np.asarray(strength, np.float64) ** 2
    local = uniform_filter1d(power, round(_LEVEL_S * MUSIC_FPS), mode="nearest")
    normalized: NDArray[np.float64] = strength / np.sqrt(
        np.maximum(np.maximum(local, 0.01 * power.mean()), 1e-20)
    )
    return normalized


def _tempo_gain(strength: NDArray[np.float64]) -> NDArray[np.float64]:
    """Score of each period, (G, P): weighted autocorrelation of the onsets plus the log tempo prior."""
    periods = np.arange(_SHORTEST_PERIOD, _LONGEST_PERIOD + 1)
    centres = np.arange(0, len(strength), _TEMPO_HOP)
    autocorrelation = autocorrelations(strength[:, None], centres, _CONTEXT_S)[:, 0, periods]  # (G, P)
    octaves = np.log2(60.0 * MUSIC_FPS / periods / _PRIOR_BPM)
    return _TEMPO_WEIGHT * autocorrelation - 0.5 * (octaves / _PRIOR_OCTAVES) ** 2


_NONE = 0  # the first beat, which has no interval before it


@njit(nogil=True)
def best_beat_sequence(
    strength: Floats,
    tempo_gain: Floats,
    gain_hop: int,
    first_period: int,
    change_penalty: float,
    new_tempo_penalty: float,
) -> Indices:
    """Frames of the beat sequence with the highest score over the whole song.

    A state is a beat at frame t whose interval to the previous beat is p frames. Its score is p times
    (strength[t] + tempo_gain there). So the total is a time average, and a fast tempo has no advantage from
    more beats. A change of p costs `change_penalty` · p · (relative change)², the first half frame free
    because the frame grid forces it. For `new_tempo_penalty`, p may change to any value, as at the start of
    another piece of music.

    Shapes are strength (T,) and tempo_gain (G, P). Column i of the latter is the period first_period + i, and
    row j the frames from j · gain_hop on. Returns int64 (Q,), at least one frame.
    """
    n_frames, n_periods = len(strength), tempo_gain.shape[1]
    last_period = first_period + n_periods - 1
    ring = np.full((last_period + 1, n_periods), -np.inf)  # scores of the latest frames
    best_columns = np.zeros(n_frames, np.int64)  # of the period with the highest score at each frame
    previous_period = np.zeros((n_frames, n_periods), np.uint8)  # the preceding period, or _NONE
    best_end, best_score, best_period = 0, -np.inf, first_period
    for t in range(n_frames):
        row = ring[t % (last_period + 1)]
        gains = tempo_gain[min(t // gain_hop, len(tempo_gain) - 1)]
        for i in range(n_periods):
            period = first_period + i
            gain = strength[t] + gains[i]
            if t < period:  # of the interval of a first beat, only the part inside the song counts
                row[i] = (t + 1) * gain
                continue
            previous_scores = ring[(t - period) % (last_period + 1)]
            column = best_columns[t - period]
            best, best_previous = previous_scores[column] - new_tempo_penalty, first_period + column
            low = max(first_period, int(period * 0.85))
            high = min(last_period, int(period * 1.18) + 1)
            for previous in range(low, high + 1):
                change = max(abs(period - previous) - 0.5, 0.0) / period
                score = previous_scores[previous - first_period] - change_penalty * period * change * change
                if score > best:
                    best, best_previous = score, previous
            row[i] = best + period * gain
            previous_period[t, i] = best_previous
        best_columns[t] = row.argmax()
        for i in range(n_periods):
            remaining = n_frames - 1 - t
            if remaining < first_period + i and row[i] + remaining * gains[i] > best_score:
                best_end, best_score, best_period = t, row[i] + remaining * gains[i], first_period + i
    beats = [best_end]
    t, period = best_end, best_period
    while previous_period[t, period - first_period] != _NONE:
        best_previous = previous_period[t, period - first_period]
        t, period = t - period, int(best_previous)
        beats.append(t)
    return np.array(beats[::-1], np.int64)


# Beat trackers behind one interface: the tempo path (default), librosa, or beat-this (an extra).
#
# Every tracker makes errors, most often octave errors (half or double tempo). So all later stages take beats
# as an argument and accept better ones.


_MIN_DURATION_S = 1.0  # a shorter song may have fewer than two beats, and so no tempo
# The tempo prior decides between octaves. librosa's defaults (120 BPM, one octave) put half of the slow
# waltzes (84 to 90 BPM) at double tempo.
_STEADY_PRIOR_BPM, _STEADY_PRIOR_OCTAVES = 100.0, 0.7
_LENGTH_SLACK_S = 0.1
_ONSET_LEAD_S = 1.0 / MUSIC_FPS  # the log power of a 93 ms window rises this long before the onset


class BeatTracker(Protocol):
    """The interface of beat trackers."""

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
        """Increasing beat times in seconds, (Q,), or empty if the song is silent.

        `log_mel` (T, 96) is that of the song, of `music.mel.log_mel`.
        """
        ...


class TempoPathBeats:
    """Tracks beats and a varying tempo together (see `music.beats`)."""

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
        """The song's beats, (Q,) seconds, or none in a song shorter than a second."""
        if song.duration_s < _MIN_DURATION_S:
            return np.zeros(0)
        beats = tempo_path_beats(log_mel)
        return beats[beats < song.duration_s]


class LibrosaBeats:
    """librosa's tracker (Ellis's dynamic programming), adapted to keep the beat through quiet passages.

    The level of the onset strength is normalised over 8 s before tracking, and beats missing from an
    otherwise steady pulse are filled in (`fill_missing_beats`).
    """

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
        """The song's beats, (Q,) seconds, or none in a song shorter than a second."""
        if song.duration_s < _MIN_DURATION_S:
            return np.zeros(0)
        return librosa_beats(log_mel, song.duration_s)


def librosa_beats(log_mel: NDArray[np.floating], duration_s: float) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), of log-mel (T, 96) at 60 fps, or empty if silent. See `LibrosaBeats`."""
    strength = level_normalized(onset_envelopes(log_mel).mean(axis=1)).astype(np.float32)  # (T,)
    if not strength.any():
        return np.zeros(0)
    import librosa  # takes seconds, and is not needed by the default tracker

    bpm = librosa.feature.tempo(
        onset_envelope=strength,
        sr=MUSIC_FPS,
        hop_length=1,
        start_bpm=_STEADY_PRIOR_BPM,
        std_bpm=_STEADY_PRIOR_OCTAVES,
    )[0]
    _, frames = librosa.beat.beat_track(
        onset_envelope=strength, sr=MUSIC_FPS, hop_length=1, bpm=bpm, trim=False
    )
    beats = frames_to_seconds(frames, MUSIC_FPS) + _ONSET_LEAD_S
    return fill_missing_beats(beats[beats < duration_s], duration_s)


class BeatThisBeats:
    """The beat-this network, an optional extra. It downloads its weights on first use."""

    def __init__(self) -> None:
        try:
            from beat_this.inference import Audio2Beats
        except ImportError as error:
            raise ParameterError(
                "expected beat-this for the tracker 'beat-this', got none: install the extra 'beat-this'"
            ) from error
        from urllib.error import URLError

        try:
            self._audio_to_beats = Audio2Beats(checkpoint_path="final0", device="cpu", dbn=False)
        except (URLError, OSError, RuntimeError) as error:
            reason = (str(error) or type(error).__name__).splitlines()[0]
            raise ParameterError(
                f"expected beat-this to load its weights, got: {reason} (offline? they are fetched once)"
            ) from error

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
        """The song's beats, (Q,) seconds. The network takes the samples, not the log-mel."""
        beats, _ = self._audio_to_beats(song.samples, SAMPLE_RATE_HZ)
        return np.asarray(beats, np.float64)


DEFAULT_TRACKER = "tempo-path"
TRACKERS: dict[str, Callable[[], BeatTracker]] = {
    DEFAULT_TRACKER: TempoPathBeats, "librosa": LibrosaBeats, "beat-this": BeatThisBeats,
}  # fmt: skip


def get_beat_tracker(name: str = DEFAULT_TRACKER) -> BeatTracker:
    """The tracker of that name among `TRACKERS`. Raises `ParameterError` if unknown or unavailable."""
    if name not in TRACKERS:
        raise ParameterError(f"expected a beat tracker among {', '.join(TRACKERS)}, got {name!r}")
    return TRACKERS[name]()


def checked_beat_times_s(beat_times_s: NDArray[np.floating], duration_s: float) -> NDArray[np.float64]:
    """Beats (Q,) of a song as float64. Raises `ParameterError` unless increasing, finite and inside it.

    Beats up to 0.1 s past the end are accepted, since the length of a song differs between decoders by a
    packet.
    """
    beats = np.asarray(beat_times_s, np.float64)
    if beats.ndim != 1 or not np.isfinite(beats).all() or (np.diff(beats) <= 0).any():
        raise ParameterError(
            f"expected increasing, finite beat_times_s (Q,), got shape {beats.shape}: unsorted or doubled?"
        )
    if len(beats) and not (beats[0] >= 0 and beats[-1] <= duration_s + _LENGTH_SLACK_S):
        raise ParameterError(
            f"expected beats within the song's {duration_s:.2f} s, got {beats[0]:.2f} to {beats[-1]:.2f} s: "
            "they may be another song's"
        )
    return beats


def fill_missing_beats(beat_times_s: NDArray[np.floating], duration_s: float) -> NDArray[np.float64]:
    """Beats with gaps above 1.5 periods divided evenly, extrapolated to both ends of the song.

    The period is local, the median of the 8 intervals nearest to a gap. Fewer than three beats are returned
    unchanged, since they define no period.
    """
    beats = np.asarray(beat_times_s, np.float64)
    if len(beats) < 3:
        return beats
    intervals = np.diff(beats)
    period = float(np.median(intervals[:8]))
    before = np.arange(int(beats[0] / period + 1e-9), 0, -1, dtype=np.float64)  # beats
    # Rounding may lead below 0.
    parts: list[NDArray[np.float64]] = [np.maximum(0.0, beats[0] - period * before)]
    for i, gap in enumerate(intervals):
        near = intervals[max(0, i - 4) : i + 5]
        period = float(np.median(near))
        pieces = max(1, round(gap / period)) if gap > 1.5 * period else 1
        parts.append(beats[i] + gap * np.arange(pieces) / pieces)
    period = float(np.median(intervals[-8:]))
    parts.append(np.arange(beats[-1], max(duration_s, beats[-1] + 1e-6), period))
    return np.asarray(np.concatenate(parts), np.float64)


# Beats of a song from a text file, one per line, with or without their numbers in the bar.
#
# A line is `12.34` or `12.34 1` (a time in seconds and a number, as written by beat trackers), or
# `12.34 12.34 1` (start, end and label, as in label tracks of audio editors). Spaces, tabs, commas or
# semicolons separate cells. `#` begins a comment. A first line of names is skipped, and so are labels that
# are words, such as `beat`, if no beat has a number. Labels may count bars and beats, as in `3.1`. If only
# some beats have a number, the others count on from them.


_CELL = re.compile(r'"[^"]*"|[^\s,;"]+')
_BAR_AND_BEAT = re.compile(r"\d+\.([1-9]\d?)")
_LAYOUT = "a time in seconds and, optionally, a number in the bar on every line"


def read_beats(path: str | Path, *, start_s: float = 0.0, duration_s: float = np.inf) -> Counts:
    """Beats from a file. The metre is the highest number, 0 if there are none.

    Times in the file are those of the song file. Those returned begin at `start_s`, and beats outside
    [start_s, start_s + duration_s] are left out. Raises `FormatError` if the file cannot be read, times do
    not increase, or numbers are not those of bars.
    """
    path = Path(path)
    rows = _rows(path)
    times_s = np.array([time_s for _, time_s, _ in rows])  # (Q,)
    if not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any() or (times_s < 0).any():
        raise FormatError(f"{path}: expected increasing times from 0 s on, got others: unsorted or doubled?")
    numbers, metre = _numbered(path, _numbers(path, rows))
    inside = (times_s >= start_s) & (times_s <= start_s + duration_s)
    return Counts(times_s[inside] - start_s, numbers[inside], metre, ANNOTATED, 1.0)


def _rows(path: Path) -> list[tuple[int, float, str]]:
    """Line number, time and label, "" if there is none, of each beat."""
    text = read_text(path, _LAYOUT, fallback="cp1252", max_bytes=MAX_TABLE_BYTES)
    # Label tracks have lines that begin with a backslash, with frequencies of the label before.
    lines = [
        line.split("#")[0].strip(" \t\r,;")
        for line in text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    ]
    numbered = [(i, line) for i, line in enumerate(lines, start=1) if line and not line.startswith("\\")]
    if len(numbered) > 1 and not any(map(_is_number, _fields(numbered[0][1]))):
        del numbered[0]  # names of columns
    return [_parsed(path, i, line) for i, line in numbered]


def _fields(line: str) -> list[str]:
    """The cells of a line. In cells between tabs or semicolons, a comma is a decimal one."""
    separator = next((mark for mark in "\t;" if mark in line), None)
    cells = _CELL.findall(line) if separator is None else line.split(separator)
    fields = [cell.strip(' "') for cell in cells]
    return [field.replace(",", ".") for field in fields] if separator else fields


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _parsed(path: Path, line_number: int, line: str) -> tuple[int, float, str]:
    fields = _fields(line)
    times, label = (fields, "") if len(fields) == 1 else (fields[:-1], "".join(fields[-1:]))
    if not 1 <= len(times) <= 2 or not all(map(_is_number, times)):
        raise _unexpected(path, line_number, line)
    return line_number, float(times[0]), label


def _unexpected(path: Path, line_number: int, got: str) -> FormatError:
    return FormatError(f"{path}, line {line_number}: expected {_LAYOUT}, got {got[:40]!r}")


def _numbers(path: Path, rows: list[tuple[int, float, str]]) -> list[int | None]:
    """The number in the bar of each beat, or None if there is none."""
    labels = [label for _, _, label in rows if label]
    if not any(map(_is_number, labels)):
        return [None] * len(rows)
    counted = [_BAR_AND_BEAT.fullmatch(label) for label in labels]
    if all(counted) and any(label.endswith(".1") for label in labels):
        rows = [(line, time_s, label.partition(".")[2]) for line, time_s, label in rows]
    return [_number(path, line, label) if label else None for line, _, label in rows]


def _number(path: Path, line_number: int, label: str) -> int:
    value = float(label) if _is_number(label) else np.nan
    if value not in range(1, MAX_METRE + 1):
        raise _unexpected(path, line_number, label)
    return int(value)


def _numbered(path: Path, given: list[int | None]) -> tuple[NDArray[np.int64], int]:
    """Numbers (Q,) and metre. Beats without a number count on from those with one, or back to the first."""
    first = next((i for i, number in enumerate(given) if number is not None), None)
    numbers = np.zeros(len(given), np.int64)
    if first is None:
        return numbers, 0
    for i in range(first, len(given)):
        number = given[i]
        numbers[i] = numbers[i - 1] + 1 if number is None else number
    metre = int(numbers.max())
    if not 2 <= metre <= MAX_METRE:
        reason = "only downbeats?" if metre == 1 else "a downbeat may lack its 1"
        raise FormatError(f"{path}: expected bars of 2 to {MAX_METRE} beats, got {metre}: {reason}")
    numbers[:first] = (numbers[first] - 1 - np.arange(first, 0, -1)) % metre + 1
    return numbers, metre
