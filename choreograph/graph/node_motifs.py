"""The motifs that each node dances.

Words last from music beat to music beat. A word belongs to the second of the song that its middle is in.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from choreograph.graph.layers import ClipTable
from choreograph.timebase import NET_FPS, SEGMENT_FRAMES, SEGMENT_S
from choreograph.warping.segments import Segments

Floats = NDArray[np.floating]
MotifsOf = Callable[[NDArray[np.int64], Floats, Floats], NDArray[np.integer]]

NO_MOTIF = -1
_BLOCK_S = 64  # seconds of the song whose spans are in memory at a time, 0.5 MB each


def node_motifs(
    segments: Segments, clips: ClipTable, word_bounds_s: Floats, motifs_of: MotifsOf
) -> NDArray[np.int16]:
    """Motifs of the nodes of all warped segments.

    Parameters
    ----------
    word_bounds_s : float array (Q + 1,)   times where the song's words begin and end; `song_words_s`
    motifs_of : (take, start_s, stop_s) -> motifs, arrays (M,); see `motifs.span_motifs.SpanMotifLookup`

    Returns
    -------
    int array (S, K, 4, W), in order, padded with -1; all nodes of a second have as many. Where a word
    extends beyond its segment, the time map is extrapolated.
    """
    n_seconds, k = segments.clip.shape
    owner = np.floor((word_bounds_s[1:] + word_bounds_s[:-1]) / 2).astype(np.int64)  # (Q,) second of the song
    words = [np.flatnonzero(owner == second) for second in range(n_seconds + SEGMENT_S - 1)]
    width = max((len(w) for w in words), default=0)
    motifs = np.full((n_seconds, k, SEGMENT_S, width), NO_MOTIF, np.int16)
    for first in range(0, n_seconds, _BLOCK_S):
        requests, takes, starts, stops = [], [], [], []
        for second in range(first, min(first + _BLOCK_S, n_seconds)):
            inside = np.concatenate(words[second : second + SEGMENT_S])
            clip = segments.clip[second]
            bounds = np.stack([word_bounds_s[inside], word_bounds_s[inside + 1]])  # (2, M)
            frames = clips.start_frame[clip, None, None] + _source_frames(
                segments.time_maps[second], bounds - second
            )
            requests.append((second, inside, owner[inside] - second))
            takes.append(np.repeat(clips.take[clip], len(inside)))
            starts.append(frames[:, 0].ravel() / NET_FPS)
            stops.append(frames[:, 1].ravel() / NET_FPS)
        labels = motifs_of(*(np.concatenate(parts) for parts in (takes, starts, stops)))
        stop = 0
        for second, inside, offset in requests:
            start, stop = stop, stop + k * len(inside)
            slot = inside - np.array([words[second + o][0] for o in offset], np.int64)
            motifs[second][:, offset, slot] = labels[start:stop].reshape(k, len(inside))
    return motifs


def _source_frames(maps: NDArray[np.floating], times_s: Floats) -> NDArray[np.float64]:
    """Clip frames (K, ...) of times (...) in a segment by its time maps (K, 81), extrapolated outside."""
    frames = np.asarray(times_s) * NET_FPS
    low = np.clip(np.floor(frames).astype(np.int64), 0, SEGMENT_FRAMES - 1)
    return maps[:, low] + (frames - low) * (maps[:, low + 1] - maps[:, low]).astype(np.float64)
