"""choreograph: makes dances for music from your own motion library, and explains every second of them.

- `build_repertoire` — takes and their songs to a repertoire file
- `Repertoire` — an opened repertoire file
- `dance` — a song and a repertoire to a `Dance`: motion, plan, notes
- `starter_repertoire`, `example_songs` — what comes along to begin with
- `render` — the motion of a (perhaps edited) `Plan`
- `MotifPin`, `TakePin`, `Ban` — what a dance should hold, and what not; `vary` makes several dances
- `motifs_of`, `signature_of` — of a take, to be danced again
- `Cost`, `Layer`, `SongFeatures` — for costs of your own
- `Motion`, `Skeleton`, `Take` — motion and where it comes from
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from choreograph.building import BuildOptions, build_repertoire
    from choreograph.config import DanceConfig
    from choreograph.constraints import Ban, MotifPin, TakePin
    from choreograph.errors import ChoreographError
    from choreograph.features.song_features import SongFeatures
    from choreograph.graph import Cost, Layer
    from choreograph.motion.motion import Motion
    from choreograph.motion.skeleton import Skeleton
    from choreograph.pipeline import Dance, dance, render, vary
    from choreograph.pipeline.recreation import motifs_of, signature_of
    from choreograph.plan import Plan
    from choreograph.repertoire import Repertoire
    from choreograph.starter import example_songs, starter_repertoire
    from choreograph.takes import Credits, Take

# Imported when first asked for: `choreograph --help` must not wait for numba and torch.
_HOMES = {
    "Ban": "constraints",
    "BuildOptions": "building",
    "ChoreographError": "errors",
    "Cost": "graph",
    "Credits": "takes",
    "Dance": "pipeline",
    "DanceConfig": "config",
    "Layer": "graph",
    "Motion": "motion.motion",
    "MotifPin": "constraints",
    "SongFeatures": "features.song_features",
    "Plan": "plan",
    "Repertoire": "repertoire",
    "Skeleton": "motion.skeleton",
    "Take": "takes",
    "TakePin": "constraints",
    "build_repertoire": "building",
    "dance": "pipeline",
    "example_songs": "starter",
    "motifs_of": "pipeline.recreation",
    "render": "pipeline",
    "signature_of": "pipeline.recreation",
    "starter_repertoire": "starter",
    "vary": "pipeline",
}

__all__ = [
    "Ban",
    "BuildOptions",
    "ChoreographError",
    "Cost",
    "Credits",
    "Dance",
    "DanceConfig",
    "Layer",
    "MotifPin",
    "Motion",
    "Plan",
    "Repertoire",
    "Skeleton",
    "SongFeatures",
    "Take",
    "TakePin",
    "build_repertoire",
    "dance",
    "example_songs",
    "motifs_of",
    "render",
    "signature_of",
    "starter_repertoire",
    "vary",
]  # fmt: skip


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module 'choreograph' has no attribute {name!r}")
    value = getattr(import_module(f"choreograph.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
