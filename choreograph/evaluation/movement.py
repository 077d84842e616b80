"""How a repertoire moves, beside the ranges of real dancing.

Every measure describes one window of a take by one number (`MEASURES`). A genre of a
repertoire is described by the median of its windows, and it is inside the real range if that lies between the
5th and the 95th percentile of the windows of real takes. The ranges are in `movement_ranges.json`, which
`research/movement_ranges.py` makes. They are numbers that say nothing of single takes.

Body positions (T, 21, 3) are in metres at 20 fps. Angles are in degrees. A count lasts `count_s`. Measures
"in 8 counts" are medians over all spans of that length.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from choreograph.core.arguments import check_kind
from choreograph.core.counts import Counts
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.timebase import NET_FPS
from choreograph.library.repertoire import Repertoire
from choreograph.motion.body import (
    BODY_JOINTS,
    checked_body_pos_m,
    ground_pos_m,
    heading_rad,
    mirrored,
    to_root_frame,
)
from choreograph.motion.contacts import foot_contacts
from choreograph.music.bars import tempo_bpm
from choreograph.music.count_grids import FEWEST_COUNTS

WINDOW_S = 20.0
HOP_S = 10.0
USUAL_COUNT_S = 0.5  # where a take has no counts
_SAME_LEGS_M = 0.03  # mean distance of the joints of the legs in the bars of one figure
_HELD_M_S = 0.1
_LONGEST_LAG_S = 0.5
LEG_JOINTS = [
    BODY_JOINTS.index(f"{s}_{j}") for s in ("left", "right") for j in ("hip", "knee", "ankle", "foot")
]


@dataclass(frozen=True, eq=False)
class Window:
    """A part of a take, with what several measures need."""

    body_pos_m: NDArray[np.float64]  # (T, 21, 3)
    count_s: float = USUAL_COUNT_S
    bars: tuple[tuple[int, int], ...] = ()  # first frame of each whole bar and the one after its last

    def joint(self, name: str) -> Floats:
        """Positions of a joint, (T, 3)."""
        positions: Floats = self.body_pos_m[:, BODY_JOINTS.index(name)]
        return positions

    def sides(self, name: str) -> Floats:
        """Positions of a joint of both sides, (2, T, 3), the left one first."""
        return np.stack([self.joint(f"left_{name}"), self.joint(f"right_{name}")])

    @cached_property
    def facing(self) -> Floats:
        """Positions in the frame of the dancer's heading and place on the floor, (T, 21, 3)."""
        return to_root_frame(self.body_pos_m)

    def facing_joint(self, name: str) -> Floats:
        """`joint` in the frame of the dancer, (T, 3): X to the left, Z to the front."""
        positions: Floats = self.facing[:, BODY_JOINTS.index(name)]
        return positions

    @cached_property
    def wrists_m(self) -> Floats:
        """The wrists in the frame of the dancer from the shoulder of their side, (2, T, 3)."""
        sides = ("left", "right")
        return np.stack([self.facing_joint(f"{s}_wrist") - self.facing_joint(f"{s}_shoulder") for s in sides])

    @cached_property
    def wrist_speed_m_s(self) -> Floats:
        """Speed of the wrists relative to their shoulders, (2, T - 1)."""
        steps: Floats = np.linalg.norm(np.diff(self.wrists_m, axis=1), axis=-1)
        return steps * NET_FPS

    @cached_property
    def speed_m_s(self) -> Floats:
        """Mean speed of all joints, (T - 1,)."""
        steps: Floats = np.linalg.norm(np.diff(self.body_pos_m, axis=0), axis=-1).mean(axis=1)
        return steps * NET_FPS

    @cached_property
    def headings_deg(self) -> Floats:
        """The heading, continuous in time, (T,)."""
        return np.degrees(np.unwrap(heading_rad(self.body_pos_m)))

    @cached_property
    def ground_m(self) -> Floats:
        """The place on the floor without the sway of single steps, (T, 3)."""
        smooth: Floats = gaussian_filter1d(ground_pos_m(self.body_pos_m), 0.25 * NET_FPS, axis=0)
        return smooth

    @cached_property
    def contacts(self) -> NDArray[np.bool_]:
        """Whether each foot stands, (T, 2)."""
        confidence = foot_contacts(self.body_pos_m, NET_FPS)  # heel and ball of each foot
        stands: NDArray[np.bool_] = np.maximum(confidence[:, ::2], confidence[:, 1::2]) > 0.5
        return stands

    @cached_property
    def steps_m(self) -> Floats:
        """The length of each step: how far a foot is moved between two stands, (S,)."""
        lengths = []
        for side, foot_m in enumerate(self.sides("foot")):
            lands = np.flatnonzero(np.diff(self.contacts[:, side].astype(np.int8)) == 1) + 1
            places = foot_m[lands][:, [0, 2]]
            lengths += list(np.linalg.norm(np.diff(places, axis=0), axis=-1))
        return np.array([length for length in lengths if length > _HELD_M_S / 2])

    def in_8_counts(self, of_span: Callable[[slice], float]) -> float:
        """The median of a value over spans of 8 counts that begin every count."""
        step, length = self.count_s * NET_FPS, round(8 * self.count_s * NET_FPS)
        starts = np.arange(0, max(1, len(self.body_pos_m) - length), step).astype(int)
        return float(np.median([of_span(slice(start, start + length)) for start in starts]))


