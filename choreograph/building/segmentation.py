"""Motion words of a library: takes segmented on their counts, and the motifs found among the words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from choreograph.building.song_cache import SongCache
from choreograph.motifs.clustering import WORDS_PER_MOTIF, find_motifs
from choreograph.motifs.vocabulary import Vocabulary, make_vocabulary
from choreograph.motifs.words import Words, segment_words
from choreograph.motion.body import body_pos_m
from choreograph.progress import ProgressReport
from choreograph.repertoire.contents import MeasuredTake
from choreograph.timebase import WORD_FPS

if TYPE_CHECKING:
    from choreograph.nets.words.data import WordTake
    from choreograph.nets.words.model import WordNet

FEWEST_WORDS = 2 * WORDS_PER_MOTIF  # enough for two motifs


@dataclass(frozen=True, eq=False)
class SegmentedTake:
    """A take at `WORD_FPS` and its words, perhaps none."""

    name: str
    genre: str
    body_pos_m: NDArray[np.float32]  # (T, 21, 3)
    words: Words

    def to_word_take(self) -> WordTake:
        """The take as the word network is trained on it."""
        from choreograph.nets.words.data import WordTake

        return WordTake(self.name, self.body_pos_m, WORD_FPS, self.words.start_s, self.words.end_s)


def segment_takes(
    measured: Sequence[MeasuredTake],
    songs: SongCache | None = None,
    *,
    report: ProgressReport | None = None,
) -> tuple[list[SegmentedTake], tuple[str, ...]]:
    """Every take segmented on its counts, and notes.

    A take without counts is segmented on the beats of its music, by the default tracker, as the paper does
    (section 3.3); without music, or with fewer than two beats in its part of the song, on its motion beats.
    Counts are better: music and motion of a recorded pair need not be in step. Raises `FormatError` if a
    song cannot be read.
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
                notes.append(f"{take.name}: no beats found in its music: it is segmented on its motion beats")
        body = body_pos_m(take.motion.resampled(WORD_FPS)).astype(np.float32)
        segmented.append(
            SegmentedTake(take.name, take.credits.genre, body, segment_words(body, WORD_FPS, beats_s))
        )
        if report is not None:
            report("segmenting takes", index + 1, len(measured))
    return segmented, tuple(notes)


def make_motifs(takes: Sequence[SegmentedTake], net: WordNet, *, seed: int) -> Vocabulary:
    """Words embedded, motifs found among them, and the templates and transitions of the genres."""
    words = np.concatenate([take.words.body_pos_m for take in takes])  # (N, 13, 21, 3)
    motifs, word_motif = find_motifs(net.embed(words), seed=seed)
    return make_vocabulary(
        motifs,
        word_motif,
        np.repeat(np.arange(len(takes)), [len(take.words) for take in takes]),
        np.concatenate([take.words.start_s for take in takes]),
        np.concatenate([take.words.end_s for take in takes]),
        [take.genre for take in takes],
    )
