"""Draws the figures of the documentation from the built-in repertoire and a built-in song: `draw_all`."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

import choreograph as cg
from choreograph.choreography.graph.warping import subsequence_dtw
from choreograph.choreography.song_analysis import analyse_song
from choreograph.motion.body import BODY_JOINTS, body_pos_m
from choreograph.music.beats import onset_strength
from choreograph.music.mel import log_mel
from choreograph.music.song_features import motion_density, music_density
from choreograph.plan.joins import take_motions
from choreograph.plan.runs import plan_runs
from choreograph.render.rendering import assemble
from choreograph.view.strip import write_motif_plots

SONG_S = 30.0
WARPED_SECOND = 6
GRAPH_S = 12  # seconds of the song in the figure of the graph
CANDIDATES_SHOWN = 60  # of each second
WRIST = BODY_JOINTS.index("left_wrist")
AROUND_JOIN_S = 0.8
NAMES = ("song", "warp", "graph", "motif", "signature", "transition")


class Recorder(cg.Cost):
    """Keeps the candidates of each second and how far their style is from the music's."""

    def __init__(self) -> None:
        self.candidates: dict[int, tuple[cg.Layer, np.ndarray]] = {}

    def node(self, layer: cg.Layer, song_features: cg.SongFeatures) -> None:
        away = np.linalg.norm(layer.style - song_features.style[layer.second], axis=1)  # (N,)
        self.candidates.setdefault(layer.second, (layer, away))


def sources() -> str:
    """The SHA-256 of everything that the figures depend on: this file, the program and its built-in files."""
    package = Path(cg.__file__).parent
    paths = sorted(path for suffix in ("py", "h5", "ogg") for path in package.rglob(f"*.{suffix}"))
    return sha256(b"".join(path.read_bytes() for path in [Path(__file__), *paths])).hexdigest()


def draw_all(folder: Path) -> None:
    """Write every figure of `NAMES` into `folder` as PNG, unless they were drawn from these `sources`."""
    drawn_from = folder / "drawn-from.txt"
    if drawn_from.exists() and drawn_from.read_text() == sources():
        return
    folder.mkdir(parents=True, exist_ok=True)
    matplotlib.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    repertoire = cg.starter_repertoire()
    song = cg.load_song(cg.example_songs()["house"], duration_s=SONG_S)
    features, _ = analyse_song(song, repertoire)
    recorder = Recorder()
    dance = cg.dance(song, costs=[recorder])
    draw_song(song, features, folder / "song.png")
    draw_warp(repertoire, features, dance.plan, folder / "warp.png")
    draw_graph(recorder, dance.plan, folder / "graph.png")
    draw_transition(repertoire, dance.plan, folder / "transition.png")
    plots = {path.name: path for path in write_motif_plots(folder / "motifs", repertoire)}
    plots["motif-001.png"].replace(folder / "motif.png")
    plots["signature-waltz.png"].replace(folder / "signature.png")
    for path in (folder / "motifs").iterdir():
        path.unlink()
    (folder / "motifs").rmdir()
    drawn_from.write_text(sources())


def draw_song(song: cg.Song, features: cg.SongFeatures, path: Path) -> None:
    """The waveform with sections and phrases, and the strength of onsets with beats and bars."""
    figure = Figure(figsize=(8.0, 3.6), dpi=110, layout="constrained")
    wave, onsets = figure.subplots(2, 1, sharex=True)
    times_s = np.arange(len(song.samples)) / len(song.samples) * song.duration_s
    wave.plot(times_s[::40], song.samples[::40], lw=0.4, color="0.4")
    bounds_s = features.sections.bounds_s
    for start_s, end_s, label in zip(bounds_s[:-1], bounds_s[1:], features.sections.labels, strict=True):
        wave.axvspan(start_s, end_s, alpha=0.2, color=f"C{label}", label=f"section {label + 1}")
    height = float(np.abs(song.samples).max())
    for phrase, label in zip(features.form.phrases, features.form.labels, strict=True):
        wave.vlines(phrase.start_s, -height, height, color="0.2", lw=0.8)
        wave.text(phrase.start_s + 0.1, -height, f"phrase {label + 1}", fontsize=7)
    wave.legend(loc="upper right")
    wave.set_ylabel("waveform")
    strength = onset_strength(log_mel(song.samples))  # (T,)
    onsets.plot(np.linspace(0.0, song.duration_s, len(strength)), strength, lw=0.6, color="0.4")
    onsets.vlines(features.beat_times_s, 0, strength.max(), color="C0", lw=0.8, label="beats")
    onsets.vlines(features.counts.downbeat_times_s, 0, strength.max(), color="C3", lw=1.4, label="bars")
    onsets.legend(loc="upper right")
    onsets.set(ylabel="onset strength", xlabel="time (s)")
    figure.savefig(path)


