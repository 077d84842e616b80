"""Sounds: pitched synthesiser voices and drums."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

# Pitched synthesiser voices: wavetable synthesis with a time-varying spectrum, and FM for struck metal.
#
# A note of a `Patch` is a bank of single cycles, each with the spectrum at one age of the note (oscillator x
# low-pass with its envelope x damping that grows with the harmonic). The bank is read at the note's pitch and
# interpolated by age. The same few lines make filtered saws, plucked strings, organs and reeds, without
# aliasing, with four table look-ups per sample.


RATE_HZ = 44100
_CYCLE = 4096  # samples of one stored cycle
_AGES_S = np.concatenate([[0.0], np.geomspace(0.008, 3.0, 15)])  # of the spectra in a bank
_HIGHEST_HZ = 16000.0
_MOST_HARMONICS = 220

Wave = NDArray[np.float32]


@dataclass(frozen=True)
class Patch:
    """A subtractive voice. Envelope times in seconds, the filter's frequencies at middle C in hertz."""

    wave: str = "saw"  # saw, square, pulse, triangle, reed, sine, or drawbar levels as "8 0 6 ..."
    bright_hz: float = 6000.0  # cutoff when struck
    dark_hz: float = 1500.0  # final cutoff, lower or higher
    glide_s: float = 0.2  # time constant of the cutoff
    resonance: float = 0.0  # dB at the cutoff
    damping: float = 0.0  # 1/s per harmonic: strings lose high harmonics first
    attack_s: float = 0.004  # from silence to full level
    decay_s: float = 0.3  # time constant, from full level to `sustain`
    sustain: float = 0.7  # level after the decay
    release_s: float = 0.06  # after the end of the note
    unison: int = 1  # number of detuned copies
    detune_cents: float = 0.0  # of the outer copies, to either side
    vibrato_cents: float = 0.0  # depth of the vibrato
    vibrato_hz: float = 5.5  # rate of the vibrato
    breath: float = 0.0  # level of noise at the attack


@dataclass(frozen=True)
class FmPatch:
    """A two-operator FM voice: electric piano, vibraphone, bells."""

    ratio: float = 1.0  # modulator over carrier frequency
    depth: float = 1.5  # modulation depth at the attack, radians
    depth_decay_s: float = 0.4  # time constant of the depth
    strike_ratio: float = 14.0  # frequency ratio of a short partial: the hammer on the tine
    strike: float = 0.1  # level of the short partial
    decay_s: float = 1.2  # time constant of the level
    release_s: float = 0.12  # after the end of the note
    tremolo: float = 0.0  # depth of the tremolo


