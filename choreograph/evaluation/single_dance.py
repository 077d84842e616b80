"""Evaluate one dance of any system."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import numpy as np

from choreograph.audio.song import Song
from choreograph.errors import ParameterError
from choreograph.evaluation.counted_dance import CountedDance
from choreograph.evaluation.dance_scores import dance_scores
from choreograph.evaluation.motif_scores import MotifScorer
from choreograph.evaluation.motion_scores import check_measurable
from choreograph.evaluation.realism_scores import RealDances
from choreograph.evaluation.results import SINGLE, Evaluation, ExampleDance, ExampleSong, MeasuredDance
from choreograph.evaluation.song_music import second_tracker, song_music
from choreograph.features.music_beats import DEFAULT_TRACKER
from choreograph.motion.motion import Motion
from choreograph.numerics import default_numerics
from choreograph.repertoire import Repertoire


@default_numerics()
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
    music = song_music(song, beats)
    rng = np.random.default_rng(0)
    scorer = MotifScorer(repertoire) if repertoire is not None and repertoire.has_vocabulary else None
    scores, motifs = dance_scores(CountedDance(SINGLE, song.name, motion), music, rng, scorer=scorer)
    notes: list[str] = list(song.notes)
    if repertoire is not None:
        takes = [(repertoire.motion(i)[0], take.song_name) for i, take in enumerate(repertoire.takes)]
        try:
            real = RealDances([m for m, _ in takes], [name for _, name in takes], like=motion)
            scores |= real.scores(motion, song.name, rng)
        except ParameterError as error:
            notes.append(f"no Fréchet distances: {error}")
    facts = {
        "choreograph": version("choreograph"),
        "repertoire": repertoire.path.name if repertoire else None,
        "songs": [song.name],
        "seeds": 1,
        "beats": Path(beats).name,
        "second_beats": second_tracker(beats),
        "motifs_judged_by": scorer.network if scorer else "nothing",
        "frechet_against": "the repertoire's takes" if repertoire else "nothing",
        "seen": False,
    }
    example = ExampleSong(
        song.name,
        music.beats_s,
        (ExampleDance(SINGLE, motion, None, motifs),),
        scorer.template("") if scorer else None,
    )
    measured = MeasuredDance(SINGLE, song.name, 0, scores)
    return Evaluation(facts, {SINGLE: name}, (measured,), (), tuple(notes), example)
