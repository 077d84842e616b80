"""Metrics of dances: in each module `validate`, one function per metric, and `evaluate` for all by name.

Music and dance

- `counts` — a dance's counts against the song's beats, count 1 against its downbeats, drift, chance levels
- `beat` — motion beats against music beats: F-score, beat alignment, distances, chance levels
- `motion_beat_detectors` — five ways to detect motion beats, and the F-score by each
- `count_phase` — where in the count motion beats lie, against experts of the genre
- `energy_response` — whether the dance is bigger where the song is louder, section by section
- `labels` — distances between paired labels of dance and music (openness, intensity, rhythm, asymmetry)
- `structure` — motif signatures and transitions, repeats, agreement with the sections of the song
- `transitions` — how often takes change, and whether at borders of bars and figures

Realism

- `fid` — FID_k, FID_g and diversity of kinetic and geometric features
- `frechet` — Fréchet distance of Gaussians; FPD of poses and FMD of movements
- `references` — halves of the real data and chance dances, to read distances by

Physics

- `physical` — foot sliding, floor penetration, floating, jerk and speed at transitions, bone lengths
- `endings` — speed at the first and last pose, and when the last one is held
- `contact_scores` — PFC and foot skating ratio as published, and corrected
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
