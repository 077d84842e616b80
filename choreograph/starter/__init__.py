"""The built-in repertoire, its songs, and the recipe that makes them.

- `library` — the shipped repertoire and songs, opened
- `takes` — what its takes are: dances and songs of `choreograph.synthesis`, with their true counts
- `recipe` — renders the takes, trains the networks and writes the shipped file (`choreograph build-starter`)
"""

from choreograph.starter.library import SONGS_PATH, STARTER_PATH, example_songs, starter_repertoire

__all__ = ["SONGS_PATH", "STARTER_PATH", "example_songs", "starter_repertoire"]
