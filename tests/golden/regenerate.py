"""Write the metrics of a synthetic dance to one golden file per module; the tests compare against them.

Run it when a metric is meant to change, and review the diff:

    python tests/golden/regenerate.py [physical beat frechet ...]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.core.timebase import SAMPLE_RATE_HZ
from choreograph.evaluation.metrics import beat, fid, frechet, labels, physical, structure
from choreograph.evaluation.plan_scores import playback_speed_scores
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.motion.rotations import from_rotvec
from choreograph.motion.skeleton import canonical_skeleton
from research import retrieval, warp_scores

FOLDER = Path(__file__).parent
FPS = 60.0
DURATION_S = 12.0


def synthetic_motion() -> Motion:
    """12 s of limbs that swing in sines while the body sways, bobs and turns."""
    times_s = np.arange(round(DURATION_S * FPS)) / FPS
    skeleton = canonical_skeleton()
    joints = np.arange(len(skeleton.names))
    hz = 0.5 + 0.25 * (joints % 4)
    swing = 0.5 * np.sin(2 * np.pi * hz * times_s[:, None] + 0.7 * joints)  # (T, J)
    axes = np.stack([np.cos(joints), 0.3 * np.sin(2 * joints), np.sin(joints)], axis=-1)  # (J, 3)
    rotvec = swing[..., None] * axes
    rotvec[:, 0] = np.array([0.0, 1.0, 0.0]) * (0.4 * times_s)[:, None]
    root = skeleton.offsets_m[0] + np.stack(
        [
            0.3 * np.sin(0.9 * times_s),
            0.04 + 0.04 * np.cos(2 * np.pi * times_s),
            0.2 * np.sin(1.7 * times_s),
        ],
        axis=-1,
    )
    return Motion(skeleton, root, from_rotvec(rotvec), FPS)


def synthetic_dance() -> NDArray[np.float64]:
    """Body positions (T, 21, 3) of the synthetic motion."""
    return body_pos_m(synthetic_motion())


def accelerating_dance() -> NDArray[np.float64]:
    """Body positions (T, 21, 3) of the synthetic motion, accelerated from ½ to 1½ times its speed."""
    motion = synthetic_motion()
    progress = np.linspace(0.0, 1.0, motion.n_frames)
    return body_pos_m(motion.sampled((progress + progress**2) / 2 * (motion.n_frames - 1)))


def synthetic_song() -> NDArray[np.float32]:
    """12 s of plucked tones that accelerate from two to four per second, over noise that grows."""
    times_s = np.arange(round(DURATION_S * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    count = 2 * times_s + times_s**2 / DURATION_S  # notes started so far
    hz = 220 * 2 ** ((np.floor(count) * 5 % 12) / 12)
    since_s = (count % 1) / (2 + 2 * times_s / DURATION_S)
    pluck = np.exp(-since_s / 0.1) * np.sin(2 * np.pi * hz * since_s)
    noise = np.sin(1e4 * np.sin(1e3 * np.arange(len(times_s))))  # the same on every machine
    return (0.4 * pluck + 0.01 * times_s / DURATION_S * noise).astype(np.float32)


def physical_scores() -> dict[str, float]:
    return physical.evaluate(synthetic_dance(), FPS, [4.0, 8.0])


def beat_scores() -> dict[str, float]:
    dance, music_beats_s = synthetic_dance(), np.arange(0.3, DURATION_S, 0.5)
    motion_beats_s = motion_beat_times_s(dance, FPS)
    rng = np.random.default_rng(0)
    chance = beat.evaluate_chance(motion_beats_s, music_beats_s, duration_s=DURATION_S, rng=rng, rounds=20)
    return (
        beat.evaluate(motion_beats_s, music_beats_s)
        | beat.evaluate_published(dance, FPS, music_beats_s)
        | {f"chance of {name}": value for name, value in chance.items()}
    )


def frechet_scores() -> dict[str, float]:
    """The first second of the motion against the rest."""
    dance = synthetic_motion()
    return frechet.evaluate([dance.sliced(0, 60)], [dance.sliced(60, dance.n_frames)])


def fid_features() -> dict[str, list[float]]:
    """All features of the motion, at a rate that needs resampling."""
    pos_m = fid.canonical_pos_m(synthetic_motion().resampled(25.0))
    return {
        f"{feature.__name__} {variant}": feature(pos_m, 25.0, variant=variant).tolist()
        for feature in (fid.kinetic, fid.geometric)
        for variant in ("published", "corrected")
    }


def label_values() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Dance and music labels of every window in their own units, both (9, 4).

    The dance accelerates, so that no two windows have the same labels. The synthetic motion itself repeats
    every second: its windows differ by rounding alone, and their ranks would differ between CPUs.
    """
    starts_s = labels.window_starts_s(DURATION_S)
    return (
        labels.dance_values(accelerating_dance(), FPS, starts_s),
        labels.music_values(synthetic_song(), starts_s),
    )


