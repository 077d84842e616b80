"""The counts of a dance that is made from takes, and the scores of its plan and of its motifs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import NO_COUNTS, Counts
from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats
from choreograph.core.timebase import NET_FPS, NODE_FRAMES, WORD_FPS
from choreograph.evaluation.metrics import counts, structure, transitions
from choreograph.evaluation.scores import Scores
from choreograph.library.repertoire import Repertoire
from choreograph.library.vocabulary import ALL_GENRES, segment_words
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Motion
from choreograph.music.bars import tempo_bpm
from choreograph.music.form import Sections
from choreograph.plan.plan import Plan
from choreograph.plan.runs import Run, plan_runs

# The counts and figures of the takes, placed in a dance by the time maps of its plan.


SOURCE = "takes"  # of the counts of a dance
_GRID_S = 1 / 240  # spacing at which time maps are inverted
_OVERLAP_S = 0.05  # a count this close outside a run is danced in the transition
_ROUNDING_S = 1e-3  # a count this close outside the dance is at its end
_SAME_COUNT_S = 0.1  # counts of the two takes of a join that are closer are one
_BORDERS_WITHIN_S = 1.0  # of a transition: farther borders of figures are another count's


def danced_counts(plan: Plan, repertoire: Repertoire) -> Counts:
    """The counts of the takes of a dance, in seconds of the dance.

    Takes without counts contribute none, nor do held poses (before `opening_s`, after `closing_s`). Motion
    from a network has no counts. At a join, where both takes may count the same instant, the
    incoming take's count is kept. The metre is the longest of the takes' bars, the confidence the mean over
    the counts. Raises `RepertoireError` if the plan names a take that the repertoire does not have.
    """
    parts = [(run, _counts_of(run, repertoire)) for run in _runs_of(plan)]
    counted = [(*_placed(run, counts), counts) for run, counts in parts if len(counts)]
    counted = [part for part in counted if len(part[0])]
    if not counted:
        return NO_COUNTS
    times_s = np.concatenate([times for times, _, _ in counted])
    numbers = np.concatenate([numbers for _, numbers, _ in counted])
    confidence = np.concatenate([np.full(len(times), c.confidence) for times, _, c in counted])
    kept = _without_doubles(times_s, [len(times) for times, _, _ in counted]) & _danced(plan, times_s)
    if not kept.any():
        return NO_COUNTS
    return Counts(
        np.clip(times_s[kept], 0.0, plan.duration_s),
        numbers[kept],
        max(c.metre for _, _, c in counted),
        SOURCE,
        float(confidence[kept].mean()),
    )


def counted_share(plan: Plan, repertoire: Repertoire) -> float:
    """Share of the seconds of a dance, 0 … 1, that are from takes with counts."""
    runs = _runs_of(plan)
    counted_s = sum(  # the last second may be planned beyond the end
        min(run.stop_s, plan.duration_s) - run.start_s for run in runs if len(_counts_of(run, repertoire))
    )
    return counted_s / plan.duration_s if runs else 0.0


def figure_borders_s(plan: Plan, repertoire: Repertoire) -> Floats:
    """Borders of figures near transitions, (F,) seconds of the dance, increasing.

    They are the nearest starts and ends of figures of the outgoing and of the incoming take of each
    transition, also those just after the end of the one and before the start of the other.
    """
    borders_s: list[float] = []
    for pair in pairwise(_runs_of(plan)):
        for run in pair:
            figures = repertoire.figures(repertoire.take_index(run.take))
            of_take = {border for figure in figures for border in (figure.start_s, figure.end_s)}
            at_s = pair[1].start_s
            borders_s.extend(_danced_at_s(run, of_take, at_s - _BORDERS_WITHIN_S, at_s + _BORDERS_WITHIN_S))
    return np.unique(borders_s)


def _runs_of(plan: Plan) -> list[Run]:
    return plan_runs(plan) if plan.from_takes else []


def _counts_of(run: Run, repertoire: Repertoire) -> Counts:
    return repertoire.counts(repertoire.take_index(run.take))


def _placed(run: Run, counts: Counts) -> tuple[Floats, NDArray[np.int64]]:
    """Times (N,) in the dance and numbers (N,) of the take's counts in a run, and just outside it."""
    source_s, grid_s = _map_of(run, run.start_s - _OVERLAP_S, run.stop_s + _OVERLAP_S)
    inside = (counts.times_s >= source_s[0]) & (counts.times_s <= source_s[-1])
    return np.interp(counts.times_s[inside], source_s, grid_s), counts.numbers[inside]


