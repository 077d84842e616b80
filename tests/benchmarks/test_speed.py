"""How long the engine takes; run with `pytest tests/benchmarks --benchmark-only`.

Goals for a song of 180 s, K = 512 and 2,000 clips on two cores: warping 1.5 s, exact planning 2 s,
the whole process 10 s. Measured, not asserted: another machine is another clock.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_layers import plain_costs
from synthetic_repertoire import synthetic_contents, synthetic_takes, write_clicks

from choreograph.choreography.graph.planners import plan_exact
from choreograph.choreography.graph.segments import ClipBeats, ClipTable, LayerSource, warp_segments
from choreograph.choreography.graph.warping import subsequence_dtw
from choreograph.core.counts import Counts
from choreograph.library.repertoire import Repertoire, starter_repertoire
from choreograph.library.writing import write_repertoire
from choreograph.music.form import Sections
from choreograph.music.song_features import SongFeatures, music_density
from content.songs.synthesis.song import render_song, write_song

N_SECONDS, K, N_CLIPS = 180, 512, 2000


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    """2,000 clips from 40 takes of 57 s, and the built-in style networks: a song is analysed by real ones."""
    takes = synthetic_takes(periods_s=np.linspace(0.4, 0.9, 40), duration_s=57.0)
    contents = replace(synthetic_contents(takes), nets={"style": starter_repertoire().net("style")})
    path = tmp_path_factory.mktemp("speed") / "rep.h5"
    write_repertoire(path, contents)
    made = Repertoire.open(path)
    assert made.n_clips == N_CLIPS
    return made


@pytest.fixture(scope="module")
def warping(repertoire):
    """The arguments of `warp_segments` for a song of 120 beats a minute with random candidates."""
    rng = np.random.default_rng(0)
    clip = np.stack([rng.permutation(N_CLIPS)[:K] for _ in range(N_SECONDS)])
    beats_s = np.arange(0.0, N_SECONDS, 0.5)
    motion = repertoire.clip_motion
    beats = [repertoire.clip_motion_beats(c) for c in range(N_CLIPS)]
    stops = np.cumsum([len(b) for b in beats])
    ranges = np.stack([stops - [len(b) for b in beats], stops], axis=1)
    return (
        clip, music_density(N_SECONDS, beats_s), beats_s, motion.density, motion.speed,
        ClipBeats(np.concatenate(beats), ranges),
    )  # fmt: skip


def test_92160_warps(benchmark):
    rng = np.random.default_rng(0)
    query = rng.random((K, 80), np.float32)
    target = rng.random((K, 160), np.float32)

    def warp_a_song():
        for _ in range(N_SECONDS):
            subsequence_dtw(query, target)

    benchmark.pedantic(warp_a_song, rounds=3, warmup_rounds=1)


def test_warping_a_song(benchmark, warping):
    segments = benchmark.pedantic(warp_segments, args=warping, rounds=3, warmup_rounds=1)
    assert segments.time_maps.shape == (N_SECONDS, K, 81)


@pytest.mark.parametrize("styles", ["equal", "random"])
def test_planning_a_song_exactly(benchmark, repertoire, warping, styles):
    segments = warp_segments(*warping)
    rng = np.random.default_rng(1)
    spread = 0.0 if styles == "equal" else 0.2
    clips = ClipTable(
        repertoire.clip_take,
        repertoire.clip_start_frame,
        np.arange(len(repertoire.takes)),
        np.array([take.name for take in repertoire.takes]),
        np.array([take.credits.genre for take in repertoire.takes]),
        (spread * rng.normal(size=(N_CLIPS, 32))).astype(np.float32),
        np.full(N_CLIPS, 0.5, np.float32),
    )
    music = SongFeatures(
        "synthetic", float(N_SECONDS), Counts(warping[2], np.zeros(len(warping[2]), np.int64), 0),
        np.zeros((N_SECONDS, 32), np.float32),
        np.full(N_SECONDS, 8, np.float32), warping[1],
        Sections(np.zeros(0), np.zeros(0, np.int64)),
        np.ones(N_SECONDS, np.float32), 0.0, float(N_SECONDS), np.full(N_SECONDS, 0.5, np.float32),
    )  # fmt: skip
    costs = plain_costs()

    def plan():
        return plan_exact(LayerSource(segments, clips, repertoire.clip_motion), costs, music)

    path = benchmark.pedantic(plan, rounds=2, warmup_rounds=1)
    assert len(path.nodes) == N_SECONDS


def test_the_whole_process(benchmark, repertoire, tmp_path):
    song = write_clicks(tmp_path / "song.wav", duration_s=float(N_SECONDS))
    command = [
        sys.executable, "-m", "choreograph", "dance", str(song), "--db", str(repertoire.path),
        "-o", str(tmp_path / "out.bvh"), "-q",
    ]  # fmt: skip
    root = Path(__file__).resolve().parents[2]

    def run():
        subprocess.run(command, check=True, cwd=root, env=os.environ)

    benchmark.pedantic(run, rounds=2, warmup_rounds=1)
    assert (tmp_path / "out.bvh").stat().st_size > 1_000_000


def test_the_first_dance_on_a_fresh_machine(benchmark, tmp_path):
    """A song of 60 s with the built-in takes, nothing compiled before; the goal is 30 s."""
    song = tmp_path / "song.wav"
    write_song(song, render_song("house", bpm=124.0, duration_s=57.0, seed=4000))
    command = [sys.executable, "-m", "choreograph", "dance", str(song), "-q"]
    fresh = iter(range(99))

    def run():
        environment = {
            **os.environ, "NUMBA_CACHE_DIR": str(tmp_path / f"numba{next(fresh)}"),
            "PYTHONPATH": str(Path(__file__).resolve().parents[2]),
        }  # fmt: skip
        subprocess.run(command, check=True, cwd=tmp_path, env=environment)

    benchmark.pedantic(run, rounds=2)
    assert (tmp_path / "song.html").exists()
