"""The rollout network of a library: takes with their words and their music, and its training.

The network may also learn from dances that an engine makes from the takes to their songs. These are on the
count by construction, so that the network keeps counts and bars better. The engine is passed as a `Teacher`,
since this package does not import engines. Training imports torch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from choreograph.core.files import sha256_of
from choreograph.core.progress import ProgressReport
from choreograph.library.building.takes import SegmentedTake, measure_take, segment_takes
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import Contents, NetArrays
from choreograph.library.songs import SongCache, music_of_take
from choreograph.library.vocabulary import Vocabulary
from choreograph.library.writing import MeasuredTake, write_repertoire
from choreograph.motion.motion import Take

if TYPE_CHECKING:
    from choreograph.nets.configs import RolloutConfig
    from choreograph.nets.rollout_training import RolloutTake
    from choreograph.nets.training import TrainingContext
    from choreograph.nets.words import WordNet

# Dances of a repertoire to the songs of takes, as takes with counts. The folder keeps finished work for a
# resumed build.
Teacher = Callable[[Repertoire, Sequence[Take], Path], list[Take]]


def train_rollout_network(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    config: RolloutConfig,
    *,
    dances: Sequence[Take] = (),
    songs: SongCache,
    seed: int,
    context: TrainingContext,
    pretrained: NetArrays | None,
    report: ProgressReport | None,
) -> dict[str, NetArrays]:
    """Train the rollout network on all takes with music and on `dances` of them. Returns it by its name.

    With `RolloutConfig.by_genre` there is one for each genre, as in the paper (section 5). Training starts
    from `pretrained` if given. Raises `ParameterError` if no take, or no take of a genre, has words with
    music for as long as a training sequence.
    """
    from choreograph.nets.rollout_training import train_rollouts

    takes = rollout_takes(measured, segmented, vocabulary, words, songs=songs, report=report)
    if dances:
        danced = [measure_take(take) for take in dances]
        danced_words, of_dances = words_of_dances(danced, vocabulary, words, songs)
        takes += rollout_takes(danced, danced_words, of_dances, words, songs=songs, report=report)
    weights = None if pretrained is None else pretrained.weights
    nets = {}
    trained = train_rollouts(takes, words, config, seed=seed, context=context, pretrained=weights)
    for index, net in enumerate(trained):
        arrays, stored = net.to_arrays()
        nets[f"rollout_{index}" if config.by_genre else "rollout"] = NetArrays(stored, arrays)
    return nets


def taught_dances(contents: Contents, takes: Sequence[Take], teacher: Teacher, work: Path) -> list[Take]:
    """The teacher's dances to the songs of `takes` with the repertoire of `contents`.

    That repertoire and the finished dances are stored in `work`, where a resumed build with the same contents
    finds them.
    """
    draft = work / "untaught.h5"
    work.mkdir(parents=True, exist_ok=True)
    write_repertoire(draft, contents)
    return teacher(Repertoire.open(draft), takes, work / f"graph-dances-{sha256_of(draft)[:12]}")


def rollout_takes(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    *,
    songs: SongCache,
    report: ProgressReport | None = None,
) -> list[RolloutTake]:
    """The takes with music, as training data of the network.

    The rhythm of the music is aligned with the counts of the take, even if the recording is not. `segmented`
    are the words of `measured`. `songs` must keep samples.
    """
    from choreograph.nets.rollout_poses import ROLLOUT_FPS
    from choreograph.nets.rollout_training import RolloutTake

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
                genre=take.credits.genre,
            )
        )
        if report is not None:
            report("analysing the music of words", index + 1, len(measured))
    return takes


def words_of_dances(
    dances: Sequence[MeasuredTake], vocabulary: Vocabulary, words: WordNet, songs: SongCache
) -> tuple[list[SegmentedTake], Vocabulary]:
    """The words of dances, and the vocabulary with these words instead of those of the takes."""
    segmented, _ = segment_takes(dances, songs)
    motif = vocabulary.motifs.nearest(words.embed(np.concatenate([t.words.body_pos_m for t in segmented])))
    of_dances = replace(
        vocabulary,
        word_take=np.repeat(np.arange(len(segmented)), [len(take.words) for take in segmented]),
        word_start_s=np.concatenate([take.words.start_s for take in segmented]),
        word_end_s=np.concatenate([take.words.end_s for take in segmented]),
        word_motif=motif,
    )
    return segmented, of_dances
