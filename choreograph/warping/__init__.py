"""Warping: subsequence DTW of a clip's tempo-density to the music's, and time maps made from its path.

- `dtw` — subsequence DTW of many clips at once, with slopes in [0.5, 2]
- `time_maps` — a DTW path as a smooth, monotone time map that puts motion beats on music beats
- `micro_timing` — accents just beside their counts
- `count_grids` — beats of a song and counts of takes as clocks
- `count_maps` — time maps that lay a take's counts on a song's beats
- `segments` — every second's candidates, warped for the graph
"""

from choreograph.timebase import MAX_SLOPE, MIN_SLOPE
from choreograph.warping.count_grids import FEWEST_COUNTS, SongGrid, TakeGrids, steady_times_s
from choreograph.warping.count_maps import CountedClips
from choreograph.warping.dtw import subsequence_dtw
from choreograph.warping.segments import ClipBeats, Segments, warp_segments
from choreograph.warping.time_maps import smooth_time_maps

__all__ = [
    "FEWEST_COUNTS", "MAX_SLOPE", "MIN_SLOPE", "ClipBeats", "CountedClips", "Segments", "SongGrid",
    "TakeGrids", "smooth_time_maps", "steady_times_s", "subsequence_dtw", "warp_segments",
]  # fmt: skip
