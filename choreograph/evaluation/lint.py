"""What is likely wrong in a repertoire: duplicates, drifting feet, genres, counts, takes that are not danced.

Every check compares a take with the other takes of the repertoire. It needs no song and no other data.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from choreograph.core.arguments import check_function, check_kind
from choreograph.core.counts import FROM_MOTION
from choreograph.core.numerics import Floats, chi_square_distance, default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.core.timebase import CLIP_S, NET_FPS
from choreograph.evaluation.metrics.physical import floating_share, floor_penetration_cm, foot_slide_cm_s
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import signature
from choreograph.motion.body import to_root_frame
from choreograph.motion.motion_beats import mean_joint_speed_m_s
from choreograph.music.bars import tempo_bpm
from choreograph.music.count_grids import FEWEST_COUNTS

DUPLICATE, FEET, GENRE, COUNTS, NOT_DANCED = "duplicate", "feet", "genre", "counts", "not danced"
KINDS = (DUPLICATE, FEET, GENRE, COUNTS, NOT_DANCED)  # of findings, in the order in which they are returned


@dataclass(frozen=True)
class Finding:
    """One thing that is likely wrong with a take."""

    kind: str
    """One of `KINDS`."""

    take: str
    """Name of the take, or "" for the whole repertoire."""

    text: str
    """What was expected and what was found."""

    def __str__(self) -> str:
        return f"{self.take}: {self.text}" if self.take else self.text


@default_numerics()
def lint(repertoire: Repertoire, *, report: ProgressReport | None = None) -> tuple[Finding, ...]:
    """Find what is likely wrong in a repertoire.

    The kinds of findings are motion that several takes share, feet that slide or do not stand on the floor,
    genres that the motion or the spelling contradicts, counts that are missing, uncertain or uneven, and
    takes that are never danced. `report` is called with the name of the stage, the work done so far, and all
    the work.

    Raises `RepertoireError` if the file is damaged, and `ParameterError` if it is not a `Repertoire`.

    Examples
    --------
    >>> findings = cg.lint(cg.starter_repertoire())
    >>> [finding for finding in findings if finding.kind == "counts"]
    []
    """
    check_kind("a repertoire", repertoire, Repertoire)
    check_function("report", report)
    checks: tuple[Callable[[Repertoire], Iterator[Finding]], ...] = (
        _shared_motion, _feet, _spelling, _signatures, _counts, _never_danced,
    )  # fmt: skip
    findings: list[Finding] = []
    for done, check in enumerate(checks):
        if report is not None:
            report("checking", done, len(checks))
        findings += check(repertoire)
    if report is not None:
        report("checking", len(checks), len(checks))
    return tuple(sorted(findings, key=lambda finding: KINDS.index(finding.kind)))


# Motion that two takes share. A copy may begin at any frame of the other take.


_SAME_M = 0.01  # largest mean distance of joints of the same motion
_SHARED_S = 4.0  # least seconds of motion that two takes share
_WINDOW_S = 2  # seconds that are compared at a time, one window a second
_DIMENSIONS = 16  # of the poses in the search
_BETWEEN_FRAMES = (0.0, -0.5, -0.25, 0.25, 0.5)
_FRAMES_AT_ONCE = 1 << 18  # in a tree
_WINDOW_FRAMES = _WINDOW_S * NET_FPS
_NEAR_M = 2 * _SAME_M * np.sqrt(2 * 21)  # of two descriptors. Twice that of joints which are equally distant


def _shared_motion(repertoire: Repertoire) -> Iterator[Finding]:
    bodies = [repertoire.body_pos_m(take).astype(np.float64) for take in range(len(repertoire.takes))]
    poses = [to_root_frame(body) for body in bodies]
    names = [take.name for take in repertoire.takes]
    for take, seconds in sorted(_shared_seconds(poses).items()):
        every = len(set[int]().union(*seconds.values()))
        if every < _SHARED_S:
            continue
        other = max(seconds, key=lambda other: len(seconds[other]))
        text = f"{every} s of its {len(poses[take]) / NET_FPS:.0f} s are the same motion as in "
        others = f"{len(seconds)} other takes, most of all in " if len(seconds) > 1 else ""
        yield Finding(DUPLICATE, names[take], f"{text}{others}{names[other]} ({len(seconds[other])} s)")


def _shared_seconds(poses: Sequence[NDArray[np.floating]]) -> dict[int, dict[int, set[int]]]:
    """The seconds of each take that are also in earlier takes, by take and earlier take.

    `poses` are those of the takes in their root frames, (T, 21, 3). An orthogonal projection never makes two
    poses more distant, so that a search in few dimensions finds all that are near.
    """
    shared: dict[int, dict[int, set[int]]] = defaultdict(lambda: defaultdict(set))
    starts, frames = _windows(poses, NET_FPS), _windows(poses, 1)
    if len(starts) == 0:
        return shared
    described = [_descriptors(own) for own in poses]
    sample = np.concatenate([own[::NET_FPS] for own in described])
    centre = sample.mean(axis=0)
    axes = np.linalg.svd(sample - centre, full_matrices=False)[2][:_DIMENSIONS].T  # (D, d)
    projected = [(own - centre) @ axes for own in described]
    queries = np.stack([projected[take][frame] for take, frame in starts])
    for first in range(0, len(frames), _FRAMES_AT_ONCE):
        part = frames[first : first + _FRAMES_AT_ONCE]
        tree = cKDTree(np.stack([projected[take][frame] for take, frame in part]))
        for (take, frame), near in zip(starts, tree.query_ball_point(queries, _NEAR_M), strict=True):
            window = poses[take][frame : frame + _WINDOW_FRAMES]
            of_take = shared[int(take)]
            for other, at in part[near]:
                if other >= take or frame // NET_FPS in of_take.get(int(other), ()):
                    continue
                if _is_same(window, poses[other], int(at)):
                    of_take[int(other)].add(int(frame) // NET_FPS)
    return shared


def _windows(poses: Sequence[NDArray[np.floating]], step: int) -> NDArray[np.int64]:
    """Take and first frame (W, 2) of windows, one every `step` frames."""
    of_takes = [np.arange(0, len(own) - _WINDOW_FRAMES, step) for own in poses]
    return np.stack([np.repeat(np.arange(len(poses)), list(map(len, of_takes))), np.concatenate(of_takes)], 1)


def _descriptors(poses: NDArray[np.floating]) -> NDArray[np.float32]:
    """The first and the middle pose of each window, (T - window, 2 * 63)."""
    flat = poses.reshape(len(poses), -1).astype(np.float32)
    n_windows = max(0, len(poses) - _WINDOW_FRAMES)
    middle = _WINDOW_FRAMES // 2
    return np.concatenate([flat[:n_windows], flat[middle : middle + n_windows]], axis=1)


def _is_same(window: NDArray[np.floating], poses: NDArray[np.floating], at: int) -> bool:
    """Whether the poses from about frame `at` on are those of a window. A copy may begin between frames."""
    for share in _BETWEEN_FRAMES:
        first = min(max(at + share, 0.0), len(poses) - len(window) - 1.0)
        low, weight = int(first), first % 1.0
        before, after = (poses[low + step : low + step + len(window)] for step in (0, 1))
        if np.linalg.norm(window - (before * (1 - weight) + after * weight), axis=-1).mean() < _SAME_M:
            return True
    return False


# Feet that slide, sink or float.


_SLIDES = 2.0  # times the median of the takes of the genre
_LEAST_SLIDE_CM_S = 15.0  # that is a finding
_DEEP_CM = 5.0  # captures are off by several cm either way
_FLOATS = 0.1  # share of the frames


def _feet(repertoire: Repertoire) -> Iterator[Finding]:
    bodies = [repertoire.body_pos_m(take).astype(np.float64) for take in range(len(repertoire.takes))]
    slides = np.array([foot_slide_cm_s(body, NET_FPS) for body in bodies])
    genres = np.array([take.credits.genre for take in repertoire.takes])
    for take, body, slide, genre in zip(repertoire.takes, bodies, slides, genres, strict=True):
        usual = float(np.median(slides[genres == genre]))
        if slide > max(_SLIDES * usual, _LEAST_SLIDE_CM_S):
            yield Finding(
                FEET, take.name,
                f"standing feet slide at {slide:.0f} cm/s, those of {genre or 'all'} takes at {usual:.0f}",
            )  # fmt: skip
        deep, floats = floor_penetration_cm(body, NET_FPS), floating_share(body, NET_FPS)
        if deep > _DEEP_CM:
            yield Finding(FEET, take.name, f"feet are {deep:.1f} cm below the floor on average")
        if floats > _FLOATS:
            yield Finding(FEET, take.name, f"no foot is near the floor for {100 * floats:.0f} % of the time")


# Genres that the motion or the spelling contradicts.


_FEWEST_TAKES = 3  # of a genre, without which its signature says little
_NEARER = 0.75  # of the distance to its own genre


def _spelling(repertoire: Repertoire) -> Iterator[Finding]:
    spelled: dict[str, Counter[str]] = defaultdict(Counter)
    for take in repertoire.takes:
        genre = take.credits.genre
        spelled[re.sub(r"[\W_]+", "", genre).casefold()][genre] += 1
    for ways in spelled.values():
        usual = ways.most_common(1)[0][0]
        for take in repertoire.takes:
            if take.credits.genre in ways and take.credits.genre != usual:
                yield Finding(
                    GENRE, take.name,
                    f"its genre is spelled {take.credits.genre!r}, that of {ways[usual]} takes {usual!r}",
                )  # fmt: skip


def _signatures(repertoire: Repertoire) -> Iterator[Finding]:
    """Takes whose motifs are those of another genre. Each genre is described by its other takes."""
    if not repertoire.has_vocabulary:
        return
    vocabulary, takes = repertoire.vocabulary, repertoire.takes
    own = {
        int(take): signature(vocabulary.word_motif[vocabulary.words_of_take(int(take))], vocabulary.n_motifs)
        for take in np.unique(vocabulary.word_take)
    }
    of_genre: dict[str, list[int]] = defaultdict(list)
    for take in own:
        of_genre[takes[take].credits.genre].append(take)
    known = {genre: of for genre, of in of_genre.items() if genre and len(of) >= _FEWEST_TAKES}
    for genre, of in known.items():
        for take in of:
            away = {
                name: _distance(own[take], [own[t] for t in others if t != take])
                for name, others in known.items()
            }
            nearest = min(away, key=lambda name: away[name])
            if away[nearest] < _NEARER * away[genre]:
                yield Finding(
                    GENRE, takes[take].name,
                    f"its motifs are nearer to {nearest} (χ² {away[nearest]:.2f}) than to {genre} "
                    f"({away[genre]:.2f})",
                )  # fmt: skip


def _distance(own: Floats, others: Sequence[Floats]) -> float:
    return float(chi_square_distance(own, np.mean(others, axis=0)))


# Counts that are missing, uncertain or uneven.


_UNCERTAIN = 0.6  # confidence below which counts that were estimated are in doubt
_UNEVEN = 1.25  # ratio of the long to the short counts of a take
_OFF_TEMPO = 1.5  # ratio to the slowest or fastest other take of the genre


def _counts(repertoire: Repertoire) -> Iterator[Finding]:
    counts = [repertoire.counts(take) for take in range(len(repertoire.takes))]
    tempi: dict[str, dict[int, float]] = defaultdict(dict)
    for take, own in enumerate(counts):
        if len(own) >= FEWEST_COUNTS:
            tempi[repertoire.takes[take].credits.genre][take] = tempo_bpm(own)
    if not tempi:
        yield Finding(COUNTS, "", "no take has counts, so that motion beats are danced on the beats")
    for take, own in enumerate(counts):
        info = repertoire.takes[take]
        if len(own) < FEWEST_COUNTS:
            continue
        if own.source == FROM_MOTION and own.confidence < _UNCERTAIN:
            text = f"its counts are estimated from the motion with a confidence of {own.confidence:.2f}"
            yield Finding(COUNTS, info.name, text)
        short, long = np.percentile(np.diff(own.times_s), [10, 90])
        if long > _UNEVEN * short:
            yield Finding(COUNTS, info.name, f"its counts last from {short:.2f} to {long:.2f} s")
        others = [bpm for other, bpm in tempi[info.credits.genre].items() if other != take]
        bpm = tempi[info.credits.genre][take]
        if len(others) >= _FEWEST_TAKES and not (min(others) / _OFF_TEMPO <= bpm <= max(others) * _OFF_TEMPO):
            text = f"it is counted at {bpm:.0f} BPM, other takes of {info.credits.genre or 'no genre'} at "
            yield Finding(COUNTS, info.name, f"{text}{min(others):.0f} to {max(others):.0f}")


# Takes that are never danced.


_STILL_M_S = 0.05


def _never_danced(repertoire: Repertoire) -> Iterator[Finding]:
    n_clips = np.bincount(repertoire.clip_take, minlength=len(repertoire.takes))
    counted = [len(repertoire.counts(take)) >= FEWEST_COUNTS for take in range(len(repertoire.takes))]
    for take, info in enumerate(repertoire.takes):
        if n_clips[take] == 0:
            text = f"it lasts {info.duration_s:.1f} s and is never danced: expected {CLIP_S} s or more"
            yield Finding(NOT_DANCED, info.name, text)
        elif any(counted) and not counted[take]:
            text = "it has no counts, and is not danced to songs with beats because other takes have counts"
            yield Finding(NOT_DANCED, info.name, text)
        speed = float(mean_joint_speed_m_s(repertoire.body_pos_m(take), NET_FPS).mean())
        if speed < _STILL_M_S:
            yield Finding(
                NOT_DANCED, info.name, f"its joints move at {speed:.2f} m/s, which is standing still"
            )
