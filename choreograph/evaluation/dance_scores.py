"""All scores of one dance that need no other dance."""

from __future__ import annotations

import numpy as np

from choreograph.evaluation.counted_dance import CountedDance
from choreograph.evaluation.danced_counts import counted_share
from choreograph.evaluation.motif_scores import DancedMotifs, MotifScorer
from choreograph.evaluation.motion_scores import (
    beat_scores,
    count_scores,
    ending_scores,
    energy_scores,
    physical_scores,
    second_opinion_scores,
)
from choreograph.evaluation.plan_scores import plan_scores, transition_scores, transition_times_s
from choreograph.evaluation.read_counts import read_count_scores
from choreograph.evaluation.scores import Scores
from choreograph.evaluation.song_music import SongMusic


def dance_scores(
    dance: CountedDance,
    music: SongMusic,
    rng: np.random.Generator,
    *,
    genre: str = "",
    scorer: MotifScorer | None = None,
) -> tuple[Scores, DancedMotifs | None]:
    """Beats, counts, physics, energy, endings, what the plan tells; motifs and their scores with a scorer.

    `genre` is that of the song, where it is known.
    """
    motion, plan = dance.motion, dance.plan
    counts = music.counted_as(dance.counts)
    scores = beat_scores(motion, music.beats_s, rng)
    scores |= physical_scores(motion, transition_times_s(plan) if plan else ())
    scores |= second_opinion_scores(motion, dance.counts, music.second_beats_s)
    scores |= count_scores(dance.counts, counts, music.duration_s, rng)
    scores |= read_count_scores(motion, music, rng)
    scores |= ending_scores(motion, counts)
    danced_s = (plan.opening_s, plan.danced_until_s) if plan else (0.0, motion.duration_s)
    scores |= energy_scores(motion, danced_s, music.sections.bounds_s, music.section_loudness_db)
    motifs = None
    if scorer is not None:
        motifs = scorer.motifs_of(motion, music.beats_s)
        scores |= scorer.scores(motifs, genre) | scorer.section_scores(motifs, music.sections)
    if plan is not None and dance.repertoire is not None:
        scores |= plan_scores(plan, dance.repertoire, genre)
        scores |= transition_scores(plan, dance.repertoire, counts)
        scores |= Scores({"counted_share": counted_share(plan, dance.repertoire)})
    return scores, motifs