def _danced_at_s(run: Run, source_times_s: Iterable[float], from_s: float, to_s: float) -> list[float]:
    """The times of the dance between two at which the run's take is, or would be, at source times."""
    source_s, grid_s = _map_of(run, from_s, to_s)
    wanted = np.array(sorted(source_times_s))
    wanted = wanted[(wanted >= source_s[0]) & (wanted <= source_s[-1])]
    result: list[float] = np.interp(wanted, source_s, grid_s).tolist()
    return result


def _map_of(run: Run, from_s: float, to_s: float) -> tuple[Floats, Floats]:
    """Source times, never decreasing, and their times of the dance, both (G,)."""
    grid_s = np.linspace(from_s, to_s, max(2, round((to_s - from_s) / _GRID_S)) + 1)
    return np.maximum.accumulate(run.source_s(grid_s)), grid_s


def _without_doubles(times_s: Floats, lengths: list[int]) -> NDArray[np.bool_]:
    """Whether to keep each count (N,) of consecutive runs. One that the next run has too is dropped."""
    keep = np.ones(len(times_s), bool)
    for join in np.cumsum(lengths)[:-1]:
        # Counts in the overlap of two runs: later runs take over.
        keep[:join] &= times_s[:join] < times_s[join] - _SAME_COUNT_S
    return keep


def _danced(plan: Plan, times_s: Floats) -> NDArray[np.bool_]:
    """Whether the dance moves at each time: after its opening pose, and up to its closing one."""
    first_s = max(-_ROUNDING_S, plan.opening_s - _OVERLAP_S)
    return (times_s >= first_s) & (
        times_s <= min(plan.duration_s + _ROUNDING_S, plan.danced_until_s + _OVERLAP_S)
    )


# `CountedDance`: a dance to one of the evaluated songs with its counts and its plan, to be measured.


@dataclass(frozen=True, eq=False)
class CountedDance:
    """A dance from the first second of the song: of a variant, a real take, or by an expert."""

    variant: str  # column of the tables
    song: str  # name of the `EvaluatedSong`, or of another song
    motion: Motion
    counts: Counts = NO_COUNTS  # its own, in seconds of the dance
    plan: Plan | None = None
    repertoire: Repertoire | None = None  # that the plan's takes are in
    genre: str = ""  # if it is known

    @classmethod
    def from_plan(
        cls, variant: str, song: str, motion: Motion, plan: Plan, repertoire: Repertoire
    ) -> CountedDance:
        """A dance with the plan from which it was rendered. Its counts are those of its takes."""
        return cls(variant, song, motion, danced_counts(plan, repertoire), plan, repertoire)


# Scores of a plan: its transitions, its repeats, and the variety, genre and speed of its takes.


_SLOWEST, _FASTEST = 0.5, 2.0  # of a warp, ChoreoGraph, section 3.2


def plan_scores(plan: Plan, repertoire: Repertoire, genre: str = "") -> Scores:
    """Structure and warping of a plan. Empty unless it is made from takes.

    `genre` is that of the song, if it is known.
    """
    if not plan.from_takes:
        return Scores({})
    blocks = plan.blocks
    takes = [block.planned.take for block in blocks]
    pieces_s = np.array([(b.start_s, b.end_s, b.source_start_s, b.source_end_s) for b in blocks])
    scores = {
        "longest_repeat_s": structure.longest_repeat_s(takes, pieces_s),
        "distinct_takes_per_minute": structure.distinct_takes_per_minute(takes, plan.duration_s),
    }
    if plan.seconds:
        scores |= playback_speed_scores(time_maps(plan))
    genres = {take.name: take.credits.genre for take in repertoire.takes}
    if genre not in genres.values():
        return Scores(scores)
    danced_s = plan.takes_s()
    share = structure.genre_share([genres[take] for take in danced_s], list(danced_s.values()), genre)
    lengths_s = [take.duration_s for take in repertoire.takes]
    chance = structure.genre_share(list(genres.values()), lengths_s, genre)
    return Scores(scores | {"own_genre": share}, {"own_genre": chance})


