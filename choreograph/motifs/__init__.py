"""Global structure of a dance (Rhythm is a Dancer): words, motifs, signatures, choreography.

- `words` — a dance segmented on its beats into motion words
- `clustering` — motifs: clusters of embedded words (`nets.words` embeds them)
- `vocabulary` — the motifs, words and genres of a repertoire
- `signatures` — motif histograms, a genre's template, motif transition probabilities
- `templates` — distances of takes to their genre's template
- `goals` — the signature and transitions that a dance should have
- `choreography` — sequences of motifs drawn for a signature, around pins
- `span_motifs` — the motif of any span of a take
"""