def draw_warp(repertoire: cg.Repertoire, features: cg.SongFeatures, plan: cg.Plan, path: Path) -> None:
    """Tempo-densities of the music and of a clip, and the path of the subsequence DTW."""
    second = plan.seconds[WARPED_SECOND]
    take = repertoire.take_index(second.take)
    n_frames = len(repertoire.body_pos_m(take))
    first = round(second.clip_start_s * 20)
    clip = motion_density(n_frames, repertoire.motion_beats_s(take))[first : first + 160]
    music = music_density(features.n_seconds, features.beat_times_s)[second.second]
    source, _ = subsequence_dtw(music, clip)
    figure = Figure(figsize=(7.0, 4.4), dpi=110, layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row", width_ratios=(1, 3), height_ratios=(3, 1))
    axes[0, 0].plot(clip, np.arange(len(clip)) / 20, color="C1")
    axes[0, 0].set(ylabel=f"time in the clip of {second.take} (s)", xlabel="clip's tempo-density")
    axes[0, 1].plot(np.arange(len(music)) / 20, source / 20, color="k", label="path")
    axes[0, 1].legend()
    axes[1, 1].plot(np.arange(len(music)) / 20, music, color="C0")
    axes[1, 1].set(xlabel="time in the music (s)", ylabel="music's tempo-density")
    axes[1, 1].yaxis.set_tick_params(labelleft=True)
    axes[1, 0].set_axis_off()
    axes[0, 0].xaxis.set_tick_params(labelbottom=True)
    figure.savefig(path)


def draw_graph(recorder: Recorder, plan: cg.Plan, path: Path) -> None:
    """Candidates of some seconds by their distance of style, and the chosen path through several takes."""
    starts = range(len(plan.seconds) - GRAPH_S + 1)
    seconds = max(
        (plan.seconds[start : start + GRAPH_S] for start in starts), key=lambda s: len({at.take for at in s})
    )
    takes = list(dict.fromkeys(second.take for second in seconds))
    figure = Figure(figsize=(8.0, 4.2), dpi=110, layout="constrained")
    axis = figure.subplots()
    chosen = []
    for second in seconds:
        layer, away = recorder.candidates[second.second]
        nearest = np.argsort(away)[:CANDIDATES_SHOWN]
        colors = [
            f"C{takes.index(take)}" if take in takes else "0.8" for take in layer.take_names[nearest].tolist()
        ]
        axis.scatter(np.full(len(nearest), second.second), away[nearest], s=12, c=colors)
        node = (layer.warp.clip == second.clip) & (layer.warp.offset == second.offset)
        chosen.append(away[node][0])
    times = [second.second for second in seconds]
    axis.plot(times, chosen, "-", color="0.2", lw=1.2, zorder=0, label="chosen path")
    axis.scatter(
        times, chosen, s=70, c=[f"C{takes.index(at.take)}" for at in seconds], edgecolors="0.2", zorder=3
    )
    for number, take in enumerate(takes):
        axis.scatter([], [], s=12, color=f"C{number}", label=take)
    axis.scatter([], [], s=12, color="0.8", label="other takes")
    figure.legend(loc="outside right upper", frameon=False)
    axis.set(xlabel="second of the song", ylabel="distance of style", xticks=times)
    figure.savefig(path)


def draw_transition(repertoire: cg.Repertoire, plan: cg.Plan, path: Path) -> None:
    """The height of a wrist across the first join, cut and blended."""
    runs = plan_runs(plan)
    cut = [replace(run, transition_s=1e-3) for run in runs]  # one frame
    height_m = [
        body_pos_m(
            assemble(
                of,
                take_motions(repertoire),
                fps=plan.fps,
                duration_s=plan.duration_s,
                blending=plan.blending,
            )[0]
        )[:, WRIST, 1]
        for of in (cut, runs)
    ]
    steps = [abs(np.diff(height_m[0])[round(run.start_s * plan.fps) - 1]) for run in runs[1:]]
    join_s = runs[1 + int(np.argmax(steps))].start_s
    times_s = np.arange(len(height_m[0])) / plan.fps
    shown = np.abs(times_s - join_s) <= AROUND_JOIN_S
    figure = Figure(figsize=(7.0, 3.0), dpi=110, layout="constrained")
    axis = figure.subplots()
    axis.plot(times_s[shown], height_m[0][shown], "--", color="0.5", label="before blending")
    axis.plot(times_s[shown], height_m[1][shown], color="C0", label="after blending")
    axis.axvline(join_s, color="C3", lw=0.8, label="join")
    axis.legend()
    axis.set(xlabel="time (s)", ylabel="height of a wrist (m)")
    figure.savefig(path)


if __name__ == "__main__":
    draw_all(Path(__file__).with_name("_figures"))