# Angles.


def _degrees_from(vector: Floats, axis: int) -> Floats:
    """The lean of vectors (T, 3) from the vertical towards an axis, (T,)."""
    lean: Floats = np.degrees(np.arctan2(vector[:, axis], vector[:, 1]))
    return lean


def _bend_deg(window: Window, upper: str, middle: str, lower: str) -> Floats:
    """The inner angle of both middle joints, (2, T): 180 is straight."""
    at = window.sides(middle)
    one, other = window.sides(upper) - at, window.sides(lower) - at
    cosine = np.sum(one * other, axis=-1) / np.maximum(
        np.linalg.norm(one, axis=-1) * np.linalg.norm(other, axis=-1), 1e-9
    )
    bend: Floats = np.degrees(np.arccos(cosine.clip(-1.0, 1.0)))
    return bend


def _knees_deg(window: Window) -> Floats:
    return _bend_deg(window, "hip", "knee", "ankle")


def _elbows_deg(window: Window) -> Floats:
    return _bend_deg(window, "shoulder", "elbow", "wrist")


def _tilt_deg(window: Window, part: str) -> Floats:
    """How far the left side of the hips or shoulders is above the right one, (T,)."""
    across = window.joint(f"left_{part}") - window.joint(f"right_{part}")
    tilt: Floats = np.degrees(np.arctan2(across[:, 1], np.linalg.norm(across[:, [0, 2]], axis=1)))
    return tilt


def _yaw_deg(window: Window, part: str) -> Floats:
    """The direction of the hips or shoulders, continuous in time, (T,)."""
    across = window.joint(f"left_{part}") - window.joint(f"right_{part}")
    return np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))


def _trunk(window: Window) -> Floats:
    return window.facing_joint("neck") - window.facing_joint("pelvis")


def _head(window: Window) -> Floats:
    return window.facing_joint("head") - window.facing_joint("neck")


def from_mean(values: Floats) -> Floats:
    """Values without slow changes over two seconds, so that turns do not count."""
    slow: Floats = uniform_filter1d(values, 2 * NET_FPS, mode="nearest")
    return values - slow


def _ratio(values: Floats) -> float:
    """The 95th percentile by the median."""
    return float(np.percentile(values, 95) / max(float(np.median(values)), 1e-3))


def correlation(one: Floats, other: Floats) -> float:
    """The correlation of values (T,) with others, or 0 where one of the two is constant."""
    if min(one.std(), other.std()) < 1e-6:
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])


# The measures that are not one line.


