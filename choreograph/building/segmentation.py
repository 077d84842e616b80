"""The motion words of a library: takes cut on their beats, embedded, and their motifs found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import load_song
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import get_beat_tracker
from choreograph.motifs.clustering import WORDS_A_MOTIF, find_motifs
from choreograph.motifs.vocabulary import Vocabulary, make_vocabulary
from choreograph.motifs.words import Words, segment_words
from choreograph.motion.body import body_pos_m
from choreograph.progress import ProgressReport
from choreograph.repertoire.contents import MeasuredTake

if TYPE_CHECKING:
    from choreograph.nets.words.data import WordTake
    from choreograph.nets.words.model import WordNet

WORD_FPS = 30.0  # of the positions that words are cut from
FEWEST_WORDS = 2 * WORDS_A_MOTIF  # for two motifs: less is no vocabulary


@dataclass(frozen=True, eq=False)
class SegmentedTake:
    """A take at `WORD_FPS` and its words, perhaps none."""

    name: str
    genre: str
    body_pos_m: NDArray[np.float32]  # (T, 21, 3)
    words: Words

    def to_learn_from(self) -> WordTake:
        """The take as `nets.words.data` wants it."""
        from choreograph.nets.words.data import WordTake

        return WordTake(self.name, self.body_pos_m, WORD_FPS, self.words.start_s, self.words.end_s)


def segment_takes(
    measured: Sequence[MeasuredTake], *, report: ProgressReport | None = None
) -> tuple[list[SegmentedTake], tuple[str, ...]]:
    """Every take cut on the beats of its music, by the default tracker, and notes.

    A take without music, or in whose part of the song fewer than two beats are heard, is cut on its motion
    beats. A song that several takes dance to is heard once. Raises `FormatError` if a song cannot be read.
    """
    heard: dict[Path, NDArray[np.float64]] = {}  # beats in the song, seconds
    segmented, notes = [], []
    for index, m in enumerate(measured):
        take = m.take
        beats_s = m.motion_beats_s
        if take.song_path is not None:
            if take.song_path not in heard:
                song = load_song(take.song_path)
                heard[take.song_path] = get_beat_tracker().beats(song, log_mel(song.samples))
            music_s = heard[take.song_path] - take.song_start_s
            if np.sum((music_s >= 0) & (music_s <= take.motion.duration_s)) >= 2:
                beats_s = music_s
            else:
                notes.append(f"{take.name}: no beat heard in its music: its words are cut on motion beats")
        body = body_pos_m(take.motion.resampled(WORD_FPS)).astype(np.float32)
        segmented.append(
            SegmentedTake(take.name, take.credits.genre, body, segment_words(body, WORD_FPS, beats_s))
        )
        if report is not None:
            report("cutting words", index + 1, len(measured))
    return segmented, tuple(notes)


def make_motifs(takes: Sequence[SegmentedTake], net: WordNet, *, seed: int) -> Vocabulary:
    """Words embedded, motifs found among them, and the genres' templates and transitions."""
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
