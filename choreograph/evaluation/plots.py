"""Plots of an evaluation as SVG and PNG. Needs the extra `plots` (matplotlib)."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path
from choreograph.core.numerics import Floats, chi_square_distance
from choreograph.core.timebase import STORE_FPS, frame_times_s
from choreograph.evaluation.coverage import GOOD, SPEEDS, Coverage
from choreograph.evaluation.metrics.front import usual_front_rad
from choreograph.evaluation.plan_scores import time_maps
from choreograph.evaluation.results import (
    EXPERT,
    METRICS,
    REAL,
    Evaluation,
    ExampleDance,
    ExampleSong,
    column_title,
    dances_of,
    song_table,
)
from choreograph.formats.writer import GENERATOR
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.motion.motion_beats import mean_joint_speed_m_s, motion_beat_times_s

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_SPEED_PLOT_S = 12.0
_WIDTH_IN = 7.2
_INK, _MUSIC, _MOTION = "#33405c", "#d08a2e", "#c1272d"
_COLOURS = ("#33405c", "#c1272d", "#2e8b6f", "#d08a2e", "#7a55a8", "#4a90c2", "#8a6d3b", "#9aa3b2")
_MAX_MOTIFS = 20
_STRIP_POSES, _STRIP_TILE = 8, (150, 200)


def expect_matplotlib() -> None:
    """Raise `ParameterError` if matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise ParameterError(
            "expected matplotlib to plot a report, got none: install the extra 'plots', or use --json"
        ) from error


