"""Counts for takes without counts, from the song if the motion follows its beats, else from the motion.

A recording and the file of its song may begin at different times, as in dance-with-melody. So the beats of
the song are the counts of a take only if the motion is slow on the beats throughout the take. Otherwise a
pretrained network (`nets.motion_counts`) estimates the counts from the motion. Their confidence is the
expected share of right counts. If the confidence is too low, or the uncertainty of the counts too high, the
take stays without counts. Uncertain counts are better than motion beats (`research/results/warping.md`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from choreograph.core.cache import key_of
from choreograph.core.counts import NO_COUNTS, Counts
from choreograph.core.numerics import Floats
from choreograph.core.timebase import STORE_FPS, frame_times_s
from choreograph.library.builtin import MotionCounter, are_likely_right, mean_uncertainty
from choreograph.library.notes import Note
from choreograph.library.songs import SongCache
from choreograph.library.writing import MeasuredTake
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Take
from choreograph.motion.motion_beats import mean_joint_speed_m_s

# Built-in takes have 0.83 to 1 with the beats of their songs. Takes of dance-with-melody have up to 0.28.
MIN_PHASE_LOCK = 0.6
# Confidence below which a note says that counts from motion are uncertain. Dances that are cut into pieces
# and shuffled have no counts, and reach 0.65. Dances of new genres or figures have 0.6 to 0.9.
SURE_MOTION_CONFIDENCE = 0.7
_WINDOW_BEATS = 4
_FEWEST_WINDOWS = 5  # in fewer windows, random phases agree too often
_STILL_M_S = 0.02  # slower motion counts as equally still


class Counting(NamedTuple):
    """What takes without counts are counted with."""

    songs: SongCache
    count_motion: MotionCounter | None = None  # without it, no counts are estimated from motion

    @property
    def key(self) -> bytes | None:
        """A digest of `count_motion`, or None if it is of another package."""
        return key_of(counted_take if self.count_motion is None else self.count_motion)

    def song_counts(self, takes: Sequence[Take]) -> list[Counts | None]:
        """For each take, the counts of its song if it has one and needs them. Raises as `load_song`."""
        needed = [None if len(take.counts) else take.song_path for take in takes]
        self.songs.analyse(path for path in needed if path)
        return [self.songs.analysed(path).counts if path else None for path in needed]


def counted_take(
    count_motion: MotionCounter | None, measured: MeasuredTake, song: Counts | None
) -> tuple[MeasuredTake, Note | None]:
    """The take with counts if these are probably right, and a note if it had none.

    The counts are those of its `song`, if there is one, else those that `count_motion` estimates from the
    motion, if it is given.
    """
    take = measured.take
    if len(take.counts):
        return measured, None
    counts, note = NO_COUNTS, Note("no counts", take.name)
    if song is not None:
        pos_m = body_pos_m(take.motion.resampled(STORE_FPS))
        counts = counts_from_song(song, pos_m, STORE_FPS, song_start_s=take.song_start_s)
    if len(counts):
        note = Note("counts from song", take.name, {"confidence": counts.confidence})
    elif count_motion is not None:
        counts = count_motion(measured.body_pos_m)
        confidence = {"confidence": counts.confidence}
        if not are_likely_right(counts):
            values = confidence | {"uncertainty": mean_uncertainty(counts)}
            counts, note = NO_COUNTS, Note("refused counts", take.name, values)
        elif counts.confidence >= SURE_MOTION_CONFIDENCE:
            note = Note("counts from motion", take.name, confidence)
        else:
            note = Note("uncertain counts", take.name, confidence)
    return replace(measured, take=replace(take, counts=counts)), note


def uncounted_notes(measured: Sequence[MeasuredTake]) -> list[Note]:
    """A note on the use of takes without counts, if there are any."""
    has_counts = [len(m.take.counts) > 0 for m in measured]
    return [] if all(has_counts) else [Note("uncounted left out" if any(has_counts) else "uncounted danced")]


def counts_from_song(
    song: Counts, motion_pos_m: NDArray[np.floating], fps: float, *, song_start_s: float = 0.0
) -> Counts:
    """The counts of a take from those of its song, or none if the motion does not follow the beats.

    Parameters
    ----------
    song : counts of the song, in seconds from its beginning
    motion_pos_m : float array (T, J, 3)   joint positions of the take
    fps : rate of the positions
    song_start_s : time in the song of the take's first frame

    Returns
    -------
    Counts   those within the take, or `NO_COUNTS` if the phase lock is below `MIN_PHASE_LOCK`. Their
    confidence is the phase lock, times the confidence of the song where bars are known
    """
    here = song.within(song_start_s, song_start_s + len(motion_pos_m) / fps)
    lock = phase_lock(mean_joint_speed_m_s(motion_pos_m, fps), fps, here.times_s)
    if lock < MIN_PHASE_LOCK:
        return NO_COUNTS
    return replace(here, confidence=lock * (song.confidence if here.has_bars else 1.0))


def phase_lock(speed_m_s: Floats, fps: float, beat_times_s: Floats) -> float:
    """How consistently a motion is slow on beats and fast between them, 0 to 1.

    In every window of four beats, the phase of the first Fourier coefficient of the log speed (T,) over the
    beat is the position in the beat at which the motion is slow. The result is the sum of the real parts,
    divided by the sum of the magnitudes. It is 1 if every window is slowest on the beat, the cosine of any
    other constant phase, and around 0 if beats and motion drift apart. It is not below 0, and it is 0 for
    fewer than 20 beats.
    """
    n_windows = (len(beat_times_s) - 1) // _WINDOW_BEATS
    if n_windows < _FEWEST_WINDOWS:
        return 0.0
    log_speed = np.log(np.asarray(speed_m_s, np.float64) + _STILL_M_S)
    # Remove changes that are slower than beats, such as a turn.
    log_speed = log_speed - scipy.ndimage.gaussian_filter1d(
        log_speed, fps * float(np.median(np.diff(beat_times_s)))
    )
    times_s = frame_times_s(len(log_speed), fps)
    phase = np.interp(times_s, beat_times_s, np.arange(len(beat_times_s)), left=-1.0)  # (T,) in beats
    window = np.floor(phase / _WINDOW_BEATS).astype(np.int64)
    is_inside = (window >= 0) & (window < n_windows)
    slow = -log_speed * np.exp(2j * np.pi * phase)
    sums = [np.bincount(window[is_inside], part[is_inside], n_windows) for part in (slow.real, slow.imag)]
    size = float(np.hypot(*sums).sum())
    return max(0.0, float(sums[0].sum()) / size) if size > 0.0 else 0.0
