"""Drum synthesis. Every sound starts on its first sample, so onset times are exact.

Three ingredients: a sine with falling pitch (skins), filtered noise (wires, shells, breath), and a few
inharmonic square waves (metal). Every sound has some variants, so that consecutive hits differ.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from choreograph.synthesis.songs.voices import RATE_HZ, Wave

VARIANTS = 3
_FADE_S = 0.004  # fade-out, so that no sound ends with a click

Rng = np.random.Generator


@lru_cache(maxsize=256)
def drum_hit(name: str, variant: int = 0) -> Wave:
    """One drum sound, float32 (S,) at 44.1 kHz with unit peak; `name` from `DRUMS`. Read-only."""
    rng = np.random.default_rng([variant, *name.encode()])
    sound = DRUMS[name](rng)
    fade = min(len(sound), round(_FADE_S * RATE_HZ))
    sound[-fade:] *= np.linspace(1.0, 0.0, fade)
    shared = np.asarray(sound / np.abs(sound).max(), np.float32)
    shared.setflags(write=False)
    return shared


def _seconds(length_s: float) -> NDArray[np.float64]:
    return np.arange(round(length_s * RATE_HZ)) / RATE_HZ


def _skin(
    rng: Rng, from_hz: float, to_hz: float, sweep_s: float, decay_s: float, length_s: float
) -> NDArray[np.float64]:
    """A struck skin: a sine falling in pitch. Its phase starts near a crest, for an immediate onset."""
    t = _seconds(length_s)
    tune = rng.uniform(0.99, 1.01)
    cycles = tune * (to_hz * t + (from_hz - to_hz) * sweep_s * (1.0 - np.exp(-t / sweep_s)))
    return np.sin(2.0 * np.pi * cycles + 0.5) * np.exp(-t / decay_s)


def _noise(rng: Rng, low_hz: float, high_hz: float, decay_s: float, length_s: float) -> NDArray[np.float64]:
    sos = butter(2, [low_hz, min(high_hz, 20000.0)], "bandpass", fs=RATE_HZ, output="sos")
    t = _seconds(length_s)
    noise = sosfilt(sos, rng.standard_normal(len(t))) * np.exp(-t / decay_s)
    return noise / np.abs(noise).max()


def _metal(
    rng: Rng, partials_hz: tuple[float, ...], low_hz: float, decay_s: float, length_s: float
) -> NDArray[np.float64]:
    """Inharmonic square waves above `low_hz`: bells and cymbals."""
    t = _seconds(length_s)
    tone = sum(np.sign(np.sin(2.0 * np.pi * (hz * rng.uniform(0.995, 1.005) * t))) for hz in partials_hz)
    sos = butter(3, low_hz, "highpass", fs=RATE_HZ, output="sos")
    tone = sosfilt(sos, np.asarray(tone)) * np.exp(-t / decay_s)
    return tone / np.abs(tone).max()


def _scrape(rng: Rng, length_s: float, teeth_hz: float, swell: float) -> NDArray[np.float64]:
    """A stick scraped over the notches of a guiro."""
    t = _seconds(length_s)
    speed = teeth_hz * (1.0 + swell * t / length_s)
    tooth = np.exp(-8.0 * ((np.cumsum(speed) / RATE_HZ) % 1.0))
    sos = butter(2, [2200.0, 9000.0], "bandpass", fs=RATE_HZ, output="sos")
    shape = (0.35 + 0.65 * (t / length_s)) * np.minimum(1.0, (length_s - t) / 0.02)
    return sosfilt(sos, rng.standard_normal(len(t)) * tooth) * shape


def _claps(rng: Rng) -> NDArray[np.float64]:
    out = _noise(rng, 900.0, 6000.0, 0.07, 0.28)
    out *= 0.7
    for hand, delay_s in enumerate((0.0, 0.009, 0.019)):
        start = round(delay_s * RATE_HZ)
        clap = _noise(rng, 900.0, 7000.0, 0.005, 0.03)
        out[start : start + len(clap)] += clap * (1.0 - 0.15 * hand)
    return out


_CYMBAL_HZ = (263.0, 400.0, 421.0, 474.0, 587.0, 845.0)
_SPLASH_HZ = (327.0, 447.0, 563.0, 719.0, 911.0, 1103.0)


def _cymbal(rng: Rng, low_hz: float, decay_s: float, length_s: float, wash: float) -> NDArray[np.float64]:
    metal = _metal(rng, _CYMBAL_HZ, low_hz, decay_s, length_s)
    return metal + wash * _noise(rng, low_hz, 18000.0, decay_s, length_s)


def _snare(rng: Rng, tone_hz: float, wires: float, decay_s: float) -> NDArray[np.float64]:
    shell = _skin(rng, tone_hz * 1.8, tone_hz, 0.012, 0.07, 0.3)
    return shell + wires * _noise(rng, 1200.0, 11000.0, decay_s, 0.3)


def _kick(rng: Rng, to_hz: float, decay_s: float, click: float) -> NDArray[np.float64]:
    boom = _skin(rng, to_hz * 5.0, to_hz, 0.022, decay_s, decay_s * 3.5)
    tick = click * _noise(rng, 1500.0, 8000.0, 0.004, 0.03)
    boom[: len(tick)] += tick
    return np.tanh(1.4 * boom)


def _conga(rng: Rng, hz: float, decay_s: float, slap: float, length_s: float = 0.35) -> NDArray[np.float64]:
    body = _skin(rng, hz * 1.25, hz, 0.015, decay_s, length_s)
    second = 0.3 * _skin(rng, hz * 2.1, hz * 1.9, 0.01, decay_s * 0.4, length_s)
    return body + second + slap * _noise(rng, 1500.0, 7000.0, 0.02, length_s)


DRUMS: dict[str, Callable[[Rng], NDArray[np.float64]]] = {
    "kick": lambda rng: _kick(rng, 50.0, 0.13, 0.35),
    "deep kick": lambda rng: _kick(rng, 43.0, 0.24, 0.2),
    "soft kick": lambda rng: _kick(rng, 58.0, 0.09, 0.1),
    "snare": lambda rng: _snare(rng, 190.0, 0.9, 0.09),
    "fat snare": lambda rng: _snare(rng, 165.0, 1.0, 0.13),
    "ghost": lambda rng: _snare(rng, 210.0, 0.7, 0.03),
    "rim": lambda rng: (
        _skin(rng, 900.0, 820.0, 0.004, 0.02, 0.1) + 0.6 * _noise(rng, 1800.0, 6000.0, 0.008, 0.1)
    ),
    "clap": _claps,
    "snap": lambda rng: _noise(rng, 1600.0, 5200.0, 0.018, 0.12),
    "hat": lambda rng: _cymbal(rng, 6500.0, 0.028, 0.14, 0.5),
    "open hat": lambda rng: _cymbal(rng, 6000.0, 0.14, 0.42, 0.5),
    "pedal": lambda rng: _cymbal(rng, 4500.0, 0.02, 0.1, 0.9),
    "ride": lambda rng: _cymbal(rng, 3800.0, 0.32, 0.9, 0.15),
    "crash": lambda rng: _cymbal(rng, 2500.0, 0.6, 1.9, 1.2),
    "shaker": lambda rng: _noise(rng, 4500.0, 14000.0, 0.03, 0.13),
    "brush": lambda rng: _noise(rng, 1500.0, 9000.0, 0.06, 0.25),
    "tambourine": lambda rng: (
        _metal(rng, _SPLASH_HZ, 6000.0, 0.07, 0.25) + 0.6 * _noise(rng, 5000.0, 15000.0, 0.05, 0.25)
    ),
    "triangle": lambda rng: _metal(rng, (1310.0, 2790.0, 4730.0), 3500.0, 0.5, 1.2),
    "low tom": lambda rng: _skin(rng, 170.0, 95.0, 0.04, 0.16, 0.5),
    "mid tom": lambda rng: _skin(rng, 230.0, 135.0, 0.04, 0.14, 0.45),
    "high tom": lambda rng: _skin(rng, 310.0, 185.0, 0.03, 0.12, 0.4),
    "conga": lambda rng: _conga(rng, 205.0, 0.11, 0.12),
    "tumba": lambda rng: _conga(rng, 150.0, 0.13, 0.1),
    "conga slap": lambda rng: _conga(rng, 300.0, 0.035, 0.9, 0.2),
    "conga mute": lambda rng: _conga(rng, 190.0, 0.03, 0.25, 0.15),
    "bongo": lambda rng: _conga(rng, 420.0, 0.05, 0.25, 0.2),
    "timbale": lambda rng: (
        _skin(rng, 420.0, 370.0, 0.01, 0.09, 0.35) + 0.4 * _noise(rng, 2500.0, 9000.0, 0.04, 0.35)
    ),
    "cascara": lambda rng: _metal(rng, (1730.0, 2390.0), 1500.0, 0.02, 0.09),
    "clave": lambda rng: _skin(rng, 2520.0, 2480.0, 0.01, 0.028, 0.14),
    "cowbell": lambda rng: _metal(rng, (562.0, 845.0), 500.0, 0.07, 0.3),
    "guiro": lambda rng: _scrape(rng, 0.26, 95.0, 0.8),
    "guiro tick": lambda rng: _scrape(rng, 0.06, 140.0, 0.3),
}