def speed_figure(example: ExampleSong) -> Figure:
    """Mean joint speed over the first seconds with music and motion beats, one panel per dance.

    ChoreoGraph, Figure 2.
    """
    figure, panels = _panels(len(example.dances), 1.35)
    for axis, dance in zip(panels, example.dances, strict=True):
        motion = _first_seconds(dance.motion, _SPEED_PLOT_S)
        pos_m = body_pos_m(motion)
        speed = mean_joint_speed_m_s(pos_m, STORE_FPS)
        times_s = frame_times_s(len(speed), STORE_FPS)
        beats_s = motion_beat_times_s(pos_m, STORE_FPS)
        music_s = example.music_beats_s[example.music_beats_s <= motion.duration_s]
        axis.vlines(music_s, 0, 1, transform=axis.get_xaxis_transform(), color=_MUSIC, linewidth=1.1)
        axis.plot(times_s, speed, color=_INK, linewidth=1.2)
        axis.plot(beats_s, np.interp(beats_s, times_s, speed), "o", color=_MOTION, markersize=4)
        _titled(axis, column_title(dance.variant))
        axis.set(ylim=(0, None), xlim=(0, motion.duration_s))
    panels[-1].set_xlabel("seconds")
    panels[len(panels) // 2].set_ylabel("mean joint speed, m/s")
    return figure


def cost_figure(example: ExampleSong) -> Figure | None:
    """Stacked weighted costs of every second, one panel per plan. None if no plan has costs."""
    plans = [(d.variant, d.plan) for d in example.dances if d.plan and any(s.costs for s in d.plan.seconds)]
    if not plans:
        return None
    names = list(dict.fromkeys(name for _, plan in plans for s in plan.seconds for name in s.costs))
    names = [n for n in names if any(s.costs.get(n) for _, plan in plans for s in plan.seconds)]
    figure, panels = _panels(len(plans), 1.6, sharey=False)
    for axis, (variant, plan) in zip(panels, plans, strict=True):
        below = np.zeros(len(plan.seconds))
        for index, name in enumerate(names):
            value = np.array([max(second.costs.get(name, 0.0), 0.0) for second in plan.seconds])
            axis.bar(
                np.arange(len(value)) + 0.5, value, 1.0, bottom=below, label=name,
                color=_COLOURS[index % len(_COLOURS)],
            )  # fmt: skip
            below += value
        _titled(axis, variant)
        axis.set_xlim(0, len(plan.seconds))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    panels[-1].set_xlabel("second of the dance")
    panels[len(panels) // 2].set_ylabel("weighted cost")
    return figure


def slope_figure(evaluation: Evaluation) -> Figure | None:
    """Histogram of playback speeds over all planned seconds of all dances. None without planned seconds."""
    slopes = {}
    for name in evaluation.variants:
        plans = [d.plan for d in dances_of(evaluation.dances, name) if d.plan and d.plan.seconds]
        if plans:
            slopes[name] = np.concatenate([np.diff(time_maps(plan), axis=1).ravel() for plan in plans])
    if not slopes:
        return None
    figure, panels = _panels(len(slopes), 1.25, sharey=False)  # unwarped clips are a single bar of 100 %
    for axis, (name, values) in zip(panels, slopes.items(), strict=True):
        share, edges = np.histogram(values, bins=np.linspace(0.45, 2.05, 65))
        axis.stairs(100.0 * share / len(values), edges, fill=True, color=_INK)
        _titled(axis, name)
        axis.axvline(1.0, color=_MUSIC, linewidth=1.0)
        axis.set_xlim(edges[0], edges[-1])
    panels[-1].set_xlabel("playback speed, 1 as recorded")
    panels[len(panels) // 2].set_ylabel("% of frames")
    return figure


def song_figure(evaluation: Evaluation, metric: str = "f_score") -> Figure | None:
    """A metric by song, one mark per variant. None for a single song."""
    rows = song_table(evaluation, metric)
    if len(rows) < 2:
        return None
    figure = _figure(_WIDTH_IN, 1.1 + 0.4 * len(rows))
    axis = figure.subplots()
    variants = [name for name in evaluation.variants if any(name in row for row in rows.values())]
    for index, variant in enumerate(variants):
        offset = 0.5 * (index / max(len(variants) - 1, 1) - 0.5)  # so that marks do not hide each other
        points = [(row[variant], y + offset) for y, row in enumerate(rows.values()) if variant in row]
        axis.plot(
            *zip(*points, strict=True), "D" if variant == REAL else "o", label=column_title(variant),
            color=_COLOURS[index % len(_COLOURS)], markersize=6,
        )  # fmt: skip
    axis.set_yticks(range(len(rows)), list(rows))
    axis.set(ylim=(len(rows) - 0.5, -0.5), xlim=(0, None))
    axis.grid(axis="y", alpha=0.3)
    axis.set_xlabel(METRICS[metric].label)
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


def signature_figure(example: ExampleSong) -> Figure | None:
    """Shares of the genre's most frequent motifs, one panel per dance. None without a vocabulary."""
    dances = [d for d in example.dances if d.motifs is not None and len(d.motifs)]
    if example.template is None or not dances:
        return None
    order = np.argsort(-example.template, kind="stable")[:_MAX_MOTIFS]
    figure, panels = _panels(1 + len(dances), 1.2)
    shares = [("the genre's template", example.template)]
    shares += [(column_title(d.variant), _shares(d, len(example.template))) for d in dances]
    for index, (axis, (name, share)) in enumerate(zip(panels, shares, strict=True)):
        axis.bar(range(len(order)), 100 * share[order], color=_MUSIC if index == 0 else _INK, width=0.8)
        distance = float(chi_square_distance(share, example.template))
        _titled(axis, name if index == 0 else f"{name}: χ² {distance:.2f}")
    panels[-1].set_xticks(range(len(order)), [str(motif) for motif in order])
    panels[-1].set_xlabel("motif")
    panels[len(panels) // 2].set_ylabel("% of words")
    return figure


def convergence_figure(example: ExampleSong) -> Figure | None:
    """χ² distance of each dance so far to its genre's template (Rhythm is a Dancer, Figure 12)."""
    dances = [d for d in example.dances if d.motifs is not None and len(d.motifs)]
    if example.template is None or not dances:
        return None
    figure = _figure(_WIDTH_IN, 2.8)
    axis = figure.subplots()
    for index, dance in enumerate(dances):
        assert dance.motifs is not None
        counts = np.cumsum(np.eye(len(example.template))[dance.motifs.motifs], axis=0)  # (N, K)
        so_far = counts / np.arange(1, len(counts) + 1)[:, None]
        axis.plot(
            dance.motifs.end_s, chi_square_distance(so_far, example.template),
            label=column_title(dance.variant), color=_COLOURS[index % len(_COLOURS)], linewidth=1.4,
        )  # fmt: skip
    axis.set(ylim=(0, 1), xlabel="seconds danced", ylabel="χ² to the template")
    axis.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


def strips(example: ExampleSong) -> Mapping[str, bytes]:
    """PNG of the poses on the first beats of the song, by variant."""
    from choreograph.view.strip import draw_strip

    pictures = {}
    for dance in example.dances:
        beats_s = example.music_beats_s[example.music_beats_s <= dance.motion.duration_s]
        if len(beats_s) < _STRIP_POSES:
            beats_s = np.linspace(0.0, dance.motion.duration_s * 0.95, _STRIP_POSES)
        front_rad = 0.0
        if dance.variant in (EXPERT, REAL):  # recorded dances, whose front is not known
            front_rad = usual_front_rad(body_pos_m(dance.motion), dance.motion.fps)
        sheet = draw_strip(
            dance.motion,
            beats_s[:_STRIP_POSES].tolist(),
            columns=_STRIP_POSES // 2,
            tile=_STRIP_TILE,
            front_rad=front_rad,
        )
        pictures[dance.variant] = _png(sheet)
    return pictures


def to_svg(figure: Figure) -> str:
    """The figure as an <svg> element with its text as text."""
    import matplotlib

    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "choreograph"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _png(sheet: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(sheet).quantize(128).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def coverage_figure(found: Coverage) -> Figure:
    """Tempi of songs over those of takes, a row for each genre and metre.

    A take is a dot at its tempo, with a line over the tempi at which it may be danced. Seconds of songs are
    columns above, in another colour where they are poor (`evaluation.coverage`).
    """
    motion = found.motion
    of_songs = {(genre, song.metre) for song in found.songs for genre in song.genres}
    of_takes = {(str(g), int(m)) for g, m in zip(motion.genre, motion.metre, strict=True) if m}
    rows = sorted(of_songs | of_takes)
    figure = _figure(_WIDTH_IN, 0.9 + 0.5 * len(rows))
    axes = figure.subplots()
    most_s = max(song.duration_s for song in found.songs)
    for row, (genre, metre) in enumerate(rows):
        bpm = motion.bpm[(motion.genre == genre) & (motion.metre == metre)]
        axes.hlines(np.full(len(bpm), row - 0.15), SPEEDS[0] * bpm, SPEEDS[1] * bpm, _MUSIC, alpha=0.15, lw=4)
        axes.plot(bpm, np.full(len(bpm), row - 0.15), ".", color=_MUSIC)
        for is_poor, colour in ((False, _INK), (True, _MOTION)):
            tempi = [
                tempo
                for song in found.songs
                for tempo, reason, danced in zip(song.tempo_bpm, song.reasons, song.genres, strict=True)
                if (danced, song.metre) == (genre, metre)
                and (reason != GOOD) == is_poor
                and np.isfinite(tempo)
            ]
            values, seconds = np.unique(np.round(tempi), return_counts=True)
            heights = 0.6 * np.sqrt(seconds / most_s)
            axes.vlines(values + 0.5 * is_poor, row, row + heights.clip(max=0.8), colour, lw=2)
    axes.set_yticks(
        range(len(rows)), [f"{genre or '-'} in {metre}" if metre else genre for genre, metre in rows]
    )
    axes.plot([], [], ".", color=_MUSIC, label="takes, and the tempi they may be danced at")
    axes.vlines([], [], [], _INK, label="seconds of the songs")
    axes.vlines([], [], [], _MOTION, label="poor seconds")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False, fontsize="small")
    axes.set_xlabel("counts a minute")
    axes.set_ylim(-0.5, len(rows))
    return figure


def write_coverage_figure(path: Path, found: Coverage) -> None:
    """Write `coverage_figure` as PNG. Raises `ParameterError` if matplotlib is missing."""
    expect_matplotlib()
    with atomic_path(path) as temporary:
        coverage_figure(found).savefig(temporary, format="png", dpi=150, metadata={"Software": GENERATOR})


def _first_seconds(motion: Motion, seconds: float) -> Motion:
    motion = motion.resampled(STORE_FPS)
    return motion.sliced(0, round(seconds * STORE_FPS))


def _shares(dance: ExampleDance, n_motifs: int) -> Floats:
    assert dance.motifs is not None
    return np.bincount(dance.motifs.motifs, minlength=n_motifs) / len(dance.motifs)


def _panels(n: int, height_in: float, *, sharey: bool = True) -> tuple[Figure, list[Axes]]:
    figure = _figure(_WIDTH_IN, 0.6 + height_in * n)
    return figure, list(figure.subplots(n, 1, sharex=True, sharey=sharey, squeeze=False)[:, 0])


def _titled(axis: Axes, title: str) -> None:
    axis.set_title(title, loc="left", fontsize=10)
    axis.spines[["top", "right"]].set_visible(False)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
