"""Both methods as published, as the settings of a build and of a dance.

Each is an ordinary setting, of `BuildOptions`, `StyleConfig`, `DensityConfig`, `RolloutConfig` or
`DanceConfig`. This module only lists them. By section of ChoreoGraph:

- 3.1: style vectors learned by equation 1 alone, from mel spectrogram and joint positions alone. The 512
  clips of least style loss are candidates, of any metre or genre
- 3.2: tempo-densities learned by equations 2 and 3, from raw pairs of music and motion. Segments are played
  along the path of subsequence DTW, without smoothing and without regard to counts and beats
- 3.3: the cheapest next node by style, completeness and transition, unweighted, with linear blending on the
  second
- 4.1: Adam, batches of 16, a rate of 1e-4, 10,000 epochs

Nothing is added to the paper. There are no contrast, rhythm features, augmentation or pretrained networks.
There are no smoothed time maps, matched beats or locked feet, neither in the takes nor in the dance. There
are no held poses, no dynamics, no steering to the stage, and no other costs.

Where the paper is silent, we chose:

- the widths of layers, and the λ of equations 1 and 2: those of `StyleConfig` and `DensityConfig`. Every λ
  of equation 4 is 1
- batch, rate and epochs of the style networks: those of the tempo-densities, the only ones it names
- what an epoch is: as many segments (4 s for style, 8 s for densities) as fit the takes without overlap
- equations 2 and 3 with means of squares for norms
- how far a random warp moves a motion beat: up to 0.5 s, where the slope stays in [0.5, 2]
- the DTW's weights: a step of two query frames pays for both (`choreography.graph.warping`)
- nodes are joined where the last pose stands and faces, as in motion graphs, and the transition cost is
  measured so. Consecutive nodes of a segment are at distance 0, where the paper's are a frame apart
- the settings of the rollout network are those of Rhythm is a Dancer, sections 4 and 5. It does not state
  the weights of the losses of positions and contacts (1 here), or how many teacher-forced and self-fed
  frames alternate (5 here, as in the acLSTM that it builds on). Ours are the root, which is relative to the
  heading of the dancer (`nets.rollout_poses`), slight smoothing, and steering to the stage
- a second without a motion beat extends the gap of completeness to its far end
- a crossfade lasts 0.25 s. The dance is sampled at 60 fps by a spline through the path's 20 frames a second
- one-frame jumps of markers are smoothed and takes retargeted to one skeleton, as for every repertoire
"""

from __future__ import annotations

from typing import Any

import numpy as np

from choreograph.choreography.graph.costs import BUILTIN_COSTS
from choreograph.core.arguments import check_choice
from choreograph.core.errors import ParameterError
from choreograph.nets.configs import density_config
from choreograph.settings import DanceConfig

METHOD = "published"  # begins the provenance of its repertoires
PAPER_EPOCHS = 10_000
# Epochs of all networks. With half an hour of takes, they take one CPU core four minutes, or half an hour.
EPOCHS = {"tiny": 10, "small": 100, "paper": PAPER_EPOCHS}

_ADAM = {"batch_size": 16, "learning_rate": 1e-4, "weight_decay": 0.0, "schedule": "constant"}
STYLE: dict[str, Any] = {
    **_ADAM, "loss": "paper", "music_inputs": "mel", "normalised": False, "dropout": 0.0,
    "augmented": False, "balanced_genres": False,
}  # fmt: skip
DENSITY: dict[str, Any] = {
    **_ADAM, "music_batch_size": 16, "music_learning_rate": 1e-4, "loss": "paper", "velocities": False,
    "skips": False, "unit_variance": False, "augmented": False, "synchronise": False, "music_target": "clip",
}  # fmt: skip

ROLLOUT_STEPS = {"tiny": 500, "small": 5_000, "paper": 500_000}  # scaled down as the epochs are
ROLLOUT: dict[str, Any] = {
    "by_genre": True, "condition_width": 0, "standardised": False, "phase": False, "count_phase": False,
    "own_embedding_share": 0.0, "style_strength": 40.0, "style_fade_s": 0.0, "style_dropout": 0.0,
    "loss": "paper", "perceptual_weight": 0.5, "position_weight": 1.0, "contact_weight": 1.0,
    "tempi": (1.0,), "frames": 100, "teacher_frames": 5, "self_fed_frames": (5,), "n_layers": 3,
    "batch_size": 32, "learning_rate": 1e-4, "weight_decay": 0.0, "schedule": "constant",
}  # fmt: skip

_JOINTS_TO_NORM = float(np.sqrt(21.0))  # our transition cost is a mean over 21 joints, the paper's a norm
WEIGHTS: dict[str, float] = {
    **{cost.name: 0.0 for cost in BUILTIN_COSTS}, "genre": 1.0, "completeness": 1.0,
    "transition": _JOINTS_TO_NORM,
}  # fmt: skip
DANCE: dict[str, Any] = {
    "planner": "greedy", "candidates": 512, "selection": "style", "warping": "dtw", "density": "clip",
    "time_maps": "raw", "blending": "linear", "transitions": "seconds", "lock_feet": False,
    "hold_ends": False, "stage": "free", "front": "free", "dynamics": 0.0, "weights": WEIGHTS,
}  # fmt: skip


# Of the other engines: equations 5 and 4 of Rhythm is a Dancer as printed, motif by motif.
_MOTIFS = {"motif_draw": "absolute", "phrase_counts": 1, "hold_ends": False, "dynamics": 0.0}
_DANCES: dict[str, dict[str, Any]] = {
    "graph": DANCE,
    "mixer": _MOTIFS
    | {"planner": "greedy", "blending": "linear", "lock_feet": False, "stage": "free", "front": "free"},
    "rollout": {**_MOTIFS, "front": "free", "style_strength": 40.0, "style_window": "hamming"},
}  # fmt: skip


def published_build(preset: str) -> dict[str, Any]:
    """Keywords of `build` for both methods as published, with networks and epochs scaled by the preset.

    Raises `ParameterError` for an unknown preset.
    """
    if preset not in EPOCHS:
        raise ParameterError(f"expected a preset among {', '.join(EPOCHS)}, got {preset!r}")
    epochs = {"epochs": EPOCHS[preset]}
    return {
        "preset": preset, "density": "learned", "lock_feet": False, "pretrained": "nothing",
        "style_changes": STYLE | epochs, "density_changes": DENSITY | epochs, "rollout_teacher": False,
        "rollout_changes": ROLLOUT | {"steps": ROLLOUT_STEPS[preset]},
        "method": f"{METHOD}: {scaling(preset)}",
    }  # fmt: skip


def published_dance(engine: str = "graph", **changes: Any) -> DanceConfig:
    """The settings of a dance as published, with fields changed.

    They are those of ChoreoGraph for the graph engine, and of Rhythm is a Dancer for the mixer and the
    rollout. Raises `ParameterError` for another engine.
    """
    check_choice("a published engine", engine, _DANCES)
    return DanceConfig(engine=engine, **(_DANCES[engine] | changes))


def scaling(preset: str) -> str:
    """The sizes and training lengths that a preset scales down, in words."""
    paper, ours = (density_config(name) for name in ("paper", preset))
    if preset == "paper":
        return "at full size"
    hidden = [config.hidden_dim for config in (ours, paper)]
    return (
        f"{EPOCHS[preset]:,} epochs of {PAPER_EPOCHS:,}, hidden vectors of {hidden[0]:,} numbers for "
        f"{hidden[1]:,}, contents of {ours.content_dim:,} for {paper.content_dim:,}"
    )
