"""Motifs to motion, the other way to dance beside the graph (Rhythm is a Dancer).

- `mixer` — the words of takes that dance a sequence of motifs best
- `word_bank` — what the mixer looks at: words' borders, and how surely a word is its motif
"""
