"""Label distances: four pairs of dance and music labels that artists would compare.

ChoreoGraph, section 4.3.1 and Table 3: a dance and its music have four labels each, on a scale of 1 to 10.
The label distance of a pair is the mean absolute difference over the data. The paper describes each label in
one line and gives neither formula nor scale. Our choice, per window of 4 s (the engine's segment):

| pair | dance (Table 3: our reading) | music (Table 3: our reading) |
| --- | --- | --- |
| openness | total distance of head and limbs to the centre: wrists, ankles and head to the pelvis, m | \
distance between fundamental frequencies and repetitiveness: mean interval between successive notes in \
semitones, times the share of distinct steps in the window |
| intensity | mean of the joints' variations: mean joint speed, m/s (of the velocity as a vector, since \
coordinates depend on the heading) | onsets per second |
| rhythm | accumulated angular acceleration: of the bone directions, mean over the window, rad/s² | time \
between onsets and density: geometric mean of onsets per second and 1 / (median inter-onset interval) |
| asymmetry | independent use of upper or lower half: Σ abs(u - l) / Σ (u + l), u and l mean speeds of the \
joints above and below the pelvis, relative to it | rough or smooth, aggressive or mild: geometric mean of \
flatness and centroid of the window's mean spectrum (frame by frame, a pause would be rough) |

The labels of a pair rise together: open with wide, intense with dense, jerky with hurried, one-sided with
rough. The text of the paper has left-right asymmetry in one place, but its table has upper or lower.

Scale: the rank of a value among the windows of the reference, from 1 for the lowest to 10 for the highest
(`fit_scale`). The reference is the training split of real data. Ranks do not depend on a label's unit or on
a monotone change of its formula, which is what the paper leaves open. Unrelated labels are then 3 apart, and
`chance_distances` gives the exact value. The numbers of the paper (1.05 to 2.07) are on another scale, so
compare only rows of one table.

Conventions: body positions (T, 21, 3) are in metres. Mono samples at 22.05 kHz begin with the dance. Windows
are given by their start in seconds. Input that does not fit raises `ParameterError`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from choreograph.core import kernel_cache  # noqa: F401 (keeps the kernels of librosa)
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import MUSIC_FPS, NET_FPS, SAMPLE_RATE_HZ, SEGMENT_S, frames_to_seconds
from choreograph.motion.body import BODY_JOINTS, BODY_PARENTS, body_pos_at
from choreograph.music.mel import log_mel, mel_band_hz, onset_envelopes

PAIRS = ("openness", "intensity", "rhythm", "asymmetry")
LOW, HIGH = 1.0, 10.0

_PELVIS = BODY_JOINTS.index("pelvis")
_EXTREMITIES = [
    BODY_JOINTS.index(j) for j in ("head", "left_wrist", "right_wrist", "left_ankle", "right_ankle")
]
_LOWER = [i for i, j in enumerate(BODY_JOINTS) if j.endswith(("knee", "ankle", "foot"))]
_UPPER = [
    i
    for i, j in enumerate(BODY_JOINTS)
    if j.endswith(("spine3", "head", "collar", "shoulder", "elbow", "wrist"))
]
_BONES = [i for i, parent in enumerate(BODY_PARENTS) if parent >= 0]
_SHORT_M = 1e-3  # a bone that the rig lacks has length 0 and no direction
_MIN_HZ, _MAX_HZ, _PITCH_HOP = 65.4, 1046.5, 512  # two octaves either side of middle C
_NOTE_FRAMES = 6  # 0.14 s: later the note may have ended, and the pitch of a pause is arbitrary


@dataclass(frozen=True, eq=False)
class LabelScale:
    """The values of the reference, each column sorted. Labels are ranks among these values."""

    dance: Floats  # (R, 4)
    music: Floats  # (R', 4)

    def dance_labels(self, values: Floats) -> Floats:
        """Labels 1 … 10, (N, 4), for `dance_values`."""
        return _ranked(values, self.dance)

    def music_labels(self, values: Floats) -> Floats:
        """Labels 1 … 10, (N, 4), for `music_values`."""
        return _ranked(values, self.music)


def fit_scale(dance_values: Floats, music_values: Floats) -> LabelScale:
    """The scale on which the values (R, 4) and (R', 4) of the reference are evenly distributed.

    Examples
    --------
    >>> reference = np.arange(1.0, 101.0)[:, None] * np.ones(4)
    >>> scale = cg.metrics.labels.fit_scale(reference, reference)
    >>> scale.dance_labels(np.array([[0.0, 50.5, 100.5, 999.0]]))  # ranks from 1 to 10
    array([[ 1. ,  5.5, 10. , 10. ]])
    """
    return LabelScale(np.sort(_checked(dance_values), axis=0), np.sort(_checked(music_values), axis=0))


def window_starts_s(duration_s: float) -> Floats:
    """Starts (N,) of all windows of 4 s that fit, one second apart. None if the duration is shorter.

    Examples
    --------
    >>> cg.metrics.labels.window_starts_s(6.0)
    array([0., 1., 2.])
    """
    return np.arange(max(0, int(duration_s + 1e-6) - SEGMENT_S + 1), dtype=np.float64)


def dance_values(body_pos_m: NDArray[np.floating], fps: float, starts_s: Floats) -> Floats:
    """The four dance labels in their own units, (N, 4), for windows of body positions (T, 21, 3).

    Raises `ParameterError` if a window does not lie within the dance, and as `checked_body_pos_m` does.

    Examples
    --------
    >>> held_m = np.tile(np.random.default_rng(0).normal(size=(21, 3)), (80, 1, 1))  # one pose for 4 s
    >>> cg.metrics.labels.dance_values(held_m, 20.0, starts_s=np.array([0.0]))[0, 1:3]  # m/s, rad/s²
    array([0., 0.])
    """
    duration_s = len(np.asarray(body_pos_m)) / fps
    pos = body_pos_at(body_pos_m, fps, NET_FPS)
    openness_m = np.linalg.norm(pos[:, _EXTREMITIES] - pos[:, [_PELVIS]], axis=-1).sum(axis=1)  # (T',)
    speed_m_s = np.linalg.norm(np.diff(pos, axis=0), axis=-1).mean(axis=1) * NET_FPS  # (T'-1,)
    relative_m = np.linalg.norm(np.diff(pos - pos[:, [_PELVIS]], axis=0), axis=-1)  # (T'-1, 21) per frame
    upper, lower = relative_m[:, _UPPER].mean(axis=1), relative_m[:, _LOWER].mean(axis=1)
    acceleration_rad_s2 = _angular_acceleration_rad_s2(pos)  # (T'-2,)
    rows = []
    for window in _windows(starts_s, duration_s, NET_FPS):
        total = (upper + lower)[window].sum()
        rows.append(
            [
                openness_m[window].mean(),
                speed_m_s[window].mean(),
                acceleration_rad_s2[window].mean(),
                np.abs(upper - lower)[window].sum() / total if total > 0 else 0.0,
            ]
        )
    return np.array(rows, np.float64).reshape(-1, len(PAIRS))


def music_values(samples: NDArray[np.floating], starts_s: Floats) -> Floats:
    """The four music labels in their own units, (N, 4), for windows of a song (S,) at 22.05 kHz.

    In a window with fewer than two onsets, openness and rhythm are 0. Raises `ParameterError` if samples are
    empty or not mono, or a window does not lie within the song.

    Examples
    --------
    >>> silence = np.zeros(4 * 22050, np.float32)
    >>> cg.metrics.labels.music_values(silence, starts_s=np.array([0.0]))[0, :3]  # no onsets
    array([0., 0., 0.])
    """
    mel = log_mel(samples)
    duration_s = len(samples) / SAMPLE_RATE_HZ
    onsets_s = _onset_times_s(mel)
    notes = _notes_semitones(np.asarray(samples, np.float32), onsets_s)
    rows = []
    for start_s, window in zip(starts_s, _windows(starts_s, duration_s, MUSIC_FPS), strict=True):
        inside = slice(*np.searchsorted(onsets_s, [start_s, start_s + SEGMENT_S]))
        density_hz = (inside.stop - inside.start) / SEGMENT_S
        gaps_s = np.diff(onsets_s[inside])
        pace_hz = np.sqrt(density_hz / np.median(gaps_s)) if len(gaps_s) else 0.0
        rows.append([_melodic_openness(notes[inside]), density_hz, pace_hz, _roughness(mel[window])])
    return np.array(rows, np.float64).reshape(-1, len(PAIRS))


def label_distances(dance_labels: Floats, music_labels: Floats) -> Floats:
    """Mean absolute difference between paired labels (N, 4), by pair, (4,) from 0 to 9. Lower is better.

    Examples
    --------
    >>> dance, music = np.full((5, 4), 2.0), np.full((5, 4), 6.0)
    >>> cg.metrics.labels.label_distances(dance, dance), cg.metrics.labels.label_distances(dance, music)
    (array([0., 0., 0., 0.]), array([4., 4., 4., 4.]))
    """
    validate(dance_labels, music_labels)
    result: Floats = np.abs(np.asarray(dance_labels) - music_labels).mean(axis=0)
    return result


def chance_distances(dance_labels: Floats, music_labels: Floats) -> Floats:
    """Chance level of the distances, (4,): the mean over all pairings of dance and music windows.

    Examples
    --------
    >>> labels = np.array([[1.0] * 4, [10.0] * 4])  # half of all pairings are equal, the others 9 apart
    >>> cg.metrics.labels.chance_distances(labels, labels)
    array([4.5, 4.5, 4.5, 4.5])
    """
    validate(dance_labels, music_labels)
    music = np.asarray(music_labels)
    result: Floats = np.mean([np.abs(music - row).mean(axis=0) for row in np.asarray(dance_labels)], axis=0)
    return result


def validate(dance_labels: Floats, music_labels: Floats) -> None:
    """Raise `ParameterError` unless both are labels (N, 4) from 1 to 10, for the same number of windows.

    Examples
    --------
    >>> cg.metrics.labels.validate(np.ones((2, 4)), np.ones((2, 4)))
    >>> cg.metrics.labels.validate(np.ones((2, 4)), np.ones((3, 4)))
    Traceback (most recent call last):
        ...
    choreograph.core.errors.ParameterError: expected as many music as dance windows, got 3 and 2
    """
    for labels in (dance_labels, music_labels):
        values = _checked(labels)
        if values.min() < LOW or values.max() > HIGH:
            raise ParameterError(
                f"expected labels from {LOW:g} to {HIGH:g}, got {values.min()} to {values.max()}"
            )
    if len(dance_labels) != len(music_labels):
        raise ParameterError(
            f"expected as many music as dance windows, got {len(music_labels)} and {len(dance_labels)}"
        )


@default_numerics()
def evaluate(dance_labels: Floats, music_labels: Floats) -> dict[str, float]:
    """Distance of every pair by name, and its chance level. Raises `ParameterError` as `validate` does.

    Examples
    --------
    >>> labels = np.array([[1.0] * 4, [10.0] * 4])
    >>> scores = cg.metrics.labels.evaluate(labels, labels)
    >>> scores["label_distance_rhythm"], scores["label_distance_rhythm_chance"]
    (0.0, 4.5)
    """
    distances, chance = (f(dance_labels, music_labels) for f in (label_distances, chance_distances))
    return {f"label_distance_{pair}": float(d) for pair, d in zip(PAIRS, distances, strict=True)} | {
        f"label_distance_{pair}_chance": float(c) for pair, c in zip(PAIRS, chance, strict=True)
    }


def _angular_acceleration_rad_s2(pos: Floats) -> Floats:
    """Mean angular acceleration of the bone directions at 20 fps, (T'-2,)."""
    bones = pos[:, _BONES] - pos[:, [BODY_PARENTS[i] for i in _BONES]]  # (T', B, 3)
    lengths = np.linalg.norm(bones, axis=-1, keepdims=True)
    present = (lengths > _SHORT_M).all(axis=(0, 2))
    direction = bones[:, present] / lengths[:, present]
    axis = np.cross(direction[:-1], direction[1:])  # (T'-1, B, 3), its length the sine of the angle
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    cosine = (direction[:-1] * direction[1:]).sum(axis=-1, keepdims=True)
    velocity_rad_s = axis * (np.arctan2(sine, cosine) / np.maximum(sine, 1e-12)) * NET_FPS
    result: Floats = np.linalg.norm(np.diff(velocity_rad_s, axis=0), axis=-1).mean(axis=1) * NET_FPS
    return result


def _onset_times_s(mel: NDArray[np.floating]) -> Floats:
    """Onset times, (O,), in log-mel (T, 96) at 60 fps."""
    strength = onset_envelopes(mel).mean(axis=1)
    if not strength.any():
        return np.zeros(0)
    import librosa

    frames = librosa.onset.onset_detect(onset_envelope=strength, sr=MUSIC_FPS, hop_length=1)
    return frames_to_seconds(frames, MUSIC_FPS)


def _notes_semitones(samples: NDArray[np.float32], onsets_s: Floats) -> Floats:
    """Median fundamental just after each onset, (O,), in whole semitones above 1 Hz."""
    if len(onsets_s) == 0:
        return np.zeros(0)
    import librosa

    hz = librosa.yin(samples, fmin=_MIN_HZ, fmax=_MAX_HZ, sr=SAMPLE_RATE_HZ, hop_length=_PITCH_HOP)
    pitch = 12 * np.log2(hz)
    first = np.minimum((onsets_s * SAMPLE_RATE_HZ / _PITCH_HOP).astype(np.int64), len(pitch) - 1)
    return np.array([np.rint(np.median(pitch[frame : frame + _NOTE_FRAMES])) for frame in first])


def _melodic_openness(notes: Floats) -> float:
    """Mean interval between successive notes in semitones, times the share of distinct steps."""
    if len(notes) < 2:
        return 0.0
    steps = np.stack([notes[:-1], notes[1:]], axis=1)
    return float(np.abs(np.diff(notes)).mean() * len(np.unique(steps, axis=0)) / len(steps))


def _roughness(mel: NDArray[np.floating]) -> float:
    """Geometric mean of flatness (0 … 1) and centroid (Hz) of the mean spectrum in log-mel (T, 96)."""
    power = np.exp(np.asarray(mel, np.float64) - mel.max()).mean(axis=0)  # (96,)
    flatness = np.exp(np.log(power).mean()) / power.mean()
    centroid_hz = power @ mel_band_hz() / power.sum()
    return float(np.sqrt(flatness * centroid_hz))


def _windows(starts_s: Floats, duration_s: float, fps: int) -> list[slice]:
    """Frame ranges of windows of 4 s. A curve of differences is one or two frames shorter at the end."""
    starts = np.asarray(starts_s, np.float64)
    if starts.ndim != 1 or not np.isfinite(starts).all():
        raise ParameterError(f"expected finite window starts (N,) in seconds, got an array {starts.shape}")
    if len(starts) and (starts.min() < 0 or starts.max() + SEGMENT_S > duration_s + 0.1):
        raise ParameterError(
            f"expected windows of {SEGMENT_S} s within {duration_s:.2f} s, got {starts.max():g}"
        )
    return [slice(round(s * fps), round((s + SEGMENT_S) * fps)) for s in starts]


def _ranked(values: Floats, reference: Floats) -> Floats:
    """Mean rank of each column's values among those of the reference (R, 4), as 1 … 10."""
    values = _checked(values)
    columns = []
    for value, known in zip(values.T, reference.T, strict=True):
        below, up_to = (np.searchsorted(known, value, side) for side in ("left", "right"))
        columns.append((below + up_to) / 2 / len(known))
    return LOW + (HIGH - LOW) * np.stack(columns, axis=1)


def _checked(values: Floats) -> Floats:
    array = np.asarray(values, np.float64)
    if array.ndim != 2 or array.shape[1] != len(PAIRS) or len(array) == 0 or not np.isfinite(array).all():
        raise ParameterError(f"expected finite window values (N, {len(PAIRS)}), got an array {array.shape}")
    return array
