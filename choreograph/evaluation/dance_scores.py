"""All scores of one dance, also of one that any system made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.core.arguments import as_list, check_kind, check_text
from choreograph.core.counts import NO_COUNTS, Counts
from choreograph.core.errors import ParameterError
from choreograph.core.files import as_path
from choreograph.core.numerics import default_numerics
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.plan_scores import (
    CountedDance,
    DancedMotifs,
    MotifScorer,
    counted_share,
    plan_scores,
    tempo_scores,
    transition_scores,
    transition_times_s,
)
from choreograph.evaluation.results import (
    EXPERT,
    REAL,
    SINGLE,
    TAKES,
    Evaluation,
    ExampleDance,
    ExampleSong,
    MeasuredDance,
)
from choreograph.evaluation.scores import (
    RealDances,
    Scores,
    beat_scores,
    check_measurable,
    count_scores,
    ending_scores,
    energy_scores,
    front_scores,
    physical_scores,
    second_opinion_scores,
)
from choreograph.evaluation.songs import SongMusic, second_tracker, song_music
from choreograph.library.builtin import MotionCounter, load_motion_counter, pretrained_set
from choreograph.library.repertoire import Repertoire, as_repertoire
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.music.song import Song, as_song

# The counts of a dance as a network estimates them from its motion alone.
#
# The counts of a dance made of takes are known (`danced_counts`). Those of a generated dance are not. The
# network that estimates them has no music as input, so that the estimate does not depend on the beats it is
# compared with. It makes errors in the dances of experts, too, so compare with the share of real dances.


_NAMES = {"counts_within": "counts_read_within", "downbeat_share": "downbeat_share_read"}
_SHORTEST_S = 4.0  # of a motion whose counts are estimated


def read_counts(motion: Motion) -> Counts:
    """Counts of a motion, estimated by the shipped network trained on most dances. None below 4 s."""
    if motion.duration_s < _SHORTEST_S:
        return NO_COUNTS
    return _reader()(body_pos_m(motion.resampled(NET_FPS)))


def read_count_scores(motion: Motion, music: SongMusic, rng: np.random.Generator) -> Scores:
    """Counts estimated from a motion against the beats of the song, at the metrical level of the motion."""
    read = read_counts(motion)
    scores = count_scores(read, music.counted_as(read), music.duration_s, rng)
    return Scores(
        {new: scores.values[name] for name, new in _NAMES.items() if name in scores.values},
        {new: scores.chance[name] for name, new in _NAMES.items() if name in scores.chance},
    )


@cache
def _reader() -> MotionCounter:
    read = load_motion_counter(pretrained_set("research"))
    assert read is not None, "the set 'research' has a network that counts motion"
    return read


# All scores of one dance that need no other dance.


def dance_scores(
    dance: CountedDance,
    music: SongMusic,
    rng: np.random.Generator,
    *,
    genre: str = "",
    scorer: MotifScorer | None = None,
) -> tuple[Scores, DancedMotifs | None]:
    """All scores of a dance, with those of its plan if it has one, and of its motifs with a scorer.

    `genre` is that of the song, if it is known.
    """
    motion, plan = dance.motion, dance.plan
    counts = music.counted_as(dance.counts)
    scores = beat_scores(motion, music.beats_s, rng)
    scores |= physical_scores(motion, transition_times_s(plan) if plan else ())
    scores |= second_opinion_scores(motion, dance.counts, music.second_beats_s)
    scores |= count_scores(dance.counts, counts, music.duration_s, rng)
    scores |= read_count_scores(motion, music, rng)
    scores |= ending_scores(motion, counts)
    scores |= front_scores(motion, front_known=dance.variant not in (EXPERT, REAL))
    danced_s = (plan.opening_s, plan.danced_until_s) if plan else (0.0, motion.duration_s)
    scores |= energy_scores(motion, danced_s, music.sections.bounds_s, music.section_loudness_db)
    motifs = None
    if scorer is not None:
        motifs = scorer.motifs_of(motion, music.beats_s)
        scores |= scorer.scores(motifs, genre) | scorer.section_scores(motifs, music.sections)
    if plan is not None and dance.repertoire is not None:
        scores |= plan_scores(plan, dance.repertoire, genre)
        scores |= tempo_scores(plan, dance.repertoire, dance.counts)
        scores |= transition_scores(plan, dance.repertoire, counts)
        scores |= Scores({"counted_share": counted_share(plan, dance.repertoire)})
    return scores, motifs


# Evaluate one dance of any system.


@default_numerics()
def evaluate(
    motion: Motion | Mapping[str, Motion | Sequence[Motion]],
    song: Song | str | Path | Sequence[Song | str | Path],
    *,
    name: str = "dance",
    beats: str | Path = DEFAULT_TRACKER,
    repertoire: Repertoire | str | Path | None = None,
) -> Evaluation:
    """Measure dances of any system to a song, or to several.

    Dance and song start together, and the longer one is cut. With several songs, the tables show the mean and
    the standard deviation over the songs. `choreograph evaluate DANCE SONG` prints the
    result, and `evaluation.results.to_json` returns it as text.

    Parameters
    ----------
    motion : Motion or mapping   the dance, or several dances by name, which are compared in one table. With
                                 several songs, a list of dances by name, one to each song
    song : Song or path, or several   its song, or a list of songs
    name : str   how a single dance is named in the result
    beats : str or path   a beat tracker, or a file of beat times in seconds
    repertoire : Repertoire or path, optional   its takes and motifs, to which the dance is compared as well

    Returns
    -------
    evaluation : Evaluation   the scores, `evaluation.dances[0].scores.values`, and their chance levels

    Raises
    ------
    ParameterError   if an argument is of another type, the name of a joint is unknown, or the beats cannot be
                     used
    FormatError      if the song or the file of beats is damaged

    Examples
    --------
    >>> motion, _ = cg.starter_repertoire().motion(0, 0.0, 8.0)
    >>> song = cg.load_song(cg.example_songs()["house"], duration_s=8.0)
    >>> found = cg.evaluate(motion, song)
    >>> 0 <= found.dances[0].scores.values["f_score"] <= 1
    True
    >>> both = cg.evaluate({"take": motion, "slow": motion.sampled(np.arange(0, 100, 0.5))}, song)
    >>> list(both.variants)
    ['take', 'slow']
    >>> of_two = cg.evaluate({"take": [motion, motion]}, [song, cg.example_songs()["waltz"]])
    >>> of_two.facts["songs"]
    ['house', 'waltz']
    """
    check_text("the name of a dance", name)
    songs: list[Any] = list(song) if isinstance(song, list | tuple) else [song]
    motions = _named(motion, name, len(songs) if isinstance(song, list | tuple) else None)
    as_path("beats to measure by", beats)
    return measured_dances(
        [as_song("a song", one) for one in songs], motions, beats,
        None if repertoire is None else as_repertoire(repertoire),
    )  # fmt: skip


def measured_dances(
    songs: Sequence[Song],
    motions: Mapping[str, tuple[str, Sequence[Motion | None]]],
    beats: str | Path,
    repertoire: Repertoire | None,
) -> Evaluation:
    """Measure dances to songs: a description of each column, and its dance to each song, or None.

    Raises as `evaluate`.
    """
    for described, of_songs in motions.values():
        for one in of_songs:
            if one is not None:
                check_measurable(one, described)
    scorer = MotifScorer(repertoire) if repertoire is not None and repertoire.has_vocabulary else None
    notes: list[str] = []
    measured: list[MeasuredDance] = []
    shown: list[ExampleSong] = []
    for index, song in enumerate(songs):
        notes += song.notes
        music, examples = song_music(song, beats), []
        for variant, (described, of_songs) in motions.items():
            whole = of_songs[index]
            if whole is None:
                continue
            one = whole.sliced(0, max(1, round(min(whole.duration_s, song.duration_s) * whole.fps)))
            rng = np.random.default_rng(0)
            scores, motifs = dance_scores(CountedDance(SINGLE, song.name, one), music, rng, scorer=scorer)
            if repertoire is not None:
                try:
                    scores |= _realism_scores(one, song, repertoire, rng)
                except ParameterError as error:
                    of_one = f" of {described}" if len(motions) > 1 else ""
                    notes.append(f"no Fréchet distances{of_one}: {error}")
            measured.append(MeasuredDance(variant, song.name, 0, scores))
            examples.append(ExampleDance(variant, one, None, motifs))
        template = scorer.template("") if scorer else None
        shown.append(ExampleSong(song.name, music.beats_s, tuple(examples), template))
    facts = _facts(songs, repertoire, beats, scorer)
    described_as = {variant: described for variant, (described, _) in motions.items()}
    return Evaluation(facts, described_as, tuple(measured), (), tuple(dict.fromkeys(notes)), shown[0])


def _facts(
    songs: Sequence[Song], repertoire: Repertoire | None, beats: str | Path, scorer: MotifScorer | None
) -> dict[str, Any]:
    """What is evaluated and how."""
    return {
        "choreograph": version("choreograph"),
        "repertoire": repertoire.path.name if repertoire else None,
        "songs": [song.name for song in songs],
        "seeds": 1,
        "beats": Path(beats).name,
        "second_beats": second_tracker(beats),
        "motifs_judged_by": scorer.network if scorer else "nothing",
        "frechet_against": "the repertoire's takes" if repertoire else "nothing",
        "seen": False,
    }


def _named(motion: object, name: str, n_songs: int | None) -> dict[str, tuple[str, list[Motion | None]]]:
    """The description and the dances of each column, by its name. `n_songs` is None for a single song."""
    if n_songs is None and not isinstance(motion, Mapping):
        check_kind("the motion to evaluate", motion, Motion)
        return {SINGLE: (name, [motion])}  # type: ignore[list-item]  # it was checked
    if not isinstance(motion, Mapping) or not motion or n_songs == 0:
        raise ParameterError(
            "expected a dance or more to evaluate, got none"
            if isinstance(motion, Mapping)
            else f"expected lists of dances by name beside several songs, got {type(motion).__name__}"
        )
    columns: dict[str, tuple[str, list[Motion | None]]] = {}
    for of_one, given in motion.items():
        check_text("the name of a dance", of_one)
        if of_one in (EXPERT, REAL, TAKES):
            raise ParameterError(f"expected another name of a dance than {of_one!r}, which stands for others")
        if n_songs is None:
            check_kind("the motion to evaluate", given, Motion)
        dances = [given] if n_songs is None else as_list(f"dances of {of_one}", given, "motions", Motion)
        if len(dances) != (n_songs or 1):
            raise ParameterError(
                f"expected a dance of {of_one} to each of {n_songs} songs, got {len(dances)}"
            )
        columns[of_one] = of_one, list(dances)
    return columns


def _realism_scores(motion: Motion, song: Song, repertoire: Repertoire, rng: np.random.Generator) -> Scores:
    """Fréchet distances to the takes to other songs. `ParameterError` if rigs do not match."""
    motions = [repertoire.motion(index)[0] for index in range(len(repertoire.takes))]
    real = RealDances(motions, [take.song_name for take in repertoire.takes], like=motion)
    return real.scores(motion, song.name, rng)
