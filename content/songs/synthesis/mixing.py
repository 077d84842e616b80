"""Renders tracks of notes and masters them to a stereo song."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from content.songs.synthesis.composition import Track
from content.songs.synthesis.sounds import RATE_HZ, VARIANTS, Wave, drum_hit, render_note
from content.songs.synthesis.style import Lane, SongStyle

# Effects and mastering: reverb, stereo width, ducking, loudness, soft limiter.


TARGET_LUFS = -14.0
_CEILING, _KNEE = 0.86, 0.55  # amplitudes: the limit, and the knee of the limiter
_WIDTH_DELAY_S = 0.011


def _k_weighting() -> NDArray[np.float64]:
    """K-weighting of BS.1770 (a high shelf and a high-pass) at 44.1 kHz, second-order sections (2, 6)."""
    k, q = np.tan(np.pi * 1681.974450955533 / RATE_HZ), 0.7071752369554196
    high = 10.0 ** (3.999843853973347 / 20.0)
    middle = high**0.4996667741545416
    a0 = 1.0 + k / q + k * k
    zeros = np.array([high + middle * k / q + k * k, 2.0 * (k * k - high), high - middle * k / q + k * k])
    shelf = [*(zeros / a0), 1.0, 2.0 * (k * k - 1.0) / a0, (1.0 - k / q + k * k) / a0]
    k, q = np.tan(np.pi * 38.13547087602444 / RATE_HZ), 0.5003270373238773
    a0 = 1.0 + k / q + k * k
    return np.array([shelf, [1.0, -2.0, 1.0, 1.0, 2.0 * (k * k - 1.0) / a0, (1.0 - k / q + k * k) / a0]])


@lru_cache(maxsize=8)
def _room(room_s: float) -> Wave:
    """Impulse response (S, 2): noise that decays by 60 dB in `room_s`, faster in the highs."""
    rng = np.random.default_rng(7)
    n = round(room_s * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    noise = rng.standard_normal((n, 2))
    dark = scipy.signal.sosfilt(scipy.signal.butter(1, 2500.0, fs=RATE_HZ, output="sos"), noise, axis=0)
    body = noise * np.exp(-12.0 * t / room_s)[:, None] + 2.0 * dark * np.exp(-6.9 * t / room_s)[:, None]
    body = scipy.signal.sosfilt(
        scipy.signal.butter(1, 180.0, "highpass", fs=RATE_HZ, output="sos"), body, axis=0
    )
    late = np.concatenate([np.zeros((round(0.012 * RATE_HZ), 2)), body])
    return np.asarray(late / np.sqrt((late**2).sum(axis=0)), np.float32)


def reverberate(send: Wave, room_s: float) -> Wave:
    """Stereo reverb (S, 2) of a mono send (S,)."""
    room = _room(room_s)
    sides = [scipy.signal.oaconvolve(send, room[:, side])[: len(send)] for side in (0, 1)]
    return np.asarray(np.stack(sides, axis=1), np.float32)


def pan_stereo(track: Wave, pan: float, width: float) -> tuple[Wave, Wave]:
    """Left and right of a mono track, panned with constant power. Width is a delayed copy of opposite signs.

    The width cancels in the mono sum.
    """
    angle = 0.25 * np.pi * (1.0 + pan)
    left, right = np.float32(np.cos(angle)) * track, np.float32(np.sin(angle)) * track
    if width:
        delay = round(_WIDTH_DELAY_S * RATE_HZ)
        late = np.float32(0.5 * width) * track[:-delay]
        left[delay:] += late
        right[delay:] -= late
    return left, right


def ducking_gain(n: int, kicks: NDArray[np.int64], depth: float) -> Wave:
    """Gain (S,) that drops by `depth` at each kick and recovers within half a beat."""
    shape = depth * np.exp(-np.arange(round(0.3 * RATE_HZ)) / (0.09 * RATE_HZ))
    shape[:96] *= np.linspace(0.0, 1.0, 96)  # avoids a click in sounding notes
    gain = np.ones(n, np.float32)
    for kick in kicks:
        stretch = gain[kick : kick + len(shape)]
        np.minimum(stretch, 1.0 - shape[: len(stretch)], out=stretch)
    return gain


def loudness_lufs(stereo: NDArray[np.floating]) -> float:
    """Integrated loudness of (S, 2) at 44.1 kHz, gated as in BS.1770, or -70 for silence."""
    weighted = scipy.signal.sosfilt(_k_weighting(), stereo, axis=0)
    hop = RATE_HZ // 10
    tenths = (weighted[: len(weighted) // hop * hop] ** 2).sum(axis=1).reshape(-1, hop).mean(axis=1)
    blocks = np.convolve(tenths, np.full(4, 0.25), "valid") if len(tenths) >= 4 else tenths
    gated = blocks[blocks > 10.0 ** ((-70.0 + 0.691) / 10.0)]
    if len(gated) == 0:
        return -70.0
    gated = gated[gated > 0.1 * gated.mean()]
    return float(-0.691 + 10.0 * np.log10(gated.mean()))


def master(mix: Wave) -> Wave:
    """The mix (S, 2), high-passed, at -14 LUFS or slightly below, peaks soft-limited below -1.3 dBFS."""
    mix = np.asarray(
        scipy.signal.sosfilt(scipy.signal.butter(2, 28.0, "highpass", fs=RATE_HZ, output="sos"), mix, axis=0),
        np.float32,
    )
    gain_db = TARGET_LUFS - loudness_lufs(mix)
    once = _soft_limited(mix * np.float32(10.0 ** (gain_db / 20.0)))
    gain_db += min(TARGET_LUFS - loudness_lufs(once), 3.0)  # compensates the limiter, within 3 dB
    return _soft_limited(mix * np.float32(10.0 ** (gain_db / 20.0)))


def _soft_limited(mix: Wave) -> Wave:
    size = np.abs(mix)
    over = np.maximum(0.0, size - _KNEE) / np.float32(_CEILING - _KNEE)
    bent = _KNEE + (_CEILING - _KNEE) * np.tanh(over)
    return np.asarray(np.where(size > _KNEE, np.sign(mix) * bent, mix), np.float32)


# Rendering of tracks of notes to a mastered stereo song.


_TAIL_S = 1.5  # reverb tail after the last note
_GATE = 0.96  # sounding share of a note's steps
_LENGTH_STEP_S = 0.02  # lengths are rounded to this, so that repeated notes are rendered only once
_TOUCHES = 4  # levels of brightness by velocity


def mix_tracks(style: SongStyle, tracks: Sequence[Track], step_s: NDArray[np.float64]) -> Wave:
    """The song, float32 (S, 2) at 44.1 kHz. `step_s` (steps,) are the times of the steps."""
    n = round((step_s[-1] + _TAIL_S) * RATE_HZ)
    left, right, send = (np.zeros(n, np.float32) for _ in range(3))
    kicks = [note.step for track in tracks if track.sound.endswith("kick") for note in track.notes]
    starts = np.unique(np.rint(step_s[sorted(set(kicks))] * RATE_HZ).astype(np.int64))
    pump = ducking_gain(n, starts, style.duck) if style.duck else None
    for track in tracks:
        source = track.source
        is_drum = isinstance(source, Lane)
        mono = _drums(track, step_s, n) if is_drum else _notes(track, step_s, n)
        mono *= np.float32(10.0 ** (source.db / 20.0))
        if pump is not None and not is_drum:
            mono *= pump
        send += np.float32(source.send) * mono
        for side, part in zip((left, right), pan_stereo(mono, source.pan, _width(source)), strict=True):
            side += part
    stereo = np.stack([left, right], axis=1)  # (S, 2)
    stereo += reverberate(send, style.room_s)
    tail = round(0.5 * RATE_HZ)
    stereo[-tail:] *= np.linspace(1.0, 0.0, tail, dtype=np.float32)[:, None] ** 2
    return master(stereo)


def _width(source: object) -> float:
    return float(getattr(source, "width", 0.0))


def _drums(track: Track, step_s: NDArray[np.float64], n: int) -> Wave:
    out = np.zeros(n, np.float32)
    for i, note in enumerate(track.notes):
        sound = drum_hit(track.sound, (i * i + note.step) % VARIANTS)
        start = round(step_s[note.step] * RATE_HZ)
        out[start : start + len(sound)] += np.float32(note.velocity) * sound[: n - start]
    return out


def _notes(track: Track, step_s: NDArray[np.float64], n: int) -> Wave:
    out = np.zeros(n, np.float32)
    rendered: dict[tuple[int, int, int], Wave] = {}
    for note in track.notes:
        sounding_s = _GATE * float(step_s[min(note.step + note.steps, len(step_s) - 1)] - step_s[note.step])
        length = max(2, round(sounding_s / _LENGTH_STEP_S))
        touch = round(note.velocity * _TOUCHES)
        key = (note.midi, length, touch)
        if key not in rendered:
            rendered[key] = render_note(
                track.sound, note.midi, length * _LENGTH_STEP_S, touch / _TOUCHES, seed=note.midi
            )
        start = round(step_s[note.step] * RATE_HZ)
        sound = rendered[key]
        out[start : start + len(sound)] += np.float32(note.velocity) * sound[: n - start]
    return out
