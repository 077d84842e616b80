"""An evaluation: which dances are made, to which songs, how often, and everything measured on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.rendering import plan_runs
from choreograph.errors import ParameterError
from choreograph.evaluation.measuring import (
    FeatureRows,
    RealDances,
    Scores,
    beat_scores,
    dance_label_values,
    label_scores,
    physical_scores,
    plan_scores,
    real_set_scores,
    retrieval_scores,
    set_scores,
)
from choreograph.evaluation.motif_judge import SignatureJudge
from choreograph.evaluation.results import (
    REAL,
    SELECTION,
    TAKES,
    Evaluation,
    MeasuredDance,
    Shown,
    ShownDance,
    dances_of,
)
from choreograph.evaluation.songs import EvaluatedSong, beats_of, check_unseen
from choreograph.evaluation.variants import Variant, dance_as, variants_named
from choreograph.features.music_beats import DEFAULT_TRACKER
from choreograph.features.sections import Sections, song_sections
from choreograph.metrics import labels
from choreograph.motion.motion import Motion
from choreograph.plan import Plan
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Protocol:
    """What is compared, and how it is measured."""

    variants: tuple[Variant, ...] = field(default_factory=lambda: variants_named(["ours"]))
    seeds: int = 5
    beats: str | Path = DEFAULT_TRACKER  # the beats that dances are measured by, not those danced to
    seen: bool = False  # songs that the repertoire was made with are measured all the same
    first_seed: int = 0  # seeds count from it

    def __post_init__(self) -> None:
        if not self.variants or self.seeds < 1:
            raise ParameterError(f"expected variants and seeds, got {len(self.variants)} and {self.seeds}")


def evaluate(
    repertoire: Repertoire,
    songs: Sequence[EvaluatedSong],
    protocol: Protocol | None = None,
    *,
    report: ProgressReport | None = None,
) -> Evaluation:
    """Dance to held-out songs in every variant with every seed, and measure all dances and the real ones.

    Raises
    ------
    ParameterError    the repertoire was made with a song, or beats or settings cannot be used
    FormatError       a song cannot be read
    RepertoireError   the repertoire lacks what a variant needs
    """
    protocol = protocol or Protocol()
    if not protocol.seen:
        check_unseen(songs, repertoire)
    run = _Run(repertoire, songs, protocol, report)
    for song in songs:
        run.dance_to(song)
    return run.finished()


class _Run:
    """The state of an evaluation while it goes from song to song."""

    def __init__(
        self,
        repertoire: Repertoire,
        songs: Sequence[EvaluatedSong],
        protocol: Protocol,
        report: ProgressReport | None,
    ) -> None:
        self.repertoire, self.songs, self.protocol = repertoire, songs, protocol
        self.report = report or (lambda stage, done, total: None)
        self.dances: list[MeasuredDance] = []
        self.found: list[MeasuredDance] = []  # clips, by style
        self.notes: dict[str, None] = {}
        self.features: dict[tuple[str, int], list[FeatureRows]] = {}
        self.dance_labels: list[Floats] = []  # (W, 4) a dance
        self.music_labels: dict[str, Floats] = {}  # song -> (W, 4)
        self.sections: dict[str, Sections] = {}  # by song
        self.shown: Shown | None = None
        self.judge = SignatureJudge(repertoire) if repertoire.has_vocabulary else None
        self.real, self.against = self._real_dances()
        self.n_dances = sum(len(self._seeds(v)) for v in protocol.variants) * len(songs)

    def _seeds(self, variant: Variant) -> range:
        first = self.protocol.first_seed
        return range(first, first + (self.protocol.seeds if variant.seeded else 1))

    def _real_dances(self) -> tuple[RealDances | None, str]:
        """What poses are held against: real takes to other songs, or the repertoire's takes."""
        self.report("learning what is real", 0, 0)
        takes = [(song.take.motion, song.song_name) for song in self.songs if song.take is not None]
        what = "the real takes to the other songs"
        if len({name for _, name in takes}) < 2:
            infos = self.repertoire.takes
            takes = [(self.repertoire.motion(i)[0], info.song_name) for i, info in enumerate(infos)]
            what = "the repertoire's takes"
        if len({name for _, name in takes}) < 2:
            self.notes["one real song: no Fréchet distances"] = None
            return None, "nothing"
        try:
            like = self.repertoire.motion(0, 0.0, 0.0)[0]
            return RealDances([m for m, _ in takes], [name for _, name in takes], like=like), what
        except ParameterError as error:
            self.notes[f"no Fréchet distances: {error}"] = None
            return None, "nothing"

    def dance_to(self, song: EvaluatedSong) -> None:
        """Make and measure all dances to a song."""
        loaded = song.load()
        beats_s = beats_of(loaded, self.protocol.beats, start_s=song.start_s)
        starts_s = labels.window_starts_s(loaded.duration_s)
        self.music_labels[song.name] = labels.music_values(loaded.samples, starts_s)
        self.sections[song.name] = song_sections(loaded.samples, beats_s)
        kept: list[ShownDance] = []
        for variant in self.protocol.variants:
            for seed in self._seeds(variant):
                self.report("dancing", len(self.dances), self.n_dances)
                made = dance_as(variant, loaded, self.repertoire, seed=seed, start_s=song.start_s)
                self.notes |= dict.fromkeys(made.notes)
                shown = self._measured(variant.name, song, seed, made.motion, made.plan, beats_s)
                if seed == self.protocol.first_seed:
                    kept.append(shown)
        if song.take is not None:
            found = retrieval_scores(loaded, song.genre, self.repertoire)
            self.found.append(MeasuredDance(SELECTION, song.name, 0, found))
            n_frames = min(song.take.motion.n_frames, round(loaded.duration_s * song.take.motion.fps))
            kept.append(self._measured(REAL, song, 0, song.take.motion.sliced(0, n_frames), None, beats_s))
        if self.shown is None:
            template = self.judge.template(song.genre) if self.judge else None
            self.shown = Shown(song.name, beats_s, tuple(kept), template)

    def _measured(
        self,
        variant: str,
        song: EvaluatedSong,
        seed: int,
        motion: Motion,
        plan: Plan | None,
        beats_s: Floats,
    ) -> ShownDance:
        rng = np.random.default_rng(seed)
        boundaries_s = transition_times_s(plan) if plan else ()
        scores = beat_scores(motion, beats_s, rng) | physical_scores(motion, boundaries_s)
        if self.real is not None:
            scores |= self.real.scores(motion, song.song_name, rng)
        motifs = None
        if self.judge is not None:
            motifs = self.judge.motifs_of(motion, beats_s)
            scores |= self.judge.scores(motifs, song.genre)
            scores |= self.judge.section_scores(motifs, self.sections[song.name])
        if plan is not None:
            scores |= plan_scores(plan, self.repertoire, song.genre)
        self.features.setdefault((variant, seed), []).append(FeatureRows.of(motion, self.real))
        self.dance_labels.append(dance_label_values(motion))
        self.dances.append(MeasuredDance(variant, song.name, seed, scores, plan))
        return ShownDance(variant, motion, plan, motifs)

    def finished(self) -> Evaluation:
        """The evaluation, with what needs all dances: labels, sets, and the takes danced with."""
        dances = self._labelled()
        sets = self._sets()
        takes = self._takes()
        variants = {v.name: v.says for v in self.protocol.variants}
        if any(d.variant == REAL for d in dances):
            variants[REAL] = "the real takes to these songs"
        found = [f for f in self.found if f.scores.values]
        if found:
            variants[SELECTION] = "the repertoire's clips by style, whatever is danced"
        if takes:
            variants[TAKES] = f"the takes that {self.protocol.variants[0].name} danced with, by how long"
        facts = {
            "choreograph": version("choreograph"),
            "repertoire": self.repertoire.path.name,
            "songs": [song.name for song in self.songs],
            "seeds": self.protocol.seeds,
            "beats": Path(self.protocol.beats).name,
            "frechet_against": self.against,
            "seen": self.protocol.seen,
        }
        return Evaluation(
            facts, variants, (*dances, *found, *takes), tuple(sets), tuple(self.notes), self.shown
        )

    def _labelled(self) -> list[MeasuredDance]:
        real = [v for d, v in zip(self.dances, self.dance_labels, strict=True) if d.variant == REAL]
        windows = np.concatenate(real or self.dance_labels)
        music = np.concatenate(list(self.music_labels.values()))
        if len(windows) == 0 or len(music) == 0:
            self.notes["songs shorter than 4 s: no label distances"] = None
            return self.dances
        scale = labels.fit_scale(windows, music)
        return [
            MeasuredDance(
                d.variant, d.song, d.seed,
                d.scores | label_scores(scale, values, self.music_labels[d.song]), d.plan,
            )
            for d, values in zip(self.dances, self.dance_labels, strict=True)
        ]  # fmt: skip

    def _sets(self) -> list[MeasuredDance]:
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

    def _takes(self) -> list[MeasuredDance]:
        """The physics of the takes that the first variant danced with, song by song, by how long it did."""
        plans: dict[str, list[Plan]] = {}
        for dance in dances_of(self.dances, self.protocol.variants[0].name):
            if dance.plan is not None:
                plans.setdefault(dance.song, []).append(dance.plan)
        known: dict[str, dict[str, float]] = {}
        measured = []
        for done, (song, own) in enumerate(plans.items()):
            self.report("measuring takes", done, len(plans))
            danced_s: Counter[str] = Counter()
            for plan in own:
                danced_s.update({take: length_s for take, length_s in plan.takes_s().items() if take})
            for take in danced_s.keys() - known.keys():
                motion, _ = self.repertoire.motion(self.repertoire.take_index(take))
                known[take] = dict(physical_scores(motion).values)
            if danced_s:
                measured.append(MeasuredDance(TAKES, song, 0, weighted(known, danced_s)))
        return measured


def weighted(scores: Mapping[str, Mapping[str, float]], weights: Mapping[str, float]) -> Scores:
    """Mean scores of those that have a weight; a score counts only where it is finite."""
    names = {name for key in weights for name in scores[key]}
    means = {}
    for name in sorted(names):
        pairs = [(scores[key][name], weight) for key, weight in weights.items() if name in scores[key]]
        pairs = [(value, weight) for value, weight in pairs if np.isfinite(value)]
        if pairs:
            values, shares = zip(*pairs, strict=True)
            means[name] = float(np.average(values, weights=shares))
    return Scores(means)


def transition_times_s(plan: Plan) -> Floats:
    """Instants in seconds, (B,), at which one run of a take gives way to another; none of a network's."""
    if plan.engine == "rollout":
        return np.zeros(0)
    return np.array([run.start_s for run in plan_runs(plan)[1:]])