def _leg_copies(window: Window) -> float:
    """Share of bars whose legs are those of another bar, or its mirror image. nan below two bars."""
    if len(window.bars) < 2:
        return float("nan")
    length = round(4 * USUAL_COUNT_S * NET_FPS)
    poses = []
    for first, stop in window.bars:
        frames = np.linspace(first, stop - 1, length)
        low = frames.astype(int)
        weight = (frames - low)[:, None, None]
        at = window.facing[low] * (1 - weight) + window.facing[np.minimum(low + 1, stop - 1)] * weight
        poses.append(at)
    legs = [pose[:, LEG_JOINTS] for pose in poses]
    other = [mirrored(pose)[:, LEG_JOINTS] for pose in poses]

    def is_copied(index: int) -> bool:
        return any(
            np.linalg.norm(legs[index] - as_danced[i], axis=-1).mean() < _SAME_LEGS_M
            for as_danced in (legs, other)
            for i in range(len(legs))
            if i != index
        )

    return float(np.mean([is_copied(index) for index in range(len(legs))]))


def _travel_m(window: Window) -> float:
    steps = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(window.ground_m, axis=0), axis=1)))
    return window.in_8_counts(lambda span: float(np.ptp(steps[span])))


def _displacement_m(window: Window) -> float:
    return window.in_8_counts(
        lambda span: float(np.linalg.norm(window.ground_m[span][-1] - window.ground_m[span][0]))
    )


def _turning_deg(window: Window) -> float:
    path = np.append(0.0, np.cumsum(np.abs(np.diff(gaussian_filter1d(window.headings_deg, 0.1 * NET_FPS)))))
    return window.in_8_counts(lambda span: float(np.ptp(path[span])))


def _rise_m(window: Window) -> float:
    height = window.joint("pelvis")[:, 1]
    return window.in_8_counts(lambda span: float(np.subtract(*np.percentile(height[span], [95, 5]))))


def _step_spread(window: Window) -> float:
    steps = window.steps_m
    return float(steps.std() / steps.mean()) if len(steps) > 2 else 0.0


def _foot_lift_m(window: Window) -> float:
    heights = window.sides("foot")[..., 1]
    standing = np.percentile(heights, 10, axis=1, keepdims=True)
    return float(np.percentile(heights - standing, 95))


def _stance_m(window: Window) -> Floats:
    left, right = window.sides("foot")
    apart: Floats = np.linalg.norm((left - right)[:, [0, 2]], axis=1)
    return apart


def _weight_shift(window: Window) -> float:
    """How far the pelvis is from the middle of the feet to one of them, median: 0 middle, 1 over a foot."""
    left, right = (foot[:, [0, 2]] for foot in window.sides("ankle"))
    axis = left - right
    length = np.maximum(np.sum(axis**2, axis=1), 1e-4)
    along = np.sum((window.joint("pelvis")[:, [0, 2]] - (left + right) / 2) * axis, axis=1) / length
    wide = length > 0.15**2
    return float(np.median(np.abs(2 * along[wide]).clip(max=2.0))) if wide.any() else 0.0


def _chest_lag_s(window: Window) -> float:
    """By how much the yaw of the chest follows that of the hips, where they agree best."""
    hips, chest = (np.gradient(from_mean(_yaw_deg(window, part))) for part in ("hip", "shoulder"))
    most = round(_LONGEST_LAG_S * NET_FPS)
    lags = range(-most, most + 1)
    inner = slice(most, len(hips) - most)
    best = max(lags, key=lambda lag: correlation(hips[inner], np.roll(chest, -lag)[inner]))
    return best / NET_FPS


def _twist_deg(window: Window) -> float:
    return float((_yaw_deg(window, "shoulder") - _yaw_deg(window, "hip")).std())


def _tilt_correlation(window: Window) -> float:
    return correlation(_tilt_deg(window, "hip"), _tilt_deg(window, "shoulder"))


def _wrist_to_side_m(window: Window) -> float:
    return float(np.median(window.wrists_m[..., 0] * np.array([[1.0], [-1.0]])))


