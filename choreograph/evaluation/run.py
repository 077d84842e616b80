"""Run an evaluation: dance to songs in several variants and seeds, keep the dances, and measure every one."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from choreograph.choreography.constraints import Constraints
from choreograph.choreography.engine import engines
from choreograph.core.errors import ChoreographError, ParameterError, RepertoireError
from choreograph.core.files import atomic_path, locked_folder, sha256_of
from choreograph.core.numerics import Floats, default_numerics
from choreograph.core.progress import ProgressReport
from choreograph.core.timebase import CLIP_S, NET_FPS, NODE_FRAMES, SEGMENT_S
from choreograph.evaluation.dance_scores import dance_scores
from choreograph.evaluation.metrics import labels
from choreograph.evaluation.plan_scores import CountedDance, scorer_for
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
from choreograph.formats.npz import read_npz
from choreograph.formats.register import save_motion
from choreograph.library.repertoire import Repertoire
from choreograph.motion.body import body_pos_m
from choreograph.music.beats import DEFAULT_TRACKER
from choreograph.music.song import Song
from choreograph.pipeline import dancing, published
from choreograph.pipeline.dancing import Dance
from choreograph.plan.plan import Plan, PlannedSecond
from choreograph.render.rendering import render
from choreograph.settings import TRANSITION_LENGTHS_S, DanceConfig

# Variants to compare: the engines, the published method, and baselines.


@dataclass(frozen=True)
class Variant:
    """A way to dance: the settings of an engine, or random clips."""

    name: str
    description: str  # one line in the report
    config: DanceConfig = field(default_factory=DanceConfig)
    seeded: bool = True  # whether the dance depends on the seed
    random_clips: bool = False
    method: str = ""  # the provenance of its repertoires begins with this, "" for any


VARIANTS: dict[str, Variant] = {
    variant.name: variant
    for variant in (
        Variant("ours", "the defaults"),
        Variant("greedy", "ours with the greedy planner", DanceConfig(planner="greedy")),
        Variant("mixer", "the mixer engine: motion words of takes", DanceConfig(engine="mixer")),
        Variant("rollout", "the rollout engine: motion from a network", DanceConfig(engine="rollout")),
        Variant(
            "as-published",
            "ChoreoGraph as published, throughout: networks, selection, warping, graph and blending",
            published.published_dance(),
            seeded=False,
            method=published.METHOD,
        ),
        Variant(
            "random",
            "random clips: their middle 4 s unwarped, linear blending",
            DanceConfig(blending="linear", transitions="seconds"),
            random_clips=True,
        ),
    )
}
GROUPS: dict[str, tuple[str, ...]] = {
    "engines": ("ours", "mixer", "rollout"),
    "baselines": ("ours", "greedy", "random"),
}


def variants_named(
    names: Sequence[str],
    variants: Mapping[str, Variant] = VARIANTS,
    groups: Mapping[str, tuple[str, ...]] = GROUPS,
) -> tuple[Variant, ...]:
    """The variants with these names or in these groups, each once. `ParameterError` for an unknown name."""
    chosen: dict[str, Variant] = {}
    for name in names:
        if name not in groups and name not in variants:
            raise ParameterError(f"expected variants among {', '.join([*groups, *variants])}, got {name!r}")
        chosen.update({member: variants[member] for member in groups.get(name, (name,))})
    return tuple(chosen.values())


def check_variant(variant: Variant, repertoire: Repertoire) -> None:
    """Raise `RepertoireError` or `ParameterError`, before any work, if the repertoire cannot dance it."""
    built_by = repertoire.provenance.get("method", "ours")
    if not built_by.startswith(variant.method):
        raise RepertoireError(
            f"{repertoire.path}: expected a repertoire of `choreograph build-db --{variant.method}` for "
            f"{variant.name}, got one built otherwise: its networks were trained by another method"
        )
    if not variant.random_clips:
        try:
            engines()[variant.config.engine].check(repertoire, variant.config, Constraints(), ())
        except ChoreographError as error:
            raise type(error)(f"cannot dance the variant {variant.name}: {error}") from error
    elif repertoire.n_clips == 0:
        raise RepertoireError(
            f"{repertoire.path}: expected clips, got none: all takes are shorter than {CLIP_S} s"
        )


def dance_variant(variant: Variant, song: Song, repertoire: Repertoire, *, seed: int = 0) -> Dance:
    """The dance of the variant to a song. Raises as `dance` and `check_variant` do."""
    check_variant(variant, repertoire)
    config = replace(variant.config, seed=seed)
    if not variant.random_clips:
        return dancing.dance(song, repertoire, config=config)
    plan = _random_plan(song, repertoire, config)
    return Dance(render(plan, repertoire), plan, song_path=song.path)


def _random_plan(song: Song, repertoire: Repertoire, config: DanceConfig) -> Plan:
    """A random clip for every 4 s: its middle 4 s at recorded speed."""
    n_seconds = max(1, int(np.ceil(song.duration_s - 1e-9)))
    drawn = np.random.default_rng(config.seed).integers(repertoire.n_clips, size=-(-n_seconds // SEGMENT_S))
    seconds = []
    for second in range(n_seconds):
        clip, offset = int(drawn[second // SEGMENT_S]), second % SEGMENT_S
        take = repertoire.takes[int(repertoire.clip_take[clip])]
        first_s = repertoire.clip_start_s(clip) + (CLIP_S - SEGMENT_S) / 2 + offset
        seconds.append(
            PlannedSecond(
                second=second, take=take.name, clip=clip, clip_start_s=repertoire.clip_start_s(clip),
                segment_second=second - offset, offset=offset,
                source_times_s=tuple(np.linspace(first_s, first_s + 1.0, NODE_FRAMES + 1).tolist()),
                start_s=float(second), transition_s=TRANSITION_LENGTHS_S[config.blending][0],
                costs={}, credits=take.credits,
            )
        )  # fmt: skip
    return Plan(
        song=song.name, duration_s=song.duration_s, start_s=song.start_s, repertoire=repertoire.path.name,
        planner="greedy", blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=(), seconds=tuple(seconds),
    )  # fmt: skip


# Dances of an evaluation are kept until it is complete, so that one that was stopped can be resumed.
#
# Dancing takes most of the time. The motion, the plan and the notes of each dance are kept in a folder. The
# dance is measured again when the evaluation is resumed, so that the results are those of an evaluation
# without a stop. A dance is identified by the bytes of song and repertoire, the part of the song, the
# settings of the variant, and the seed.


_DIGITS = 32  # of the checksum that a dance's files are named by
_NAME = "?" * _DIGITS


class KeptDances:
    """The dances in a folder. Open it with `kept_dances`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._checksums: dict[Path, str] = {}  # of songs and repertoires

    def __len__(self) -> int:
        return len(list(self._folder.glob(f"{_NAME}.json"))) if self._folder.exists() else 0

    def find(self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire) -> Dance | None:
        """The dance, if it was kept. None if it is damaged."""
        path = self._path(song, variant, seed, repertoire)
        if not path.exists():
            return None
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
            motion = read_npz(path.with_suffix(".npz"))
            plan = Plan.from_json(json.dumps(stored["plan"]), name=str(path))
            return Dance(motion, plan, tuple(map(str, stored["notes"])), song.path)
        except (OSError, ValueError, KeyError, TypeError, ChoreographError):
            return None

    def keep(
        self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire, dance: Dance
    ) -> None:
        """Keep a dance. `ChoreographError` if it cannot be written."""
        path = self._path(song, variant, seed, repertoire)
        save_motion(path.with_suffix(".npz"), dance.motion)
        text = json.dumps({"plan": json.loads(dance.plan.to_json()), "notes": dance.notes})
        with atomic_path(path) as temporary:  # last: with it, the dance is complete
            temporary.write_text(text, encoding="utf-8")

    def clear(self) -> None:
        """Remove all dances, and the files that killed processes left."""
        for pattern in (f"{_NAME}.json", f"{_NAME}.npz", f".{_NAME}.*"):
            for path in self._folder.glob(pattern):
                path.unlink(missing_ok=True)

    def _path(self, song: EvaluatedSong, variant: Variant, seed: int, repertoire: Repertoire) -> Path:
        made_of = {
            "choreograph": version("choreograph"),
            "song": self._checksum(song.path),
            "part_s": [song.start_s, song.duration_s],
            "repertoire": [self._checksum(path) for path in repertoire.paths],
            "variant": asdict(variant),
            "seed": seed,
        }
        digest = hashlib.sha256(json.dumps(made_of, sort_keys=True, default=str).encode()).hexdigest()
        return self._folder / f"{digest[:_DIGITS]}.json"

    def _checksum(self, path: Path) -> str:
        if path not in self._checksums:
            self._checksums[path] = sha256_of(path)
        return self._checksums[path]


@contextmanager
def kept_dances(folder: Path, *, resume: bool, doing: str) -> Iterator[KeptDances]:
    """The dances kept in `folder` while the block runs, removed when it ends without an error.

    Without `resume` those of an evaluation that was stopped are removed first. Raises `ChoreographError` if
    another process evaluates there. `doing` describes this one in its message.
    """
    with locked_folder(folder, doing=doing):
        kept = KeptDances(folder)
        if not resume:
            kept.clear()
        yield kept
        kept.clear()


# The evaluation itself: every variant dances to every song with every seed, and all dances are measured.


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
