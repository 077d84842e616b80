"""The rollout network of a library: takes with their words and their music, and its training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from choreograph.building.music_in_step import music_of_take
from choreograph.building.segmentation import SegmentedTake
from choreograph.building.song_cache import SongCache
from choreograph.motifs.vocabulary import Vocabulary
from choreograph.nets.rollout.config import RolloutConfig
from choreograph.nets.rollout.data import ROLLOUT_FPS
from choreograph.nets.rollout.model import RolloutNet
from choreograph.nets.rollout.train import train_rollout
from choreograph.nets.rollout.training_data import RolloutTake
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
    songs: SongCache,
    seed: int,
    context: TrainingContext,
    pretrained: NetArrays | None,
    report: ProgressReport | None,
) -> NetArrays:
    """Train the network that dances motifs on all takes with music, starting from `pretrained` if given.

    Raises `ParameterError` if no take dances words to music for as long as a training sequence.
    """
    takes = rollout_takes(measured, segmented, vocabulary, words, songs=songs, report=report)
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
    songs: SongCache,
    report: ProgressReport | None = None,
) -> list[RolloutTake]:
    """The takes with music, as the network is trained on them.

    The music is in step with a take's counts, whether it was recorded so or not (`music_in_step`).

    `segmented` are the words of `measured`; `songs` must keep samples.
    """
    takes = []
    for index, (m, of_take) in enumerate(zip(measured, segmented, strict=True)):
        take, bounds = m.take, of_take.words
        if take.song_path is None or len(bounds) == 0:
            continue
        analysed = songs.analysed(take.song_path)
        music = music_of_take(take, analysed, np.append(bounds.start_s, bounds.end_s[-1]))
        motif = vocabulary.word_motif[vocabulary.words_of_take(index)]
        takes.append(
            RolloutTake(
                name=take.name,
                motion=take.motion.resampled(ROLLOUT_FPS),
                rhythm=music.rhythm,
                count_phase=music.count_phase,
                start_s=bounds.start_s,
                end_s=bounds.end_s,
                motif=vocabulary.motifs.embeddings[motif],
                embedding=words.embed(bounds.body_pos_m),
                spectral=music.spectral,
            )
        )
        if report is not None:
            report("analysing the music of words", index + 1, len(measured))
    return takes
