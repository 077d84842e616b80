"""Preview pages: plans for synthetic motions, a song with a click at every full second, pages of both."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import soundfile
from synthetic_motions import swaying

from choreograph.motion.motion import Credits, Motion
from choreograph.plan.plan import Plan, PlannedSecond
from choreograph.view.page import write_page

TAKES = ("anna-waltz", "ben-house", "cleo-salsa")
SEGMENT_S = 2
FPS = 60.0
DANCE = swaying(480, fps=FPS)  # 8 s


def plan_for(motion: Motion, *, takes: tuple[str, ...] = TAKES) -> Plan:
    """A plan as long as the motion: two seconds of each take in turn, at 1.25 times the speed."""
    n_seconds = int(np.ceil(motion.duration_s))
    return Plan(
        song="clicks", duration_s=motion.duration_s, start_s=0.0, repertoire="rep.h5", planner="exact",
        blending="inertial", seed=0, fps=motion.fps, weights={"style": 1.0, "transition": 1.0},
        music_beats_s=tuple(np.arange(0.0, motion.duration_s, 0.5)),
        seconds=tuple(_second(s, takes[s // SEGMENT_S % len(takes)]) for s in range(n_seconds)),
    )  # fmt: skip


def _second(second: int, take: str) -> PlannedSecond:
    offset = second % SEGMENT_S
    start_s = 10.0 + 4 * (second // SEGMENT_S) + 1.25 * offset
    return PlannedSecond(
        second=second, take=take, clip=40 + second // SEGMENT_S, clip_start_s=start_s - 1.25 * offset,
        segment_second=second - offset, offset=offset,
        source_times_s=tuple(start_s + 1.25 * np.arange(21) / 20),
        start_s=float(second), transition_s=0.4,
        costs={"style": 0.25 + 0.01 * second, "transition": 0.0 if offset else 0.125},
        credits=Credits(f"genre of {take}", f"dancer of {take}", licence="CC0", source="synthetic"),
    )  # fmt: skip


def write_seconds(path: Path, *, duration_s: float, rate_hz: int = 44100) -> Path:
    """A stereo song, nearly silent but for a click of 20 ms at every full second."""
    samples = 0.001 * np.random.default_rng(0).standard_normal((round(duration_s * rate_hz), 2))
    time_s = np.arange(round(0.02 * rate_hz)) / rate_hz
    click = 0.8 * np.sin(2 * np.pi * 3000 * time_s) * np.exp(-time_s / 0.004)
    for second in range(int(duration_s)):
        samples[second * rate_hz :][: len(click)] += click[: len(samples) - second * rate_hz, None]
    soundfile.write(path, samples.astype(np.float32), rate_hz)
    return path


def write_pages(folder: Path) -> Path:
    """`DANCE` with its song (song.html), without (silent.html) and with a broken one (broken.html)."""
    song = write_seconds(folder / "song.wav", duration_s=9.0)
    options = {"motion_beats_s": np.arange(0.25, 8.0, 0.5), "title": "A dance"}
    write_page(folder / "song.html", DANCE, plan_for(DANCE), song_path=song, **options)
    write_page(folder / "silent.html", DANCE, plan_for(DANCE), song_path=None, **options)
    text = (folder / "song.html").read_text(encoding="utf-8")
    broken = re.sub(r'(id="sound">)[^<]{4000}', r"\g<1>" + "AAAA" * 1000, text)
    (folder / "broken.html").write_text(broken, encoding="utf-8")
    return folder
