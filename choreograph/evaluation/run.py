"""Run an evaluation: dance to songs in several variants and seeds, and measure every dance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.errors import ParameterError
from choreograph.evaluation.motif_scores import MotifScorer
from choreograph.evaluation.motion_scores import (
    beat_scores,
    dance_label_values,
    label_scores,
    physical_scores,
)
from choreograph.evaluation.plan_scores import plan_scores, transition_times_s
from choreograph.evaluation.realism_scores import FeatureRows, RealDances, real_set_scores, set_scores
from choreograph.evaluation.results import (
    REAL,
    SELECTION,
    TAKES,
    Evaluation,
    ExampleDance,
    ExampleSong,
    MeasuredDance,
    dances_of,
)
from choreograph.evaluation.retrieval_scores import retrieval_scores
from choreograph.evaluation.scores import Scores, weighted_mean
from choreograph.evaluation.songs import EvaluatedSong, beats_of, check_unseen
from choreograph.evaluation.variants import Variant, dance_variant, variants_named
from choreograph.features.music_beats import DEFAULT_TRACKER
from choreograph.features.sections import Sections, song_sections
from choreograph.metrics import labels
from choreograph.motion.motion import Motion
from choreograph.plan import Plan
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class EvaluationConfig:
    """Which variants are compared, how often, and against which beats."""

    variants: tuple[Variant, ...] = field(default_factory=lambda: variants_named(["ours"]))
    seeds: int = 5
    beats: str | Path = DEFAULT_TRACKER  # that dances are measured against, not those they are made with
    seen: bool = False  # whether songs that the repertoire was built from are allowed
    first_seed: int = 0  # the seeds are first_seed, first_seed + 1, …

    def __post_init__(self) -> None:
        if not self.variants or self.seeds < 1:
            raise ParameterError(
                f"expected variants and seeds, 1 or more each, got {len(self.variants)} and {self.seeds}"
            )


def evaluate(
    repertoire: Repertoire,
    songs: Sequence[EvaluatedSong],
    config: EvaluationConfig | None = None,
    *,
    report: ProgressReport | None = None,
) -> Evaluation:
    """Dance to held-out songs in every variant with every seed, and measure all dances and the real ones.

    Raises
    ------
    ParameterError    the repertoire was built from a song, or beats or settings cannot be used
    FormatError       a song cannot be read
    RepertoireError   the repertoire lacks something that a variant needs
    """
    config = config or EvaluationConfig()
    if not config.seen:
        check_unseen(songs, repertoire)
    run = _Run(repertoire, songs, config, report)
    for song in songs:
        run.dance_to(song)
    return run.evaluation()


class _Run:
    """The state of an evaluation while it goes from song to song."""

    def __init__(
        self,
        repertoire: Repertoire,
        songs: Sequence[EvaluatedSong],
        config: EvaluationConfig,
        report: ProgressReport | None,
    ) -> None:
        self.repertoire, self.songs, self.config = repertoire, songs, config
        self.report = report or (lambda stage, done, total: None)
        self.dances: list[MeasuredDance] = []
        self.retrievals: list[MeasuredDance] = []  # style retrieval by song, not dances
        self.notes: dict[str, None] = {}
        self.features: dict[tuple[str, int], list[FeatureRows]] = {}  # (variant, seed) -> dances
        self.dance_labels: list[Floats] = []  # (W, 4) per dance
        self.music_labels: dict[str, Floats] = {}  # song -> (W, 4)
        self.sections: dict[str, Sections] = {}  # by song
        self.example: ExampleSong | None = None
        self.motif_scorer = MotifScorer(repertoire) if repertoire.has_vocabulary else None
        self.real, self.real_description = self._real_dances()
        self.n_dances = sum(len(self._seeds(v)) for v in config.variants) * len(songs)

    def _seeds(self, variant: Variant) -> range:
        first = self.config.first_seed
        return range(first, first + (self.config.seeds if variant.seeded else 1))

    def _real_dances(self) -> tuple[RealDances | None, str]:
        """The dances that poses are compared with: real takes to other songs, or the repertoire's takes."""
        self.report("measuring real dances", 0, 0)
        takes = [(song.take.motion, song.song_name) for song in self.songs if song.take is not None]
        description = "the real takes to the other songs"
        if len({name for _, name in takes}) < 2:
            infos = self.repertoire.takes
            takes = [(self.repertoire.motion(i)[0], info.song_name) for i, info in enumerate(infos)]
            description = "the repertoire's takes"
        if len({name for _, name in takes}) < 2:
            self.notes["real takes to one song only: no Fréchet distances"] = None
            return None, "nothing"
        try:
            like = self.repertoire.motion(0, 0.0, 0.0)[0]
            return RealDances([m for m, _ in takes], [name for _, name in takes], like=like), description
        except ParameterError as error:
            self.notes[f"no Fréchet distances: {error}"] = None
            return None, "nothing"

    def dance_to(self, song: EvaluatedSong) -> None:
        """Make and measure all dances to a song."""
        loaded = song.load()
        beats_s = beats_of(loaded, self.config.beats, start_s=song.start_s)
        starts_s = labels.window_starts_s(loaded.duration_s)
        self.music_labels[song.name] = labels.music_values(loaded.samples, starts_s)
        self.sections[song.name] = song_sections(loaded.samples, beats_s)
        examples: list[ExampleDance] = []
        for variant in self.config.variants:
            for seed in self._seeds(variant):
                self.report("dancing", len(self.dances), self.n_dances)
                dance = dance_variant(variant, loaded, self.repertoire, seed=seed, start_s=song.start_s)
                self.notes |= dict.fromkeys(dance.notes)
                example = self._measure(variant.name, song, seed, dance.motion, dance.plan, beats_s)
                if seed == self.config.first_seed:
                    examples.append(example)
        if song.take is not None:
            scores = retrieval_scores(loaded, song.genre, self.repertoire)
            self.retrievals.append(MeasuredDance(SELECTION, song.name, 0, scores))
            n_frames = min(song.take.motion.n_frames, round(loaded.duration_s * song.take.motion.fps))
            examples.append(self._measure(REAL, song, 0, song.take.motion.sliced(0, n_frames), None, beats_s))
        if self.example is None:
            template = self.motif_scorer.template(song.genre) if self.motif_scorer else None
            self.example = ExampleSong(song.name, beats_s, tuple(examples), template)

    def _measure(
        self,
        variant: str,
        song: EvaluatedSong,
        seed: int,
        motion: Motion,
        plan: Plan | None,
        beats_s: Floats,
    ) -> ExampleDance:
        rng = np.random.default_rng(seed)
        boundaries_s = transition_times_s(plan) if plan else ()
        scores = beat_scores(motion, beats_s, rng) | physical_scores(motion, boundaries_s)
        if self.real is not None:
            scores |= self.real.scores(motion, song.song_name, rng)
        motifs = None
        if self.motif_scorer is not None:
            motifs = self.motif_scorer.motifs_of(motion, beats_s)
            scores |= self.motif_scorer.scores(motifs, song.genre)
            scores |= self.motif_scorer.section_scores(motifs, self.sections[song.name])
        if plan is not None:
            scores |= plan_scores(plan, self.repertoire, song.genre)
        self.features.setdefault((variant, seed), []).append(FeatureRows.from_motion(motion, self.real))
        self.dance_labels.append(dance_label_values(motion))
        self.dances.append(MeasuredDance(variant, song.name, seed, scores, plan))
        return ExampleDance(variant, motion, plan, motifs)

    def evaluation(self) -> Evaluation:
        """The results, with the scores that need all dances: labels, sets, and the takes danced with."""
        dances = self._with_label_scores()
        sets = self._set_scores()
        takes = self._take_scores()
        variants = {v.name: v.description for v in self.config.variants}
        if any(d.variant == REAL for d in dances):
            variants[REAL] = "the real takes to these songs"
        retrievals = [r for r in self.retrievals if r.scores.values]
        if retrievals:
            variants[SELECTION] = "the repertoire's clips ranked by style; the same for every variant"
        if takes:
            variants[TAKES] = (
                f"the takes in the dances of {self.config.variants[0].name}, weighted by duration"
            )
        facts = {
            "choreograph": version("choreograph"),
            "repertoire": self.repertoire.path.name,
            "songs": [song.name for song in self.songs],
            "seeds": self.config.seeds,
            "beats": Path(self.config.beats).name,
            "frechet_against": self.real_description,
            "seen": self.config.seen,
        }
        measured = (*dances, *retrievals, *takes)
        return Evaluation(facts, variants, measured, tuple(sets), tuple(self.notes), self.example)

    def _with_label_scores(self) -> list[MeasuredDance]:
        real = [v for d, v in zip(self.dances, self.dance_labels, strict=True) if d.variant == REAL]
        windows = np.concatenate(real or self.dance_labels)
        music = np.concatenate(list(self.music_labels.values()))
        if len(windows) == 0 or len(music) == 0:
            self.notes["songs shorter than 4 s: no label distances"] = None
            return self.dances
        scale = labels.fit_scale(windows, music)
        return [
            replace(d, scores=d.scores | label_scores(scale, values, self.music_labels[d.song]))
            for d, values in zip(self.dances, self.dance_labels, strict=True)
        ]

    def _set_scores(self) -> list[MeasuredDance]:
        real = self.features.get((REAL, 0), [])
        names = [song.song_name for song in self.songs if song.take is not None]
        if len(set(names)) < 2:
            return []
        sets = [
            MeasuredDance(variant, "", seed, Scores(set_scores(rows, real)))
            for (variant, seed), rows in self.features.items()
            if variant != REAL
        ]
        halves = real_set_scores(real, names, np.random.default_rng(0))
        return [*sets, MeasuredDance(REAL, "", 0, Scores(halves))]

    def _take_scores(self) -> list[MeasuredDance]:
        """Physics of the takes in the first variant's dances, by song, weighted by their duration there."""
        plans: dict[str, list[Plan]] = {}
        for dance in dances_of(self.dances, self.config.variants[0].name):
            if dance.plan is not None:
                plans.setdefault(dance.song, []).append(dance.plan)
        known: dict[str, dict[str, float]] = {}
        measured = []
        for done, (song, of_song) in enumerate(plans.items()):
            self.report("measuring takes", done, len(plans))
            danced_s: Counter[str] = Counter()
            for plan in of_song:
                danced_s.update({take: length_s for take, length_s in plan.takes_s().items() if take})
            for take in danced_s.keys() - known.keys():
                motion, _ = self.repertoire.motion(self.repertoire.take_index(take))
                known[take] = dict(physical_scores(motion).values)
            if danced_s:
                measured.append(MeasuredDance(TAKES, song, 0, weighted_mean(known, danced_s)))
        return measured
