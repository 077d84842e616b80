"""The motion words of a build, and their motifs, which are found or kept from another repertoire.

Takes are segmented into words on their counts (`segment_takes`). Motifs are kept where networks are
(`KeptMotifs`), so that takes that are added have the motifs of the others, and so that repertoires with the
same networks have the same motifs. A word has the motif whose embedding is nearest, as in a build that finds
motifs. If the medoid of a motif is not among the words, the word of the motif that is nearest to it takes its
place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from choreograph.core.numerics import AnyFloats, Floats, Indices
from choreograph.core.progress import ProgressReport
from choreograph.core.timebase import NET_FPS, WORD_FPS, WORD_FRAMES
from choreograph.library.notes import Note
from choreograph.library.repertoire import Repertoire
from choreograph.library.songs import SongCache
from choreograph.library.vocabulary import (
    WORDS_PER_MOTIF,
    Motifs,
    Vocabulary,
    Words,
    find_motifs,
    make_vocabulary,
    poses_at,
    segment_words,
)
from choreograph.library.writing import MeasuredTake
from choreograph.motion.body import body_pos_m, clips_to_root_frame

if TYPE_CHECKING:
    from choreograph.nets.words import WordNet

FEWEST_WORDS = 2 * WORDS_PER_MOTIF  # enough for two motifs
_SAME_S = 1e-6  # largest difference of the times of one word


@dataclass(frozen=True, eq=False)
class SegmentedTake:
    """A take at `WORD_FPS` and its words, perhaps none."""

    name: str  # of the take
    genre: str  # of the take
    body_pos_m: NDArray[np.float32]  # (T, 21, 3)
    words: Words  # in order, perhaps none


def segment_takes(
    measured: Sequence[MeasuredTake],
    songs: SongCache | None = None,
    *,
    report: ProgressReport | None = None,
) -> tuple[list[SegmentedTake], list[Note]]:
    """Every take segmented on its counts, and notes.

    A take without counts is segmented on the beats of its music, by the default tracker, as in the paper
    (section 3.3). Without music, or with fewer than two beats in its part of the song, it is segmented on its
    motion beats. Counts are better, because music and motion of a recorded pair may not be aligned. Raises
    `FormatError` if a song cannot be read.
    """
    songs = songs or SongCache()
    segmented, notes = [], []
    for index, m in enumerate(measured):
        take = m.take
        beats_s = m.motion_beats_s
        if len(take.counts) > 1:
            beats_s = take.counts.times_s
        elif take.song_path is not None:
            music_s = songs.analysed(take.song_path).beat_times_s - take.song_start_s
            if np.sum((music_s >= 0) & (music_s <= take.motion.duration_s)) >= 2:
                beats_s = music_s
            else:
                notes.append(Note("no music beats", take.name))
        body = body_pos_m(take.motion.resampled(WORD_FPS)).astype(np.float32)
        segmented.append(
            SegmentedTake(take.name, take.credits.genre, body, segment_words(body, WORD_FPS, beats_s))
        )
        if report is not None:
            report("segmenting takes", index + 1, len(measured))
    return segmented, notes


@dataclass(frozen=True, eq=False)
class WordTable:
    """The words of all takes, ordered by take and then by time, and the takes."""

    take: Indices  # (N,) index of each word's take
    start_s: Floats  # (N,) in its take
    end_s: Floats  # (N,)
    take_names: Sequence[str]
    take_genres: Sequence[str]

    @classmethod
    def of(cls, takes: Sequence[SegmentedTake]) -> WordTable:
        """The words of the takes, perhaps none."""
        return cls(
            np.repeat(np.arange(len(takes)), [len(take.words) for take in takes]),
            np.concatenate([np.zeros(0), *(take.words.start_s for take in takes)]),
            np.concatenate([np.zeros(0), *(take.words.end_s for take in takes)]),
            [take.name for take in takes],
            [take.genre for take in takes],
        )


@dataclass(frozen=True, eq=False)
class KeptMotifs:
    """The motifs of a repertoire that others have as well."""

    embeddings: NDArray[np.float32]  # (K, D)
    medoids: tuple[tuple[str, float, float], ...]  # (K,) take, start and end in seconds of each motif's word
    of_set: str  # a digest of the motifs that were found together, which repertoires that keep them share

    @classmethod
    def of(cls, repertoire: Repertoire, *, compress: bool = False) -> KeptMotifs:
        """The motifs of a repertoire, which has a vocabulary. `compress` rounds as a compressed file does."""
        vocabulary = repertoire.vocabulary
        words = vocabulary.motifs.words
        names = [repertoire.takes[take].name for take in vocabulary.word_take[words].tolist()]
        times_s = vocabulary.word_start_s[words].tolist(), vocabulary.word_end_s[words].tolist()
        embeddings = vocabulary.motifs.embeddings
        if compress:
            embeddings = embeddings.astype(np.float16).astype(np.float32)
        return cls(embeddings, tuple(zip(names, *times_s, strict=True)), repertoire.motif_set)

    def nearest(self, embeddings: AnyFloats) -> Indices:
        """The motif (N,) of each word from its embedding (N, D)."""
        none = np.zeros(len(self.embeddings), np.int64)
        return Motifs(self.embeddings, none, none).nearest(embeddings)

    def distances_m(self, embeddings: AnyFloats) -> Floats:
        """The distance (N,) of each word from its motif, from its embedding (N, D), in metres."""
        return self._apart_m(embeddings, self.nearest(embeddings))

    def _apart_m(self, embeddings: AnyFloats, motif: Indices) -> Floats:
        """The distance (N,) of words from motifs (N,)."""
        apart = np.asarray(embeddings, np.float64) - self.embeddings[motif]
        distances_m: Floats = np.sqrt(np.square(apart).sum(axis=1))
        return distances_m

    def vocabulary(
        self, words: WordTable, word_motif: Indices, embed: Callable[[Indices], NDArray[np.float32]]
    ) -> Vocabulary:
        """The vocabulary of these words, of which `word_motif` (N,) are the motifs.

        Motifs without a word are left out. The others keep their order. `embed` returns the embeddings (M, D)
        of words (M,). It is called where a motif has words, but not its medoid.
        """
        counts = np.bincount(word_motif, minlength=len(self.embeddings))
        danced = np.flatnonzero(counts)
        number = np.cumsum(counts > 0) - 1
        medoids = self._medoids_among(words, word_motif)  # -1 where there is none
        for motif in danced[medoids[danced] < 0].tolist():
            own = np.flatnonzero(word_motif == motif)
            medoids[motif] = own[np.argmin(self._apart_m(embed(own), np.full(len(own), motif)))]
        motifs = Motifs(self.embeddings[danced], medoids[danced], counts[danced])
        return make_vocabulary(
            motifs, number[word_motif], words.take, words.start_s, words.end_s, words.take_genres
        )

    def _medoids_among(self, words: WordTable, word_motif: Indices) -> Indices:
        """The medoid of each motif among the words (K,), or -1 if they do not have it."""
        takes = {name: take for take, name in enumerate(words.take_names)}
        found = np.full(len(self.medoids), -1, np.int64)
        for motif, (name, start_s, end_s) in enumerate(self.medoids):
            if name not in takes:
                continue
            own = np.arange(*np.searchsorted(words.take, [takes[name], takes[name] + 1]))
            apart_s = np.maximum(np.abs(words.start_s[own] - start_s), np.abs(words.end_s[own] - end_s))
            same = own[(apart_s <= _SAME_S) & (word_motif[own] == motif)]
            found[motif] = same[0] if len(same) else -1
        return found


def words_of_body(body_pos_m: AnyFloats, start_s: Floats, end_s: Floats) -> Floats:
    """Words (N, 13, 21, 3) of a take, from its body positions (T, 21, 3) at 20 fps, in their root frames.

    They are coarser than those of `segment_words`, and a repertoire has all that is needed.
    """
    share = np.linspace(0.0, 1.0, WORD_FRAMES)
    times_s = start_s[:, None] + (end_s - start_s)[:, None] * share  # (N, 13)
    return clips_to_root_frame(poses_at(body_pos_m, NET_FPS, times_s))


def embedder_of(
    words: WordTable,
    body_of: Callable[[int], AnyFloats],
    embed: Callable[[AnyFloats], NDArray[np.float32]],
) -> Callable[[Indices], NDArray[np.float32]]:
    """Embeddings of words by their numbers, take by take, from the body positions of takes at 20 fps."""

    def of(numbers: Indices) -> NDArray[np.float32]:
        found = [
            embed(words_of_body(body_of(take), words.start_s[own], words.end_s[own]))
            for take in np.unique(words.take[numbers]).tolist()
            for own in [numbers[words.take[numbers] == take]]
        ]
        return np.concatenate(found)

    return of


def make_motifs(takes: Sequence[SegmentedTake], net: WordNet, *, seed: int) -> Vocabulary:
    """Embed the words and find motifs among them, and the templates and transitions of the genres."""
    words = np.concatenate([take.words.body_pos_m for take in takes])  # (N, 13, 21, 3)
    motifs, word_motif = find_motifs(net.embed(words), seed=seed)
    table = WordTable.of(takes)
    return make_vocabulary(motifs, word_motif, table.take, table.start_s, table.end_s, table.take_genres)


def keep_motifs(
    takes: Sequence[SegmentedTake], kept: KeptMotifs, net: WordNet, bodies: Sequence[AnyFloats]
) -> Vocabulary:
    """Embed the words, give each the nearest of the kept motifs, and make templates and transitions.

    `bodies` are the positions (T, 21, 3) of the takes at 20 fps.
    """
    words = WordTable.of(takes)
    motif = np.concatenate([kept.nearest(net.embed(take.words.body_pos_m)) for take in takes])
    return kept.vocabulary(words, motif, embedder_of(words, bodies.__getitem__, net.embed))
