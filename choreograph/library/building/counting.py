"""Counts of takes that come without any: their song's, where the motion keeps to its beats, or the motion's.

That a take was danced to a song does not say that recording and sound file begin together: those of
dance-with-melody do not. So the song's beats are a take's counts only if the motion is slow where they are,
throughout the take. Otherwise, and without a song, a pretrained network reads the counts from the motion
(`nets.counts`), and says how many of them it expects to be right. If these are less than half, or if its
phases hardly agree with any counts, the take stays without and is danced by its motion beats. Counts that are
not sure are better than motion beats, and said not to be sure (`research/results/warping.md`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from choreograph.core.counts import FROM_MOTION, NO_COUNTS, Counts
from choreograph.core.timebase import STORE_FPS, frame_times_s
from choreograph.library.builtin import PretrainedNet
from choreograph.library.songs import SongCache
from choreograph.library.writing import MeasuredTake
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import mean_joint_speed_m_s

Floats = NDArray[np.float64]
MotionCounter = Callable[[NDArray[np.floating]], Counts]  # of body positions (T, 21, 3) at 20 fps

# Built-in takes and their songs' beats have 0.83 to 1, takes of dance-with-melody, of any phase, up to 0.28.
MIN_PHASE_LOCK = 0.6
# Shares of counts that are expected to be right, below which none are read from the motion,
MIN_MOTION_CONFIDENCE = 0.5
# and below which those read are said not to be sure: dances cut into pieces and shuffled, which have no
# count, reach 0.65; dances of new genres or figures have 0.6 to 0.9.
SURE_MOTION_CONFIDENCE = 0.7
# Mean uncertainty above which none are used. It is 0.13 to 0.29 in real takes with figures that the network
# was not trained on, and 0.34 and more in takes that are shuffled or stand still.
MAX_MOTION_UNCERTAINTY = 0.3
MOTION_NET = "motion_counts"  # its name among the pretrained networks
_WINDOW_BEATS = 4
_FEWEST_WINDOWS = 5  # of fewer, random phases agree too often
_STILL_M_S = 0.02  # slower is no clearer rest
_NAMED = 8  # takes in a note; the others are counted


def counted_takes(
    measured: Sequence[MeasuredTake], songs: SongCache, read_motion: MotionCounter | None = None
) -> tuple[list[MeasuredTake], tuple[str, ...]]:
    """The takes, those without counts with their song's or motion's where these are likely right, and notes.

    Without `read_motion` no counts are read from the motion. Raises `FormatError` if a song cannot be read.
    """
    counted, refused = [], []  # what was read of takes that stay without counts
    for given in measured:
        new = _counted_by_song(given, songs)
        if not len(new.take.counts) and read_motion is not None:
            read = read_motion(given.body_pos_m)
            if read.confidence >= MIN_MOTION_CONFIDENCE and _mean_uncertainty(read) <= MAX_MOTION_UNCERTAINTY:
                new = replace(new, take=replace(new.take, counts=read))
            else:
                refused.append(read)
        counted.append(new)
    pairs = list(zip(measured, counted, strict=True))
    found = [new.take for old, new in pairs if len(new.take.counts) and not len(old.take.counts)]
    by_motion = [take for take in found if take.counts.source == FROM_MOTION]
    by_song = [take.name for take in found if take.counts.source != FROM_MOTION]
    without = [m.take.name for m in counted if not len(m.take.counts)]
    notes = []
    if by_song:
        notes.append(
            f"{_number(by_song)} counted by the song's beats, which the motion keeps to: {_some(by_song)}"
        )
    for is_sure in (True, False):
        takes = [t for t in by_motion if (t.counts.confidence >= SURE_MOTION_CONFIDENCE) == is_sure]
        if takes:
            share = _range([take.counts.confidence for take in takes])
            how = f"with {share}" if is_sure else f"but not surely: only {share}"
            notes.append(
                f"{_number(takes)} counted by the motion, {how} of the counts expected to be right: "
                f"{_some([take.name for take in takes])}"
            )
    if without:
        why = ""
        if refused:
            share, uncertainty = (
                _range([c.confidence for c in refused]),
                _range([_mean_uncertainty(c) for c in refused]),
            )
            why = (
                f", since counts read from the motion are too doubtful ({share} of them expected to be "
                f"right, uncertainty {uncertainty})"
            )
        danced = "left out beside counted takes" if len(without) < len(counted) else "danced by motion beats"
        notes.append(f"{_number(without)} without counts and {danced}{why}: {_some(without)}")
    return counted, tuple(notes)


def load_motion_counter(pretrained: Mapping[str, PretrainedNet]) -> MotionCounter | None:
    """What reads counts from motion; None if the set has no such network."""
    if MOTION_NET not in pretrained:
        return None
    stored = pretrained[MOTION_NET].arrays

    def read(body_pos_m: NDArray[np.floating]) -> Counts:
        from choreograph.nets.motion_counts import MotionCountsNet

        return MotionCountsNet.from_arrays(stored.weights, stored.config).counts(body_pos_m)

    return read


def counts_from_song(
    song: Counts, motion_pos_m: NDArray[np.floating], fps: float, *, song_start_s: float = 0.0
) -> Counts:
    """A take's counts from those of its song, or none where the motion does not keep to the song's beats.

    Parameters
    ----------
    song : counts of the song, in seconds from its beginning
    motion_pos_m : float array (T, J, 3)   joint positions of the take
    fps : rate of the positions
    song_start_s : time in the song of the take's first frame

    Returns
    -------
    Counts   those within the take; confidence: the phase lock, times the song's where bars are known.
    `NO_COUNTS` if the phase lock is below `MIN_PHASE_LOCK`
    """
    here = song.within(song_start_s, song_start_s + len(motion_pos_m) / fps)
    lock = phase_lock(mean_joint_speed_m_s(motion_pos_m, fps), fps, here.times_s)
    if lock < MIN_PHASE_LOCK:
        return NO_COUNTS
    return replace(here, confidence=lock * (song.confidence if here.has_bars else 1.0))


def phase_lock(speed_m_s: Floats, fps: float, beat_times_s: Floats) -> float:
    """How steadily a motion is slow on beats and fast between them, 0 to 1.

    In every four beats, the first Fourier coefficient over the beat of the log speed (T,) says where in the
    beat it is slow. The result is the sum of their parts in phase with the beats over the sum of their sizes:
    1 if every window is slowest on the beat, around 0 (below it: 0) if beats and motion drift against each
    other, and for any other constant phase the cosine of it. 0 for fewer than 20 beats.
    """
    n_windows = (len(beat_times_s) - 1) // _WINDOW_BEATS
    if n_windows < _FEWEST_WINDOWS:
        return 0.0
    log_speed = np.log(np.asarray(speed_m_s, np.float64) + _STILL_M_S)
    # Without what changes more slowly than beats: a loud bar, a turn.
    log_speed = log_speed - gaussian_filter1d(log_speed, fps * float(np.median(np.diff(beat_times_s))))
    times_s = frame_times_s(len(log_speed), fps)
    phase = np.interp(times_s, beat_times_s, np.arange(len(beat_times_s)), left=-1.0)  # (T,) in beats
    window = np.floor(phase / _WINDOW_BEATS).astype(np.int64)
    is_inside = (window >= 0) & (window < n_windows)
    slow = -log_speed * np.exp(2j * np.pi * phase)
    sums = [np.bincount(window[is_inside], part[is_inside], n_windows) for part in (slow.real, slow.imag)]
    size = float(np.hypot(*sums).sum())
    return max(0.0, float(sums[0].sum()) / size) if size > 0.0 else 0.0


def _counted_by_song(measured: MeasuredTake, songs: SongCache) -> MeasuredTake:
    take = measured.take
    if len(take.counts) or take.song_path is None:
        return measured
    song = songs.analysed(take.song_path).counts
    pos_m = body_pos_m(take.motion.resampled(STORE_FPS))
    counts = counts_from_song(song, pos_m, STORE_FPS, song_start_s=take.song_start_s)
    return replace(measured, take=replace(take, counts=counts))


def _mean_uncertainty(read: Counts) -> float:
    return float(read.uncertainty.mean()) if len(read.uncertainty) else 0.0


def _number(takes: Sequence[object]) -> str:
    return "1 take is" if len(takes) == 1 else f"{len(takes)} takes are"


def _range(shares: Sequence[float]) -> str:
    low, high = f"{min(shares):.2f}", f"{max(shares):.2f}"
    return low if low == high else f"{low} to {high}"


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")