def _variety_m(window: Window) -> float:
    return float(np.linalg.norm(window.facing - window.facing.mean(axis=0), axis=-1).mean())


def _arm_symmetry(window: Window) -> float:
    left, right = window.wrists_m[0], window.wrists_m[1] * np.array([-1.0, 1.0, 1.0])
    return float(np.mean([correlation(left[:, axis], right[:, axis]) for axis in range(3)]))


def _pose_dimensions(window: Window) -> float:
    """Principal components that hold nine tenths of the variance of the poses."""
    poses = window.facing.reshape(len(window.facing), -1)
    values = np.linalg.svd(poses - poses.mean(axis=0), compute_uv=False) ** 2
    return float(np.searchsorted(np.cumsum(values) / max(values.sum(), 1e-12), 0.9) + 1)


def _repetition(window: Window) -> float:
    """The highest correlation of the poses with those of 1 to 6 s later."""
    poses = window.facing.reshape(len(window.facing), -1)
    poses = poses - poses.mean(axis=0)
    power = np.sum(poses**2, axis=1)
    lags = range(NET_FPS, min(6 * NET_FPS, len(poses) // 2), 2)
    alike = [
        np.sum(poses[lag:] * poses[:-lag]) / np.sqrt(power[lag:].sum() * power[:-lag].sum() + 1e-12)
        for lag in lags
    ]
    return float(max(alike, default=0.0))


def _jerk_m_s3(window: Window) -> float:
    jerk = np.linalg.norm(np.diff(window.body_pos_m, 3, axis=0), axis=-1) * NET_FPS**3
    return float(np.percentile(jerk, 95))


# All measures: name, unit, and function. A function takes a `Window` and returns one number.


MEASURES: dict[str, tuple[str, Callable[[Window], float]]] = {
    "legs of a bar danced again": ("share", _leg_copies),
    "travel in 8 counts": ("m", _travel_m),
    "displacement in 8 counts": ("m", _displacement_m),
    "turning in 8 counts": ("°", _turning_deg),
    "knee angle, median": ("°", lambda w: float(np.median(_knees_deg(w)))),
    "knee angle, 5th percentile": ("°", lambda w: float(np.percentile(_knees_deg(w), 5))),
    "knee angle, 95th percentile": ("°", lambda w: float(np.percentile(_knees_deg(w), 95))),
    "knee angle, sd": ("°", lambda w: float(_knees_deg(w).std(axis=1).mean())),
    "steps": ("/s", lambda w: len(w.steps_m) / (len(w.body_pos_m) / NET_FPS)),
    "step length, median": ("m", lambda w: float(np.median(w.steps_m)) if len(w.steps_m) else 0.0),
    "step length, spread": ("ratio", _step_spread),
    "foot lift, 95th percentile": ("m", _foot_lift_m),
    "distance of the feet, median": ("m", lambda w: float(np.median(_stance_m(w)))),
    "distance of the feet, 95th percentile": ("m", lambda w: float(np.percentile(_stance_m(w), 95))),
    "both feet stand": ("share", lambda w: float(w.contacts.all(axis=1).mean())),
    "weight over a foot": ("ratio", _weight_shift),
    "rise and fall in 8 counts": ("m", _rise_m),
    "hip tilt, sd": ("°", lambda w: float(_tilt_deg(w, "hip").std())),
    "hip yaw, sd": ("°", lambda w: float(from_mean(_yaw_deg(w, "hip")).std())),
    "trunk pitch, sd": ("°", lambda w: float(_degrees_from(_trunk(w), 2).std())),
    "trunk pitch, mean": ("°", lambda w: float(_degrees_from(_trunk(w), 2).mean())),
    "trunk roll, sd": ("°", lambda w: float(_degrees_from(_trunk(w), 0).std())),
    "twist of the trunk, sd": ("°", _twist_deg),
    "shoulder tilt, sd": ("°", lambda w: float(_tilt_deg(w, "shoulder").std())),
    "tilt of shoulders with hips": ("r", _tilt_correlation),
    "chest after hips": ("s", _chest_lag_s),
    "head pitch, sd": ("°", lambda w: float(_degrees_from(_head(w), 2).std())),
    "head roll, sd": ("°", lambda w: float(_degrees_from(_head(w), 0).std())),
    "head with trunk": ("r", lambda w: correlation(_degrees_from(_head(w), 0), _degrees_from(_trunk(w), 0))),
    "arm speed, median": ("m/s", lambda w: float(np.median(w.wrist_speed_m_s))),
    "arm speed, 95th percentile over median": ("ratio", lambda w: _ratio(w.wrist_speed_m_s)),
    "arms held": ("share", lambda w: float((w.wrist_speed_m_s < _HELD_M_S).mean())),
    "wrist height over shoulder, median": ("m", lambda w: float(np.median(w.wrists_m[..., 1]))),
    "wrist height, sd": ("m", lambda w: float(w.wrists_m[..., 1].std(axis=1).mean())),
    "wrist to the side, median": ("m", _wrist_to_side_m),
    "elbow angle, median": ("°", lambda w: float(np.median(_elbows_deg(w)))),
    "elbow angle, sd": ("°", lambda w: float(_elbows_deg(w).std(axis=1).mean())),
    "arms alike": ("r", _arm_symmetry),
    "speed, median": ("m/s", lambda w: float(np.median(w.speed_m_s))),
    "speed, 95th percentile over median": ("ratio", lambda w: _ratio(w.speed_m_s)),
    "jerk, 95th percentile": ("m/s³", _jerk_m_s3),
    "variety of poses": ("m", _variety_m),
    "dimensions of poses": ("", _pose_dimensions),
    "poses repeated": ("r", _repetition),
}  # fmt: skip


# The windows of takes.


def windows_of(body_pos_m: NDArray[np.floating], counts: Counts | None = None) -> list[Window]:
    """The windows of a take at 20 fps, (T, 21, 3). A shorter take is one window, if it lasts half of one."""
    pos = checked_body_pos_m(body_pos_m, NET_FPS)
    length, hop = round(WINDOW_S * NET_FPS), round(HOP_S * NET_FPS)
    if len(pos) < length // 2:
        return []
    known = counts is not None and len(counts) >= FEWEST_COUNTS
    count_s = 60.0 / tempo_bpm(counts) if known and counts is not None else USUAL_COUNT_S
    downbeats = np.zeros(0) if counts is None else counts.downbeat_times_s * NET_FPS
    found = []
    for start in range(0, max(1, len(pos) - length + 1), hop):
        part = pos[start : start + length]
        inside = np.rint(downbeats[(downbeats >= start) & (downbeats <= start + len(part))] - start).astype(
            int
        )
        bars = tuple((a, b) for a, b in pairwise(inside.tolist()) if b - a > 1)
        found.append(Window(part, count_s, bars))
    return found


def measured(window: Window) -> dict[str, float]:
    """All measures of a window by name. A measure that it cannot have is nan."""
    return {name: measure(window) for name, (_, measure) in MEASURES.items()}


# How the genres of a repertoire move, beside the ranges of real dancing.


@dataclass(frozen=True)
class Range:
    """The values of a measure in real dancing: percentiles of windows."""

    low: float
    """5th percentile."""

    median: float
    """Median."""

    high: float
    """95th percentile."""

    def holds(self, value: float) -> bool:
        """Whether a value is inside the range."""
        return self.low <= value <= self.high


ALL_REAL = "all"  # genres of the real takes together


def real_ranges() -> dict[str, dict[str, Range]]:
    """The ranges of real dancing by genre and measure. `ALL_REAL` are all genres."""
    text = files("choreograph.evaluation").joinpath("movement_ranges.json").read_text(encoding="utf-8")
    return {
        genre: {name: Range(*values) for name, values in of_genre.items()}
        for genre, of_genre in json.loads(text)["ranges"].items()
    }


@dataclass(frozen=True)
class Cell:
    """A measure of a genre beside the real range."""

    genre: str
    """Name of the genre."""

    measure: str
    """Name of the measure."""

    unit: str
    """Unit of the values."""

    value: float
    """Median of the windows."""

    real: Range
    """The range of real takes."""

    of_genre: bool
    """Whether the range is that of real takes of the same genre."""

    @property
    def is_inside(self) -> bool:
        """Whether the value is inside the real range."""
        return self.real.holds(self.value)


@default_numerics()
def movement(repertoire: Repertoire) -> tuple[Cell, ...]:
    """Compare how each genre of a repertoire moves with real dancing.

    Measures that a genre cannot have, such as copies of bars without counts, are left out.

    Raises `RepertoireError` if the file is damaged, and `ParameterError` if it is not a `Repertoire`.

    Examples
    --------
    >>> cells = cg.movement(cg.starter_repertoire())
    >>> sorted({cell.genre for cell in cells})[:3]
    ['Charleston', 'Viennese waltz', 'cha-cha']
    >>> len([cell for cell in cells if cell.genre == "waltz"])
    44
    """
    check_kind("a repertoire", repertoire, Repertoire)
    return cells_beside(real_ranges(), repertoire)


def cells_beside(ranges: Mapping[str, Mapping[str, Range]], repertoire: Repertoire) -> tuple[Cell, ...]:
    """As `movement`, with other ranges by genre and measure."""
    values: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    for take, info in enumerate(repertoire.takes):
        for window in windows_of(repertoire.body_pos_m(take), repertoire.counts(take)):
            for name, value in measured(window).items():
                if np.isfinite(value):
                    values[info.credits.genre][name].append(value)
    cells = []
    for genre in sorted(values):
        own = ranges.get(genre, {})
        for name, (unit, _) in MEASURES.items():
            if values[genre][name] and (name in own or name in ranges[ALL_REAL]):
                real = own.get(name) or ranges[ALL_REAL][name]
                cells.append(
                    Cell(genre, name, unit, float(np.median(values[genre][name])), real, name in own)
                )
    return tuple(cells)


def movement_table(cells: Sequence[Cell]) -> list[str]:
    """A line for each measure with the range of all real takes, and the value of each genre.

    A value outside of the range of its cell is marked with a star. The first lines are the shares of cells
    inside.
    """
    genres = list(dict.fromkeys(cell.genre for cell in cells))
    by_name: dict[str, dict[str, Cell]] = defaultdict(dict)
    for cell in cells:
        by_name[cell.measure][cell.genre] = cell
    own = [cell.is_inside for cell in cells if cell.of_genre]
    inside = (
        f"{np.mean([cell.is_inside for cell in cells]):.2f} of {len(cells)} values are inside the real range"
    )
    lines = [
        inside + (f", {np.mean(own):.2f} of the {len(own)} with a range of their own genre" if own else "")
    ]
    width = max(len(name) for name in MEASURES) + 8
    columns = [max(len(genre), 8) for genre in genres]
    head = "  ".join(f"{genre or '-':>{column}}" for genre, column in zip(genres, columns, strict=True))
    lines.append(f"{'':<{width}}  {'real, all':>15}  {head}")
    everywhere = real_ranges()[ALL_REAL]
    for name, of_name in by_name.items():
        unit, real = MEASURES[name][0], everywhere.get(name)
        text = "" if real is None else f"{real.low:.3g} to {real.high:.3g}"
        values = [
            f"{_marked(of_name.get(genre)):>{column}}" for genre, column in zip(genres, columns, strict=True)
        ]
        lines.append(f"{name + (f', {unit}' if unit else ''):<{width}}  {text:>15}  {'  '.join(values)}")
    lines.append("* outside of the range, which is that of real takes of the genre where there are enough")
    return lines


def _marked(cell: Cell | None) -> str:
    return "-" if cell is None else f"{cell.value:.3g}{' ' if cell.is_inside else '*'}"