VOICES: dict[str, Patch | FmPatch] = {
    "analog bass": Patch("saw", 1400, 260, 0.12, 5, 0, 0.003, 0.25, 0.65, 0.04, 2, 5),
    "round bass": Patch("triangle", 1100, 420, 0.1, 0, 0, 0.003, 0.4, 0.7, 0.05),
    "sub bass": Patch("sine", 900, 500, 0.1, 0, 0, 0.006, 0.6, 0.85, 0.07),
    "slap bass": Patch("pulse", 4200, 420, 0.07, 3, 0.2, 0.002, 0.3, 0.45, 0.04),
    "upright bass": Patch("saw", 1500, 340, 0.09, 0, 0.6, 0.003, 0.9, 0.15, 0.08),
    "piano": Patch("saw", 3800, 1300, 0.3, 0, 0.16, 0.002, 1.4, 0.08, 0.12, 2, 2.5, breath=0.03),
    "felt piano": Patch("saw", 1500, 700, 0.5, 0, 0.2, 0.005, 2.2, 0.12, 0.3, 2, 2, breath=0.02),
    "harp": Patch("triangle", 4200, 1500, 0.3, 0, 0.7, 0.002, 1.0, 0.02, 0.35),
    "nylon guitar": Patch("saw", 3200, 1100, 0.12, 0, 0.7, 0.002, 0.6, 0.05, 0.1),
    "muted guitar": Patch("saw", 3600, 1500, 0.04, 4, 1.5, 0.001, 0.09, 0.0, 0.03),
    "clav": Patch("pulse", 5200, 1800, 0.06, 5, 0.5, 0.001, 0.25, 0.3, 0.02),
    "organ": Patch("8 6 8 5 0 4 0 3", 9000, 7000, 1.0, 0, 0, 0.006, 1.0, 0.95, 0.04, 1, 0, 7, 6.4),
    "stab": Patch("saw", 5200, 700, 0.11, 6, 0, 0.002, 0.22, 0.35, 0.08, 3, 14),
    "pad": Patch("saw", 700, 1900, 1.2, 2, 0, 0.25, 1.0, 0.9, 0.5, 4, 16),
    "warm pad": Patch("pulse", 500, 1100, 1.5, 0, 0, 0.4, 1.0, 0.9, 0.7, 3, 12),
    "strings": Patch("saw", 2200, 4200, 0.2, 0, 0, 0.07, 0.8, 0.85, 0.22, 4, 14, 9),
    "pizzicato": Patch("saw", 2600, 900, 0.06, 0, 1.4, 0.002, 0.3, 0.0, 0.1),
    "brass": Patch("saw", 700, 3400, 0.05, 2, 0, 0.018, 0.5, 0.8, 0.07, 2, 8, 8),
    "accordion": Patch("reed", 5200, 5200, 1.0, 0, 0, 0.025, 1.0, 0.92, 0.05, 2, 11, 4, 5.0),
    "clarinet": Patch("square", 2000, 2600, 0.1, 0, 0, 0.03, 0.6, 0.85, 0.06, 1, 0, 10, 5.2, 0.02),
    "flute": Patch("triangle", 2600, 3200, 0.1, 0, 0, 0.04, 0.6, 0.9, 0.08, 1, 0, 14, 5.2, 0.08),
    "violin": Patch("saw", 2600, 4300, 0.1, 3, 0, 0.05, 0.6, 0.9, 0.12, 2, 6, 16, 5.6),
    "cello": Patch("saw", 1200, 2100, 0.2, 3, 0, 0.09, 0.6, 0.9, 0.2, 2, 6, 14, 5.2),
    "saw lead": Patch("saw", 5200, 2400, 0.25, 4, 0, 0.005, 0.4, 0.75, 0.1, 3, 12, 10),
    "square lead": Patch("pulse", 3800, 1700, 0.2, 3, 0, 0.005, 0.3, 0.7, 0.08, 2, 7, 10),
    "pluck lead": Patch("saw", 6500, 900, 0.09, 5, 0.1, 0.002, 0.3, 0.15, 0.12, 3, 10),
    "electric piano": FmPatch(1.0, 1.3, 0.5, 14.0, 0.10, 1.5, 0.12, 0.12),
    "vibraphone": FmPatch(4.0, 0.5, 0.25, 10.0, 0.05, 1.6, 0.25, 0.35),
    "bell": FmPatch(3.5, 1.6, 0.6, 7.0, 0.05, 1.4, 0.4, 0.0),
}


def render_note(name: str, midi: int, duration_s: float, velocity: float, *, seed: int = 0) -> Wave:
    """One note, float32 (S,) at 44.1 kHz, including its release, with about unit peak at velocity 1.

    `velocity` (0 … 1) changes only the timbre: the mixer sets the loudness. `seed` sets the phases.
    """
    patch = VOICES[name]
    rng = np.random.default_rng(seed)
    hz = 440.0 * 2.0 ** ((midi - 69) / 12.0)
    if isinstance(patch, FmPatch):
        return _fm_note(patch, hz, duration_s, velocity)
    return _patch_note(patch, hz, duration_s, velocity, rng)


def _patch_note(
    patch: Patch, hz: float, duration_s: float, velocity: float, rng: np.random.Generator
) -> Wave:
    n = max(1, round((duration_s + patch.release_s) * RATE_HZ))
    t = np.arange(n, dtype=np.float32) / np.float32(RATE_HZ)
    bank = _bank(patch, hz, velocity).ravel()
    age = np.interp(t, _AGES_S, np.arange(len(_AGES_S))).astype(np.float32)
    row = np.minimum(age.astype(np.int32), len(_AGES_S) - 2)
    share = age - row
    row *= _CYCLE
    bend = _vibrato(patch, t)
    out = np.zeros(n, np.float32)
    spread = np.linspace(-1.0, 1.0, patch.unison) if patch.unison > 1 else np.zeros(1)
    starts = rng.uniform(0.0, 1.0, patch.unison) if patch.attack_s > 0.05 else np.zeros(patch.unison)
    for cents, start in zip(spread * patch.detune_cents, starts, strict=True):
        step = hz * 2.0 ** (cents / 1200.0) / RATE_HZ * _CYCLE
        phase = start * _CYCLE + step * (np.arange(n) + bend)  # (S,) in table samples
        index = (phase.astype(np.int64) & (_CYCLE - 1)).astype(np.int32) + row
        fresh = bank[index]
        out += fresh + share * (bank[index + _CYCLE] - fresh)
    out /= np.float32(np.sqrt(patch.unison))
    if patch.breath:
        out += _breath(patch, n, rng)
    return out * _envelope(patch, t, duration_s)


