"""The build of a repertoire file from takes and their songs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from choreograph.core.cache import caching, digest
from choreograph.core.counts import FROM_MOTION
from choreograph.core.files import check_apart, check_target, folder_beside, locked_folder
from choreograph.core.progress import ProgressReport
from choreograph.core.workers import beside, is_of_torchrun, working
from choreograph.formats.download import is_address, local_sources
from choreograph.library.building.counting import Counting
from choreograph.library.building.networks import (
    STYLE_NET,
    PretrainedWeights,
    Teacher,
    source_checksums,
    taught_dances,
    train_music_networks,
    train_rollout_network,
    train_word_network,
    training_content,
)
from choreograph.library.building.options import BuildOptions, BuildResult
from choreograph.library.building.takes import kept_notes, measured_takes
from choreograph.library.building.words import (
    FEWEST_WORDS,
    KeptMotifs,
    SegmentedTake,
    keep_motifs,
    make_motifs,
    segment_takes,
)
from choreograph.library.builtin import MOTION_NET, load_motion_counter, pretrained_set
from choreograph.library.notes import Note, note_arrays, summary
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import NetArrays, rollout_names
from choreograph.library.songs import SongCache, song_notes
from choreograph.library.vocabulary import Vocabulary, motif_arrays
from choreograph.library.writing import (
    ClipDensity,
    Contents,
    EmbedMotion,
    MeasuredTake,
    to_arrays,
    write_repertoire,
)
from choreograph.motion.motion import Take
from choreograph.music.song_features import motion_density

if TYPE_CHECKING:
    from choreograph.nets.training import TrainingContext, TrainingProgress


def build_repertoire(
    sources: Iterable[str | Path],
    output: str | Path,
    options: BuildOptions | None = None,
    *,
    teacher: Teacher | None = None,
    report: ProgressReport | None = None,
    training_report: Callable[[Any], None] | None = None,
) -> BuildResult:
    """Import takes, train the networks on them, and write one repertoire file.

    Parameters
    ----------
    sources : folders or files of takes, of any layout in `choreograph.formats.register`, or their addresses
        as of `choreograph.formats.download`
    output : the file to write. Work in progress lies beside it in `OUTPUT.build/`
    teacher : makes dances that the rollout network learns from in addition to the takes, by default none
    report : called with the name of the stage, the work done so far, and all the work
    training_report : called repeatedly with a `TrainingProgress`

    Raises
    ------
    ChoreographError another process builds `output`
    ParameterError   no take is left, two takes share a name, there is no such device
    FormatError      a source is damaged
    """
    from choreograph.nets.training import select_device

    options = options or BuildOptions()
    select_device(options.device)
    sources = tuple(sources)
    output = check_target(output)
    work = folder_beside(output, ".build")
    on_disk = [source for source in sources if not is_address(source)]
    check_apart([output, work], [*on_disk, *([options.init_from] if options.init_from else ())])
    doing = f"builds {output.name}"
    with (
        locked_folder(work, doing=doing),
        local_sources(sources, work, report) as paths,
        working(options.workers, options.dask, stage=options.stage) as cluster,
        caching(options.cache_gb) as kept,
    ):
        if cluster is not None:
            paths = tuple(source.absolute() for source in paths)  # workers are elsewhere
            if report is not None:
                report(f"connected, {cluster.dashboard}", 0, 0)
        notes = _write_built(paths, output, work, options, teacher, report, training_report)
    repertoire = Repertoire.open(output)
    n_takes = len(repertoire.takes)
    return BuildResult(repertoire, summary([*notes, *kept_notes(kept, n_takes)], n_takes, output.name))


def _write_built(
    sources: Iterable[str | Path],
    output: Path,
    work: Path,
    options: BuildOptions,
    teacher: Teacher | None,
    report: ProgressReport | None,
    training_report: Callable[[Any], None] | None,
) -> list[Note]:
    """Build and write the file `output`, with work in progress in `work`. Returns notes."""
    from choreograph.nets.training import TrainingContext, select_device

    shipped = pretrained_set(options.pretrained)
    pretrained = PretrainedWeights.of(options, shipped)
    songs = SongCache(options.beats, keep_samples=options.rollout)
    counting = Counting(songs, load_motion_counter(shipped))
    measured, notes = measured_takes(sources, options, report, counting)
    check_apart([output], [path for m in measured for path in m.take.source_paths])
    checksums = source_checksums(measured, sources)
    content = training_content(measured, checksums, options)
    context = TrainingContext(  # checkpoints NAME.pt and logs NAME.jsonl are in `work`
        work, options.resume, options.device, options.precision, training_report or (lambda progress: None),
        content, lambda text: notes.append(Note("training", values={"text": text})),
    )  # fmt: skip
    counter_trained_on: tuple[str, ...] = ()  # songs, if it counted a take
    if pretrained.from_shipped:
        kind = "style kept" if pretrained.keep else "style begins"
        notes.append(Note(kind, values={"networks": shipped[STYLE_NET].description}))
    if any(m.take.counts.source == FROM_MOTION for m in measured):
        counter_trained_on = shipped[MOTION_NET].trained_on
        notes.append(Note("counting networks", values={"networks": shipped[MOTION_NET].description}))
    segmented, segment_notes = segment_takes(measured, songs, report=report) if options.words else ([], [])
    train_words = partial(_trained_words, segmented, pretrained, options)
    at_once = options.words and not (pretrained.keep or is_of_torchrun())
    at_once = at_once and select_device(options.device).type == "cpu"
    elsewhere = partial(train_words, replace(context, report=_unseen)) if at_once else None
    with beside(partial(train_words, context), elsewhere) as words_net:
        nets, trained_on, music_notes = train_music_networks(
            measured, songs, pretrained, options=options, context=context, report=report
        )
        notes += [*music_notes, *song_notes([m.take for m in measured], songs)]
        features = clip_features(nets, options.density, notes)
        notes += segment_notes
        words = _WordParts()
        if options.words:
            net, word_notes, progress = words_net()
            if elsewhere is not None and progress is not None:
                context.report(progress)
            notes += word_notes
            words = _words(segmented, net, pretrained.motifs, measured, options, notes)
    arrays = features.arrays(measured, checksums)
    contents = Contents(
        arrays | words.arrays,
        options.density if features.density else "analytic",
        _provenance(
            options,
            [*trained_on, *counter_trained_on],
            features.selection_beat_weight,
            with_teacher=teacher is not None,
            motif_set=words.motif_set,
        ),
        nets | words.nets,
    )
    rollout: dict[str, NetArrays] = {}
    if words.vocabulary is not None:
        rollout = _rollout_net(
            contents, words, measured, songs, pretrained, options, context, teacher, report
        )
    songs_trained_on = set(contents.provenance["trained_on"])
    if {*words.nets, *rollout} - pretrained.kept.keys():  # trained on these takes
        songs_trained_on |= {m.take.song_name for m in measured if m.take.song_name}
    contents = replace(
        contents,
        arrays={**contents.arrays, **note_arrays(notes)},
        nets={**contents.nets, **rollout},
        provenance=contents.provenance | {"trained_on": sorted(songs_trained_on)},
    )
    write_repertoire(output, contents, compress=options.compress)
    return notes


def _provenance(
    options: BuildOptions,
    trained_on: Sequence[str],
    selection_beat_weight: float,
    *,
    with_teacher: bool,
    motif_set: str,
) -> dict[str, Any]:
    """The provenance of the file, for `inspect` and for evaluation."""
    return {
        "choreograph": version("choreograph"),
        "method": options.method,
        "preset": options.preset,
        "seed": options.seed,
        "init_from": options.init_from.name if options.init_from else None,
        "pretrained": options.pretrained,
        "beats": options.beats,
        "feet_locked": options.lock_feet,
        "rollout_teacher": options.rollout and options.rollout_teacher and with_teacher,
        "left_out": sorted(options.leave_out),
        "trained_on": sorted(set(trained_on)),
        "selection_beat_weight": selection_beat_weight,
        "motifs": motif_set,
        "style_changes": dict(options.style_changes),
        "density_changes": dict(options.density_changes),
        "rollout_changes": dict(options.rollout_changes),
    }


@dataclass(frozen=True, eq=False)
class ClipFeatures:
    """Features of clips by the trained networks, or None without the networks."""

    embed_motion: EmbedMotion | None = None
    density: ClipDensity | None = None
    selection_beat_weight: float = 0.0

    def arrays(
        self, measured: Sequence[MeasuredTake], checksums: Sequence[tuple[str, str, int]]
    ) -> dict[str, NDArray[Any]]:
        """The arrays of takes by path. `checksums` are those of `networks.source_checksums`."""
        analytic: ClipDensity = lambda m: motion_density(len(m.body_pos_m), m.motion_beats_s)  # noqa: E731
        return to_arrays(
            measured,
            embed_motion=self.embed_motion,
            density=self.density or analytic,
            checksums=checksums,
        )


def clip_features(nets: Mapping[str, NetArrays], density: str, notes: list[Note]) -> ClipFeatures:
    """Style vectors and tempo-densities, computed by the networks. Appends to `notes`."""
    if "style" not in nets:
        return ClipFeatures()
    from choreograph.nets.style import StyleNets

    style = StyleNets.from_arrays(nets["style"].weights, nets["style"].config)
    beat_weight = style.config.beat_weight / style.config.style_weight
    if density != "learned":
        return ClipFeatures(style.embed_motion, None, beat_weight)
    if "motion_density" not in nets:
        notes.append(Note("no density networks"))
        return ClipFeatures(style.embed_motion, None, beat_weight)
    from choreograph.nets.density import MotionDensity

    net = nets["motion_density"]
    estimator = MotionDensity.from_arrays(net.weights, net.config)
    return ClipFeatures(style.embed_motion, lambda m: estimator.take_density(m.body_pos_m), beat_weight)


@dataclass(frozen=True, eq=False)
class _WordParts:
    """Networks of motion words, and the arrays of the vocabulary, or none where there are too few words."""

    nets: dict[str, NetArrays] = field(default_factory=dict)
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    segmented: Sequence[SegmentedTake] = ()
    vocabulary: Vocabulary | None = None
    motif_set: str = ""  # `Repertoire.motif_set`


def _trained_words(
    segmented: Sequence[SegmentedTake],
    pretrained: PretrainedWeights,
    options: BuildOptions,
    context: TrainingContext,
) -> tuple[NetArrays | None, list[Note], TrainingProgress | None]:
    """The network of motion words, with notes on its training and the last of its progress."""
    notes: list[Note] = []
    last: TrainingProgress | None = None

    def report(progress: TrainingProgress) -> None:
        nonlocal last
        last = progress
        context.report(progress)

    def note(text: str) -> None:
        notes.append(Note("training", values={"text": text}))

    own = replace(context, report=report, note=note)
    net = train_word_network(segmented, pretrained, options=options, context=own)
    return net, notes, last


def _unseen(progress: TrainingProgress) -> None:
    """The report of a training in another process, whose progress is seen when it has ended."""


def _words(
    segmented: Sequence[SegmentedTake],
    net: NetArrays | None,
    kept: KeptMotifs | None,
    measured: Sequence[MeasuredTake],
    options: BuildOptions,
    notes: list[Note],
) -> _WordParts:
    """The takes' motion words, their networks and their motifs, kept or found. Appends to `notes`."""
    nets = {} if net is None else {"words": net}
    n_words = sum(len(take.words) for take in segmented)
    if net is None or n_words < (FEWEST_WORDS if kept is None else 1):
        notes.append(Note("few words", values={"words": n_words, "fewest": FEWEST_WORDS}))
        return _WordParts(nets)
    from choreograph.nets.words import WordNet

    words = WordNet.from_arrays(net.weights, net.config)
    if kept is None:
        vocabulary = make_motifs(segmented, words, seed=options.seed)
        motif_set = digest(vocabulary.motifs.embeddings).hex()
    else:
        vocabulary = keep_motifs(segmented, kept, words, [m.body_pos_m for m in measured])
        motif_set = kept.of_set
    return _WordParts(nets, motif_arrays(vocabulary), segmented, vocabulary, motif_set)


