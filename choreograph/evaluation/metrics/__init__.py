"""Metrics of dances of any system.

Each module has a function for each metric and `evaluate` for all of them by name. Most have `validate`, which
checks the input. Functions take arrays. Their docstrings give units, range, and which direction is better.

Music and dance

- `counts` — a dance's counts against the song's beats, count 1 against its downbeats, drift, chance levels
- `beat` — motion beats against music beats: F-score, beat alignment, distances, chance levels
- `motion_beat_detectors` — five ways to detect motion beats, and the F-score by each
- `count_phase` — where in the count motion beats lie, against experts of the genre
- `energy_response` — whether the dance is bigger where the song is louder, section by section
- `labels` — distances between paired labels of dance and music (openness, intensity, rhythm, asymmetry)
- `structure` — motif signatures and transitions, repeats, agreement with the sections of the song
- `phrase_returns` — whether the dance returns with the phrases of its song, and differs between them
- `transitions` — how often takes change, and whether at borders of bars and figures
- `requests` — whether a requested genre is danced, at its tempi, and whether dances differ with another seed

Scenes

- `scene` — how near bodies come to each other, and how long one is hidden by others

Realism

- `fid` — FID_k, FID_g and diversity of kinetic and geometric features
- `frechet` — Fréchet distance of Gaussians, FPD of poses and FMD of movements, with their floor and ceiling

Physics

- `physical` — foot sliding, floor penetration, floating, jerk and speed at transitions, bone lengths
- `endings` — speed at the first and last pose, whether they freeze, and when the last one is held
- `front` — how long a dancer shows the back to the audience, and whether the last pose faces it
- `contact_scores` — PFC and foot skating ratio as published, and corrected

Examples
--------
>>> music_s = np.array([0.5, 1.0, 1.5, 2.0])
>>> cg.metrics.beat.f_score(music_s + 0.03, music_s)  # motion beats 30 ms after the music
1.0
>>> cg.metrics.counts.counts_within(music_s + 0.25, music_s)  # counts between the beats
0.0
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
