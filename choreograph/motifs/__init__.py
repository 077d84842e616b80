"""Global structure of a dance (Rhythm is a Dancer): words, motifs, signatures, choreography.

- `words` — a dance cut on its beats into motion words
- `clustering` — the motifs of embedded words (`nets.words` embeds them)
- `signatures` — motif histograms, a genre's template, their distance, what follows what
- `choreography` — which motif comes when, drawn for a signature, around pins
"""