def _rollout_net(
    contents: Contents,
    parts: _WordParts,
    measured: Sequence[MeasuredTake],
    songs: SongCache,
    pretrained: PretrainedWeights,
    options: BuildOptions,
    context: TrainingContext,
    teacher: Teacher | None,
    report: ProgressReport | None,
) -> dict[str, NetArrays]:
    """The rollout network, or that of each genre, by its name, kept or trained, or nothing without it.

    The `teacher` makes dances from `contents`, the repertoire without this network.
    """
    if kept := rollout_names(pretrained.kept):
        return {name: pretrained.kept[name] for name in kept}
    if not options.rollout:
        return {}
    from choreograph.nets.configs import rollout_config, taught
    from choreograph.nets.words import WordNet

    assert parts.vocabulary is not None and context.folder is not None
    dances: Sequence[Take] = ()
    if teacher is not None and options.rollout_teacher:
        dances = taught_dances(contents, [m.take for m in measured], teacher, context.folder)
    words = WordNet.from_arrays(parts.nets["words"].weights, parts.nets["words"].config)
    config = rollout_config(options.preset, **options.rollout_changes)
    begins = pretrained.nets.get("rollout")
    return train_rollout_network(
        measured, parts.segmented, parts.vocabulary, words, taught(config) if dances else config,
        dances=dances, songs=songs, seed=options.seed, context=context, pretrained=begins, report=report,
    )  # fmt: skip
