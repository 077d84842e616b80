"""Real takes played through smoothed time maps are as smooth as the takes; through raw paths they are not."""

from __future__ import annotations

import numpy as np
import pytest

from choreograph.choreography.graph.warping import smooth_time_maps, subsequence_dtw
from choreograph.core.timebase import CLIP_FRAMES, CLIP_S, NET_FPS, SEGMENT_S, STORE_FPS
from choreograph.evaluation.metrics.physical import joint_jerk_m_s3
from choreograph.formats import dance_with_melody
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.song_features import motion_density, music_density
from choreograph.plan.runs import Run
from choreograph.render.assembly import assemble

TAKES = ("DANCE_C_4", "DANCE_R_7", "DANCE_W_12")


@pytest.fixture(scope="module")
def takes(shared_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("takes")
    for name in TAKES:
        (folder / name).symlink_to(shared_data / "dance-with-melody" / name)
    return {take.name: take for take in dance_with_melody.read(folder)}


def jerk_m_s3(motion, source_times_s: np.ndarray) -> np.ndarray:
    """Jerk of a segment as played in a dance; `source_times_s` (81,) are times in the take."""
    run = Run("take", 0.0, (len(source_times_s) - 1) / NET_FPS, source_times_s)
    dance, _ = assemble(
        [run], lambda *_: (motion, 0.0), fps=STORE_FPS, duration_s=SEGMENT_S, blending="inertial"
    )
    return joint_jerk_m_s3(body_pos_m(dance), STORE_FPS)[1]


def instants_s(frames: np.ndarray, start_s: float) -> np.ndarray:
    """Clip frames (80,) and the end of the last one, as times in the take (81,)."""
    end = min(2 * frames[-1] - frames[-2], CLIP_FRAMES - 1)
    return start_s + np.append(frames, end) / NET_FPS


@pytest.mark.slow
@pytest.mark.parametrize("beats_per_minute", [90, 120])
@pytest.mark.parametrize("name", TAKES)
def test_a_warped_take_is_as_smooth_as_the_take_at_its_mean_speed(takes, name, beats_per_minute):
    motion = takes[name].motion
    take_beats_s = motion_beat_times_s(body_pos_m(motion.resampled(NET_FPS)), NET_FPS)
    music_beats_s = np.arange(0.2, SEGMENT_S, 60 / beats_per_minute)
    query = music_density(1, music_beats_s)[0]
    smooth, raw, even = [], [], []
    for start_s in range(1, int(motion.duration_s) - CLIP_S - 1, CLIP_S):
        beats_s = take_beats_s[(take_beats_s >= start_s) & (take_beats_s < start_s + CLIP_S)] - start_s
        paths, _ = subsequence_dtw(query, motion_density(CLIP_FRAMES, beats_s)[None])
        time_map = smooth_time_maps(
            paths, clip_frames=CLIP_FRAMES - 1, motion_beats=beats_s * NET_FPS,
            beat_ranges=np.array([[0, len(beats_s)]]), music_beats=music_beats_s * NET_FPS,
        )[0]  # fmt: skip
        times_s = instants_s(time_map, start_s)
        smooth.append(jerk_m_s3(motion, times_s))
        raw.append(jerk_m_s3(motion, instants_s(paths[0], start_s)))
        even.append(jerk_m_s3(motion, np.linspace(times_s[0], times_s[-1], len(times_s))))
    assert len(even) >= 5
    smooth_p95, raw_p95, even_p95 = (np.percentile(np.concatenate(j), 95) for j in (smooth, raw, even))
    # Where the map speeds up towards a beat, jerk grows with the cube of its slope, but no further.
    assert smooth_p95 < 1.4 * even_p95
    assert raw_p95 > 1.3 * smooth_p95
