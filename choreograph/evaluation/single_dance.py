"""Evaluate one dance of any system."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import numpy as np

from choreograph.audio.song import Song
from choreograph.errors import ParameterError
from choreograph.evaluation.motif_scores import MotifScorer
from choreograph.evaluation.motion_scores import beat_scores, check_measurable, physical_scores
from choreograph.evaluation.realism_scores import RealDances
from choreograph.evaluation.results import SINGLE, Evaluation, ExampleDance, ExampleSong, MeasuredDance
from choreograph.evaluation.songs import beats_of
from choreograph.features.music_beats import DEFAULT_TRACKER
from choreograph.features.sections import song_sections
from choreograph.motion.motion import Motion
from choreograph.repertoire import Repertoire


def evaluate_dance(
    motion: Motion,
    song: Song,
    *,
    name: str = "dance",
    beats: str | Path = DEFAULT_TRACKER,
    repertoire: Repertoire | None = None,
) -> Evaluation:
    """Measure one dance of any system to a song; with a repertoire also against its takes and motifs.

    Dance and song start together, and the longer one is cut. Raises `ParameterError` if the rig's joint names
    are unknown or the beats cannot be used.
    """
    check_measurable(motion, name)
    length_s = min(motion.duration_s, song.duration_s)
    motion = motion.sliced(0, max(1, round(length_s * motion.fps)))
    beats_s = beats_of(song, beats)
    rng = np.random.default_rng(0)
    scores = beat_scores(motion, beats_s, rng) | physical_scores(motion)
    motifs = template = None
    notes: list[str] = list(song.notes)
    if repertoire is not None:
        takes = [(repertoire.motion(i)[0], take.song_name) for i, take in enumerate(repertoire.takes)]
        try:
            real = RealDances([m for m, _ in takes], [name for _, name in takes], like=motion)
            scores |= real.scores(motion, song.name, rng)
        except ParameterError as error:
            notes.append(f"no Fréchet distances: {error}")
        if repertoire.has_vocabulary:
            scorer = MotifScorer(repertoire)
            motifs = scorer.motifs_of(motion, beats_s)
            scores |= scorer.scores(motifs, "")
            scores |= scorer.section_scores(motifs, song_sections(song.samples, beats_s))
            template = scorer.template("")
    facts = {
        "choreograph": version("choreograph"),
        "repertoire": repertoire.path.name if repertoire else None,
        "songs": [song.name],
        "seeds": 1,
        "beats": Path(beats).name,
        "frechet_against": "the repertoire's takes" if repertoire else "nothing",
        "seen": False,
    }
    example = ExampleSong(song.name, beats_s, (ExampleDance(SINGLE, motion, None, motifs),), template)
    measured = MeasuredDance(SINGLE, song.name, 0, scores)
    return Evaluation(facts, {SINGLE: name}, (measured,), (), tuple(notes), example)
