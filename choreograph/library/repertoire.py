"""`Repertoire`, an opened repertoire file with its takes, clips, motions and poses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.arguments import as_index, as_number, check_function, check_kind, check_text, unexpected
from choreograph.core.cache import digest
from choreograph.core.counts import UNKNOWN, Counts, Figure, bar_positions
from choreograph.core.errors import ParameterError, RepertoireError
from choreograph.core.files import as_path
from choreograph.core.numerics import Floats, Indices
from choreograph.core.progress import counted, cut_line, html_table
from choreograph.core.timebase import CLIP_FRAMES, NET_FPS, frames_to_seconds
from choreograph.library.builtin import STARTER_PATH
from choreograph.library.catalogue import AnyFile, RepertoireShards, motif_set, open_files
from choreograph.library.clips import ClipMotion, TakeCounts, TakeInfo, TakeTempi, figures_from, takes_from
from choreograph.library.derived import stored_motion, stored_skeleton
from choreograph.library.notes import Note, notes_from
from choreograph.library.schema import NetArrays, check_clips, rollout_names
from choreograph.library.store import RepertoireFile
from choreograph.library.vocabulary import SpanMotifLookup, Vocabulary, vocabulary_from
from choreograph.motion.motion import Motion
from choreograph.motion.skeleton import Skeleton
from choreograph.music.count_grids import accent_shifts_s

if TYPE_CHECKING:
    from choreograph.nets.inference import WordEmbedder
    from choreograph.nets.rollout_poses import PosePredictor

_HTML_ROWS = 50


class Repertoire:
    """An opened repertoire file: its takes, clips, networks and motifs.

    `Repertoire.open` opens a file. Arrays are read when they are first used.

    Examples
    --------
    >>> repertoire = cg.Repertoire.open(cg.starter_repertoire().path)
    >>> take = repertoire.takes[0]
    >>> take.name, take.credits.genre, repertoire.counts(0).metre
    ('cha-cha-01', 'cha-cha', 4)
    >>> motion, first_s = repertoire.motion(0, start_s=2, stop_s=4)
    >>> motion.root_pos_m.shape, first_s
    ((52, 3), 2.0)
    """

    def __init__(self, file: AnyFile) -> None:
        if not isinstance(file, RepertoireShards):
            check_kind("the file of a repertoire", file, RepertoireFile, "`Repertoire.open` opens a path")
        self._file = file

    @classmethod
    def open(cls, path: str | Path | Sequence[str | Path]) -> Repertoire:
        """Open a repertoire file, or several as one: those of a folder, or of a list of files and folders.

        Raises `RepertoireError` if one is missing, damaged, of another version, or does not fit the others,
        `ParameterError` if `path` is not a path.
        """
        given = path if isinstance(path, list | tuple) else [path]
        return cls(open_files([as_path("a repertoire file", one) for one in given]))

    def verify(self, report: Callable[[int, int], None] | None = None) -> None:
        """Read the whole file and compare every block with its checksum.

        `report` is called with the work done so far and all the work. Raises `RepertoireError` if a block or
        a network is damaged, or if arrays contradict each other.
        """
        check_function("report", report)
        self._file.verify(report)
        _ = self.skeleton, self.notes, self.clip_take, self._counts, self._figures
        if self.has_vocabulary:
            _ = self.vocabulary, self.word_net()

    def __repr__(self) -> str:
        return cut_line(f"<Repertoire {self._summary()}>")

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
            f"{self.path.name}: {counted(len(self.takes), 'take')}, {minutes:.1f} min, "
            f"{counted(self.n_clips, 'clip')}, genres: {genres}"
        )

    @property
    def path(self) -> Path:
        """The file of this repertoire, or what several files are called together, such as their folder."""
        return self._file.path

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files of this repertoire."""
        return self._file.paths

    @property
    def density(self) -> str:
        """The kind of the clips' tempo-densities: "analytic" or "learned"."""
        return self._file.density

    @property
    def provenance(self) -> dict[str, Any]:
        """How the file was made: program version, preset, seed, and training songs."""
        return self._file.provenance

    @property
    def source_checksums(self) -> frozenset[str]:
        """Hexadecimal SHA-256 of every motion and music file from which the repertoire was made."""
        return frozenset(str(digest) for digest in self._file.read("sources/sha256"))

    @property
    def net_names(self) -> tuple[str, ...]:
        """Names of the networks in the file."""
        return self._file.net_names

    def net(self, name: str) -> NetArrays:
        """A network's config and weights. Raises `RepertoireError` if there is none with that name."""
        check_text("the name of a network", name)
        return self._file.read_net(name)

    @property
    def has_vocabulary(self) -> bool:
        """Whether the file has motion words and motifs."""
        return "motifs" in self._file.parts

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """Motion words, motifs and the genres' signatures. Raises `RepertoireError` if there are none."""
        self._expect_vocabulary()
        with self._damage_named():
            return vocabulary_from(self._file.read, len(self.takes))

    @property
    def motif_set(self) -> str:
        """A digest of the motifs that were found together, as `shards.motif_set`."""
        return motif_set(self._file)

    def word_net(self) -> WordEmbedder:
        """The network that embedded the motion words. Raises `RepertoireError` if there is none."""
        return self._word_net

    @cached_property
    def _word_net(self) -> WordEmbedder:
        from choreograph.nets.inference import WordEmbedder

        self._expect_vocabulary()
        net = self.net("words")
        with self._damage_named():
            return WordEmbedder.from_arrays(net.weights, net.config)

    @cached_property
    def span_motifs(self) -> SpanMotifLookup:
        """The motifs of spans of takes. Raises `RepertoireError` without motifs."""
        return SpanMotifLookup(self.clip_motion.poses_at, self.word_net().embed, self.vocabulary.motifs)

    @cached_property
    def _rollout_nets(self) -> dict[str, NetArrays]:
        """The one rollout network by its name, or those of the genres by these."""
        nets = {name: self.net(name) for name in rollout_names(self.net_names)}
        if not nets:
            raise RepertoireError(
                f"{self.path}: expected a rollout network, got a repertoire without one: build it again with "
                "`choreograph build-db --rollout`"
            )
        if "rollout" in nets:
            return {"rollout": nets["rollout"]}
        return {str(net.config.get("genre", "")): net for net in nets.values()}

    @property
    def rollout_genres(self) -> tuple[str, ...]:
        """The genres that have a rollout network of their own, or none where one network dances all of them.

        Raises `RepertoireError` if there is no rollout network.
        """
        return () if "rollout" in self.net_names else tuple(self._rollout_nets)

    def rollout_net(self, genre: str = "") -> PosePredictor:
        """The network that generates motion from motifs, of `genre` if each genre has its own.

        Raises `RepertoireError` if there is none.
        """
        from choreograph.nets.rollout_poses import PosePredictor

        check_text("a genre", genre)
        nets = self._rollout_nets
        net = nets.get(genre if self.rollout_genres else "rollout")
        if net is None:
            raise RepertoireError(
                f"{self.path}: expected a genre among {', '.join(nets)} for the rollout, got {genre!r}"
            )
        with self._damage_named():
            return PosePredictor.from_arrays(net.weights, net.config)

    def _expect_vocabulary(self) -> None:
        if not self.has_vocabulary:
            raise RepertoireError(
                f"{self.path}: expected motion words and motifs, got a repertoire without them: it was built "
                "without words or from too few of them, build it again with `choreograph build-db`"
            )

    @cached_property
    def skeleton(self) -> Skeleton:
        """The skeleton of all motion in the file."""
        with self._damage_named():
            return stored_skeleton(self._file.read, has_roles="roles" in self._file.parts)

    @cached_property
    def takes(self) -> tuple[TakeInfo, ...]:
        """All takes in the order of the file. Raises `RepertoireError` if there is none or rows overlap."""
        with self._damage_named():
            return takes_from(self._file)

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What was unusual in the build of the file. Raises `RepertoireError` if a note is not valid."""
        if "notes" not in self._file.parts:
            return ()
        with self._damage_named():
            return notes_from(self._file.read)

    @property
    def n_clips(self) -> int:
        """Number of clips N."""
        return self._file.shapes["clips/take"][0]

    @property
    def clip_take(self) -> NDArray[np.int32]:
        """Index of each clip's take, (N,)."""
        return self._clips[0]

    @property
    def clip_start_frame(self) -> NDArray[np.int64]:
        """First frame of each clip in its take, 20 fps, (N,)."""
        return self._clips[1]

    @cached_property
    def _clips(self) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
        """Take and first frame of each clip, (N,)."""
        clips = self._file.read("clips/take"), self._file.read("clips/start_frame")
        with self._damage_named():
            check_clips(*clips, np.diff([take.body for take in self.takes], axis=1)[:, 0])
        return clips

    @cached_property
    def clip_style(self) -> NDArray[np.float32]:
        """Style vectors of the clips' middle 4 s, (N, 32)."""
        return self._file.read("clips/style")

    @cached_property
    def clip_beat_count(self) -> NDArray[np.float32]:
        """Motion beats in the clips' middle 4 s, (N,)."""
        return self._file.read("clips/beat_count")

    @contextmanager
    def _damage_named(self) -> Iterator[None]:
        """Raise errors in the content of arrays as a `RepertoireError` that names the file."""
        try:
            yield
        except (RepertoireError, ParameterError) as error:
            if str(error).startswith(str(self.path)):
                raise
            raise RepertoireError(f"{self.path}: {error}: a damaged file") from error

    @property
    def selection_beat_weight(self) -> float:
        """Weight of a difference of one motion beat in selection, relative to the distance of styles."""
        return float(self.provenance.get("selection_beat_weight", 0.0))

    def take_index(self, name: str) -> int:
        """Index of a take by name. Raises `RepertoireError` if there is none."""
        check_text("the name of a take", name)
        names = [take.name for take in self.takes]
        if name not in names:
            raise RepertoireError(f"{self.path}: expected one of {len(names)} takes, got {name!r}")
        return names.index(name)

    def motion(self, take: int, start_s: float = 0.0, stop_s: float | None = None) -> tuple[Motion, float]:
        """A take's stored motion around [start_s, stop_s], and the time of its first frame.

        Raises `ParameterError` for an index that does not exist, as all methods with the index of a take or a
        clip do, and for times that are not numbers.
        """
        info = self.takes[self._take(take)]
        start_s = as_number("start_s in seconds", start_s)
        stop_s = None if stop_s is None else as_number("stop_s in seconds or None", stop_s)
        n_frames = info.motion[1] - info.motion[0]
        first = int(np.clip(np.floor(start_s * info.fps), 0, n_frames - 1))
        stop = n_frames if stop_s is None else np.ceil(stop_s * info.fps) + 2
        last = int(np.clip(stop, first + 1, n_frames))
        rows = info.motion[0] + first, info.motion[0] + last
        root = self._file.read_rows("motion/root_pos_m", *rows)
        quat = self._file.read_rows("motion/local_quat", *rows)
        return stored_motion(self.skeleton, root, quat, info.fps), first / info.fps

    def _take(self, take: int) -> int:
        return as_index("a take", take, len(self.takes))

    def _clip(self, clip: int) -> int:
        return as_index("a clip", clip, self.n_clips)

    def body_pos_m(self, take: int) -> NDArray[np.float32]:
        """A take's 21 joints at 20 fps, (T, 21, 3)."""
        return self.clip_motion.body_pos_m(self._take(take))

    def motion_beats_s(self, take: int) -> NDArray[np.float64]:
        """A take's motion beats in seconds from its first frame, (Q,)."""
        start, stop = self.takes[self._take(take)].beats
        return self._beats_s[start:stop]

    @cached_property
    def _beats_s(self) -> NDArray[np.float64]:
        return self._file.read("beats/motion_s")

    @cached_property
    def _counts(self) -> TakeCounts:
        with self._damage_named():
            refused = frozenset(note.subject for note in self.notes if note.kind == "refused counts")
            return TakeCounts(self._file, [take.name for take in self.takes], refused)

    @property
    def take_tempi(self) -> TakeTempi:
        """The metre, the tempo and the number of counts of each take."""
        return self._counts.tempi

    @cached_property
    def analysis_digest(self) -> bytes:
        """A digest of all that the analysis of a song depends on: networks, and genres and tempi of takes."""
        nets = {name: self.net(name) for name in self.net_names if name in ("style", "music_density")}
        genres = [take.credits.genre for take in self.takes]
        clips = self.clip_style, self.clip_take, self.vocabulary.genres if self.has_vocabulary else ()
        parts = [[net.config, net.weights] for net in nets.values()]
        return digest(list(nets), parts, self.density, self.path.name, genres, self.take_tempi, *clips)

    def counts(self, take: int) -> Counts:
        """A take's counts, in seconds from its first frame, or `NO_COUNTS` if they are not known.

        Where the file has none, they are estimated from the motion, if they are more likely right than wrong.
        """
        with self._damage_named():
            return self._counts.of_take(self._take(take))

    @cached_property
    def _figures(self) -> dict[int, tuple[Figure, ...]]:
        return figures_from(self._file.read)

    def figures(self, take: int) -> tuple[Figure, ...]:
        """A take's figures in order, or none if they are not known."""
        return self._figures.get(self._take(take), ())

    @cached_property
    def word_positions(self) -> Indices:
        """Position in the bar (W,) at which every word begins, as in `bar_positions`."""
        v = self.vocabulary
        positions = np.full(len(v.word_take), UNKNOWN, np.int64)
        for take in np.unique(v.word_take):
            words = v.words_of_take(int(take))
            positions[words] = bar_positions(v.word_start_s[words], self.counts(int(take)))
        return positions

    @cached_property
    def accented_bounds_s(self) -> Floats:
        """The part (W, 2) of its take that each word dances, so that its accents lie on the beat (ours).

        Words are cut on counts. If a take has its accents near the counts, words begin and end on the accents
        instead, as in the time maps of the graph engine (`music.count_grids`).
        """
        v = self.vocabulary
        bounds_s = np.stack([v.word_start_s, v.word_end_s], axis=1).astype(np.float64)
        for take in np.unique(v.word_take):
            counts_s = self.counts(int(take)).times_s
            if len(counts_s) >= 2:
                words = v.words_of_take(int(take))
                shifts_s = accent_shifts_s(self.motion_beats_s(int(take)), counts_s)
                bounds_s[words] += np.interp(bounds_s[words], counts_s, shifts_s, left=0.0, right=0.0)
        return bounds_s

    def clip_start_s(self, clip: int) -> float:
        """Start of a clip in its take, in seconds."""
        return float(frames_to_seconds(self.clip_start_frame[self._clip(clip)], NET_FPS))

    def clip_motion_beats(self, clip: int) -> NDArray[np.float64]:
        """Motion beats inside a clip, in its frames at 20 fps."""
        clip = self._clip(clip)
        beats = self.motion_beats_s(int(self.clip_take[clip])) * NET_FPS - self.clip_start_frame[clip]
        result: NDArray[np.float64] = beats[(beats >= 0) & (beats < CLIP_FRAMES)]
        return result

    def forget_rows(self) -> None:
        """Free the memory of the rows of takes and clips, which are read again where they are used."""
        self._file.forget_rows()
        vars(self).pop("clip_motion", None)

    @cached_property
    def clip_motion(self) -> ClipMotion:
        """Features of the clips by frame."""
        return ClipMotion(self._file, self.takes, self.counts, self.clip_take, self.clip_start_frame)


def starter_repertoire() -> Repertoire:
    """Open the built-in repertoire: synthetic takes in fifteen genres with their networks and motifs.

    Raises
    ------
    RepertoireError   if the installation lacks the file

    Examples
    --------
    >>> repertoire = cg.starter_repertoire()
    >>> repertoire
    <Repertoire starter.h5: 345 takes, 94.2 min, 3,071 clips, genres: Charleston, ...>
    """
    return Repertoire(RepertoireFile(STARTER_PATH))


def as_repertoire(repertoire: object) -> Repertoire:
    """An opened repertoire, for None or no paths the built-in one.

    Raises `ParameterError` unless given one, a path, or a list of paths.
    """
    if repertoire is None or (isinstance(repertoire, tuple) and not repertoire):
        return starter_repertoire()
    if isinstance(repertoire, Repertoire):
        return repertoire
    if not isinstance(repertoire, str | Path | list | tuple):
        raise unexpected("a repertoire or its path", repertoire)
    return Repertoire.open(repertoire)
