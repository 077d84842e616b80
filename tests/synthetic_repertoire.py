"""A small repertoire without networks, from takes with known beats, and songs of clicks."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import soundfile
from synthetic_motions import stepping

from choreograph.core.counts import Figure, make_counts, numbers_in_bar
from choreograph.core.timebase import NET_FPS, SAMPLE_RATE_HZ
from choreograph.library.repertoire import Repertoire
from choreograph.library.schema import NetArrays
from choreograph.library.store import RepertoireFile
from choreograph.library.vocabulary import (
    Vocabulary,
    find_motifs,
    make_vocabulary,
    motif_arrays,
    segment_words,
)
from choreograph.library.writing import Contents, MeasuredTake, to_arrays, write_repertoire, write_texts
from choreograph.motion.body import body_pos_m
from choreograph.motion.motion import Credits, Take
from choreograph.motion.motion_beats import motion_beat_times_s
from choreograph.music.song_features import motion_density

PERIODS_S = (0.5, 0.6, 0.75)


def synthetic_takes(
    *,
    periods_s: Sequence[float] = PERIODS_S,
    duration_s: float = 30.0,
    genres: Sequence[str] = ("a", "b", "c"),
) -> list[MeasuredTake]:
    """One take per period, which comes to rest once every period."""
    takes = []
    for index, period_s in enumerate(periods_s):
        motion = stepping(round(duration_s * 30), period_s=period_s, seed=index)
        credits = Credits(genres[index % len(genres)], f"dancer {index}", "CC0", "synthetic")
        take = Take(f"take{index}", motion, credits, song_name=f"song{index}", notes=("synthetic",))
        beats_s = motion_beat_times_s(body_pos_m(motion), motion.fps)
        takes.append(MeasuredTake(take, body_pos_m(motion.resampled(NET_FPS)).astype(np.float32), beats_s))
    return takes


def with_counts(takes: Sequence[MeasuredTake], periods_s: Sequence[float] = PERIODS_S) -> list[MeasuredTake]:
    """The takes counted 1 2 3 4 where they rest, from their first frame, in figures of 8 counts."""
    counted = []
    for measured, period_s in zip(takes, periods_s, strict=True):
        n_counts = int(measured.take.motion.duration_s / period_s) + 1
        counts = make_counts(
            period_s * np.arange(n_counts), numbers_in_bar(n_counts, 4), 4, source="data set"
        )
        starts = range(0, n_counts - 8, 8)
        figures = tuple(Figure(f"F-{i}", i * period_s, (i + 8) * period_s, 8) for i in starts)
        counted.append(replace(measured, take=replace(measured.take, counts=counts, figures=figures)))
    return counted


def synthetic_contents(takes: Sequence[MeasuredTake] | None = None) -> Contents:
    """Contents of a repertoire of the takes, with analytic densities and reproducible random styles."""
    takes = synthetic_takes() if takes is None else takes
    rng = np.random.default_rng(7)
    arrays = to_arrays(
        takes,
        embed_motion=lambda pos, starts: rng.normal(size=(len(starts), 32)).astype(np.float32),
        density=lambda m: motion_density(len(m.body_pos_m), m.motion_beats_s),
        checksums=[(f"{m.take.name}.bvh", "0" * 64, i) for i, m in enumerate(takes)],
    )
    return Contents(arrays, "analytic", {"preset": "synthetic", "selection_beat_weight": 0.1})


def synthetic_vocabulary(takes: Sequence[MeasuredTake]) -> tuple[Vocabulary, NetArrays]:
    """The takes' words, segmented on their motion beats, and the untrained network that embeds them."""
    import torch

    from choreograph.nets.configs import word_config
    from choreograph.nets.words import WordNet

    cut = [segment_words(body_pos_m(m.take.motion), m.take.motion.fps, m.motion_beats_s) for m in takes]
    words = np.concatenate([c.body_pos_m for c in cut])
    with torch.random.fork_rng():
        torch.manual_seed(0)
        net = WordNet(word_config("tiny"))
    net.init_from_pca(torch.from_numpy(words.astype(np.float32)))
    motifs, word_motif = find_motifs(net.embed(words))
    vocabulary = make_vocabulary(
        motifs, word_motif, np.repeat(np.arange(len(takes)), [len(c) for c in cut]),
        np.concatenate([c.start_s for c in cut]), np.concatenate([c.end_s for c in cut]),
        [m.take.credits.genre for m in takes],
    )  # fmt: skip
    weights, config = net.to_arrays()
    return vocabulary, NetArrays(config, weights)


