"""The built-in repertoire, its songs, and the recipe that makes them.

- `library` — opens the shipped repertoire and lists the shipped songs
- `takes` — the takes of the repertoire: dances and songs of `choreograph.synthesis`, with their true counts
- `recipe` — renders the takes, trains the networks and writes `starter.h5` (`choreograph build-starter`)
- `song_recipe` — renders the shipped songs (`python -m choreograph.starter.song_recipe`)
"""

from choreograph.starter.library import SONGS_PATH, STARTER_PATH, example_songs, starter_repertoire

__all__ = ["SONGS_PATH", "STARTER_PATH", "example_songs", "starter_repertoire"]
