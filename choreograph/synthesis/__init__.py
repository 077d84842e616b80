"""Generators of dances and songs whose beats, bars and counts are known exactly.

- `moves` — a dance notation (steps and poses on counts), genres written in it, and their rendering as motion
- `songs` — a composer and synthesiser of songs in these genres

The built-in repertoire (`choreograph.starter`) is made with them; tests, benchmarks and training use them as
material with ground truth. Dancing imports nothing from here.
"""
