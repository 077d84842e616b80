"""ChoreoGraph's Figure 2: one clip's tempo-density, its warp, and the music's tempo-density beside it.

    python research/warp_figure.py p0.h5 song.mp3 -o figure2.png [--second 10]

The segment is the one that a dance plays at that second: of the method as published if the repertoire
carries learned densities (`build-db --published`), else of ours with `warping="dtw"`. Grey lines lead from
every fifth frame that is played down to when it is played.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import ConnectionPatch

import choreograph as cg
from choreograph.choreography.graph.warping import smooth_time_maps, subsequence_dtw
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.timebase import (
    CLIP_FRAMES,
    MAX_SLOPE,
    MIN_SLOPE,
    NET_FPS,
    SEGMENT_FRAMES,
    SEGMENT_S,
    frame_times_s,
)
from choreograph.pipeline.published import published_dance

SOURCE, WARPED, MUSIC, BEATS = "#d08a2e", "#2e8b6f", "#33405c", "#c1272d"
LINK_EVERY = 5  # frames


def warp_figure(
    repertoire: cg.Repertoire, song: cg.Song, config: cg.DanceConfig, second: int
) -> tuple[Figure, str]:
    """The figure, and a line on what it shows."""
    features, _ = analyse_song(song, repertoire)
    planned = cg.dance(song, repertoire, config=config).plan.seconds[second]
    first_s = planned.segment_second
    wanted = features.density[first_s]  # (80,)
    target = repertoire.clip_motion.density(np.array([planned.clip]))[0]  # (160,)
    time_map, _ = subsequence_dtw(wanted, target[:-1])  # (80,) clip frames
    beats_s = features.beat_times_s[(features.beat_times_s >= first_s)] - first_s
    beats_s = beats_s[beats_s < SEGMENT_S]
    clip_beats = repertoire.clip_motion_beats(planned.clip)
    if config.time_maps == "smooth":
        time_map = smooth_time_maps(
            time_map[None], clip_frames=CLIP_FRAMES - 1, motion_beats=clip_beats,
            beat_ranges=np.array([[0, len(clip_beats)]]), music_beats=beats_s * NET_FPS,
        )[0]  # fmt: skip
    warped = np.interp(time_map, np.arange(CLIP_FRAMES), target)
    figure = Figure(figsize=(8.0, 6.4), layout="constrained", dpi=110)
    figure.get_layout_engine().set(h_pad=0.16)
    of_clip, of_music, of_map = figure.subplots(3, 1, height_ratios=(1, 1, 1.3))
    of_clip.plot(frame_times_s(CLIP_FRAMES, NET_FPS), target, color=SOURCE)
    of_clip.plot(clip_beats / NET_FPS, np.interp(clip_beats, np.arange(CLIP_FRAMES), target), "o",
                 color=BEATS, markersize=4)  # fmt: skip
    of_clip.axvspan(time_map[0] / NET_FPS, time_map[-1] / NET_FPS, color=WARPED, alpha=0.15)
    of_clip.set(xlim=(0, 8), ylabel="tempo-density")
    of_clip.xaxis.tick_top()
    of_clip.set_title(f"clip of {planned.take} from {planned.clip_start_s:g} s, motion beats as dots",
                      loc="left", fontsize=10)  # fmt: skip
    played_s = frame_times_s(SEGMENT_FRAMES, NET_FPS)
    of_music.plot(played_s, wanted, color=MUSIC, label="music")
    of_music.plot(played_s, warped, color=WARPED, label="clip, warped")
    of_music.vlines(beats_s, 0, 1, transform=of_music.get_xaxis_transform(), color=SOURCE, linewidth=0.8)
    of_music.set(xlim=(0, SEGMENT_S), ylabel="tempo-density")
    of_music.set_xlabel(f"{song.name} from {first_s} s, its beats as lines", loc="left", fontsize=10)
    of_music.legend(frameon=False, loc="upper right", ncols=2, fontsize=8)
    for frame in range(0, SEGMENT_FRAMES, LINK_EVERY):
        ends = {
            "xyA": (time_map[frame] / NET_FPS, 0.0), "coordsA": of_clip.get_xaxis_transform(),
            "xyB": (frame / NET_FPS, 1.0), "coordsB": of_music.get_xaxis_transform(),
        }  # fmt: skip
        figure.add_artist(ConnectionPatch(**ends, color="#9aa3b2", linewidth=0.6))
    of_map.plot(played_s, time_map / NET_FPS, color=WARPED)
    middle = SEGMENT_FRAMES // 2
    for slope in (MIN_SLOPE, MAX_SLOPE):
        limit = (time_map[middle] + slope * (np.arange(SEGMENT_FRAMES) - middle)) / NET_FPS
        of_map.plot(played_s, limit, color="#9aa3b2", linewidth=0.8, linestyle="--")
    of_map.set(xlim=(0, SEGMENT_S), ylim=(0, 8), xlabel="seconds played", ylabel="seconds of the clip")
    of_map.set_title("the warp, and half and double speed dashed", loc="left", fontsize=10)
    for axis in (of_clip, of_music, of_map):
        axis.spines[["top", "right"]].set_visible(False)
    fit = float(np.mean((warped - wanted) ** 2) / max(np.var(wanted), 1e-12))
    return figure, f"{planned.take} from {planned.clip_start_s:g} s: squared difference / variance {fit:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("repertoire", type=Path)
    parser.add_argument("song", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help=".png, .svg or .pdf")
    parser.add_argument("--second", type=int, default=10)
    parser.add_argument("--duration", type=float, default=30.0, help="seconds of the song that are danced")
    options = parser.parse_args()
    repertoire = cg.Repertoire.open(options.repertoire)
    learned = repertoire.density == "learned"
    config = published_dance() if learned else cg.DanceConfig(warping="dtw")
    song = cg.load_song(options.song, duration_s=options.duration)
    figure, shown = warp_figure(repertoire, song, config, options.second)
    figure.savefig(options.output)
    print(shown)


if __name__ == "__main__":
    main()
