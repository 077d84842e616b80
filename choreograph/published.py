"""ChoreoGraph's method as published: the settings of a build and of a dance that together are it.

Each is an ordinary setting, of `BuildOptions`, `StyleConfig`, `DensityConfig` or `DanceConfig`; this module
only lists them. By section of the paper:

- 3.1: style vectors learned by equation 1 alone, from mel spectrogram and joint positions alone; the 512
  clips of least style loss are candidates, whatever their metre or genre
- 3.2: tempo-densities learned by equations 2 and 3, from raw pairs of music and motion; segments are played
  along the path of subsequence DTW as it is, whatever is known of counts and beats
- 3.3: the cheapest next node by style, completeness and transition, unweighted; linear blending on the second
- 4.1: Adam, batches of 16, a rate of 1e-4, 10,000 epochs

Nothing of ours is done besides: no contrast, rhythm features, augmentation or pretrained networks; no
smoothed time maps, beats on beats or locked feet, neither in the takes nor in the dance; no held poses at the
ends, no steering to the stage, and no other costs.

Where the paper is silent, we chose:

- the widths of layers, and equations 1 and 2's λ: those of `StyleConfig` and `DensityConfig`; every λ of
  equation 4 is 1
- batch, rate and epochs of the style networks: those of the tempo-densities, the only ones it names
- what an epoch is: as many segments (4 s for style, 8 s for densities) as fit the takes without overlap
- equations 2 and 3 with means of squares for norms
- how far a random warp moves a motion beat: up to 0.5 s, where the slope stays in [0.5, 2]
- the DTW's weights: a step of two query frames pays for both (`warping.dtw`)
- nodes are joined where the last pose stands and faces, as in motion graphs, and the transition cost is
  measured so; consecutive nodes of a segment are at distance 0, where the paper's are a frame apart
- a clip's tempo-density is the mean of the estimates of the clips that overlap with it, since it is stored
  once for each take
- a second without a motion beat extends the gap of completeness to its far end
- a crossfade lasts 0.25 s; the dance is sampled at 60 fps by a spline through the path's 20 frames a second
- one-frame jumps of markers are smoothed and takes retargeted to one skeleton, as for every repertoire
"""

from __future__ import annotations

from typing import Any

import numpy as np

from choreograph.config import DEFAULT_WEIGHTS, DanceConfig
from choreograph.errors import ParameterError
from choreograph.nets.density.config import density_config

METHOD = "published"  # what the provenance of its repertoires begins with
PAPER_EPOCHS = 10_000
# Of all networks: with half an hour of takes, one CPU core takes four minutes, or half an hour.
EPOCHS = {"tiny": 10, "small": 100, "paper": PAPER_EPOCHS}

_ADAM = {"batch_size": 16, "learning_rate": 1e-4, "weight_decay": 0.0, "schedule": "constant"}
STYLE: dict[str, Any] = {
    **_ADAM, "loss": "paper", "music_inputs": "mel", "normalised": False, "dropout": 0.0,
    "augmented": False, "balanced_genres": False,
}  # fmt: skip
DENSITY: dict[str, Any] = {
    **_ADAM, "music_batch_size": 16, "music_learning_rate": 1e-4, "loss": "paper", "velocities": False,
    "skips": False, "unit_variance": False, "augmented": False, "synchronise": False,
}  # fmt: skip

_JOINTS_TO_NORM = float(np.sqrt(21.0))  # our transition cost is a mean over 21 joints, the paper's a norm
WEIGHTS: dict[str, float] = {
    **dict.fromkeys(DEFAULT_WEIGHTS, 0.0), "style": 1.0, "completeness": 1.0, "transition": _JOINTS_TO_NORM,
}  # fmt: skip
DANCE: dict[str, Any] = {
    "planner": "greedy", "candidates": 512, "selection": "style", "warping": "dtw", "density": "learned",
    "time_maps": "raw", "blending": "linear", "transitions": "seconds", "lock_feet": False,
    "hold_ends": False, "keep_on_stage": False, "weights": WEIGHTS,
}  # fmt: skip


def published_build(preset: str) -> dict[str, Any]:
    """Keywords of `build` for the method as published, its networks and epochs scaled by the preset.

    Raises `ParameterError` for an unknown preset.
    """
    if preset not in EPOCHS:
        raise ParameterError(f"expected a preset among {', '.join(EPOCHS)}, got {preset!r}")
    epochs = {"epochs": EPOCHS[preset]}
    return {
        "preset": preset, "density": "learned", "lock_feet": False, "pretrained": "nothing",
        "style_changes": STYLE | epochs, "density_changes": DENSITY | epochs,
        "method": f"{METHOD}: {scaling(preset)}",
    }  # fmt: skip


def published_dance(**changes: Any) -> DanceConfig:
    """The settings of a dance as published, with fields changed."""
    return DanceConfig(**(DANCE | changes))


def scaling(preset: str) -> str:
    """What a preset scales down of the networks and their training, in words."""
    paper, ours = (density_config(name) for name in ("paper", preset))
    if preset == "paper":
        return "at full size"
    hidden = [config.hidden_dim for config in (ours, paper)]
    return (
        f"{EPOCHS[preset]:,} epochs of {PAPER_EPOCHS:,}, hidden vectors of {hidden[0]:,} numbers for "
        f"{hidden[1]:,}, contents of {ours.content_dim:,} for {paper.content_dim:,}"
    )
