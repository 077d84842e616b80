"""Beat trackers behind one interface: the tempo path (default), librosa, or beat-this (an extra).

Every tracker makes mistakes, octave errors (half or double tempo) above all. So all later stages take
beats as an argument and accept better ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.errors import ParameterError
from choreograph.features.onsets import onset_envelopes
from choreograph.features.tempo_path import level_normalized, tempo_path_beats
from choreograph.timebase import MUSIC_FPS, SAMPLE_RATE_HZ, frames_to_seconds

_MIN_DURATION_S = 1.0  # anything shorter may hold fewer than two beats, so no tempo
# The tempo prior decides between octaves. librosa's defaults (120 BPM, one octave) put half of the slow
# waltzes (84 to 90 BPM) at double tempo.
_PRIOR_BPM, _PRIOR_OCTAVES = 100.0, 0.7
_LENGTH_SLACK_S = 0.1
_ONSET_LEAD_S = 1.0 / MUSIC_FPS  # the log power of a 93 ms window rises this long before the onset


class BeatTracker(Protocol):
    """Anything that finds the beats of a song."""

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
        """Increasing beat times in seconds, (Q,); empty if the song is silent.

        `log_mel` (T, 96) of the song, as `features.mel.log_mel` returns it.
        """
        ...


class TempoPathBeats:
    """Beats and a varying tempo, tracked together: see `features.tempo_path`."""

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
        """The song's beats, (Q,) seconds; none in a song shorter than a second."""
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
        """The song's beats, (Q,) seconds; none in a song shorter than a second."""
        if song.duration_s < _MIN_DURATION_S:
            return np.zeros(0)
        return librosa_beats(log_mel, song.duration_s)


def librosa_beats(log_mel: NDArray[np.floating], duration_s: float) -> NDArray[np.float64]:
    """Beats in seconds, (Q,), of log-mel (T, 96) at 60 fps; empty if silent. See `LibrosaBeats`."""
    strength = level_normalized(onset_envelopes(log_mel).mean(axis=1)).astype(np.float32)  # (T,)
    if not strength.any():
        return np.zeros(0)
    from choreograph.cached_librosa import librosa, librosa_beat

    bpm = librosa.feature.tempo(
        onset_envelope=strength, sr=MUSIC_FPS, hop_length=1, start_bpm=_PRIOR_BPM, std_bpm=_PRIOR_OCTAVES
    )[0]
    _, frames = librosa_beat().beat_track(
        onset_envelope=strength, sr=MUSIC_FPS, hop_length=1, bpm=bpm, trim=False
    )
    beats = frames_to_seconds(frames, MUSIC_FPS) + _ONSET_LEAD_S
    return fill_missing_beats(beats[beats < duration_s], duration_s)


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

    def beats(self, song: Song, log_mel: NDArray[np.floating]) -> NDArray[np.float64]:
        """The song's beats, (Q,) seconds; the network takes the samples, not the log-mel."""
        beats, _ = self._audio_to_beats(song.samples, SAMPLE_RATE_HZ)
        return np.asarray(beats, np.float64)


DEFAULT_TRACKER = "tempo-path"
TRACKERS: dict[str, Callable[[], BeatTracker]] = {
    DEFAULT_TRACKER: TempoPathBeats, "librosa": LibrosaBeats, "beat-this": BeatThisBeats,
}  # fmt: skip


def get_beat_tracker(name: str = DEFAULT_TRACKER) -> BeatTracker:
    """The tracker of that name among `TRACKERS`; `ParameterError` if unknown or unavailable."""
    if name not in TRACKERS:
        raise ParameterError(f"expected a beat tracker among {', '.join(TRACKERS)}, got {name!r}")
    return TRACKERS[name]()


def checked_beat_times_s(beat_times_s: NDArray[np.floating], duration_s: float) -> NDArray[np.float64]:
    """Beats (Q,) of a song as float64; `ParameterError` unless they are increasing, finite and inside it.

    A tenth of a second past the end is tolerated: decoders differ on a song's length by a packet.
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

    The period is local: the median of the 8 intervals nearest to a gap. Fewer than three beats are
    returned unchanged: they define no period.
    """
    beats = np.asarray(beat_times_s, np.float64)
    if len(beats) < 3:
        return beats
    intervals = np.diff(beats)
    parts: list[NDArray[np.float64]] = [_beats_before(beats[0], float(np.median(intervals[:8])))]
    for i, gap in enumerate(intervals):
        near = intervals[max(0, i - 4) : i + 5]
        period = float(np.median(near))
        pieces = max(1, round(gap / period)) if gap > 1.5 * period else 1
        parts.append(beats[i] + gap * np.arange(pieces) / pieces)
    period = float(np.median(intervals[-8:]))
    parts.append(np.arange(beats[-1], max(duration_s, beats[-1] + 1e-6), period))
    return np.asarray(np.concatenate(parts), np.float64)


def _beats_before(first_s: float, period_s: float) -> NDArray[np.float64]:
    steps = np.arange(int(first_s / period_s + 1e-9), 0, -1, dtype=np.float64)
    return np.maximum(0.0, first_s - period_s * steps)  # rounding may lead below 0
