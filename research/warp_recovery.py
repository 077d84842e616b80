"""How well DTW on tempo-densities gives a known random warp back, on takes never trained on.

    python research/warp_recovery.py shared/data/dance-with-melody --preset tiny --seeds 0 1
    python research/warp_recovery.py shared/data/dance-with-melody --preset tiny --published \\
        --takes DANCE_C_6 DANCE_C_8 --epochs 100 300 1000 --work FOLDER

The second command trains by equation 2 alone, as `build-db --published` (`choreograph.settings.DENSITY`), on
the named takes, once for each number of epochs. The first rows of a network are of the held-out takes, those
with "trained on" of its own. Checkpoints are written to FOLDER, and after a stop the same command
continues.

Clips of 8 s every 4 s of each held-out take are warped at random: every motion beat moves by up to 0.5 s,
slopes stay in [0.5, 2]. Query: the middle 4 s of the warped clip's density. Target: the density of the
clip as it was. Error: the source time that subsequence DTW gives each query frame, against the true map.
`smooth` is the path after a Gaussian of 0.1 s, which takes the staircase of 50 ms frames out.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from itertools import product
from pathlib import Path

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d

from choreograph.choreography.graph.warping import subsequence_dtw
from choreograph.core.numerics import interpolate_frames
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, SEGMENT_FRAMES, STORE_FPS
from choreograph.formats.register import import_takes
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.song_features import motion_density
from choreograph.nets.configs import density_config
from choreograph.nets.density import MotionDensity
from choreograph.nets.density_training import random_time_map, train_motion_density
from choreograph.nets.style import centred
from choreograph.nets.style_training import StyleTake
from choreograph.nets.training import TrainingContext
from choreograph.pipeline.published import DENSITY
from research.warp_scores import recovery_errors_ms, summary_ms

SMOOTHING_FRAMES = 2.0
MIDDLE = slice((CLIP_FRAMES - SEGMENT_FRAMES) // 2, (CLIP_FRAMES + SEGMENT_FRAMES) // 2)
NO_MUSIC = np.zeros((1, 96), np.float32), np.zeros((1, 1), np.float32)


def motion_only(take) -> StyleTake:
    fine = body_pos_m(take.motion.resampled(STORE_FPS))
    coarse = body_pos_m(take.motion.resampled(NET_FPS)).astype(np.float32)
    return StyleTake(take.name, take.name, "", *NO_MUSIC, coarse, motion_beat_times_s(fine, STORE_FPS))


def clip_density(net: MotionDensity, clip: np.ndarray) -> np.ndarray:
    return net.take_density(centred(clip[None])[0])


def errors_ms(takes: list[StyleTake], net: MotionDensity | None) -> dict[str, np.ndarray]:
    """Absolute errors of every query frame by method. The warps are the same for every net."""
    rng = np.random.default_rng(123)
    errors = defaultdict(list)

    def record(method: str, found: np.ndarray, true: np.ndarray) -> None:
        errors[method].append(recovery_errors_ms(found, true[MIDDLE], NET_FPS))

    for take in takes:
        for begin in range(0, len(take.body_pos_m) - CLIP_FRAMES, SEGMENT_FRAMES):
            clip = take.body_pos_m[begin : begin + CLIP_FRAMES]
            beats = take.motion_beat_times_s - begin / NET_FPS
            true = random_time_map(CLIP_FRAMES, NET_FPS, rng, beat_times_s=beats, share=1.0)
            if net is None:
                record("identity", np.arange(CLIP_FRAMES)[MIDDLE], true)
                inside = beats[(beats > 0) & (beats * NET_FPS < CLIP_FRAMES - 1)]
                moved = np.interp(inside * NET_FPS, true, np.arange(CLIP_FRAMES)) / NET_FPS
                query, target, name = (
                    motion_density(CLIP_FRAMES, moved),
                    motion_density(CLIP_FRAMES, beats),
                    "analytic",
                )
            else:
                query, target, name = (
                    clip_density(net, interpolate_frames(clip, true)),
                    clip_density(net, clip),
                    "learned",
                )
            path, _ = subsequence_dtw(query[MIDDLE], target)
            smooth = gaussian_filter1d(path, SMOOTHING_FRAMES, mode="nearest")
            record(f"{name} raw", path, true)
            record(f"{name} smooth", smooth, true)
    return {name: np.concatenate(e) for name, e in errors.items()}


def show(title: str, errors: dict[str, np.ndarray]) -> None:
    for name, e in errors.items():
        label = f"{title} {name}".strip()
        print(f"{label:32s}", *(f"{ms:7.1f}" for ms in summary_ms(e).values()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument(
        "--held-out", type=Path, default=Path(__file__).with_name("dance_with_melody_held_out.txt")
    )
    parser.add_argument("--preset", default="small")
    parser.add_argument("--loss", default="locatable", help="locatable, or paper: equation 2 alone")
    parser.add_argument("--published", action="store_true", help="all settings of the paper, and --epochs")
    parser.add_argument("--epochs", type=int, nargs="+", default=[100], help="with --published")
    parser.add_argument("--takes", nargs="+", help="names of those trained on, by default all others")
    parser.add_argument("--work", type=Path, help="folder of the checkpoints")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    options = parser.parse_args()
    names = set(options.held_out.read_text(encoding="utf-8").split())
    takes = [motion_only(take) for take in import_takes(options.data)]
    known = [take for take in takes if take.name not in names]
    if options.takes:
        known = [take for take in known if take.name in options.takes]
    unknown = [take for take in takes if take.name in names]
    print(
        f"{len(known)} takes trained on, {len(unknown)} held out. Errors in ms: median, mean, 90th percentile"
    )
    show("", errors_ms(unknown, None))
    torch.set_num_threads(1)
    runs = (
        [DENSITY | {"epochs": n} for n in options.epochs] if options.published else [{"loss": options.loss}]
    )
    for seed, changes in product(options.seeds, runs):
        title = f"{options.preset}, seed {seed}" + (
            f", {changes['epochs']} epochs" if options.published else ""
        )
        folder = options.work and options.work / title.replace(", ", "-").replace(" ", "-")
        context = TrainingContext(folder, resume=True, device="cpu")
        config, start_s = density_config(options.preset, **changes), time.process_time()
        net = train_motion_density(known, config, seed=seed, context=context)
        print(f"{title}: trained in {time.process_time() - start_s:.0f} s of CPU time")
        show(f"{title}:", errors_ms(unknown, net))
        if options.published:
            show(f"{title}, trained on:", errors_ms(known, net))


if __name__ == "__main__":
    main()
