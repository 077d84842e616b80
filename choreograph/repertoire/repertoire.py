"""`Repertoire`: an opened repertoire file as takes, clips, motions and poses."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from choreograph.counts import NO_COUNTS, Counts, Figure
from choreograph.errors import ParameterError, RepertoireError
from choreograph.features.liveliness import Liveliness
from choreograph.features.motion_beats import mean_joint_speed_m_s
from choreograph.motifs.vocabulary import Vocabulary
from choreograph.motion import rotations as rot
from choreograph.motion.motion import Motion
from choreograph.motion.pose import to_root_frame
from choreograph.motion.skeleton import Skeleton
from choreograph.repertoire.clip_ranks import clip_liveliness, clip_steps
from choreograph.repertoire.html_table import html_table
from choreograph.repertoire.motif_arrays import vocabulary_from
from choreograph.repertoire.store import NetArrays, RepertoireFile
from choreograph.takes import Credits
from choreograph.timebase import CLIP_FRAMES, NET_FPS, frame_times_s, frames_to_seconds

if TYPE_CHECKING:
    from choreograph.nets.rollout.model import RolloutNet
    from choreograph.nets.words.model import WordNet


_HTML_ROWS = 50


@dataclass(frozen=True)
class TakeInfo:
    """A take of a repertoire; ranges are into the file's flat arrays."""

    name: str
    song_name: str
    credits: Credits
    fps: float
    motion: tuple[int, int]
    body: tuple[int, int]
    beats: tuple[int, int]
    notes: str

    @property
    def duration_s(self) -> float:
        """Length of the take's motion in seconds."""
        return (self.motion[1] - self.motion[0]) / self.fps


