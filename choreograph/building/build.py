"""From takes and their songs to a repertoire file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.foot_locking import lock_feet
from choreograph.building.options import BuildOptions
from choreograph.building.segmentation import FEWEST_WORDS, make_motifs, segment_takes
from choreograph.building.train_networks import (
    PretrainedWeights,
    train_music_networks,
    train_word_network,
    training_context,
)
from choreograph.errors import ParameterError
from choreograph.features.density import motion_density
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.files import check_target, sha256_of
from choreograph.importers import import_takes
from choreograph.motion.body import body_pos_m
from choreograph.motion.retargeting import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.progress import ProgressReport
from choreograph.repertoire import Contents, NetArrays, Repertoire, write_repertoire
from choreograph.repertoire.contents import MeasuredTake, to_arrays
from choreograph.repertoire.motif_arrays import motif_arrays
from choreograph.takes import Take
from choreograph.timebase import CLIP_S, NET_FPS, STORE_FPS

if TYPE_CHECKING:
    from choreograph.nets.training import TrainingContext


def build_repertoire(
    sources: Iterable[str | Path],
    output: str | Path,
    options: BuildOptions | None = None,
    *,
    report: ProgressReport | None = None,
    training_report: Callable[[Any], None] | None = None,
) -> tuple[Repertoire, tuple[str, ...]]:
    """Import takes, train the networks on them, and write one repertoire file.

    Parameters
    ----------
    sources : folders or files of takes, of any layout that `choreograph.importers` knows
    output : the file to write; work in progress lies beside it in `OUTPUT.build/`
    report : called with the stage's name, how much is done, of how much
    training_report : called with a `TrainingProgress` now and then

    Returns the repertoire and notes on what was odd, one line each.

    Raises
    ------
    ParameterError   no take is left, two takes share a name, an unknown preset
    FormatError      a source is damaged
    """
    options = options or BuildOptions()
    if options.keep_networks and options.init_from is None:
        raise ParameterError("expected another repertoire to keep the networks of (--init-from), got none")
    output = check_target(output)
    beginning = PretrainedWeights.of(options)
    takes, notes = _imported(sources, options, report)
    if options.lock_feet:
        takes = [replace(take, motion=lock_feet(take.motion)) for take in takes]
    measured = [_measured(take) for take in takes]
    short = [m.take.name for m in measured if len(m.body_pos_m) < CLIP_S * NET_FPS]
    if short:
        notes = (*notes, f"{', '.join(short)}: shorter than {CLIP_S} s: no clip comes from there")
    context = training_context(output.with_name(output.name + ".build"), options, training_report)
    nets, trained_on, more = train_music_networks(
        measured, beginning, options=options, context=context, report=report
    )
    learned, about_density = _learned(nets, options)
    words, about_words = _worded(measured, beginning, options, context, report)
    nets |= words.nets
    arrays = to_arrays(
        measured,
        embed_motion=learned.embed_motion,
        density=learned.density or (lambda m: motion_density(len(m.body_pos_m), m.motion_beats_s)),
        checksums=[
            (str(path), sha256_of(path), i) for i, take in enumerate(takes) for path in take.source_paths
        ],
    )
    provenance = {
        "choreograph": version("choreograph"),
        "preset": options.preset,
        "seed": options.seed,
        "init_from": options.init_from.name if options.init_from else None,
        "style_from": options.pretrained_style.name if options.pretrained_style else None,
        "feet_held": options.lock_feet,
        "left_out": sorted(options.leave_out),
        "trained_on": trained_on,
        "selection_beat_weight": learned.selection_beat_weight,
    }
    write_repertoire(
        output,
        Contents(arrays | words.arrays, options.density if learned.density else "analytic", provenance, nets),
        packed=options.packed,
    )
    return Repertoire.open(output), (*notes, *more, *about_density, *about_words)


def _imported(
    sources: Iterable[str | Path], options: BuildOptions, report: ProgressReport | None
) -> tuple[list[Take], tuple[str, ...]]:
    """All takes on one skeleton, and notes."""
    takes: list[Take] = []
    for source in sources:
        for take in import_takes(source):
            if take.name not in options.leave_out:
                takes.append(take)
            if report is not None:
                report("importing", len(takes), 0)
    if not takes:
        raise ParameterError("no take is left to build from")
    names = [take.name for take in takes]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ParameterError(f"two takes are called {twice[0]!r}: the sources overlap, or need other names")
    notes = [f"{take.name}: {note}" for take in takes for note in take.notes]
    first = takes[0].motion.skeleton
    if all(take.motion.skeleton.same_as(first) for take in takes):
        return takes, tuple(notes)
    notes.append("the takes are on different skeletons: all are retargeted to the canonical body")
    body = canonical_skeleton()
    return [replace(take, motion=retarget(take.motion, body)) for take in takes], tuple(notes)


def _measured(take: Take) -> MeasuredTake:
    fine = body_pos_m(take.motion.resampled(STORE_FPS))
    coarse = body_pos_m(take.motion.resampled(NET_FPS)).astype(np.float32)
    return MeasuredTake(take, coarse, motion_beat_times_s(fine, STORE_FPS))


@dataclass(frozen=True, eq=False)
class _Learned:
    """What the trained networks add to the arrays; None where there are none."""

    embed_motion: Callable | None = None
    density: Callable | None = None
    selection_beat_weight: float = 0.0


def _learned(nets: Mapping[str, NetArrays], options: BuildOptions) -> tuple[_Learned, tuple[str, ...]]:
    """Style vectors and tempo-densities as the networks give them, and notes."""
    if "style" not in nets:
        return _Learned(), ()
    from choreograph.nets.style.model import StyleNets

    style = StyleNets.from_arrays(nets["style"].weights, nets["style"].config)
    beat_weight = style.config.beat_weight / style.config.style_weight
    if options.density != "learned":
        return _Learned(style.embed_motion, None, beat_weight), ()
    if "motion_density" not in nets:
        note = "no tempo-density networks: the clips carry the analytic tempo-density"
        return _Learned(style.embed_motion, None, beat_weight), (note,)
    from choreograph.nets.density.model import MotionDensity

    net = nets["motion_density"]
    estimator = MotionDensity.from_arrays(net.weights, net.config)
    return _Learned(style.embed_motion, lambda m: estimator.take_density(m.body_pos_m), beat_weight), ()


@dataclass(frozen=True, eq=False)
class _Worded:
    """Networks of motion words, and the arrays of the vocabulary; none where there are too few words."""

    nets: dict[str, NetArrays] = field(default_factory=dict)
    arrays: dict[str, NDArray] = field(default_factory=dict)


def _worded(
    measured: Sequence[MeasuredTake],
    beginning: PretrainedWeights,
    options: BuildOptions,
    context: TrainingContext,
    report: ProgressReport | None,
) -> tuple[_Worded, tuple[str, ...]]:
    """The takes' motion words, their networks and their motifs, and notes."""
    if not options.words:
        return _Worded(), ()
    segmented, notes = segment_takes(measured, report=report)
    net = train_word_network(segmented, beginning, options=options, context=context)
    nets = {} if net is None else {"words": net}
    n_words = sum(len(take.words) for take in segmented)
    if net is None or n_words < FEWEST_WORDS:
        few = f"{n_words} motion words, fewer than {FEWEST_WORDS}: no motifs, so no genre to dance by"
        return _Worded(nets), (*notes, few)
    from choreograph.nets.words.model import WordNet

    words = WordNet.from_arrays(net.weights, net.config)
    vocabulary = make_motifs(segmented, words, seed=options.seed)
    if "rollout" in beginning.kept:
        nets["rollout"] = beginning.kept["rollout"]
    elif options.rollout:
        from choreograph.building.train_rollout import train_rollout_network
        from choreograph.nets.rollout.config import rollout_config

        nets["rollout"] = train_rollout_network(
            measured, segmented, vocabulary, words, rollout_config(options.preset), seed=options.seed, context=context,
            pretrained=beginning.nets.get("rollout"), report=report,
        )  # fmt: skip
    return _Worded(nets, motif_arrays(vocabulary)), notes
