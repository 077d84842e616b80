"""Dances and songs made by program, whose beats, bars and counts are known exactly.

- `moves` — the language of steps and poses that dances are written in, and the genres
- `songs` — the synthesiser of their music

The built-in repertoire is made of them, and tests and benchmarks measure on them. Dancing imports
nothing from here.
"""
