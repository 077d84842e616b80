"""Run an evaluation: dance to songs in several variants and seeds, and measure every dance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from choreograph.core.errors import ParameterError
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.core.timebase import NET_FPS
from choreograph.evaluation.dance_scores import dance_scores
from choreograph.evaluation.danced_counts import CountedDance
from choreograph.evaluation.metrics import labels
from choreograph.evaluation.plan_scores import scorer_for
from choreograph.evaluation.results import (
    EXPERT,
    REAL,
    TAKES,
    Evaluation,
    ExampleDance,
    ExampleSong,
    MeasuredDance,
    dances_of,
)
from choreograph.evaluation.scores import (
    DancedPhases,
    FeatureRows,
    RealDances,
    Scores,
    dance_label_values,
    danced_phases,
    label_scores,
    phase_scores,
    physical_scores,
    real_set_scores,
    seed_scores,
    set_scores,
    weighted_mean,
)
from choreograph.evaluation.songs import EvaluatedSong, SongMusic, check_unseen, second_tracker, song_music
from choreograph.evaluation.variants import KeptDances, Variant, check_variant, dance_variant, variants_named
from choreograph.library.repertoire import Repertoire
from choreograph.motion.body import body_pos_m
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.music.song import Song
from choreograph.pipeline.dancing import Dance
from choreograph.plan.plan import Plan


@dataclass(frozen=True)
class EvaluationConfig:
    """The variants, seeds and beats of an evaluation."""

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


@default_numerics()
def evaluate_variants(
    repertoire: Repertoire,
    songs: Sequence[EvaluatedSong],
    config: EvaluationConfig | None = None,
    *,
    references: Sequence[CountedDance] = (),
    judge: Repertoire | None = None,
    kept: KeptDances | None = None,
    report: ProgressReport | None = None,
) -> Evaluation:
    """Dance to held-out songs in every variant with every seed, and measure all dances and the real ones.

    `references` are measured as well, for example dances of experts to the same songs. Those to other songs
    only serve to measure the phases within the count at which their genre has motion beats. `judge` is a
    repertoire built with another seed. Motifs and signatures are then those of its vocabulary, by its word
    network, which no cost of the dances is from. Dances that `kept` holds are not made again, and new ones
    are kept there, so that a stopped evaluation can be resumed.

    Raises
    ------
    ParameterError    the repertoire or the judge was built from a song, the judge has the repertoire's own
                      word network, or beats or settings cannot be used
    FormatError       a song cannot be read
    RepertoireError   the repertoire lacks something that a variant needs. It is raised before the first dance
    """
    config = config or EvaluationConfig()
    for variant in config.variants:
        check_variant(variant, repertoire)
    for built in (repertoire, judge) if not config.seen else ():
        if built is not None:
            check_unseen(songs, built)
    run = _Run(repertoire, songs, config, references, judge, kept, report)
    for song in songs:
        run.dance_to(song)
    return run.evaluation()


class _Run:
    """The state of a running evaluation."""

    def __init__(
        self,
        repertoire: Repertoire,
        songs: Sequence[EvaluatedSong],
        config: EvaluationConfig,
        references: Sequence[CountedDance],
        judge: Repertoire | None,
        kept: KeptDances | None,
        report: ProgressReport | None,
    ) -> None:
        self.repertoire, self.songs, self.config, self.kept = repertoire, songs, config, kept
        self.report = report or (lambda stage, done, total: None)
        self.dances: list[MeasuredDance] = []
        self.notes: dict[str, None] = {}
        self.features: dict[tuple[str, int], list[FeatureRows]] = {}  # (variant, seed) -> dances
        self.dance_labels: list[Floats] = []  # (W, 4) per dance
        self.bodies_m: list[Floats] = []  # (T, 21, 3) at 20 fps per dance
        self.music_labels: dict[str, Floats] = {}  # song -> (W, 4)
        self.references = references
        self.music: dict[str, SongMusic] = {}  # by song
        self.example: ExampleSong | None = None
        self.motif_scorer = scorer_for(repertoire, judge)
        self.real, self.real_description = self._real_dances()
        self.n_dances = sum(len(self._seeds(v)) for v in config.variants) * len(songs)

    def _seeds(self, variant: Variant) -> range:
        first = self.config.first_seed
        return range(first, first + (self.config.seeds if variant.seeded else 1))

    def _real_dances(self) -> tuple[RealDances | None, str]:
        """The real dances to compare poses with: real takes to other songs, or those of the repertoire."""
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
        starts_s = labels.window_starts_s(loaded.duration_s)
        self.music_labels[song.name] = labels.music_values(loaded.samples, starts_s)
        self.music[song.name] = song_music(loaded, self.config.beats)
        examples: list[ExampleDance] = []
        for variant in self.config.variants:
            for seed in self._seeds(variant):
                self.report("dancing", len(self.dances), self.n_dances)
                dance = self._dance(song, loaded, variant, seed)
                self.notes |= dict.fromkeys(dance.notes)
                made = CountedDance.from_plan(
                    variant.name, song.name, dance.motion, dance.plan, self.repertoire
                )
                example = self._measure(song, seed, made)
                if seed == self.config.first_seed:
                    examples.append(example)
        examples += [self._measure(song, 0, known) for known in self.references if known.song == song.name]
        if song.take is not None:
            n_frames = min(song.take.motion.n_frames, round(loaded.duration_s * song.take.motion.fps))
            motion = song.take.motion.sliced(0, n_frames)
            counts = song.take.counts.within(0.0, motion.duration_s)
            examples.append(self._measure(song, 0, CountedDance(REAL, song.name, motion, counts)))
        if self.example is None:
            template = self.motif_scorer.template(song.genre) if self.motif_scorer else None
            beats_s = self.music[song.name].beats_s
            self.example = ExampleSong(song.name, beats_s, tuple(examples), template)

    def _dance(self, song: EvaluatedSong, loaded: Song, variant: Variant, seed: int) -> Dance:
        """The dance of a variant to a song, which was kept or is made and kept."""
        known = None if self.kept is None else self.kept.find(song, variant, seed, self.repertoire)
        if known is not None:
            return known
        dance = dance_variant(variant, loaded, self.repertoire, seed=seed)
        if self.kept is not None:
            self.kept.keep(song, variant, seed, self.repertoire, dance)
        return dance

    def _measure(self, song: EvaluatedSong, seed: int, dance: CountedDance) -> ExampleDance:
        rng, motion, music = np.random.default_rng(seed), dance.motion, self.music[song.name]
        scores, motifs = dance_scores(dance, music, rng, genre=song.genre, scorer=self.motif_scorer)
        if self.real is not None:
            scores |= self.real.scores(motion, song.song_name, rng)
        rows = FeatureRows.from_motion(motion, self.real)
        self.features.setdefault((dance.variant, seed), []).append(rows)
        self.dance_labels.append(dance_label_values(motion))
        self.bodies_m.append(body_pos_m(motion.resampled(NET_FPS)))
        counts = music.counted_as(dance.counts)
        phases = danced_phases(motion, counts.times_s, song.genre, song.song_name)
        self.dances.append(MeasuredDance(dance.variant, song.name, seed, scores, dance.plan, phases))
        return ExampleDance(dance.variant, motion, dance.plan, motifs)

    def evaluation(self) -> Evaluation:
        """The results, with the scores that need all dances: labels, sets, and takes."""
        experts = self._expert_phases()
        rng = np.random.default_rng(0)
        dances = [
            d if d.phases is None else replace(d, scores=d.scores | phase_scores(d.phases, experts, rng))
            for d in self._with_seed_distances(self._with_label_scores())
        ]
        sets = self._set_scores()
        takes = self._take_scores()
        variants = {v.name: v.description for v in self.config.variants}
        for reference in self.references:
            variants.setdefault(reference.variant, "choreographies of experts, placed on the beats")
        if any(d.variant == REAL for d in dances):
            variants[REAL] = "the real takes to these songs as recorded, synchronised with them or not"
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
            "second_beats": second_tracker(self.config.beats),
            "motifs_judged_by": self.motif_scorer.network if self.motif_scorer else "nothing",
            "frechet_against": self.real_description,
            "seen": self.config.seen,
        }
        return Evaluation(
            facts, variants, (*dances, *takes), tuple(sets), tuple(self.notes), self.example, tuple(experts)
        )

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

    def _with_seed_distances(self, dances: Sequence[MeasuredDance]) -> list[MeasuredDance]:
        """The dances with their mean distance to those of other seeds."""
        of_song: dict[tuple[str, str], list[Floats]] = {}
        for dance, body_m in zip(dances, self.bodies_m, strict=True):
            of_song.setdefault((dance.variant, dance.song), []).append(body_m)
        return [
            replace(d, scores=d.scores | seed_scores(body_m, of_song[d.variant, d.song]))
            for d, body_m in zip(dances, self.bodies_m, strict=True)
        ]

    def _expert_phases(self) -> list[DancedPhases]:
        """Phases of the motion beats of the experts, or of the real takes without experts."""
        reference = EXPERT if any(r.variant == EXPERT for r in self.references) else REAL
        experts = [d.phases for d in dances_of(self.dances, reference) if d.phases is not None]
        evaluated = {song.name for song in self.songs}
        return experts + [
            danced_phases(r.motion, r.counts.times_s, r.genre, r.song)
            for r in self.references
            if r.variant == EXPERT and r.song not in evaluated
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
        """Physics of the takes in the dances of the first variant, by song, weighted by duration."""
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
