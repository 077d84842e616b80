"""The build of a repertoire file from takes and their songs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.core.counts import FROM_MOTION
from choreograph.core.files import check_apart, check_target, folder_beside, locked_folder, sha256_of
from choreograph.core.progress import ProgressReport
from choreograph.library.building.counting import MOTION_NET, count_notes, counted_takes, load_motion_counter
from choreograph.library.building.networks import (
    STYLE_NET,
    PretrainedWeights,
    source_checksums,
    train_music_networks,
    train_word_network,
    training_content,
    training_context,
)
from choreograph.library.building.options import BuildOptions, BuildResult
from choreograph.library.building.takes import (
    FEWEST_WORDS,
    SegmentedTake,
    make_motifs,
    measure_take,
    measured_takes,
    segment_takes,
)
from choreograph.library.builtin import pretrained_set
from choreograph.library.motifs import Vocabulary, motif_arrays
from choreograph.library.notes import Note, note_arrays, summary
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import Contents, NetArrays, rollout_names
from choreograph.library.songs import SongCache, music_of_take, song_notes
from choreograph.library.writing import ClipDensity, EmbedMotion, MeasuredTake, to_arrays, write_repertoire
from choreograph.motion.motion import Take
from choreograph.music.song_features import motion_density

if TYPE_CHECKING:
    from choreograph.nets.configs import RolloutConfig
    from choreograph.nets.rollout_training import RolloutTake
    from choreograph.nets.training import TrainingContext
    from choreograph.nets.words import WordNet

# Dances of a repertoire to the songs of takes, as takes with counts. The folder keeps finished work for a
# resumed build.
Teacher = Callable[[Repertoire, Sequence[Take], Path], list[Take]]


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
    sources : folders or files of takes, of any layout in `choreograph.formats.register`
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
    check_apart([output, work], [*sources, *([options.init_from] if options.init_from else ())])
    with locked_folder(work, doing=f"builds {output.name}"):
        notes = _write_built(sources, output, work, options, teacher, report, training_report)
    repertoire = Repertoire.open(output)
    return BuildResult(repertoire, summary(notes, len(repertoire.takes), output.name))


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
    shipped = pretrained_set(options.pretrained)
    pretrained = PretrainedWeights.of(options, shipped)
    measured, notes = measured_takes(sources, options, report)
    check_apart([output], [path for m in measured for path in m.take.source_paths])
    checksums = source_checksums(measured, sources)
    content = training_content(measured, checksums, options)
    context = training_context(
        work, options, content, training_report,
        note=lambda text: notes.append(Note("training", values={"text": text})),
    )  # fmt: skip
    songs = SongCache(options.beats, keep_samples=options.rollout)
    measured, decisions = counted_takes(measured, songs, load_motion_counter(shipped))
    notes += count_notes(measured, decisions)
    counter_trained_on: tuple[str, ...] = ()  # songs, if it counted a take
    if pretrained.from_shipped:
        kind = "style kept" if pretrained.keep else "style begins"
        notes.append(Note(kind, values={"networks": shipped[STYLE_NET].description}))
    if any(m.take.counts.source == FROM_MOTION for m in measured):
        counter_trained_on = shipped[MOTION_NET].trained_on
        notes.append(Note("counting networks", values={"networks": shipped[MOTION_NET].description}))
    nets, trained_on, music_notes = train_music_networks(
        measured, songs, pretrained, options=options, context=context, report=report
    )
    notes += [*music_notes, *song_notes([m.take for m in measured], songs)]
    features = _clip_features(nets, options, notes)
    words = _words(measured, songs, pretrained, options, context, report, notes)
    arrays = to_arrays(
        measured,
        embed_motion=features.embed_motion,
        density=features.density or (lambda m: motion_density(len(m.body_pos_m), m.motion_beats_s)),
        checksums=checksums,
    )
    contents = Contents(
        arrays | words.arrays,
        options.density if features.density else "analytic",
        _provenance(
            options, [*trained_on, *counter_trained_on], features.selection_beat_weight, teacher is not None
        ),
        nets | words.nets,
    )
    if words.vocabulary is not None:
        rollout = _rollout_net(
            contents, words, measured, songs, pretrained, options, context, teacher, report
        )
        contents = replace(contents, nets={**contents.nets, **rollout})
    contents = replace(contents, arrays={**contents.arrays, **note_arrays(notes)})
    write_repertoire(output, contents, compress=options.compress)
    return notes


def _provenance(
    options: BuildOptions, trained_on: Sequence[str], selection_beat_weight: float, with_teacher: bool
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
        "style_changes": dict(options.style_changes),
        "density_changes": dict(options.density_changes),
        "rollout_changes": dict(options.rollout_changes),
    }


@dataclass(frozen=True, eq=False)
class _ClipFeatures:
    """Features of clips by the trained networks, or None without the networks."""

    embed_motion: EmbedMotion | None = None
    density: ClipDensity | None = None
    selection_beat_weight: float = 0.0


def _clip_features(nets: Mapping[str, NetArrays], options: BuildOptions, notes: list[Note]) -> _ClipFeatures:
    """Style vectors and tempo-densities, computed by the networks. Appends to `notes`."""
    if "style" not in nets:
        return _ClipFeatures()
    from choreograph.nets.style import StyleNets

    style = StyleNets.from_arrays(nets["style"].weights, nets["style"].config)
    beat_weight = style.config.beat_weight / style.config.style_weight
    if options.density != "learned":
        return _ClipFeatures(style.embed_motion, None, beat_weight)
    if "motion_density" not in nets:
        notes.append(Note("no density networks"))
        return _ClipFeatures(style.embed_motion, None, beat_weight)
    from choreograph.nets.density import MotionDensity

    net = nets["motion_density"]
    estimator = MotionDensity.from_arrays(net.weights, net.config)
    return _ClipFeatures(style.embed_motion, lambda m: estimator.take_density(m.body_pos_m), beat_weight)


@dataclass(frozen=True, eq=False)
class _WordParts:
    """Networks of motion words, and the arrays of the vocabulary, or none where there are too few words."""

    nets: dict[str, NetArrays] = field(default_factory=dict)
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    segmented: Sequence[SegmentedTake] = ()
    vocabulary: Vocabulary | None = None


def _words(
    measured: Sequence[MeasuredTake],
    songs: SongCache,
    pretrained: PretrainedWeights,
    options: BuildOptions,
    context: TrainingContext,
    report: ProgressReport | None,
    notes: list[Note],
) -> _WordParts:
    """The takes' motion words, their networks and their motifs. Appends to `notes`."""
    if not options.words:
        return _WordParts()
    segmented, segment_notes = segment_takes(measured, songs, report=report)
    notes += segment_notes
    net = train_word_network(segmented, pretrained, options=options, context=context)
    nets = {} if net is None else {"words": net}
    n_words = sum(len(take.words) for take in segmented)
    if net is None or n_words < FEWEST_WORDS:
        notes.append(Note("few words", values={"words": n_words, "fewest": FEWEST_WORDS}))
        return _WordParts(nets)
    from choreograph.nets.words import WordNet

    words = WordNet.from_arrays(net.weights, net.config)
    vocabulary = make_motifs(segmented, words, seed=options.seed)
    return _WordParts(nets, motif_arrays(vocabulary), segmented, vocabulary)


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


