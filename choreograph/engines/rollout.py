"""The rollout engine: a sequence of motifs, drawn or given, danced by the repertoire's recurrent network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from choreograph.audio.song import Song
from choreograph.blending.held_ends import hold_ends
from choreograph.config import DanceConfig
from choreograph.constraints.likely_genre import choose_goal
from choreograph.constraints.resolve import ResolvedConstraints
from choreograph.constraints.spec import Constraints
from choreograph.engines.base import DanceRequest, EngineResult
from choreograph.engines.mixer import sequence_notes
from choreograph.errors import ParameterError
from choreograph.features.count_phase import count_phase
from choreograph.features.mel import log_mel
from choreograph.features.word_audio import rhythm_from, word_spectra
from choreograph.graph import Cost
from choreograph.motifs.bar_positions import bar_positions, possible_motifs, word_positions
from choreograph.motifs.choreography import draw_motifs
from choreograph.motifs.goals import MotifGoal
from choreograph.motifs.words import dance_bounds_s
from choreograph.motion.motion import Motion
from choreograph.plan import PlannedWord
from choreograph.repertoire import Repertoire
from choreograph.song_counts import DEFAULT_BEATS, names_a_tracker, song_counts
from choreograph.takes import Credits

Indices = NDArray[np.int64]


class RolloutEngine:
    """A network's motion (Rhythm is a Dancer, section 4)."""

    name = "rollout"
    settings = frozenset({"style_song"})

    def check(
        self,
        repertoire: Repertoire,
        config: DanceConfig,
        constraints: Constraints,
        costs: Sequence[Cost],
    ) -> None:
        """As `Engine.check`: it needs motifs and a rollout network, and dances no take."""
        repertoire.rollout_net()
        _ = repertoire.vocabulary

    def plan(self, request: DanceRequest) -> EngineResult:
        """A dance of the network; it follows the genre nearest to the song unless one is given."""
        constraints = request.constraints.requested
        goal, notes = choose_goal(request.song_features, request.repertoire, constraints)
        result = roll_out_motifs(request, goal)
        return replace(result, notes=(*notes, *sequence_notes(constraints, len(result.plan.words))))


def roll_out_motifs(request: DanceRequest, goal: MotifGoal) -> EngineResult:
    """Motifs drawn towards a goal and danced by the network, with the plan's motion.

    The style of the motion (equation 4) is the song's, or another song's (`style_song`), from beat to beat.

    Raises `ParameterError` if constraints name takes, `RepertoireError` without a vocabulary or a rollout
    network.
    """
    from choreograph.nets.rollout.data import ROLLOUT_FPS  # torch takes a second to import
    from choreograph.rollout.generation import MotifSequence, generate_motion

    repertoire, features, config = request.repertoire, request.song_features, request.config
    vocabulary = repertoire.vocabulary
    net = repertoire.rollout_net()
    inner_s = request.constraints.bounds_s[1:-1]
    bounds_s = np.concatenate([[0.0], inner_s, [features.duration_s]])
    constraints = replace(request.constraints, bounds_s=bounds_s)
    _refuse_takes(constraints)
    motifs = draw_motifs(
        constraints.n_words, goal.signature, goal.transitions, rng=np.random.default_rng(config.seed),
        pins=constraints.motifs, banned=np.flatnonzero(constraints.motif_banned).tolist(),
        possible=possible_motifs(
            bar_positions(bounds_s[:-1], features.counts), word_positions(vocabulary, repertoire.counts),
            np.arange(len(vocabulary.word_motif)), vocabulary,
        ),
    )  # fmt: skip
    spectral = (
        word_spectra(request.song, bounds_s)
        if request.style_song is None
        else _repeated_spectra(request.style_song, len(motifs), config.beats)
    )
    times_s = np.arange(0.0, features.duration_s, 1.0 / ROLLOUT_FPS)
    sequence = MotifSequence(
        start_s=bounds_s[:-1],
        end_s=bounds_s[1:],
        motif=vocabulary.motifs.embeddings[motifs],
        rhythm=rhythm_from(request.song, features.beat_times_s, 0.0),
        count_phase=count_phase(features.counts, times_s),
        spectral=spectral,
    )
    report = request.report
    motion = generate_motion(
        net, sequence, _lead_in(int(motifs[0]), repertoire, ROLLOUT_FPS), fps=config.fps,
        report=None if report is None else lambda done, total: report("dancing", done, total),
    )  # fmt: skip
    credits = Credits(performer=f"learned from {len(repertoire.takes)} takes")
    plan = request.new_plan(engine=RolloutEngine.name, words=_planned_words(motifs, constraints, credits))
    return EngineResult(plan, motion=hold_ends(motion, plan.opening_s, plan.closing_s))


def _refuse_takes(constraints: ResolvedConstraints) -> None:
    """The network dances no take, so none can be pinned or banned."""
    if constraints.takes or not constraints.take_allowed.all():
        raise ParameterError(
            "expected pins and bans of motifs, got takes or genres: the rollout engine dances no take; use "
            "--engine graph or mixer, or --genre"
        )


def _planned_words(
    motifs: Indices, constraints: ResolvedConstraints, credits: Credits
) -> tuple[PlannedWord, ...]:
    bounds = constraints.bounds_s.round(6).tolist()
    return tuple(
        PlannedWord(bounds[slot], bounds[slot + 1], int(motif), "", 0.0, 0.0, credits,
                    pinned=slot in constraints.pinned)
        for slot, motif in enumerate(motifs)
    )  # fmt: skip


def _lead_in(motif: int, repertoire: Repertoire, fps: float) -> Motion:
    """The recorded motion that leads up to a motif's medoid; at a take's very beginning, into it."""
    from choreograph.rollout.generation import SEED_FRAMES

    v = repertoire.vocabulary
    word = int(v.motifs.words[motif])
    length_s = (SEED_FRAMES + 1) / fps
    end_s = max(float(v.word_start_s[word]), length_s)
    motion, first_s = repertoire.motion(int(v.word_take[word]), end_s - length_s, end_s)
    times_s = end_s - np.arange(SEED_FRAMES, 0, -1) / fps
    return motion.sampled((times_s - first_s) * motion.fps, fps=fps)


def _repeated_spectra(song: Song, n_words: int, beats: str | Path) -> NDArray[np.float32]:
    """Spectral features (N, 87) of a song from beat to beat, repeated where it ends.

    `beats` is the dance's setting; a file is of the song danced to, so that this one is tracked.
    """
    tracker = beats if names_a_tracker(beats) else DEFAULT_BEATS
    tracked_s = song_counts(song, log_mel(song.samples), tracker).times_s
    spectra = word_spectra(song, dance_bounds_s(tracked_s, song.duration_s))
    return spectra[np.arange(n_words) % len(spectra)]
