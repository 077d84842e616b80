"""The HTML pages of an evaluation: its report of tables and plots, and dances side by side."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

import numpy as np

from choreograph.core.arguments import check_kind
from choreograph.core.errors import ParameterError
from choreograph.core.files import atomic_path, check_target
from choreograph.core.progress import counted
from choreograph.evaluation import plots
from choreograph.evaluation.results import (
    Cell,
    Evaluation,
    Metric,
    Row,
    Table,
    column_title,
    number_text,
    song_table,
    tables,
)
from choreograph.motion.motion import Credits, Motion
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.music.song import Song
from choreograph.plan.plan import Plan, PlannedWord
from choreograph.settings import DanceConfig
from choreograph.view.page import write_page

_ARROWS = {"higher": "↑", "lower": "↓", "real": "≈"}
_ARROW_TITLES = {"higher": "higher is better", "lower": "lower is better", "real": "closer to real is better"}


def write_report(path: str | Path, evaluation: Evaluation) -> None:
    """Write the evaluation as one self-contained HTML file.

    Raises `ParameterError` if matplotlib is missing or the folder does not exist, `ChoreographError` if the
    file cannot be written.
    """
    plots.expect_matplotlib()
    check_target(path)
    text = _page(evaluation)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _page(evaluation: Evaluation) -> str:
    style = resources.files(__package__).joinpath("report.css").read_text(encoding="utf-8")
    title = f"Evaluation of {evaluation.facts['repertoire'] or 'a dance'}"
    body = [
        f"<h1>{_text(title)}</h1>", _facts(evaluation), _variants(evaluation),
        *(_table(table) for table in tables(evaluation)), _songs(evaluation), *_figures(evaluation),
        _notes(evaluation),
    ]  # fmt: skip
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{_text(title)}</title><style>{style}</style></head>\n<body><main>\n"
        + "\n".join(part for part in body if part)
        + "\n</main></body></html>\n"
    )


def _facts(evaluation: Evaluation) -> str:
    facts = evaluation.facts
    songs = facts["songs"]
    lines = [
        f"{counted(len(songs), 'song')}: {', '.join(songs)}",
        f"{counted(facts['seeds'], 'seed')}",
        f"Music beats by {facts['beats']}, and by {facts['second_beats']} for comparison",
        f"Word network of motifs and signatures: {facts['motifs_judged_by']}",
        f"Fréchet distances to {facts['frechet_against']}",
        f"choreograph {facts['choreograph']}",
    ]
    if facts["seen"]:
        lines.insert(0, "<strong>The repertoire may have been built from some of these songs.</strong>")
    return "<ul class=facts>" + "".join(f"<li>{_text(line)}</li>" if line[0] != "<" else f"<li>{line}</li>"
                                        for line in lines) + "</ul>"  # fmt: skip


def _variants(evaluation: Evaluation) -> str:
    items = (
        f"<dt>{_text(column_title(name))}</dt><dd>{_text(description)}</dd>"
        for name, description in evaluation.variants.items()
    )
    return f"<dl>{''.join(items)}</dl>"


def _table(table: Table) -> str:
    head = "".join(f"<th scope=col>{_text(column_title(name))}</th>" for name in table.columns)
    rows = "".join(_row(row) for row in table.rows)
    return (
        f'<section id="{table.family}"><h2>{_text(table.title)}</h2><p>{_text(table.caption)}</p>'
        f"<div class=scroll><table><thead><tr><th></th>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        "</section>"
    )


def _row(row: Row) -> str:
    metric = row.metric
    unit = f" <span class=unit>{_text(metric.unit)}</span>" if metric.unit else ""
    title = _text(f"{metric.source}. Limits: {metric.limits}")
    head = (
        f'<th scope=row title="{title}">{_text(metric.label)}{unit} '
        f'<span class=arrow title="{_ARROW_TITLES[metric.better]}">{_ARROWS[metric.better]}</span></th>'
    )
    return f"<tr>{head}{''.join(_cell(cell, metric) for cell in row.cells)}</tr>"


def _cell(cell: Cell | None, metric: Metric) -> str:
    if cell is None:
        return "<td>–</td>"
    spread = f" <span class=spread>± {number_text(cell.spread, metric.digits)}</span>" if cell.n > 1 else ""
    chance = "" if cell.chance is None else f"<small>chance {number_text(cell.chance, metric.digits)}</small>"
    return f'<td title="{cell.n} dances"><b>{number_text(cell.mean, metric.digits)}</b>{spread}{chance}</td>'


def _songs(evaluation: Evaluation) -> str:
    rows = song_table(evaluation, "f_score")
    if len(rows) < 2:
        return ""
    variants = [name for name in evaluation.variants if any(name in row for row in rows.values())]
    head = "".join(f"<th scope=col>{_text(column_title(name))}</th>" for name in variants)
    lines = "".join(
        f"<tr><th scope=row>{_text(song)}</th>"
        + "".join(f"<td>{row[name]:.2f}</td>" if name in row else "<td>–</td>" for name in variants)
        + "</tr>"
        for song, row in rows.items()
    )
    figure = plots.song_figure(evaluation)
    return (
        "<section id=songs><h2>F-score by song</h2><p>Mean over seeds.</p><div class=scroll>"
        f"<table><thead><tr><th></th>{head}</tr></thead><tbody>{lines}</tbody></table></div>"
        + (f"<div class=scroll>{plots.to_svg(figure)}</div>" if figure else "")
        + "</section>"
    )


def _figures(evaluation: Evaluation) -> list[str]:
    example = evaluation.example
    if example is None:
        return []
    song = f"{example.song}, first seed"
    strips = "".join(
        f'<h3>{_text(column_title(name))}</h3><img alt="poses of {_text(name)}" '
        f'src="data:image/png;base64,{base64.b64encode(png).decode()}">'
        for name, png in plots.strips(example).items()
    )
    parts = [
        ("speed", "Speed and beats", f"{song}. Orange lines are music beats. Red dots are motion beats, "
         "where the body slows down.", plots.speed_figure(example)),
        ("costs", "Costs", f"{song}: weighted costs of every second.", plots.cost_figure(example)),
        ("slopes", "Playback speed of the takes", "All songs and seeds.", plots.slope_figure(evaluation)),
        ("signatures", "Motif signatures", f"{song}: the most frequent motifs of the genre.",
         plots.signature_figure(example)),
        ("convergence", "Convergence of the signatures", song, plots.convergence_figure(example)),
    ]  # fmt: skip
    sections = [
        f'<section id="{name}"><h2>{title}</h2><p>{_text(caption)}</p>'
        f"<div class=scroll>{plots.to_svg(figure)}</div></section>"
        for name, title, caption, figure in parts
        if figure is not None
    ]
    poses = f"<section id=poses><h2>Poses on beats</h2><p>{_text(song)}</p>{strips}</section>"
    return [*sections, poses]


def _notes(evaluation: Evaluation) -> str:
    if not evaluation.notes:
        return ""
    items = "".join(f"<li>{_text(note)}</li>" for note in evaluation.notes)
    return f"<section id=notes><h2>Notes</h2><ul>{items}</ul></section>"


def _text(text: str) -> str:
    return html.escape(str(text), quote=True)


# A page that shows dances of any systems side by side, with their song.


_APART_M = 1.8
_FPS = 30.0
_MOST = 8


def write_side_by_side(
    path: str | Path, motions: Mapping[str, Motion], song: Song, *, beats_s: np.ndarray
) -> None:
    """Write a page with the dances from left to right, as the audience sees them.

    All start with the song and are cut to the shortest one. Each is moved so that its mean position is in its
    place, and retargeted to one body. `beats_s` (Q,) are those of the song.

    Raises `ParameterError` for more than 8 dances, or a joint of unknown name, and as `view.page.write_page`.
    """
    if not 1 <= len(motions) <= _MOST:
        raise ParameterError(f"expected 1 to {_MOST} dances side by side, got {len(motions)}")
    for name, motion in motions.items():
        check_kind(f"the dance {name}", motion, Motion)
    body = canonical_skeleton()
    shown = [
        (motion if motion.skeleton.same_as(body) else retarget(motion, body)).resampled(_FPS)
        for motion in motions.values()
    ]
    n_frames = min(*(one.n_frames for one in shown), max(1, round(song.duration_s * _FPS)))
    placed = [
        _placed(one.sliced(0, n_frames), _APART_M * (place - (len(shown) - 1) / 2))
        for place, one in enumerate(shown)
    ]
    names = ", ".join(motions)
    several = len(motions) > 1
    plan = _page_plan(song, n_frames / _FPS, beats_s, "all dances" if several else names)
    write_page(
        path, placed[0], plan, song_path=song.path, motion_beats_s=(), start_s=song.start_s,
        title=f"From left: {names}" if several else names, others=placed[1:],
    )  # fmt: skip


def _placed(motion: Motion, x_m: float) -> Motion:
    mean_m = motion.root_pos_m.mean(axis=0)
    return motion.moved(shift_m=np.array([x_m - mean_m[0], 0.0, -mean_m[2]]))


def _page_plan(song: Song, duration_s: float, beats_s: np.ndarray, name: str) -> Plan:
    """What the timeline of the page shows: the beats, and one block."""
    defaults = DanceConfig()
    whole = PlannedWord(0.0, duration_s, 0, "", 0.0, duration_s, Credits(), kept=name)
    return Plan(
        song=song.name, duration_s=duration_s, start_s=song.start_s, repertoire="", planner=defaults.planner,
        blending=defaults.blending, seed=0, fps=_FPS, weights={},
        music_beats_s=tuple(float(beat) for beat in beats_s if beat < duration_s), seconds=(), engine="mixer",
        words=(whole,),
    )  # fmt: skip