# The rollout network of a library: takes with their words and their music, and its training.
#
# The network may also learn from dances that an engine makes from the takes to their songs. These are on the
# count by construction, so that the network keeps counts and bars better. The engine is passed as a
# `Teacher`, since this package does not import engines. Training imports torch.


def train_rollout_network(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    config: RolloutConfig,
    *,
    dances: Sequence[Take] = (),
    songs: SongCache,
    seed: int,
    context: TrainingContext,
    pretrained: NetArrays | None,
    report: ProgressReport | None,
) -> dict[str, NetArrays]:
    """Train the rollout network on all takes with music and on `dances` of them. Returns it by its name.

    With `RolloutConfig.by_genre` there is one for each genre, as in the paper (section 5). Training starts
    from `pretrained` if given. Raises `ParameterError` if no take, or no take of a genre, has words with
    music for as long as a training sequence.
    """
    from choreograph.nets.rollout_training import train_rollouts

    takes = rollout_takes(measured, segmented, vocabulary, words, songs=songs, report=report)
    if dances:
        danced = [measure_take(take) for take in dances]
        danced_words, of_dances = words_of_dances(danced, vocabulary, words, songs)
        takes += rollout_takes(danced, danced_words, of_dances, words, songs=songs, report=report)
    weights = None if pretrained is None else pretrained.weights
    nets = {}
    trained = train_rollouts(takes, words, config, seed=seed, context=context, pretrained=weights)
    for index, net in enumerate(trained):
        arrays, stored = net.to_arrays()
        nets[f"rollout_{index}" if config.by_genre else "rollout"] = NetArrays(stored, arrays)
    return nets