class Repertoire:
    """Everything that `dance` needs besides the song. Open with `Repertoire.open`; arrays load on demand."""

    def __init__(self, file: RepertoireFile) -> None:
        self._file = file

    @classmethod
    def open(cls, path: str | Path) -> Repertoire:
        """Open a repertoire file.

        Raises `RepertoireError` if it is missing, damaged or of another version, `ParameterError` if `path`
        is not a path.
        """
        if not isinstance(path, str | os.PathLike):
            raise ParameterError(f"expected the path of a repertoire file, got {path!r}")
        return cls(RepertoireFile(Path(path)))

    def __repr__(self) -> str:
        return f"<Repertoire {self._summary()}>"

    def _repr_html_(self) -> str:
        """A table of the takes, for notebooks."""
        clips = np.bincount(self.clip_take, minlength=len(self.takes))
        rows = [
            (
                take.name,
                take.credits.genre,
                f"{take.duration_s:.1f} s",
                f"{n_clips:,}",
                ", ".join(filter(None, (take.credits.performer, take.credits.licence, take.credits.source))),
            )
            for take, n_clips in zip(self.takes, clips, strict=True)
        ]
        header = ("take", "genre", "length", "clips", "credits")
        return html_table(self._summary(), header, rows, max_rows=_HTML_ROWS)

    def _summary(self) -> str:
        minutes = sum(take.duration_s for take in self.takes) / 60
        genres = ", ".join(sorted({take.credits.genre for take in self.takes} - {""})) or "none"
        return (
            f"{self.path.name}: {len(self.takes):,} takes, {minutes:.1f} min, {self.n_clips:,} clips, "
            f"genres: {genres}"
        )

    @property
    def path(self) -> Path:
        """The file of this repertoire."""
        return self._file.path

    @property
    def density(self) -> str:
        """The kind of the clips' tempo-densities: "analytic" or "learned"."""
        return self._file.density

    @property
    def provenance(self) -> dict:
        """How the file was made: program version, preset, seed, songs trained on."""
        return self._file.provenance

    @property
    def source_checksums(self) -> frozenset[str]:
        """SHA-256, hexadecimal, of every motion and music file that it was made from."""
        return frozenset(str(digest) for digest in self._file.read("sources/sha256"))

    @property
    def net_names(self) -> tuple[str, ...]:
        """Names of the networks in the file."""
        return self._file.net_names

    def net(self, name: str) -> NetArrays:
        """A network's config and weights; `RepertoireError` if there is none with that name."""
        return self._file.read_net(name)

    @property
    def has_vocabulary(self) -> bool:
        """Whether the file has motion words and motifs."""
        return self._file.has_motifs

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """Motion words, motifs and the genres' signatures; `RepertoireError` if there are none."""
        self._expect_vocabulary()
        try:
            return vocabulary_from(self._file.read, len(self.takes))
        except RepertoireError as error:
            raise RepertoireError(f"{self.path}: {error}: a damaged file") from error

    def word_net(self) -> WordNet:
        """The network that embedded the vocabulary's motion words; `RepertoireError` if there is none."""
        from choreograph.nets.words.model import WordNet

        self._expect_vocabulary()
        net = self.net("words")
        try:
            return WordNet.from_arrays(net.weights, net.config)
        except ParameterError as error:
            raise RepertoireError(f"{self.path}: {error}: a damaged file") from error

    def rollout_net(self) -> RolloutNet:
        """The network that generates motion from motifs; `RepertoireError` if there is none."""
        from choreograph.nets.rollout.model import RolloutNet

        if "rollout" not in self.net_names:
            raise RepertoireError(
                f"{self.path}: expected a rollout network, got a repertoire without one: build it again with "
                "`choreograph build-db --rollout`"
            )
        net = self.net("rollout")
        try:
            return RolloutNet.from_arrays(net.weights, net.config)
        except ParameterError as error:
            raise RepertoireError(f"{self.path}: {error}: a damaged file") from error

    def _expect_vocabulary(self) -> None:
        if not self.has_vocabulary:
            raise RepertoireError(
                f"{self.path}: expected motion words and motifs, got a repertoire without: made by an older "
                "choreograph or from too few words, build it again with `choreograph build-db`"
            )

    @cached_property
    def skeleton(self) -> Skeleton:
        """The skeleton of all motion in the file."""
        names = ("parents", "offsets_m", "tip_parents", "tips_m")
        joints = tuple(str(name) for name in self._file.read("skeleton/names"))
        return Skeleton(joints, *(self._file.read(f"skeleton/{name}") for name in names))

    @cached_property
    def takes(self) -> tuple[TakeInfo, ...]:
        """All takes, in the order of the file."""
        text = ("name", "song_name", "genre", "performer", "licence", "source", "notes")
        ranges = [f"{array}_{end}" for array in ("motion", "body", "beat") for end in ("start", "stop")]
        columns = {name: self._file.read(f"takes/{name}") for name in (*text, "fps", *ranges)}
        return tuple(
            TakeInfo(
                name=str(columns["name"][i]),
                song_name=str(columns["song_name"][i]),
                credits=Credits(*(str(columns[c][i]) for c in ("genre", "performer", "licence", "source"))),
                fps=float(columns["fps"][i]),
                motion=(int(columns["motion_start"][i]), int(columns["motion_stop"][i])),
                body=(int(columns["body_start"][i]), int(columns["body_stop"][i])),
                beats=(int(columns["beat_start"][i]), int(columns["beat_stop"][i])),
                notes=str(columns["notes"][i]),
            )
            for i in range(len(columns["name"]))
        )

    @property
    def n_clips(self) -> int:
        """Number of clips N."""
        return self._file.shapes["clips/take"][0]

    @cached_property
    def clip_take(self) -> NDArray[np.int32]:
        """Index of each clip's take, (N,)."""
        return self._file.read("clips/take")

    @cached_property
    def clip_start_frame(self) -> NDArray[np.int64]:
        """First frame of each clip in its take, 20 fps, (N,)."""
        return self._file.read("clips/start_frame")

    @cached_property
    def clip_style(self) -> NDArray[np.float32]:
        """Style vectors of the clips' middle 4 s, (N, 32)."""
        return self._file.read("clips/style")

    @cached_property
    def clip_beat_count(self) -> NDArray[np.float32]:
        """Motion beats in the clips' middle 4 s, (N,)."""
        return self._file.read("clips/beat_count")

    @cached_property
    def _body_pos_m(self) -> NDArray[np.float32]:
        return self._file.read("body/pos_m")

    @cached_property
    def _density(self) -> NDArray[np.float32]:
        return self._file.read("body/density")

    @cached_property
    def _beats_s(self) -> NDArray[np.float64]:
        return self._file.read("beats/motion_s")

    @cached_property
    def _clip_body_start(self) -> NDArray[np.int64]:
        """First row of each clip in the flat 20 fps arrays, (N,)."""
        starts = np.array([take.body[0] for take in self.takes], np.int64)
        return starts[self.clip_take] + self.clip_start_frame

    @property
    def selection_beat_weight(self) -> float:
        """Weight in selection of a difference of one motion beat, relative to style distance."""
        return float(self.provenance.get("selection_beat_weight", 0.0))

    def take_index(self, name: str) -> int:
        """Index of a take by name; `RepertoireError` if there is none."""
        names = [take.name for take in self.takes]
        if name not in names:
            raise RepertoireError(f"{self.path}: expected one of {len(names)} takes, got {name!r}")
        return names.index(name)

    def motion(self, take: int, start_s: float = 0.0, stop_s: float | None = None) -> tuple[Motion, float]:
        """A take's stored motion around [start_s, stop_s], and the time of its first frame."""
        info = self.takes[take]
        n_frames = info.motion[1] - info.motion[0]
        first = int(np.clip(np.floor(start_s * info.fps), 0, n_frames - 1))
        last = (
            n_frames if stop_s is None else int(np.clip(np.ceil(stop_s * info.fps) + 2, first + 1, n_frames))
        )
        part = slice(info.motion[0] + first, info.motion[0] + last)
        root = self._file.read("motion/root_pos_m", part)
        quat = rot.normalize(self._file.read("motion/local_quat", part).astype(np.float64))
        return Motion(self.skeleton, root, quat, info.fps), first / info.fps

    def body_pos_m(self, take: int) -> NDArray[np.float32]:
        """A take's 21 joints at 20 fps, (T, 21, 3)."""
        start, stop = self.takes[take].body
        return self._body_pos_m[start:stop]

    def motion_beats_s(self, take: int) -> NDArray[np.float64]:
        """A take's motion beats in seconds from its first frame, (Q,)."""
        start, stop = self.takes[take].beats
        return self._beats_s[start:stop]

    @cached_property
    def _counts(self) -> tuple[Counts, ...]:
        """Each take's counts; none in a file of version 1."""
        if not self._file.has_counts:
            return (NO_COUNTS,) * len(self.takes)
        columns = ("count_start", "count_stop", "metre", "counts_source", "counts_confidence")
        times_s, numbers = self._file.read("counts/time_s"), self._file.read("counts/number")
        doubt = self._file.read("counts/doubt").astype(np.float64) if self._file.has_doubt else np.zeros(0)
        rows = zip(*(self._file.read(f"takes/{column}") for column in columns), strict=True)
        takes = [(slice(start, stop), *about) for start, stop, *about in rows]
        return tuple(
            Counts(times_s[own], numbers[own], int(metre), str(source), float(confidence), doubt[own])
            for own, metre, source, confidence in takes
        )

    def counts(self, take: int) -> Counts:
        """A take's counts, in seconds from its first frame; `NO_COUNTS` if they are not known."""
        return self._counts[take]

    @cached_property
    def _figures(self) -> dict[int, tuple[Figure, ...]]:
        if not self._file.has_counts:
            return {}
        names = ("take", "name", "start_s", "end_s", "n_counts")
        figures: dict[int, tuple[Figure, ...]] = {}
        for take, name, start_s, end_s, n_counts in zip(
            *(self._file.read(f"figures/{column}") for column in names), strict=True
        ):
            figure = Figure(str(name), float(start_s), float(end_s), int(n_counts))
            figures[int(take)] = (*figures.get(int(take), ()), figure)
        return figures

    def figures(self, take: int) -> tuple[Figure, ...]:
        """A take's figures in order; none if they are not known."""
        return self._figures.get(take, ())

    def clip_density(self, clips: NDArray[np.integer]) -> NDArray[np.float32]:
        """Tempo-densities of clips (K,), (K, 160) at 20 fps."""
        return self._density[self._clip_body_start[clips][:, None] + np.arange(CLIP_FRAMES)]

    def clip_speed(self, clips: NDArray[np.integer]) -> NDArray[np.float32]:
        """Mean joint speeds of clips (K,) in m/s, (K, 160) at 20 fps."""
        return self._speed[self._clip_body_start[clips][:, None] + np.arange(CLIP_FRAMES)]

    @cached_property
    def _speed(self) -> NDArray[np.float32]:
        """Mean joint speed at every 20 fps frame, (B,)."""
        speeds = [mean_joint_speed_m_s(self.body_pos_m(take), NET_FPS) for take in range(len(self.takes))]
        return np.concatenate(speeds).astype(np.float32)

    def clip_start_s(self, clip: int) -> float:
        """Start of a clip in its take, in seconds."""
        return float(frames_to_seconds(self.clip_start_frame[clip], NET_FPS))

    def clip_motion_beats(self, clip: int) -> NDArray[np.float64]:
        """Motion beats inside a clip, in its frames at 20 fps."""
        beats = self.motion_beats_s(int(self.clip_take[clip])) * NET_FPS - self.clip_start_frame[clip]
        return beats[(beats >= 0) & (beats < CLIP_FRAMES)]

    def poses_m(
        self, clip: NDArray[np.integer], frames: NDArray[np.floating]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Poses (N, 21, 3) and joint velocities (N, 21, 3) in m/s, both in the root frame.

        `clip` (N,) and fractional clip frames (N,) at 20 fps; beyond the clip the take goes on, and beyond
        the take its first or last pose holds.
        """
        poses, velocities = self._root_frame_poses
        first, stop = self._take_body_rows[self.clip_take[clip]].T
        rows = np.clip(self._clip_body_start[clip] + frames, first, stop - 1)
        row = np.minimum(np.floor(rows).astype(np.int64), stop - 2)
        weight = (rows - row).astype(np.float32)[:, None, None]
        pose = poses[row] + weight * (poses[row + 1] - poses[row])
        return pose, velocities[row] + weight * (velocities[row + 1] - velocities[row])

    @cached_property
    def _take_body_rows(self) -> NDArray[np.int64]:
        """First row and one past the last of each take in the flat 20 fps arrays, (takes, 2)."""
        return np.array([take.body for take in self.takes], np.int64)

    def liveliness(
        self, clip: NDArray[np.integer], start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of each clip played from frame `start` to `stop` within a second."""
        offset = self.clip_start_frame[clip]
        return self._liveliness.ranks(self.clip_take[clip], offset + start, offset + stop)

    def count_doubt(
        self, clip: NDArray[np.integer], start: NDArray[np.floating], stop: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        """Doubt (N,), 0 … 1, of the counts half way between two frames of each clip: see `Counts`."""
        middle = np.round(0.5 * (start + stop)).astype(np.int64)
        return self._doubt[self._clip_body_start[clip] + middle]

    @cached_property
    def _doubt(self) -> NDArray[np.float32]:
        """Doubt of the counts at every 20 fps frame, (B,); 0 where a take has none."""
        doubt = np.zeros(self._file.shapes["body/pos_m"][0], np.float32)
        for index, take in enumerate(self.takes):
            counts, (start, stop) = self.counts(index), take.body
            if len(counts.doubt):
                times_s = frame_times_s(stop - start, NET_FPS)
                doubt[start:stop] = np.interp(times_s, counts.times_s, counts.doubt)
        return doubt

    @cached_property
    def clip_liveliness(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of how lively the middle 4 s of each clip are."""
        return clip_liveliness(self._liveliness, self.clip_take, self.clip_start_frame)

    @cached_property
    def clip_steps(self) -> NDArray[np.float32]:
        """Rank (N,), 0 … 1, in its genre of how many steps the middle 4 s of each clip have."""
        genres = np.array([take.credits.genre for take in self.takes])
        return clip_steps(self.body_pos_m, self.clip_take, self.clip_start_frame, genres)

    @cached_property
    def _liveliness(self) -> Liveliness:
        takes = range(len(self.takes))
        return Liveliness([self.body_pos_m(i) for i in takes], [take.credits.genre for take in self.takes])

    @cached_property
    def _root_frame_poses(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Every 20 fps frame and its velocities in its root frame, (B, 21, 3) each."""
        pos = self._body_pos_m.astype(np.float64)
        velocity = np.zeros_like(pos)
        for take in self.takes:
            start, stop = take.body
            if stop - start > 1:
                velocity[start:stop] = np.gradient(pos[start:stop], axis=0) * NET_FPS
        return to_root_frame(pos).astype(np.float32), to_root_frame(pos, velocity).astype(np.float32)
