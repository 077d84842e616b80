"""The rollout network of a library: takes with their words and their music, and the training on them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from choreograph.audio.song import Song, load_song
from choreograph.building.segmentation import SegmentedTake
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import get_beat_tracker
from choreograph.features.word_audio import rhythm_from, word_spectra
from choreograph.motifs.vocabulary import Vocabulary
from choreograph.nets.rollout.config import RolloutConfig
from choreograph.nets.rollout.data import ROLLOUT_FPS, RolloutTake
from choreograph.nets.rollout.model import RolloutNet
from choreograph.nets.rollout.train import train_rollout
from choreograph.nets.training import TrainingContext
from choreograph.nets.words.model import WordNet
from choreograph.progress import ProgressReport
from choreograph.repertoire import NetArrays
from choreograph.repertoire.contents import MeasuredTake


def train_rollout_network(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    config: RolloutConfig,
    *,
    seed: int,
    context: TrainingContext,
    pretrained: NetArrays | None,
    report: ProgressReport | None,
) -> NetArrays:
    """Train the network that dances motifs on all takes with music, or continue from `pretrained`.

    Raises `ParameterError` if no take dances words to music for as long as a training sequence.
    """
    takes = rollout_takes(measured, segmented, vocabulary, words, report=report)
    net: RolloutNet = train_rollout(
        takes, words, config, seed=seed, context=context,
        pretrained=None if pretrained is None else pretrained.weights,
    )  # fmt: skip
    weights, stored = net.to_arrays()
    return NetArrays(stored, weights)


def rollout_takes(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    *,
    report: ProgressReport | None = None,
) -> list[RolloutTake]:
    """The takes that have music, as the network learns from them; `segmented` are the words of `measured`."""
    heard = lru_cache(maxsize=4)(_heard)  # takes of one song mostly follow one another
    takes = []
    for index, (m, of_take) in enumerate(zip(measured, segmented, strict=True)):
        take, bounds = m.take, of_take.words
        if take.song_path is None or len(bounds) == 0:
            continue
        song, beat_times_s = heard(take.song_path)
        instants = take.song_start_s + np.append(bounds.start_s, bounds.end_s[-1])
        motif = vocabulary.word_motif[vocabulary.words_of_take(index)]
        takes.append(
            RolloutTake(
                name=take.name,
                motion=take.motion.resampled(ROLLOUT_FPS),
                rhythm=rhythm_from(song, beat_times_s, take.song_start_s),
                start_s=bounds.start_s,
                end_s=bounds.end_s,
                motif=vocabulary.motifs.embeddings[motif],
                embedding=words.embed(bounds.body_pos_m),
                spectral=word_spectra(song, instants),
            )
        )
        if report is not None:
            report("hearing words", index + 1, len(measured))
    return takes


def _heard(path: Path) -> tuple[Song, np.ndarray]:
    song = load_song(path)
    return song, get_beat_tracker().beats(song, log_mel(song.samples))
