"""From tracks of notes to a mastered stereo song."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from choreograph.synthesis.songs.composition import Track
from choreograph.synthesis.songs.drums import VARIANTS, drum_hit
from choreograph.synthesis.songs.effects import ducking_gain, master, pan_stereo, reverberate
from choreograph.synthesis.songs.style import Lane, SongStyle
from choreograph.synthesis.songs.voices import RATE_HZ, Wave, render_note

_TAIL_S = 1.5  # reverb tail after the last note
_GATE = 0.96  # sounding share of a note's steps
_LENGTH_STEP_S = 0.02  # lengths are rounded to this, so that repeated notes are rendered only once
_TOUCHES = 4  # levels of brightness by velocity


def mix_tracks(style: SongStyle, tracks: Sequence[Track], step_s: NDArray[np.float64]) -> Wave:
    """The song, float32 (S, 2) at 44.1 kHz; `step_s` (steps,) are the times of the steps."""
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