def label_scores() -> dict[str, float]:
    dance, music = label_values()
    scale = labels.fit_scale(dance, music)
    means = {
        f"{whose} {pair}": float(mean)
        for whose, values in (("dance", dance), ("music", music))
        for pair, mean in zip(labels.PAIRS, values.mean(axis=0), strict=True)
    }
    return means | labels.evaluate(scale.dance_labels(dance), scale.music_labels(music))


def structure_scores() -> dict[str, float]:
    """A minute of motion words of half a second: verse, chorus, verse, bridge, chorus."""
    rng = np.random.default_rng(0)
    verse, chorus, bridge = rng.integers(0, 8, (3, 24))
    motifs = np.concatenate([verse, chorus, verse[::-1], bridge, chorus])
    starts_s = np.arange(len(motifs)) * 0.5
    sources_s = 0.5 * motifs + 20.0 * (np.arange(len(motifs)) % 3)
    return structure.evaluate(
        motifs, starts_s, [f"take {motif % 5}" for motif in motifs],
        np.stack([starts_s, starts_s + 0.5, sources_s, sources_s + 0.6], axis=1),
        template=np.arange(1, 9) / 36, transitions=rng.dirichlet(np.ones(8), 8),
        section_bounds_s=np.arange(6) * 12.0, section_labels=["verse", "chorus", "verse", "bridge", "chorus"],
    )  # fmt: skip


def warping_scores() -> dict[str, float]:
    """Maps whose slope swings between the limits, and their recovery by a path of whole frames."""
    frames = np.arange(80)
    true = np.cumsum(2.0 ** np.sin(frames / np.array([[9.0], [15.0], [40.0]])), axis=1)
    errors_ms = warp_scores.recovery_errors_ms(np.rint(true), true, 20.0)
    return playback_speed_scores(true) | warp_scores.summary_ms(errors_ms)


def retrieval_scores() -> dict[str, float]:
    ranks = np.arange(60)
    relevant = np.stack([(3 * ranks + query + 1) % (query + 4) == 0 for query in range(6)])
    return retrieval.evaluate(relevant, 10, groups=["waltz"] * 4 + ["tango"] * 2)


SCORES: dict[str, Callable[[], dict]] = {
    "physical": physical_scores,
    "beat": beat_scores,
    "labels": label_scores,
    "structure": structure_scores,
    "warping": warping_scores,
    "retrieval": retrieval_scores,
    "frechet": frechet_scores,
    "fid": fid_features,
}


def golden(module: str) -> dict:
    """The golden values of a module."""
    return json.loads((FOLDER / f"{module}.json").read_text(encoding="utf-8"))


def main() -> None:
    for module in sys.argv[1:] or SCORES:
        text = json.dumps(SCORES[module](), indent=1) + "\n"
        (FOLDER / f"{module}.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
