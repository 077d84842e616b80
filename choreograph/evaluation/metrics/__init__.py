"""Metrics of dances of any system.

Each module has a function for each metric and `evaluate` for all of them by name. Most have `validate`, which
checks the input. Functions take arrays. Their docstrings give units, range, and which direction is better.

A metric is one module and one line in `__init__.pyi`, under a heading of the reference. The page of the
reference is made from both.

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
