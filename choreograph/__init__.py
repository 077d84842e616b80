"""choreograph: makes dances for music from your own motion library, and explains every second of them.

- `dance` — a song to a `Dance`: motion, plan, notes; `vary` makes several that differ
- `build` — takes and their songs to a repertoire file
- `Repertoire` — an opened repertoire file; `starter_repertoire`, `example_songs` — the built-in ones
- `load_song` — a `Song`, decoded once for several dances
- `RolloutStream` — a dance of the rollout network frame by frame, while its song plays
- `render` — the motion of a (perhaps edited) `Plan`
- `MotifPin`, `TakePin`, `Ban` — constraints: what must be danced, and what must not
- `motifs_of`, `signature_of` — of an existing dance, to be danced again
- `Cost`, `Layer`, `SongFeatures` — for costs of your own
- `read_character` — a character of yours, to dance in `Dance.save("a.glb", character=…)`
- `Motion`, `Skeleton`, `Take`, `Counts` — motion, where it comes from, and its counts
- `load_motion`, `save_motion` — a motion from a file and to a file, in every format that is known
- `evaluate` — all scores of one dance, of any system, to a song
- `metrics` — beat alignment, Fréchet distances, FID, foot slide, ... of any dance
- `ChoreographError` and its kinds — every error that a caller can cause
"""

import lazy_loader

# Imported when first used, so that `choreograph --help` does not wait for numba and torch. The stub
# `__init__.pyi` says what is where, to this line, to type checkers and to editors.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
