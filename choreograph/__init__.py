"""choreograph: makes dances for music from your own motion library, and explains every second of them.

- `dance` makes a `Dance` for a song: motion, plan and notes. `vary` makes several that differ
- `scene` makes a `Scene` of several `Dancer`s, and `render_scene_plan` makes it again from its `ScenePlan`
- `Session` holds a song and a repertoire in memory, from which dances are made again with other settings
- `build` makes a repertoire file from takes and their songs. `change_takes` adds takes to it and removes them
- `Repertoire` is an opened repertoire file. `starter_repertoire` and `example_songs` are built in
- `load_song` decodes a `Song` once for several dances
- `RolloutStream` makes a dance with the rollout network while the song plays
- `render` makes the motion of a `Plan`, edited or not
- `MotifPin`, `TakePin`, `Ban` and `Keep` are constraints on what is danced
- `motifs_of` and `signature_of` describe an existing dance
- `Cost`, `Layer` and `SongFeatures` are for costs of your own
- `read_character` reads a character for `Dance.save("a.glb", character=...)`
- `Motion`, `Skeleton`, `Take` and `Counts` hold motion, its source and its counts
- `count_file` finds tempo, counts and loop points of an animation or a song
- `load_motion` and `save_motion` read and write motions in all formats
- `evaluate` scores a dance of any system to a song
- `metrics` has beat alignment, Fréchet distances, FID, foot slide and others
- `ChoreographError` and its subclasses are the errors that a caller can cause

Examples
--------
>>> cg.__version__
'0.1.0'
"""

import lazy_loader

# Modules are imported when first used, so that `choreograph --help` does not wait for numba and torch. The
# stub `__init__.pyi` lists the module of each name, for this line, type checkers and editors.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
