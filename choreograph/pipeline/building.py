"""From takes and their songs to a repertoire file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from choreograph.blending.feet import lock_feet
from choreograph.errors import ParameterError
from choreograph.features.density import motion_density
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.files import check_target, sha256_of
from choreograph.importers import import_takes
from choreograph.motion.body import body_pos_m
from choreograph.motion.retarget import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.pipeline.learning import Beginning, Report, music_networks, training_place, word_network
from choreograph.pipeline.wording import FEWEST_WORDS, cut_takes, make_motifs
from choreograph.repertoire import Contents, NetArrays, Repertoire, write_repertoire
from choreograph.repertoire.contents import MeasuredTake, to_arrays
from choreograph.repertoire.motif_arrays import motif_arrays
from choreograph.takes import Take
from choreograph.timebase import CLIP_S, NET_FPS, STORE_FPS

if TYPE_CHECKING:
    from choreograph.nets.training import TrainingPlace


@dataclass(frozen=True)
class BuildOptions:
    """How to build a repertoire; see `choreograph build-db --help`."""

    preset: str = "small"  # size and training length of the networks: tiny, small, paper
    density: str = "analytic"  # which tempo-density clips carry; the README's table says why
    seed: int = 0
    device: str = "auto"
    resume: bool = False
    init_from: Path | None = None  # networks of another repertoire to begin with
    style_from: Path | None = None  # style networks to begin with where `init_from` has none (CLI: starter's)
    keep_networks: bool = False  # take those as they are; only what they lack is trained
    packed: bool = False  # motion in 16 bits: a third of the size, turns to 0.03 degrees
    rollout: bool = False  # train the network that dances motifs, too: as long as all else together
    leave_out: tuple[str, ...] = ()  # takes left out of everything, by name
    hold_feet: bool = True  # of takes: what a dance then does to its feet makes fewer beats nobody danced
    mirroring: bool = True  # networks learn from motion seen in a mirror, too
    words: bool = True  # cut motion words and find motifs; without, a word network is not even taken over


def build_repertoire(
    sources: Iterable[str | Path],
    output: str | Path,
    options: BuildOptions | None = None,
    *,
    report: Report | None = None,
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
    beginning = Beginning.of(options)
    takes, notes = _imported(sources, options, report)
    if options.hold_feet:
        takes = [replace(take, motion=lock_feet(take.motion)) for take in takes]
    measured = [_measured(take) for take in takes]
    short = [m.take.name for m in measured if len(m.body_pos_m) < CLIP_S * NET_FPS]
    if short:
        notes = (*notes, f"{', '.join(short)}: shorter than {CLIP_S} s: no clip comes from there")
    place = training_place(output.with_name(output.name + ".build"), options, training_report)
    nets, trained_on, more = music_networks(measured, beginning, options=options, place=place, report=report)
    learned, about_density = _learned(nets, options)
    words, about_words = _worded(measured, beginning, options, place, report)
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
        "style_from": options.style_from.name if options.style_from else None,
        "feet_held": options.hold_feet,
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
    sources: Iterable[str | Path], options: BuildOptions, report: Report | None
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
    from choreograph.nets.style import StyleNets

    style = StyleNets.from_arrays(nets["style"].weights, nets["style"].config)
    beat_weight = style.config.beat_weight / style.config.style_weight
    if options.density != "learned":
        return _Learned(style.embed_motion, None, beat_weight), ()
    if "motion_density" not in nets:
        note = "no tempo-density networks: the clips carry the analytic tempo-density"
        return _Learned(style.embed_motion, None, beat_weight), (note,)
    from choreograph.nets.density import MotionDensity

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
    beginning: Beginning,
    options: BuildOptions,
    place: TrainingPlace,
    report: Report | None,
) -> tuple[_Worded, tuple[str, ...]]:
    """The takes' motion words, their networks and their motifs, and notes."""
    if not options.words:
        return _Worded(), ()
    cut, notes = cut_takes(measured, report=report)
    net = word_network(cut, beginning, options=options, place=place)
    nets = {} if net is None else {"words": net}
    n_words = sum(len(take.words) for take in cut)
    if net is None or n_words < FEWEST_WORDS:
        few = f"{n_words} motion words, fewer than {FEWEST_WORDS}: no motifs, so no genre to dance by"
        return _Worded(nets), (*notes, few)
    from choreograph.nets.words import WordNet

    words = WordNet.from_arrays(net.weights, net.config)
    vocabulary = make_motifs(cut, words, seed=options.seed)
    if "rollout" in beginning.kept:
        nets["rollout"] = beginning.kept["rollout"]
    elif options.rollout:
        from choreograph.nets.rollout_presets import rollout_config
        from choreograph.pipeline.rollout_learning import rollout_network

        nets["rollout"] = rollout_network(
            measured, cut, vocabulary, words, rollout_config(options.preset), seed=options.seed, place=place,
            start=beginning.nets.get("rollout"), report=report,
        )  # fmt: skip
    return _Worded(nets, motif_arrays(vocabulary)), notes