def _bank(patch: Patch, hz: float, velocity: float) -> Wave:
    """Single cycles by age, (ages, _CYCLE). The first one has unit peak."""
    count = int(np.clip(_HIGHEST_HZ / hz, 1, _MOST_HARMONICS))
    n = np.arange(1, count + 1)
    follow = (hz / 261.6) ** 0.5 * (0.55 + 0.45 * velocity)  # key and velocity tracking of the filter
    fall = np.exp(-_AGES_S / patch.glide_s)[:, None]
    cutoff = follow * (patch.dark_hz + (patch.bright_hz - patch.dark_hz) * fall)  # (ages, 1)
    ratio = n * hz / cutoff  # (ages, H)
    gain = 1.0 / np.sqrt(1.0 + ratio**6)
    gain *= 1.0 + (10.0 ** (patch.resonance / 20.0) - 1.0) * np.exp(-0.5 * (np.log2(ratio) / 0.25) ** 2)
    amplitude = _oscillator(patch.wave, n) * gain * np.exp(-patch.damping * n * _AGES_S[:, None])
    spectrum = np.zeros((len(_AGES_S), _CYCLE // 2 + 1), np.complex64)
    spectrum[:, 1 : count + 1] = -1j * amplitude
    cycles = np.fft.irfft(spectrum, axis=1)
    return np.asarray(cycles / np.abs(cycles[0]).max(), np.float32)


def _oscillator(wave: str, n: NDArray[np.int64]) -> NDArray[np.float64]:
    """Amplitudes of harmonics `n` (H,)."""
    odd = n % 2
    if wave == "saw":
        return 1.0 / n
    if wave == "square":
        return (odd + 0.06) / n
    if wave == "pulse":
        harmonics: NDArray[np.float64] = np.abs(np.sin(np.pi * 0.3 * n)) / n
        return harmonics
    if wave == "triangle":
        return (odd + 0.15) / n**2
    if wave == "reed":
        return 1.0 / n**0.8 * (0.6 + 0.4 * np.cos(n))
    if wave == "sine":
        return np.where(n == 1, 1.0, 0.12 / n**2)
    levels = np.array([float(level) for level in wave.split()]) / 8.0  # drawbars
    return np.where(n <= len(levels), levels[np.minimum(n, len(levels)) - 1], 0.0)


def _vibrato(patch: Patch, t: Wave) -> Wave | float:
    """Phase offset in samples. The vibrato starts after 0.15 s."""
    if not patch.vibrato_cents or len(t) < 0.15 * RATE_HZ:
        return 0.0
    depth = (2.0 ** (patch.vibrato_cents / 1200.0) - 1.0) * RATE_HZ / (2.0 * np.pi * patch.vibrato_hz)
    onset = np.clip((t - 0.15) / 0.3, 0.0, 1.0)
    return np.asarray(depth * onset * np.sin(2.0 * np.pi * patch.vibrato_hz * (t - 0.15)), np.float32)


def _breath(patch: Patch, n: int, rng: np.random.Generator) -> Wave:
    short = min(n, round(0.12 * RATE_HZ))
    noise = np.zeros(n, np.float32)
    white = rng.standard_normal(short + 4).astype(np.float32)
    smooth = (white[:-4] + white[1:-3] + white[2:-2] + white[3:-1]) / 2.0
    noise[:short] = patch.breath * smooth * np.exp(-np.arange(short) / (0.03 * RATE_HZ))
    return noise


def _envelope(patch: Patch, t: Wave, duration_s: float) -> Wave:
    level = patch.sustain + (1.0 - patch.sustain) * np.exp(-t / np.float32(patch.decay_s))
    level *= np.minimum(1.0, t / np.float32(patch.attack_s))
    return np.asarray(level * _release(t, duration_s, patch.release_s), np.float32)


def _release(t: Wave, duration_s: float, release_s: float) -> Wave:
    """1 until the release, then down to exactly 0 at the end."""
    left = np.clip(1.0 - (t - np.float32(duration_s)) / np.float32(release_s), 0.0, 1.0)
    return np.asarray(left * left, np.float32)


def _fm_note(patch: FmPatch, hz: float, duration_s: float, velocity: float) -> Wave:
    n = max(1, round((duration_s + patch.release_s) * RATE_HZ))
    t = np.arange(n, dtype=np.float32) / np.float32(RATE_HZ)
    phase = (2.0 * np.pi * hz * np.arange(n) / RATE_HZ) % (2.0 * np.pi * 1000)
    depth = patch.depth * (0.4 + 0.6 * velocity) * np.exp(-t / np.float32(patch.depth_decay_s))
    out = np.sin((phase + depth * np.sin(patch.ratio * phase)).astype(np.float32))
    if hz * patch.strike_ratio < _HIGHEST_HZ:
        out += patch.strike * velocity * np.exp(-t / 0.06) * np.sin(patch.strike_ratio * phase)
    level = np.exp(-t / np.float32(patch.decay_s)) * np.minimum(1.0, t / 0.002)
    level *= 1.0 - patch.tremolo * (0.5 - 0.5 * np.cos(2.0 * np.pi * 5.0 * t))
    return np.asarray(out * level * _release(t, duration_s, patch.release_s), np.float32)


# Drum synthesis. Every sound starts on its first sample, so onset times are exact.
#
# The sounds consist of a sine with falling pitch (skins), filtered noise (wires, shells, breath), and a few
# inharmonic square waves (metal). Every sound has some variants, so that consecutive hits differ.


VARIANTS = 3
_FADE_S = 0.004  # fade-out, so that no sound ends with a click

Rng = np.random.Generator


@lru_cache(maxsize=256)
def drum_hit(name: str, variant: int = 0) -> Wave:
    """One drum sound of `DRUMS`, a read-only float32 array (S,) at 44.1 kHz with unit peak."""
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
    sos = scipy.signal.butter(2, [low_hz, min(high_hz, 20000.0)], "bandpass", fs=RATE_HZ, output="sos")
    t = _seconds(length_s)
    noise = scipy.signal.sosfilt(sos, rng.standard_normal(len(t))) * np.exp(-t / decay_s)
    peak_one: NDArray[np.float64] = noise / np.abs(noise).max()
    return peak_one


def _metal(
    rng: Rng, partials_hz: tuple[float, ...], low_hz: float, decay_s: float, length_s: float
) -> NDArray[np.float64]:
    """Inharmonic square waves above `low_hz`: bells and cymbals."""
    t = _seconds(length_s)
    tone = sum(np.sign(np.sin(2.0 * np.pi * (hz * rng.uniform(0.995, 1.005) * t))) for hz in partials_hz)
    sos = scipy.signal.butter(3, low_hz, "highpass", fs=RATE_HZ, output="sos")
    tone = scipy.signal.sosfilt(sos, np.asarray(tone)) * np.exp(-t / decay_s)
    peak_one: NDArray[np.float64] = tone / np.abs(tone).max()
    return peak_one


def _scrape(rng: Rng, length_s: float, teeth_hz: float, swell: float) -> NDArray[np.float64]:
    """A stick scraped over the notches of a guiro."""
    t = _seconds(length_s)
    speed = teeth_hz * (1.0 + swell * t / length_s)
    tooth = np.exp(-8.0 * ((np.cumsum(speed) / RATE_HZ) % 1.0))
    sos = scipy.signal.butter(2, [2200.0, 9000.0], "bandpass", fs=RATE_HZ, output="sos")
    shape = (0.35 + 0.65 * (t / length_s)) * np.minimum(1.0, (length_s - t) / 0.02)
    scraped: NDArray[np.float64] = scipy.signal.sosfilt(sos, rng.standard_normal(len(t)) * tooth) * shape
    return scraped


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
