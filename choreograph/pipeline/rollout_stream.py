"""`RolloutStream`, in which the rollout network dances to a song while it plays."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.choreography.constraints import make_constraints
from choreograph.choreography.genres import genre_note, likely_genre
from choreograph.choreography.material import counts_of_genre
from choreograph.choreography.mixer.words import WordBank
from choreograph.choreography.rollout.engine import lead_in
from choreograph.choreography.rollout.generation import asked_embeddings
from choreograph.choreography.rollout.streaming import DanceStream, FrameCondition, MotifStream, StreamedWord
from choreograph.choreography.song_analysis import analyse_song
from choreograph.core.arguments import is_whole, unexpected
from choreograph.core.counts import Counts, count_phase
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.progress import one_line
from choreograph.core.timebase import seconds_to_frames
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.library.songs import DEFAULT_BEATS
from choreograph.library.vocabulary import ALL_GENRES
from choreograph.music.rhythm import RhythmStream
from choreograph.music.song import Song, as_song
from choreograph.nets.rollout_poses import LOOKAHEAD_FRAMES, ROLLOUT_FPS
from choreograph.settings import DanceConfig

_MOST_WORDS = 10_000  # for which a motif can be requested, about an hour


@dataclass(frozen=True, eq=False)
class RolloutFrame:
    """One frame of a streamed dance. It is final: later sound does not change it.

    Examples
    --------
    >>> song = cg.load_song(cg.example_songs()["house"], duration_s=2)
    >>> frame = next(iter(cg.RolloutStream(song, genre="house")))
    >>> frame.time_s, frame.root_pos_m.shape, frame.local_quat.shape
    (0.0, (3,), (24, 4))
    """

    time_s: float
    """Time in the song, in seconds."""

    root_pos_m: Floats
    """(3,) position of the root joint, in metres."""

    local_quat: Floats
    """(J, 4) rotations on `RolloutStream.skeleton`, unit quaternions `wxyz`, with signs continuous in
    time."""

    __repr__ = one_line


class RolloutStream:
    """A dance by the rollout network, made while its song plays (Rhythm is a Dancer, section 4).

    Parameters
    ----------
    song : path, `Song` or `Counts`
        A whole song, or only its counts. With counts, the sound is given to `feed` as it plays.
    repertoire : the repertoire with the rollout network, by default the built-in one
    genre : the genre to dance, by default the nearest one to the song, or all genres if only counts are given
    seed : of the choice of motifs
    fps : frames per second
    beats : where the beats of a song come from, as in `DanceConfig`. Not allowed with counts

    Iterating gives a `RolloutFrame` every 1 / fps seconds of the song. The counts and the genre are fixed at
    the start. Everything else follows the sound: a frame depends on no sound later than `look_ahead_s` after
    it, a motif is drawn when its word begins (equation 5), and smoothing, stage and foot lock use the next
    four poses (133 ms). A whole song gives exactly the same frames as its counts with its sound in blocks.

    Unlike in `dance`, the music does not change the style of poses, since equation 4 needs the music up to
    the end of a word. Loudness is relative to the sound so far. No pose is held until the first count, and a
    motif that the network does not show is not tried again.

    Threads do not make the network faster. Set OMP_NUM_THREADS=1.

    Raises `ParameterError` for an unknown genre or invalid settings, `FormatError` for a song that cannot be
    read, `RepertoireError` without motifs or a rollout network.

    Examples
    --------
    >>> song = cg.load_song(cg.example_songs()["house"], duration_s=3)
    >>> stream = cg.RolloutStream(song, genre="house", fps=30)
    >>> len(list(stream))
    90
    >>> stream.genre
    'house'
    """

    look_ahead_s = 0.5

    @default_numerics()
    def __init__(
        self,
        song: str | Path | Song | Counts,
        repertoire: str | Path | Repertoire | None = None,
        *,
        genre: str | None = None,
        seed: int = 0,
        fps: float = 60.0,
        beats: str | Path = DEFAULT_BEATS,
    ) -> None:
        DanceConfig(seed=seed, fps=fps)  # checks them
        self._repertoire = as_repertoire(repertoire)
        networks = self._repertoire.rollout_genres
        if genre is not None:
            self._repertoire.vocabulary.genre_index(genre)
        requested = genre or ALL_GENRES
        self.fps, self.skeleton = fps, self._repertoire.skeleton
        self.notes: tuple[str, ...] = ()  # what is unusual about the song, one line each
        loaded: Song | None = None
        if isinstance(song, Counts):
            if str(beats) != DEFAULT_BEATS:  # arrays, too, are refused
                raise unexpected("no beats beside counts, which are the song's", beats)
            self.counts = song
        else:
            loaded = as_song("a song", song)
            features, self.notes = analyse_song(loaded, self._repertoire, beats=beats, genre=genre)
            self.counts = features.counts
            if genre is None:
                likely = likely_genre(features, self._repertoire, make_constraints())
                genre, self.notes = likely.genre, (*self.notes, genre_note([likely]))
        if networks and genre not in networks:
            raise unexpected(f"a genre with a rollout network, among {', '.join(networks)}", genre)
        self._net = self._repertoire.rollout_net(genre or "")
        repertoire = self._repertoire
        self._bank = WordBank(
            repertoire.vocabulary, repertoire.clip_motion.poses_at, repertoire.word_net().embed
        )
        beat_times_s = self.counts.times_s
        self.counts, metre_notes = counts_of_genre(self.counts, self._repertoire, requested)
        self.notes += metre_notes
        self._motifs = MotifStream(
            self.counts, self._repertoire, genre=genre or ALL_GENRES, seed=seed,
            phrase_counts=DanceConfig().phrase_counts,
        )  # fmt: skip
        self._rhythm = RhythmStream(beat_times_s)
        self._conditions: deque[FrameCondition] = deque()  # of the rest of a word, rhythm left out
        self._dance: DanceStream | None = None  # from the first word on
        self._final: deque[tuple[Floats, Floats]] = deque()  # frames that are made but not yet returned
        self._n_rows = self._n_poses = self._n_frames = 0  # read and predicted at 30 fps, returned at `fps`
        if loaded is not None:
            self.feed(loaded.samples)
            self.finish()

    @property
    def genre(self) -> str:
        """The genre that is danced. A new one takes effect when the next word begins."""
        return self._motifs.genre

    @genre.setter
    def genre(self, genre: str) -> None:
        self._motifs.genre = genre

    @property
    def words(self) -> tuple[StreamedWord, ...]:
        """The words that have begun, with the motifs given to the network. The last one may begin soon."""
        return tuple(self._motifs.words)

    def request(self, motif: int, n_words: int = 1) -> None:
        """Dance a motif in the next words that begin. Two words show it more reliably than one.

        A later request replaces the rest of this one. Frames up to 0.17 s ahead are already final.
        Raises `ParameterError` for an unknown motif, or for fewer words than one or more than 10,000.
        """
        if not is_whole(n_words) or not 1 <= n_words <= _MOST_WORDS:
            raise unexpected(f"a motif for 1 to {_MOST_WORDS} words", n_words)
        self._motifs.request(motif, int(n_words))

    @default_numerics()
    def feed(self, samples: NDArray[np.floating]) -> None:
        """Add sound (S,), mono at 22.05 kHz, that follows what was fed before.

        Raises `ParameterError` unless it is finite, or after `finish`.
        """
        self._rhythm.feed(samples)

    def finish(self) -> None:
        """End the song after the sound that was fed, so that its last frames can be made."""
        self._rhythm.finish()

    def __iter__(self) -> Iterator[RolloutFrame]:
        """Frames from the next one on, until the song ends or more sound is needed. Then iterate again."""
        while True:
            while not self._final and self._rhythm.has_row() and not self._has_ended():
                self._advance()
            if not self._final or self._has_ended():
                return
            root_pos_m, local_quat = self._final.popleft()
            frame = RolloutFrame(self._n_frames / self.fps, root_pos_m, local_quat)
            self._n_frames += 1
            yield frame

    def _has_ended(self) -> bool:
        n_frames = max(1, seconds_to_frames(self._rhythm.fed_s, self.fps))
        return self._rhythm.has_ended and self._n_frames >= n_frames

    @default_numerics()
    def _advance(self) -> None:
        """Read one more row of the rhythm and, from the network's look-ahead on, predict a pose."""
        rhythm = self._rhythm.next_row()
        self._n_rows += 1
        if self._n_rows <= LOOKAHEAD_FRAMES:
            return
        while not self._conditions:
            self._begin_word()
        assert self._dance is not None
        self._final.extend(self._dance.advance(self._conditions.popleft(), rhythm))
        self._n_poses += 1

    def _begin_word(self) -> None:
        word = self._motifs.begin_word()
        frames = np.arange(self._n_poses, int(np.ceil((word.end_s - 1e-6) * ROLLOUT_FPS)))
        times_s = frames / ROLLOUT_FPS
        word_s = word.end_s - word.start_s
        progress = np.clip((times_s - word.start_s) / word_s, 0.0, 1.0)
        phase = count_phase(self.counts, times_s)  # (T, 4)
        embedding = self._repertoire.vocabulary.motifs.embeddings[word.motif]
        if word.word >= 0 and self._net.config.own_embedding_share > 0:
            own = self._bank.embeddings(np.array([word.word]))[0]
            embedding = asked_embeddings(own, self._repertoire.vocabulary.motifs)
        for of_frame, of_count in zip(progress, phase, strict=True):
            self._conditions.append(FrameCondition(embedding, float(of_frame), word_s, of_count))
        if self._dance is None:
            seed_motion = lead_in(word.motif, self._repertoire, ROLLOUT_FPS)
            self._dance = DanceStream(self._net, seed_motion, self.fps)
        self._dance.begin_word(len(frames))
