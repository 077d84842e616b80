"""Training all networks of a repertoire, one after another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from choreograph.nets.density_presets import density_config
from choreograph.nets.density_training import train_motion_density
from choreograph.nets.music_density_training import train_music_density
from choreograph.nets.presets import style_config
from choreograph.nets.style_data import StyleTake
from choreograph.nets.style_training import train_style
from choreograph.nets.training import TrainingPlace
from choreograph.repertoire import NetArrays
from choreograph.timebase import CLIP_S, MUSIC_FPS, NET_FPS

if TYPE_CHECKING:
    from choreograph.pipeline.building import BuildOptions


def train_networks(
    takes: Sequence[StyleTake],
    *,
    work: Path,
    options: BuildOptions,
    start: Mapping[str, NetArrays] | None,
    report: Callable[[Any], None] | None,
) -> dict[str, NetArrays]:
    """Networks by name: style, then the tempo-density of motion, then of music, which follows the motion's.

    Each keeps NAME.pt and NAME.jsonl in `work`; with `options.resume` a complete network is taken from
    there and an incomplete one goes on. `start` holds weights to begin with, by the same names. Without
    a take of 8 s of music and motion there are no tempo-density networks.
    """
    place = TrainingPlace(work, options.resume, options.device, report or (lambda progress: None))
    weights = {name: net.weights for name, net in (start or {}).items()}
    seed = options.seed
    config = style_config(options.preset, n_songs=len({take.song_name for take in takes}))
    style = train_style(takes, config, seed=seed, place=place, start=weights.get("style"))
    nets = {"style": _stored(*style.to_arrays())}
    if any(min(len(take.body_pos_m) / NET_FPS, len(take.log_mel) / MUSIC_FPS) >= CLIP_S for take in takes):
        densities = density_config(options.preset)
        motion = train_motion_density(
            takes, densities, seed=seed, place=place, start=weights.get("motion_density")
        )
        music = train_music_density(
            takes, motion, densities, seed=seed, place=place, start=weights.get("music_density")
        )
        nets["motion_density"] = _stored(*motion.to_arrays())
        nets["music_density"] = _stored(*music.to_arrays())
    return nets


def _stored(weights, config) -> NetArrays:
    return NetArrays(config, weights)
