"""Warping: subsequence DTW of a clip's tempo-density to the music's, and the time map it becomes.

- `subsequence_dtw` — where in each clip the wanted density runs, with slope in [0.5, 2]
- `warp_segments` — every second's candidates, for the graph
- `smooth_time_maps` — the DTW's staircase as a smooth, monotone time map with beats on beats
"""

from choreograph.warping.dtw import MAX_SLOPE, MIN_SLOPE, subsequence_dtw
from choreograph.warping.segments import ClipBeats, Segments, warp_segments
from choreograph.warping.time_maps import smooth_time_maps

__all__ = [
    "MAX_SLOPE", "MIN_SLOPE", "ClipBeats", "Segments", "smooth_time_maps", "subsequence_dtw",
    "warp_segments",
]  # fmt: skip
