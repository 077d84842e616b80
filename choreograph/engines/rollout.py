"""The rollout engine: a sequence of motifs, drawn or given, danced by the repertoire's network."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.config import DanceConfig
from choreograph.constraints.resolve import ResolvedConstraints, resolve
from choreograph.constraints.spec import Constraints
from choreograph.engines.rendering import danced_motifs
from choreograph.errors import ParameterError
from choreograph.features.mel import log_mel
from choreograph.features.music_beats import get_beat_tracker
from choreograph.features.song_features import SongFeatures
from choreograph.features.word_audio import rhythm_from, word_spectra
from choreograph.motifs.choreography import draw_motifs
from choreograph.motifs.words import dance_bounds_s
from choreograph.motion.motion import Motion
from choreograph.nets.rollout.data import ROLLOUT_FPS
from choreograph.plan import Plan, PlannedWord
from choreograph.progress import ProgressReport
from choreograph.repertoire import Repertoire
from choreograph.rollout.generation import SEED_FRAMES, MotifSequence, generate_motion
from choreograph.takes import Credits

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def roll(
    song: Song,
    song_features: SongFeatures,
    repertoire: Repertoire,
    config: DanceConfig,
    constraints: Constraints,
    *,
    signature: Floats,
    transitions: Floats,
    style_song: Song | None = None,
    start_s: float = 0.0,
    report: ProgressReport | None = None,
) -> tuple[Plan, Motion, Indices]:
    """A dance of the rollout network (Rhythm is a Dancer, section 4): plan, motion, motifs it shows (N,).

    `signature` (K,) and `transitions` (K, K) are the genre's, or what the user gave. The style of the
    motion (equation 4) is the song's, or another's, `style_song`, interval by interval of its beats.

    Raises `ParameterError` if wishes contradict each other or name takes, `RepertoireError` without a
    vocabulary or a rollout network.
    """
    net = repertoire.rollout_net()
    bounds_s = dance_bounds_s(song_features.beat_times_s, song_features.duration_s)
    bounds_s = np.concatenate([[0.0], bounds_s[1:-1], [song_features.duration_s]])
    resolved = resolve(constraints, repertoire, bounds_s, song_features.duration_s)
    _refuse_takes(resolved)
    rng = np.random.default_rng(config.seed)
    motifs = draw_motifs(
        resolved.n_words, signature, transitions, rng=rng, pins=resolved.motifs,
        banned=np.flatnonzero(resolved.motif_banned).tolist(),
    )  # fmt: skip
    sequence = MotifSequence(
        start_s=bounds_s[:-1],
        end_s=bounds_s[1:],
        motif=repertoire.vocabulary.motifs.embeddings[motifs],
        rhythm=rhythm_from(song, song_features.beat_times_s, 0.0),
        spectral=word_spectra(song, bounds_s) if style_song is None else _cycled(style_song, len(motifs)),
    )
    motion = generate_motion(
        net, sequence, _leading_to(int(motifs[0]), repertoire), fps=config.fps,
        report=None if report is None else lambda done, total: report("dancing", done, total),
    )  # fmt: skip
    plan = Plan(
        song=song_features.name, duration_s=song_features.duration_s, start_s=start_s, repertoire=repertoire.path.name,
        planner=config.planner, blending=config.blending, seed=config.seed, fps=config.fps, weights={},
        music_beats_s=tuple(float(beat) for beat in song_features.beat_times_s), seconds=(), engine="rollout",
        words=_planned_words(motifs, resolved, Credits(performer=f"learned from {len(repertoire.takes)} takes")),
    )  # fmt: skip
    return plan, motion, danced_motifs(motion, bounds_s, repertoire)


def _refuse_takes(resolved: ResolvedConstraints) -> None:
    """The network dances no take, so that none can be pinned or banned."""
    if resolved.takes or not resolved.take_allowed.all():
        raise ParameterError(
            "expected pins and bans of motifs, got takes or genres: the rollout engine dances no take; use "
            "--engine graph or mixer, or --genre"
        )


def _planned_words(
    motifs: Indices, resolved: ResolvedConstraints, credits: Credits
) -> tuple[PlannedWord, ...]:
    bounds = resolved.bounds_s.round(6).tolist()
    return tuple(
        PlannedWord(bounds[slot], bounds[slot + 1], int(motif), "", 0.0, 0.0, credits,
                    pinned=slot in resolved.pinned)
        for slot, motif in enumerate(motifs)
    )  # fmt: skip


def _leading_to(motif: int, repertoire: Repertoire) -> Motion:
    """The real motion that leads up to a motif's medoid, at 30 fps; at a take's very beginning, into it."""
    v = repertoire.vocabulary
    word = int(v.motifs.words[motif])
    lead_s = (SEED_FRAMES + 1) / ROLLOUT_FPS
    end_s = max(float(v.word_start_s[word]), lead_s)
    motion, first_s = repertoire.motion(int(v.word_take[word]), end_s - lead_s, end_s)
    times_s = end_s - np.arange(SEED_FRAMES, 0, -1) / ROLLOUT_FPS
    return motion.sampled((times_s - first_s) * motion.fps, fps=ROLLOUT_FPS)


def _cycled(song: Song, n_words: int) -> NDArray[np.float32]:
    """The colour (N, 87) of a song from beat to beat, from its beginning again where it ends."""
    beats = get_beat_tracker().beats(song, log_mel(song.samples))
    spectra = word_spectra(song, dance_bounds_s(beats, song.duration_s))
    return spectra[np.arange(n_words) % len(spectra)]
