"""From takes and their songs to a repertoire file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from choreograph.audio.song import load_song
from choreograph.errors import FormatError, ParameterError
from choreograph.features.density import motion_density
from choreograph.features.mel import log_mel
from choreograph.features.motion_beats import motion_beat_times_s
from choreograph.features.rhythm import rhythm_features
from choreograph.files import check_target, sha256_of
from choreograph.importers import import_takes
from choreograph.motion.body import body_pos_m
from choreograph.motion.retarget import retarget
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.repertoire import Contents, NetArrays, Repertoire, write_repertoire
from choreograph.repertoire.contents import MeasuredTake, to_arrays
from choreograph.takes import Take
from choreograph.timebase import CLIP_S, MUSIC_FPS, NET_FPS, STORE_FPS, seconds_to_frames

Report = Callable[[str, int, int], None]


@dataclass(frozen=True)
class BuildOptions:
    """How to build a repertoire; see `choreograph build-db --help`."""

    preset: str = "small"  # size and training length of the networks: tiny, small, paper
    density: str = "analytic"  # which tempo-density clips carry; the README's table says why
    seed: int = 0
    device: str = "auto"
    resume: bool = False
    init_from: Path | None = None  # networks of another repertoire to begin with
    keep_networks: bool = False  # take those as they are instead of training on
    packed: bool = False  # motion in 16 bits: a third of the size, turns to 0.03 degrees
    leave_out: tuple[str, ...] = ()  # takes left out of everything, by name


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
    takes, notes = _imported(sources, options, report)
    measured = [_measured(take) for take in takes]
    short = [m.take.name for m in measured if len(m.body_pos_m) < CLIP_S * NET_FPS]
    if short:
        notes = (*notes, f"{', '.join(short)}: shorter than {CLIP_S} s: no clip comes from there")
    nets, learned, more = _networks(measured, output, options, report, training_report)
    checksums = [
        (str(path), sha256_of(path), index) for index, take in enumerate(takes) for path in take.source_paths
    ]
    arrays = to_arrays(
        measured,
        embed_motion=learned.embed_motion,
        density=learned.density or (lambda m: motion_density(len(m.body_pos_m), m.motion_beats_s)),
        checksums=checksums,
    )
    provenance = {
        "choreograph": version("choreograph"),
        "preset": options.preset,
        "seed": options.seed,
        "init_from": options.init_from.name if options.init_from else None,
        "left_out": sorted(options.leave_out),
        "trained_on": learned.trained_on,
        "selection_beat_weight": learned.selection_beat_weight,
    }
    write_repertoire(
        output, Contents(arrays, options.density if learned.density else "analytic", provenance, nets),
        packed=options.packed,
    )  # fmt: skip
    return Repertoire.open(output), (*notes, *more)


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
    trained_on: Sequence[str] = ()  # songs


def _networks(
    measured: Sequence[MeasuredTake],
    output: Path,
    options: BuildOptions,
    report: Report | None,
    training_report: Callable[[Any], None] | None,
) -> tuple[dict[str, NetArrays], _Learned, tuple[str, ...]]:
    """Train what the takes allow, or take over another repertoire's networks."""
    from choreograph.nets.style import StyleNets
    from choreograph.pipeline.learning import train_networks

    with_music = [m for m in measured if m.take.song_path is not None]
    start, trained_on = None, sorted({m.take.song_name for m in with_music})
    if options.init_from is not None:
        other = Repertoire.open(options.init_from)
        start = {name: other.net(name) for name in other.net_names}
    notes: tuple[str, ...] = ()
    if len(trained_on) >= 2 and not options.keep_networks:
        nets = train_networks(
            [_heard(m, i, len(with_music), report) for i, m in enumerate(with_music)],
            work=output.with_name(output.name + ".build"), options=options, start=start,
            report=training_report,
        )  # fmt: skip
    elif start is not None:
        nets, trained_on = start, list(other.provenance.get("trained_on", []))
        if not options.keep_networks:
            notes = ("fewer than two takes' songs to learn from: the networks are taken over as they are",)
    else:
        nets, trained_on = {}, []
        notes = ("fewer than two songs to learn from: no networks, so clips are not chosen by style",)
    if "style" not in nets:
        return nets, _Learned(trained_on=trained_on), notes
    style = StyleNets.from_arrays(nets["style"].weights, nets["style"].config)
    density = None
    if options.density == "learned" and "motion_density" in nets:
        from choreograph.nets.density import MotionDensity

        net = nets["motion_density"]
        estimator = MotionDensity.from_arrays(net.weights, net.config)

        def density(m: MeasuredTake):
            return estimator.take_density(m.body_pos_m)

    elif options.density == "learned":
        notes = (*notes, "no tempo-density networks: the clips carry the analytic tempo-density")
    beat_weight = style.config.beat_weight / style.config.style_weight
    return nets, _Learned(style.embed_motion, density, beat_weight, trained_on), notes


def _heard(measured: MeasuredTake, index: int, total: int, report: Report | None):
    """A take as the networks learn from it; the song's part from the motion's first frame on."""
    from choreograph.nets.style_data import StyleTake

    take = measured.take
    assert take.song_path is not None  # only takes with music are heard
    song = load_song(take.song_path)
    mel = log_mel(song.samples)
    rhythm = rhythm_features(mel, start_s=max(0.0, take.song_start_s))
    first = seconds_to_frames(take.song_start_s, MUSIC_FPS)
    last = first + seconds_to_frames(take.motion.duration_s, MUSIC_FPS)
    if first >= len(mel):
        raise FormatError(
            f"{take.song_path}: expected music at {take.song_start_s:g} s, where {take.name} begins, but the "
            f"song lasts {song.duration_s:.1f} s"
        )
    silent = np.full((max(0, -first), mel.shape[1]), mel.min(), mel.dtype)
    if report is not None:
        report("hearing", index + 1, total)
    return StyleTake(
        name=take.name,
        song_name=take.song_name,
        genre=take.credits.genre,
        log_mel=np.concatenate([silent, mel[max(0, first) : max(0, last)]]),
        rhythm=rhythm,
        body_pos_m=measured.body_pos_m,
        motion_beat_times_s=measured.motion_beats_s,
    )
