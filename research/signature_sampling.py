"""χ² of motifs drawn from the signature of a genre to that signature, by the number of words.

    python research/signature_sampling.py [REPERTOIRE] [--words 80 120] [--draws 200]

Values are means over the genres of a repertoire (the built-in one by default), with a line for each number of
words.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import choreograph as cg
from choreograph.core.numerics import chi_square_distance
from choreograph.library.vocabulary import ALL_GENRES, signature


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("repertoire", type=Path, nargs="?")
    parser.add_argument("--words", type=int, nargs="+", default=[80, 120])
    parser.add_argument("--draws", type=int, default=200)
    given = parser.parse_args()
    repertoire = cg.Repertoire.open(given.repertoire) if given.repertoire else cg.starter_repertoire()
    vocabulary, rng = repertoire.vocabulary, np.random.default_rng(0)
    n_motifs = vocabulary.n_motifs
    for n_words in given.words:
        distances = []
        for genre, template in zip(vocabulary.genres, vocabulary.signatures, strict=True):
            if genre == ALL_GENRES:
                continue
            for _ in range(given.draws):
                drawn = rng.choice(n_motifs, size=n_words, p=template / template.sum())
                distances.append(chi_square_distance(signature(drawn, n_motifs), template))
        print(f"{n_words} words: {np.mean(distances):.3f}", flush=True)


if __name__ == "__main__":
    main()
