"""Layers with random contents, and a source of them, for planners and costs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from choreograph.choreography.graph.cost import Cost, WeightedCost
from choreograph.choreography.graph.costs import BUILTIN_COSTS
from choreograph.choreography.graph.layers import Moments
from choreograph.choreography.graph.motif_costs import node_motifs, song_words_s
from choreograph.choreography.graph.segments import ClipTable, LayerSource, Segments
from choreograph.choreography.graph.warping import NO_TIME_MAP
from choreograph.core.counts import Counts
from choreograph.core.timebase import CLIP_FRAMES, NODE_FRAMES, SEGMENT_FRAMES
from choreograph.music.form import Sections
from choreograph.music.song_features import SongFeatures


class RandomPoses:
    """A pose bank with a random pose for every frame of every clip."""

    def __init__(self, n_clips: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.pose = rng.normal(size=(n_clips, CLIP_FRAMES, 21, 3)).astype(np.float32)
        self.of_clip = rng.random(n_clips, np.float32)

    def poses_m(self, clip, frames):
        frames = np.clip(frames, 0, CLIP_FRAMES - 1)
        low = np.minimum(np.asarray(frames).astype(int), CLIP_FRAMES - 2)
        weight = (frames - low)[:, None, None].astype(np.float32)
        here, there = self.pose[clip, low], self.pose[clip, low + 1]
        return here + weight * (there - here), (there - here) * 20

    def liveliness(self, clip, start, stop):
        return self.of_clip[clip]

    def headings_rad(self, clip, frames):
        return (6.0 * self.of_clip[clip][:, None] + 0.02 * frames).astype(np.float32)

    def places_m(self, clip, frames):
        return np.stack([self.of_clip[clip][:, None] + 0.01 * frames, 0.0 * frames], axis=-1)

    def count_uncertainty(self, clip, start, stop):
        return 0.5 * self.of_clip[clip]


def random_source(
    seed: int,
    *,
    n_seconds: int = 6,
    k: int = 4,
    n_clips: int = 6,
    tie_break_s: np.ndarray | None = None,
    n_motifs: int = 0,
    tracked: bool = False,
    goal_starts: Sequence[int] = (),
    moments: Sequence[Moments] | None = None,
    returns: Sequence[int | None] | None = None,
) -> tuple[LayerSource, SongFeatures]:
    """A source of `n_seconds` random layers of at most 4·k nodes, and song features for it.

    With `n_motifs`, nodes have random motifs, two words per second. With `tracked`, about half of the
    segments belong to one of three tracks. Motifs are counted anew from `goal_starts` on.
    `moments` and `returns` are those of `LayerSource`.
    """
    rng = np.random.default_rng(seed)
    beats = np.sort(rng.uniform(0, NODE_FRAMES, (2, n_seconds, k, 4)), axis=0).astype(np.float32)
    beats[:, rng.random((n_seconds, k, 4)) < 0.2] = np.nan
    start = rng.uniform(0, 70, (n_seconds, k, 1))
    segments = Segments(
        clip=np.stack([rng.permutation(n_clips)[:k] for _ in range(n_seconds)]),
        time_maps=(start + np.arange(SEGMENT_FRAMES + 1)).astype(np.float32),
        density_mismatch=rng.random((n_seconds, k, 4), np.float32),
        unmatched_beat=rng.random((n_seconds, k, 4), np.float32),
        first_beat=beats[0],
        last_beat=beats[1],
        time_map_id=_time_map_ids(rng, n_seconds, k) if tracked else np.full((n_seconds, k), NO_TIME_MAP),
        off_bar=rng.random((n_seconds, k, 4), np.float32),
        phrase_penalty=rng.random((n_seconds, k, 5), np.float32),
        inputs=np.zeros((n_seconds, 16), np.uint8),
    )
    clips = ClipTable(
        take=np.arange(n_clips) % 2,
        start_frame=20 * np.arange(n_clips),
        usage_column=np.arange(2),
        take_names=np.array(["left", "right"]),
        genres=np.array(["waltz", "rumba"]),
        style=rng.normal(size=(n_clips, 32)).astype(np.float32),
        steps=rng.random(n_clips, np.float32),
    )
    song_features = SongFeatures(
        "random", float(n_seconds), Counts(np.arange(0, n_seconds, 0.5), np.arange(2 * n_seconds) % 4 + 1, 4),
        rng.normal(size=(n_seconds, 32)).astype(np.float32), np.full(n_seconds, 8, np.float32),
        np.zeros((n_seconds, SEGMENT_FRAMES), np.float32), Sections(np.zeros(0), np.zeros(0, np.int64)),
        np.ones(n_seconds, np.float32), 0.0, float(n_seconds), np.full(n_seconds, 0.5, np.float32),
    )  # fmt: skip
    motifs = None
    if n_motifs:
        words = rng.integers(n_motifs, size=10_000)
        motifs = node_motifs(
            segments, clips, song_words_s(song_features), lambda take, start_s, stop_s: words[: take.size]
        )
    source = LayerSource(
        segments, clips, RandomPoses(n_clips, seed), tie_break_s=tie_break_s, motifs=motifs,
        n_motifs=n_motifs, goal_starts=goal_starts, moments=moments, returns=returns,
    )  # fmt: skip
    return source, song_features


def _time_map_ids(rng: np.random.Generator, n_seconds: int, k: int) -> np.ndarray:
    return np.where(rng.random((n_seconds, k)) < 0.5, rng.integers(0, 3, (n_seconds, k)), NO_TIME_MAP)


def plain_costs() -> list[WeightedCost]:
    """The built-in costs that are made without arguments, with their default weights."""
    plain = [kind for kind in BUILTIN_COSTS if kind.for_dance.__func__ is Cost.for_dance.__func__]
    return [WeightedCost(kind(), kind.default_weight) for kind in plain]
