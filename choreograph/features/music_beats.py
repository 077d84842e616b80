"""Beats of music behind one small interface: librosa by default, beat-this as an optional extra.

No tracker is the truth: octave errors (half or double tempo) are common, so everything later takes
beats as an argument and may be given better ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.errors import ParameterError
from choreograph.features.mel import log_mel
from choreograph.features.rhythm import onset_envelopes
from choreograph.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, frames_to_seconds

_LEVEL_S = 8.0  # span over which loud and quiet passages are brought to one level
_MIN_DURATION_S = 1.0  # less holds no two beats to hear a tempo from
# Between an octave's two readings the one nearer to a step's pace wins: librosa's own 120 BPM and one
# octave read half of the slow waltzes (84 to 90 BPM) in eighths.
_PRIOR_BPM, _PRIOR_OCTAVES = 100.0, 0.7
_ONSET_LEAD_S = 1.0 / MUSIC_FPS  # the log power of a 93 ms window rises this much before the onset itself


class BeatTracker(Protocol):
    """Anything that hears beats in a song."""

    def beats(self, song: Song) -> NDArray[np.float64]:
        """Increasing instants of the beats in seconds, (Q,); empty if nothing sounds."""
        ...


class LibrosaBeats:
    """Ellis's dynamic programming as librosa has it, made to keep the beat through quiet passages.

    The onset strength is levelled over 8 s before tracking, and beats missing from an otherwise
    steady pulse are filled in (`filled`).
    """

    def beats(self, song: Song) -> NDArray[np.float64]:
        if song.duration_s < _MIN_DURATION_S:
            return np.zeros(0)
        return beats_of_mel(log_mel(song.samples), song.duration_s)


def beats_of_mel(log_mel: NDArray[np.floating], duration_s: float) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), of log-mel (T, 96) at 60 fps; empty if nothing sounds. See `LibrosaBeats`."""
    strength = _levelled(onset_envelopes(log_mel).mean(axis=1))  # (T,)
    if not strength.any():
        return np.zeros(0)
    from librosa.beat import beat_track
    from librosa.feature.rhythm import tempo

    bpm = tempo(
        onset_envelope=strength, sr=MUSIC_FPS, hop_length=1, start_bpm=_PRIOR_BPM, std_bpm=_PRIOR_OCTAVES
    )[0]
    _, frames = beat_track(onset_envelope=strength, sr=MUSIC_FPS, hop_length=1, bpm=bpm, trim=False)
    beats = frames_to_seconds(frames, MUSIC_FPS) + _ONSET_LEAD_S
    return filled(beats[beats < duration_s], duration_s)


class BeatThisBeats:
    """The beat-this network (optional extra; fetches its weights on first use)."""

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

    def beats(self, song: Song) -> NDArray[np.float64]:
        beats, _ = self._audio_to_beats(song.samples, SAMPLE_RATE_HZ)
        return np.asarray(beats, np.float64)


TRACKERS: dict[str, Callable[[], BeatTracker]] = {"librosa": LibrosaBeats, "beat-this": BeatThisBeats}


def get_beat_tracker(name: str = "librosa") -> BeatTracker:
    """The tracker of that name: "librosa" or "beat-this"; `ParameterError` if unknown or unavailable."""
    if name not in TRACKERS:
        raise ParameterError(f"expected a beat tracker among {', '.join(TRACKERS)}, got {name!r}")
    return TRACKERS[name]()


def filled(beat_times_s: NDArray[np.floating], duration_s: float) -> NDArray[np.float64]:
    """Beats with gaps above 1.5 periods divided evenly, and carried on to both ends of the song.

    The period is local: the median of the 8 intervals nearest to a gap. Fewer than three beats are
    returned as they are: they show no period.
    """
    beats = np.asarray(beat_times_s, np.float64)
    if len(beats) < 3:
        return beats
    intervals = np.diff(beats)
    parts: list[NDArray[np.float64]] = [_before(beats[0], float(np.median(intervals[:8])))]
    for i, gap in enumerate(intervals):
        near = intervals[max(0, i - 4) : i + 5]
        period = float(np.median(near))
        pieces = max(1, round(gap / period)) if gap > 1.5 * period else 1
        parts.append(beats[i] + gap * np.arange(pieces) / pieces)
    period = float(np.median(intervals[-8:]))
    parts.append(np.arange(beats[-1], max(duration_s, beats[-1] + 1e-6), period))
    return np.asarray(np.concatenate(parts), np.float64)


def _before(first_s: float, period_s: float) -> NDArray[np.float64]:
    steps = np.arange(int(first_s / period_s + 1e-9), 0, -1, dtype=np.float64)
    return np.asarray(first_s - period_s * steps, np.float64)


def _levelled(strength: NDArray[np.floating]) -> NDArray[np.float32]:
    """Onset strength over its root mean square in the 8 s around, at least a tenth of the song's."""
    from scipy.ndimage import uniform_filter1d

    power = uniform_filter1d(strength.astype(np.float64) ** 2, round(_LEVEL_S * MUSIC_FPS), mode="nearest")
    power = np.maximum(power, 0.01 * np.mean(strength.astype(np.float64) ** 2))
    return (strength / np.sqrt(np.maximum(power, 1e-20))).astype(np.float32)
