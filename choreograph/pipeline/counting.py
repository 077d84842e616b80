"""Counts of any animation or song: tempo, metre, counts, loop points, and figures or phrases."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.song_analysis import song_structure
from choreograph.core.counts import FROM_MUSIC, NO_COUNTS, Counts, Figure
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path, atomic_path
from choreograph.core.numerics import Floats, default_numerics, interpolate_frames, one_thread
from choreograph.core.timebase import NET_FPS
from choreograph.formats.glb import dance_document
from choreograph.formats.gltf_document import read_gltf, with_marks
from choreograph.formats.manifest import write_counts
from choreograph.formats.register import is_motion, read_take
from choreograph.formats.usd import ANIMATION_PATH, dance_stage, export_stage, mark_stage, require_usd
from choreograph.formats.writer import GENERATOR
from choreograph.library.building.takes import measure_take
from choreograph.library.builtin import are_likely_right, load_motion_counter, pretrained_set
from choreograph.library.songs import DEFAULT_BEATS, song_counts
from choreograph.motion.body import ground_pos_m, to_root_frame
from choreograph.motion.motion import Take
from choreograph.music.bars import tempo_bpm
from choreograph.music.form import CountDistances, Form, letter_name
from choreograph.music.mel import log_mel
from choreograph.music.song import load_song
from choreograph.pipeline.saving import save_document

MOTION, SONG = "motion", "song"
_SURE_SONG_CONFIDENCE = 0.5


@dataclass(frozen=True, eq=False)
class CountedFile:
    """The counts of a file, with what follows from them."""

    name: str
    """Name of the file without its suffix."""

    kind: str
    """What it holds, "motion" or "song"."""

    duration_s: float
    """Length in seconds."""

    counts: Counts
    """Its counts, or none if none were found."""

    loops: tuple[LoopPoints, ...]
    """The best loop of each length. Its distance is that of the poses in metres, or that of the music, in
    which 1 is the distance of any two places of the song."""

    figures: tuple[Figure, ...]
    """The figures that are stated with a motion, or the phrases of a song. Phrases that repeat each other
    have the same letter."""

    is_sure: bool
    """Whether the counts are stated or likely to be right."""

    take: Take | None = None
    """The animation, or None for a song."""

    @property
    def tempo_bpm(self) -> float | None:
        """Median tempo in counts a minute, or None with fewer than two counts."""
        return tempo_bpm(self.counts) if len(self.counts) > 1 else None

    def facts(self) -> dict[str, Any]:
        """All of it as numbers and texts, for JSON."""
        counts = self.counts
        return {
            "name": self.name,
            "kind": self.kind,
            "duration_s": round(self.duration_s, 4),
            "tempo_bpm": None if self.tempo_bpm is None else round(self.tempo_bpm, 2),
            "metre": counts.metre,
            "source": counts.source,
            "confidence": round(counts.confidence, 3),
            "is_sure": self.is_sure,
            "times_s": [round(time_s, 4) for time_s in counts.times_s.tolist()],
            "numbers": counts.numbers.tolist(),
            "loops": [asdict(loop) for loop in self.loops],
            "figures": [asdict(figure) for figure in self.figures],
        }


@default_numerics()
@one_thread()
def count_file(path: str | Path, *, beats: str | Path = DEFAULT_BEATS) -> CountedFile:
    """The counts of a motion or song: tempo, metre, count 1, loop points, and figures or phrases.

    Counts that lie beside a motion are taken as they are. Otherwise, they are estimated from the motion by
    the network that counts takes in a build, with the confidence that a count is right.

    Parameters
    ----------
    path : str or Path    a motion in any format that is read, or a song or video
    beats : str or Path   the tracker of a song's beats, or a file of them

    Raises
    ------
    ParameterError   there is no such file, or several takes in it, the tracker is not known, or `beats` are
                     given for a motion
    FormatError      the file is damaged, or neither a motion nor a song

    Examples
    --------
    >>> counted = cg.count_file(cg.example_songs()["waltz"])
    >>> round(counted.tempo_bpm), counted.counts.metre, counted.kind
    (90, 3, 'song')
    """
    path = as_path("a motion or song to count", path)
    if not path.exists():
        raise ParameterError(f"{path}: expected a motion or a song, got nothing: there is no such file")
    if path.is_dir() or is_motion(path):
        if beats != DEFAULT_BEATS:
            raise ParameterError(
                f"{path}: expected a song for the beats {beats}, got a motion: leave out beats"
            )
        return _counted_motion(path)
    return _counted_song(path, beats)


def _counted_motion(path: Path) -> CountedFile:
    measured = measure_take(read_take(path))
    take, counts, is_sure = measured.take, measured.take.counts, True
    if not len(counts):
        counter = load_motion_counter(pretrained_set("default"))
        counts = NO_COUNTS if counter is None else counter(measured.body_pos_m)
        is_sure = len(counts) > 0 and are_likely_right(counts)
    away = pose_distances(measured.body_pos_m, NET_FPS, counts.times_s)
    return CountedFile(
        take.name,
        MOTION,
        take.motion.duration_s,
        counts,
        best_loops(away, counts),
        take.figures,
        is_sure,
        take,
    )


def _counted_song(path: Path, beats: str | Path) -> CountedFile:
    song = load_song(path)
    counts = song_counts(song, log_mel(song.samples), beats)
    if len(counts) < 2:
        return CountedFile(song.name, SONG, song.duration_s, counts, (), (), False)
    _, form, features = song_structure(song, counts, None)
    loops = best_loops(song_distances(features, counts), counts)
    is_sure = counts.source != FROM_MUSIC or counts.confidence >= _SURE_SONG_CONFIDENCE
    return CountedFile(song.name, SONG, song.duration_s, counts, loops, _phrases(form), is_sure)


def _phrases(form: Form) -> tuple[Figure, ...]:
    """The phrases of a song. The first one is A, and so is every phrase that repeats it."""
    ranks = {label: rank for rank, label in enumerate(dict.fromkeys(form.labels))}
    return tuple(
        Figure(letter_name(ranks[label]), phrase.start_s, phrase.end_s, phrase.n_counts)
        for label, phrase in zip(form.labels, form.phrases, strict=True)
    )


# Files of counts: a table (.csv), all facts (.json), markers that sound editors read (.txt), and animations
# with their counts (.glb, .usda, .usdc).


def save_counts(path: str | Path, counted: CountedFile) -> None:
    """Write the counts of a file: a table (.csv), JSON (.json), or labels (.txt) as Audacity imports them.

    A .glb, .usda or .usdc has the animation that was counted, with its counts. If this is a .glb, all else in
    it is kept.

    Raises `ParameterError` for another suffix, if there are no counts, or for the animation of a song.
    """
    path = as_path("a file of counts to write", path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise ParameterError(f"{path}: expected a name ending in {', '.join(_WRITERS)} for counts")
    if not len(counted.counts):
        raise ParameterError(f"{path}: expected counts to write, got none: {counted.name} has no clear beat")
    writer(path, counted)


def _write_json(path: Path, counted: CountedFile) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(counted.facts(), indent=1) + "\n", encoding="utf-8")


def _write_labels(path: Path, counted: CountedFile) -> None:
    """A line for each count and figure: start and end in seconds and a text, separated by tabs."""
    counts = counted.counts
    marks = [
        (time_s, time_s, str(number) if number else "count")
        for time_s, number in zip(counts.times_s.tolist(), counts.numbers.tolist(), strict=True)
    ]
    marks += [(figure.start_s, figure.end_s, figure.name) for figure in counted.figures]
    lines = [
        f"{start_s:.6f}\t{end_s:.6f}\t{' '.join(text.split())}\n" for start_s, end_s, text in sorted(marks)
    ]
    with atomic_path(path) as temporary:
        temporary.write_text("".join(lines), encoding="utf-8")


def _write_marked_glb(path: Path, counted: CountedFile) -> None:
    take = _take_of(counted, path)
    source = take.source_paths[0]
    is_gltf = source.suffix.lower() in (".glb", ".gltf")
    document = read_gltf(source) if is_gltf else dance_document(take.motion)
    save_document(path, with_marks(document, counted.facts()))


def _write_marked_stage(path: Path, counted: CountedFile) -> None:
    require_usd(path)
    stage = dance_stage(_take_of(counted, path).motion)
    mark_stage(stage, ANIMATION_PATH, counted.facts())
    with atomic_path(path) as temporary:
        export_stage(stage, temporary, GENERATOR)


def _take_of(counted: CountedFile, path: Path) -> Take:
    if counted.take is None:
        raise ParameterError(f"{path}: expected the counts of an animation, got those of a song: use .json")
    return counted.take


_WRITERS: Mapping[str, Callable[[Path, CountedFile], None]] = {
    ".csv": lambda path, counted: write_counts(path, counted.counts, counted.figures),
    ".json": _write_json,
    ".txt": _write_labels,
    ".glb": _write_marked_glb,
    ".usda": _write_marked_stage,
    ".usdc": _write_marked_stage,
}


# Loop points: spans of whole bars of a motion or a song after which it can begin again without a jump.

_LENGTHS = (1, 2, 4, 8, 16, 32)  # in bars, or in counts if bars are not known
_AFTER_S = 0.1  # poses so long after the start and after the end of a loop must agree as well
_REACH = 4  # counts around the ends of a loop in a song whose bars are not known


@dataclass(frozen=True)
class LoopPoints:
    """A span that can be repeated."""

    start_s: float
    """When it begins, in seconds."""

    end_s: float
    """When it ends, in seconds."""

    n_counts: int
    """Its length in counts."""

    distance: float
    """Distance of its end from its start, as in the matrix of distances in which it was found."""


def best_loops(distances: Floats, counts: Counts) -> tuple[LoopPoints, ...]:
    """For each length, the loop whose end is nearest to its start, by length.

    Loops last 1, 2, 4, 8, 16 or 32 bars, from count 1 to count 1, or so many counts if bars are not known.

    Parameters
    ----------
    distances : float array (Q, Q)   of the instants of two counts
    counts : Counts (Q,)
    """
    starts = np.flatnonzero(counts.numbers == 1) if counts.has_bars else np.arange(len(counts))
    loops = []
    for length in _LENGTHS:
        if length >= len(starts):
            break
        first, last = starts[:-length], starts[length:]
        away = distances[first, last]
        best = int(np.argmin(away))
        start, end = int(first[best]), int(last[best])
        times_s = counts.times_s
        loops.append(LoopPoints(float(times_s[start]), float(times_s[end]), end - start, float(away[best])))
    return tuple(loops)


def pose_distances(body_pos_m: NDArray[np.floating], fps: float, times_s: Floats) -> Floats:
    """Distances of the poses at times (Q,) together with those shortly after, (Q, Q) in metres.

    A distance is the mean over the joints. Each pose is seen from its own place and heading on the floor, and
    the one after it from the same place. `body_pos_m` is (T, 21, 3).
    """
    pos_m = np.asarray(body_pos_m, np.float64)
    at_m = interpolate_frames(pos_m, times_s * fps)  # (Q, 21, 3)
    after_m = interpolate_frames(pos_m, (times_s + _AFTER_S) * fps)
    moved_m = to_root_frame(at_m, after_m - ground_pos_m(at_m)[:, None])
    poses_m = np.concatenate([to_root_frame(at_m), moved_m], axis=1)  # (Q, 42, 3)
    return np.stack([np.linalg.norm(poses_m - one_m, axis=-1).mean(axis=-1) for one_m in poses_m])


def song_distances(features: NDArray[np.floating], counts: Counts) -> Floats:
    """Distances of the music around two counts, (Q, Q), relative to the median distance of two counts.

    It is the mean over the counts of a bar before and of one after. `features` are the spectral features
    (B, 87) of `form.song_form`, of which row q begins at count q.
    """
    n, reach = min(len(counts), len(features)), counts.metre or _REACH
    away = CountDistances(features[:n]).rows(0, n)
    padded = np.pad(away, reach, mode="edge")
    steps = range(2 * reach)  # from a bar before to the last count of a bar after
    around: Floats = np.mean([padded[step : step + n, step : step + n] for step in steps], axis=0)
    missing = len(counts) - n  # the last count ends the last interval
    return np.pad(around, (0, missing), mode="edge")
