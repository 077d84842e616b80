"""Takes to a repertoire, with all that its networks learn from.

- `build` — the stages of `building`, and for the rollout network a teacher: the graph engine
- `graph_teacher` — dances of the graph engine that the rollout network learns from
- `synthesised_songs` — songs beside the takes' own that these are danced to

Above `pipeline`, since it dances; apart from it, since dancing knows nothing of the synthesiser.
"""

from choreograph.build_pipeline.building import build

__all__ = ["build"]