def tempo_scores(plan: Plan, repertoire: Repertoire, danced: Counts) -> Scores:
    """Share of the time between the danced counts outside of the tempi of the takes of the genre danced.

    Chance is the tempo of the dance with the takes of any genre that the repertoire holds. Empty without
    counts.
    """
    tempi = _tempi_by_genre(repertoire)
    if not plan.from_takes or len(danced) < 2 or not tempi:
        return Scores({})
    genre_of = {take.name: take.credits.genre for take in repertoire.takes}
    blocks = plan.blocks
    starts_s = np.array([block.start_s for block in blocks])
    middles_s = (danced.times_s[1:] + danced.times_s[:-1]) / 2
    of_block = np.searchsorted(starts_s, middles_s, "right") - 1
    genres = [genre_of[blocks[max(index, 0)].source] for index in of_block]

    def outside(ranges: Sequence[tuple[float, float]]) -> float:
        low_bpm, high_bpm = np.array(ranges).T
        return counts.outside_tempi_share(danced.times_s, low_bpm, high_bpm)

    share = outside([tempi.get(genre, (0.0, np.inf)) for genre in genres])
    chance = float(np.mean([outside([of_genre] * len(genres)) for of_genre in tempi.values()]))
    return Scores({"outside_tempi": share}, {"outside_tempi": chance})


def _tempi_by_genre(repertoire: Repertoire) -> dict[str, tuple[float, float]]:
    """The slowest and the fastest tempo of the takes with counts of each genre, in counts per minute."""
    tempi: dict[str, list[float]] = {}
    for index, take in enumerate(repertoire.takes):
        counts = repertoire.counts(index)
        if len(counts) > 1:
            tempi.setdefault(take.credits.genre, []).append(tempo_bpm(counts))
    return {genre: (min(of_genre), max(of_genre)) for genre, of_genre in tempi.items()}


def transition_scores(plan: Plan, repertoire: Repertoire, music: Counts) -> Scores:
    """How often the takes change, and whether at borders of bars and figures. Empty unless made from takes.

    Chance is transitions at random instants of the song's beats.
    """
    if not plan.from_takes:
        return Scores({})
    scores = transitions.evaluate(
        transition_times_s(plan),
        plan.duration_s,
        music.times_s,
        music.numbers,
        figure_borders_s(plan, repertoire),
    )
    known = {name: value for name, value in scores.items() if np.isfinite(value)}
    chance = transitions.uniform_chance(max(1, music.metre))
    return Scores(known, {name: level for name, level in chance.items() if name in known})


def time_maps(plan: Plan) -> Floats:
    """The take's frame at every frame of the plan's seconds, ends included, (S, 21) at 20 fps."""
    times_s = np.array([second.source_times_s for second in plan.seconds], np.float64)
    return times_s.reshape(-1, NODE_FRAMES + 1) * NET_FPS


def transition_times_s(plan: Plan) -> Floats:
    """Times in seconds, (B,), at which one run of a take takes over from another. None without takes."""
    if not plan.from_takes:
        return np.zeros(0)
    return np.array([run.start_s for run in plan_runs(plan)[1:]])


def playback_speed_scores(time_maps: Floats) -> dict[str, float]:
    """Percentiles of the slopes of time maps (S, T), and the shares of the frames at the limits, by name.

    A slope of 1 is the recorded speed. A smoothed map comes within 2 % of a limit where it runs along it.
    """
    slopes = np.diff(time_maps, axis=-1)
    return {
        "slope_p05": float(np.percentile(slopes, 5)),
        "slope_median": float(np.median(slopes)),
        "slope_p95": float(np.percentile(slopes, 95)),
        "share_at_slowest": float(np.mean(slopes <= _SLOWEST * 1.02)),
        "share_at_fastest": float(np.mean(slopes >= _FASTEST * 0.98)),
    }


# Scores of the motifs in a dance: against its genre's signature and its song's sections.


OWN_NETWORK = "own network"  # the one that the costs of the dances are from
_CHANCE_ROUNDS = 100
_SMOOTHING = 0.01  # share of the transition probability spread over all motifs