def taught_dances(contents: Contents, takes: Sequence[Take], teacher: Teacher, work: Path) -> list[Take]:
    """The teacher's dances to the songs of `takes` with the repertoire of `contents`.

    That repertoire and the finished dances are stored in `work`, where a resumed build with the same contents
    finds them.
    """
    draft = work / "untaught.h5"
    work.mkdir(parents=True, exist_ok=True)
    write_repertoire(draft, contents)
    return teacher(Repertoire.open(draft), takes, work / f"graph-dances-{sha256_of(draft)[:12]}")


def rollout_takes(
    measured: Sequence[MeasuredTake],
    segmented: Sequence[SegmentedTake],
    vocabulary: Vocabulary,
    words: WordNet,
    *,
    songs: SongCache,
    report: ProgressReport | None = None,
) -> list[RolloutTake]:
    """The takes with music, as training data of the network.

    The rhythm of the music is aligned with the counts of the take, even if the recording is not. `segmented`
    are the words of `measured`. `songs` must keep samples.
    """
    from choreograph.nets.rollout_poses import ROLLOUT_FPS
    from choreograph.nets.rollout_training import RolloutTake

    takes = []
    for index, (m, of_take) in enumerate(zip(measured, segmented, strict=True)):
        take, bounds = m.take, of_take.words
        if take.song_path is None or len(bounds) == 0:
            continue
        analysed = songs.analysed(take.song_path)
        music = music_of_take(take, analysed, np.append(bounds.start_s, bounds.end_s[-1]))
        motif = vocabulary.word_motif[vocabulary.words_of_take(index)]
        takes.append(
            RolloutTake(
                name=take.name,
                motion=take.motion.resampled(ROLLOUT_FPS),
                rhythm=music.rhythm,
                count_phase=music.count_phase,
                start_s=bounds.start_s,
                end_s=bounds.end_s,
                motif=vocabulary.motifs.embeddings[motif],
                embedding=words.embed(bounds.body_pos_m),
                spectral=music.spectral,
                genre=take.credits.genre,
            )
        )
        if report is not None:
            report("analysing the music of words", index + 1, len(measured))
    return takes


def words_of_dances(
    dances: Sequence[MeasuredTake], vocabulary: Vocabulary, words: WordNet, songs: SongCache
) -> tuple[list[SegmentedTake], Vocabulary]:
    """The words of dances, and the vocabulary with these words instead of those of the takes."""
    segmented, _ = segment_takes(dances, songs)
    motif = vocabulary.motifs.nearest(words.embed(np.concatenate([t.words.body_pos_m for t in segmented])))
    of_dances = replace(
        vocabulary,
        word_take=np.repeat(np.arange(len(segmented)), [len(take.words) for take in segmented]),
        word_start_s=np.concatenate([take.words.start_s for take in segmented]),
        word_end_s=np.concatenate([take.words.end_s for take in segmented]),
        word_motif=motif,
    )
    return segmented, of_dances