def with_vocabulary(contents: Contents, takes: Sequence[MeasuredTake]) -> Contents:
    """The same contents with the takes' words, motifs and word network."""
    vocabulary, net = synthetic_vocabulary(takes)
    return replace(
        contents,
        arrays={**contents.arrays, **motif_arrays(vocabulary)},
        nets={**contents.nets, "words": net},
    )


def synthetic_repertoire(
    path: Path, takes: Sequence[MeasuredTake] | None = None, *, vocabulary: bool = False
) -> Repertoire:
    """The repertoire of the takes, written to `path` and opened; with a vocabulary on request."""
    takes = synthetic_takes() if takes is None else takes
    contents = synthetic_contents(takes)
    write_repertoire(path, with_vocabulary(contents, takes) if vocabulary else contents)
    return Repertoire.open(path)


def without_counts(
    repertoire: Repertoire, path: Path, names: Collection[str], *, provenance: Mapping[str, Any] | None = None
) -> Repertoire:
    """A copy of a repertoire in which the takes of these names have neither counts nor figures."""
    file = RepertoireFile(repertoire.path)
    arrays = file.arrays()
    hidden = np.isin(arrays["takes/name"], list(names))
    start, stop = arrays["takes/count_start"], arrays["takes/count_stop"]
    kept = np.ones(len(arrays["counts/time_s"]), bool)
    for i, j in zip(start[hidden], stop[hidden], strict=True):
        kept[i:j] = False
    before = np.append(0, np.cumsum(kept))
    arrays |= {name: arrays[name][kept] for name in arrays if name.startswith("counts/")}
    arrays |= {"takes/count_start": before[start], "takes/count_stop": before[stop]}
    arrays["takes/metre"] = np.where(hidden, 0, arrays["takes/metre"])
    named = ~hidden[arrays["figures/take"]]
    arrays |= {name: arrays[name][named] for name in arrays if name.startswith("figures/")}
    nets = {name: file.read_net(name) for name in file.net_names}
    given = file.provenance if provenance is None else provenance
    write_repertoire(path, Contents(arrays, file.density, dict(given), nets))
    return Repertoire.open(path)


def put_texts(file: h5py.File, name: str, texts: Sequence[str]) -> None:
    """Texts in place of those that a file has."""
    del file[name]
    write_texts(file, name, np.array(texts, object))


def read_all(path: Path) -> None:
    """Everything that a dance may read of a repertoire."""
    repertoire = Repertoire.open(path)
    RepertoireFile(path).verify()
    _ = (
        repertoire.skeleton,
        repertoire.takes,
        repertoire.clip_style,
        repertoire.clip_beat_count,
        repr(repertoire),
        [str(note) for note in repertoire.notes],
    )
    _ = repertoire.source_checksums, repertoire.selection_beat_weight, repertoire.clip_motion.liveliness_ranks
    for take in range(len(repertoire.takes)):
        _ = repertoire.motion(take), repertoire.motion_beats_s(take), repertoire.body_pos_m(take)
        _ = repertoire.counts(take), repertoire.figures(take)
    clips = np.arange(min(repertoire.n_clips, 8))
    _ = repertoire.clip_motion.density(clips), repertoire.clip_motion.speed(clips)
    if repertoire.has_vocabulary:
        _ = repertoire.vocabulary, repertoire.word_net()


def write_clicks(path: Path, *, duration_s: float, bpm: float = 120.0) -> Path:
    """A song of one click per beat from 0 s on."""
    times = np.arange(round(duration_s * SAMPLE_RATE_HZ)) / SAMPLE_RATE_HZ
    since = times % (60.0 / bpm)
    samples = 0.6 * np.exp(-since / 0.02) * np.sin(2 * np.pi * 880 * since)
    soundfile.write(path, samples.astype(np.float32), SAMPLE_RATE_HZ)
    return path