def scorer_for(repertoire: Repertoire, judge: Repertoire | None = None) -> MotifScorer | None:
    """A scorer with the vocabulary of the judge, or with that of the repertoire. None if it has none.

    A search with motif costs from a word network may fit the network more than the dance. So a judge is a
    repertoire whose network was trained with another seed. Raises `RepertoireError` if the judge has no
    vocabulary, `ParameterError` if its word network is the repertoire's.
    """
    if judge is None:
        return MotifScorer(repertoire) if repertoire.has_vocabulary else None
    scorer = MotifScorer(judge, network=judge.path.name)
    if repertoire.has_vocabulary:
        own, other = repertoire.net("words").weights, judge.net("words").weights
        if own.keys() == other.keys() and all(np.array_equal(own[name], other[name]) for name in own):
            raise ParameterError(
                f"{judge.path.name}: expected a judge with another word network than {repertoire.path.name}, "
                "got the same: build it with another --seed"
            )
    return scorer


@dataclass(frozen=True, eq=False)
class DancedMotifs:
    """The motifs of a dance in order, with their start and end times."""

    motifs: NDArray[np.int64]  # (N,)
    start_s: Floats  # (N,)
    end_s: Floats  # (N,)

    def __len__(self) -> int:
        return len(self.motifs)


class MotifScorer:
    """Assigns the motion words of a dance to the motifs of a repertoire, and scores the motifs."""

    def __init__(self, repertoire: Repertoire, *, network: str = OWN_NETWORK) -> None:
        """`network` names whose word network and vocabulary these are, for reports."""
        self.vocabulary = repertoire.vocabulary
        self.network = network
        self._net = repertoire.word_net()

    def motifs_of(self, motion: Motion, music_beats_s: Floats) -> DancedMotifs:
        """The motifs of a dance, whose words are segmented at the music's beats."""
        words = segment_words(body_pos_m(motion.resampled(WORD_FPS)), WORD_FPS, music_beats_s)
        if len(words) == 0:
            return DancedMotifs(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        motifs = self.vocabulary.motifs.nearest(self._net.embed(words.body_pos_m))
        return DancedMotifs(motifs, words.start_s, words.end_s)

    def template(self, genre: str) -> Floats:
        """The signature (K,) of a genre, or of all genres if the repertoire does not have it."""
        result: Floats = self.vocabulary.signatures[self.vocabulary.genre_index(self._known(genre))]
        return result

    def scores(self, danced: DancedMotifs, genre: str) -> Scores:
        """Distance of the motifs to the genre's signature, and surprisal of their transitions.

        Chance is the motifs of words drawn from the whole repertoire, and the same motifs in any order. A
        transition that never occurs in the genre's takes would be infinitely surprising, so transition
        probabilities are smoothed by 1 %.
        """
        motifs = danced.motifs
        if len(motifs) < 2:
            return Scores({})
        genre, n_motifs = self._known(genre), self.vocabulary.n_motifs
        template = self.template(genre)
        transitions = self.vocabulary.transitions[self.vocabulary.genre_index(genre)]
        transitions = (1.0 - _SMOOTHING) * transitions + _SMOOTHING / n_motifs
        rng = np.random.default_rng(len(motifs))
        drawn = [rng.choice(self.vocabulary.word_motif, len(motifs)) for _ in range(_CHANCE_ROUNDS)]
        chance = np.mean([structure.signature_distance(random_motifs, template) for random_motifs in drawn])
        return Scores(
            {
                "signature_chi2": structure.signature_distance(motifs, template),
                "transition_bits": structure.transition_bits(motifs, transitions),
                "longest_repeat_motifs": float(structure.longest_repeat(motifs)),
            },
            {
                "signature_chi2": float(chance),
                "transition_bits": structure.transition_chance_bits(motifs, transitions),
            },
        )

    def section_scores(self, danced: DancedMotifs, sections: Sections) -> Scores:
        """Whether sections of the same music are danced with the same motifs. Empty without sections."""
        if len(danced) == 0 or len(sections) == 0:
            return Scores({})
        motifs = structure.motifs_by_section(danced.motifs, danced.start_s, sections.bounds_s)
        similarities = {
            "section_agreement": structure.shared_motifs(motifs, self.vocabulary.n_motifs),
            "section_agreement_in_step": structure.motifs_in_step(motifs),
        }
        values = {
            name: structure.section_agreement(similarity, sections.labels)
            for name, similarity in similarities.items()
        }
        return Scores(values, dict.fromkeys(values, 0.0))

    def _known(self, genre: str) -> str:
        return genre if genre in self.vocabulary.genres else ALL_GENRES
